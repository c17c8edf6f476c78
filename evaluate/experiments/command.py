"""`meniscus experiment NAME -o OUT`: run one recipe and write its report."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from materials.foundation.command import add_common_flags, run_command
from materials.foundation.settings import add_flags, from_flags, read_toml

from . import RECIPES


def main(argv: list[str] | None = None) -> int:
    """Run an experiment and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="meniscus experiment",
        description="Run an experiment on optical flow and leave report.html, report.md, metrics.json, CSV and pictures. What was "
        "computed before is used again.",
    )
    recipes = parser.add_subparsers(dest="recipe", metavar="NAME", required=True)
    for name, recipe in RECIPES.items():
        own = recipes.add_parser(name, help=recipe.question, description=recipe.question)
        own.add_argument("-o", "--output", required=True, type=Path, metavar="OUT", help="folder for the result and what it keeps")
        add_flags(own, recipe.settings, "the experiment")
        add_common_flags(own)
    return run_command(parser, _run, argv)


def _run(args: argparse.Namespace) -> None:
    # Imported here, so that --help and a wrong flag answer at once.
    from importlib import import_module

    from materials.foundation.files import make_folder, write_json
    from materials.foundation.settings import as_dict

    from ..report import write_report

    recipe = RECIPES[args.recipe]
    file = Path(args.settings) if args.settings else None
    settings = from_flags(recipe.settings, args, read_toml(file) if file else {}, file)
    folder = make_folder(args.output)
    report = import_module(f".{recipe.module}", __package__).run(settings, folder)
    write_report(folder, report)
    write_json(folder / "settings.json", {"experiment": args.recipe, "settings": as_dict(settings)})
    if not args.quiet:
        print(report.markdown())
        print(folder / "report.html")


if __name__ == "__main__":
    sys.exit(main())
