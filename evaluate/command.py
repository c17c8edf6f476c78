"""The `meniscus` command: `meniscus doctor` looks whether everything that the toolkit needs is here and works."""

from __future__ import annotations

import argparse

from materials.foundation.command import run_command


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code: 0 all is well (warnings allowed), 1 something does not work, 2 wrong use."""
    parser = argparse.ArgumentParser(
        prog="meniscus",
        description="Look after the toolkit. The work is done by scene-build and augment; each has --help.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    subcommands = parser.add_subparsers(dest="subcommand", metavar="COMMAND")
    doctor = subcommands.add_parser("doctor", help="check libraries, name clashes, cores, memory and disk, and say what to do")
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
