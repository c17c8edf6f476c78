from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from evaluate.diagnose_cli import main
from evaluate.mismatch.pictures.folders import load_folders
from evaluate.mismatch.pictures.noise import rounding_variance
from materials.foundation.errors import InputError
from scene.images import Encoding, decode

from .collages import collage, noisy, vignetted, written

FRAMES = 3


@pytest.fixture
def folders(tmp_path):
    S = collage(FRAMES, 48, 64)
    return written(tmp_path / "a", S), written(tmp_path / "b", noisy(vignetted(S, 2.0)))


def test_the_command_explains_two_folders(folders, tmp_path, capsys):
    a, b = folders
    assert main(["--simulated", str(a), "--recorded", str(b), "-o", str(tmp_path / "out"), "--focal-px", "64"]) == 0
    said = capsys.readouterr()
    assert "explained" in said.out
    assert "cannot be tested (needs depth: give --depth): participating_medium, height_fog" in said.err
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [e["id"] for e in found["effects"]] == ["vignetting"]
    assert found["not_testable"]["moved_object"].endswith("give --masks")
    assert found["noise"]["stated"] is False
    assert any("states no noise" in note for note in found["notes"])
    assert len(list((tmp_path / "out" / "corrected" / "images").glob("*.exr"))) == FRAMES
    assert not (tmp_path / "out" / "corrected" / "simulation.json").exists()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Could not be tested (needs depth: give --depth): participating_medium, height_fog" in page


def test_folders_without_a_common_name_are_paired_in_order(folders, tmp_path):
    a, _ = folders
    other = written(tmp_path / "c", noisy(collage(FRAMES, 48, 64)), ["x", "y", "z"])
    case = load_folders(a, other)
    assert any("paired in the order of their names" in note for note in case.notes)
    assert [f.name for f in case.recording.frames] == ["x", "y", "z"]


def test_a_simulation_of_another_size_is_refused(folders, tmp_path):
    _, b = folders
    small = written(tmp_path / "c", collage(FRAMES, 24, 32))
    with pytest.raises(InputError, match=r"must be 64 x 48 as .*000\.exr, got 32 x 24\. Render at the size"):
        load_folders(small, b)


def test_frames_of_several_sizes_are_refused(folders, tmp_path):
    for f in folders:
        written(f, collage(1, 24, 32), ["zzz"])
    with pytest.raises(InputError, match=r"must be 64 x 48 as .*, got 32 x 24\. Diagnose each size by itself"):
        load_folders(*folders)


def test_a_missing_frame_is_named(folders):
    a, b = folders
    (a / "001.exr").unlink()
    with pytest.raises(InputError, match="have a picture for each recorded one, got 2 for 3; 001 stands alone"):
        load_folders(a, b)
    written(a, collage(1, 48, 64), ["001"])
    (b / "002.exr").unlink()
    with pytest.raises(InputError, match="have no picture that was not recorded, got 3 for 2; 002 stands alone"):
        load_folders(a, b)


def test_a_folder_without_pictures_is_refused(folders, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"--recorded must hold files that end in .*, got none"):
        load_folders(folders[0], tmp_path / "empty")
    with pytest.raises(InputError, match="--simulated must be a folder of pictures"):
        load_folders(tmp_path / "nowhere", folders[1])


def test_two_files_of_one_name_are_refused(folders):
    cv2.imwrite(str(folders[0] / "000.png"), np.zeros((48, 64, 3), np.uint8))
    with pytest.raises(InputError, match="must hold one file of a name, got several of 000"):
        load_folders(*folders)


def test_pictures_of_nothing_but_nan_are_refused(folders, tmp_path):
    nothing = written(tmp_path / "c", np.full((FRAMES, 48, 64, 3), np.nan))
    with pytest.raises(InputError, match="hold measured pixels"):
        load_folders(nothing, folders[1])


def test_depth_and_masks_go_with_the_pictures(folders, tmp_path):
    (tmp_path / "d").mkdir()
    (tmp_path / "m").mkdir()
    for i in range(FRAMES):
        depth = np.full((48, 64), 4.0, np.float32)
        depth[0, :5] = np.nan
        np.save(tmp_path / "d" / f"{i:03d}.npy", depth)
        mask = np.zeros((48, 64), np.uint8)
        mask[10:20, 10:20] = 5
        cv2.imwrite(str(tmp_path / "m" / f"{i:03d}.png"), mask)
    case = load_folders(*folders, tmp_path / "d", tmp_path / "m")
    assert case.has_depth
    assert case.shape_names == ("picture", "body 5")
    assert f"{5 * FRAMES} pixels have no depth and were left out." in case.notes
    (tmp_path / "d" / "001.npy").unlink()
    with pytest.raises(InputError, match="--depth must have a file for each frame, got none for 001"):
        load_folders(*folders, tmp_path / "d")
    np.save(tmp_path / "d" / "001.npy", np.ones((24, 32), np.float32))
    with pytest.raises(InputError, match="must be 64 x 48 as the pictures, got 32 x 24"):
        load_folders(*folders, tmp_path / "d")


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ([], "what is to be explained must be one, got none"),
        (["x", "--simulated", "a", "--recorded", "b"], "got recording and simulated"),
        (["x", "--scene", "s"], "got recording and scene"),
        (["--simulated", "a"], "--recorded must be given"),
        (["x", "--depth", "d"], "--depth must go with --simulated A"),
        (["x", "--average", "2"], "--average must go with --scene SCENE"),
        (["--scene", "s", "--average", "0"], "--average must be 1 or more"),
        (["--scene", "s", "--pose-error-px", "-1"], "--pose-error-px must be 0 or more"),
        (["--simulated", "a", "--recorded", "b", "--noise", "0.1"], "--noise must be two numbers with a comma between"),
        (["--simulated", "a", "--recorded", "b", "--noise", "0,0"], "--noise must be two numbers of 0 or more"),
        (["--simulated", "a", "--recorded", "b", "--focal-px", "-3"], "--focal-px must be positive"),
    ],
)
def test_flags_that_do_not_go_together_are_one_line(flags, words, tmp_path, capsys):
    assert main([*flags, "-o", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err


def test_rounding_to_bytes_has_the_variance_that_it_has():
    rng = np.random.default_rng(0)
    encoding = Encoding(".png", "uint8", 3, "srgb")
    for code in (30, 120, 220):
        fine = np.linspace(code - 0.5, code + 0.5, 1001)
        linear = decode(np.rint(fine * 257).astype(np.uint16), "srgb")
        true = float(np.var(linear - decode(np.uint8([code]), "srgb")[0]))
        level = decode(np.uint8([code]), "srgb").astype(np.float64)
        assert np.allclose(rounding_variance(level, encoding), true, rtol=0.03)
    assert not rounding_variance(rng.random(3), Encoding(".exr", "float32", 3, "linear")).any()
