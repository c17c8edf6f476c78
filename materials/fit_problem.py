"""One minimisation of a fit: the parameters as a vector, its bounds, the solver, and how sure the answer is."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .kernels import brdf_fit as kernel
from .kernels.kinds import COOK_TORRANCE, GGX, PHONG, WARD
from .kernels.lobe_gradients import HALF_VECTOR

Floats = NDArray[np.float64]
KINDS = {"phong": PHONG, "ward": WARD, "ct": COOK_TORRANCE, "ggx": GGX, "half_vector": HALF_VECTOR}
_MAX_EVALUATIONS = 400


@dataclass(frozen=True)
class Problem:
    """Samples of one texel and the model that shall meet them.

    The vector x holds diffuse (C), specular (L C), alpha (L 2), and three angles that turn the base frame: by the first about
    its y, by the second about its x (the normal), by the third about its z (the tangent).
    """

    wi: Floats
    wo: Floats
    value: Floats
    kind: int
    f0: float
    base: Floats
    lobes: int
    loss_scale: float

    @property
    def channels(self) -> int:
        """Number of channels C."""
        return self.value.shape[1]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.channels * (1 + self.lobes) + 2 * self.lobes + 3

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return diffuse (C,), specular (L, C), alpha (L, 2) and the angles (3,); Phong's width counts both ways."""
        c, lobes = self.channels, self.lobes
        alpha = x[c * (1 + lobes) : -3].reshape(lobes, 2)
        if self.kind == PHONG:
            alpha = np.repeat(alpha[:, :1], 2, axis=1)
        return x[:c], x[c : c * (1 + lobes)].reshape(lobes, c), alpha, x[-3:]

    def frame(self, x: Floats) -> Floats:
        """Return the frame (3, 3): columns tangent, bitangent, normal."""
        return self.base @ _turn(*x[-3:])[0]

    def cost(self, x: Floats, gradient: Floats) -> float:
        """Return the cost; fill `gradient` if it is not empty."""
        diffuse, specular, alpha, angles = self.split(x)
        turn, by_angle = _turn(*angles)
        gd, gs, ga, gf = np.empty(self.channels), np.empty(specular.shape), np.empty((self.lobes, 2)), np.empty((3, 3))
        arrays = (diffuse, specular, np.ascontiguousarray(alpha), self.loss_scale, gd, gs, ga, gf)
        value = kernel.cost(self.wi, self.wo, self.value, self.kind, self.f0, self.base @ turn, *arrays)
        if gradient.size:
            angle = [float(np.sum(gf * (self.base @ d))) for d in by_angle]
            gradient[:] = np.concatenate([gd, gs.ravel(), ga.ravel(), angle])
        return float(value)

    def bounds(
        self, alphas: list[tuple[float, float]], tilt: float = 0.0, diffuse: tuple[Floats, Floats] | None = None
    ) -> tuple[Floats, Floats]:
        """Return lower and upper bounds: widths per lobe, the normal's tilt [rad] (0 holds it), the diffuse albedo."""
        low, high = np.zeros(self.size), np.full(self.size, np.inf)
        c = self.channels
        if diffuse is not None:
            low[:c], high[:c] = diffuse
        for k, (a, b) in enumerate(alphas):
            at = c * (1 + self.lobes) + 2 * k
            low[at : at + 2], high[at : at + 2] = a, b
        # A quarter turn either way: the lobe is symmetric under half a turn, so all tangents are reached.
        turn = 0.0 if self.kind == PHONG else math.pi / 2
        low[-3:], high[-3:] = (-tilt, -tilt, -turn), (tilt, tilt, turn)
        return low, high

    def minimise(self, start: Floats, bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
        """Return the minimum that sequential quadratic programming reaches from `start`, and its cost."""
        import nlopt

        low, high = bounds
        x = np.clip(start, low, high)
        # Reflectances and widths to one size, so that one step length fits all; a unit cost lets one tolerance serve.
        level = max(float(np.mean(self.value)) * math.pi, 1e-9)
        scale = np.ones(self.size)
        scale[: self.channels * (1 + self.lobes)] = level
        unit = max(self.cost(x, np.empty(0)), 1e-300)
        best = [x, unit]

        def scaled(y: Floats, gradient: Floats) -> float:
            at = np.clip(y * scale, low, high)
            value = self.cost(at, gradient)
            if gradient.size:
                gradient *= scale / unit
            if value < best[1]:
                best[:] = [at, value]
            return value / unit

        solver = nlopt.opt(nlopt.LD_SLSQP, self.size)
        solver.set_min_objective(scaled)
        solver.set_lower_bounds(low / scale)
        solver.set_upper_bounds(high / scale)
        solver.set_ftol_rel(1e-7)
        solver.set_xtol_rel(1e-6)
        solver.set_maxeval(_MAX_EVALUATIONS)
        # Raised at the floor of float64, or with no descent left: the best point seen stands.
        with suppress(nlopt.RoundoffLimited, RuntimeError):
            solver.optimize(x / scale)
        return best[0], best[1]

    def statistics(self, x: Floats, bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
        """Return the covariance of the parameters but the tilt (White's sandwich), and the relative variance."""
        diffuse, specular, alpha, angles = self.split(x)
        turn, by_angle = _turn(*angles)
        factor, t = kernel.terms(self.wi, self.wo, self.kind, self.f0, self.base @ turn, np.ascontiguousarray(alpha))
        weight = self.wi[:, 2] * self.wo[:, 2]
        n, c, lobes = len(weight), self.channels, self.lobes
        jacobian = np.zeros((n, c, self.size))
        by_turn = self.base @ by_angle[2]
        slope = np.einsum("nka,na->nk", t[:, :, 3:6], self.wi @ by_turn) + np.einsum("nka,na->nk", t[:, :, 6:9], self.wo @ by_turn)
        scaled = (factor * weight)[:, None]
        for q in range(c):
            jacobian[:, q, q] = scaled[:, 0] / math.pi
            for k in range(lobes):
                jacobian[:, q, c * (1 + k) + q] = scaled[:, 0] * t[:, k, 0]
                at = c * (1 + lobes) + 2 * k
                jacobian[:, q, at : at + 2] = scaled * specular[k, q] * t[:, k, 1:3]
            jacobian[:, q, -1] = scaled[:, 0] * (slope @ specular[:, q])
        model = factor[:, None] * (diffuse / math.pi + t[:, :, 0] @ specular)
        residual = weight[:, None] * (model - self.value)
        relative = float(np.mean(residual**2) / max(np.mean((weight[:, None] * self.value) ** 2), 1e-300))
        if self.kind == PHONG:
            jacobian[:, :, c * (1 + lobes) + 1 : -3 : 2] = 0  # the second width is the first
        low, high = bounds
        j = jacobian.reshape(n * c, self.size)
        edge = 1e-6 * (1 + np.abs(x))
        free = (x > low + edge) & (x < high - edge) & (np.abs(j).max(axis=0) > 1e-12)
        free[-3:-1] = False
        covariance = np.zeros((self.size, self.size))
        j = j[:, free]
        scale = np.linalg.norm(j, axis=0)
        inverse = np.linalg.pinv((j / scale).T @ (j / scale), rcond=1e-12) / np.outer(scale, scale)
        pulled = j * residual.reshape(-1, 1)
        covariance[np.ix_(free, free)] = inverse @ (pulled.T @ pulled) @ inverse
        return np.delete(np.delete(covariance, (-3, -2), 0), (-3, -2), 1), relative


def initial_guess(problem: Problem, alphas: tuple[tuple[float, float], ...], angles: tuple[float, float, float]) -> Floats:
    """Return the vector whose albedo and scales solve plain least squares at given widths, negative ones set to 0."""
    alpha = np.array(alphas, np.float64)
    factor, t = kernel.terms(problem.wi, problem.wo, problem.kind, problem.f0, problem.base @ _turn(*angles)[0], alpha)
    weight = (problem.wi[:, 2] * problem.wo[:, 2])[:, None]
    design = weight * factor[:, None] * np.concatenate([np.full((len(factor), 1), 1 / math.pi), t[:, :, 0]], axis=1)
    solved, *_ = np.linalg.lstsq(design, weight * problem.value, rcond=None)
    # A scale of exactly 0 would leave its width without gradient.
    least = 1e-3 * max(float(problem.value.mean()), 1e-9)
    return np.concatenate([np.maximum(solved, least).ravel(), alpha.ravel(), angles])


def _turn(a: float, b: float, c: float) -> tuple[Floats, list[Floats]]:
    """Return R = Ry(a) Rx(b) Rz(c) and its derivatives by the three angles."""
    ca, sa, cb, sb, cc, sc = math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(c), math.sin(c)
    y, dy = np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]]), np.array([[-sa, 0, ca], [0, 0, 0], [-ca, 0, -sa]])
    x, dx = np.array([[1, 0, 0], [0, cb, -sb], [0, sb, cb]]), np.array([[0, 0, 0], [0, -sb, -cb], [0, cb, -sb]])
    z, dz = np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]]), np.array([[-sc, -cc, 0], [cc, -sc, 0], [0, 0, 0]])
    return y @ x @ z, [dy @ x @ z, y @ dx @ z, y @ x @ dz]
