"""Photographs alone give cameras and points, up to the scale that they cannot know."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.points import read_points
from scene.recording import Frame, Recording
from scene.sources.structure_from_motion import ASSUMED_DISTANCE, open_images, sparse_points
from scene.transforms import look_at

pytest.importorskip("pycolmap")
WIDTH, HEIGHT, FOCAL = 400, 300, 420.0
# A floor and two walls of a corner, 6 m wide, each a textured rectangle: a corner of it and its two sides.
PLANES = (((-3, -3, 0), (6, 0, 0), (0, 6, 0)), ((-3, 3, 0), (6, 0, 0), (0, 0, 4)), ((3, 3, 0), (0, -6, 0), (0, 0, 4)))


def photographs(folder: Path, angles: list[float]) -> list[Frame]:
    """Photograph the corner from a ring of upright cameras."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    textures = []
    for _ in PLANES:
        layers = [
            cv2.resize(rng.uniform(0, 1, (n, n)).astype(np.float32), (900, 900), interpolation=cv2.INTER_CUBIC)
            for n in (40, 120, 300)
        ]
        mixed = np.sum(layers, axis=0)
        textures.append(np.clip(255 * (mixed - mixed.min()) / np.ptp(mixed), 0, 255).astype(np.uint8))
    frames = []
    for i, angle in enumerate(angles):
        pose = look_at((-7 * np.sin(angle), -7 * np.cos(angle), 3.0), (0.8, 0.8, 1.0))
        camera = Camera("PINHOLE", WIDTH, HEIGHT, pose, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
        image = np.zeros((HEIGHT, WIDTH), np.uint8)
        for (origin, u, v), texture in zip(PLANES, textures, strict=True):
            corners = np.array(origin) + np.array([np.zeros(3), u, np.add(u, v), v])
            xy, _ = camera.project(corners)
            H = cv2.getPerspectiveTransform(
                np.array([[0, 0], [900, 0], [900, 900], [0, 900]], np.float32), (xy - 0.5).astype(np.float32)
            )
            seen = cv2.warpPerspective(texture, H, (WIDTH, HEIGHT), flags=cv2.INTER_AREA)
            image = np.where(cv2.warpPerspective(np.full_like(texture, 255), H, (WIDTH, HEIGHT)) > 127, seen, image)
        cv2.imwrite(str(folder / f"{i}.png"), image)
        frames.append(Frame(folder / f"{i}.png", camera))
    return frames


def distance_to_corner(points: np.ndarray) -> np.ndarray:
    return np.min(np.abs([points[:, 2], points[:, 1] - 3, points[:, 0] - 3]), axis=0)


def test_a_corner_is_reconstructed_up_to_scale_and_stands_upright(tmp_path: Path) -> None:
    truth = photographs(tmp_path / "images", [-0.1, 0.15, 0.4, 0.65, 0.9, 1.15])
    recording = open_images(tmp_path, tmp_path / "work")
    assert [f.name for f in recording.frames] == [str(i) for i in range(6)]
    a = np.stack([f.camera.position for f in recording.frames])
    b = np.stack([f.camera.position for f in truth])
    # Similarity alignment (Umeyama 1991).
    A, B = a - a.mean(axis=0), b - b.mean(axis=0)
    U, S, Vt = np.linalg.svd(B.T @ A)
    sign = np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))])
    R, scale = U @ sign @ Vt, np.trace(np.diag(S) @ sign) / np.sum(A**2)
    # Features are good to about half a pixel of 420: 8 mm at 7 m each. The focal length is estimated as well, which a
    # ring determines to about a percent of 7 m.
    assert np.linalg.norm(scale * A @ R.T - B, axis=1).max() < 0.07
    assert np.arccos((R @ [0, 0, 1])[2]) < np.deg2rad(3)
    assert recording.points
    points = read_points(recording.points)[:, :3].astype(np.float64)
    distances = np.linalg.norm(points - a.mean(axis=0), axis=1)
    assert 0.5 * ASSUMED_DISTANCE < np.median(distances) < 2 * ASSUMED_DISTANCE
    world = (scale * (points - a.mean(axis=0))) @ R.T + b.mean(axis=0)
    assert np.median(distance_to_corner(world)) < 0.05
    # The model is kept: opening again gives the same to the bit.
    again = open_images(tmp_path, tmp_path / "work")
    for f, g in zip(recording.frames, again.frames, strict=True):
        np.testing.assert_array_equal(f.camera.T_world_camera, g.camera.T_world_camera)


def test_known_cameras_triangulate_the_corner_where_it_is(tmp_path: Path) -> None:
    frames = photographs(tmp_path / "images", [0.2, 0.5, 0.8, 1.1])
    file = sparse_points(Recording(tuple(frames), tmp_path, "corner"), tmp_path / "work")
    assert file
    points = read_points(file)
    assert len(points) > 100
    # Half a pixel at 7 m over rays that part by 17 to 50 degrees: 0.5 / 420 * 7 / sin(17 deg) = 28 mm for one point.
    assert np.median(distance_to_corner(points)) < 0.028
    assert [p.name for p in (tmp_path / "work").iterdir()] == [file.name]


def test_pictures_of_nothing_are_refused(tmp_path: Path) -> None:
    for i in range(3):
        cv2.imwrite(str(tmp_path / f"{i}.png"), np.full((60, 80), 128, np.uint8))
    with pytest.raises(InputError, match="one textured, static scene"):
        open_images(tmp_path, tmp_path / "work")
    (tmp_path / "2.png").unlink()
    with pytest.raises(InputError, match="at least three images, got 2"):
        open_images(tmp_path, tmp_path / "work")
