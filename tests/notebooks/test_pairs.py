"""Each notebook is a pair: a script that people edit and compare, and the same cells with their pictures."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
SCRIPTS = sorted(FOLDER.glob("*.py"))


def cells_of_script(text: str) -> list[tuple[str, str]]:
    """Return (kind, source) of the cells of a script in jupytext's percent format."""
    parts = re.split(r"^# %%(.*)\n", text, flags=re.MULTILINE)[1:]
    cells = []
    for marker, body in zip(parts[::2], parts[1::2], strict=True):
        lines = body.strip("\n").split("\n")
        if "[markdown]" in marker:
            cells.append(("markdown", "\n".join(line[2:] for line in lines)))
        else:
            # Magics are comments in the script, so that Python can read it.
            cells.append(("code", "\n".join(re.sub(r"^# (%\w)", r"\1", line) for line in lines)))
    return cells


def test_there_are_notebooks():
    assert SCRIPTS and {p.stem for p in SCRIPTS} == {p.stem for p in FOLDER.glob("*.ipynb")}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_script_and_notebook_have_the_same_cells(script):
    notebook = json.loads(script.with_suffix(".ipynb").read_text(encoding="utf-8"))
    stored = [(cell["cell_type"], "".join(cell["source"])) for cell in notebook["cells"]]
    assert stored == cells_of_script(script.read_text(encoding="utf-8"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_scripts_are_python(script):
    ast.parse(script.read_text(encoding="utf-8"), filename=str(script))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_notebooks_are_stored_after_a_run_without_error_and_small(script):
    path = script.with_suffix(".ipynb")
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    # Run from top to bottom in a fresh kernel, which counts from 1.
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert not any(output["output_type"] == "error" for cell in cells for output in cell["outputs"])
    # What git keeps of every change for good.
    assert path.stat().st_size < 400_000
