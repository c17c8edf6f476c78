"""Flow error against how light meets the surface: the reflectance-aware end-point error (thesis 5.4.2).

Each flow vector belongs to an angle: between the view and the direction in which a perfect mirror would send the lamp's
light, or between the view and the normal. Heat maps show how errors are distributed at each angle, normalised per column
(figures 5.8 and 5.9).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_unit
from materials.foundation.errors import InputError
from scene.camera import Camera

Floats = NDArray[np.floating]

MIRROR = "angle between view and mirror direction [degrees]"
GRAZING = "angle between view and normal [degrees]"
# The thesis's intervals of the error double: 0.06 to 0.12 px for metals (5.5.4), 0.04 to 0.08 px for structured samples.
ERROR_EDGES = tuple(0.03 * 2.0**k for k in range(10))


@dataclass(frozen=True)
class HeatMap:
    """Counts of flow vectors by angle and error.

    Attributes
    ----------
    angle_edges : (A + 1,) float
        [degrees]; the last interval is closed.
    error_edges : (E,) float
        Upper ends of the error intervals [px]; the first begins at 0 and a last, open one follows.
    counts : (E + 1, A) int64
        Vectors in each.
    """

    angle_edges: NDArray[np.float64]
    error_edges: NDArray[np.float64]
    counts: NDArray[np.int64]

    def __add__(self, other: HeatMap) -> HeatMap:
        """Return the counts of both, which must have the same intervals."""
        same = np.array_equal(self.angle_edges, other.angle_edges) and np.array_equal(self.error_edges, other.error_edges)
        if not same:
            raise InputError("have the same intervals", key="heat maps to be added")
        return HeatMap(self.angle_edges, self.error_edges, self.counts + other.counts)

    def normalised(self) -> NDArray[np.float64]:
        """Return the share of each error interval in its column; a column without vectors is NaN."""
        total = self.counts.sum(axis=0, keepdims=True)
        return np.divide(self.counts, total, out=np.full(self.counts.shape, np.nan), where=total > 0)


def mirror_angle_deg(n: Floats, wo: Floats, wi: Floats) -> NDArray[np.float32]:
    """Return the angle between the view and the mirrored direction of the light [degrees]; 0 is the highlight's centre.

    Parameters
    ----------
    n, wo, wi : (..., 3) float
        Normal, towards the viewer, towards the light; unit vectors in one frame.

    Returns
    -------
    angle : (...) float32
        NaN where the light is below the surface: there is no reflection to look at.

    Raises
    ------
    InputError
        If a vector is not of unit length.
    """
    for name, vectors in (("n", n), ("wo", wo), ("wi", wi)):
        check_unit(name, vectors)
    cos_i = np.einsum("...c,...c->...", n, wi)
    mirrored = 2 * cos_i[..., None] * n - wi
    return np.where(cos_i > 0, _angle(mirrored, wo), np.nan).astype(np.float32)


def view_angle_deg(n: Floats, wo: Floats) -> NDArray[np.float32]:
    """Return the angle between normal and view [degrees]; near 90 the surface is seen at grazing incidence.

    Raises
    ------
    InputError
        If a vector is not of unit length.
    """
    for name, vectors in (("n", n), ("wo", wo)):
        check_unit(name, vectors)
    return _angle(np.broadcast_arrays(n, wo)[0], wo).astype(np.float32)


def angles_of_scene(
    position: Floats, normal: Floats, camera: Camera, light_position: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return both angles for every pixel of a rendered scene with one small lamp.

    Parameters
    ----------
    position, normal : (H, W, 3) float
        Where each pixel sees the surface, and its unit normal there, in the world; NaN or 0 where there is none.
    light_position : (3,) float
        Centre of the lamp in the world [m].

    Returns
    -------
    mirror, view : (H, W) float32
        Angles [degrees]; NaN where there is no surface.
    """
    seen = np.isfinite(position).all(axis=-1) & (np.abs(np.linalg.norm(normal, axis=-1) - 1) < 1e-3)
    p, n = position[seen].astype(np.float64), normal[seen].astype(np.float64)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    wo, wi = camera.position - p, np.asarray(light_position, np.float64) - p
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    wi /= np.linalg.norm(wi, axis=-1, keepdims=True)
    mirror, view = (np.full(seen.shape, np.nan, np.float32) for _ in range(2))
    mirror[seen], view[seen] = mirror_angle_deg(n, wo, wi), view_angle_deg(n, wo)
    return mirror, view


def heat_map(angle: Floats, error: Floats, angle_edges: Floats, error_edges: Floats | tuple[float, ...] = ERROR_EDGES) -> HeatMap:
    """Count flow vectors by angle and error.

    Parameters
    ----------
    angle, error : (...) float
        Of each vector, [degrees] and [px]; those that are not finite do not count, nor do angles beyond the edges.
    angle_edges, error_edges : float
        Rising; see `HeatMap`.

    Raises
    ------
    InputError
        If shapes differ or edges do not rise.
    """
    if np.shape(angle) != np.shape(error):
        raise InputError("have one shape", got=f"{np.shape(angle)} and {np.shape(error)}", key="angle and error")
    edges = {"angle_edges": np.asarray(angle_edges, float), "error_edges": np.asarray(error_edges, float)}
    for name, values in edges.items():
        if values.ndim != 1 or len(values) < 2 or not np.all(np.diff(values) > 0):
            raise InputError("be two or more rising numbers", got=values, key=name)
    known = np.isfinite(angle) & np.isfinite(error)
    a, e = np.asarray(angle)[known], np.asarray(error)[known]
    # Errors on an edge belong to the interval below, as in the thesis's (0.06, 0.12].
    row = np.searchsorted(edges["error_edges"], e, side="left")
    column = np.searchsorted(edges["angle_edges"], a, side="right") - 1
    column[a == edges["angle_edges"][-1]] -= 1
    inside = (column >= 0) & (column < len(edges["angle_edges"]) - 1)
    shape = (len(edges["error_edges"]) + 1, len(edges["angle_edges"]) - 1)
    flat = np.bincount(row[inside] * shape[1] + column[inside], minlength=shape[0] * shape[1])
    return HeatMap(edges["angle_edges"], edges["error_edges"], flat.reshape(shape).astype(np.int64))


def _angle(a: Floats, b: Floats) -> NDArray[np.float64]:
    """Return the angle between unit vectors, exact also near 0 and 180 degrees (Kahan)."""
    return np.degrees(2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))
