"""The whole way, on a tiny drive: one command makes a scene, a second run keeps it, and bad input is one clear line."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import laspy
import numpy as np
import pytest

from scene.camera import Camera
from scene.cli import main
from scene.recording import Frame, MaskFile, PointsFile, Recording, write_recording
from scene.scene_file import read_scene
from scene.transforms import look_at

from .synthetic_street import box_points, ring_points, street_height

SMALL = [
    "--no-stereo",
    "--environment-depth",
    "6",
    "--cell",
    "0.2",
    "--texel-deg",
    "2",
    "--surface-cell",
    "0.2",
    "--max-range",
    "20",
]


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    frames = []
    for index in range(3):
        rng = np.random.default_rng(index)
        x = 4.0 * index
        z = float(street_height(np.array([x]), np.array([0.0]))[0]) + 1.7
        wall = box_points(rng, (10.0, 7.0, 2.5), (24.0, 0.5, 4.0), 3000)
        T = np.eye(4)
        T[:3, 3] = (x, 0, z)
        np.savez(folder / f"{index}.npz", points=(np.concatenate([ring_points(rng, x), wall]) - T[:3, 3]).astype(np.float32))
        picture = np.full((60, 160, 3), 110, np.uint8) + rng.integers(0, 20, (60, 160, 3), dtype=np.uint8)
        picture[:25] = 235
        cv2.imwrite(str(folder / f"{index}.png"), picture)
        mask = np.zeros((60, 160), np.uint8)
        mask[28:40, 90:115] = 5
        cv2.imwrite(str(folder / f"mask{index}.png"), mask)
        camera = Camera("PINHOLE", 160, 60, look_at(T[:3, 3], T[:3, 3] + (10, 0, -0.6)), 120, 120, 80, 30)
        frames.append(
            Frame(
                folder / f"{index}.png",
                camera,
                points=PointsFile(folder / f"{index}.npz", T),
                masks=MaskFile(folder / f"mask{index}.png"),
            )
        )
    write_recording(folder / "recording.json", Recording(tuple(frames), folder, "tiny"))
    return folder


@pytest.fixture(scope="module")
def built(drive, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "scene"
    assert main([str(drive), "-o", str(folder), "--quiet", *SMALL]) == 0
    return folder


def test_one_command_makes_a_whole_scene(built):
    scene = read_scene(built)
    assert len(scene.recording.frames) == 3
    assert scene.ground.num_faces > 1000
    assert scene.environment.num_faces > 100
    assert all(boards[0].instance == 5 for boards in scene.cardboards)
    for name in ("report.json", "report.md", "scene.glb", "preview/top.png", "preview/scene.png", "preview/overlay_0.png"):
        assert (built / name).stat().st_size > 0
    report = json.loads((built / "report.json").read_text())
    # 1 cm of noise in the points; three sweeps.
    assert report["surfaces"]["ground"]["held_out_within_15_m_of_path_m"]["median"] < 0.02
    assert report["surfaces"]["ground"]["edge_manifold"]
    assert report["ground_coverage"]["within 3 m"] > 0.95


def test_boxes_serve_where_there_are_no_masks(drive, tmp_path):
    shutil.copytree(drive, tmp_path / "drive")
    data = json.loads((drive / "recording.json").read_text())
    for index, frame in enumerate(data["frames"]):
        del frame["masks"]
        z = float(street_height(np.array([10.0 + 4 * index]), np.array([0.0]))[0])
        box = {"track": 4, "class": "Car", "centre": [10.0 + 4 * index, 0.0, z + 0.8], "size": [4.2, 1.8, 1.6]}
        (tmp_path / "drive" / f"boxes{index}.json").write_text(json.dumps({"format": "boxes/1", "boxes": [box]}))
        frame["boxes"] = {"file": f"boxes{index}.json", "T_world_boxes": np.eye(4).tolist()}
    (tmp_path / "drive" / "recording.json").write_text(json.dumps(data))
    assert main([str(tmp_path / "drive"), "-o", str(tmp_path / "scene"), "--quiet", *SMALL]) == 0
    scene = read_scene(tmp_path / "scene")
    for index, (frame, (board,)) in enumerate(zip(scene.recording.frames, scene.cardboards, strict=True)):
        assert frame.masks is not None and frame.masks.classes == {1: "vehicle"} and frame.boxes is not None
        # The car ahead shows its back, 2.1 m before its centre.
        assert np.allclose(board.corners_world[:, 0], 7.9 + 4 * index, atol=1e-6)


def test_a_surveyed_cloud_in_map_coordinates_and_its_pictures_make_a_scene(drive, tmp_path):
    shutil.copytree(drive, tmp_path / "drive")
    data = json.loads((drive / "recording.json").read_text())
    origin, world = np.array([512_000.0, 5_403_000.0, 110.0]), []
    for frame in data["frames"]:
        sweep = frame.pop("points")
        del frame["masks"]
        points = np.load(drive / sweep["file"])["points"]
        points = points[np.linalg.norm(points, axis=1) < 12]
        world.append(points + np.array(sweep["T_world_points"])[:3, 3] + origin)
        for row, shift in zip(frame["camera"]["T_world_camera"], (*origin, 0.0), strict=True):
            row[3] += shift
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = origin, np.full(3, 0.001)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = np.concatenate(world).T
    cloud.write(str(tmp_path / "drive" / "survey.laz"))
    data["points"] = "survey.laz"
    (tmp_path / "drive" / "recording.json").write_text(json.dumps(data))
    assert main([str(tmp_path / "drive"), "-o", str(tmp_path / "scene"), "--quiet", *SMALL]) == 0
    scene = read_scene(tmp_path / "scene")
    # The world was moved to the middle of the path, in whole metres, and the settings say by how much.
    moved = np.array(scene.settings["world_offset"])
    assert np.abs(scene.recording.frames[1].camera.position).max() < 1.5
    assert np.allclose(moved, -(origin + np.array([4.0, 0.0, 2.0])), atol=1.0)
    report = json.loads((tmp_path / "scene" / "report.json").read_text())
    # As from the sweeps: 1 cm of noise, and the millimetre of the file.
    assert report["surfaces"]["ground"]["held_out_within_15_m_of_path_m"]["median"] < 0.02
    assert report["ground_coverage"]["within 3 m"] > 0.95


def test_a_second_run_keeps_every_stage(drive, built, capsys):
    before = {path: path.stat().st_mtime_ns for path in built.rglob("*") if path.is_file()}
    assert main([str(drive), "-o", str(built), *SMALL]) == 0
    assert {path: path.stat().st_mtime_ns for path in built.rglob("*") if path.is_file()} == before
    assert "scene.json: 3 frames" in capsys.readouterr().out


def test_a_changed_setting_makes_anew_only_what_depends_on_it(drive, built):
    def made() -> dict[str, int]:
        return {path.parent.name: path.stat().st_mtime_ns for path in (built / ".stages").glob("*/stage.json")}

    before = made()
    assert main([str(drive), "-o", str(built), "--quiet", *SMALL, "--fill-deg", "2"]) == 0
    after = made()
    assert {name for name in after if after[name] != before[name]} == {"sky"}


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--frames", "7:9"], "--frames must name some of the 3 frames"),
        (["--frames", "x"], "--frames must be FROM:TO"),
        (["--settings", "missing.toml"], "missing.toml: it must exist"),
    ],
)
def test_a_wrong_option_is_one_line_and_exit_code_2(drive, tmp_path, capsys, extra, words):
    assert main([str(drive), "-o", str(tmp_path / "scene"), "--quiet", *extra]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("flag", "value"),
    [("voxel", "0"), ("cell", "-1"), ("texel-deg", "nan"), ("environment-depth", "99"), ("seed", "-1"), ("max-range", "inf")],
)
def test_a_flag_out_of_range_is_named_as_typed_and_nothing_is_made(drive, tmp_path, capsys, flag, value):
    assert main([str(drive), "-o", str(tmp_path / "scene"), "--quiet", f"--{flag}", value]) == 2
    assert f"meniscus: --{flag} must lie in " in capsys.readouterr().err
    assert not (tmp_path / "scene").exists()


def test_a_range_in_a_settings_file_is_named_by_its_dotted_key(drive, tmp_path, capsys):
    (tmp_path / "s.toml").write_text("[height_field]\nsurface_cell = 0\n")
    assert main([str(drive), "-o", str(tmp_path / "scene"), "--quiet", "--settings", str(tmp_path / "s.toml")]) == 2
    assert "s.toml: height_field.surface_cell must lie in [0.01, 10], got 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data["frames"][1]["camera"].update(model="ORTHOGRAPHIC", pixel_size=0.1), "frames[1].camera.model must be"),
        (lambda data: [row.__setitem__(3, row[3] + 9000) for f in data["frames"] for row in f["points"]["T_world_points"][:1]],
         "points of the cloud must lie within 500 m of a camera"),
        (lambda data: [frame.pop("points") for frame in data["frames"]], "the recording must hold points"),
    ],
)  # fmt: skip
def test_a_recording_that_makes_no_scene_is_named(drive, tmp_path, capsys, change, words):
    shutil.copytree(drive, tmp_path / "drive")
    data = json.loads((drive / "recording.json").read_text())
    change(data)
    (tmp_path / "drive" / "recording.json").write_text(json.dumps(data))
    assert main([str(tmp_path / "drive"), "-o", str(tmp_path / "scene"), "--quiet", *SMALL]) == 2
    error = capsys.readouterr().err
    assert str(tmp_path / "drive") in error
    assert words in error
    assert error.count("\n") == 1


def test_bad_input_leaves_no_folder_behind(drive, tmp_path):
    shutil.copytree(drive, tmp_path / "drive")
    (tmp_path / "drive" / "1.png").write_bytes(b"")
    assert main([str(tmp_path / "drive"), "-o", str(tmp_path / "scene"), "--quiet"]) == 2
    assert not (tmp_path / "scene").exists()


def test_a_typo_in_a_settings_file_is_named(drive, tmp_path, capsys):
    (tmp_path / "s.toml").write_text("[cloud]\nvoxle = 0.1\n")
    assert main([str(drive), "-o", str(tmp_path / "scene"), "--quiet", "--settings", str(tmp_path / "s.toml")]) == 2
    assert "cloud.voxle must be a known setting" in capsys.readouterr().err


def test_a_file_in_place_of_the_output_folder_is_refused(drive, tmp_path, capsys):
    (tmp_path / "scene").write_text("")
    assert main([str(drive), "-o", str(tmp_path / "scene"), "--quiet"]) == 2
    assert "must be a folder, got a file" in capsys.readouterr().err


def test_a_truncated_sweep_is_named_and_leaves_no_scene(drive, tmp_path, capsys):
    shutil.copytree(drive, tmp_path / "drive")
    sweep = tmp_path / "drive" / "1.npz"
    sweep.write_bytes(sweep.read_bytes()[:1000])
    assert main([str(tmp_path / "drive"), "-o", str(tmp_path / "scene"), "--quiet", *SMALL]) == 2
    assert "1.npz" in capsys.readouterr().err
    assert not (tmp_path / "scene" / "scene.json").exists()
    assert not (tmp_path / "scene" / ".stages" / "cloud").exists()


def test_help_loads_no_numerics():
    code = (
        "import sys; from scene.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "sys.exit('numpy' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2]
    )
    assert result.returncode == 0
    assert "--wetness" not in result.stdout
    assert "--environment-depth" in result.stdout
