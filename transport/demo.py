"""`make demo`: photograph the built-in street, reconstruct it, wet it at three strengths, let it rain, and show a contact sheet."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from materials.foundation.command import add_common_flags, run_command

_WETNESS = (1 / 3, 2 / 3, 1.0)
_MIST, _DROPLETS = 0.5, 0.5


def main(argv: list[str] | None = None) -> int:
    """Run the demonstration and return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m transport.demo", description=__doc__)
    parser.add_argument("-o", "--output", default="out/demo", help="folder for everything (default: out/demo)")
    parser.add_argument("--frames", type=int, default=8, help="length of the drive (default: 8)")
    parser.add_argument("--width", type=int, default=640, help="width of the pictures [px] (default: 640)")
    parser.add_argument("--height", type=int, default=270, help="their height [px] (default: 270)")
    parser.add_argument("--samples", type=int, default=32, help="paths per pixel of the photographs and of the rain (default: 32)")
    parser.add_argument("--seed", type=int, default=0, help="seed of world and light")
    add_common_flags(parser)
    return run_command(parser, _run, argv)


def _run(args: argparse.Namespace) -> None:
    from materials.foundation.progress import stage
    from scene.images import read_raw
    from scene.reconstruction.build import build
    from scene.reconstruction.build_settings import BuildSettings
    from scene.recording import read_recording
    from scene.scene_file import read_scene
    from scene.street import StreetSettings, street

    from .augment import AugmentSettings, augment, folder_name, summarise
    from .contact_sheet import contact_sheet
    from .photograph import PhotographSettings, photograph

    output = Path(args.output)
    world = street(StreetSettings(frames=args.frames, width=args.width, height=args.height, seed=args.seed))
    with stage("photographing the built-in street"):
        photograph(world, output / "recording", PhotographSettings(samples=args.samples, render_seed=args.seed))
    with stage("building the scene"):
        build(read_recording(output / "recording"), output / "scene", BuildSettings(seed=args.seed))
    scene = read_scene(output / "scene")
    frames = list(range(len(scene.recording.frames)))
    with stage("wetting the ground"):
        summarise(augment(scene, frames, list(_WETNESS), AugmentSettings(samples=args.samples, seed=args.seed), output / "wet"))
    shown = frames[:: max(1, len(frames) // 3)][:3]
    rain = AugmentSettings(samples=args.samples, seed=args.seed, mist=_MIST, droplets=_DROPLETS)
    with stage("mist, and drops on the windshield"):
        augment(scene, shown, [1.0], rain, output / "wet")
    rows = [("recorded", [read_raw(scene.recording.frames[i].image) for i in shown])]
    for w in _WETNESS:
        names = [scene.recording.frames[i].name for i in shown]
        rows.append((f"wetness {w:.2f}", [read_raw(output / "wet" / f"w{w:.2f}" / "image" / f"{name}.png") for name in names]))
    folder = output / "wet" / folder_name(1.0, rain) / "image"
    pictures = [read_raw(folder / f"{scene.recording.frames[i].name}.png") for i in shown]
    rows.append((f"wetness 1.00, mist {_MIST:.2f}, drops {_DROPLETS:.2f}", pictures))
    contact_sheet(rows, output / "contact_sheet.png")
    print(
        f"""
{len(frames)} frames of the built-in street
  recorded        {output / "recording"}  (recording.json, pictures, LiDAR sweeps, masks; the truth in truth/)
  reconstructed   {output / "scene"}  (meshes/, maps/, preview/, report.md)
  wet             {output / "wet"}  (one folder per wetness, and one in mist and drops: image/, layers/, label/, augment.json)
  to look at      {output / "contact_sheet.png"}"""
    )


if __name__ == "__main__":
    sys.exit(main())
