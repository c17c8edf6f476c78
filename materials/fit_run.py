"""The fit of a whole measurement, block by block: progress, what an interrupted run has done, normals first where needed."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .fit import FitSettings, TexelFit, fit_texel, fit_where_possible
from .foundation.files import make_folder, replacing
from .foundation.progress import tracked
from .foundation.settings import as_dict
from .measured.source import Source
from .photometric_stereo import NormalSettings, angular_error_deg, lambert_normals, robust_normals
from .svbrdf import SVBRDF, from_fits

Floats = NDArray[np.float64]
_BLOCK_BYTES = 64e6
_VERSION = 2
"""Raised when a change of the code makes earlier blocks worthless."""


@dataclass(frozen=True)
class FitResult:
    """A fitted measurement.

    Attributes
    ----------
    material : SVBRDF
    sigma : (T, P) float64
        Standard deviations of diffuse, specular, alpha, sigma and tangent angle (order of `TexelFit.covariance`); 0 where held.
    failed : int
        Texels without enough valid samples.
    normal_error_deg : dict of str to float
        Mean angle to the measured normals, where the source brings them: of our estimate and of least squares.
    """

    material: SVBRDF
    sigma: Floats
    failed: int
    normal_error_deg: dict[str, float]


def run_fit(source: Source, settings: FitSettings, work: Path | None = None, inputs: Path | None = None) -> FitResult:
    """Fit a source.

    Parameters
    ----------
    source : Source
    settings : FitSettings
    work : path, optional
        Folder that keeps finished blocks until `discard_work`; a later run with equal input and settings goes on from there.
    inputs : path, optional
        What the source was read from; part of the key of kept blocks.

    Raises
    ------
    InputError
        If no texel has enough valid samples.
    """
    keep = _Kept(work, _key(source, settings, inputs)) if work is not None else None
    frames, errors = None, {}
    if source.photographs is not None:
        frames, errors = _photographed_frames(source, keep)
    num = source.num_texels
    probe = source.block(0, 1)
    per_texel = probe.value[0].nbytes
    size = int(np.clip(_BLOCK_BYTES / max(per_texel, 1), 1, 512))
    fits: list[TexelFit | None] = []
    for first in tracked(range(0, num, size), "fitting texels"):
        last = min(first + size, num)
        block = keep.load(f"block_{first}") if keep else None
        if block is None:
            some = None if frames is None else frames[first:last]
            block = fit_where_possible(source.block(first, last), settings, some)
            if keep:
                keep.save(f"block_{first}", block)
        fits += block
    failed = sum(fit is None for fit in fits)
    if failed == num:
        fit_texel(source.block(0, 1), 0, settings)  # says why
    known = next(fit for fit in fits if fit is not None)
    sigma = np.zeros((num, len(known.covariance)))
    for t, fit in enumerate(fits):
        if fit is not None:
            sigma[t] = np.sqrt(np.maximum(np.diag(fit.covariance), 0))
    given = (settings.model, settings.eta, settings.lobes, source.mask, probe.unit, source.name, settings.base)
    material = from_fits(fits, *given)
    return FitResult(material, sigma, failed, errors)


def discard_work(work: Path) -> None:
    """Remove kept blocks once the result stands."""
    shutil.rmtree(work, ignore_errors=True)


def frames_of(normal: Floats) -> Floats:
    """Return frames (T, 3, 3) about normals (T, 3): the tangent is x, made orthogonal."""
    x = np.where(np.abs(normal[:, :1]) < 0.99, (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    tangent = x - (x * normal).sum(axis=1, keepdims=True) * normal
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame: Floats = np.stack([tangent, np.asarray(np.cross(normal, tangent), np.float64), normal], axis=-1)
    return frame


def _photographed_frames(source: Source, keep: _Kept | None) -> tuple[Floats, dict[str, float]]:
    """Return frames by photometric stereo, and how far their normals are from the measured ones."""
    photographs = source.photographs
    assert photographs is not None
    grey = photographs.abrdf
    normal = keep.load_array("normals") if keep else None
    if normal is None:
        normal = robust_normals(grey, NormalSettings()).normal
        if keep:
            keep.save_array("normals", normal)
    errors = {}
    if photographs.normal is not None:
        truth = photographs.normal[source.mask]
        known = np.linalg.norm(truth, axis=1) > 0.5
        for name, found in (("photometric stereo", normal), ("least squares", lambert_normals(grey))):
            errors[name] = float(angular_error_deg(found[known], truth[known]).mean())
    return frames_of(normal), errors


class _Kept:
    """Finished parts of a run in a folder, valid for one key."""

    def __init__(self, folder: Path, key: str) -> None:
        self.folder = folder
        stamp = folder / "key"
        if not stamp.is_file() or stamp.read_text(encoding="utf-8") != key:
            shutil.rmtree(folder, ignore_errors=True)
            make_folder(folder)
            with replacing(stamp) as temporary:
                temporary.write_text(key, encoding="utf-8")

    def load_array(self, name: str) -> Floats | None:
        file = self.folder / f"{name}.npy"
        return np.load(file, allow_pickle=False) if file.is_file() else None

    def save_array(self, name: str, values: NDArray) -> None:
        with replacing(self.folder / f"{name}.npy") as temporary:
            np.save(temporary, values, allow_pickle=False)

    def load(self, name: str) -> list[TexelFit | None] | None:
        file = self.folder / f"{name}.npz"
        if not file.is_file():
            return None
        with np.load(file, allow_pickle=False) as kept:
            arrays = {key: kept[key] for key in kept.files}
        out: list[TexelFit | None] = []
        for t, fitted in enumerate(arrays["fitted"]):
            diffuse, specular, alpha, frame = (arrays[key][t] for key in ("diffuse", "specular", "alpha", "frame"))
            cost, relative = float(arrays["cost"][t]), float(arrays["relative"][t])
            spread = float(arrays["sigma"][t])
            fit = TexelFit(diffuse, specular, alpha, frame, cost, relative, arrays["covariance"][t], spread)
            out.append(fit if fitted else None)
        return out

    def save(self, name: str, fits: list[TexelFit | None]) -> None:
        known = next((fit for fit in fits if fit is not None), None)
        if known is None:
            return
        full = [fit or known for fit in fits]
        arrays = {
            key: np.stack([getattr(fit, key) for fit in full]) for key in ("diffuse", "specular", "alpha", "frame", "covariance")
        }
        arrays |= {"cost": np.array([f.cost for f in full]), "relative": np.array([f.relative_variance for f in full])}
        arrays["sigma"] = np.array([f.sigma for f in full])
        arrays["fitted"] = np.array([fit is not None for fit in fits])
        with replacing(self.folder / f"{name}.npz") as temporary:
            np.savez(temporary, **arrays)  # type: ignore[arg-type]


def _key(source: Source, settings: FitSettings, inputs: Path | None) -> str:
    """Return what kept blocks depend on: settings, the data's shape, and name, size and time of each input file."""
    files = []
    if inputs is not None:
        listed = sorted(inputs.rglob("*")) if inputs.is_dir() else [inputs]
        files = [(str(f), f.stat().st_size, f.stat().st_mtime_ns) for f in listed if f.is_file() and ".fit" not in f.parts]
    told = as_dict(replace(settings, threads=0))
    content = [_VERSION, told, source.kind, source.num_texels, source.block(0, 1).value.shape, files]
    return hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()
