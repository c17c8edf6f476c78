"""Flow by minimising an energy, coarse to fine: Horn-Schunck's quadratic one and the robust one of Brox and Papenberg.

    E(w) = sum over pixels of  psi(|I1(x + w) - I0(x)|²) + gamma psi(|grad I1(x + w) - grad I0(x)|²) + alpha psi(|grad w|²)

with psi(s²) = s² (Horn and Schunck) or sqrt(s² + epsilon²) (Charbonnier). The data terms are not linearised in w: each
step warps I1 by the flow so far, linearises about it, and solves for an increment. A step that would raise E itself is
halved until it does not, so E falls monotonically on each level of the pyramid. What comes from outside the picture has no
data term.

References
----------
`horn1981`, `meinhardt2013` (the multi-scale nonlinear Horn-Schunck that the thesis used), `brox2004`, `papenberg2006` in
docs/references.bib.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.settings import check_settings, setting

from ..kernels import variational as kernel
from .pictures import grey_pair

Image = NDArray[np.float64]


@dataclass(frozen=True)
class VariationalSettings:
    """Parameters of the energy and of its minimisation; intensities are on the scale of 8 bits."""

    alpha: float = setting(100.0, "weight of smoothness", within="(0, inf)")
    gamma: float = setting(0.0, "weight of the constancy of gradients", within="[0, inf)")
    robust: bool = setting(False, "Charbonnier penalisers on data and smoothness instead of squares")
    epsilon_data: float = setting(0.5, "where the data's penaliser turns from square to linear [grey levels]", within="(0, inf)")
    epsilon_flow: float = setting(0.001, "where that of smoothness does", within="(0, inf)")
    levels: int = setting(5, "levels of the pyramid, each half as large as the one below (thesis: 5)", within="[1, 16]")
    warps: int = setting(10, "steps per level", within="[1, 1000]")
    inner: int = setting(1, "updates of the robust weights per step", within="[1, 100]")
    rounds: int = setting(8, "times that neighbouring strips of rows exchange their values, per update", within="[1, 10000]")
    sweeps: int = setting(4, "relaxations of each strip between", within="[1, 1000]")
    omega: float = setting(1.9, "over-relaxation", within="(0, 2)")
    presmoothing: float = setting(0.8, "sigma of the Gaussian on the pictures [px]", within="[0, 10]")
    tolerance: float = setting(0.002, "a level ends when a step moves less than this on average [px]", within="[0, 1]")

    def __post_init__(self) -> None:
        check_settings(self)


# Chosen among a handful of values by the error on Middlebury's RubberWhale; gamma 0 is the intensity-only data term of the thesis.
HORN_SCHUNCK = VariationalSettings(alpha=60.0)
PAPENBERG = VariationalSettings(alpha=5.0, robust=True, inner=3, rounds=3)
BROX = VariationalSettings(alpha=40.0, gamma=8.0, epsilon_data=0.1, robust=True, inner=3, rounds=3)


@dataclass(frozen=True)
class Step:
    """One step of the minimisation: its level (0 is full size), the energy before and after, and the share taken of it."""

    level: int
    before: float
    after: float
    share: float


def estimate(
    image0: NDArray, image1: NDArray, settings: VariationalSettings = HORN_SCHUNCK, steps: list[Step] | None = None
) -> NDArray[np.float32]:
    """Return the flow from one picture to the next.

    Parameters
    ----------
    image0, image1 : (H, W) or (H, W, 3)
        8 or 16 bits, or linear floats of any range.
    settings : VariationalSettings
    steps : list, optional
        Gets a `Step` for each step.

    Returns
    -------
    flow : (H, W, 2) float32
        [px]

    Raises
    ------
    InputError
        If sizes differ or the pictures cannot be used.
    """
    pair = [_blurred(image, settings.presmoothing) for image in grey_pair(image0, image1)]
    pyramid = [pair]
    while len(pyramid) < settings.levels and min(pyramid[-1][0].shape) >= 24:
        pyramid.append([_halved(image) for image in pyramid[-1]])
    u = np.zeros(pyramid[-1][0].shape)
    v = np.zeros_like(u)
    for level in reversed(range(len(pyramid))):
        first, second = pyramid[level]
        u, v = (_resized(c, first.shape) * (first.shape[axis] / c.shape[axis]) for c, axis in ((u, 1), (v, 0)))
        u, v = _minimise(first, second, u, v, settings, level, steps)
    return np.dstack([u, v]).astype(np.float32)


def _minimise(
    first: Image, second: Image, u: Image, v: Image, s: VariationalSettings, level: int, steps: list[Step] | None
) -> tuple[Image, Image]:
    """Return the flow that lowers the energy at one level, starting from (u, v)."""
    target = _targets(first, s.gamma)
    stack = _derivatives(second, s.gamma)
    used = len(target)
    m11, m12, m22 = np.empty_like(u), np.empty_like(u), np.empty_like(u)
    # Who comes from outside the picture is settled at the start of a level, so that one energy is minimised throughout it.
    inside = _sampled(stack, u, v)[1]
    for _ in range(s.warps):
        moved, _ = _sampled(stack, u, v)
        residual = moved[:used] - target
        gradient = _gradients(moved, s.gamma)
        before = _energy(residual, inside, u, v, s)
        du, dv = np.zeros_like(u), np.zeros_like(v)
        for _ in range(s.inner):
            linear = residual + gradient[0] * du + gradient[1] * dv
            weights = _data_weights(linear, inside, s)
            right, below = _edge_weights(u + du, v + dv, s)
            d11, d12, d22 = ((weights * gradient[a] * gradient[b]).sum(axis=0) for a, b in ((0, 0), (0, 1), (1, 1)))
            b1, b2 = (-(weights * gradient[a] * residual).sum(axis=0) for a in (0, 1))
            kernel.invert(d11, d12, d22, right, below, m11, m12, m22)
            kernel.relax(m11, m12, m22, b1, b2, right, below, u, v, du, dv, s.omega, s.sweeps, s.rounds)
        share, after = 1.0, np.inf
        while share > 0.05:
            there, _ = _sampled(stack[:used], u + share * du, v + share * dv)
            after = _energy(there - target, inside, u + share * du, v + share * dv, s)
            if after <= before:
                break
            share /= 2
        if after > before:
            break
        if steps is not None:
            steps.append(Step(level, before, after, share))
        u, v = u + share * du, v + share * dv
        if share * float(np.hypot(du, dv).mean()) < s.tolerance:
            break
    return u, v


def _targets(image: Image, gamma: float) -> Image:
    """Return what must stay constant along the motion, (C, H, W): the intensity, and its gradient."""
    return np.stack([image, *(_derivative(image, axis) for axis in (1, 0))]) if gamma > 0 else image[None]


def _derivatives(image: Image, gamma: float) -> Image:
    """Return the picture, its first and, where gradients count, its second derivatives."""
    x, y = _derivative(image, 1), _derivative(image, 0)
    if gamma == 0:
        return np.stack([image, x, y])
    return np.stack([image, x, y, _derivative(x, 1), _derivative(x, 0), _derivative(y, 0)])


def _gradients(moved: Image, gamma: float) -> tuple[Image, Image]:
    """Return d/dx and d/dy of each constancy (C, H, W)."""
    if gamma == 0:
        return moved[1:2], moved[2:3]
    return moved[[1, 3, 4]], moved[[2, 4, 5]]


def _energy(residual: Image, inside: NDArray[np.bool_], u: Image, v: Image, s: VariationalSettings) -> float:
    """Return E; what came from outside the picture has no data term."""
    data = _penalty(residual[0] ** 2, s.epsilon_data, s.robust)
    if s.gamma > 0:
        data = data + s.gamma * _penalty(residual[1] ** 2 + residual[2] ** 2, s.epsilon_data, s.robust)
    return float((data * inside).sum() + s.alpha * _penalty(_roughness(u, v), s.epsilon_flow, s.robust).sum())


def _data_weights(linear: Image, inside: NDArray[np.bool_], s: VariationalSettings) -> Image:
    """Return psi' of each constancy (C, H, W); that of the gradient is common to its two components."""
    weights = np.empty_like(linear)
    weights[0] = _slope(linear[0] ** 2, s.epsilon_data, s.robust)
    if s.gamma > 0:
        weights[1:] = s.gamma * _slope(linear[1] ** 2 + linear[2] ** 2, s.epsilon_data, s.robust)
    return weights * inside


def _edge_weights(u: Image, v: Image, s: VariationalSettings) -> tuple[Image, Image]:
    """Return the weights of the edges to the next column and row: those of the pixel whose forward difference they are."""
    weight = s.alpha * _slope(_roughness(u, v), s.epsilon_flow, s.robust)
    return weight, weight


def _roughness(u: Image, v: Image) -> Image:
    """Return |grad u|² + |grad v|² by forward differences; beyond the border the flow goes on unchanged."""
    total = np.zeros_like(u)
    for c in (u, v):
        total[:, :-1] += np.diff(c, axis=1) ** 2
        total[:-1] += np.diff(c, axis=0) ** 2
    return total


def _penalty(square: Image, epsilon: float, robust: bool) -> Image:
    return np.sqrt(square + epsilon * epsilon) if robust else square


def _slope(square: Image, epsilon: float, robust: bool) -> Image:
    return 0.5 / np.sqrt(square + epsilon * epsilon) if robust else np.ones_like(square)


def _sampled(stack: Image, u: Image, v: Image) -> tuple[Image, NDArray[np.bool_]]:
    out, inside = np.empty_like(stack), np.empty(u.shape, np.bool_)
    kernel.sample(np.ascontiguousarray(stack), u, v, out, inside)
    return out, inside


def _derivative(image: Image, axis: int) -> Image:
    """Return the central difference of fourth order, with the border repeated."""
    taps = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12
    kernel_2d = taps[None] if axis == 1 else taps[:, None]
    return np.asarray(cv2.filter2D(image, cv2.CV_64F, kernel_2d, borderType=cv2.BORDER_REPLICATE), np.float64)


def _blurred(image: Image, sigma: float) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE), np.float64) if sigma > 0 else image


def _halved(image: Image) -> Image:
    """Return the picture at half its size, rounded up; the blur is that of Meinhardt-Llopis et al. (2013), eq 14."""
    height, width = image.shape
    blurred = _blurred(image, 0.6 * np.sqrt(2.0**2 - 1))
    return _resized(blurred, ((height + 1) // 2, (width + 1) // 2))


def _resized(image: Image, shape: tuple[int, ...]) -> Image:
    return np.asarray(cv2.resize(image, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), np.float64)
