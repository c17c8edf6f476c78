from __future__ import annotations

import importlib.metadata
import shutil
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pytest

from evaluate.command import main
from evaluate.doctor import clashes, disk, embree, examine, modules, system_libraries


def distribution(folder: Path, name: str, *files: str) -> importlib.metadata.Distribution:
    """Lay out an installed distribution as pip does, with the files that its RECORD names."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "RECORD").write_text("".join(f"{file},,\n" for file in files))
    for file in files:  # from Python 3.12 on, only files that exist are listed
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).touch()
    return importlib.metadata.Distribution.at(info)


def test_a_healthy_installation_has_no_failure():
    assert [str(finding) for finding in examine() if finding.grade == "fail"] == []


def test_another_package_of_our_name_is_a_warning(tmp_path):
    other = distribution(tmp_path, "huggingface-evaluate", "evaluate/__init__.py", "evaluate/load.py")
    (finding,) = clashes([other])
    assert finding.grade == "warn"
    assert "huggingface-evaluate also provides a package named evaluate" in finding.text


def test_a_module_file_of_our_name_is_a_warning_too(tmp_path):
    assert [f.grade for f in clashes([distribution(tmp_path, "one-file", "scene.py")])] == ["warn"]


def test_a_package_that_only_contains_our_name_is_no_clash(tmp_path):
    assert [f.grade for f in clashes([distribution(tmp_path, "deep", "deep/evaluate/__init__.py", "deep/scene.py")])] == ["ok"]


def test_a_module_that_does_not_load_is_a_failure():
    (finding,) = modules({"no_such_module": "no-such-distribution"})
    assert finding.grade == "fail"
    assert "no-such-distribution cannot be imported" in finding.text


@pytest.mark.skipif(sys.platform != "linux", reason="other systems bring these libraries")
def test_a_missing_library_names_its_package(monkeypatch):
    monkeypatch.setattr("evaluate.doctor._LIBRARIES", {"libnone.so.9": "libnone9"})
    (finding,) = system_libraries()
    assert finding.grade == "fail"
    assert "apt-get install libnone9" in finding.text


def test_embree_loads():
    assert embree().grade == "ok"


def test_a_nearly_full_disk_is_a_warning(tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage(10**9, 10**9 - 1, 1))
    assert disk(tmp_path).grade == "warn"


def test_the_command_prints_what_it_found(capsys):
    assert main(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "Embree 4 loads" in out and "cores" in out


def test_the_command_says_its_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("meniscus ")


def test_help_loads_no_numerics():
    code = "import sys; from evaluate.command import main; main(['--help']); sys.exit('numpy' in sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False
    )
    assert result.returncode == 0, result.stderr
    assert "doctor" in result.stdout
