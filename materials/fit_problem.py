"""One minimisation of a fit: the parameters as a vector, its bounds, the solver, and how sure the answer is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .kernels import brdf_fit as kernel
from .kernels import levenberg as solver
from .kernels.kinds import COOK_TORRANCE, GGX, PHONG, WARD
from .kernels.lobe_gradients import HALF_VECTOR

Floats = NDArray[np.float64]
KINDS = {"phong": PHONG, "ward": WARD, "ct": COOK_TORRANCE, "ggx": GGX, "half_vector": HALF_VECTOR}
_MAX_EVALUATIONS = 400
_ROUGH_SAMPLES = 1000
_ROUGH, _FINE = 1e-5, 1e-6
_SIGMA, _SIGMA_START = (0.0, math.pi / 2), 0.4


@dataclass(frozen=True)
class Problem:
    """Samples of one texel and the model that shall meet them.

    The vector x holds diffuse (C), specular (L C), alpha (L 2), of a rough base the spread sigma of its slopes, and three angles
    that turn the base frame: by the first about its y, by the second about its x (the normal), by the third about its z (the
    tangent).
    """

    wi: Floats
    wo: Floats
    value: Floats
    kind: int
    f0: float
    base: Floats
    lobes: int
    loss_scale: float
    isotropic: bool = False
    rough_base: bool = False
    """Whether the matte part is Oren and Nayar's, of fitted sigma; else Lambert's."""

    @property
    def channels(self) -> int:
        """Number of channels C."""
        return self.value.shape[1]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.after_widths + self.rough_base + 3

    @property
    def first_width(self) -> int:
        """Place of the first width in x."""
        return self.channels * (1 + self.lobes)

    @property
    def after_widths(self) -> int:
        """Place in x of what follows the widths: sigma, or the angles."""
        return self.first_width + 2 * self.lobes

    @property
    def tied(self) -> bool:
        """Whether a lobe's two widths are one: Phong's always, others' on isotropic surfaces."""
        return self.isotropic or self.kind == PHONG

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return diffuse (C,), specular (L, C), alpha (L, 2) and the angles (3,); a tied width counts both ways."""
        c, lobes = self.channels, self.lobes
        alpha = x[self.first_width : self.after_widths].reshape(lobes, 2)
        if self.tied:
            alpha = np.repeat(alpha[:, :1], 2, axis=1)
        return x[:c], x[c : self.first_width].reshape(lobes, c), alpha, x[-3:]

    def sigma(self, x: Floats) -> float:
        """Return the spread of the base's slopes [rad]; 0 is Lambert's."""
        return float(x[-4]) if self.rough_base else 0.0

    def frame(self, x: Floats) -> Floats:
        """Return the frame (3, 3): columns tangent, bitangent, normal."""
        return solver.turned(self.base, *x[-3:])[0]

    def cost(self, x: Floats, gradient: Floats) -> float:
        """Return the cost; fill `gradient` if it is not empty."""
        diffuse, specular, alpha, angles = self.split(x)
        frame, by_angle = solver.turned(self.base, *angles)
        gd, gs, ga, gf = np.empty(self.channels), np.empty(specular.shape), np.empty((self.lobes, 2)), np.empty((3, 3))
        by_sigma = np.empty(1)
        given = (diffuse, specular, np.ascontiguousarray(alpha), self.sigma(x), self.loss_scale)
        arrays = (*given, gd, gs, ga, by_sigma, gf)
        value = kernel.cost(self.wi, self.wo, self.value, self.kind, self.f0, frame, *arrays)
        if gradient.size:
            if self.tied:
                ga = np.stack([ga.sum(axis=1), np.zeros(self.lobes)], axis=1)
            angle = [float(np.sum(gf * d)) for d in by_angle]
            gradient[:] = np.concatenate([gd, gs.ravel(), ga.ravel(), by_sigma if self.rough_base else (), angle])
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
            at = self.first_width + 2 * k
            low[at : at + 2], high[at : at + 2] = a, b
        if self.rough_base:
            low[-4], high[-4] = _SIGMA
        # A quarter turn either way: the lobe is symmetric under half a turn, so all tangents are reached.
        turn = 0.0 if self.tied else math.pi / 2
        low[-3:], high[-3:] = (-tilt, -tilt, -turn), (tilt, tilt, turn)
        return low, high

    def start(self, alphas: Sequence[float]) -> Floats:
        """Return where to begin: round lobes of these widths, albedo and scales by least squares, the best tangent.

        Of sigma one start will do: albedo x A and albedo x B enter f linearly, and B / A rises with sigma throughout.
        """
        x = np.zeros(self.size)
        x[self.first_width : self.after_widths] = np.repeat(alphas, 2)
        if self.rough_base:
            x[-4] = _SIGMA_START
        solver.start_linear(*self._given, x, self.lobes, self.loss_scale, self.stride)
        if not self.tied:
            solver.start_tangent(*self._given, x, self.lobes, self.loss_scale, self.stride)
        return x

    def minimise(self, starts: Sequence[Floats], bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
        """Return the lowest minimum that Levenberg and Marquardt's method reaches from the starts, and its cost.

        Where there are many samples an even part of them tells the starts apart and brings the best one near; few steps with
        all samples remain.
        """
        low, high = bounds[0].copy(), bounds[1].copy()
        if high[-1] > low[-1]:
            low[-1], high[-1] = -np.inf, np.inf  # half a turn changes nothing: no wall may stop the tangent on its way
        best, least = starts[0], math.inf
        for start in starts:
            x = start.copy()
            value = self._descend(x, low, high, self.stride, _ROUGH)
            if value < least:
                best, least = x, value
        least = self._descend(best, low, high, 1, _FINE)
        return self._canonical(best, bounds), float(least)

    def minimise_slsqp(self, start: Floats, bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
        """Return the minimum that NLopt's sequential quadratic programming reaches from `start`, and its cost."""
        import nlopt

        low, high = bounds
        x = np.clip(start, low, high)
        # Reflectances and widths to one size, so that one step length fits all; a unit cost lets one tolerance serve.
        level = max(float(np.mean(self.value)) * math.pi, 1e-9)
        scale = np.ones(self.size)
        scale[: self.first_width] = level
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

        optimiser = nlopt.opt(nlopt.LD_SLSQP, self.size)
        optimiser.set_min_objective(scaled)
        optimiser.set_lower_bounds(low / scale)
        optimiser.set_upper_bounds(high / scale)
        optimiser.set_ftol_rel(1e-7)
        optimiser.set_xtol_rel(1e-6)
        optimiser.set_maxeval(_MAX_EVALUATIONS)
        # Raised at the floor of float64, or with no descent left: the best point seen stands.
        with suppress(nlopt.RoundoffLimited, RuntimeError):
            optimiser.optimize(x / scale)
        return self._canonical(best[0], bounds), best[1]

    def statistics(self, x: Floats, bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
        """Return the covariance of the parameters but the tilt (White's sandwich), and the relative variance."""
        diffuse, specular, alpha, _ = self.split(x)
        hessian, gradient, meat = np.empty((self.size, self.size)), np.empty(self.size), np.empty((self.size, self.size))
        solver.normal_equations(*self._given, x, self.lobes, self.loss_scale, 1, hessian, gradient, meat)
        arrays = (self.frame(x), diffuse, specular, np.ascontiguousarray(alpha), self.sigma(x))
        residual, level = kernel.misfit(self.wi, self.wo, self.value, self.kind, self.f0, *arrays)
        low, high = bounds
        edge = 1e-6 * (1 + np.abs(x))
        diagonal = np.diag(hessian)
        free = (x > low + edge) & (x < high - edge) & (diagonal > 1e-24)
        free[-1] = high[-1] > low[-1] and diagonal[-1] > 1e-24
        free[-3:-1] = False
        covariance = np.zeros((self.size, self.size))
        scale = 1 / np.sqrt(diagonal[free])
        inverse = np.linalg.pinv(hessian[np.ix_(free, free)] * np.outer(scale, scale), rcond=1e-12) * np.outer(scale, scale)
        covariance[np.ix_(free, free)] = inverse @ meat[np.ix_(free, free)] @ inverse
        return np.delete(np.delete(covariance, (-3, -2), 0), (-3, -2), 1), residual / max(level, 1e-300)

    def _descend(self, x: Floats, low: Floats, high: Floats, stride: int, tolerance: float) -> float:
        limits = (low, high, self.lobes, self.loss_scale, stride, tolerance, _MAX_EVALUATIONS)
        return float(solver.minimise(*self._given, x, *limits)[0])

    @property
    def stride(self) -> int:
        """Every which sample the rough part of a minimisation looks at; odd, so as to pass through all rows of a grid."""
        return max(len(self.wi) // _ROUGH_SAMPLES, 1) | 1

    @property
    def _given(self) -> tuple[Floats, Floats, Floats, int, float, bool, Floats]:
        return self.wi, self.wo, self.value, self.kind, self.f0, self.tied, self.base

    def _canonical(self, x: Floats, bounds: tuple[Floats, Floats]) -> Floats:
        """Return the same lobes with the tangent within an eighth of a turn: a quarter turn swaps the widths."""
        x = x.copy()
        if bounds[1][-1] > bounds[0][-1]:
            quarters = round(x[-1] / (math.pi / 2))
            x[-1] -= quarters * math.pi / 2
            if quarters % 2:
                widths = slice(self.first_width, self.after_widths)
                x[widths] = x[widths].reshape(-1, 2)[:, ::-1].ravel()
        return x
