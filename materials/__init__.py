"""How surfaces and media scatter light, and what water does to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:  # what a type checker sees of the lazy names below
    from . import (
        catalog,
        conductor,
        cook_torrance,
        dielectric,
        disney,
        fresnel,
        from_image,
        ggx,
        gloss,
        lambert,
        microfacet,
        oren_nayar,
        phase,
        phong,
        scattering,
        ward,
        water_film,
        wetness,
    )
    from .catalog import CATALOG, named
    from .scattering import Sample, Surface, albedo, evaluate, pdf, sample

__all__ = [
    "CATALOG",
    "Sample",
    "Surface",
    "albedo",
    "catalog",
    "conductor",
    "cook_torrance",
    "dielectric",
    "disney",
    "evaluate",
    "fresnel",
    "from_image",
    "ggx",
    "gloss",
    "lambert",
    "microfacet",
    "named",
    "oren_nayar",
    "pdf",
    "phase",
    "phong",
    "sample",
    "scattering",
    "ward",
    "water_film",
    "wetness",
]

__getattr__, __dir__, _ = lazy_loader.attach(
    __name__,
    submodules={
        "catalog", "conductor", "cook_torrance", "dielectric", "disney", "fresnel", "from_image", "ggx", "gloss",
        "lambert", "microfacet", "oren_nayar", "phase", "phong", "scattering", "ward", "water_film", "wetness",
    },
    submod_attrs={
        "catalog": ["CATALOG", "named"],
        "scattering": ["Sample", "Surface", "albedo", "evaluate", "pdf", "sample"],
    },
)  # fmt: skip
