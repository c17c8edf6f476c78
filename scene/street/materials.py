"""What everything in the street is made of, except the ground (`ground_textures`)."""

from __future__ import annotations

import numpy as np

from ..simulation import Material
from . import wall_textures as paint

# Colours are linear reflectances (Rec. 709).
_PLAIN = {
    "wood_white": (0.62, 0.61, 0.58),
    "door_green": (0.03, 0.10, 0.06),
    "door_red": (0.22, 0.03, 0.025),
    "door_brown": (0.12, 0.06, 0.03),
    "stone": (0.36, 0.35, 0.32),
    "plinth": (0.20, 0.195, 0.185),
    "gutter_zinc": (0.28, 0.29, 0.30),
    "lamp_pane": (0.55, 0.55, 0.52),
    "rubber": (0.025, 0.025, 0.026),
    "car_underbody": (0.022, 0.022, 0.022),
    "car_plate": (0.60, 0.60, 0.56),
    "skin": (0.42, 0.24, 0.16),
    "hair": (0.035, 0.022, 0.015),
    "shoe": (0.045, 0.040, 0.036),
    "trousers": (0.045, 0.060, 0.115),
    "jacket": (0.42, 0.055, 0.035),
    "steel": (0.22, 0.24, 0.23),
}
# A clear coat or glaze over a diffuse base: car paint, glass over a dark room, enamel.
_COATED = {
    "glass": (0.012, 0.013, 0.014),
    "glass_curtain": (0.22, 0.21, 0.19),
    "car_rim": (0.36, 0.37, 0.38),
    "car_headlamp": (0.50, 0.50, 0.50),
    "car_taillamp": (0.13, 0.006, 0.005),
    "paint_red": (0.36, 0.022, 0.018),
    "paint_blue": (0.030, 0.085, 0.26),
    "paint_silver": (0.40, 0.41, 0.42),
    "paint_white": (0.68, 0.68, 0.66),
    "paint_black": (0.018, 0.018, 0.020),
    "paint_green": (0.05, 0.14, 0.09),
    "sign_blue": (0.015, 0.07, 0.33),
    "sign_white": (0.65, 0.65, 0.64),
    "bin_green": (0.045, 0.10, 0.05),
}


def fixed_materials(rng: np.random.Generator) -> dict[str, Material]:
    """Return the dry and wet alike materials by name."""
    out = {name: Material("lambert", albedo) for name, albedo in _PLAIN.items()}
    out |= {name: Material("coated", albedo, eta=1.5) for name, albedo in _COATED.items()}
    walls = {
        "plaster_cream": paint.plaster((0.56, 0.50, 0.38), rng),
        "plaster_white": paint.plaster((0.64, 0.63, 0.59), rng),
        "plaster_rose": paint.plaster((0.50, 0.36, 0.29), rng),
        "plaster_sand": paint.plaster((0.50, 0.42, 0.29), rng),
        "plaster_green": paint.plaster((0.40, 0.44, 0.36), rng),
        "brick_red": paint.brick((0.27, 0.10, 0.065), rng),
        "brick_brown": paint.brick((0.19, 0.105, 0.07), rng),
        "roof": paint.roof_tiles((0.24, 0.095, 0.06), rng),
        "bark": paint.bark((0.13, 0.10, 0.075), rng),
        "leaf": paint.foliage((0.055, 0.125, 0.028), rng),
    }
    return out | {name: Material("lambert", albedo_texture=texture) for name, texture in walls.items()}
