"""Fitted reflectance that varies over a surface: textures of parameters, normals, and how well they fit.

In a folder: `material.json` (material/1, docs/formats.md), one EXR per parameter, `normal.exr` and, for viewers, `normal.png`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fit import TexelFit
from .fit_problem import KINDS
from .foundation.checks import check_unit
from .foundation.errors import InputError
from .foundation.files import write_json
from .foundation.images import read_exr, write_exr, write_raw
from .foundation.typed_json import read_typed_json
from .kernels import svbrdf as kernel

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SVBRDF:
    """Parameters of T texels, which are the places of a mask in row order.

    Attributes
    ----------
    model : str
        `ct`, `ward`, `phong` or `ggx`.
    eta : float
        Refractive index of the Fresnel factor of ct and ggx.
    mask : (H, W) bool
        Where there is surface; T places.
    diffuse : (T, 3) float64
        Albedo d of d / pi, linear Rec. 709.
    specular : (T, L, 3) float64
        Scales of the lobes.
    alpha : (T, L, 2) float64
        Widths along tangent and bitangent.
    frame : (T, 3, 3) float64
        Columns tangent, bitangent, normal; x right, y up, z out of the coarse surface.
    cost, relative_variance : (T,) float64
        As `TexelFit`; NaN where the fit failed (the texel is then black, its normal z).
    unit : str
        `1/sr`, or `relative`: known up to one factor.
    name : str
        Of what was measured.
    sigma : (T,) float64, optional
        Spread of the slopes of an Oren-Nayar base [rad]; None is a Lambert base.
    """

    model: str
    eta: float
    mask: NDArray[np.bool_]
    diffuse: Floats
    specular: Floats
    alpha: Floats
    frame: Floats
    cost: Floats
    relative_variance: Floats
    unit: str = "1/sr"
    name: str = ""
    sigma: Floats | None = None

    @property
    def base(self) -> Literal["lambert", "oren_nayar"]:
        """Model of the matte part."""
        return "lambert" if self.sigma is None else "oren_nayar"

    @property
    def spread(self) -> Floats:
        """Spreads of the base's slopes (T,) [rad]; 0 throughout for Lambert."""
        return np.zeros(len(self.diffuse)) if self.sigma is None else self.sigma

    @property
    def lobes(self) -> int:
        """Number of specular lobes."""
        return self.alpha.shape[1]

    @property
    def normal(self) -> Floats:
        """Unit normals (T, 3)."""
        return self.frame[:, :, 2]

    def reflect(self, wi: ArrayLike, wo: ArrayLike, texels: NDArray | slice = slice(None)) -> Floats:
        """Return f cos theta_i (T, 3), on the fitted normal: what a unit light sends towards the viewer.

        Parameters
        ----------
        wi, wo : (T, 3) or (3,) float
            Unit directions, in coordinates of the coarse surface.
        texels : index
            Some of the texels only.
        """
        frame = np.ascontiguousarray(self.frame[texels])
        shape = (len(frame), 3)
        i, o = (np.ascontiguousarray(np.broadcast_to(np.asarray(w, np.float64), shape)) for w in (wi, wo))
        check_unit("wi", i)
        check_unit("wo", o)
        f0 = ((self.eta - 1) / (self.eta + 1)) ** 2
        parts = (self.diffuse, self.specular, self.alpha, self.spread)
        diffuse, specular, alpha, sigma = (np.ascontiguousarray(a[texels]) for a in parts)
        return kernel.reflect(KINDS[self.model], f0, diffuse, specular, alpha, sigma, frame, i, o)

    def picture(self, values: NDArray, empty: float = 0.0) -> NDArray[np.float32]:
        """Return values (T, ...) as a picture (H, W, ...)."""
        out = np.full((*self.mask.shape, *values.shape[1:]), empty, np.float32)
        out[self.mask] = values
        return out


def from_fits(
    fits: Sequence[TexelFit | None],
    model: str,
    eta: float,
    lobes: int,
    mask: NDArray[np.bool_],
    unit: str,
    name: str,
    base: str = "lambert",
) -> SVBRDF:
    """Return fitted texels as textures; None is a texel whose fit failed."""
    num = len(fits)
    diffuse, specular, alpha = np.zeros((num, 3)), np.zeros((num, lobes, 3)), np.full((num, lobes, 2), 0.5)
    frame, cost, relative = np.tile(np.eye(3), (num, 1, 1)), np.full(num, np.nan), np.full(num, np.nan)
    sigma = None if base == "lambert" else np.array([0.0 if fit is None else fit.sigma for fit in fits])
    for t, fit in enumerate(fits):
        if fit is not None:
            diffuse[t], specular[t], alpha[t], frame[t] = fit.diffuse, fit.specular, fit.alpha, fit.frame
            cost[t], relative[t] = fit.cost, fit.relative_variance
    return SVBRDF(model, eta, mask, diffuse, specular, alpha, frame, cost, relative, unit, name, sigma)


class MaterialJson(msgspec.Struct, forbid_unknown_fields=True):
    """material/1, key by key."""

    format: Literal["material/1"]
    model: Literal["ct", "ward", "phong", "ggx"]
    eta: float
    lobes: int
    width: int
    height: int
    unit: Literal["1/sr", "relative"]
    textures: dict[str, str]
    name: str = ""
    base: Literal["lambert", "oren_nayar"] = "lambert"
    fit: dict[str, object] = {}


def write_svbrdf(folder: str | Path, material: SVBRDF, fit: dict[str, object] | None = None) -> None:
    """Write textures and `material.json`, which comes last: a folder without it is no material.

    Parameters
    ----------
    folder : path
    material : SVBRDF
    fit : dict
        What to say about the fit: settings and numbers.
    """
    folder = Path(folder)
    textures = {"diffuse": "diffuse.exr", "normal": "normal.exr", "tangent": "tangent.exr", "quality": "quality.exr"}
    _write_exr(folder / "diffuse.exr", "RGB", material.picture(material.diffuse))
    for k in range(material.lobes):
        textures |= {f"specular_{k}": f"specular_{k}.exr", f"alpha_{k}": f"alpha_{k}.exr"}
        _write_exr(folder / f"specular_{k}.exr", "RGB", material.picture(material.specular[:, k]))
        _write_exr(folder / f"alpha_{k}.exr", ("U", "V"), material.picture(material.alpha[:, k], 0.5))
    if material.sigma is not None:
        textures["sigma"] = "sigma.exr"
        _write_exr(folder / "sigma.exr", "Y", material.picture(material.sigma[:, None]))
    normal = material.picture(material.normal)
    _write_exr(folder / "normal.exr", "XYZ", normal)
    _write_exr(folder / "tangent.exr", "XYZ", material.picture(material.frame[:, :, 0]))
    quality = np.stack([material.cost, material.relative_variance], axis=-1)
    both = np.concatenate([material.picture(quality, np.nan), material.mask[..., None].astype(np.float32)], axis=-1)
    _write_exr(folder / "quality.exr", ("cost", "relative_variance", "mask"), both)
    write_raw(folder / "normal.png", normal_picture(normal))
    height, width = material.mask.shape
    head: dict[str, object] = {"format": "material/1", "name": material.name, "model": material.model, "eta": material.eta}
    head |= {
        "base": material.base,
        "lobes": material.lobes,
        "width": width,
        "height": height,
        "unit": material.unit,
        "textures": textures,
    }
    write_json(folder / "material.json", {**head, "fit": fit or {}})


def read_svbrdf(path: str | Path) -> SVBRDF:
    """Read what `write_svbrdf` wrote: `material.json` or its folder.

    Raises
    ------
    InputError
        If a file is missing or damaged, or sizes disagree.
    """
    path = Path(path)
    path = path / "material.json" if path.is_dir() else path
    head = read_typed_json(path, MaterialJson)
    if not 1 <= head.lobes <= 2:
        raise InputError("be 1 or 2", got=head.lobes, file=path, key="lobes")
    quality = _read_exr(path, head, "quality", ("cost", "relative_variance", "mask"))
    mask = quality[..., 2] > 0.5
    if not mask.any():
        raise InputError("mark some surface", got="an empty mask", file=path, key="textures.quality")
    diffuse = _read_exr(path, head, "diffuse", "RGB")[mask]
    specular = np.stack([_read_exr(path, head, f"specular_{k}", "RGB")[mask] for k in range(head.lobes)], axis=1)
    alpha = np.stack([_read_exr(path, head, f"alpha_{k}", ("U", "V"))[mask] for k in range(head.lobes)], axis=1)
    normal, tangent = (_read_exr(path, head, key, "XYZ")[mask] for key in ("normal", "tangent"))
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=-1)
    cost, relative = quality[mask][:, 0], quality[mask][:, 1]
    sigma = None
    if head.base == "oren_nayar":
        sigma = _read_exr(path, head, "sigma", "Y")[mask][:, 0]
        if not ((sigma >= 0) & (sigma <= np.pi / 2)).all():
            raise InputError("lie in [0, pi / 2] rad", got=float(sigma.max()), file=path.parent / head.textures["sigma"])
    return SVBRDF(head.model, head.eta, mask, diffuse, specular, alpha, frame, cost, relative, head.unit, head.name, sigma)


def normal_picture(normal: NDArray) -> NDArray[np.uint16]:
    """Return normals (H, W, 3) as the 16-bit picture of a normal map: (n + 1) / 2, z where there is none."""
    known = np.linalg.norm(normal, axis=-1, keepdims=True) > 0.5
    return np.rint(65535 * np.clip(0.5 + 0.5 * np.where(known, normal, (0.0, 0.0, 1.0)), 0, 1)).astype(np.uint16)


def _write_exr(path: Path, names: Sequence[str], values: NDArray) -> None:
    write_exr(path, {name: values[..., k].astype(np.float32) for k, name in enumerate(names)})


def _read_exr(path: Path, head: MaterialJson, key: str, names: Sequence[str]) -> Floats:
    if key not in head.textures:
        raise InputError("be given", file=path, key=f"textures.{key}")
    file = path.parent / head.textures[key]
    if not file.resolve().is_relative_to(path.parent.resolve()):
        raise InputError("be a path below the folder of the JSON", got=head.textures[key], file=path, key=f"textures.{key}")
    layers = read_exr(file)
    if missing := [name for name in names if name not in layers]:
        raise InputError(f"have the channel {missing[0]}", file=file)
    out = np.stack([layers[name] for name in names], axis=-1).astype(np.float64)
    if out.shape[:2] != (head.height, head.width):
        raise InputError(f"have the size {(head.height, head.width)}", got=out.shape[:2], file=file)
    return out
