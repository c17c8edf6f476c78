"""The command `diagnose`: say which physics a simulation leaves out of a recording."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from materials.foundation.command import run_command
from materials.foundation.errors import InputError


def main(argv: list[str] | None = None) -> int:
    """Run `diagnose` and return its exit code."""
    return run_command(_parser(), _run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="diagnose",
        description="Compare a recording with the simulation that was believed of it: locate the mismatch, name the physics that "
        "was left out, fit it, and show on held-out frames that the fit improves.",
    )
    parser.add_argument("recording", nargs="?", metavar="RECORDING", help="folder with recording.json and simulation.json")
    parser.add_argument("-o", "--output", metavar="OUT", help="folder for diagnosis.json, report.html and what goes with them")
    parser.add_argument("--seed", type=int, default=0, help="which views and lights are held out (default: 0)")
    parser.add_argument("--effects", action="append", default=[], metavar="FILE", help="Python file with effects of your own")
    parser.add_argument("--without", action="append", default=[], metavar="ID", help="leave an effect out of the catalogue")
    parser.add_argument("--list-effects", action="store_true", help="print the catalogue and stop")
    parser.add_argument("--most", type=int, default=3, metavar="N", help="at most so many effects at once (default: 3)")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--traceback", action="store_true", help="show the Python traceback of a failure")
    return parser


def _run(args: argparse.Namespace) -> None:
    # Imported here, so that --help and a wrong flag answer at once.
    from .effects import catalogue

    effects = catalogue(tuple(args.effects), tuple(args.without))
    if args.list_effects:
        for e in effects:
            print(f"{e.stage:10} {e.id:22} {e.title}: {e.says}")
        return
    for name, value in (("RECORDING", args.recording), ("--output", args.output)):
        if value is None:
            raise InputError("be given", key=name)
    if not 1 <= args.most <= 8:
        raise InputError("lie in [1, 8]", got=args.most, key="--most")
    output = Path(args.output)
    if output.exists() and not output.is_dir():
        raise InputError("be a folder", got="a file", file=output, remedy="Choose another place.")
    from .mismatch.attribute import SearchSettings
    from .mismatch.case import load
    from .mismatch.diagnose import diagnose
    from .mismatch.outputs import write_diagnosis
    from .mismatch.report import sentence

    def say(text: str) -> None:
        if not args.quiet:
            print(text, file=sys.stderr, flush=True)

    d = diagnose(load(args.recording), effects, args.seed, SearchSettings(most=args.most), say)
    write_diagnosis(output, d)
    if not args.quiet:
        print(f"{d.verdict}: {sentence(d)}")
        for f in d.findings:
            single = {k: p for k, p in f.parameters.items() if not isinstance(p["value"], list)}
            values = ", ".join(f"{k} {p['value']:.4g}" + ("" if p["unit"] == "1" else f" {p['unit']}") for k, p in single.items())
            also = f" (or {', '.join(f.ambiguous_with)})" if f.ambiguous_with else ""
            print(f"  {f.id}{f' on {f.where}' if f.where else ''}{also}: {values}")
        print(output / "report.html")


if __name__ == "__main__":
    sys.exit(main())
