"""Every algorithm that is listed works through the one interface; any other is a command line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from evaluate.algorithms import ALGORITHMS, FlowCommand, algorithm, estimate
from materials.foundation.errors import InputError

from .textures import moved_pair

SHIFT = np.array([2.0, -1.0])


@pytest.fixture(scope="module")
def pair():
    return moved_pair(np.eye(2), SHIFT)


@pytest.mark.parametrize("name", [name for name, a in ALGORITHMS.items() if not a.hdr])
def test_opencv_methods_find_a_translation(name: str, pair):
    first, second, _ = pair
    flow = estimate(first, second, name)
    assert flow.shape == (96, 128, 2) and flow.dtype == np.float32
    # Not how good they are: only that x is x, y is y, and the sign is ours.
    np.testing.assert_allclose(np.median(flow.reshape(-1, 2), axis=0), SHIFT, atol=0.2)


def test_the_registry_names_what_it_has():
    assert {"horn-schunck", "papenberg", "brox", "dis", "farneback"} <= set(ALGORITHMS)
    assert all(a.description for a in ALGORITHMS.values())
    with pytest.raises(InputError, match=r"algorithm must be one of horn-schunck, .*got raft\. .*--flow-command"):
        algorithm("raft")


WRITER = """
import sys, numpy as np
from scene.images import read_raw
from scene.flow_files import write_flow
a, b = (read_raw(p).astype(float) for p in sys.argv[1:3])
write_flow(sys.argv[3], np.stack([a.mean() + 0 * a[..., 0], b.mean() + 0 * a[..., 0]], axis=-1))
"""


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_a_command_gets_the_pictures_as_they_are_and_gives_back_its_flow(kind, tmp_path: Path, monkeypatch):
    (tmp_path / "write.py").write_text(WRITER)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[3]))
    command = FlowCommand(f"{sys.executable} '{tmp_path / 'write.py'}' {{image0}} {{image1}} {{out}}", ".npy")
    one, two = np.full((4, 5, 3), 3, kind), np.full((4, 5, 3), 7, kind)
    np.testing.assert_array_equal(command(one, two), np.broadcast_to(np.array([3, 7], np.float32), (4, 5, 2)))


@pytest.mark.parametrize(
    ("template", "words"),
    [
        ("flow {image0} {out}", "must have the places"),
        ("flow {image0} {image1} {out} {gpu}", "must have the places"),
        ("flow '{image0} {image1} {out}", "must be a command line"),
        ("no-such-program-here {image0} {image1} {out}", "can be started, got no-such-program-here"),
        (f"{sys.executable} -c 'raise SystemExit(\"out of memory\")' {{image0}} {{image1}} {{out}}", "exit code 1: out of memory"),
        (f"{sys.executable} -c pass {{image0}} {{image1}} {{out}}", r"write its flow to \{out\}, got no file"),
        (
            f'{sys.executable} -c \'import sys; open(sys.argv[3], "w").write("x")\' {{image0}} {{image1}} {{out}}',
            "write a flow that begin as a Middlebury",
        ),
    ],
)
def test_commands_that_fail_say_how(template: str, words: str):
    image = np.zeros((4, 5, 3), np.uint8)
    with pytest.raises(InputError, match=f"--flow-command must .*{words}|{words}"):
        FlowCommand(template)(image, image)


def test_a_command_must_give_a_flow_of_the_pictures_size(tmp_path: Path):
    np.save(tmp_path / "small.npy", np.zeros((2, 2, 2)))
    copy = f"{sys.executable} -c 'import shutil, sys; shutil.copy(sys.argv[4], sys.argv[3])' {{image0}} {{image1}} {{out}}"
    image = np.zeros((4, 5, 3), np.uint8)
    with pytest.raises(InputError, match=r"write a flow of \(4, 5\), got \(2, 2\)"):
        FlowCommand(f"{copy} {tmp_path / 'small.npy'}", ".npy")(image, image)
    with pytest.raises(InputError, match=r"--flow-format must be one of \.flo"):
        FlowCommand(f"{copy} x", ".jpg")
