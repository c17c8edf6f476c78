from __future__ import annotations

import errno
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from materials.foundation.command import explain
from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, read_json, replacing, replacing_folder, write_json


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_a_file_appears_whole_and_with_the_usual_permissions(tmp_path):
    with replacing(tmp_path / "deep" / "a.txt") as temporary:
        temporary.write_text("new")
        assert temporary.suffix == ".txt"
        assert not (tmp_path / "deep" / "a.txt").exists()
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "deep" / "a.txt").read_text() == "new"
    assert (tmp_path / "deep" / "a.txt").stat().st_mode & 0o777 == 0o666 & ~mask
    assert names(tmp_path / "deep") == ["a.txt"]


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device"), RuntimeError("bug")])
def test_whatever_fails_the_earlier_file_stays_and_nothing_else_is_left(tmp_path, failure):
    path = tmp_path / "a.txt"
    path.write_text("earlier")

    def write():
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise failure

    with pytest.raises(type(failure)):
        write()
    assert path.read_text() == "earlier"
    assert names(tmp_path) == ["a.txt"]


def test_a_full_disk_names_the_file_that_was_to_be_written(tmp_path):
    path = tmp_path / "a.bin"

    def write():
        with replacing(path):
            raise OSError(errno.ENOSPC, "No space left on device")  # as write(2) says it: without a name

    with pytest.raises(OSError, match="No space") as caught:
        write()
    assert explain(caught.value) == f"{path}: it must have space left on its disk. Free some space or choose another output folder."


def test_a_file_size_limit_leaves_nothing_behind(tmp_path):
    # A real failing write(2), in a process of its own since the limit cannot be raised again.
    code = f"""
import resource
from materials.foundation.files import replacing
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
with replacing({str(tmp_path / "a.bin")!r}) as temporary:
    temporary.write_bytes(bytes(100_000))
"""
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[3], check=False
    )
    assert "File too large" in result.stderr
    assert "a.bin" in result.stderr
    assert names(tmp_path) == []
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 1000


def test_a_failure_never_names_the_temporary_file(tmp_path):
    path = tmp_path / "a.txt"

    def write():
        with replacing(path) as temporary:
            temporary.unlink()
            temporary.read_bytes()

    with pytest.raises(FileNotFoundError) as caught:
        write()
    assert caught.value.filename == str(path)


def test_a_folder_is_replaced_as_a_whole(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old")
    with replacing_folder(tmp_path / "out") as temporary:
        (temporary / "new.txt").write_text("new")
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["new.txt"]


def test_a_folder_that_fails_leaves_the_earlier_one(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old")

    def write():
        with replacing_folder(tmp_path / "out") as temporary:
            (temporary / "new.txt").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["old.txt"]


def test_the_earlier_folder_comes_back_if_the_last_step_fails(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old")
    rename = Path.replace

    def fails_at_the_end(self: Path, target: Path):
        if Path(target) == tmp_path / "out" and (self / "new.txt").exists():
            raise OSError(errno.EIO, "Input/output error")
        return rename(self, target)

    monkeypatch.setattr(Path, "replace", fails_at_the_end)

    def write():
        with replacing_folder(tmp_path / "out") as temporary:
            (temporary / "new.txt").write_text("new")

    with pytest.raises(OSError, match="Input/output"):
        write()
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["old.txt"]


def test_a_file_in_the_way_of_a_folder_is_refused(tmp_path):
    (tmp_path / "a").write_text("")
    for path in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(InputError, match="must be a folder, got a file"):
            make_folder(path)
    with pytest.raises(InputError, match="must be a folder, got a file"), replacing_folder(tmp_path / "a"):
        pass


def test_a_folder_in_the_way_of_a_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="must be a file, got a folder"), replacing(tmp_path):
        pass


def test_a_place_that_cannot_be_written_to_is_refused(tmp_path, monkeypatch):
    # The super-user may write anywhere, so the refusal of the system is simulated.
    def refuse(*args, **kwargs):
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path))

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    with (
        pytest.raises(InputError, match=r"a\.txt: it must be in a folder that can be written to\. Choose another place"),
        replacing(tmp_path / "a.txt"),
    ):
        pass
    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match="must be in a folder that can be written to"):
        make_folder(tmp_path / "b")


def test_json_comes_back_as_it_was_written(tmp_path):
    value = {"ü": [1, 2.5, None, True], "z": {}, "a": "text"}
    write_json(tmp_path / "a.json", value)
    assert read_json(tmp_path / "a.json") == value
    assert list(json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))) == ["ü", "z", "a"]


def test_a_number_that_json_lacks_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", float("nan"))
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b'{"a": 1,\n "b" 2}', r"must be JSON, got .* at line 2, column 6\. Mend the file\."),
        (b'{"a": NaN}', "must be JSON in UTF-8, got the constant NaN"),
        (b'"\xff"', "must be JSON in UTF-8"),
        (None, r"must exist\. Check the path\."),
    ],
)
def test_what_is_no_json_is_refused_with_its_place(tmp_path, content, words):
    if content is not None:
        (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_json(tmp_path / "a.json")
