"""Run all modules of a kind, one after the other, and go on when one cannot run."""

from __future__ import annotations

import argparse
import importlib
import sys
import traceback
from pathlib import Path

from .peers import PeerMissing
from .report import Report

HERE = Path(__file__).resolve().parent


def modules(prefix: str, folder: Path = HERE) -> list[str]:
    """Return the names of the modules `PREFIX_*.py`, without the prefix, in alphabetical order."""
    return sorted(path.stem.removeprefix(prefix + "_") for path in folder.glob(f"{prefix}_*.py"))


def run(kind: str, argv: list[str] | None = None, *, folder: Path = HERE, package: str = "benchmarks") -> int:
    """Run the benchmarks (`kind` "bench") or proofs ("proof") and return the exit code.

    Each module has a function `run(report)`. 0: all ran, and all proofs hold. 1: a proof does not hold, or a proof
    could not be run. A benchmark that cannot run is named, and changes nothing: benchmarks are no gates.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {package}{'' if kind == 'bench' else '.proof'}", description=__doc__)
    available = modules(kind, folder)
    parser.add_argument("--only", metavar="NAME", action="append", choices=available, help=f"run only this: {', '.join(available)}")
    parser.add_argument("--out", metavar="FOLDER", default="out", help="where the results go (default: out)")
    args = parser.parse_args(argv)
    report = Report(args.out, kind)
    for name in args.only or available:
        print(f"{kind}: {name} …", file=sys.stderr, flush=True)
        try:
            importlib.import_module(f"{package}.{kind}_{name}").run(report)
        except PeerMissing as error:
            report.failed(name, str(error))
        except Exception as error:
            # A defect in one module must not cost the others' results; it is shown in full and in the table.
            traceback.print_exc()
            report.failed(name, f"{type(error).__name__}: {error}")
    print(report.finish(), end="")
    print(f"{kind}: results in {args.out}/{kind}.jsonl, .md and .png", file=sys.stderr)
    return 0 if kind == "bench" or report.all_hold else 1
