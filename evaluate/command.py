"""The `meniscus` command: `doctor` looks whether all that the toolkit needs is here; what else it does lies in other floors."""

from __future__ import annotations

import argparse
import sys

from materials.foundation.command import run_command


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code: 0 all is well (warnings allowed), 1 something does not work, 2 wrong use."""
    given = sys.argv[1:] if argv is None else argv
    if given[:1] == ["street"]:
        # A command of its own, with settings of its own; here it has a name.
        from transport.photograph import main as photograph_street

        return photograph_street(given[1:])
    if given[:1] == ["render"]:
        from transport.render_cli import main as render

        return render(given[1:])
    if given[:1] == ["experiment"]:
        from .experiments.command import main as run_experiment

        return run_experiment(given[1:])
    parser = argparse.ArgumentParser(
        prog="meniscus",
        description="Look after the toolkit. The work is done by scene-build and augment; each has --help.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    subcommands = parser.add_subparsers(dest="subcommand", metavar="COMMAND")
    doctor = subcommands.add_parser("doctor", help="check libraries, name clashes, cores, memory and disk, and say what to do")
    subcommands.add_parser("render", help="trace a simulation into multi-layer EXR files (see render --help)")
    subcommands.add_parser("street", help="photograph the built-in street, whose truth is known (see street --help)")
    subcommands.add_parser("experiment", help="run an experiment on optical flow (see experiment --help)")
    doctor.add_argument("--traceback", action="store_true", help="show the Python traceback of a failure")
    code = 0

    def body(args: argparse.Namespace) -> None:
        nonlocal code
        # Here and not above: --help loads no numerics.
        from .doctor import examine, version

        if args.version:
            print(f"meniscus {version()}")
        elif args.subcommand == "doctor":
            findings = examine()
            for finding in findings:
                print(finding)
            code = int(any(finding.grade == "fail" for finding in findings))
        else:
            parser.print_help()

    return run_command(parser, body, argv) or code
