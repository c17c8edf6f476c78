"""What `diagnose` is given on the command line, brought into the form that it works on."""

from __future__ import annotations

import argparse
import math

from materials.foundation.errors import InputError
from scene.recording import Noise

from .effects.in_drives import choose_for_drive
from .effects.in_pictures import choose
from .mismatch.case import Case, load
from .mismatch.drive.load import load_scene
from .mismatch.effect import Effect
from .mismatch.pictures.folders import load_folders

_PICTURES = ("recorded", "depth", "masks", "noise", "focal_px")
_DRIVE = ("average", "pose_error_px")


def load_source(args: argparse.Namespace, effects: list[Effect]) -> tuple[Case, list[Effect]]:
    """Return what is to be explained, and the effects that can be tested on it.

    Raises
    ------
    InputError
        If none or several kinds of input are named, or what is named cannot be read.
    """
    given = [name for name in ("recording", "simulated", "scene") if getattr(args, name) is not None]
    if len(given) != 1:
        remedy = "Give one of RECORDING, --simulated A --recorded B, and --scene SCENE."
        raise InputError("be one", got=" and ".join(given) or "none", key="what is to be explained", remedy=remedy)
    for names, kind, flag in ((_PICTURES, "simulated", "--simulated A"), (_DRIVE, "scene", "--scene SCENE")):
        stray = next((n for n in names if getattr(args, n) is not None), None)
        if stray is not None and given != [kind]:
            raise InputError(f"go with {flag}", key=f"--{stray.replace('_', '-')}")
    if given == ["recording"]:
        return load(args.recording), effects
    return _drive(args, effects) if given == ["scene"] else _pictures(args, effects)


def _pictures(args: argparse.Namespace, effects: list[Effect]) -> tuple[Case, list[Effect]]:
    if args.recorded is None:
        raise InputError("be given", key="--recorded")
    if args.focal_px is not None and not 0 < args.focal_px < math.inf:
        raise InputError("be positive", got=args.focal_px, key="--focal-px")
    noise = None if args.noise is None else _noise(args.noise)
    return choose(load_folders(args.simulated, args.recorded, args.depth, args.masks, noise, args.focal_px), effects)


def _drive(args: argparse.Namespace, effects: list[Effect]) -> tuple[Case, list[Effect]]:
    if args.average is not None and args.average < 1:
        raise InputError("be 1 or more", got=args.average, key="--average")
    off = 0.2 if args.pose_error_px is None else args.pose_error_px
    if not 0 <= off < math.inf:
        raise InputError("be 0 or more", got=off, key="--pose-error-px")
    return choose_for_drive(load_scene(args.scene, args.average, off), effects)


def _noise(text: str) -> Noise:
    try:
        read, shot = (float(v) for v in text.split(","))
    except ValueError as error:
        raise InputError("be two numbers with a comma between", got=text, key="--noise") from error
    if not (0 <= read < math.inf and 0 <= shot < math.inf and read + shot > 0):
        raise InputError("be two numbers of 0 or more, not both 0", got=text, key="--noise")
    return Noise(read, shot)
