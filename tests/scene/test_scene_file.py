from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.grid import GroundGrid
from scene.images import write_exr, write_raw
from scene.mesh import Mesh
from scene.recording import Frame, Recording, write_recording
from scene.scene_file import GROUND_MAPS, Cardboard, Scene, Sky, cardboard_mesh, read_scene, write_scene
from scene.transforms import look_at

rng = np.random.default_rng(3)
BOARD = Cardboard(7, "vehicle", np.array([[0, 5, 0], [1, 5, 0], [1, 5, 1], [0, 5, 1]], np.float64))


def scene(folder: Path) -> Scene:
    """A triangle of ground below another, seen in two frames."""
    camera = Camera("PINHOLE", 8, 6, look_at((0, 0, 1.5), (0, 5, 0)), 8.0, 8.0, 4.0, 3.0)
    frames = []
    for i in range(2):
        write_raw(folder / "recording" / f"{i}.png", np.full((6, 8, 3), 100, np.uint8))
        frames.append(Frame(folder / "recording" / f"{i}.png", camera))
    recording = Recording(tuple(frames), folder / "recording", "small")
    write_recording(folder / "recording" / "recording.json", recording)
    triangle = Mesh(np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0]], np.float32), np.array([[0, 1, 2]], np.uint32))
    fill = {name: rng.random(3).astype(np.float32) for name in ("fill_r", "fill_g", "fill_b", "fill_w")}
    return Scene(
        "small",
        recording,
        replace(triangle.with_smooth_normals(), attributes=fill),
        triangle,
        GroundGrid(0.0, 0.0, 0.5, 18, 18),
        {name: rng.random((18, 18)).astype(np.float32) for name in GROUND_MAPS},
        Sky(rng.random((4, 8, 4)).astype(np.float32)),
        {name: np.array([0.1, 0.2, 0.3], np.float32) for name in ("ground", "environment", "vehicle", "pedestrian")},
        ((BOARD,), ()),
        {"cell": 0.5, "nested": {"depth": 12}},
    )


def changed(folder: Path, path: tuple[Any, ...], new: Any) -> None:
    file = folder / "scene.json"
    value = json.loads(file.read_text())
    place = value
    for step in path[:-1]:
        place = place[step]
    if new is None:
        del place[path[-1]]
    else:
        place[path[-1]] = new
    file.write_text(json.dumps(value))


def test_a_scene_written_and_read_again_is_the_same(tmp_path):
    was = scene(tmp_path)
    write_scene(tmp_path, was)
    now = read_scene(tmp_path)
    assert (now.name, now.grid, now.settings) == (was.name, was.grid, was.settings)
    for name in GROUND_MAPS:
        assert np.array_equal(now.maps[name], was.maps[name])
    assert np.array_equal(now.sky.panorama, was.sky.panorama)
    assert np.array_equal(now.ground.vertices, was.ground.vertices)
    assert np.array_equal(now.ground.attributes["fill_w"], was.ground.attributes["fill_w"])
    assert np.array_equal(now.class_means["ground"], was.class_means["ground"])
    assert [len(boards) for boards in now.cardboards] == [1, 0]
    assert np.array_equal(now.cardboards[0][0].corners_world, BOARD.corners_world)
    assert [f.name for f in now.recording.frames] == ["0", "1"]


def test_a_scene_can_be_moved_to_another_folder(tmp_path):
    write_scene(tmp_path / "a", scene(tmp_path / "a"))
    (tmp_path / "a").rename(tmp_path / "b")
    assert read_scene(tmp_path / "b").name == "small"


def test_a_folder_without_scene_json_is_no_scene(tmp_path):
    with pytest.raises(InputError, match=r"must be a scene \(with a scene\.json\)\. Build it with scene-build"):
        read_scene(tmp_path)


@pytest.mark.parametrize(
    ("path", "new", "words"),
    [
        (("grund",), 1, r"scene\.json: grund must be a known key\. Check its spelling\. Build the scene again"),
        (("ground_maps", "cell"), 0.0, r"scene\.json: ground_maps\.cell must lie in \(0, inf\), got 0"),
        (("ground_maps", "rows"), 17, r"height\.exr: it must have the grid's shape \(17, 18\), got \(18, 18\)"),
        (("ground_maps", "maps", "puddles"), None, r"scene\.json: ground_maps\.maps\.puddles must be given"),
        (("ground_maps", "maps", "mask"), "../mask.exr", r"ground_maps\.maps\.mask must be a path below the folder"),
        (("ground",), "/etc/passwd", "ground must be a path below the folder"),
        (("sky",), "maps/none.exr", r"none\.exr: it must exist"),
        (("sky",), "maps/mask.exr", r"mask\.exr: it must have the channel R, got Y"),
        (("frames", 0, "gain"), 0, r"frames\[0\]\.gain must lie in"),
        (("class_means", "ground"), [0.1], r"class_means\.ground must have shape \(3,\), got \(1,\)"),
        (("frames", 0, "name"), "other", "frames must list the frames of the recording"),
        (
            ("frames", 0, "cardboards", 0, "corners_world"),
            [[0, 0, 0]],
            r"frames\[0\]\.cardboards\[0\]\.corners_world must be four corners",
        ),
        (("frames", 0, "cardboards", 0, "kind"), "ufo", r"frames\[0\]\.cardboards\[0\]\.kind must be a word that the format knows"),
    ],
)
def test_a_scene_that_breaks_the_format_is_refused_by_file_and_key(tmp_path, path, new, words):
    write_scene(tmp_path, scene(tmp_path))
    changed(tmp_path, path, new)
    with pytest.raises(InputError, match=words):
        read_scene(tmp_path)


def test_a_damaged_map_is_refused_by_its_name(tmp_path):
    write_scene(tmp_path, scene(tmp_path))
    file = tmp_path / "maps" / "moisture.exr"
    file.write_bytes(file.read_bytes()[:-50])
    with pytest.raises(InputError, match=r"moisture\.exr: it must be a whole OpenEXR file"):
        read_scene(tmp_path)


def test_a_write_that_fails_leaves_no_scene(tmp_path, monkeypatch):
    def fail(path, channels):
        if Path(path).name == "sky.exr":
            raise OSError(28, "No space left on device")
        write_exr(path, channels)

    monkeypatch.setattr("scene.scene_file.write_exr", fail)
    with pytest.raises(OSError, match="No space"):
        write_scene(tmp_path, scene(tmp_path))
    assert not (tmp_path / "scene.json").exists()


def test_two_images_of_one_name_cannot_share_a_scene(tmp_path):
    was = scene(tmp_path)
    twice = replace(was.recording, frames=was.recording.frames[:1] * 2)
    with pytest.raises(InputError, match="each image of a scene must have a name of its own, got 0"):
        write_scene(tmp_path, replace(was, recording=twice))


def test_cardboards_of_a_frame_become_one_mesh():
    mesh = cardboard_mesh((BOARD, replace(BOARD, instance=9)))
    assert mesh.num_faces == 4
    assert mesh.attributes["instance"].tolist() == [7] * 4 + [9] * 4
    # Bottom left, bottom right, top right as the camera (looking along +y) sees it: the normal points back to it.
    assert np.allclose(mesh.face_normals(), [0, -1, 0])
