"""How far a flow field is from the truth: end-point and angular error, outliers, WAUC, by region; and from another field.

Every measure has its definition in `DEFINITIONS`, which reports print beside the numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.flow_files import Flow

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

DEFINITIONS = {
    "pixels": "pixels that count: truth and estimate known, inside the region",
    "density": "share of the region's pixels with known truth where the estimate is known too; all else is over these",
    "epe": "mean end-point error |(u, v) - (u_t, v_t)| [px]",
    "epe_sd": "standard deviation of the end-point error over the pixels [px]",
    "epe_median": "median end-point error [px]",
    "angular_error": "mean angle between (u, v, 1) and (u_t, v_t, 1) [degrees] (Barron et al. 1994)",
    "fl_all": "share of pixels whose end-point error exceeds both 3 px and 5 % of the true length (KITTI 2015)",
    "over_1px": "share of pixels with an end-point error above 1 px",
    "over_3px": "share of pixels with an end-point error above 3 px",
    "over_5px": "share of pixels with an end-point error above 5 px",
    "wauc": "weighted area under the curve of inliers over thresholds of 0.05 to 5 px, weights falling from 1 to 0.01; 1 is best "
    "(Richter et al. 2017)",
    "within_1_sigma": "share of pixels whose end-point error is at most the truth's stated uncertainty (HD1K)",
    "within_3_sigma": "share of pixels whose end-point error is at most three times the truth's stated uncertainty (HD1K)",
    "epe_beyond_sigma": "mean of max(end-point error - uncertainty, 0): what the truth's uncertainty cannot excuse [px]",
    "dfe": "difference flow error |(u_a, v_a) - (u_b, v_b)| of two fields [px] (thesis eq 4.1), where both are known",
}
# Upper ends of the thesis's five classes (4.3.3) and what they mean; the last class is open and starts at 1 px itself.
DFE_BOUNDS = (0.05, 0.2, 0.5, 1.0)
DFE_CLASSES = (
    "≤ 0.05 px: virtually identical",
    "0.05 to 0.2 px: within the accuracy of the algorithm",
    "0.2 to 0.5 px: within the accuracy of the scene",
    "0.5 to 1 px: medium error",
    "≥ 1 px: large error",
)


@dataclass(frozen=True)
class Score:
    """The measures of `DEFINITIONS` over a region; all but `pixels` are None where no pixel counts.

    The last three need uncertainties of the truth.
    """

    pixels: int
    density: float | None = None
    epe: float | None = None
    epe_sd: float | None = None
    epe_median: float | None = None
    angular_error: float | None = None
    fl_all: float | None = None
    over_1px: float | None = None
    over_3px: float | None = None
    over_5px: float | None = None
    wauc: float | None = None
    within_1_sigma: float | None = None
    within_3_sigma: float | None = None
    epe_beyond_sigma: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the measures by name, without those that do not apply."""
        return {f.name: v for f in fields(self) if (v := getattr(self, f.name)) is not None}


@dataclass(frozen=True)
class Difference:
    """How two flow fields differ (thesis 4.3.3).

    Attributes
    ----------
    pixels : int
    mean, sd, median : float
        Of the difference flow error [px]; 0 where no pixel counts.
    classes : tuple of 5 floats
        Share of pixels in each of `DFE_CLASSES`; they add up to 1.
    """

    pixels: int
    mean: float
    sd: float
    median: float
    classes: tuple[float, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values by name."""
        named = {f"class_{i + 1}": share for i, share in enumerate(self.classes)}
        return {"pixels": self.pixels, "dfe": self.mean, "dfe_sd": self.sd, "dfe_median": self.median, **named}


def endpoint_error(a: Flow, b: Flow) -> Floats:
    """Return |a - b| (H, W) [px]; NaN where either is unknown. With the truth as `b` it is the end-point error.

    Raises
    ------
    InputError
        If the sizes differ.
    """
    _check_sizes(a, b)
    difference = a.flow.astype(np.float64) - b.flow
    return np.hypot(difference[..., 0], difference[..., 1]).astype(np.float32)


def angular_error_deg(a: Flow, b: Flow) -> Floats:
    """Return the angle between (u, v, 1) of both (H, W) [degrees]; NaN where either is unknown.

    Raises
    ------
    InputError
        If the sizes differ.
    """
    _check_sizes(a, b)
    one = np.dstack([a.flow.astype(np.float64), np.ones(a.size)])
    two = np.dstack([b.flow.astype(np.float64), np.ones(b.size)])
    # The arctangent is exact for small angles, where the arccosine of the normalised product loses half the digits.
    sine = np.linalg.norm(np.cross(one, two), axis=-1)
    return np.degrees(np.arctan2(sine, (one * two).sum(axis=-1))).astype(np.float32)


def score(estimate: Flow, truth: Flow, region: Mask | None = None, sigma: Floats | None = None) -> Score:
    """Return all measures of an estimate over a region.

    Parameters
    ----------
    estimate, truth : Flow
    region : (H, W) bool, optional
        Which pixels count; by default all.
    sigma : (H, W) float, optional
        Standard deviation of the truth [px] (HD1K); pixels with 0 do not enter the measures that need it.

    Raises
    ------
    InputError
        If sizes differ.
    """
    error = endpoint_error(estimate, truth)
    asked = truth.valid if region is None else truth.valid & _fitting("region", region, truth)
    counted = asked & estimate.valid
    if not counted.any():
        return Score(0, 0.0 if asked.any() else None)
    e = error[counted].astype(np.float64)
    length = np.hypot(truth.flow[..., 0], truth.flow[..., 1])[counted]
    deviations: dict[str, float] = {}
    if sigma is not None:
        s = _fitting("sigma", sigma, truth)[counted].astype(np.float64)
        stated = s > 0
        if stated.any():
            e_s, s = e[stated], s[stated]
            deviations = {
                "within_1_sigma": float(np.mean(e_s <= s)),
                "within_3_sigma": float(np.mean(e_s <= 3 * s)),
                "epe_beyond_sigma": float(np.mean(np.maximum(e_s - s, 0))),
            }
    return Score(
        pixels=int(counted.sum()),
        density=float(counted.sum() / asked.sum()),
        epe=float(e.mean()),
        epe_sd=float(e.std()),
        epe_median=float(np.median(e)),
        angular_error=float(angular_error_deg(estimate, truth)[counted].mean(dtype=np.float64)),
        fl_all=float(np.mean((e > 3) & (e > 0.05 * length))),
        over_1px=float(np.mean(e > 1)),
        over_3px=float(np.mean(e > 3)),
        over_5px=float(np.mean(e > 5)),
        wauc=wauc(e),
        **deviations,
    )


def wauc(error: NDArray) -> float:
    """Return the weighted area under the curve of inliers, in [0, 1].

    The thresholds are i / 20 px for i = 1 … 100, with weights 1 - (i - 1) / 100.

    References
    ----------
    `richter2017` in docs/references.bib, section 5.3.
    """
    weights = 1 - np.arange(100) / 100
    # In how many of the thresholds an error lies: searchsorted finds the first that is not below it.
    first = np.searchsorted(np.arange(1, 101) / 20, error, side="left")
    gained = np.append(np.cumsum(weights[::-1])[::-1], 0.0)
    return float(gained[first].mean() / weights.sum())


def regions(visible: Mask | None = None, moving: Mask | None = None, others: Mapping[str, Mask] | None = None) -> dict[str, Mask]:
    """Return the named regions of a frame: `visible`, `occluded`, `moving`, `static`, and `others` as they are named.

    Parameters
    ----------
    visible : (H, W) bool, optional
        What the next frame sees too.
    moving : (H, W) bool, optional
        What moves by itself.
    """
    found: dict[str, Mask] = {}
    if visible is not None:
        found |= {"visible": visible, "occluded": ~visible}
    if moving is not None:
        found |= {"moving": moving, "static": ~moving}
    return found | dict(others or {})


def score_regions(estimate: Flow, truth: Flow, masks: Mapping[str, Mask], sigma: Floats | None = None) -> dict[str, Score]:
    """Return the score over `all` and over each mask; a frame may have no pixel of a region (`pixels` is 0 then)."""
    return {"all": score(estimate, truth, None, sigma)} | {n: score(estimate, truth, m, sigma) for n, m in masks.items()}


def pooled(scores: Sequence[Score]) -> Score:
    """Return the score of several frames: means over all their pixels (so each frame counts by its pixels).

    The median is that of the frames' medians, and the standard deviation the root of the mean of squared deviations from
    the common mean.
    """
    kept = [s for s in scores if s.pixels]
    if not kept:
        return Score(0, 0.0 if any(s.density is not None for s in scores) else None)
    weights = np.array([s.pixels for s in kept], float)

    def mean(name: str) -> float | None:
        values = [(w, getattr(s, name)) for w, s in zip(weights, kept) if getattr(s, name) is not None]
        return float(sum(w * v for w, v in values) / sum(w for w, _ in values)) if values else None

    asked = sum(s.pixels / s.density for s in kept if s.density)
    means = {f.name: mean(f.name) for f in fields(Score) if f.name not in ("pixels", "density", "epe_sd", "epe_median")}
    epe, spread = np.array([s.epe for s in kept]), np.array([s.epe_sd for s in kept])
    square = np.average(spread**2 + epe**2, weights=weights) - np.average(epe, weights=weights) ** 2
    median = float(np.median([s.epe_median for s in kept if s.epe_median is not None]))
    return Score(int(weights.sum()), float(weights.sum() / asked), epe_sd=float(max(square, 0) ** 0.5), epe_median=median, **means)


def difference(a: Flow, b: Flow, region: Mask | None = None) -> Difference:
    """Return the difference flow error of two fields and its five classes (thesis eq 4.1, section 4.3.3).

    Raises
    ------
    InputError
        If sizes differ, or no pixel is known in both and inside the region.
    """
    error = endpoint_error(a, b)
    counted = a.valid & b.valid if region is None else a.valid & b.valid & _fitting("region", region, a)
    if not counted.any():
        raise InputError("have pixels that are known in both fields and inside the region", got="none", key="the flow fields")
    return difference_of(error[counted])


def difference_of(error: NDArray) -> Difference:
    """Return the summary of difference flow errors (N,) [px]."""
    e = np.asarray(error, np.float64)
    # Classes are closed above, but for the last two: 1 px is a large error already.
    index = np.searchsorted(DFE_BOUNDS[:3], e, side="left") + (e >= DFE_BOUNDS[3])
    shares = np.bincount(index, minlength=5) / max(e.size, 1)
    return Difference(e.size, float(e.mean()), float(e.std()), float(np.median(e)), tuple(float(s) for s in shares))


def _check_sizes(a: Flow, b: Flow) -> None:
    if a.size != b.size:
        sizes = " and ".join(f"{w} x {h}" for h, w in (a.size, b.size))
        raise InputError("have one size", got=sizes, key="the flow fields", remedy="Compare fields of the same pictures.")


def _fitting(name: str, values: NDArray, flow: Flow) -> NDArray:
    if values.shape != flow.size:
        raise InputError(f"have shape {flow.size}, as the flow", got=values.shape, key=name)
    return values
