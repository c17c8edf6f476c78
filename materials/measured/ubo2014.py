"""Compressed BTFs of the University of Bonn (UBO2014, `*.btf`): full matrix factorisation, plain or of decorrelated channels.

Little-endian. A signature of ten characters (`!FMF12FCER` or `!DFMF08FCR`); the size and the version of a description; three
texts of 80 bytes (setup, sensor, light); pixels per mm; three scale factors; from version 2 whether the cosine is in; from 3 an
XML text; from 4 the names of the channels. Then per view its angles and those of its lights, width, height, rotations per texel
if the signature ends in R, and the factors: singular values, U (directions, view slowest), S V (texels) in floats of 2, 4 or 8
bytes.

References
----------
Weinmann, Gall and Klein (2014), Material Classification Based on Training Data Synthesized Using a BTF Database. The
decorrelations by number are those of the University of Bonn's btflib.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF, pairs
from ..directions import solid_angles, spherical
from ..foundation.errors import InputError

Floats = NDArray[np.float64]
_FMF, _DFMF = b"!FMF12FCER", b"!DFMF08FCR"
_EPS = 1e-5
_MAX_DIRECTIONS, _MAX_SIDE, _MAX_COMPONENTS = 4096, 1 << 16, 1 << 16
_RGB_FROM_YUV = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]])
_RGB_FROM_YCOCG = np.array([[1, 1, -1], [1, 0, 1], [1, -1, -1]], np.float64)
_RGB, _YUV, _PCA, _YCOCG, _LOG_Y, _LOG_Y_RATIOS, _LOG_RGB = 0, 1, 3, 4, 9, 11, 12


@dataclass(frozen=True)
class UboBTF:
    """A compressed BTF; its texels come out one block at a time.

    Attributes
    ----------
    wi, wo : (I, 3), (O, 3) float64
        Directions of light and view.
    height, width : int
        Texels.
    angular : tuple of (N, K) arrays
        U per group of channels, N = O I, or 3 O I where one factor holds all channels.
    spatial : tuple of (T, K) arrays
        S V.
    colour_model : int
        Decorrelation by number; -1 for the logarithm of plain factors, 0 for none.
    colour_matrix, colour_mean : (3, 3), (3,) float64
        Of the model 3.
    has_cosine : bool
        Whether the irradiance's cosine is in.
    name : str
    """

    wi: Floats
    wo: Floats
    height: int
    width: int
    angular: tuple[NDArray, ...]
    spatial: tuple[NDArray, ...]
    colour_model: int
    colour_matrix: Floats
    colour_mean: Floats
    has_cosine: bool
    name: str

    def block(self, first: int, last: int) -> ABRDF:
        """Return texels as an apparent BRDF, one texel axis, RGB; the unit is `relative`. Negative values are set to 0."""
        groups = [
            s[first:last].astype(np.float32) @ u.astype(np.float32).T for s, u in zip(self.spatial, self.angular, strict=True)
        ]
        num_i, num_o = len(self.wi), len(self.wo)
        if len(groups) == 1:
            values = groups[0].reshape(-1, num_o, num_i, 3)
        else:
            values = np.stack(groups, axis=-1).reshape(-1, num_o, num_i, 3)
        rgb = np.maximum(self._rgb(values), 0).swapaxes(1, 2)  # the light slowest
        wi, wo = pairs(self.wi, self.wo)
        weight = np.outer(solid_angles(self.wi), solid_angles(self.wo)).reshape(-1)
        value = np.ascontiguousarray(rgb, np.float32).reshape(len(rgb), -1, 3)
        plain, grid = not self.has_cosine, (num_i, num_o)
        valid = np.ones(value.shape[:2], bool)
        return ABRDF(wi, wo, value, valid, weight, unit="relative", normalised=plain, grid=grid, name=self.name)

    def _rgb(self, v: NDArray) -> NDArray:
        """Undo the decorrelation of channels (..., 3)."""
        model = self.colour_model
        if model == -1 or model == _LOG_RGB:
            return np.exp(v) - _EPS
        if model == _PCA:
            return v @ self.colour_matrix + self.colour_mean
        if model == _YCOCG:
            return v @ _RGB_FROM_YCOCG.T
        if model in (_LOG_Y, _LOG_Y_RATIOS):
            y = np.exp(v[..., :1])
            uv = v[..., 1:] * y if model == _LOG_Y_RATIOS else v[..., 1:]
            v = np.concatenate([y - _EPS, uv], axis=-1)
        return v @ _RGB_FROM_YUV.T if model != _RGB else v


def read_ubo2014(path: str | Path) -> UboBTF:
    """Read a `*.btf` of UBO2014.

    Raises
    ------
    InputError
        If the file is missing, truncated or of another kind, its sizes are impossible (refused before memory is taken), its
        views have different lights, or its decorrelation is unknown.
    """
    path = Path(path)
    try:
        at = _Cursor(path, path.read_bytes())
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    signature = at.raw(10)
    if signature not in (_FMF, _DFMF):
        raise InputError("be a BTF of UBO2014", got=f"the bytes {signature!r}", file=path)
    has_cosine = _description(at)
    wi, wo = _directions(at)
    width, height = (at.count("width or height", _MAX_SIDE) for _ in range(2))
    if signature.endswith(b"R"):
        at.array(np.float32, 9 * at.count("rotations", _MAX_SIDE**2, least=0))
    matrix, mean, model = np.eye(3), np.zeros(3), _RGB
    if signature == _FMF:
        version = int(at.array(np.uint8, 1)[0])
        if version > 2:
            raise InputError("have a factorisation of version 0 to 2", got=version, file=path)
        if version >= 1:
            model = -1 if at.number() else _RGB
        if version >= 2:
            at.array(np.float16, math.prod(at.count("height map", _MAX_SIDE, least=0) for _ in range(2)))
        at.number()
        groups = [_factors(at)]
    else:
        at.number()
        model = int(at.array(np.int32, 1)[0])
        mean = at.array(np.float32, 3).astype(np.float64)
        matrix = at.array(np.float32, 9).astype(np.float64).reshape(3, 3)
        if model not in (_RGB, _YUV, _PCA, _YCOCG, _LOG_Y, _LOG_Y_RATIOS, _LOG_RGB):
            raise InputError("have a known decorrelation of channels", got=f"number {model}", file=path)
        groups = [_factors(at) for _ in range(3)]
    rows = len(wi) * len(wo) * (3 if signature == _FMF else 1)
    for u, s in groups:
        if len(u) != rows or len(s) != width * height:
            got = f"{len(u)} x {len(s)}"
            raise InputError(f"have factors of {rows} directions x {width * height} texels", got=got, file=path)
    angular, spatial = tuple(u for u, _ in groups), tuple(s for _, s in groups)
    return UboBTF(wi, wo, height, width, angular, spatial, model, matrix, mean, has_cosine, path.stem)


class _Cursor:
    """Where the reading of a file is; no size is believed before it is compared with what is left."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.data, self.at = path, data, 0

    def raw(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            got = f"{len(self.data) - self.at} bytes where {size} should be"
            raise InputError("be whole", got=got, file=self.path, remedy="Copy the file again.")
        self.at += size
        return self.data[self.at - size : self.at]

    def array(self, kind: type, count: int) -> NDArray:
        dtype = np.dtype(kind).newbyteorder("<")
        return np.frombuffer(self.raw(dtype.itemsize * count), dtype)

    def number(self) -> int:
        return int(self.array(np.uint32, 1)[0])

    def count(self, key: str, most: int, least: int = 1) -> int:
        value = self.number()
        if not least <= value <= most:
            raise InputError(f"lie in [{least}, {most}]", got=value, file=self.path, key=key)
        return value


def _description(at: _Cursor) -> bool:
    """Skip the description; return whether the cosine is in."""
    start, size, version = at.at, at.number(), at.number()
    at.raw(3 * 80 + 4 + 12)
    has_cosine = bool(at.number()) if version > 1 else False
    if version > 2:
        at.raw(at.number())
    if version > 3:
        channels = at.count("channels", 64)
        if channels != 3:
            raise InputError("have three channels", got=channels, file=at.path)
        for _ in range(channels):
            at.raw(at.number())
    if at.at != start + size:
        raise InputError(f"describe itself in {size} bytes", got=at.at - start, file=at.path)
    return has_cosine


def _directions(at: _Cursor) -> tuple[Floats, Floats]:
    views, lights = [], None
    for _ in range(at.count("views", _MAX_DIRECTIONS)):
        views.append(at.array(np.float32, 2).astype(np.float64))
        angles = at.array(np.float32, 2 * at.count("lights", _MAX_DIRECTIONS)).reshape(-1, 2).astype(np.float64)
        if lights is not None and not np.array_equal(angles, lights):
            raise InputError("have the same lights for all views", file=at.path)
        lights = angles
    assert lights is not None
    found = []
    for key, angles in (("lights", lights), ("views", np.array(views))):
        if not np.isfinite(angles).all() or (angles[:, 0] < 0).any() or (angles[:, 0] > math.pi / 2 + 1e-5).any():
            raise InputError("lie above the horizon", got="other angles", file=at.path, key=key)
        found.append(spherical(np.minimum(angles[:, 0], math.pi / 2), angles[:, 1]))
    return found[0], found[1]


def _factors(at: _Cursor) -> tuple[NDArray, NDArray]:
    """Return U (N, K) and S V (T, K)."""
    size = int(at.array(np.uint8, 1)[0])
    if size not in (2, 4, 8):
        raise InputError("store floats of 2, 4 or 8 bytes", got=size, file=at.path)
    kind = {2: np.float16, 4: np.float32, 8: np.float64}[size]
    components, rows, columns = at.count("components", _MAX_COMPONENTS), at.number(), at.number()
    at.array(kind, components)
    factors = (
        at.array(kind, rows * components).reshape(rows, components),
        at.array(kind, columns * components).reshape(columns, components),
    )
    if not all(np.isfinite(f).all() for f in factors):
        raise InputError("be finite", got="NaN or infinity", file=at.path, key="a factor")
    return factors
