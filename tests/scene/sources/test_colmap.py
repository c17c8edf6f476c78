"""A COLMAP model becomes a recording whose cameras put the points on COLMAP's own pixels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.points import read_points_far
from scene.sources.colmap import camera_of, open_colmap
from scene.transforms import look_at

pycolmap = pytest.importorskip("pycolmap")
WIDTH, HEIGHT = 64, 48
# COLMAP's worlds stand anyhow; this one lies on its side.
SIDE = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


def make_model(root: Path, text: bool = False) -> tuple[Path, np.ndarray]:
    """Write a model of six upright cameras around a hundred points, in a world turned on its side."""
    rng = np.random.default_rng(3)
    world = rng.uniform(-1, 1, (100, 3))
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="OPENCV", width=WIDTH, height=HEIGHT, params=[60, 61, 31, 25, 0.05, -0.02, 1e-3, 2e-3], camera_id=1
    )
    model.add_camera_with_trivial_rig(camera)
    (root / "images").mkdir(parents=True)
    observations: list[list[tuple[int, int]]] = [[] for _ in world]
    for i, angle in enumerate(np.arange(6) * np.pi / 3):
        pose = look_at((6 * np.cos(angle), 6 * np.sin(angle), 1.5), (0, 0, 0))
        T = np.eye(4)
        T[:3, :3] = SIDE @ pose[:3, :3]
        T[:3, 3] = SIDE @ pose[:3, 3]
        image = pycolmap.Image(name=f"{i:03d}.png", camera_id=1, image_id=i + 1)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.zeros(2)) for _ in world])
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(np.linalg.inv(T)[:3]))
        for k in range(len(world)):
            observations[k].append((i + 1, k))
        cv2.imwrite(str(root / "images" / f"{i:03d}.png"), np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    for point, seen in zip(world, observations, strict=True):
        track = pycolmap.Track()
        for image_id, index in seen:
            track.add_element(image_id, index)
        model.add_point3D(SIDE @ point, track, np.zeros(3, np.uint8))
    for point in model.points3D.values():
        point.error = 0.5
    folder = root / "sparse" / "0"
    folder.mkdir(parents=True)
    (model.write_text if text else model.write_binary)(str(folder))
    return folder, world


@pytest.mark.parametrize("text", [False, True])
def test_a_world_on_its_side_is_turned_upright(tmp_path: Path, text: bool) -> None:
    folder, world = make_model(tmp_path / "model", text)
    recording = open_colmap(tmp_path / "model", tmp_path / "work")
    assert len(recording.frames) == 6
    assert recording.points
    points = read_points_far(recording.points)
    # Six level cameras look to all sides, so the vertical is exact; the turn about it is free, heights are not.
    np.testing.assert_allclose(np.sort(points[:, 2]), np.sort(world[:, 2]), atol=1e-6)
    np.testing.assert_allclose([f.camera.position[2] for f in recording.frames], 1.5, atol=1e-9)
    model = pycolmap.Reconstruction(str(folder))
    image = next(i for i in model.images.values() if i.name == "002.png")
    theirs = np.array([image.project_point(SIDE @ p) for p in world])
    ours, _ = recording.frames[2].camera.project(points)
    for xy in theirs:
        # Points are stored as float32: 1e-7 of 1 m at 60 px over 5 m.
        assert np.abs(ours - xy).sum(axis=1).min() < 1e-4


def test_the_model_folder_alone_finds_its_images(tmp_path: Path) -> None:
    folder, _ = make_model(tmp_path / "model")
    assert len(open_colmap(folder, tmp_path / "work").frames) == 6
    (tmp_path / "model" / "images" / "003.png").unlink()
    assert [f.name for f in open_colmap(folder, tmp_path / "work").frames] == ["000", "001", "002", "004", "005"]


def test_bad_models_are_refused(tmp_path: Path) -> None:
    folder, _ = make_model(tmp_path / "model")
    with pytest.raises(InputError, match="hold a COLMAP model"):
        open_colmap(tmp_path / "model" / "images", tmp_path / "work")
    for file in (tmp_path / "model" / "images").iterdir():
        file.rename(file.with_suffix(".away"))
    with pytest.raises(InputError, match="have its images beside it"):
        open_colmap(folder, tmp_path / "work")
    fisheye = pycolmap.Camera(model="OPENCV_FISHEYE", width=8, height=8, params=[5, 5, 4, 4, 0, 0, 0, 0], camera_id=1)
    with pytest.raises(InputError, match="camera model must be one of"):
        camera_of(fisheye, np.eye(4))
    images = folder / "images.bin"
    images.write_bytes(images.read_bytes()[:100])
    with pytest.raises(InputError, match="whole COLMAP model"):
        open_colmap(folder, tmp_path / "work")
