"""Cameras that are no pinholes at rest: distortion, a thin lens, and motion while the shutter is open."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from materials.foundation.checks import check_finite, check_range, check_shape
from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.simulation import Lens

from .kernels.optics import OpticsArrays

__all__ = ["Shutter", "compile_optics"]


@dataclass(frozen=True)
class Shutter:
    """The camera's way while it takes a picture, from its own pose on: straight, and turning evenly.

    Attributes
    ----------
    T_world_camera_end : (4, 4) float64
        Pose at the end of the way.
    exposure : float
        Share of the way during which a row is exposed; 0 is an instant.
    readout : float
        Share of the way between the first row's exposure and the last one's; 0 is a global shutter. Together at most 1.
    """

    T_world_camera_end: NDArray[np.float64]
    exposure: float = 1.0
    readout: float = 0.0


def compile_optics(camera: Camera, lens: Lens | None = None, shutter: Shutter | None = None) -> OpticsArrays | None:
    """Return lens and shutter as the kernels take them, None for a pinhole at rest.

    Parameters
    ----------
    camera : Camera
        OPENCV brings its distortion.
    lens : Lens, optional
        Of a simulation: an aperture, focus and k1, k2.
    shutter : Shutter, optional

    Raises
    ------
    InputError
        If a number is out of range, both camera and lens distort, or an ORTHOGRAPHIC camera is to have a lens or to move.
    """
    lens = lens or Lens()
    k1, k2, p1, p2 = (camera.k1, camera.k2, camera.p1, camera.p2) if camera.model == "OPENCV" else (0.0,) * 4
    check_finite("lens", (lens.k1, lens.k2))
    if lens.k1 or lens.k2:
        if any((k1, k2, p1, p2)):
            raise InputError("leave the distortion to the camera, which has one", got=(lens.k1, lens.k2), key="lens")
        k1, k2 = lens.k1, lens.k2
    radius = lens.aperture_radius if lens.model == "thin_lens" else 0.0
    check_range("lens.aperture_radius", radius, "[0, inf)")
    if radius > 0:
        check_range("lens.focus_distance", lens.focus_distance, "(0, inf]")
    if not any((k1, k2, p1, p2)) and radius == 0 and shutter is None:
        return None
    if camera.model == "ORTHOGRAPHIC":
        raise InputError("be PINHOLE or OPENCV to have a lens or a shutter", got=camera.model, key="camera")
    start = camera.T_world_camera
    end = start if shutter is None else np.asarray(shutter.T_world_camera_end, np.float64)
    exposure, readout = (0.0, 0.0) if shutter is None else (shutter.exposure, shutter.readout)
    check_shape("T_world_camera_end", end, (4, 4))
    check_finite("T_world_camera_end", end)
    check_range("exposure", exposure, "[0, 1]")
    check_range("exposure + readout", exposure + readout, "[0, 1]")
    turn = Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(turn))
    return OpticsArrays(
        *(float(v) for v in (camera.fx, camera.fy, camera.cx, camera.cy, k1, k2, p1, p2, radius)),
        focus_distance=float(lens.focus_distance) if radius > 0 else math.inf,
        rows=camera.height,
        R=start[:3, :3].copy(),
        t=start[:3, 3].copy(),
        axis=turn / angle if angle > 0 else np.array([0.0, 0.0, 1.0]),
        angle=angle,
        way=end[:3, 3] - start[:3, 3],
        exposure=float(exposure),
        readout=float(readout),
    )
