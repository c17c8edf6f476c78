"""Materials as the kernels take them: a row of numbers and a row of texture slots each, all textures in one array."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from materials import conductor, cook_torrance, disney, ggx, oren_nayar, phong, ward
from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.kernels import kinds
from materials.kernels.tabulated import TableArrays
from materials.scattering import Surface
from materials.tabulated import compile_tables
from scene.simulation import Film, Material

from .kernels import arrays as a

_KINDS = {
    "lambert": kinds.LAMBERT,
    "oren_nayar": kinds.OREN_NAYAR,
    "ggx": kinds.GGX,
    "cook_torrance": kinds.COOK_TORRANCE,
    "ward": kinds.WARD,
    "phong": kinds.PHONG,
    "conductor": kinds.CONDUCTOR,
    "disney": kinds.DISNEY,
    "coated": kinds.COATED,
    "mirror": kinds.MIRROR,
    "dielectric": kinds.DIELECTRIC,
    "rough_dielectric": kinds.ROUGH_DIELECTRIC,
    "emission": kinds.EMISSION,
    "measured": kinds.TABULATED,
}
_TEXTURES = {
    a.ALBEDO_TEXTURE: "albedo_texture",
    a.ALPHA_TEXTURE: "alpha_texture",
    a.NORMAL_TEXTURE: "normal_texture",
    a.OPACITY_TEXTURE: "opacity_texture",
    a.TINT_TEXTURE: "tint_texture",
    a.EMISSION_TEXTURE: "emission_texture",
    a.BUMP_TEXTURE: "bump_texture",
}
_RANGES = {
    "albedo": "[0, 1]",
    "albedo_scale": "[0, inf)",
    "eta": "(0, inf)",
    "alpha": "[0, inf)",
    "specular_scale": "[0, inf)",
    "emission": "[0, inf)",
    "tangent_angle": "(-inf, inf)",
    "bump_scale": "(-inf, inf)",
}
# Beyond these the series of bounces inside a film and the tables of its rough surface have no meaning.
_FILM_RANGES = {"coverage": "[0, 1]", "thickness": "[0, inf)", "eta": "[1, 3]", "alpha": "[0, 1]", "sigma_a": "[0, inf)"}
# What water can lie on: glass, mirrors and lamps have no diffuse base for a film to darken.
_FILM_BASES = ("lambert", "ggx", "coated")


def compile_materials(materials: dict[str, Material]) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Return kinds, values and texture slots (a row per material), texels and texture_info of `WorldArrays`.

    Raises
    ------
    InputError
        If a value is out of its range or not finite; the key names the material.
    """
    kind_of = np.zeros(len(materials), np.int64)
    values = np.zeros((len(materials), a.NUM_VALUES), np.float64)
    slots = np.full((len(materials), a.NUM_TEXTURES), -1, np.int32)
    store = _TextureStore()
    for i, (name, m) in enumerate(materials.items()):
        if m.model not in _KINDS:
            raise InputError(f"be one of {', '.join(_KINDS)}", got=m.model, key=f"materials.{name}.model")
        for key, interval in _RANGES.items():
            check_range(f"materials.{name}.{key}", getattr(m, key), interval)
        kind_of[i] = _KINDS[m.model]
        try:
            alpha_u, alpha_v, more = _reflectance(m)
        except InputError as error:
            raise InputError(error.must, got=error.got, key=f"materials.{name}.{error.key}", remedy=error.remedy) from error
        base = m.albedo if m.albedo_texture is None else (1.0, 1.0, 1.0)
        values[i, a.ALBEDO : a.ALBEDO + 3] = np.asarray(base) * m.albedo_scale
        values[i, a.SPECULAR_SCALE], values[i, a.ETA] = m.specular_scale, m.eta
        values[i, a.ALPHA_U], values[i, a.ALPHA_V] = alpha_u, alpha_v
        values[i, a.TANGENT_COS], values[i, a.TANGENT_SIN] = np.cos(m.tangent_angle), np.sin(m.tangent_angle)
        values[i, a.EMISSION : a.EMISSION + 3] = m.emission
        values[i, a.ONE_SIDED], values[i, a.BUMP_SCALE] = m.one_sided, m.bump_scale
        values[i, a.EMISSION_MEAN] = _mean_emission(m, f"materials.{name}.emission_texture")
        values[i, a.MORE : a.MORE + kinds.NUM_MORE] = more
        if m.model == "measured":
            values[i, a.MORE + kinds.TABLE] = sum(other.model == "measured" for other in list(materials.values())[:i])
        for slot, key in _TEXTURES.items():
            slots[i, slot] = store.add(getattr(m, key), f"materials.{name}.{key}")
        if m.film is not None:
            if m.model not in _FILM_BASES:
                raise InputError(
                    f"be None unless the model is one of {', '.join(_FILM_BASES)}", got=m.model, key=f"materials.{name}.film"
                )
            for key, interval in _FILM_RANGES.items():
                check_range(f"materials.{name}.film.{key}", getattr(m.film, key), interval)
            _film(m.film, values[i], slots[i], store, f"materials.{name}.film")
        if not np.all(np.isfinite(values[i])):
            raise InputError("be finite", got="NaN or infinity", key=f"materials.{name}")
    return kind_of, values, slots, *store.arrays()


def compile_measured(materials: dict[str, Material]) -> TableArrays | None:
    """Return the tables of all measured and fitted materials, in the order of their names; None where there are none.

    Raises
    ------
    InputError
        If one has no measurement, or one with holes; the key names the material.
    """
    found = {name: m.measured for name, m in materials.items() if m.model == "measured"}
    for name, measured in found.items():
        key = f"materials.{name}.measured"
        if measured is None:
            raise InputError("be given", key=key, remedy="Give a materials.btf.BTF or a materials.svbrdf.SVBRDF.")
        if not measured.mask.all():
            raise InputError("be known everywhere", got="a mask with holes", key=key)
    return compile_tables([m for m in found.values() if m is not None]) if found else None


def _mean_emission(m: Material, key: str) -> float:
    emission = np.asarray(m.emission, np.float64)
    if m.emission_texture is None:
        return float(emission.mean())
    check_range(key, m.emission_texture, "[0, inf)")
    texture = np.asarray(m.emission_texture, np.float64)
    means = np.full(3, texture.mean()) if texture.ndim == 2 else texture.mean(axis=(0, 1))[:3]
    return float((emission * means).mean())


def _reflectance(m: Material) -> tuple[float, float, tuple[float, ...]]:
    """Return the widths, to be multiplied by a texture where there is one, and `Surface.more`.

    A surface is made as a user of `materials` would, so that its ranges are checked there.
    """
    alpha_u = m.alpha if m.alpha_u is None else m.alpha_u
    alpha_v = m.alpha if m.alpha_v is None else m.alpha_v
    if m.model == "coated":
        # A coat is smooth unless a texture says otherwise; `Material.alpha` is the width of other models.
        alpha_u = alpha_v = 0.0
    surface = _glossy(m, alpha_u, alpha_v)
    if m.model == "oren_nayar":
        surface = oren_nayar.surface((0.0, 0.0, 0.0), m.sigma)
    elif m.model == "conductor":
        if m.metal is None:
            raise InputError("be given as (eta, k)", key="metal", remedy="See materials.conductor.METALS for some.")
        surface = conductor.surface(*m.metal, alpha_u, alpha_v=alpha_v, specular_scale=m.specular_scale)
    elif m.model == "disney":
        p = m.principled or disney.Principled()
        surface = disney.surface((0.0, 0.0, 0.0), p)
        if m.alpha_texture is not None:
            return 1 / p.aspect, p.aspect, surface.more
        return surface.alpha_u, surface.alpha_v, surface.more
    if m.alpha_texture is not None:
        alpha_u = 1.0 if m.alpha_u is None else m.alpha_u
        alpha_v = 1.0 if m.alpha_v is None else m.alpha_v
    return alpha_u, alpha_v, kinds.PLAIN if surface is None else surface.more


def _glossy(m: Material, alpha_u: float, alpha_v: float) -> Surface | None:
    black, lobe = (0.0, 0.0, 0.0), {"specular_scale": m.specular_scale, "tint": m.tint, "tail": m.tail}
    if m.model == "ggx":
        # Widths of 0 and above 1 are let pass: the first is a limit, the second a fit's affair.
        check_range("alpha_u", alpha_u, "[0, inf)")
        check_range("alpha_v", alpha_v, "[0, inf)")
        return ggx.surface(black, 1.0, **lobe)
    if m.model == "cook_torrance":
        return cook_torrance.surface(black, alpha_u, alpha_v=alpha_v, eta=m.eta, **lobe)
    if m.model == "ward":
        return ward.surface(black, alpha_u, alpha_v=alpha_v, normalisation=m.normalisation, **lobe)
    if m.model == "phong":
        if alpha_u != alpha_v:
            raise InputError("equal alpha_u", got=alpha_v, key="alpha_v", remedy="Phong's lobe is round: give `alpha` alone.")
        return phong.surface(black, alpha_u, **lobe)
    return None


def _film(film: Film, values: NDArray, slots: NDArray, store: _TextureStore, key: str) -> None:
    for kind, column, slot in (
        ("coverage", a.FILM_COVERAGE, a.COVERAGE_TEXTURE),
        ("thickness", a.FILM_THICKNESS, a.THICKNESS_TEXTURE),
    ):
        given = getattr(film, kind)
        is_texture = isinstance(given, np.ndarray)
        values[column] = 1.0 if is_texture else given
        slots[slot] = store.add(given, f"{key}.{kind}") if is_texture else -1
    values[a.FILM_ETA], values[a.FILM_ALPHA], values[a.FILM_LEVEL] = film.eta, film.alpha, film.level
    values[a.FILM_SIGMA_A : a.FILM_SIGMA_A + 3] = film.sigma_a


class _TextureStore:
    """Textures one after the other; the same array is stored once."""

    def __init__(self) -> None:
        self._textures: list[NDArray] = []
        self._index: dict[int, int] = {}

    def add(self, texture: NDArray | None, key: str) -> int:
        if texture is None:
            return -1
        if id(texture) not in self._index:
            if not np.all(np.isfinite(texture)):
                raise InputError("be finite", got="NaN or infinity", key=key)
            self._index[id(texture)] = len(self._textures)
            self._textures.append(texture)
        return self._index[id(texture)]

    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        if not self._textures:
            return np.zeros(1, np.float32), np.zeros((1, 4), np.int64)
        sizes = [t.size for t in self._textures]
        offsets = np.cumsum([0, *sizes[:-1]])
        info = [(o, t.shape[1], t.shape[0], 1 if t.ndim == 2 else t.shape[2]) for o, t in zip(offsets, self._textures, strict=True)]
        return np.concatenate([t.astype(np.float32).ravel() for t in self._textures]), np.array(info, np.int64)
