"""The command `diagnose`: say which physics a simulation leaves out of a recording."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from materials.foundation.command import image_slice, run_command
from materials.foundation.errors import InputError

if TYPE_CHECKING:
    from .mismatch.attribute import SearchSettings
    from .mismatch.diagnose import Finding
    from .mismatch.effect import Effect


def main(argv: list[str] | None = None) -> int:
    """Run `diagnose` and return its exit code."""
    return run_command(_parser(), _run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="diagnose",
        description="Compare a recording with the simulation that was believed of it: locate the mismatch, name the physics that "
        "was left out, fit it, and show on held-out frames that the fit improves.",
    )
    what = (
        "folder with recording.json and simulation.json; a measurement.json or its folder; a file of a measured BRDF (Cornell "
        "*.brdf, MERL *.binary, *.pbsdf, RGL *.bsdf); photometric stereo in DiLiGenT's layout, or as a recording of one normal_map"
    )
    parser.add_argument("recording", nargs="?", metavar="RECORDING", help=what)
    parser.add_argument("-o", "--output", metavar="OUT", help="folder for diagnosis.json, report.html and what goes with them")
    parser.add_argument("--seed", type=int, default=0, help="which views and lights are held out (default: 0)")
    parser.add_argument("--effects", action="append", default=[], metavar="FILE", help="Python file with effects of your own")
    parser.add_argument("--without", action="append", default=[], metavar="ID", help="leave an effect out of the catalogue")
    words = "of a file that says no model: what was believed (default: lambert)"
    parser.add_argument("--believed", choices=("lambert", "ggx"), default="lambert", help=words)
    words = "of photometric stereo: some of the photographs only, a Python slice such as 20:"
    parser.add_argument("--images", metavar="FROM:TO", help=words)
    parser.add_argument("--list-effects", action="store_true", help="print the catalogue and stop")
    parser.add_argument("--most", type=int, default=3, metavar="N", help="at most so many effects at once (default: 3)")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--traceback", action="store_true", help="show the Python traceback of a failure")
    _add_pictures(parser)
    return parser


def _add_pictures(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("pictures that were simulated elsewhere, in place of RECORDING")
    group.add_argument("--simulated", metavar="A", help="folder of simulated pictures")
    group.add_argument("--recorded", metavar="B", help="folder of recorded pictures, of the same names and size")
    group.add_argument(
        "--depth", metavar="D", help="folder of its depth, along the camera's axis [m] (.exr, .npy, .png): tests fog"
    )
    group.add_argument("--masks", metavar="M", help="folder of its bodies' ids, 0 for all else: tests whether one has moved")
    group.add_argument("--noise", metavar="READ,SHOT", help="of the recording: variance READ**2 + SHOT * signal (else estimated)")
    group.add_argument("--focal-px", type=float, metavar="PX", help="focal length (default: the picture's width)")
    drive = parser.add_argument_group("a reconstructed drive, in place of RECORDING")
    drive.add_argument("--scene", metavar="SCENE", help="folder of scene-build: each frame is predicted from the others")
    drive.add_argument("--average", type=int, metavar="N", help="average N x N pixels (default: to 320 columns at most)")
    drive.add_argument("--pose-error-px", type=float, metavar="PX", help="what its poses are off by, in pixels (default: 0.2)")


def _run(args: argparse.Namespace) -> None:
    # Imported here, so that --help and a wrong flag answer at once.
    from .effects import catalogue

    effects = catalogue(tuple(args.effects), tuple(args.without))
    if args.list_effects:
        for e in effects:
            print(f"{e.stage:10} {e.id:22} {e.title}: {e.says}")
        return
    if args.output is None:
        raise InputError("be given", key="--output")
    if not 1 <= args.most <= 8:
        raise InputError("lie in [1, 8]", got=args.most, key="--most")
    output = Path(args.output)
    if output.exists() and not output.is_dir():
        raise InputError("be a folder", got="a file", file=output, remedy="Choose another place.")
    from .diagnose_measurement import diagnose_measurement, measurement_of
    from .mismatch.attribute import SearchSettings

    settings = SearchSettings(most=args.most)

    def say(text: str) -> None:
        if not args.quiet:
            print(text, file=sys.stderr, flush=True)

    measurement = measurement_of(Path(args.recording), args.believed, output) if args.recording is not None else None
    if measurement is not None:
        verdict, words, findings = diagnose_measurement(measurement, output, effects, settings, say, image_slice(args.images))
    else:
        verdict, words, findings = _diagnose_pictures(args, output, effects, settings, say)
    if not args.quiet:
        print(f"{verdict}: {words}")
        for f in findings:
            single = {k: p for k, p in f.parameters.items() if isinstance(p["value"], int | float)}
            values = ", ".join(f"{k} {p['value']:.4g}" + ("" if p["unit"] == "1" else f" {p['unit']}") for k, p in single.items())
            also = f" (or {', '.join(f.ambiguous_with)})" if f.ambiguous_with else ""
            print(f"  {f.id}{f' on {f.where}' if f.where else ''}{also}: {values}")
        print(output / "report.html")


def _diagnose_pictures(
    args: argparse.Namespace, output: Path, effects: list[Effect], settings: SearchSettings, say: Callable[[str], None]
) -> tuple[str, str, list[Finding]]:
    from .diagnose_inputs import load_source
    from .mismatch.diagnose import diagnose
    from .mismatch.drive.load import drive_settings
    from .mismatch.outputs import write_diagnosis
    from .mismatch.report import sentence

    case, effects = load_source(args, effects)
    for why in dict.fromkeys(case.untestable.values()):
        ids = [id for id, reason in case.untestable.items() if reason == why]
        say(f"cannot be tested ({why}): {', '.join(ids)}")
    if args.scene is not None:
        settings = drive_settings(args.most)
    d = diagnose(case, effects, args.seed, settings, say)
    write_diagnosis(output, d)
    return d.verdict, sentence(d), d.findings


if __name__ == "__main__":
    sys.exit(main())
