"""The command `flow-eval`: score flow fields against the truth and each other, or pictures through flow algorithms."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from materials.foundation.command import run_command
from materials.foundation.errors import InputError


def main(argv: list[str] | None = None) -> int:
    """Run `flow-eval` and return its exit code."""
    return run_command(_parser(), _run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="flow-eval",
        description="Compare two flow fields, or folders of them, with each other and with the truth; or, with --algorithm or "
        "--flow-command, compute the flow from picture A to picture B and score it. Reads .flo, .flo5, KITTI PNG, .pfm, .npy, "
        ".npz.",
    )
    parser.add_argument("a", metavar="A", help="flow field, picture, or folder of them")
    parser.add_argument(
        "b", metavar="B", help="the other flow field, or the next picture; folders are paired by name, else by order"
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="folder for the result")
    parser.add_argument("--truth", metavar="T", help="true flow: file or folder with A's names")
    parser.add_argument("--masks", metavar="M", help="instance ids of what moves (0 = static): scores moving and static apart")
    parser.add_argument("--visible", metavar="V", help="mask of what the next frame sees too: scores visible and occluded apart")
    region = "any other mask to score by itself, e.g. puddles=FOLDER; may be repeated. The name `compared` limits the difference"
    parser.add_argument("--region", metavar="NAME=M", action="append", default=[], help=region)
    parser.add_argument("--uncertainty", metavar="U", help="standard deviation of the true flow (HD1K)")
    parser.add_argument("--uncertainty-scale", type=float, metavar="S", help="its px = stored / S")
    names = "flow algorithms, e.g. brox or dis,deepflow; A and B are then pictures. `list` prints those there are"
    parser.add_argument("--algorithm", metavar="NAME[,NAME]", help=names)
    command = "any other algorithm: a command line with {image0}, {image1} and {out}"
    parser.add_argument("--flow-command", metavar="TEMPLATE", help=command)
    parser.add_argument("--flow-format", default=".flo", metavar="SUFFIX", help="what --flow-command writes (default: .flo)")
    parser.add_argument("--names", metavar="A,B", help="what to call the two fields (default: their file or folder names)")
    parser.add_argument("--largest", type=float, metavar="PX", help="end of the colour scales (default: by percentiles)")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--traceback", action="store_true", help="show the Python traceback of a failure")
    return parser


def _run(args: argparse.Namespace) -> None:
    # Imported here, so that --help and a wrong flag answer at once.
    from .flow_evaluation import evaluate_flow
    from .flow_inputs import match
    from .report import write_report

    if args.largest is not None and not args.largest > 0:
        raise InputError("be positive", got=args.largest, key="--largest")
    methods = _methods(args)
    if methods == {}:
        return
    others = {role: place for role in ("truth", "masks", "visible", "uncertainty") if (place := getattr(args, role)) is not None}
    for text in args.region:
        name, separator, place = text.partition("=")
        if not separator or not name or not place:
            raise InputError("be NAME=PATH", got=text, key="--region")
        others[f"region {name}"] = place
    scored = {"masks", "visible", "uncertainty"} & set(others)
    if scored and "truth" not in others:
        raise InputError("be given too", key="--truth", remedy=f"--{min(scored)} parts the score against it.")
    output = Path(args.output)
    if output.exists() and not output.is_dir():
        raise InputError("be a folder", got="a file", file=output, remedy="Choose another place.")
    cases = match(args.a, args.b, others, images=methods is not None)
    report = evaluate_flow(cases, output, methods, _names(args), args.uncertainty_scale, args.largest)
    write_report(output, report)
    if not args.quiet:
        for table in report.tables:
            if table.name != "scores_per_frame":
                print(table.markdown())
        for name, text in report.definitions.items():
            print(f"{name}: {text}")
        print(f"\n{output / 'report.html'}")


def _methods(args: argparse.Namespace):
    if args.algorithm is None and args.flow_command is None:
        return None
    from .algorithms import ALGORITHMS, FlowCommand, algorithm

    if args.algorithm == "list":
        for entry in ALGORITHMS.values():
            print(f"{entry.name:13} {'HDR  ' if entry.hdr else '8 bit'}  {entry.description}")
        return {}
    methods = {}
    for name in (args.algorithm or "").split(","):
        if name.strip():
            methods[name.strip()] = algorithm(name.strip()).estimate
    if args.flow_command is not None:
        methods["command"] = FlowCommand(args.flow_command, args.flow_format)
    if not methods:
        raise InputError("name an algorithm", got=args.algorithm, key="--algorithm")
    return methods


def _names(args: argparse.Namespace) -> tuple[str, str]:
    if args.names is not None:
        given = [name.strip() for name in args.names.split(",")]
        if len(given) != 2 or not all(given) or given[0] == given[1]:
            raise InputError("be two different names: A,B", got=args.names, key="--names")
        return given[0], given[1]
    a, b = Path(args.a), Path(args.b)
    one, two = (p.stem if p.is_file() else p.name for p in (a, b))
    if one == two:
        one, two = (p.resolve().parent.name + "/" + n for p, n in ((a, one), (b, two)))
    # Names become parts of file names.
    one, two = one.replace("/", "-"), two.replace("/", "-")
    return (one, two) if one != two else ("A", "B")


if __name__ == "__main__":
    sys.exit(main())
