"""A bent picture, straightened, is the picture that a pinhole would have taken."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.images import Encoding, read_image, read_raw, write_image, write_raw
from scene.recording import DisparityFile, Frame, MaskFile, Recording
from scene.sources.recording_copy import check_recording, copy_recording
from scene.sources.undistort import is_distorted, pinhole_of, undistort_ids, undistort_image

BARREL = Camera("OPENCV", 160, 90, np.eye(4), 120.0, 118.0, 83.0, 44.0, k1=-0.25, k2=0.02, p1=0.002, p2=-0.001)
PINCUSHION = replace(BARREL, k1=0.2)
LINEAR = Encoding(".exr", "float32", 3, "linear")


def smooth_world(camera: Camera) -> np.ndarray:
    """Return what a camera sees of a world whose colour is a smooth function of direction."""
    _, d = camera.rays(camera.pixel_centres())
    colour = np.stack([1 + np.sin(8 * d[:, 0]), 1 + np.cos(8 * d[:, 1]), 1 + d[:, 0] * d[:, 1]], axis=1)
    return colour.reshape(camera.height, camera.width, 3).astype(np.float32)


@pytest.mark.parametrize("camera", [BARREL, PINCUSHION])
def test_an_undistorted_picture_is_what_a_pinhole_sees(tmp_path: Path, camera: Camera) -> None:
    write_image(tmp_path / "bent.exr", smooth_world(camera), LINEAR)
    pinhole = pinhole_of(camera)
    undistort_image(tmp_path / "bent.exr", tmp_path / "straight.exr", camera, pinhole, None)
    straight, _ = read_image(tmp_path / "straight.exr")
    # The colour's second derivative per pixel is (8/f)^2: linear interpolation errs by an eighth of that per axis, and
    # OpenCV rounds positions to 1/32 px, 1/64 px off at most, of a slope 8/f per axis. The rim is filled within half a pixel.
    per_pixel = 8 / 118
    inner = np.s_[1:-1, 1:-1]
    bound = 2 * (1.5 * per_pixel**2 / 8 + 1.5 * per_pixel / 64)
    assert np.abs(straight - smooth_world(pinhole))[inner].max() < bound


def test_a_pincushion_is_zoomed_until_no_pixel_is_empty_and_a_barrel_is_not() -> None:
    assert pinhole_of(BARREL).fx == BARREL.fx
    pinhole = pinhole_of(PINCUSHION)
    assert pinhole.fx > PINCUSHION.fx
    origins, rays = pinhole.rays(pinhole.pixel_centres())
    xy, _ = PINCUSHION.project(origins + rays)
    assert np.all((xy >= 0) & (xy <= (160, 90)))


def test_ids_stay_ids(tmp_path: Path) -> None:
    ids = np.zeros((90, 160), np.uint16)
    ids[40:60, 20:50], ids[30:50, 100:140] = 3, 700
    write_raw(tmp_path / "bent.png", ids)
    undistort_ids(tmp_path / "bent.png", tmp_path / "straight.png", BARREL, pinhole_of(BARREL))
    straight = read_raw(tmp_path / "straight.png")
    assert straight.dtype == np.uint16
    assert set(np.unique(straight)) == {0, 3, 700}


def test_coefficients_of_no_lens_are_refused() -> None:
    with pytest.raises(InputError, match="the camera must be the distortion of a lens, got k1 -30"):
        pinhole_of(replace(BARREL, k1=-30.0))


def test_a_lens_with_coefficients_of_zero_is_no_lens() -> None:
    assert not is_distorted(replace(BARREL, k1=0.0, k2=0.0, p1=0.0, p2=0.0))


def test_the_copy_in_a_scene_has_pinhole_cameras(tmp_path: Path) -> None:
    write_image(tmp_path / "0.png", smooth_world(BARREL) / 3, Encoding(".png", "uint8", 3, "srgb"))
    write_raw(tmp_path / "mask.png", np.full((90, 160), 4, np.uint8))
    frame = Frame(tmp_path / "0.png", BARREL, masks=MaskFile(tmp_path / "mask.png"))
    copy = copy_recording(Recording((frame,), tmp_path), tmp_path / "copy")
    got = copy.frames[0]
    assert got.camera.model == "PINHOLE"
    assert got.masks is not None
    assert np.all(read_raw(got.masks.file) == 4)
    check_recording(copy)


def test_disparity_of_a_distorted_camera_is_refused(tmp_path: Path) -> None:
    write_raw(tmp_path / "0.png", np.zeros((90, 160), np.uint8))
    frame = Frame(tmp_path / "0.png", BARREL, disparity=DisparityFile(tmp_path / "0.png", 256.0, 0.5))
    with pytest.raises(InputError, match=r"frames\[0\]\.camera\.model must be PINHOLE where there is disparity"):
        check_recording(Recording((frame,), tmp_path))
