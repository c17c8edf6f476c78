"""Blind trials of the diagnosis: Mitsuba 3 photographs, something is left out, `diagnose` says what, then the answers are opened.

The recordings are made by a process of its own, with a seed that is drawn when the proof is run (and printed, so that it
can be run again). `diagnose` sees a copy of each under a name without meaning, in a folder without the answers, and only
when its last verdict is written is the envelope opened and held against the commitment. After that each effect that was
named rightly is taken out of the catalogue, and the same recording must come out as not explained.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import beta

from materials.foundation.files import make_folder, replacing, write_json
from materials.foundation.progress import tracked

from .peers import mitsuba
from .report import Report
from .sealed.score import Verdict, judge, plot_confusion, table

_TRIALS, _SIZE, _SEED = "MENISCUS_SEALED_TRIALS", "MENISCUS_SEALED_SIZE", "MENISCUS_SEALED_SEED"
_TIMEOUT = 900
_GOALS = {"named": 0.9, "null": 0.95, "unlisted": 0.75, "left out": 0.75}


def run(report: Report) -> None:
    """Make, diagnose, open, judge; tables and pictures go to `proof/sealed` beside the report."""
    mitsuba("llvm_ad_rgb")  # here, so that it is said before anything else if it cannot be had
    folder = make_folder(report.folder / "proof" / "sealed")
    trials, size = os.environ.get(_TRIALS, "40"), os.environ.get(_SIZE, "160x120")
    seed = os.environ.get(_SEED) or str(secrets.randbelow(2**31))
    print(f"sealed: {trials} recordings of {size}, {_SEED}={seed}", file=sys.stderr, flush=True)
    recordings = folder / "recordings"
    for old in (recordings, folder / "diagnoses", folder / "without"):
        shutil.rmtree(old, ignore_errors=True)
    # Nowhere near what the diagnosis is given.
    envelope = Path(tempfile.mkdtemp(prefix="envelope-"))
    command = [sys.executable, "-m", "benchmarks.sealed", str(recordings), "--answers", str(envelope)]
    subprocess.run([*command, "--trials", trials, "--size", size, "--seed", seed], check=True)
    names = sorted(p.name for p in recordings.iterdir() if p.is_dir())
    runs = {name: diagnose(recordings / name, folder / "diagnoses" / name) for name in tracked(names, "diagnosing")}
    answers = opened(recordings, envelope)
    verdicts = [judge(n, answers[n], _affected(envelope, n), folder / "diagnoses" / n, *runs[n]) for n in names]
    without = [
        v for name in tracked(names, "leaving out") if (v := _without(verdicts, name, answers, envelope, folder)) is not None
    ]
    with replacing(folder / "trials.md") as temporary:
        temporary.write_text(
            table(verdicts) + "\nWith the true effect taken out of the catalogue:\n\n" + table(without), encoding="utf-8"
        )
    plot_confusion(verdicts, folder / "confusion.png")
    write_json(folder / "trials.json", [v.__dict__ for v in verdicts])
    shutil.copytree(envelope, folder / "answers", dirs_exist_ok=True)
    shutil.rmtree(envelope)
    _record(report, verdicts, without)


def diagnose(recording: Path, out: Path, *options: str) -> tuple[float, str]:
    """Diagnose a copy of a recording under a name without meaning; return (seconds, what went wrong)."""
    shutil.rmtree(out, ignore_errors=True)
    make_folder(out.parent)
    program = Path(sys.executable).parent / "diagnose"
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "recording"
        shutil.copytree(recording, copy)
        try:
            command = [str(program), str(copy), "-o", str(out), "--seed", "1", *options]
            done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            return time.perf_counter() - start, f"not done in {_TIMEOUT} s"
    failure = "" if done.returncode == 0 else f"exit code {done.returncode}: {done.stderr.strip()[-200:]}"
    return time.perf_counter() - start, failure


def opened(recordings: Path, envelope: Path) -> dict[str, dict]:
    """Return the answers, if they are those that were committed to.

    Raises
    ------
    RuntimeError
        If the hash differs: the answers were changed after the recordings were made.
    """
    text = (envelope / "answers.json").read_text(encoding="utf-8")
    salt = json.loads((envelope / "salt.json").read_text())["salt"]
    committed = json.loads((recordings / "commitment.json").read_text())["sha256"]
    if hashlib.sha256((salt + text).encode()).hexdigest() != committed:
        raise RuntimeError(f"{envelope / 'answers.json'} is not what {recordings / 'commitment.json'} committed to")
    return json.loads(text)


def _affected(envelope: Path, name: str) -> np.ndarray:
    with np.load(envelope / f"{name}.npz") as arrays:
        return arrays["affected"]


def _without(verdicts: list[Verdict], name: str, answers: dict, envelope: Path, folder: Path) -> Verdict | None:
    """Diagnose once more without the effect that was rightly named; right is then not to explain it."""
    before = next(v for v in verdicts if v.trial == name)
    if before.kind != "single" or not before.exact:
        return None
    out = folder / "without" / name
    result = diagnose(folder / "recordings" / name, out, "--without", before.wanted[0])
    unlisted = {"effects": [{"id": f"unlisted:{before.wanted[0]}"}]}
    return judge(name, answers[name] | unlisted, _affected(envelope, name), out, *result)


def _record(report: Report, verdicts: list[Verdict], without: list[Verdict]) -> None:
    groups = {
        "named": ("what was left out is named, and nothing else", [v for v in verdicts if v.kind in ("single", "pair")]),
        "null": ("nothing left out: consistent", [v for v in verdicts if v.kind == "null"]),
        "unlisted": ("outside the catalogue: not explained", [v for v in verdicts if v.kind == "unlisted"]),
        "left out": ("taken out of the catalogue: not explained", without),
    }
    for key, (name, group) in groups.items():
        if group:
            right = sum(v.exact for v in group)
            # Of a share so small a sample says little: its one-sided 95 % lower bound stands beside it.
            low = float(beta.ppf(0.05, right, len(group) - right + 1)) if right else 0.0
            share = right / len(group)
            label = f"sealed, {name} ({right} of {len(group)}; above {low:.2f} with 95 %)"
            report.proof(name=label, value=share, bound=_GOALS[key], holds=share >= _GOALS[key])
