"""The command `material-fit`: measured reflectance to textures of an analytical BRDF, with a report."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from .fit_settings import FitSettings
from .foundation.command import add_common_flags, image_slice, run_command
from .foundation.errors import InputError
from .foundation.settings import add_flags, as_dict, from_flags, read_toml

if TYPE_CHECKING:
    from .foundation.report import Report
    from .svbrdf import SVBRDF

_KINDS = ("auto", "cornell", "merl", "pbsdf", "rgl", "ubo2003", "ubo2014", "btf", "photographs", "recording", "measurement")
_EXPORTS = ("gltf", "materialx", "mitsuba")


def main(argv: list[str] | None = None) -> int:
    """Run `material-fit` and return its exit code."""
    return run_command(_parser(), _run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="material-fit",
        description="Fit an analytical BRDF to measured reflectance, at every texel where there are many: textures of its "
        "parameters, normals, and a report with pictures. An interrupted run goes on where it stopped.",
    )
    what = (
        "Cornell *.brdf, MERL *.binary, *.pbsdf, RGL *.bsdf, UBO2003 *.zip, UBO2014 *.btf, our *.btf.npz; folder of photographs "
        "in DiLiGenT's layout; recording.json; measurement.json (also of spectra under rising moisture: then models of wet "
        "ground are fitted)"
    )
    parser.add_argument("input", metavar="INPUT", help=what)
    parser.add_argument("-o", "--output", metavar="OUT", required=True, help="folder for textures, material.json and the report")
    parser.add_argument("--kind", choices=_KINDS, default="auto", help="what INPUT is (default: auto, by suffix and content)")
    parser.add_argument("--images", metavar="FROM:TO", help="some of the photographs only: a Python slice such as 20:")
    parser.add_argument("--export", nargs="+", choices=_EXPORTS, default=[], help="write the material in formats of others, too")
    add_common_flags(parser)
    add_flags(parser, FitSettings, "fit (TOML keys in --settings)")
    return parser


def _run(args: argparse.Namespace) -> None:
    file = Path(args.settings) if args.settings else None
    settings = from_flags(FitSettings, args, read_toml(file) if file else {}, file)
    images = image_slice(args.images)
    output = Path(args.output)
    if output.exists() and not output.is_dir():
        raise InputError("be a folder", got="a file", file=output, remedy="Choose another place.")
    # Imported here, so that --help and a wrong flag answer at once.
    from .measured.source import read_conditions

    measured = read_conditions(args.input, args.kind)
    if measured is not None:
        from .foundation.report import write_report
        from .wetness_report import wetness_report

        assert measured.conditions is not None
        report = wetness_report(measured.conditions, measured.name, output / "pictures")
        write_report(output, report)
    else:
        report = _fit_brdfs(args, settings, images, output)
    if not args.quiet:
        for table in report.tables:
            print(table.markdown())
        print(output / "report.html")


def _fit_brdfs(args: argparse.Namespace, settings: FitSettings, images: slice | None, output: Path) -> Report:
    from .fit_report import fit_report
    from .fit_run import discard_work, run_fit
    from .foundation.progress import stage
    from .foundation.report import write_report
    from .measured.source import open_source
    from .svbrdf import write_svbrdf

    with stage("reading"):
        source = open_source(args.input, args.kind, images)
    with stage(f"fitting {source.num_texels} texel{'s' if source.num_texels > 1 else ''}"):
        result = run_fit(source, settings, output / ".fit", Path(args.input))
    (output / "material.json").unlink(missing_ok=True)
    with stage("report"):
        report = fit_report(source, result, settings, output / "pictures")
        write_report(output, report)
    told = {"settings": as_dict(settings), "texels": source.num_texels, "failed": result.failed}
    write_svbrdf(output, result.material, {**told, **{t.name: t.records() for t in report.tables}})
    for name in args.export:
        _export(name, output, result.material, args.quiet)
    discard_work(output / ".fit")
    return report


def _export(name: str, output: Path, material: SVBRDF, quiet: bool) -> None:
    from .exports.gltf import write_gltf
    from .exports.materialx import write_materialx
    from .exports.mitsuba_xml import write_mitsuba

    write, file = {
        "gltf": (write_gltf, "material.glb"),
        "materialx": (write_materialx, "material.mtlx"),
        "mitsuba": (write_mitsuba, "mitsuba.xml"),
    }[name]
    told = write(output / file, material)
    if not quiet:
        print(f"{output / file}: " + ", ".join(f"{key.replace('_', ' ')} {value:.3g}" for key, value in told.items()))


if __name__ == "__main__":
    sys.exit(main())
