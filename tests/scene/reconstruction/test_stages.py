from __future__ import annotations

from pathlib import Path

import pytest

from scene.reconstruction.stages import Stages, digest_of


class Counter:
    """Writes a text and counts how often it was asked to."""

    def __init__(self, text: str = "a") -> None:
        self.text, self.runs = text, 0

    def __call__(self, folder: Path) -> None:
        self.runs += 1
        (folder / "result.txt").write_text(self.text)


def test_a_stage_whose_inputs_did_not_change_is_not_run_again(tmp_path):
    make = Counter()
    first = Stages(tmp_path).run("cloud", {"x": 1}, make)
    second = Stages(tmp_path).run("cloud", {"x": 1}, make)
    assert make.runs == 1
    assert (first.reused, second.reused) == (False, True)
    assert first.digest == second.digest


def test_a_stage_is_run_again_when_a_setting_changes(tmp_path):
    make = Counter()
    Stages(tmp_path).run("cloud", {"x": 1}, make)
    Stages(tmp_path).run("cloud", {"x": 2}, make)
    assert make.runs == 2


def test_a_stage_is_run_again_when_its_file_was_damaged_or_lost(tmp_path):
    make = Counter()
    result = Stages(tmp_path).run("cloud", {}, make)
    (result.folder / "result.txt").write_text("broken")
    Stages(tmp_path).run("cloud", {}, make)
    (result.folder / "result.txt").unlink()
    Stages(tmp_path).run("cloud", {}, make)
    assert make.runs == 3


def test_equal_results_of_changed_inputs_leave_later_stages_alone(tmp_path):
    later = Counter()
    for x in (1, 2):
        earlier = Stages(tmp_path).run("cloud", {"x": x}, Counter("same"))
        Stages(tmp_path).run("mesh", {"cloud": earlier.digest}, later)
    assert later.runs == 1


@pytest.mark.parametrize("failure", [KeyboardInterrupt, OSError])
def test_an_interrupted_stage_leaves_nothing_half_written(tmp_path, failure):
    def broken(folder: Path) -> None:
        (folder / "result.txt").write_text("half")
        raise failure

    with pytest.raises(failure):
        Stages(tmp_path).run("cloud", {}, broken)
    assert list(tmp_path.iterdir()) == []


def test_the_digest_does_not_depend_on_the_order_of_keys():
    assert digest_of({"a": 1, "b": [1.5]}) == digest_of({"b": [1.5], "a": 1})
