"""The drive: where the camera and each moving thing are in every frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..transforms import look_at
from . import layout as at
from .relief import Relief
from .settings import StreetSettings
from .vehicles import CONTACTS

Floats = NDArray[np.floating]

CAMERA_HEIGHT = 1.55
LIDAR_OFFSET = np.array([-0.35, 0.0, 1.85])
AHEAD, ONCOMING, WALKER = 1, 2, 3
CLASSES = {AHEAD: "vehicle", ONCOMING: "vehicle", WALKER: "pedestrian"}
# Metres driven or walked per frame by the others (a frame is 0.1 s at the default step of 1 m: 36 km/h).
_SPEEDS = {AHEAD: 1.15, ONCOMING: -0.75, WALKER: -0.135}


def cameras(settings: StreetSettings, relief: Relief) -> tuple[Camera, ...]:
    """Return the camera of each frame: it rides with the undulation of the road and yaws by a few milliradians."""
    focal = 0.5 * settings.width / np.tan(np.radians(settings.fov_deg) / 2)
    out = []
    for frame in range(settings.frames):
        x = frame * settings.step
        eye = np.array([x, at.LANE_EGO, CAMERA_HEIGHT + _ground(relief, x)])
        yaw = 0.004 * np.sin(0.9 * frame)
        pitch = np.radians(-2.6) + 0.0025 * np.sin(1.7 * frame + 0.5)
        target = eye + [np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)]
        T = look_at(eye, target)
        out.append(Camera("PINHOLE", settings.width, settings.height, T, focal, focal, settings.width / 2, settings.height / 2))
    return tuple(out)


def scanner_pose(settings: StreetSettings, relief: Relief, frame: int) -> NDArray[np.float64]:
    """Return `T_world_scanner`: x forward, y left, z up, on the roof behind the camera."""
    x = frame * settings.step
    T = np.eye(4)
    T[:3, 3] = [x + LIDAR_OFFSET[0], at.LANE_EGO, LIDAR_OFFSET[2] + _ground(relief, x)]
    return T


def object_poses(settings: StreetSettings, relief: Relief) -> tuple[dict[int, NDArray[np.float64]], ...]:
    """Return, per frame, `T_world_object` of each moving thing by its instance id."""
    out = []
    for frame in range(settings.frames):
        out.append(
            {
                AHEAD: on_wheels(relief, 20.5 + _SPEEDS[AHEAD] * frame, at.LANE_EGO - 0.05, 0.0),
                ONCOMING: on_wheels(relief, 31.0 + _SPEEDS[ONCOMING] * frame, at.LANE_ONCOMING + 0.1, np.pi),
                WALKER: _walking(relief, 18.3, 2.9 + _SPEEDS[WALKER] * frame),
            }
        )
    return tuple(out)


def on_wheels(relief: Relief, x: float, y: float, yaw: float) -> NDArray[np.float64]:
    """Return the pose of a car whose four wheels stand on the ground as well as four points of a plane can."""
    c, s = np.cos(yaw), np.sin(yaw)
    heading, left = np.array([c, s]), np.array([-s, c])
    xy = np.array([x, y]) + CONTACTS[:, :1] * heading + CONTACTS[:, 1:2] * left
    # A tyre rests on a patch of 12 cm x 16 cm, not on a point.
    spots = np.array([[0, 0], [0.06, 0], [-0.06, 0], [0, 0.08], [0, -0.08]])
    z = np.mean([relief.height(xy[:, 0] + dx, xy[:, 1] + dy) for dx, dy in spots], axis=0)
    (height, slope_x, slope_y), *_ = np.linalg.lstsq(np.column_stack([np.ones(4), CONTACTS[:, :2]]), z, rcond=None)
    forward = np.array([*heading, slope_x])
    forward /= np.linalg.norm(forward)
    sideways = np.array([*left, slope_y])
    up = np.cross(forward, sideways)
    up /= np.linalg.norm(up)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([forward, np.cross(up, forward), up])
    T[:3, 3] = [x, y, height]
    return T


def _walking(relief: Relief, x: float, y: float) -> NDArray[np.float64]:
    """Return the pose of the pedestrian, who crosses towards -y with one sole on the ground."""
    T = np.eye(4)
    T[:3, :3] = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    # The leading foot, 25 cm ahead of the body and 10 cm to its left, carries it.
    T[:3, 3] = [x, y, float(relief.height(x + 0.10, y - 0.25))]
    return T


def _ground(relief: Relief, x: float) -> float:
    """Return the height of the lane below the vehicle, evened out over its wheelbase."""
    xs = x + np.linspace(-1.3, 1.3, 9)
    return float(relief.height(xs, np.full(9, at.LANE_EGO)).mean())
