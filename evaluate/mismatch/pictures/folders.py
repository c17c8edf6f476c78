"""Two folders of pictures, one recorded and one simulated elsewhere, with depth and masks if there are any."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from scene.depth_files import SUFFIXES as DEPTHS
from scene.depth_files import read_depth
from scene.images import Encoding, read_ids, read_image
from scene.recording import Noise

from .case import Given, PictureCase, build
from .noise import noise_of_pair

PICTURES = (".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff", ".bmp", ".hdr")
_IDS = (".png", ".tif", ".tiff", ".bmp")


def load_folders(
    simulated: str | Path,
    recorded: str | Path,
    depth: str | Path | None = None,
    masks: str | Path | None = None,
    noise: Noise | None = None,
    focal_px: float | None = None,
) -> PictureCase:
    """Read pictures, and bring them together by their names, or in the order of their names.

    Parameters
    ----------
    simulated, recorded : folder
        Pictures of one size.
    depth : folder, optional
        Depth of each simulated picture [m], see `scene.depth_files`.
    masks : folder, optional
        Ids of bodies in each simulated picture, 0 for all else.
    noise : Noise, optional
        Of the recording; estimated if not given.
    focal_px : float, optional
        Focal length; the picture's width if not given.

    Raises
    ------
    InputError
        If a folder has no pictures, one lacks a frame that the other has, a file cannot be read, or sizes differ.
    """
    A, B = _files(simulated, PICTURES, "--simulated"), _files(recorded, PICTURES, "--recorded")
    notes: list[str] = []
    pairs = _paired(A, B, "--simulated", simulated, notes)
    made, made_as = _read([a for a, _ in pairs], "reading what was simulated")
    seen, seen_as = _read([b for _, b in pairs], "reading what was recorded")
    for (a, b), S, R in zip(pairs, made, seen, strict=True):
        if S.shape != R.shape:
            remedy = "Render at the size of the recording; nothing is resampled here."
            raise InputError(f"be {_size(R)} as {b}", got=_size(S), file=a, remedy=remedy)
    sizes = {_size(R): b for R, (_, b) in zip(seen, pairs, strict=True)}
    if len(sizes) > 1:
        one, other = list(sizes.items())[:2]
        raise InputError(f"be {one[0]} as {one[1]}", got=other[0], file=other[1], remedy="Diagnose each size by itself.")
    if any(e.response == "srgb" for e in (*made_as, *seen_as)):
        notes.append("The response of integer pictures was taken to be sRGB: the files do not say.")
    R, S = np.stack(seen), np.stack(made)
    height, width = R.shape[1:3]
    if focal_px is None:
        notes.append(f"No focal length was given; where one is needed it is {width} px, the picture's width.")
    names = [b.name for _, b in pairs]
    frames = [a.stem for a, _ in pairs]
    valid = np.all(np.isfinite(R) & np.isfinite(S), axis=-1)
    known = [np.where(valid[..., None], v, 0) for v in (R, S)]
    found = noise or noise_of_pair(known[0], known[1], valid, (made_as[0], seen_as[0]))
    given = Given(
        R, S, names,
        depth=None if depth is None else _beside(depth, frames, DEPTHS, "--depth", read_depth, (height, width)),
        labels=None if masks is None else _beside(masks, frames, _IDS, "--masks", _ids, (height, width)).astype(np.int64),
        focal_px=focal_px,
    )  # fmt: skip
    return build(given, found, noise is None, tuple(notes), Path(recorded))


def _files(folder: str | Path, suffixes: tuple[str, ...], key: str) -> list[Path]:
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("be a folder of pictures", got=folder, key=key)
    found = sorted(f for f in folder.iterdir() if f.suffix.lower() in suffixes and not f.name.startswith("."))
    if not found:
        raise InputError(f"hold files that end in {', '.join(suffixes)}", got="none", file=folder, key=key)
    stems = [f.stem for f in found]
    if twice := next((s for s in stems if stems.count(s) > 1), None):
        raise InputError("hold one file of a name", got=f"several of {twice}", file=folder, key=key)
    return found


def _paired(A: list[Path], B: list[Path], key: str, folder: str | Path, notes: list[str]) -> list[tuple[Path, Path]]:
    a, b = {f.stem: f for f in A}, {f.stem: f for f in B}
    if a.keys() == b.keys():
        return [(a[s], b[s]) for s in b]
    if not a.keys() & b.keys() and len(A) == len(B):
        notes.append("The two folders have no name in common: their files were paired in the order of their names.")
        return list(zip(A, B, strict=True))
    odd = sorted(a.keys() ^ b.keys())[0]
    which = "have a picture for each recorded one" if odd in b else "have no picture that was not recorded"
    remedy = "Give both folders the same names, or as many files."
    raise InputError(which, got=f"{len(A)} for {len(B)}; {odd} stands alone", file=folder, key=key, remedy=remedy)


def _read(files: list[Path], label: str) -> tuple[list[NDArray[np.float32]], list[Encoding]]:
    read = [read_image(f) for f in tracked(files, label)]
    return [r[0] for r in read], [r[1] for r in read]


def _ids(path: Path) -> NDArray:
    ids = read_ids(path)
    if ids.ndim != 2 or ids.dtype.kind not in "iu":
        raise InputError("hold one integer a pixel", got=f"{ids.shape} of {ids.dtype}", file=path, key="the mask")
    return ids


def _beside(folder: str | Path, frames: list[str], suffixes: tuple[str, ...], key: str, read, size: tuple[int, int]) -> NDArray:
    """Read what goes with each frame: by the names of the simulated pictures, else in order."""
    files = _files(folder, suffixes, key)
    by_name = {f.stem: f for f in files}
    if not all(s in by_name for s in frames):
        if len(files) != len(frames) or any(s in by_name for s in frames):
            lacking = next(s for s in frames if s not in by_name)
            raise InputError("have a file for each frame", got=f"none for {lacking}", file=Path(folder), key=key)
        by_name = dict(zip(frames, files, strict=True))
    out = []
    for s in frames:
        values = read(by_name[s])
        if values.shape != size:
            raise InputError(
                f"be {size[1]} x {size[0]} as the pictures", got=f"{values.shape[1]} x {values.shape[0]}", file=by_name[s]
            )
        out.append(values)
    return np.stack(out)


def _size(picture: NDArray) -> str:
    return f"{picture.shape[1]} x {picture.shape[0]}"
