"""Photograph the built-in street: a recording whose truth is known.

    python -m transport.photograph -o out/street

writes `recording.json` (recording/1) with images, sweeps and masks, and below `truth/` what a real recording lacks: depth,
normals, flow, noise-free linear images, and, for each wetness asked for, the truly wet street. A folder that is
complete and was made with the same settings is left as it is.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.command import add_common_flags, run_command
from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, read_json, write_json
from materials.foundation.progress import logger, stage
from materials.foundation.settings import add_flags, as_dict, from_flags, read_tables, setting
from scene.images import Encoding, write_exr, write_image
from scene.recording import Noise, Recording, read_recording
from scene.street import Street, StreetSettings, street
from scene.street.measurements import write_measurements, write_street_recording

from .render import Rendering, render
from .world import World, compile_world

# A change of the street or of the light that makes old pictures wrong raises this number.
_VERSION = 1
_SRGB = Encoding(".png", "uint8", 3, "srgb")
_STAMP = "made.json"
# Named anew when the measurements or the recording's keys change, so that an older folder gets them without new pictures.
_MEASURED = "measurements with boxes"
_MADE_FOLDERS = ("images", "masks", "points", "truth")


@dataclass(frozen=True)
class PhotographSettings:
    """How the pictures are taken."""

    samples: int = setting(64, "paths per pixel")
    max_bounces: int = setting(6, "scattering events per path")
    clamp: float = setting(2.0, "largest contribution of one indirect path, which tames mirrored sunlight; 0 is no limit")
    exposure: float = setting(1.0, "factor from radiance to the linear image, which clips at 1")
    read_sigma: float = setting(0.002, "sensor noise in the dark, linear units")
    shot_gain: float = setting(0.0001, "variance of sensor noise per signal, linear units")
    render_seed: int = setting(0, "seed of the renderer and of the sensor noise")

    def __post_init__(self) -> None:
        check_range("samples", self.samples, "[1, 1048576]")
        check_range("max_bounces", self.max_bounces, "[1, 64]")
        check_range("clamp", self.clamp, "[0, inf)")
        check_range("exposure", self.exposure, "(0, inf)")
        check_range("read_sigma", self.read_sigma, "[0, 1]")
        check_range("shot_gain", self.shot_gain, "[0, 1]")
        check_range("render_seed", self.render_seed, "[0, 2147483647]")


def photograph(
    world: Street, folder: str | Path, settings: PhotographSettings | None = None, wetness: tuple[float, ...] = ()
) -> Recording:
    """Render the drive through the dry street and write it as a recording.

    Parameters
    ----------
    world : Street
    folder : path
        The recording's folder.
    settings : PhotographSettings, optional
    wetness : tuple of float
        Strengths of showers in [0, 1]; the truly wet street is rendered for each, below `truth/wet-W/`, without sensor
        noise.

    Returns
    -------
    recording : Recording
        As `read_recording(folder)` gives it.

    Raises
    ------
    InputError
        If a setting is out of range, or the folder holds something else than a recording made here.

    Notes
    -----
    Each picture carries the hash of what it was made from and is written whole. What is there with the right hash is
    kept, so an interrupted run goes on where it stopped, and a further wetness costs only its own pictures.
    """
    settings = settings or PhotographSettings()
    folder = Path(folder)
    for w in wetness:
        check_range("wetness", w, "[0, 1]")
    identity = {"format": "street/1", "version": _VERSION, "street": as_dict(world.settings), "photograph": as_dict(settings)}
    key = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]
    done = _open(folder, identity, key)
    if _MEASURED not in done:
        (folder / "recording.json").unlink(missing_ok=True)
        with stage("measuring the street"):
            write_measurements(world, folder)
        done = _note(folder, identity, key, done, _MEASURED)
    noise = Noise(settings.read_sigma, settings.shot_gain)
    series: list[float | None] = [None, *wetness]
    for w in series:
        previous: World | None = None
        for frame in range(world.settings.frames):
            name = picture_name(frame, w)
            if name in done and (folder / name).exists():
                continue
            compiled = compile_world(world.simulation(frame, w), previous)
            previous = compiled
            picture = render(
                compiled,
                world.cameras[frame],
                settings.samples,
                settings.render_seed + 7919 * frame,
                settings.max_bounces,
                clamp=settings.clamp or np.inf,
                label=f"frame {frame + 1} of {world.settings.frames}" + ("" if w is None else f", wetness {w:g}"),
            )
            _write_picture(folder, name, frame, w, picture, settings, noise)
            done = _note(folder, identity, key, done, name)
    if not (folder / "recording.json").exists():
        write_street_recording(world, folder, noise)
    return read_recording(folder)


def picture_name(frame: int, wetness: float | None = None) -> str:
    """Return where a frame's noise-free linear image lies in the recording's folder."""
    return f"truth/{'linear' if wetness is None else f'wet-{wetness:.3f}'}/{frame:04d}.exr"


def _write_picture(
    folder: Path, name: str, frame: int, wetness: float | None, picture: Rendering, settings: PhotographSettings, noise: Noise
) -> None:
    linear = picture.radiance * np.float32(settings.exposure)
    variance = picture.variance * np.float32(settings.exposure) ** 2
    if wetness is None:
        rng = np.random.default_rng([settings.render_seed, frame])
        write_image(folder / "images" / f"{frame:04d}.png", with_noise(linear, noise, rng), _SRGB)
    else:
        # The wet truth is a yardstick, not a measurement: no sensor noise.
        write_image(folder / Path(name).with_suffix(".png"), linear, _SRGB)
    channels = {c: linear[..., i] for i, c in enumerate("RGB")} | {f"variance.{c}": variance[..., i] for i, c in enumerate("RGB")}
    write_exr(folder / name, channels)


def with_noise(linear: NDArray[np.float32], noise: Noise, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return an image as the sensor of `recording/1` sees it: variance `read_sigma**2 + shot_gain * signal`."""
    sigma = np.sqrt(noise.read_sigma**2 + noise.shot_gain * np.clip(linear.astype(np.float64), 0, 1))
    return (linear + sigma * rng.standard_normal(linear.shape)).astype(np.float32)


def _open(folder: Path, identity: dict, key: str) -> list[str]:
    """Return what is already done in the folder; clear the list where it was made from other settings."""
    make_folder(folder)
    stamp = folder / _STAMP
    if not stamp.exists():
        if any(folder.iterdir()):
            raise InputError("be empty or a street made before", file=folder, remedy="Choose another output folder.")
        return []
    made = read_json(stamp)
    if isinstance(made, dict) and made.get("key") == key:
        logger.info("%s: going on with what is there", folder)
        return list(made.get("done", []))
    # Other settings: the old recording must not be taken for the new one while this is under way.
    (folder / "recording.json").unlink(missing_ok=True)
    for name in _MADE_FOLDERS:
        shutil.rmtree(folder / name, ignore_errors=True)
    write_json(stamp, identity | {"key": key, "done": []})
    return []


def _note(folder: Path, identity: dict, key: str, done: list[str], name: str) -> list[str]:
    done = [*done, name]
    write_json(folder / _STAMP, identity | {"key": key, "done": done})
    return done


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="meniscus street", description="Photograph the built-in street, whose truth is known.")
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="FOLDER", help="folder of the recording")
    parser.add_argument("--wetness", default="", metavar="W,…", help="also render the truly wet street, e.g. 0.333,0.667,1")
    add_flags(parser, StreetSettings, "the street")
    add_flags(parser, PhotographSettings, "the pictures")
    add_common_flags(parser)
    return run_command(parser, _run, argv)


def _run(args: argparse.Namespace) -> None:
    toml, file = read_tables(args.settings, "street", "photograph")
    street_settings = from_flags(StreetSettings, args, toml.get("street"), file)
    settings = from_flags(PhotographSettings, args, toml.get("photograph"), file)
    try:
        wetness = tuple(float(w) for w in args.wetness.split(",") if w.strip())
    except ValueError as error:
        raise InputError("be numbers with commas between", got=args.wetness, key="--wetness") from error
    check_range("--wetness", wetness, "[0, 1]")
    make_folder(args.output)  # a place that takes no folder is named before the street is built
    with stage("building the street"):
        world = street(street_settings)
    recording = photograph(world, args.output, settings, wetness)
    print(f"{args.output}: {len(recording.frames)} frames of {street_settings.width} x {street_settings.height}")


if __name__ == "__main__":
    sys.exit(main())
