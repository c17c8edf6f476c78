"""How surfaces and media scatter light, and what water does to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:  # what a type checker sees of the lazy names below
    from . import catalog, dielectric, fresnel, from_image, ggx, lambert, microfacet, phase, scattering, water_film, wetness
    from .catalog import CATALOG, named
    from .scattering import Sample, Surface, albedo, evaluate, pdf, sample

__all__ = [
    "CATALOG",
    "Sample",
    "Surface",
    "albedo",
    "catalog",
    "dielectric",
    "evaluate",
    "fresnel",
    "from_image",
    "ggx",
    "lambert",
    "microfacet",
    "named",
    "pdf",
    "phase",
    "sample",
    "scattering",
    "water_film",
    "wetness",
]

__getattr__, __dir__, _ = lazy_loader.attach(
    __name__,
    submodules={
        "catalog", "dielectric", "fresnel", "from_image", "ggx", "lambert", "microfacet", "phase", "scattering", "water_film",
        "wetness",
    },
    submod_attrs={
        "catalog": ["CATALOG", "named"],
        "scattering": ["Sample", "Surface", "albedo", "evaluate", "pdf", "sample"],
    },
)  # fmt: skip
