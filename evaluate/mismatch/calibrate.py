"""The parameters that the sender did not know exactly, fitted before any blame is laid, and the level of the noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from ..kernels import shade
from .case import Case, Floats
from .effect import Effect, Parameter, Term, Values
from .formation import State
from .solve import Fit, fit

# An outline cuts a pixel of 8 x 8 points: its share is known to about this standard deviation.
_EDGE_SHARE = 0.035
_COLUMN = {
    "albedo_scale": None,
    "eta": shade.ETA,
    "alpha": None,
    "alpha_u": shade.ALPHA_U,
    "alpha_v": shade.ALPHA_V,
    "specular_scale": shade.LOBE,
}


class FreeParameters(Effect):
    """What `free` names in the materials of the simulation: no effect, but part of every model."""

    id = "free"
    stage = "surface"
    title = "free parameters"
    says = "parameters that the simulation declares not to know exactly"

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        out = []
        for name, material in case.simulation.materials.items():
            for key in material.free:
                value = float(getattr(material, key) if getattr(material, key) is not None else material.alpha)
                low, high = (0.01, 1.0) if key.startswith("alpha") else (1.01, 6.0) if key == "eta" else (0.0, 1e3)
                out.append(Parameter(f"{key}.{name}", value, low, high, max(0.01 * value, 1e-3)))
        return tuple(out)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        for i, shape in enumerate(case.world.shapes):
            material, row = case.simulation.materials[shape.material], state.surfaces[i]
            for key in material.free:
                value = values[f"{key}.{shape.material}"]
                if key == "albedo_scale":
                    row[shade.SCALE : shade.SCALE + 3] *= value / max(material.albedo_scale, 1e-12)
                elif key == "alpha":
                    row[shade.ALPHA_U] = row[shade.ALPHA_V] = value
                else:
                    row[_COLUMN[key]] = value


def free_term(case: Case) -> Term:
    """Return the term that holds the free parameters."""
    effect = FreeParameters()
    return Term(effect, None, None, effect.parameters(case, None))


def weigh(case: Case, picture: Floats) -> Floats:
    """Return 1 / variance of the residual of a prediction (F, H, W, 3); 0 where nothing was measured.

    To the sensor's variance comes what is not known about edges: how much of a pixel lies on which side.
    """
    edge = case.pieces.edge.reshape(case.valid.shape)[..., None]
    spread = maximum_filter(picture, (0, 3, 3, 0)) - minimum_filter(picture, (0, 3, 3, 0))
    variance = case.variance + edge * (_EDGE_SHARE * spread) ** 2
    return np.where(case.valid[..., None], 1 / variance, 0).astype(np.float32)


def calibrate(case: Case) -> tuple[Fit, Floats]:
    """Fit the free parameters robustly; return the fit and the weights.

    Residuals beyond 3 sigma count by their distance only (P. Huber, 1964), so that a local mismatch does not drag the
    parameters along.
    """
    fitted = fit(case, np.where(case.valid[..., None], 1 / case.variance, 0).astype(np.float32), [free_term(case)], 6)
    weight = weigh(case, fitted.picture)
    for _ in range(3):
        z = np.abs(case.pictures - fitted.picture) * np.sqrt(weight)
        huber = np.minimum(1, 3 / np.maximum(z, 1e-6)).astype(np.float32)
        fitted = fit(case, weight * huber, fitted.terms, 3)
        weight = weigh(case, fitted.picture)
    return fit(case, weight, fitted.terms, 0), weight


def white_level(case: Case, z: Floats, among: NDArray[np.bool_] | None = None) -> float:
    """Return the standard deviation of what is noise in a residual: unlike its neighbours, and unlike other frames.

    Differences of neighbours along rows, columns and diagonals, and the median over pixels (of those in `among`, (F, H, W)),
    let structure pass unseen; what stands still on the sensor is taken off first.
    """
    fixed = z.mean(axis=0, keepdims=True) if case.num_frames > 4 else 0.0
    r = (z - fixed) * (np.sqrt(case.num_frames / (case.num_frames - 1)) if case.num_frames > 4 else 1.0)
    # Corners of 2 x 2 pixels: blind to slopes and to whole rows and columns.
    d = (r[:, 1:, 1:] - r[:, :-1, 1:] - r[:, 1:, :-1] + r[:, :-1, :-1]) / 2
    v = case.valid & ~case.pieces.edge.reshape(case.valid.shape)
    if among is not None:
        v = v & among
    ok = v[:, 1:, 1:] & v[:, :-1, 1:] & v[:, 1:, :-1] & v[:, :-1, :-1]
    if ok.sum() < 100:
        return 1.0
    return float(1.4826 * np.median(np.abs(d[ok])))


def quiet_level(case: Case, weight: Floats, picture: Floats) -> float:
    """Return the level of white noise where a prediction is smooth: what is displaced or blurred there is not taken for noise."""
    spread = (maximum_filter(picture, (0, 5, 5, 0)) - minimum_filter(picture, (0, 5, 5, 0))) * np.sqrt(weight)
    spread = spread.max(axis=-1)
    quiet = spread <= np.median(spread[case.valid])
    return white_level(case, (case.pictures - picture) * np.sqrt(weight), quiet)
