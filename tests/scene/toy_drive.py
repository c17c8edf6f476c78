"""A drive through a toy world whose colours are known functions of the place: ground with a lawn, and a wall."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.images import write_raw
from scene.mesh import Mesh
from scene.reconstruction.frame_view import depth_map, raycasting_scene
from scene.recording import Frame, MaskFile, Recording
from scene.transforms import look_at

SKY = np.array([0.5, 0.7, 0.9])


def sheet(x: NDArray, y: NDArray, height: NDArray | float = 0.0) -> Mesh:
    """Return a mesh over the grid of x and y (m,), (n,), facing up."""
    X, Y = np.meshgrid(x, y)
    Z = np.broadcast_to(height, X.shape)
    i = np.arange(X.size).reshape(X.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.uint32)
    return Mesh(np.column_stack([X.ravel(), Y.ravel(), Z.ravel()]).astype(np.float32), faces).with_smooth_normals()


def wall(x: float = 14.0) -> Mesh:
    """Return a wall across the road at x, from y = 1 to 4, 2.5 m high, facing -x."""
    flat = sheet(np.linspace(1, 4, 31), np.linspace(0, 2.5, 26))
    v = flat.vertices
    return Mesh(
        np.column_stack([np.full(len(v), x), v[:, 0], v[:, 1]]).astype(np.float32), flat.faces[:, ::-1]
    ).with_smooth_normals()


def meshes() -> dict[str, Mesh]:
    return {"ground": sheet(np.linspace(0, 24, 241), np.linspace(-5, 5, 101)), "environment": wall()}


def colour(points: NDArray, mesh_index: NDArray) -> NDArray[np.float64]:
    """Return the radiance: a grey road with soft stripes, a lawn beyond y = -2, a red wall with a gradient, the sky."""
    x, y, z = points.T
    grey = 0.25 + 0.05 * np.sin(1.5 * x)
    road = grey[:, None] * np.ones(3)
    lawn = np.array([0.06, 0.14, 0.04]) * (1 + 0.2 * np.sin(2 * x))[:, None]
    bricks = np.array([0.5, 0.2, 0.1]) * (0.8 + 0.1 * z)[:, None]
    ground = np.where((y < -2)[:, None], lawn, road)
    return np.where((mesh_index == 0)[:, None], ground, np.where((mesh_index == 1)[:, None], bricks, SKY))


def camera(x: float, width: int = 320, height: int = 140) -> Camera:
    return Camera("PINHOLE", width, height, look_at((x, 0, 1.6), (x + 10, 0, 1.0)), 260.0, 260.0, width / 2, 50.0)


def drive(folder: Path, gains: tuple[float, ...] = (1.0, 1.0, 1.0), moving: bool = False, labels: bool = False) -> Recording:
    """Photograph the toy world while driving 2 m per frame; `moving` puts a bright box with a mask into each picture."""
    scene = raycasting_scene(meshes().values())
    frames = []
    for t, gain in enumerate(gains):
        cam = camera(2.0 * t)
        depth, index = depth_map(scene, cam)
        origins, rays = cam.rays(cam.pixel_centres())
        along = (depth / (rays @ cam.T_world_camera[:3, 2]).reshape(depth.shape)).ravel()
        with np.errstate(invalid="ignore"):
            points = origins + rays * along[:, None]
        image = gain * colour(np.nan_to_num(points, posinf=0, neginf=0), index.ravel()).reshape(*depth.shape, 3)
        frame = Frame(folder / f"image_{t}.exr", cam)
        if moving:
            mask = np.zeros(depth.shape, np.uint8)
            mask[70:110, 130 + 10 * t : 170 + 10 * t] = 3
            image[mask > 0] = (5.0, 0.0, 5.0)
            write_raw(folder / f"mask_{t}.png", mask)
            frame = replace(frame, masks=MaskFile(folder / f"mask_{t}.png"))
        if labels:
            kind = np.where(index == 0, 7, np.where(index == 1, 11, 23)).astype(np.uint8)
            kind[(index == 0) & (points[:, 1].reshape(depth.shape) < -2)] = 22
            write_raw(folder / f"labels_{t}.png", kind)
            frame = replace(frame, segmentation=folder / f"labels_{t}.png")
        write_raw(frame.image, image.astype(np.float32))
        frames.append(frame)
    return Recording(tuple(frames), folder)
