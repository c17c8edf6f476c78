"""Pictures to judge a scene by: from above, in perspective, and laid over the photographs."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..images import Encoding, encode, read_image, write_raw
from ..mesh import Mesh, join
from ..scene_file import Scene, cardboard_mesh
from ..transforms import look_at
from .cloud import path_of
from .dynamics import instance_mask
from .mesh_rays import MeshRays

Floats = NDArray[np.floating]
_SCREEN = Encoding(".png", "uint8", 3, "srgb")
_BOARD = (0.9, 0.35, 0.1)


def write_previews(folder: str | Path, scene: Scene) -> list[Path]:
    """Write `top.png`, `scene.png` and up to three `overlay_FRAME.png`; return their paths."""
    folder = Path(folder)
    made = []
    for name, picture in (("top", top_view(scene)), ("scene", oblique_view(scene))):
        write_raw(folder / f"{name}.png", picture)
        made.append(folder / f"{name}.png")
    count = len(scene.recording.frames)
    for index in sorted({0, count // 2, count - 1} if count else set()):
        name = f"overlay_{scene.recording.frames[index].name}.png"
        write_raw(folder / name, overlay(scene, index))
        made.append(folder / name)
    return made


def top_view(scene: Scene, longest: int = 1600) -> NDArray[np.uint8]:
    """Return the ground seen from above (H, W, 3), north up: height as colour and shading, the wetness mask beside it."""
    covered = scene.maps["coverage"] > 0
    height = scene.maps["height"].astype(np.float64)
    rows, cols = _extent(covered, scene)
    fold = max(1, round(max(rows.stop - rows.start, cols.stop - cols.start) / longest))
    height, covered = height[rows, cols][::fold, ::fold], covered[rows, cols][::fold, ::fold]
    mask = scene.maps["mask"][rows, cols][::fold, ::fold]
    cell = scene.grid.cell * fold
    low, high = np.percentile(height[covered], [2, 98]) if covered.any() else (0.0, 1.0)
    tint = np.rint(np.clip((height - low) / max(high - low, 1e-6), 0, 1) * 255).astype(np.uint8)
    tint = cv2.applyColorMap(tint, cv2.COLORMAP_VIRIDIS)[..., ::-1] / 255.0
    dy, dx = np.gradient(cv2.GaussianBlur(height, (0, 0), 1.0), cell)
    # Ten times steeper than it is, so that camber and kerbs show.
    light = np.clip((0.6 - 10 * (dx + dy) * 0.35) / np.sqrt(1 + 100 * (dx**2 + dy**2)) + 0.3, 0.15, 1.25)
    above = np.where(covered[..., None], tint * light[..., None], 1.0)
    wetting = np.where(covered[..., None], np.repeat(mask[..., None], 3, axis=2), (1.0, 0.9, 0.9))
    panels = []
    for panel in (above, wetting):
        picture = np.ascontiguousarray(np.rint(np.clip(panel, 0, 1) * 255).astype(np.uint8))
        _draw_path(picture, scene, rows.start, cols.start, fold)
        panels.append(picture[::-1])
    gap = np.full((12, panels[0].shape[1], 3), 255, np.uint8)
    return np.ascontiguousarray(np.concatenate([panels[0], gap, panels[1]], axis=0))


def _extent(covered: NDArray[np.bool_], scene: Scene, around: float = 30.0) -> tuple[slice, slice]:
    """Return the rows and columns within 30 m of the path, or of all ground where there is no path on it."""
    path = path_of(scene.recording)
    if len(path):
        place = scene.grid.position(path)
        reach = around / scene.grid.cell
        low = np.maximum(np.floor(place.min(axis=0) - reach), 0).astype(int)
        high = np.minimum(np.ceil(place.max(axis=0) + reach), covered.shape).astype(int)
        if np.all(low < high):
            return slice(low[0], high[0]), slice(low[1], high[1])
    return slice(0, covered.shape[0]), slice(0, covered.shape[1])


def _draw_path(picture: NDArray[np.uint8], scene: Scene, row: int, col: int, fold: int) -> None:
    def pixel(points: Floats) -> NDArray[np.int32]:
        return np.rint((scene.grid.position(points) - (row, col))[:, ::-1] / fold).astype(np.int32)

    path = path_of(scene.recording)
    if len(path):
        cv2.polylines(picture, [pixel(path)], False, (220, 30, 30), 2)
        for place in pixel(path):
            cv2.circle(picture, tuple(int(v) for v in place), 3, (220, 30, 30), -1)
    for boards in scene.cardboards:
        for board in boards:
            cv2.polylines(picture, [pixel(board.corners_world[:2])], False, (240, 140, 0), 2)


def oblique_view(scene: Scene, width: int = 1600, height: int = 900) -> NDArray[np.uint8]:
    """Return the meshes in their fill colours, seen from behind and above the start of the drive."""
    path = path_of(scene.recording)
    centre = path[len(path) // 2] if len(path) else scene.ground.vertices.mean(axis=0).astype(np.float64)
    forward = scene.recording.frames[0].camera.T_world_camera[:3, 2] if scene.recording.frames else np.array([1.0, 0, 0])
    forward = forward * (1, 1, 0) / max(np.linalg.norm(forward[:2]), 1e-9)
    start = path[0] if len(path) else centre - 30 * forward
    eye = start - 14 * forward + (0, 0, 13.0)
    camera = Camera("PINHOLE", width, height, look_at(eye, centre + 4 * forward), 0.75 * width, 0.75 * width, width / 2, height / 2)
    boards = next((b for b in scene.cardboards if b), ())
    return encode(shaded(camera, scene, boards), _SCREEN)


def shaded(camera: Camera, scene: Scene, boards=()) -> NDArray[np.float32]:
    """Return a picture (H, W, 3) of the meshes under a lamp at the camera, in fill colours where there are any."""
    meshes = [_coloured(scene.ground, (0.12, 0.13, 0.15)), _coloured(scene.environment, (0.25, 0.22, 0.2))]
    if boards:
        meshes.append(_coloured(cardboard_mesh(boards), _BOARD))
    mesh = join([m for m in meshes if m.num_faces])
    origins, directions = camera.rays(camera.pixel_centres())
    hits = MeshRays(mesh).cast(origins, directions)
    corners = mesh.faces[hits.face].astype(np.int64)
    colour = np.stack([mesh.attributes[name] for name in ("r", "g", "b")], axis=1)[corners]
    colour = np.einsum("nc,nck->nk", hits.weights, colour)
    facing = np.abs(np.einsum("nk,nk->n", hits.normals, directions))
    colour = colour * (0.45 + 0.55 * facing)[:, None]
    colour = np.where(hits.is_hit[:, None], colour, (0.75, 0.85, 0.95)).astype(np.float32)
    return colour.reshape(camera.height, camera.width, 3)


def overlay(scene: Scene, index: int) -> NDArray[np.uint8]:
    """Return a photograph with the meshes' depth edges (cyan), the ground's border (yellow), boards and masks on it."""
    frame = scene.recording.frames[index]
    linear, _ = read_image(frame.image, frame.response)
    picture = encode(linear, _SCREEN)
    mask = instance_mask(frame)
    picture[mask > 0] = picture[mask > 0] // 2 + np.array([110, 0, 0], np.uint8)
    meshes = [_coloured(m, (0, 0, 0)) for m in (scene.ground, scene.environment) if m.num_faces]
    shape = (frame.camera.height, frame.camera.width)
    hits = MeshRays(join(meshes)).cast(*frame.camera.rays(frame.camera.pixel_centres()))
    inverse = np.where(hits.is_hit, 1 / np.maximum(hits.distance, 0.1), 0).reshape(shape)
    step = np.maximum(np.abs(np.diff(inverse, axis=0, append=0)), np.abs(np.diff(inverse, axis=1, append=0)))
    picture[step > 0.15 * np.maximum(inverse, 0.02)] = (0, 220, 220)
    on_ground = (hits.is_hit & (hits.face < scene.ground.num_faces)).reshape(shape)
    border = cv2.morphologyEx(on_ground.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8)) > 0
    picture[border] = (255, 230, 0)
    for board in scene.cardboards[index]:
        xy, _ = frame.camera.project(board.corners_world)
        if np.isfinite(xy).all():
            cv2.polylines(picture, [np.rint((xy - 0.5) * 16).astype(np.int32)], True, (60, 255, 60), 1, cv2.LINE_AA, 4)
    return picture


def _coloured(mesh: Mesh, unseen: tuple[float, float, float]) -> Mesh:
    """Return the mesh with attributes r, g, b only: its fill colours, or `unseen` where no frame saw it."""
    n = len(mesh.vertices)
    seen = mesh.attributes["fill_w"] > 0 if "fill_w" in mesh.attributes else np.zeros(n, bool)
    rgb = {}
    for name, value in zip("rgb", unseen, strict=True):
        rgb[name] = np.where(seen, mesh.attributes[f"fill_{name}"], value) if seen.any() else np.full(n, value)
    return Mesh(mesh.vertices, mesh.faces, attributes=rgb)
