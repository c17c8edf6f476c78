"""A closed film of water on a part of a surface: as smooth as water lies."""

from __future__ import annotations

from typing import ClassVar

from .surface_wetness import SurfaceWetness


class WaterFilm(SurfaceWetness):
    id = "water_film"
    title = "a film of water"
    says = "one place of a surface is darker under all lamps and mirrors them sharply"
    taken_for = ("surface_wetness", "specular_lobe", "albedo_error")
    decides = "look for the image of a small lamp: a film shows it, wet grain blurs it"
    widths: ClassVar[tuple[float, float, float]] = (0.05, 0.004, 0.08)
