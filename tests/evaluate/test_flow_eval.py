"""The command from files to page: fields, folders, pictures; and what it says of inputs that cannot be used."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from evaluate import flow_evaluation
from evaluate.cli import main
from evaluate.flow_metrics import DEFINITIONS
from scene.flow_files import read_flow, write_flow
from scene.images import read_raw, write_raw

from .algorithms.textures import moved_pair

SIZE = (20, 30)


def constant(u: float, v: float) -> np.ndarray:
    return np.broadcast_to(np.array([u, v], np.float32), (*SIZE, 2)).copy()


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Two fields that are 1 px and 4 px off the truth, masks, and folders of two frames of each."""
    truth = constant(10, 0)
    truth[:, :5] = np.nan
    for folder, field in (("a", constant(11, 0)), ("b", constant(10, 4)), ("t", truth)):
        for frame in ("0001", "0002"):
            write_flow(tmp_path / folder / f"{frame}.flo", field)
    moving = np.zeros(SIZE, np.uint8)
    moving[:10] = 3
    for frame in ("0001", "0002"):
        write_raw(tmp_path / "m" / f"{frame}.png", moving)
    write_raw(tmp_path / "empty.png", np.zeros(SIZE, np.uint8))
    return tmp_path


def run(*words: object) -> int:
    return main([str(w) for w in words])


def test_two_fields_and_the_truth_become_tables_and_one_page(files: Path, capsys):
    assert run(files / "a/0001.flo", files / "b/0001.flo", "--truth", files / "t/0001.flo", "--masks", files / "m/0001.png",
               "-o", files / "out", "--names", "one,two") == 0  # fmt: skip
    printed = capsys.readouterr().out
    metrics = json.loads((files / "out/metrics.json").read_text())
    by_key = {(row["flow"], row["region"]): row for row in metrics["scores"]}
    assert set(by_key) == {(n, r) for n in ("one", "two") for r in ("all", "moving", "static")}
    assert by_key["one", "all"]["epe"] == 1 and by_key["two", "static"]["epe"] == 4
    assert by_key["one", "all"]["pixels"] == 20 * 25 and by_key["two", "moving"]["fl_all"] == 1
    assert metrics["difference"][0]["dfe"] == pytest.approx(17**0.5, rel=1e-6)
    with (files / "out/scores.csv").open() as file:
        assert float(next(csv.DictReader(file))["epe"]) == 1
    page = (files / "out/report.html").read_text()
    # One file: pictures are inside, nothing is fetched.
    assert page.count("data:image/png;base64,") >= 6 and not re.search(r'(src|href)="(?!data:)', page)
    for name in ("epe", "fl_all", "wauc", "dfe"):
        assert DEFINITIONS[name].replace("&", "&amp;").replace("'", "&#39;") in page
        assert f"{name}: {DEFINITIONS[name]}" in printed
    assert "| one" in (files / "out/report.md").read_text()


def test_error_maps_that_are_compared_have_one_scale(files: Path, monkeypatch):
    tops = []
    monkeypatch.setattr(flow_evaluation, "save_error_map", lambda path, error, largest, title: tops.append(largest))
    write_raw(files / "out/pictures/0001_a_error.png", np.zeros(SIZE, np.uint8))
    write_raw(files / "out/pictures/0001_b_error.png", np.zeros(SIZE, np.uint8))
    words = (files / "a/0001.flo", files / "b/0001.flo", "--truth", files / "t/0001.flo", "--names", "a,b", "-o", files / "out")
    assert run(*words, "--quiet") == 0
    assert tops == [4, 4]  # errors are 1 px and 4 px


def test_folders_are_paired_by_name_and_pooled(files: Path):
    write_flow(files / "b/0002.flo", constant(10, 2))
    assert run(files / "a", files / "b", "--truth", files / "t", "-o", files / "out", "--quiet") == 0
    metrics = json.loads((files / "out/metrics.json").read_text())
    assert {row["flow"]: row["epe"] for row in metrics["scores"]} == {"a": 1, "b": 3}
    assert [row["epe"] for row in metrics["scores_per_frame"]] == [1, 1, 4, 2]
    assert [row["frame"] for row in metrics["difference"]] == ["all", "0001", "0002"]


def test_without_truth_the_fields_are_compared_where_asked(files: Path):
    assert run(files / "a/0001.flo", files / "b/0001.flo", "--region", f"compared={files / 'm/0001.png'}", "-o", files / "out") == 0
    metrics = json.loads((files / "out/metrics.json").read_text())
    assert "scores" not in metrics and metrics["difference"][0]["pixels"] == 300


def test_pictures_go_through_algorithms_first(tmp_path: Path):
    first, second, truth = moved_pair(np.eye(2), np.array([1.0, -2.0]))
    write_raw(tmp_path / "f0.png", first)
    write_raw(tmp_path / "f1.png", second)
    write_flow(tmp_path / "t.npy", truth)
    copy = "import shutil, sys; shutil.copy(sys.argv[4], sys.argv[3])"
    command = f"{sys.executable} -c '{copy}' {{image0}} {{image1}} {{out}} {tmp_path / 't.npy'}"
    words = (tmp_path / "f0.png", tmp_path / "f1.png", "--truth", tmp_path / "t.npy", "-o", tmp_path / "out", "--quiet")
    assert run(*words, "--algorithm", "dis", "--flow-command", command, "--flow-format", ".npy") == 0
    rows = {row["flow"]: row["epe"] for row in json.loads((tmp_path / "out/metrics.json").read_text())["scores"]}
    assert rows["command"] == 0 and 0 < rows["dis"] < 0.5
    assert read_flow(tmp_path / "out/flow/dis/f0.flo").valid.all()
    assert read_raw(tmp_path / "out/pictures/f0_dis.png").ndim == 3


def test_the_list_of_algorithms_can_be_asked_for(capsys):
    assert run("x", "y", "-o", "z", "--algorithm", "list") == 0
    assert "horn-schunck  HDR" in capsys.readouterr().out and not Path("z").exists()


def test_uncertainties_enter_where_they_are_given(files: Path):
    np.save(files / "sigma.npy", np.full(SIZE, 2.0, np.float32))
    words = (
        files / "a/0001.flo",
        files / "b/0001.flo",
        "--truth",
        files / "t/0001.flo",
        "--uncertainty",
        files / "sigma.npy",
        "-o",
        files / "o",
    )
    assert run(*words, "--uncertainty-scale", 4, "--quiet") == 0
    row = json.loads((files / "o/metrics.json").read_text())["scores"][0]
    assert (row["within_1_sigma"], row["within_3_sigma"], row["epe_beyond_sigma"]) == (0, 1, 0.5)
    assert run(*words) == 2


def refused(capsys, *words: object) -> str:
    assert run(*words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("meniscus: ")
    return lines[0]


def test_inputs_that_cannot_be_used_are_one_line_with_the_file(files: Path, capsys):
    a, b, t, o = files / "a/0001.flo", files / "b/0001.flo", files / "t/0001.flo", ("-o", files / "out")
    write_flow(files / "small.flo", np.zeros((5, 6, 2)))
    assert "small.flo: it must be 30 x 20, as a-0001, got 6 x 5" in refused(
        capsys, a, files / "small.flo", *o, "--names", "a-0001,s"
    )
    assert "small.flo: it must be 30 x 20, as the flow of 0001, got 6 x 5" in refused(
        capsys, a, b, "--truth", files / "small.flo", *o
    )
    write_raw(files / "small.png", np.ones((5, 6), np.uint8))
    assert "small.png: --masks must be 30 x 20" in refused(capsys, a, b, "--truth", t, "--masks", files / "small.png", *o)
    empty = refused(capsys, a, b, "--truth", t, "--region", f"puddle={files / 'empty.png'}", *o)
    assert "must have a pixel of the region puddle with known truth in at least one frame, got none" in empty
    write_flow(files / "none.flo", np.full((*SIZE, 2), np.nan))
    assert "the flow must be known somewhere in both fields" in refused(capsys, a, files / "none.flo", *o)
    assert "the flow of " in (line := refused(capsys, a, b, "--truth", files / "none.flo", *o)) and "known truth" in line
    cv2.imwrite(str(files / "depth.png"), np.full(SIZE, 900, np.uint16))
    assert "depth.png: it must be a 16-bit RGB PNG" in refused(capsys, a, files / "depth.png", *o)
    assert "nowhere: it must exist" in refused(capsys, a, files / "nowhere", *o)
    (files / "b/0002.flo").unlink()
    assert "must hold as many flow fields as A (2), got 1" in refused(capsys, files / "a", files / "b", *o)
    (files / "t/0002.flo").unlink()
    assert "must hold a file named 0002" in refused(capsys, files / "a", files / "a", "--truth", files / "t", *o)
    assert "--truth must be given too" in refused(capsys, a, b, "--masks", files / "m/0001.png", *o)
    assert "--region must be NAME=PATH" in refused(capsys, a, b, "--region", "puddle", *o)
    assert "--names must be two different names" in refused(capsys, a, b, "--names", "x,x", *o)
    assert "algorithm must be one of" in refused(capsys, a, b, "--algorithm", "raft", *o)
    assert "--largest must be positive" in refused(capsys, a, b, "--largest", "-1", *o)
    assert not (files / "out/report.html").exists()


def test_one_picture_is_no_sequence(tmp_path: Path, capsys):
    (tmp_path / "empty").mkdir()
    write_raw(tmp_path / "f0.png", np.zeros((20, 20), np.uint8))
    line = refused(capsys, tmp_path / "f0.png", tmp_path / "empty", "--algorithm", "dis", "-o", tmp_path / "out")
    assert "empty: it must hold files of .png" in line


def test_help_loads_no_numerics():
    code = "import sys; from evaluate.cli import main; main(['--help']); assert not {'numpy', 'numba', 'cv2'} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "--flow-command" in done.stdout, done.stderr
