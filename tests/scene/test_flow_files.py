"""Every format gives back what was written, real files are read as their makers meant, and pictures are no flow."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.flow_files import Flow, as_flow, read_flow, read_uncertainty, write_flow


@pytest.fixture
def field() -> Flow:
    rng = np.random.default_rng(3)
    flow = rng.normal(0, 40, (7, 5, 2)).astype(np.float32)
    flow[2, 3] = np.nan
    flow[4, 0] = 1e10
    return as_flow(flow)


def test_what_is_not_finite_or_marked_is_unknown(field: Flow):
    assert (~field.valid).sum() == 2 and not field.valid[2, 3] and not field.valid[4, 0]
    assert np.isnan(field.flow[~field.valid]).all() and np.isfinite(field.flow[field.valid]).all()


@pytest.mark.parametrize("suffix", [".flo", ".flo5", ".pfm", ".npy", ".npz"])
def test_floating_formats_keep_every_bit(field: Flow, suffix: str, tmp_path: Path):
    write_flow(tmp_path / f"a{suffix}", field)
    back = read_flow(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(back.valid, field.valid)
    np.testing.assert_array_equal(back.flow, field.flow)


def test_kitti_png_keeps_a_128th_of_a_pixel_and_drops_what_it_cannot_hold(field: Flow, tmp_path: Path):
    flow = field.flow.copy()
    flow[0, 0] = 600, 0
    write_flow(tmp_path / "a.png", flow)
    back = read_flow(tmp_path / "a.png")
    wanted = field.valid.copy()
    wanted[0, 0] = False
    np.testing.assert_array_equal(back.valid, wanted)
    np.testing.assert_allclose(back.flow[wanted], flow[wanted], atol=1 / 128)


def test_kitti_png_has_u_in_red_for_everyone_else(tmp_path: Path):
    write_flow(tmp_path / "a.png", np.full((2, 3, 2), (1.0, -2.0), np.float32))
    blue, green, red = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)[0, 0]
    assert (red, green, blue) == (32768 + 64, 32768 - 128, 1)


def test_flo_bytes_are_those_of_the_benchmark(tmp_path: Path):
    write_flow(tmp_path / "a.flo", np.array([[[1.5, -2.0], [np.nan, 0]]]))
    assert (tmp_path / "a.flo").read_bytes() == struct.pack("<fii4f", 202021.25, 2, 1, 1.5, -2.0, 1e10, 1e10)


def test_pfm_rows_run_from_the_bottom(tmp_path: Path):
    (tmp_path / "a.pfm").write_bytes(b"PF\n1 2\n1.0\n" + struct.pack(">6f", 1, 2, 0, 3, 4, 0))
    np.testing.assert_array_equal(read_flow(tmp_path / "a.pfm").flow, [[[3, 4]], [[1, 2]]])


def test_opencv_reads_what_we_write_and_we_what_it_writes(field: Flow, tmp_path: Path):
    write_flow(tmp_path / "a.flo", field)
    np.testing.assert_array_equal(cv2.readOpticalFlow(str(tmp_path / "a.flo"))[field.valid], field.flow[field.valid])
    cv2.writeOpticalFlow(str(tmp_path / "b.flo"), np.nan_to_num(field.flow))
    np.testing.assert_array_equal(read_flow(tmp_path / "b.flo").flow, np.nan_to_num(field.flow))


def test_real_files_are_as_their_sources_say(shared_data: Path):
    whale = read_flow(shared_data / "middlebury_rubberwhale" / "flow10.flo")
    assert whale.size == (388, 584) and round(100 * whale.valid.mean(), 1) == 98.4
    lengths = np.hypot(*whale.flow[whale.valid].T)
    assert round(float(lengths.mean()), 3) == 1.256 and round(float(lengths.max()), 3) == 4.616
    kitti = read_flow(shared_data / "kitti_flow_pair" / "flow_gt.png")
    assert kitti.size == (375, 1242) and round(100 * kitti.valid.mean(), 1) == 16.2
    assert round(float(np.hypot(*kitti.flow[kitti.valid].T).mean()), 1) == 51.0


def png(path: Path, values: np.ndarray) -> None:
    path.write_bytes(cv2.imencode(".png", values)[1].tobytes())


def test_pngs_that_are_no_flow_are_refused(tmp_path: Path):
    rng = np.random.default_rng(0)
    png(tmp_path / "a.png", rng.integers(0, 255, (4, 5, 3)).astype(np.uint8))
    with pytest.raises(InputError, match=r"a\.png: it must be a 16-bit RGB PNG.*an RGB one of uint8"):
        read_flow(tmp_path / "a.png")
    png(tmp_path / "b.png", rng.integers(0, 65535, (4, 5)).astype(np.uint16))
    with pytest.raises(InputError, match=r"a grey one of uint16.*disparity"):
        read_flow(tmp_path / "b.png")
    png(tmp_path / "c.png", rng.integers(2, 65535, (4, 5, 3)).astype(np.uint16))
    with pytest.raises(InputError, match=r"0 or 1 in its third channel \(valid\), got \d+\. Is it a picture"):
        read_flow(tmp_path / "c.png")


def test_broken_files_are_refused_by_name(field: Flow, tmp_path: Path):
    for suffix in (".flo", ".flo5", ".pfm", ".npy", ".npz"):
        write_flow(tmp_path / f"a{suffix}", field)
        data = (tmp_path / f"a{suffix}").read_bytes()
        (tmp_path / f"cut{suffix}").write_bytes(data[: len(data) // 2])
        with pytest.raises(InputError, match=rf"cut\{suffix}: "):
            read_flow(tmp_path / f"cut{suffix}")
        (tmp_path / f"other{suffix}").write_bytes(b"something else entirely")
        with pytest.raises(InputError, match=rf"other\{suffix}: "):
            read_flow(tmp_path / f"other{suffix}")
    with pytest.raises(InputError, match=r"none\.flo: it must exist"):
        read_flow(tmp_path / "none.flo")
    with pytest.raises(InputError, match=r"must be one of \.flo, .*got \.jpg"):
        read_flow(tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"must be one of \.flo, "):
        write_flow(tmp_path / "a.jpg", field)


def test_wrong_shapes_and_names_say_what_was_found(tmp_path: Path):
    np.save(tmp_path / "a.npy", np.zeros((2, 8, 9)))
    with pytest.raises(InputError, match=r"shape \(height, width, 2\), got \(2, 8, 9\)\. Move the axis"):
        read_flow(tmp_path / "a.npy")
    np.savez(tmp_path / "a.npz", motion=np.zeros((8, 9, 2)))
    with pytest.raises(InputError, match="an array named flow, got motion"):
        read_flow(tmp_path / "a.npz")
    with h5py.File(tmp_path / "a.flo5", "w") as file:
        file["motion"] = np.zeros((8, 9, 2))
    with pytest.raises(InputError, match="a dataset named flow, got motion"):
        read_flow(tmp_path / "a.flo5")
    (tmp_path / "a.pfm").write_bytes(b"Pf\n1 2\n-1.0\n" + bytes(8))
    with pytest.raises(InputError, match=r"three channels \(PF\), got one"):
        read_flow(tmp_path / "a.pfm")
    with pytest.raises(InputError, match=r"valid of flow must have shape \(8, 9\)"):
        as_flow(np.zeros((8, 9, 2)), np.ones((9, 8)))


def test_uncertainties_are_scaled_by_what_the_user_knows(tmp_path: Path):
    png(tmp_path / "sigma.png", np.full((3, 4), 128, np.uint16))
    np.testing.assert_array_equal(read_uncertainty(tmp_path / "sigma.png", 256), np.full((3, 4), 0.5))
    with pytest.raises(InputError, match="scale must be positive"):
        read_uncertainty(tmp_path / "sigma.png", 0)
    np.save(tmp_path / "sigma.npy", np.full((3, 4), -1.0))
    with pytest.raises(InputError, match="non-negative"):
        read_uncertainty(tmp_path / "sigma.npy", 1)
