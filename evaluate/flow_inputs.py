"""Which files belong together: single files or folders of them, matched by name, or by order where names differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.flow_files import SUFFIXES, Flow
from scene.images import read_ids

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr")


@dataclass(frozen=True)
class Case:
    """The files of one frame, by role: `a`, `b`, and where given `truth`, `masks`, `visible`, `uncertainty`, `region NAME`."""

    name: str
    files: Mapping[str, Path] = field(default_factory=dict)


def match(a: str | Path, b: str | Path, others: Mapping[str, str | Path], images: bool) -> list[Case]:
    """Return the cases that two files or folders make.

    Parameters
    ----------
    a, b : path
        Files, or folders of as many files; paired by name (without suffix) where all names agree, else by order.
    others : mapping of role to path
        Files or folders whose names agree with A's, without suffix; a folder may hold more than that, not less.
    images : bool
        Whether A and B are pictures rather than flow fields.

    Raises
    ------
    InputError
        If something is missing, empty, of another kind (file or folder) or number than A.
    """
    suffixes = IMAGE_SUFFIXES if images else SUFFIXES
    one, two = _files("A", Path(a), suffixes), _files("B", Path(b), suffixes)
    if len(one) != len(two):
        kind = "pictures" if images else "flow fields"
        raise InputError(f"hold as many {kind} as A ({len(one)})", got=len(two), file=b)
    names_b = {path.stem: path for path in two}
    if all(path.stem in names_b for path in one):
        two = [names_b[path.stem] for path in one]
    cases = [Case(first.stem, {"a": first, "b": second}) for first, second in zip(one, two, strict=True)]
    if len({case.name for case in cases}) < len(cases):
        raise InputError("hold one file per name (without suffix)", file=a)
    for role, place in others.items():
        kinds = SUFFIXES if role == "truth" else (*IMAGE_SUFFIXES, ".npy")
        found = _files(role, Path(place), kinds)
        names = {path.stem: path for path in found}
        single = len(cases) == 1 and len(found) == 1
        for i, case in enumerate(cases):
            if not single and case.name not in names:
                raise InputError(f"hold a file named {case.name}, as A does", file=place, key=f"--{role}")
            cases[i] = Case(case.name, {**case.files, role: found[0] if single else names[case.name]})
    return cases


def read_mask(path: str | Path, size: tuple[int, int], role: str) -> NDArray[np.bool_]:
    """Read a mask: what is not 0 is inside; of colours, what is not black.

    Raises
    ------
    InputError
        If it cannot be read or its size differs.
    """
    ids = read_ids(path)
    mask = ids.any(axis=-1) if ids.ndim == 3 else ids != 0
    if mask.shape != size:
        got = " x ".join(str(n) for n in reversed(mask.shape))
        raise InputError(f"be {size[1]} x {size[0]}, as the flow", got=got, file=path, key=f"--{role}")
    return np.asarray(mask, np.bool_)


def check_size(flow: Flow, path: str | Path, wanted: tuple[int, int], whose: str) -> None:
    """Refuse a field of another size, naming its file."""
    if flow.size != wanted:
        got = f"{flow.size[1]} x {flow.size[0]}"
        raise InputError(f"be {wanted[1]} x {wanted[0]}, as {whose}", got=got, file=path)


def _files(role: str, place: Path, suffixes: tuple[str, ...]) -> list[Path]:
    if place.is_file():
        return [place]
    if not place.exists():
        raise InputError("exist", file=place, remedy="Check the path.")
    found = sorted(p for p in place.iterdir() if p.is_file() and p.suffix.lower() in suffixes and not p.name.startswith("."))
    if not found:
        raise InputError(f"hold files of {', '.join(suffixes)}", got="none", file=place, key=None if role in "AB" else f"--{role}")
    return found
