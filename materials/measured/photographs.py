"""Photographs of an object under one light at a time, in the layout of DiLiGenT: an ABRDF per pixel, seen from one side.

A folder holds `filenames.txt` (or the images in order of name), `light_directions.txt` (unit vectors towards the lights: x
right, y up, z to the camera, which looks from far away along -z), optionally `light_intensities.txt` (RGB, by which the
images are divided) and `mask.png`; and for evaluation `normal_gt.npy` (H, W, 3), `Normal_gt.mat` or `normal.txt`.

References
----------
Shi et al. (2019), A Benchmark Dataset and Evaluation for Non-Lambertian and Uncalibrated Photometric Stereo.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF
from ..foundation.errors import InputError
from ..foundation.images import read_image, read_raw
from ..foundation.progress import tracked

Floats = NDArray[np.float64]
_SUFFIXES = (".png", ".tif", ".tiff", ".exr")


@dataclass(frozen=True)
class Photographs:
    """An object under many lights.

    Attributes
    ----------
    abrdf : ABRDF
        Texels are the mask's pixels; N is the number of lights; not normalised (the shading is still in), unit `relative`.
    mask : (H, W) bool
        The object.
    files : tuple of str
        Names of the images used.
    normal : (H, W, 3) float64 or None
        Measured normals, x right, y up, z to the camera; 0 outside the object.
    """

    abrdf: ABRDF
    mask: NDArray[np.bool_]
    files: tuple[str, ...]
    normal: Floats | None

    @property
    def lights(self) -> Floats:
        """Unit directions (N, 3) towards the lights."""
        return self.abrdf.wi


def read_photographs(folder: str | Path, images: slice | None = None) -> Photographs:
    """Read the photographs of one object.

    Parameters
    ----------
    folder : path
        In the layout above.
    images : slice, optional
        Some of the images only: the first 20 of DiLiGenT's bear are damaged, `slice(20, None)` leaves them out.

    Returns
    -------
    photographs : Photographs

    Raises
    ------
    InputError
        If a file is missing or damaged, a light direction is not of unit length or below the horizon, an intensity is not
        positive, the mask is empty, or sizes and counts disagree.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("be a folder of photographs", file=folder, remedy="Check the path.")
    lights = _table(folder / "light_directions.txt")
    names = _names(folder)
    if len(names) != len(lights):
        got = f"{len(lights)} for {len(names)} images"
        raise InputError("have one row per image", got=got, file=folder / "light_directions.txt")
    lengths = np.linalg.norm(lights, axis=1)
    # Published directions carry four decimals: lengths within 0.001 of 1 are rounding, others a mistake.
    if (abs(lengths - 1) > 1e-3).any() or (lights[:, 2] <= 0).any():
        row = int(np.argmax((abs(lengths - 1) > 1e-3) | (lights[:, 2] <= 0)))
        must = "hold unit vectors above the image plane"
        raise InputError(must, got=lights[row].tolist(), file=folder / "light_directions.txt", key=f"row {row + 1}")
    lights = lights / lengths[:, None]
    intensities = _intensities(folder / "light_intensities.txt", len(names))
    chosen = range(len(names))[images or slice(None)]
    if len(chosen) < 3:
        raise InputError("leave at least three images", got=len(chosen), file=folder, key="images")
    mask = _mask(folder, names[chosen[0]])
    value = np.empty((int(mask.sum()), len(chosen), 3), np.float32)
    for k, i in enumerate(tracked(chosen, "reading photographs")):
        linear, _ = read_image(folder / _image_folder(folder, names[i]) / names[i], "linear")
        if linear.shape[:2] != mask.shape:
            raise InputError(f"be as large as the mask, {mask.shape}", got=linear.shape[:2], file=folder / names[i])
        value[:, k] = linear[mask] / intensities[i].astype(np.float32)
    wi = lights[list(chosen)]
    wo = np.tile([0.0, 0.0, 1.0], (len(wi), 1))
    weight = np.full(len(wi), 1.0)
    abrdf = ABRDF(
        wi,
        wo,
        value,
        np.ones(value.shape[:2], bool),
        weight,
        unit="relative",
        normalised=False,
        mask=mask,
        name=folder.name,
    )
    return Photographs(abrdf, mask, tuple(names[i] for i in chosen), _truth(folder, mask))


def _names(folder: Path) -> list[str]:
    listed = folder / "filenames.txt"
    if listed.is_file():
        names = listed.read_text(encoding="utf-8").split()
    else:
        place = folder / "images" if (folder / "images").is_dir() else folder
        helpers = ("mask", "normal")
        found = (f for f in sorted(place.iterdir()) if f.suffix.lower() in _SUFFIXES)
        names = [f.name for f in found if not f.stem.lower().startswith(helpers)]
    for name in names:
        if Path(name).name != name:
            raise InputError("name files without folders", got=name, file=listed)
        if not (folder / _image_folder(folder, name) / name).is_file():
            raise InputError("exist", file=folder / name, remedy=f"It is listed in {listed.name}.")
    if not names:
        raise InputError("hold images", got="none", file=folder)
    return names


def _image_folder(folder: Path, name: str) -> str:
    return "images" if (folder / "images" / name).is_file() else "."


def _table(path: Path) -> Floats:
    try:
        table = np.loadtxt(path, ndmin=2)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Give one row of three numbers per image.") from error
    except ValueError as error:
        raise InputError("hold rows of three numbers", got=error, file=path) from error
    if table.shape[1] != 3 or not np.isfinite(table).all():
        raise InputError("hold rows of three finite numbers", got=table.shape, file=path)
    return table


def _intensities(path: Path, count: int) -> Floats:
    if not path.is_file():
        return np.ones((count, 3))
    table = _table(path)
    if len(table) != count or (table <= 0).any():
        raise InputError(f"hold {count} rows of positive numbers", got=f"{len(table)} rows, smallest {table.min():g}", file=path)
    return table


def _mask(folder: Path, first: str) -> NDArray[np.bool_]:
    path = folder / "mask.png"
    if path.is_file():
        raw = read_raw(path)
        mask = (raw if raw.ndim == 2 else raw.max(axis=2)) > 0
    else:
        raw = read_raw(folder / _image_folder(folder, first) / first)
        mask = np.ones(raw.shape[:2], bool)
    if not mask.any():
        raise InputError("mark the object", got="an empty mask", file=path)
    return mask


def _truth(folder: Path, mask: NDArray[np.bool_]) -> Floats | None:
    name = next((n for n in ("normal_gt.npy", "Normal_gt.mat", "normal.txt") if (folder / n).is_file()), None)
    if name is None:
        return None
    try:
        if name.endswith(".npy"):
            normal = np.load(folder / name, allow_pickle=False)
        elif name.endswith(".mat"):
            from scipy.io import loadmat

            normal = loadmat(folder / name)["Normal_gt"]
        else:
            normal = np.loadtxt(folder / name).reshape(*mask.shape, 3)
    except (ValueError, KeyError, EOFError, OSError) as error:
        raise InputError("hold normals (H, W, 3)", got=error, file=folder / name) from error
    if normal.shape != (*mask.shape, 3):
        raise InputError(f"have shape {(*mask.shape, 3)}", got=normal.shape, file=folder / name)
    return np.where(mask[..., None], normal, 0).astype(np.float64)
