"""Point clouds keep their coordinates through every file format, and damaged files are refused by name."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.points import read_points, read_points_far, write_points


@pytest.fixture
def cloud() -> np.ndarray:
    return np.random.default_rng(0).uniform(-50, 50, (200, 4)).astype(np.float32)


@pytest.mark.parametrize("suffix", [".npz", ".bin", ".ply"])
def test_points_come_back_to_the_bit(tmp_path: Path, cloud: np.ndarray, suffix: str) -> None:
    write_points(tmp_path / f"cloud{suffix}", cloud)
    np.testing.assert_array_equal(read_points(tmp_path / f"cloud{suffix}"), cloud)


@pytest.mark.parametrize(("ascii", "compressed"), [(True, False), (False, False), (False, True)])
def test_pcd_of_all_three_kinds_is_read(tmp_path: Path, cloud: np.ndarray, ascii: bool, compressed: bool) -> None:
    o3d = pytest.importorskip("open3d")
    pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud[:, :3].astype(np.float64)))
    file = tmp_path / "cloud.pcd"
    o3d.io.write_point_cloud(str(file), pcd, write_ascii=ascii, compressed=compressed)
    # ASCII is written with 10 significant digits; float32 needs 9.
    np.testing.assert_allclose(read_points(file), cloud[:, :3], rtol=1e-7)
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"cloud.pcd.*truncated"):
        read_points(file)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_is_read_and_a_cut_one_refused(tmp_path: Path, cloud: np.ndarray, suffix: str) -> None:
    laspy = pytest.importorskip("laspy")
    if suffix == ".laz" and not laspy.LazBackend.detect_available():
        pytest.skip("laspy has no LAZ backend here")
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = np.full(3, 0.001)
    las = laspy.LasData(header)
    las.x, las.y, las.z = cloud[:, :3].astype(np.float64).T
    las.intensity = np.arange(len(cloud), dtype=np.uint16)
    file = tmp_path / f"cloud{suffix}"
    las.write(str(file))
    points = read_points(file)
    # LAS stores whole millimetres.
    np.testing.assert_allclose(points[:, :3], cloud[:, :3], atol=0.00051)
    np.testing.assert_array_equal(points[:, 3], np.arange(len(cloud)))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(InputError, match=f"cloud{suffix}"):
        read_points(file)


def test_rows_without_a_return_are_left_out_and_counted(
    tmp_path: Path, cloud: np.ndarray, caplog: pytest.LogCaptureFixture
) -> None:
    cloud[3, 0], cloud[7, 2] = np.nan, np.inf
    np.savez(tmp_path / "cloud.npz", points=cloud)
    with caplog.at_level(logging.INFO, "meniscus"):
        assert len(read_points(tmp_path / "cloud.npz")) == 198
    assert "2 of 200" in caplog.text


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.full((5, 3), np.nan), "must hold finite points"),
        (np.zeros((0, 3)), "must hold points, got an empty cloud"),
        (np.zeros((5, 2)), "must have shape"),
        (np.zeros(5), "must have shape"),
    ],
)
def test_a_cloud_without_points_is_refused(tmp_path: Path, points: np.ndarray, words: str) -> None:
    np.savez(tmp_path / "cloud.npz", points=points)
    with pytest.raises(InputError, match=rf"cloud.npz.*{words}"):
        read_points(tmp_path / "cloud.npz")


@pytest.mark.parametrize("suffix", [".npz", ".bin", ".ply"])
def test_a_truncated_file_is_refused(tmp_path: Path, cloud: np.ndarray, suffix: str) -> None:
    file = tmp_path / f"cloud{suffix}"
    write_points(file, cloud)
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(InputError, match=f"cloud{suffix}"):
        read_points(file)


def test_other_files_are_refused_by_what_they_lack(tmp_path: Path) -> None:
    np.savez(tmp_path / "cloud.npz", xyz=np.zeros((3, 3)))
    with pytest.raises(InputError, match="array `points`, got xyz"):
        read_points(tmp_path / "cloud.npz")
    with pytest.raises(InputError, match="must exist"):
        read_points(tmp_path / "nothing.npz")
    (tmp_path / "cloud.txt").write_text("0 0 0")
    with pytest.raises(InputError, match="be one of"):
        read_points(tmp_path / "cloud.txt")
    (tmp_path / "cloud.pcd").write_text("0 0 0\n")
    with pytest.raises(InputError, match="no DATA line"):
        read_points(tmp_path / "cloud.pcd")
    with pytest.raises(InputError, match="have shape"):
        write_points(tmp_path / "out.npz", np.zeros((3, 2)))


def test_map_coordinates_would_lose_millimetres_and_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "cloud.npz", points=np.array([[456000.125, 5428000.0, 110.0]]))
    with pytest.raises(InputError, match="within 16 km"):
        read_points(tmp_path / "cloud.npz")
    assert read_points_far(tmp_path / "cloud.npz")[0, 0] == 456000.125
