"""Depth is read in metres from the files of the field; what is no depth is named."""

from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.depth_files import read_depth
from scene.images import write_exr, write_raw


def test_kittis_depth_is_stored_times_256_and_0_is_none(tmp_path):
    write_raw(tmp_path / "d.png", np.array([[0, 256], [640, 65535]], np.uint16))
    np.testing.assert_array_equal(read_depth(tmp_path / "d.png", 256), np.array([[np.nan, 1], [2.5, 65535 / 256]], np.float32))


def test_infinite_depth_stays_and_negative_or_nan_is_none(tmp_path):
    depth = np.array([[np.inf, -1], [np.nan, 3]], np.float32)
    write_exr(tmp_path / "d.exr", {"depth.Z": depth, "other.X": np.zeros((2, 2), np.float32)})
    np.save(tmp_path / "d.npy", depth)
    for name in ("d.exr", "d.npy"):
        np.testing.assert_array_equal(read_depth(tmp_path / name), np.array([[np.inf, np.nan], [np.nan, 3]], np.float32))


@pytest.mark.parametrize(
    ("name", "write", "words"),
    [
        ("d.png", lambda file: write_raw(file, np.zeros((2, 2, 3), np.uint8)), "the depth must hold one number a pixel"),
        ("d.exr", lambda file: write_exr(file, {"X": np.zeros((2, 2), np.float32)}), "must have one of the channels depth.Z"),
        ("d.npy", lambda file: file.write_bytes(b"no"), "must be a whole .npy file"),
        ("d.npy", lambda file: None, "must exist"),
        ("d.txt", lambda file: file.touch(), "must be one of .png, .exr, .npy, got .txt"),
    ],
)
def test_what_is_no_depth_is_refused(tmp_path, name, write, words):
    write(tmp_path / name)
    with pytest.raises(InputError, match=words):
        read_depth(tmp_path / name)
