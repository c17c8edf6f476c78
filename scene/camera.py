"""A calibrated camera: where a world point falls in the image, and which ray a pixel sees.

Frame: x right, y down, z forward. Pixel positions `xy` count from the image's corner: the top-left pixel's centre is
(0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .transforms import invert, transform_points, transform_vectors

Floats = NDArray[np.floating]
MODELS = ("PINHOLE", "OPENCV", "ORTHOGRAPHIC")


@dataclass(frozen=True)
class Camera:
    """Intrinsics, distortion and pose.

    Attributes
    ----------
    model : str
        PINHOLE, OPENCV (`k1 k2 p1 p2`, Brown-Conrady as OpenCV defines it) or ORTHOGRAPHIC (`pixel_size` in metres).
    width, height : int
        Image size [px].
    fx, fy, cx, cy : float
        Focal lengths and principal point [px].
    T_world_camera : (4, 4) float64
        Pose, camera to world [m].
    """

    model: str
    width: int
    height: int
    T_world_camera: NDArray[np.float64]
    fx: float = 1.0
    fy: float = 1.0
    cx: float = 0.0
    cy: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    pixel_size: float | None = None

    @property
    def K(self) -> NDArray[np.float64]:
        """Intrinsic matrix (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def T_camera_world(self) -> NDArray[np.float64]:
        return invert(self.T_world_camera)

    @property
    def position(self) -> NDArray[np.float64]:
        """Place of the camera in the world (3,) [m]."""
        return self.T_world_camera[:3, 3]

    def moved_to(self, T_world_camera: NDArray[np.float64]) -> Camera:
        return replace(self, T_world_camera=T_world_camera)

    def scaled_to(self, width: int, height: int) -> Camera:
        """Return the same camera with another number of pixels on the same field of view."""
        sx, sy = width / self.width, height / self.height
        size = None if self.pixel_size is None else self.pixel_size / sx
        return replace(
            self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy, pixel_size=size
        )

    def project(self, points_world: Floats) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return pixel positions and depths of world points.

        Parameters
        ----------
        points_world : (N, 3) float
            Points [m].

        Returns
        -------
        xy : (N, 2) float64
            Positions [px]; NaN behind the camera, and where the distortion model has no meaning: far off the axis a
            barrel polynomial turns back, and would show points in the image that no lens shows there.
        depth : (N,) float64
            Along the camera's z [m].
        """
        p = transform_points(self.T_camera_world, np.asarray(points_world, dtype=np.float64))
        depth = p[:, 2]
        if self.model == "ORTHOGRAPHIC":
            assert self.pixel_size is not None
            return p[:, :2] / self.pixel_size + (self.cx, self.cy), depth
        with np.errstate(divide="ignore", invalid="ignore"):
            xy = p[:, :2] / np.where(depth > 0, depth, np.nan)[:, None]
        if self.model == "OPENCV":
            xy = self._distort(xy)
        return xy * (self.fx, self.fy) + (self.cx, self.cy), depth

    def rays(self, xy: Floats) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origins and unit directions (N, 3) in the world of the rays that pixel positions (N, 2) see.

        The direction is NaN where the distortion leaves no ray for a position.
        """
        xy = np.asarray(xy, dtype=np.float64)
        origins = np.broadcast_to(self.position, (len(xy), 3))
        if self.model == "ORTHOGRAPHIC":
            assert self.pixel_size is not None
            offset = np.column_stack([(xy - (self.cx, self.cy)) * self.pixel_size, np.zeros(len(xy))])
            direction = np.broadcast_to(self.T_world_camera[:3, 2], (len(xy), 3))
            return origins + transform_vectors(self.T_world_camera, offset), direction
        d: NDArray[np.float64] = (xy - np.array([self.cx, self.cy])) / np.array([self.fx, self.fy])
        if self.model == "OPENCV":
            d = self._undistort(d)
        d = np.column_stack([d, np.ones(len(d))])
        d = transform_vectors(self.T_world_camera, d)
        return origins, d / np.linalg.norm(d, axis=1, keepdims=True)

    def pixel_centres(self) -> NDArray[np.float64]:
        """Return the centres (H * W, 2) of all pixels, row by row [px]."""
        x, y = np.meshgrid(np.arange(self.width, dtype=np.float64) + 0.5, np.arange(self.height, dtype=np.float64) + 0.5)
        return np.column_stack([x.ravel(), y.ravel()]).astype(np.float64, copy=False)

    def _distort(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        radial = np.where(r2 < self._largest_r2(), 1 + r2 * (self.k1 + r2 * self.k2), np.nan)
        return np.column_stack(
            [
                x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x),
                y * radial + self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y,
            ]
        )

    def _largest_r2(self) -> float:
        """Squared radius up to which r (1 + k1 r^2 + k2 r^4) rises: the first root of its derivative in r^2."""
        roots = np.roots([5 * self.k2, 3 * self.k1, 1.0])
        turning = roots[np.isreal(roots) & (roots.real > 0)].real
        return float(turning.min()) if len(turning) else np.inf

    def _undistort(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        # Newton's method from the distorted place. Along a radius r + k1 r^3 starts on the side from which it comes
        # monotonically nearer, for barrel and pincushion alike; the fixed point that OpenCV iterates stalls near the turn.
        out = xy.copy()
        for _ in range(30):
            x, y = out[:, 0], out[:, 1]
            r2 = x * x + y * y
            radial, slope = 1 + r2 * (self.k1 + r2 * self.k2), 2 * self.k1 + 4 * r2 * self.k2
            a = radial + slope * x * x + 2 * self.p1 * y + 6 * self.p2 * x
            b = slope * x * y + 2 * self.p1 * x + 2 * self.p2 * y
            d = radial + slope * y * y + 6 * self.p1 * y + 2 * self.p2 * x
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                u, v = (self._distort(out) - xy).T
                step = np.column_stack([d * u - b * v, a * v - b * u]) / (a * d - b * b)[:, None]
            out = out - step
            if np.nanmax(np.abs(step), initial=0) < 1e-14:
                break
        return out
