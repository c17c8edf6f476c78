"""Whatever is wrong with a drive, `scene-build` says in one line which file and key it is, and leaves no scene."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from scene.boxes import Box, write_boxes
from scene.cli import main
from scene.points import write_points

WIDTH, HEIGHT = 64, 24
POSE = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1]]


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Two frames with everything that can be damaged, and a static cloud as PLY."""
    folder = tmp_path / "drive"
    folder.mkdir()
    rng = np.random.default_rng(0)
    frames: list[dict[str, Any]] = []
    for i in range(2):
        cv2.imwrite(str(folder / f"{i}.png"), rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8))
        cv2.imwrite(str(folder / f"mask{i}.png"), rng.integers(0, 2, (HEIGHT, WIDTH), dtype=np.uint8))
        write_points(folder / f"{i}.npz", rng.uniform((-9, -9, -1.7), (9, 9, -1.68), (5000, 3)))
        write_boxes(folder / f"boxes{i}.json", (Box("1", "Car", np.eye(4), np.ones(3)),))
        camera = {"model": "PINHOLE", "width": WIDTH, "height": HEIGHT, "fx": 40.0, "fy": 40.0, "T_world_camera": POSE}
        T = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1.7], [0, 0, 0, 1]]
        sweep = {"file": f"{i}.npz", "T_world_points": T}
        boxes = {"file": f"boxes{i}.json", "T_world_boxes": np.eye(4).tolist()}
        frames.append({"image": f"{i}.png", "camera": camera, "points": sweep, "masks": {"file": f"mask{i}.png"}, "boxes": boxes})
    write_points(folder / "static.ply", rng.uniform((-9, -9, 0), (9, 9, 0.02), (5000, 3)))
    data = {"format": "recording/1", "points": "static.ply", "frames": frames}
    (folder / "recording.json").write_text(json.dumps(data))
    return folder


def cut(name: str) -> Callable[[Path], object]:
    """Leave the first two thirds of a file."""
    return lambda drive: (drive / name).write_bytes((drive / name).read_bytes()[: 2 * (drive / name).stat().st_size // 3])


def edit(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    """Change the recording.json."""

    def apply(drive: Path) -> None:
        data = json.loads((drive / "recording.json").read_text())
        change(data)
        (drive / "recording.json").write_text(json.dumps(data))

    return apply


def picture(name: str, width: int) -> Callable[[Path], object]:
    return lambda drive: cv2.imwrite(str(drive / name), np.zeros((HEIGHT, width), np.uint8))


def sweep(points: np.ndarray) -> Callable[[Path], object]:
    return lambda drive: np.savez(drive / "1.npz", points=points)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (edit(lambda data: (data["frames"].clear(), data.pop("points"))), "recording.json: frames must hold at least one frame"),
        (lambda drive: [file.unlink() for file in drive.iterdir()], "drive: it must be a recording; looked for recording.json"),
        (lambda drive: (drive / "1.png").unlink(), "recording.json: frames[1].image must name a file that exists, got 1.png"),
        (picture("1.png", WIDTH + 1), "1.png: the image must have the size of its camera, 64 x 24, got 65 x 24"),
        (sweep(np.zeros((0, 3))), "1.npz: it must hold points, got an empty cloud"),
        (sweep(np.full((9, 3), np.nan)), "1.npz: it must hold finite points, got NaN or infinity"),
        (cut("1.npz"), "1.npz: it must be a whole npz file"),
        (cut("static.ply"), "static.ply: it must be a whole PLY file"),
        (cut("1.png"), "1.png: it must be a whole PNG, got a truncated one"),
        (cut("boxes1.json"), "boxes1.json: it must be JSON"),
        (edit(lambda data: data["frames"][1]["camera"]["T_world_camera"][0].__setitem__(2, 2)),
         "recording.json: frames[1].camera.T_world_camera must be a rigid pose"),
        (picture("mask1.png", WIDTH - 1), "mask1.png: the mask must have the size of its camera, 64 x 24, got 63 x 24"),
        (edit(lambda data: data["frames"][1].update(msaks=1)), "recording.json: frames[1].msaks must be a known key"),
        (lambda drive: (drive / "recording.json").write_text((drive / "recording.json").read_text().replace(",", "", 1)),
         "recording.json: it must be JSON"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_with_file_and_key(drive, tmp_path, capsys, damage, words):
    damage(drive)
    assert main([str(drive), "-o", str(tmp_path / "scene"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("meniscus: ") and error.count("\n") == 1
    assert words in error
    assert not (tmp_path / "scene" / "scene.json").exists()


def test_a_place_that_takes_no_folder_is_named(drive, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main([str(drive), "-o", str(tmp_path / "file" / "scene"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert str(tmp_path / "file") in error and error.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX")
def test_a_write_that_fails_for_want_of_space_is_one_line_and_leaves_no_half_stage(drive, tmp_path):
    code = (
        "import resource, signal, sys; from scene.cli import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        # Only now, or the compiled kernels of a fresh checkout could not be kept.
        "import scene.reconstruction.build as build; write = build.write_cloud\n"
        "limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "build.write_cloud = lambda *args: (limit(), write(*args))\n"
        f"sys.exit(main([{str(drive)!r}, '-o', {str(tmp_path / 'scene')!r}, '--quiet', '--no-stereo']))"
    )
    place = Path(__file__).parents[2]
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=place)
    assert result.returncode == 2, result.stderr
    assert result.stderr.startswith("meniscus: ") and result.stderr.count("\n") == 1
    assert f"{tmp_path / 'scene' / '.stages' / 'cloud' / 'cloud.npz'}: it must stay below the file size limit" in result.stderr
    left = [path.name for path in (tmp_path / "scene").rglob("*") if path.is_file()]
    assert "scene.json" not in left and "cloud.npz" not in left
