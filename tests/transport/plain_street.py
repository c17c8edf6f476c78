"""A plane road before a striped wall, small enough to be computed in NumPy: what the augmentation's tests wet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from scene.camera import Camera
from scene.grid import GroundGrid
from scene.images import Encoding, write_image, write_raw
from scene.mesh import Mesh
from scene.recording import Frame, MaskFile, Recording, read_recording, write_recording
from scene.scene_file import GROUND_MAPS, Cardboard, Scene, Sky
from scene.transforms import look_at

WALL_Y, WALL_TOP = 14.0, 5.0
SKY = np.array([0.5, 0.6, 0.8])
PNG = Encoding(".png", "uint8", 3, "srgb")


def plane(corners: list[tuple[float, float, float]], n: int = 8) -> Mesh:
    """Return a subdivided quad; corners counter-clockwise seen from outside."""
    a, b, c, d = np.array(corners, float)
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    u, v = u[..., None], v[..., None]
    points = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    i = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = [(i[:-1, :-1], i[:-1, 1:], i[1:, 1:]), (i[:-1, :-1], i[1:, 1:], i[1:, :-1])]
    faces = np.concatenate([np.stack(q, -1).reshape(-1, 3) for q in quads])
    return Mesh(points.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32)).with_smooth_normals()


GROUND = plane([(-20, -6, 0), (20, -6, 0), (20, 30, 0), (-20, 30, 0)])
WALL = plane([(-20, WALL_Y, 0), (20, WALL_Y, 0), (20, WALL_Y, WALL_TOP), (-20, WALL_Y, WALL_TOP)])
GRID = GroundGrid.covering(GROUND.vertices, 0.1)


def camera(x: float = 0.0, y: float = -5.0, width: int = 160, height: int = 68) -> Camera:
    """Return a camera 1.6 m above the road that looks at the wall."""
    pose = look_at([x, y, 1.6], [x, y + 15, 1.0])
    return Camera("PINHOLE", width, height, pose, fx=135 * width / 160, fy=135 * width / 160, cx=width / 2, cy=height / 2)


def wall_colour(z: np.ndarray) -> np.ndarray:
    """Return the wall's radiance: a red band from 2 to 3 m on grey."""
    band = (z > 2) & (z < 3)
    return np.where(band[..., None], (0.8, 0.1, 0.1), (0.35, 0.35, 0.35))


def road_colour(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the road's radiance: grey with a fine pattern."""
    return (0.25 + 0.03 * np.sin(9 * x) * np.sin(7 * y))[..., None] * np.ones(3)


def photograph(view: Camera) -> np.ndarray:
    """Return the linear picture (H, W, 3) of road, wall and sky at the pixels' centres."""
    origin, d = view.rays(view.pixel_centres())
    with np.errstate(divide="ignore", invalid="ignore"):
        to_road = np.where(d[:, 2] < 0, -origin[:, 2] / d[:, 2], np.inf)
        to_wall = np.where(d[:, 1] > 0, (WALL_Y - origin[:, 1]) / d[:, 1], np.inf)
        on_road, on_wall = origin + to_road[:, None] * d, origin + to_wall[:, None] * d
    wall = (to_wall < to_road) & (on_wall[:, 2] < WALL_TOP)
    road = to_road < to_wall
    picture = np.tile(SKY, (len(d), 1))
    picture[wall] = wall_colour(on_wall[wall, 2])
    picture[road] = road_colour(on_road[road, 0], on_road[road, 1])
    return picture.reshape(view.height, view.width, 3).astype(np.float32)


def plain_street(
    folder: Path,
    views: list[Camera] | None = None,
    encoding: Encoding = PNG,
    masks: list[np.ndarray] | None = None,
    boards: tuple[tuple[Cardboard, ...], ...] | None = None,
) -> Scene:
    """Return the scene with its pictures below `folder`; its maps are dry, level ground."""
    views = views or [camera()]
    frames = []
    for t, view in enumerate(views):
        image = folder / "recording" / f"{t:04d}{encoding.suffix}"
        picture = photograph(view)
        write_image(image, picture, encoding)
        mask = None
        if masks is not None:
            write_raw(folder / "recording" / "mask" / f"{t:04d}.png", masks[t].astype(np.uint8))
            mask = MaskFile((folder / "recording" / "mask" / f"{t:04d}.png").resolve())
        frames.append(Frame(image.resolve(), view, response=encoding.response, masks=mask))
    write_recording(folder / "recording" / "recording.json", Recording(tuple(frames), folder, "plain"))
    one = np.ones(GRID.shape, np.float32)
    maps = dict.fromkeys(GROUND_MAPS, 0 * one) | {"coverage": one, "mask": one, "moisture": 0.5 * one, "puddles": 0.5 * one}
    sky = np.concatenate([np.tile(SKY, (60, 120, 1)), np.zeros((60, 120, 1))], axis=-1).astype(np.float32)
    means = {name: np.array([0.3, 0.3, 0.3], np.float32) for name in ("ground", "environment", "vehicle", "pedestrian")}
    recording = read_recording(folder / "recording")
    return Scene("plain", recording, GROUND, WALL, GRID, maps, Sky(sky), means, boards or tuple(() for _ in views))


def with_maps(scene: Scene, **maps: np.ndarray) -> Scene:
    """Return the scene with some of its maps replaced."""
    return replace(scene, maps={**scene.maps, **{k: v.astype(np.float32) for k, v in maps.items()}})
