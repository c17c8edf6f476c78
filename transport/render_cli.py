"""The command `meniscus render`: a simulation to pictures of light, with all that they were made of."""

from __future__ import annotations

import argparse
import sys

from materials.foundation.command import add_common_flags, run_command
from materials.foundation.errors import InputError
from materials.foundation.settings import add_flags, from_flags, read_tables

from .render_settings import RenderSettings, ViewSettings


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="meniscus render",
        description="Trace the light of a simulation/1 into multi-layer EXR files. An interrupted run leaves a checkpoint; the "
        "same command goes on from it.",
    )
    parser.add_argument("simulation", help="simulation.json, or its folder")
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="where the frames go")
    parser.add_argument(
        "--recording", metavar="JSON", help="recording.json, or its folder, that gives cameras, lamps and exposures"
    )
    parser.add_argument("--frames", metavar="A:B", help="frames of the recording: 3, 0:6, 0:20:5 (default: all)")
    add_flags(parser, RenderSettings, "rendering")
    add_flags(parser, ViewSettings, "the view, where no recording gives one")
    add_common_flags(parser)
    return run_command(parser, _run, argv)


def _run(args: argparse.Namespace) -> None:
    toml, file = read_tables(args.settings, "render", "view")
    settings = from_flags(RenderSettings, args, toml.get("render"), file)
    view = from_flags(ViewSettings, args, toml.get("view"), file)
    if args.frames is not None and args.recording is None:
        raise InputError("be given with --recording", got=args.frames, key="--frames")

    from scene.recording import read_recording
    from scene.simulation_file import read_simulation

    from .cli import chosen_frames
    from .render_frames import render_frames
    from .views import recorded_views, view_from_aside

    simulation = read_simulation(args.simulation)
    if args.recording is None:
        done = render_frames(simulation, [view_from_aside(simulation, view)], args.output, settings)
    else:
        recording = read_recording(args.recording)
        if not recording.frames:
            raise InputError("have frames", got="a cloud alone", file=args.recording)
        views = recorded_views(recording, chosen_frames(args.frames, len(recording.frames)))
        done = render_frames(simulation, views, args.output, settings, preview_gain=1.0)
    worst = max(done, key=lambda frame: frame.noise)
    print(f"{args.output}: {len(done)} frames, {worst.samples} samples per pixel or more, noise {worst.noise:.3g} or less")


if __name__ == "__main__":
    sys.exit(main())
