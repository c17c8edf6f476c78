"""What `diagnose` is given on the command line, brought into the form that it works on."""

from __future__ import annotations

import argparse
import math

from materials.foundation.errors import InputError
from scene.recording import Noise

from .effects.in_pictures import choose
from .mismatch.case import Case, load
from .mismatch.effect import Effect
from .mismatch.pictures.folders import load_folders

_PICTURES = ("depth", "masks", "noise", "focal_px")


def load_source(args: argparse.Namespace, effects: list[Effect]) -> tuple[Case, list[Effect]]:
    """Return what is to be explained, and the effects that can be tested on it.

    Raises
    ------
    InputError
        If none or several kinds of input are named, or what is named cannot be read.
    """
    pictures = args.simulated is not None or args.recorded is not None
    if pictures == (args.recording is not None):
        got = "both" if pictures else "neither"
        raise InputError("be given, or --simulated and --recorded in its place", got=got, key="RECORDING")
    if not pictures:
        if stray := next((n for n in _PICTURES if getattr(args, n) is not None), None):
            raise InputError("go with --simulated and --recorded", key=f"--{stray.replace('_', '-')}")
        return load(args.recording), effects
    if args.simulated is None or args.recorded is None:
        raise InputError("be given", key="--recorded" if args.recorded is None else "--simulated")
    if args.focal_px is not None and not 0 < args.focal_px < math.inf:
        raise InputError("be positive", got=args.focal_px, key="--focal-px")
    noise = None if args.noise is None else _noise(args.noise)
    return choose(load_folders(args.simulated, args.recorded, args.depth, args.masks, noise, args.focal_px), effects)


def _noise(text: str) -> Noise:
    try:
        read, shot = (float(v) for v in text.split(","))
    except ValueError as error:
        raise InputError("be two numbers with a comma between", got=text, key="--noise") from error
    if not (0 <= read < math.inf and 0 <= shot < math.inf and read + shot > 0):
        raise InputError("be two numbers of 0 or more, not both 0", got=text, key="--noise")
    return Noise(read, shot)
