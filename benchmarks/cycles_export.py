"""Write a wet frame for another renderer: the same meshes, pictures and lobes as our kernels use."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from materials.foundation.files import replacing
from transport.kernels.projected import GROUND, Picture, is_seen, project, sky_radiance
from transport.kernels.wet import WetGround, lobe_at, water_at
from transport.projected_world import ProjectedFrame

_SKY_ROWS = 1440


def export_frame(
    file: str | Path, frame: ProjectedFrame, ground: WetGround, diffuse: NDArray[np.float32], wanted: NDArray, bounces: int
) -> None:
    """Write `file` (npz) for `cycles_scene.py`.

    What our kernels look up per sample is baked where it is smooth: water at the pixels' centres, at the vertices and on
    its own grid; whether the camera sees a surface, at the vertices; the picture's own sky into the panorama.
    """
    camera, arrays, picture = frame.frame.camera, frame.world.arrays, frame.picture
    water = np.zeros(wanted.shape)
    lobe, normal = np.zeros((*wanted.shape, 3), np.float32), np.zeros((*wanted.shape, 3), np.float32)
    _pixel_lobes(ground, np.nan_to_num(frame.position), frame.is_ground, water, lobe, normal)
    lit = np.where(
        (water > 0)[..., None], diffuse * (1 + (ground.attenuation - 1) * np.clip(2 * water, 0, 1)[..., None]), frame.image
    )
    out: dict[str, NDArray] = {
        "camera": np.array(json.dumps({k: getattr(camera, k) for k in ("width", "height", "fx", "fy", "cx", "cy")})),
        "T_world_camera": camera.T_world_camera,
        "picture": frame.image,
        "ground_picture": lit.astype(np.float32),
        "instances": frame.instance,
        "lobe": lobe,
        "normal": normal,
        "rows": np.array([np.flatnonzero(wanted.any(axis=1)).min(), np.flatnonzero(wanted.any(axis=1)).max() + 1]),
        "bounces": np.array(bounces),
        "grid_lobe": _grid_lobes(ground),
        "grid": np.array([ground.x_min, ground.y_min, ground.cell * ground.water.shape[1], ground.cell * ground.water.shape[0]]),
    }
    sky = np.zeros((_SKY_ROWS, 2 * _SKY_ROWS, 3), np.float32)
    _bake_sky(picture, sky)
    out["sky"] = sky
    bodies, means, start = [], [], 0
    for i, shape in enumerate(frame.world.shapes):
        stop, role = start + len(shape.mesh.vertices), int(picture.role[i])
        vertices = arrays.vertices[start:stop]
        if shape.instance == 0:
            name = "ground" if role == GROUND else "environment"
            fill = np.zeros((len(vertices), 4), np.float32)
            _bake_fill(picture, ground, vertices, picture.fill[start:stop], picture.mean[i], role == GROUND, fill)
            out |= {f"{name}_vertices": vertices, f"{name}_faces": shape.mesh.faces, f"{name}_fill": fill}
        else:
            out |= {f"body{len(bodies)}_vertices": vertices, f"body{len(bodies)}_faces": shape.mesh.faces}
            bodies.append((role, shape.instance))
            means.append(picture.mean[i])
        start = stop
    out["bodies"], out["body_means"] = np.array(bodies, int).reshape(-1, 2), np.array(means).reshape(-1, 3)
    with replacing(file) as temporary:
        np.savez(temporary, **out)  # pyright: ignore[reportArgumentType]


def _grid_lobes(ground: WetGround) -> NDArray[np.float32]:
    """Return roughness, index and whether there is gloss at all (rows, cols, 3) of ground that is met on the way."""
    w_sat, w_acc = np.clip(2 * ground.water, 0, 1), np.clip(2 * ground.water - 1, 0, 1)
    keep, t = 1 - (1 - ground.rho) * 0.5 * w_sat, ground.strength * w_acc
    roughness = ground.mean_roughness * keep * (1 - t)
    return np.stack([roughness, 1.33 + (ground.eta - 1.33) * keep * (1 - t), ground.water > 0], axis=-1).astype(np.float32)


@njit(cache=True, parallel=True)
def _pixel_lobes(ground, position, is_ground, water, lobe, normal):
    for row in prange(water.shape[0]):
        for col in range(water.shape[1]):
            p = (position[row, col, 0], position[row, col, 1], position[row, col, 2])
            level = water_at(ground, p) if is_ground[row, col] else 0.0
            eta, roughness, n = lobe_at(ground, row, col, p, level)
            water[row, col] = level
            lobe[row, col, 0], lobe[row, col, 1] = roughness, eta
            for c in range(3):
                normal[row, col, c] = n[c]


@njit(cache=True, parallel=True)
def _bake_sky(picture: Picture, sky):
    """Fill a panorama as Cycles reads it: azimuth falls along the columns."""
    rows, cols = sky.shape[0], sky.shape[1]
    for row in prange(rows):
        z = np.cos((row + 0.5) / rows * np.pi)
        r = np.sqrt(1 - z * z)
        for col in range(cols):
            azimuth = (0.5 - (col + 0.5) / cols) * 2 * np.pi
            e = sky_radiance(picture, (r * np.cos(azimuth), r * np.sin(azimuth), z))
            for c in range(3):
                sky[row, col, c] = e[c]


@njit(cache=True, parallel=True)
def _bake_fill(picture, ground, vertices, fill, mean, is_ground, out):
    """Fill (V, 4): the radiance where the picture does not show the vertex, and whether it does."""
    for i in prange(len(vertices)):
        p = (float(vertices[i, 0]), float(vertices[i, 1]), float(vertices[i, 2]))
        x, y, z = project(picture.P, p)
        factor = 1.0
        if is_ground:
            factor += (ground.rho - 1.0) * min(1.0, 2.0 * water_at(ground, p))
        for c in range(3):
            out[i, c] = factor * (fill[i, c] if fill[i, 3] > 0.0 else mean[c])
        out[i, 3] = 1.0 if is_seen(picture, x, y, z, 0) else 0.0
