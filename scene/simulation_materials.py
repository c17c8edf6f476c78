"""Materials of simulation/1: every model that the tracer has, each with the keys that mean something to it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np

from materials.conductor import METALS
from materials.disney import Principled
from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.gloss import Tail

from .simulation import RGB, Film, Material, Medium, Texture
from .simulation_json import FilmJson, InteriorJson, MaterialJson, MetalJson, PrincipledJson, TailJson
from .simulation_textures import TextureReader, TextureWriter

_RELIEF = ("normal_texture", "bump_texture", "bump_scale")
_ANY = (*_RELIEF, "opacity_texture", "one_sided")
_COLOUR = ("albedo", "albedo_texture", "albedo_scale")
_WIDTHS = ("alpha", "alpha_u", "alpha_v", "alpha_texture", "tangent_angle")
_LOBES = (*_COLOUR, "specular_scale", "tint", "tint_texture", "tail")
# What each model may say besides `model` and `free`; what else is given would be ignored, and is refused.
KEYS: dict[str, tuple[str, ...]] = {
    "lambert": (*_COLOUR, "film", *_ANY),
    "oren_nayar": (*_COLOUR, "sigma", *_ANY),
    "ggx": (*_LOBES, *_WIDTHS, "eta", "film", *_ANY),
    "cook_torrance": (*_LOBES, *_WIDTHS, "eta", *_ANY),
    "ward": (*_LOBES, *_WIDTHS, "normalisation", *_ANY),
    "phong": (*_LOBES, "alpha", "alpha_texture", *_ANY),
    "conductor": ("metal", "specular_scale", *_WIDTHS, *_ANY),
    "disney": (*_COLOUR, "principled", "alpha_texture", "tangent_angle", *_ANY),
    "coated": (*_COLOUR, "eta", "alpha_texture", "film", *_ANY),
    "mirror": (*_COLOUR, *_ANY),
    "dielectric": ("eta", "interior", *_RELIEF, "opacity_texture"),
    "rough_dielectric": ("eta", "interior", *_WIDTHS, *_RELIEF, "opacity_texture"),
    "emission": ("emission", "emission_texture", "opacity_texture", "one_sided"),
}
# Of these a width must be given; a conductor without one is a mirror.
_NEED_WIDTH = ("ggx", "cook_torrance", "ward", "phong", "rough_dielectric")
_FREE = ("albedo_scale", "eta", "alpha", "alpha_u", "alpha_v", "specular_scale", "sigma")
_RANGES = {
    "albedo": "[0, 1]",
    "albedo_scale": "[0, inf)",
    "eta": "(0, inf)",
    "alpha": "[0, inf)",
    "alpha_u": "[0, inf)",
    "alpha_v": "[0, inf)",
    "specular_scale": "[0, inf)",
    "sigma": "[0, 1.5708]",
    "tint": "[0, 1]",
    "tangent_angle": "(-inf, inf)",
    "bump_scale": "(-inf, inf)",
    "emission": "[0, inf)",
}
_TEXTURES = {
    "albedo_texture": True,
    "tint_texture": True,
    "emission_texture": True,
    "alpha_texture": False,
    "normal_texture": False,
    "bump_texture": False,
    "opacity_texture": False,
}
# Keys whose value a Material takes as it stands.
_PLAIN = ("sigma", "tint", "normalisation", "tangent_angle", "bump_scale", "one_sided", "emission", "specular_scale", "eta")


def free_names(model: str) -> tuple[str, ...]:
    """Return the parameters of a model that a material may name as `free`."""
    return tuple(name for name in _FREE if name in KEYS[model])


def material_of(m: MaterialJson, key: str, textures: TextureReader) -> Material:
    """Return the material that a JSON entry describes.

    Raises
    ------
    InputError
        If a key means nothing to the model, is missing, or its value is out of range; as `TextureReader`. Names the key.
    """
    given = {name: value for name in _all_keys() if (value := getattr(m, name)) is not None}
    for name, value in given.items():
        if name not in KEYS[m.model]:
            remedy = f"It belongs to {', '.join(model for model, keys in KEYS.items() if name in keys)}."
            got = value if isinstance(value, int | float | str) else None
            raise InputError(f"be left out of {m.model}", got=got, key=f"{key}.{name}", remedy=remedy)
        if name in _RANGES:
            check_range(f"{key}.{name}", value, _RANGES[name])
    if "albedo" in given and "albedo_texture" in given:
        raise InputError("be left out beside albedo_texture", got=given["albedo"], key=f"{key}.albedo")
    for name in m.free:
        if name not in free_names(m.model):
            raise InputError(f"name one of {', '.join(free_names(m.model)) or 'nothing'}", got=name, key=f"{key}.free")
    out: dict[str, Any] = {name: given[name] for name in _PLAIN if name in given}
    out |= {"model": m.model, "free": tuple(m.free), "albedo_scale": m.albedo_scale if m.albedo_scale is not None else 1.0}
    out |= {"albedo": m.albedo or (0.5, 0.5, 0.5)} | _widths(m, key)
    for name, is_colour in _TEXTURES.items():
        read = textures.colour if is_colour else textures.numbers
        out[name] = read(getattr(m, name), f"{key}.{name}")
    if out["albedo_texture"] is not None:
        check_range(f"{key}.albedo_texture", out["albedo_texture"], "[0, inf)")
    if m.model == "emission" and m.emission is None:
        raise InputError("be given", key=f"{key}.emission")
    if m.model == "conductor":
        out["metal"] = _metal(m, key)
    if m.tail is not None:
        out["tail"] = Tail(m.tail.scale, m.tail.alpha, m.tail.alpha_v)
    if m.principled is not None:
        try:
            out["principled"] = Principled(**msgspec.structs.asdict(m.principled))
        except InputError as error:
            raise error.at(key=f"{key}.principled") if error.key is None else _deeper(error, f"{key}.principled") from error
    if m.film is not None:
        out["film"] = _film(m.film, f"{key}.film", textures)
    if m.interior is not None:
        check_range(f"{key}.interior.sigma_t", m.interior.sigma_t, "[0, inf)")
        check_range(f"{key}.interior.albedo", m.interior.albedo, "[0, 1]")
        check_range(f"{key}.interior.g", m.interior.g, "(-1, 1)")
        out["interior"] = Medium(m.interior.sigma_t, m.interior.albedo, m.interior.g)
    return Material(**out)


def material_json(m: Material, name: str, textures: TextureWriter) -> MaterialJson:
    """Return a material as the format has it, its textures written.

    Raises
    ------
    InputError
        If its interior has bounds, is not even, or scatters as droplets do.
    """
    keys = KEYS[m.model]
    out: dict[str, Any] = {"model": m.model, "free": list(m.free)}
    plain = Material(m.model)
    for key in (*_PLAIN, "albedo_scale"):
        if key in keys and getattr(m, key) != getattr(plain, key):
            out[key] = _number(getattr(m, key))
    if "albedo" in keys and m.albedo_texture is None:
        out["albedo"] = _number(m.albedo)
    if "eta" in keys:
        out["eta"] = float(m.eta)
    if m.model == "emission":
        out["emission"] = _number(m.emission)
    if "alpha" in keys and m.alpha_texture is None:
        out["alpha"] = float(m.alpha)
    for key in ("alpha_u", "alpha_v"):
        if key in keys and getattr(m, key) is not None:
            out[key] = float(getattr(m, key))
    for key, is_colour in _TEXTURES.items():
        if key in keys:
            label = name if key == "albedo_texture" else f"{name}_{key.removesuffix('_texture')}"
            out[key] = (textures.colour if is_colour else textures.numbers)(getattr(m, key), label)
    if m.model == "conductor" and m.metal is not None:
        known = next((metal for metal, values in METALS.items() if values == m.metal), None)
        out["metal"] = known or MetalJson(_number(m.metal[0]), _number(m.metal[1]))
    if "tail" in keys and m.tail is not None:
        out["tail"] = TailJson(*m.tail)
    if "principled" in keys and m.principled is not None:
        out["principled"] = PrincipledJson(**asdict(m.principled))
    if m.film is not None:
        out["film"] = _film_json(m.film, name, textures)
    if m.interior is not None:
        out["interior"] = _interior_json(m.interior, name)
    return MaterialJson(**out)


def _all_keys() -> tuple[str, ...]:
    return tuple(name for name in MaterialJson.__struct_fields__ if name not in ("model", "free"))


def _widths(m: MaterialJson, key: str) -> dict[str, float | None]:
    if (m.alpha_u is None) != (m.alpha_v is None):
        raise InputError("be given together", key=f"{key}.alpha_u and {key}.alpha_v")
    if m.model in _NEED_WIDTH and m.alpha is None and m.alpha_u is None and m.alpha_texture is None:
        raise InputError("be given", key=f"{key}.alpha")
    if m.alpha is not None and m.alpha_texture is not None:
        raise InputError("be left out beside alpha_texture", got=m.alpha, key=f"{key}.alpha")
    alpha = m.alpha
    if alpha is None and m.alpha_u is not None and m.alpha_v is not None:
        alpha = (m.alpha_u * m.alpha_v) ** 0.5
    if alpha is None:
        alpha = 0.0 if m.model == "conductor" else Material().alpha
    return {"alpha": alpha, "alpha_u": m.alpha_u, "alpha_v": m.alpha_v}


def _metal(m: MaterialJson, key: str) -> tuple[RGB, RGB]:
    if m.metal is None:
        raise InputError("be given", key=f"{key}.metal", remedy=f"Name one of {', '.join(METALS)}, or give eta and k.")
    if isinstance(m.metal, str):
        if m.metal not in METALS:
            raise InputError(f"be one of {', '.join(METALS)}, or eta and k", got=m.metal, key=f"{key}.metal")
        return METALS[m.metal]
    check_range(f"{key}.metal.eta", m.metal.eta, "(0, inf)")
    check_range(f"{key}.metal.k", m.metal.k, "[0, inf)")
    return m.metal.eta, m.metal.k


def _film(f: FilmJson, key: str, textures: TextureReader) -> Film:
    def field(value: float | str, name: str) -> float | Texture:
        if not isinstance(value, str):
            return value
        texture = textures.numbers(value, f"{key}.{name}")
        assert texture is not None
        return texture

    for name, interval in (("eta", "[1, 3]"), ("alpha", "[0, 1]"), ("sigma_a", "[0, inf)")):
        check_range(f"{key}.{name}", getattr(f, name), interval)
    coverage, thickness = field(f.coverage, "coverage"), field(f.thickness, "thickness")
    check_range(f"{key}.coverage", coverage, "[0, 1]")
    check_range(f"{key}.thickness", thickness, "[0, inf)")
    return Film(coverage, thickness, f.eta, f.sigma_a, f.alpha, f.level)


def _film_json(f: Film, name: str, textures: TextureWriter) -> FilmJson:
    def field(value: float | Texture, what: str) -> float | str:
        if not isinstance(value, np.ndarray):
            return float(value)
        written = textures.numbers(value, f"{name}_{what}")
        assert written is not None
        return written

    coverage, thickness = field(f.coverage, "coverage"), field(f.thickness, "thickness")
    return FilmJson(coverage, thickness, float(f.eta), _number(f.sigma_a), float(f.alpha), bool(f.level))


def _interior_json(m: Medium, name: str) -> InteriorJson:
    uneven = m.bounds is not None or m.scale_height is not None or m.density is not None
    if uneven or m.droplet_diameter_um is not None:
        got = "droplets" if not uneven else "bounds, a scale height or a density"
        raise InputError("be even and have a g", got=got, key=f"materials.{name}.interior")
    return InteriorJson(float(m.sigma_t), _number(m.albedo), float(m.g))


def _number(value: Any) -> Any:
    """Return Python's numbers for NumPy's, tuples of three for colours."""
    if isinstance(value, str | bool):
        return value
    return float(value) if np.ndim(value) == 0 else tuple(float(v) for v in value)


def _deeper(error: InputError, prefix: str) -> InputError:
    return InputError(error.must, got=error.got, key=f"{prefix}.{error.key}", remedy=error.remedy)
