from __future__ import annotations

import json
import sys
import time

import numpy as np
import pytest

from benchmarks.report import FIGURE_KEYS, PROOF_KEYS, Report
from benchmarks.runner import modules, run
from benchmarks.timing import paired
from materials.foundation.errors import InputError


@pytest.fixture
def bench_package(tmp_path, monkeypatch):
    """An importable package for made-up benchmark modules; its files are written by `write`."""
    folder = tmp_path / "made_up_benchmarks"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)

    def write(**sources: str):
        for name, source in sources.items():
            (folder / f"{name}.py").write_text(source)
        return {"folder": folder, "package": folder.name}

    yield write
    for name in [name for name in sys.modules if name.startswith(folder.name)]:
        del sys.modules[name]


def lines(path):
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def test_a_figure_is_one_line_with_the_agreed_keys(tmp_path):
    report = Report(tmp_path, "bench")
    report.figure(name="frame", ours=np.float32(2), peer="Cycles", theirs=8.0, unit="s", error_reached=0.01)
    report.figure(name="memory", ours=3.0, unit="MiB")
    first, second = lines(tmp_path / "bench.jsonl")
    assert tuple(first) == tuple(second) == FIGURE_KEYS
    assert first["ratio"] == 0.25
    assert second["ratio"] is None


def test_a_proof_is_one_line_with_the_agreed_keys(tmp_path):
    report = Report(tmp_path, "proof")
    report.proof(name="energy", value=0.1, bound=0.2, holds=np.bool_(True))
    (line,) = lines(tmp_path / "proof.jsonl")
    assert tuple(line) == PROOF_KEYS
    assert line["holds"] is True


def test_a_line_is_on_disk_before_the_run_ends(tmp_path):
    report = Report(tmp_path, "proof")
    report.proof(name="energy", value=0.1, bound=0.2, holds=True)
    assert len(lines(tmp_path / "proof.jsonl")) == 1


def test_a_later_run_adds_to_the_lines_and_replaces_the_table(tmp_path):
    for name in ("first", "second"):
        report = Report(tmp_path, "proof")
        report.proof(name=name, value=0.1, bound=0.2, holds=True)
        table = report.finish()
    assert [line["name"] for line in lines(tmp_path / "proof.jsonl")] == ["first", "second"]
    assert "second" in table and "first" not in table


def test_a_number_that_is_none_is_refused(tmp_path):
    with pytest.raises(InputError, match="ours of 'frame' must be finite, got nan"):
        Report(tmp_path, "bench").figure(name="frame", ours=float("nan"), unit="s")


def test_table_and_plot_show_every_line(tmp_path):
    for kind in ("bench", "proof"):
        report = Report(tmp_path, kind)
        if kind == "bench":
            report.figure(name="frame", ours=2.0, peer="Cycles", theirs=8.0, unit="s")
            report.figure(name="alone", ours=2.0, unit="s")
        else:
            report.proof(name="frame", value=1.0, bound=2.0, holds=True)
            report.proof(name="alone", value=1.0, bound=0.0, holds=False)
        table = report.finish()
        assert "frame" in table and "alone" in table
        assert (tmp_path / f"{kind}.md").read_text(encoding="utf-8") == table
        assert (tmp_path / f"{kind}.png").read_bytes().startswith(b"\x89PNG")
    assert "NO" in table


def test_alternating_runs_find_the_ratio_of_two_known_times():
    order: list[str] = []

    def slow():
        order.append("slow")
        time.sleep(0.02)

    def fast():
        order.append("fast")
        time.sleep(0.005)

    result = paired(slow, fast, runs=4)
    assert result.ours >= 0.02 and result.theirs >= 0.005  # sleep never returns early
    assert result.ratio == result.ours / result.theirs
    assert order == ["slow", "fast"] + ["slow", "fast", "fast", "slow"] * 2


def test_a_missing_peer_is_named_and_the_rest_still_runs(tmp_path, bench_package, capsys):
    place = bench_package(
        bench_a="from benchmarks.peers import PeerMissing\ndef run(report):\n    raise PeerMissing('no such renderer')\n",
        bench_b="def run(report):\n    report.figure(name='b', ours=1.0, unit='s')\n",
    )
    assert run("bench", ["--out", str(tmp_path / "out")], **place) == 0
    assert "not measured: a: no such renderer" in capsys.readouterr().out
    assert [line["name"] for line in lines(tmp_path / "out" / "bench.jsonl")] == ["b"]


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("report.proof(name='p', value=1.0, bound=2.0, holds=True)", 0),
        ("report.proof(name='p', value=3.0, bound=2.0, holds=False)", 1),
        ("raise RuntimeError('broken')", 1),
    ],
)
def test_a_proof_that_fails_is_a_failure(tmp_path, bench_package, capsys, body, code):
    place = bench_package(proof_p=f"def run(report):\n    {body}\n")
    assert run("proof", ["--out", str(tmp_path / "out")], **place) == code


def test_one_benchmark_can_be_chosen(tmp_path, bench_package):
    source = "def run(report):\n    report.figure(name=__name__[-1], ours=1.0, unit='s')\n"
    place = bench_package(bench_a=source, bench_b=source)
    assert modules("bench", place["folder"]) == ["a", "b"]
    run("bench", ["--only", "b", "--out", str(tmp_path / "out")], **place)
    assert [line["name"] for line in lines(tmp_path / "out" / "bench.jsonl")] == ["b"]
