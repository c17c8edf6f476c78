"""The command `scene-build`."""

from __future__ import annotations

import argparse
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, get_type_hints

from materials.foundation.command import add_common_flags, run_command
from materials.foundation.errors import InputError
from materials.foundation.settings import add_flags, from_mapping, read_toml

from .reconstruction.build_settings import BuildSettings
from .sources.formats import FORMATS


def main(argv: list[str] | None = None) -> int:
    """Run `scene-build` and return its exit code."""
    return run_command(_parser(), _body, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="scene-build",
        description="Build a scene that light can travel through from a recorded drive: ground, environment, moving objects, "
        "colours, sky, and the maps that water follows. What did not change since the last run is kept.",
    )
    what = "recording.json, a KITTI, Argoverse 2, COLMAP or nerfstudio folder, images, or a point cloud"
    parser.add_argument("recording", metavar="RECORDING", help=what)
    parser.add_argument("-o", "--output", metavar="SCENE", required=True, help="folder of the scene")
    parser.add_argument("--format", choices=FORMATS, default="auto", help="what RECORDING is (default: auto, by its files)")
    parser.add_argument("--frames", metavar="FROM:TO[:STEP]", help="some of the frames only: a Python slice or a number")
    parser.add_argument("--seed", type=int, default=None, metavar="INT", help="seed of all that is random (default: 0)")
    add_common_flags(parser)
    for name, kind in _stages().items():
        add_flags(parser, kind, f"{name.replace('_', ' ')} (TOML table [{name}])")
    return parser


def _stages() -> dict[str, type]:
    hints = get_type_hints(BuildSettings)
    return {item.name: hints[item.name] for item in fields(BuildSettings) if is_dataclass(hints[item.name])}


def _settings(args: argparse.Namespace) -> BuildSettings:
    """Combine defaults, TOML and flags, in rising order of rank."""
    file = Path(args.settings) if args.settings else None
    settings = from_mapping(BuildSettings, read_toml(file) if file else {}, file=file)
    changed: dict[str, Any] = {} if args.seed is None else {"seed": args.seed}
    try:
        for name, kind in _stages().items():
            given = {item.name: getattr(args, item.name) for item in fields(kind) if getattr(args, item.name) is not None}
            changed[name] = replace(getattr(settings, name), **given)
        return replace(settings, **changed)
    except InputError as error:  # what came from the file has been checked above
        flag = "--" + (error.key or "").replace("_", "-")
        raise InputError(error.must, got=error.got, key=flag, remedy=error.remedy) from error


def _chosen(count: int, text: str) -> list[int]:
    """Return the frames that `--frames` names.

    Raises
    ------
    InputError
        If it is no slice or names none.
    """
    try:
        numbers = [int(part) if part else None for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) == 1 and numbers[0] is not None:
        chosen = [i for i in range(count) if i == numbers[0] % count] if -count <= numbers[0] < count else []
    elif 2 <= len(numbers) <= 3 and 0 not in numbers[2:]:
        chosen = list(range(count))[slice(*numbers)]
    else:
        raise InputError("be FROM:TO, FROM:TO:STEP or a number", got=text, key="--frames")
    if not chosen:
        raise InputError(f"name some of the {count} frames", got=text, key="--frames")
    return chosen


def _body(args: argparse.Namespace) -> None:
    # Imported here, so that --help and a wrong flag answer at once.
    import json

    from .reconstruction.build import build
    from .recording import select_frames
    from .sources.recording_source import open_recording

    settings = _settings(args)
    output = Path(args.output)
    if output.exists() and not output.is_dir():
        raise InputError("be a folder", got="a file", file=output, remedy="Choose another place.")
    recording = open_recording(args.recording, args.format, work_folder=output / ".stages" / "source", seed=settings.seed)
    if args.frames:
        recording = select_frames(recording, _chosen(len(recording.frames), args.frames))
    scene = build(recording, output, settings)
    if args.quiet:
        return
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    ground, around = report["surfaces"]["ground"], report["surfaces"]["environment"]
    median = ground["held_out_m"]["median"]
    error = "" if median is None else f", {1000 * median:.1f} mm off held-out points"
    print(f"{output / 'scene.json'}: {len(scene.recording.frames)} frames, {report['cardboards']['count']} moving objects")
    print(f"  ground       {ground['triangles']} triangles, {report['ground_area_m2']} m2{error}")
    print(f"  environment  {around['triangles']} triangles")
    print(f"  look at      {output / 'preview' / 'scene.png'}, {output / 'preview' / 'top.png'}, {output / 'report.md'}")
    print(f"  next         augment {output} -o OUT --wetness 0.7")


if __name__ == "__main__":
    raise SystemExit(main())
