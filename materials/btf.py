"""Bidirectional texture functions, compressed by matrix factorisation, and looked up at any directions.

A BTF is a matrix of texels by pairs of directions; its leading singular vectors say most of it. `fmf` factorises all channels
at once, `dfmf` each of three decorrelated channels by itself.

References
----------
Koudelka et al. (2003), Acquisition, Compression, and Synthesis of Bidirectional Texture Functions (full matrix
factorisation). Schwartz et al. (2013), DOME II (decorrelated). Halko, Martinsson and Tropp (2011), Finding Structure with
Randomness (the factorisation).
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .abrdf import ABRDF, pairs
from .directions import interpolation, solid_angles
from .foundation.checks import check_shape, check_unit
from .foundation.errors import InputError
from .foundation.files import replacing

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
METHODS = ("fmf", "dfmf")
_OVERSAMPLING, _POWERS = 10, 2


@dataclass(frozen=True)
class BTF:
    """A compressed BTF.

    Attributes
    ----------
    wi, wo : (I, 3), (O, 3) float64
        Directions of light and view; all pairs were measured.
    mask : (H, W) bool
        Where there are T texels, in row order.
    spatial : tuple of (T, K) float32
        One factor per group of channels: a single one (`fmf`) or three (`dfmf`).
    angular : tuple of (K, I, O, G) float32
        The other factors; G channels in the group.
    colour : (3, 3) float64
        From the factors' channels to linear Rec. 709.
    relative_error : float
        Root mean square of what compression lost, over that of the values.
    unit, name : str

    Notes
    -----
    Values have the irradiance's cosine in.
    """

    wi: Floats
    wo: Floats
    mask: NDArray[np.bool_]
    spatial: tuple[Singles, ...]
    angular: tuple[Singles, ...]
    colour: Floats
    relative_error: float
    unit: str = "1/sr"
    name: str = ""

    @property
    def num_texels(self) -> int:
        """Number of texels T."""
        return int(self.mask.sum())

    @property
    def num_bytes(self) -> int:
        """Size of the factors."""
        return sum(f.nbytes for f in (*self.spatial, *self.angular))

    def decompress(self, first: int = 0, last: int | None = None) -> ABRDF:
        """Return texels `first` to `last` as an apparent BRDF (not normalised) at all pairs of directions.

        What compression brought below 0 is set to 0.
        """
        groups = [s[first:last] @ a.reshape(len(a), -1) for s, a in zip(self.spatial, self.angular, strict=True)]
        num = len(self.wi) * len(self.wo)
        channels = np.concatenate([g.reshape(len(g), num, -1) for g in groups], axis=2)
        value = np.maximum(channels @ self.colour.T.astype(np.float32), 0)
        wi, wo = pairs(self.wi, self.wo)
        weight = np.outer(solid_angles(self.wi), solid_angles(self.wo)).reshape(-1)
        valid = np.ones(value.shape[:2], bool)
        grid = (len(self.wi), len(self.wo))
        return ABRDF(wi, wo, value, valid, weight, unit=self.unit, normalised=False, grid=grid, name=self.name)

    def reflect(self, texels: ArrayLike, wi: ArrayLike, wo: ArrayLike) -> Floats:
        """Return what a unit light sends towards the viewer (Q, 3), the cosine in, linearly between measured directions.

        Parameters
        ----------
        texels : (Q,) int
            Indices of texels.
        wi, wo : (Q, 3) float
            Unit directions in the texels' common frame. Outside the measured cap the nearest direction's reflectance stands, so
            that what is sent fades with the light's cosine; below the horizon it is black.
        """
        which = np.asarray(texels, np.int64).reshape(-1)
        i, o = (np.broadcast_to(np.asarray(w, np.float64), (len(which), 3)) for w in (wi, wo))
        check_unit("wi", i)
        check_unit("wo", o)
        by_i, by_o = interpolation(self.wi, i), interpolation(self.wo, o)
        groups = []
        for spatial, angular in zip(self.spatial, self.angular, strict=True):
            total = np.zeros((len(which), angular.shape[3]))
            for a in range(3):
                for b in range(3):
                    share = by_i.weights[:, a] * by_o.weights[:, b]
                    corner = angular[:, by_i.indices[:, a], by_o.indices[:, b]]  # (K, Q, G)
                    total += share[:, None] * np.einsum("qk,kqg->qg", spatial[which], corner)
            groups.append(total)
        value = np.maximum(np.concatenate(groups, axis=1) @ self.colour.T, 0)
        rim = np.maximum(self.wi[by_i.indices[:, 0], 2], 1e-6)
        value *= np.where(by_i.inside, 1.0, i[:, 2] / rim)[:, None]
        return np.where((i[:, 2:] > 0) & (o[:, 2:] > 0), value, 0)


def compress(abrdf: ABRDF, rank: int = 32, method: str = "fmf", seed: int = 0) -> BTF:
    """Compress a measured BTF.

    Parameters
    ----------
    abrdf : ABRDF
        On a grid of directions, with one texel axis or more, all samples valid.
    rank : int
        Singular vectors kept; per channel for `dfmf`.
    method : {"fmf", "dfmf"}
    seed : int
        Of the random projection.

    Raises
    ------
    InputError
        If there is no grid, samples are missing, or the rank or method is unknown.
    """
    if abrdf.grid is None:
        raise InputError("be a grid of directions", got="scattered pairs", key="the measurement", remedy="Resample it first.")
    if not abrdf.valid.all():
        raise InputError("have all samples valid", got=f"{float(abrdf.valid.mean()):.3f} of them", key="the measurement")
    if method not in METHODS:
        raise InputError(f"be one of {', '.join(METHODS)}", got=method, key="method")
    if rank < 1:
        raise InputError("be at least 1", got=rank, key="rank")
    shaded = abrdf.with_cosine().flat()
    num_i, num_o = abrdf.grid
    value = shaded.value
    num, _, channels = value.shape
    colour = np.eye(channels)
    if method == "dfmf":
        some = value[:: max(num // 64, 1)].reshape(-1, channels).astype(np.float64)
        _, colour = np.linalg.eigh(some.T @ some)
        value = value @ colour.astype(np.float32)
        parts = [np.ascontiguousarray(value[:, :, c : c + 1]) for c in range(channels)]
    else:
        parts = [value]
    rng = np.random.default_rng(seed)
    spatial, angular, lost = [], [], 0.0
    for part in parts:
        matrix = part.reshape(num, -1)
        left, right = _factorise(matrix, rank, rng)
        lost += sum(float(np.sum((matrix[k : k + 256] - left[k : k + 256] @ right) ** 2)) for k in range(0, num, 256))
        spatial.append(left)
        angular.append(right.reshape(len(right), num_i, num_o, -1))
    level = float(np.sum(shaded.value.astype(np.float64) ** 2)) if num < 64 else sum(float(np.sum(row**2)) for row in shaded.value)
    mask = abrdf.mask if abrdf.mask is not None else np.ones((1, num), bool)
    error = float(np.sqrt(lost / max(level, 1e-300)))
    wi, wo = abrdf.wi[::num_o], abrdf.wo[:num_o]
    return BTF(wi, wo, mask, tuple(spatial), tuple(angular), colour, error, abrdf.unit, abrdf.name)


def _factorise(matrix: Singles, rank: int, rng: np.random.Generator) -> tuple[Singles, Singles]:
    """Return left (T, K) and right (K, N), whose product is near the matrix: a randomised singular value decomposition."""
    num, size = matrix.shape
    kept = min(rank, num, size)
    probes = rng.standard_normal((num, min(kept + _OVERSAMPLING, num))).astype(np.float32)
    for _ in range(_POWERS):
        basis, _ = np.linalg.qr((probes.T @ matrix).T)  # (N, K'), over directions
        probes, _ = np.linalg.qr(matrix @ basis)
    small = probes.T @ matrix
    u, s, v = np.linalg.svd(small, full_matrices=False)
    left = probes @ (u[:, :kept] * s[:kept])
    return left.astype(np.float32), np.ascontiguousarray(v[:kept], np.float32)


def write_btf(path: str | Path, btf: BTF) -> None:
    """Write a compressed BTF as npz: the factors as half floats, all else as it is."""
    arrays: dict[str, NDArray] = {"wi": btf.wi, "wo": btf.wo, "mask": btf.mask, "colour": btf.colour}
    for k, (s, a) in enumerate(zip(btf.spatial, btf.angular, strict=True)):
        # Scaled so that half floats' range is used evenly.
        level = np.maximum(np.abs(a).max(axis=(1, 2, 3)), 1e-30)
        arrays |= {
            f"spatial_{k}": (s * level).astype(np.float32),
            f"angular_{k}": (a / level[:, None, None, None]).astype(np.float16),
        }
    told = np.array([btf.unit, btf.name, str(len(btf.spatial)), repr(btf.relative_error)])
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, format=np.array("btf/1"), told=told, **arrays)  # type: ignore[arg-type]


def read_btf(path: str | Path) -> BTF:
    """Read what `write_btf` wrote.

    Raises
    ------
    InputError
        If the file is missing, damaged or something else.
    """
    path = Path(path)
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except (ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError("be a whole BTF", got=error, file=path) from error
    if "format" not in arrays or str(arrays["format"]) != "btf/1":
        raise InputError("be a BTF of this toolkit (btf/1)", got=sorted(arrays)[:4], file=path)
    unit, name, count, error_ = (str(word) for word in arrays["told"])
    spatial = tuple(arrays[f"spatial_{k}"].astype(np.float32) for k in range(int(count)))
    angular = tuple(arrays[f"angular_{k}"].astype(np.float32) for k in range(int(count)))
    for s, a in zip(spatial, angular, strict=True):
        check_shape("angular", a, (s.shape[1], len(arrays["wi"]), len(arrays["wo"]), None))
        check_shape("spatial", s, (int(arrays["mask"].sum()), None))
    return BTF(arrays["wi"], arrays["wo"], arrays["mask"], spatial, angular, arrays["colour"], float(error_), unit, name)
