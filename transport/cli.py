"""The command `augment`: make a reconstructed drive wet."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from materials.foundation.command import add_common_flags, run_command
from materials.foundation.errors import InputError
from materials.foundation.settings import add_flags, from_flags, read_toml


def main(argv: list[str] | None = None) -> int:
    """Run `augment` and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="augment",
        description="Wet the ground of a scene that scene-build made: darkened, glossy, with puddles that mirror the street; and "
        "fill its air with spray and mist, also behind wheels, and let drops fall on the windshield.",
    )
    parser.add_argument("scene", help="folder of the scene")
    parser.add_argument("-o", "--output", required=True, help="folder for the result")
    parser.add_argument(
        "-w",
        "--wetness",
        default="1",
        metavar="W[,W]",
        help="global wetness from 0 (dry) to 1, or several: 0.33,0.67,1 (default: 1)",
    )
    parser.add_argument("--frames", metavar="A:B", help="frames by index: 3, 0:6, 0:20:5 (default: all)")
    from .augment_settings import AugmentSettings

    add_flags(
        parser,
        AugmentSettings,
        "options (constants of water, mist, wheel spray, drops and relief: --settings, "
        "tables [water], [spray], [wakes], [windshield] and [relief])",
    )
    add_common_flags(parser)
    return run_command(parser, _run, argv)


def _run(args: argparse.Namespace) -> None:
    from scene.images import read_raw
    from scene.recording import select_frames
    from scene.scene_file import read_scene
    from scene.sources.recording_copy import check_recording

    from .augment import augment, folder_name, picture_name, summarise
    from .augment_settings import AugmentSettings, check_wetness
    from .contact_sheet import contact_sheet

    wetness = _wetness(args.wetness)
    file = Path(args.settings) if args.settings else None
    settings = from_flags(AugmentSettings, args, read_toml(file) if file else {}, file)
    check_wetness(wetness)
    scene = read_scene(args.scene)
    if not scene.recording.frames:
        raise InputError("have frames", got="a cloud alone", file=args.scene, remedy="Build the scene of a recording with images.")
    frames = chosen_frames(args.frames, len(scene.recording.frames))
    check_recording(select_frames(scene.recording, frames))
    output = Path(args.output)
    summarise(augment(scene, frames, wetness, settings, output))
    shown = frames[:: max(1, len(frames) // 4)][:4]
    pictures: list[tuple[str, list[Any]]] = [("recorded", [read_raw(scene.recording.frames[i].image) for i in shown])]
    for w in wetness:
        folder = output / folder_name(w, settings) / "image"
        found = [folder / picture_name(scene.recording.frames[i], settings.format) for i in shown]
        if all(file.suffix != ".exr" for file in found):
            pictures.append((f"wetness {w:.2f}", [read_raw(file) for file in found]))
    if len(pictures) > 1:
        contact_sheet(pictures, output / "contact_sheet.png")
    print(f"{len(frames)} frames at wetness {', '.join(f'{w:.2f}' for w in wetness)} in {output}")


def _wetness(text: str) -> list[float]:
    try:
        wetness = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError("be numbers separated by commas", got=text, key="--wetness") from error
    if len({f"{w:.2f}" for w in wetness}) < len(wetness):
        remedy = "Folders are named by hundredths: give each value once, or run twice into different folders."
        raise InputError("differ by 0.01 or more", got=text, key="--wetness", remedy=remedy)
    return wetness


def chosen_frames(text: str | None, count: int) -> list[int]:
    """Turn `3`, `0:6` or `0:20:5` into indices."""
    if text is None:
        return list(range(count))
    try:
        parts = [int(part) if part else None for part in text.split(":")]
        indices = list(range(count))[slice(*parts)] if len(parts) > 1 else [range(count)[int(text)]]
    except (ValueError, IndexError, TypeError) as error:  # no number, none of the frames, more than two colons
        raise InputError(f"be A:B within 0:{count}", got=text, key="--frames") from error
    if not indices:
        raise InputError(f"choose at least one of {count} frames", got=text, key="--frames")
    return indices


if __name__ == "__main__":
    sys.exit(main())
