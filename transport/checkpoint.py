"""An unfinished picture on disk, to go on with later: the sums of its samples, and what they are samples of."""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from materials.foundation.errors import InputError
from materials.foundation.files import replacing
from materials.foundation.interrupts import held_back

from .render import Exposure

# To be raised when kernels change in a way that changes a picture's bits.
_VERSION = 1
# Handles into Embree differ from process to process; what they stand for is in the arrays beside them.
_HANDLES = ("static_scene", "dynamic_scene")


def identity(exposure: Exposure) -> dict[str, str]:
    """Return what an exposure's samples depend on: numbers as they are, all else by its hash, under names for people."""
    world, tracing = exposure.world, exposure.tracing
    return {
        "version of the tracer": str(_VERSION),
        "scene": _digest((world.arrays, world.tables, world.medium, world.bodies)),
        "lights": _digest(world.lights),
        "camera": _digest((exposure.view, exposure.optics)),
        "seed": str(tracing.seed),
        "max_bounces": str(tracing.max_bounces),
        "specular_only": str(tracing.specular_only),
        "clamp": str(float(tracing.clamp)),
    }


def save_checkpoint(path: str | Path, exposure: Exposure, seconds: float) -> None:
    """Write an exposure, whole or not at all, even if it is interrupted meanwhile; `seconds` is the time spent on it."""
    with held_back(), replacing(path) as temporary:
        said = json.dumps(identity(exposure))
        np.savez(temporary, sums=exposure.sums, done=exposure.done, seconds=seconds, identity=np.array(said))


def load_checkpoint(path: str | Path, exposure: Exposure) -> float:
    """Let a new exposure go on where a stored one stopped; return the seconds spent on that.

    Raises
    ------
    InputError
        If the file cannot be read, or was made of another scene, from another place, or with other settings; names what
        differs.
    """
    try:
        # Opened here: NumPy leaves a file open that it finds torn.
        with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            said = json.loads(str(file["identity"]))
            sums, done, seconds = file["sums"], file["done"], float(file["seconds"])
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError("be a whole checkpoint", got="a damaged one", file=path, remedy="Delete it and start anew.") from error
    _check(said, identity(exposure), path)
    if sums.shape != exposure.sums.shape or done.shape != exposure.done.shape:
        raise InputError("be a whole checkpoint", got="other sizes", file=path, remedy="Delete it and start anew.")
    exposure.sums[:], exposure.done[:] = sums, done
    return seconds


def _check(said: Any, asked: dict[str, str], path: str | Path) -> None:
    remedy = "Ask for the same, delete the checkpoint, or choose another output."
    if not isinstance(said, dict):
        raise InputError("be a whole checkpoint", got="a damaged one", file=path, remedy="Delete it and start anew.")
    for name, value in asked.items():
        if said.get(name) == value:
            continue
        if len(value) == 64:  # a hash says nothing to people
            raise InputError("be the one that the checkpoint was made with", file=path, key=f"the {name}", remedy=remedy)
        raise InputError(f"be {said.get(name)}, as when the checkpoint was made", got=value, file=path, key=name, remedy=remedy)


def _digest(value: Any) -> str:
    sum_of = hashlib.sha256()

    def take(name: str, part: Any) -> None:
        if name in _HANDLES:
            part = bool(part)  # whether there is one at all
        if isinstance(part, np.ndarray):
            sum_of.update(f"{name} {part.dtype} {part.shape}".encode())
            sum_of.update(np.ascontiguousarray(part).tobytes())
        elif isinstance(part, tuple):
            names = getattr(part, "_fields", [str(i) for i in range(len(part))])
            for inner, item in zip(names, part, strict=True):
                take(inner, item)
        else:
            sum_of.update(f"{name} {part!r}".encode())

    take("", value)
    return sum_of.hexdigest()
