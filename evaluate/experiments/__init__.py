"""The thesis's flow experiments, and those it could not do, one recipe a file: `meniscus experiment NAME -o OUT`.

Each recipe is a function `run(settings, folder) -> Report`; its settings are in `settings.py`, which loads no numerics.
"""

from __future__ import annotations

from dataclasses import dataclass

from .settings import FittedMaterialsSettings, ReflectanceFieldsSettings, TrueWetSettings, WetterSettings


@dataclass(frozen=True)
class Recipe:
    """Where an experiment is, what can be chosen about it, and what it asks."""

    module: str
    settings: type
    question: str


RECIPES: dict[str, Recipe] = {
    "reflectance-fields": Recipe(
        "reflectance_fields",
        ReflectanceFieldsSettings,
        "Do flow algorithms see measured reflectance fields as they see the real objects, and textures too (chapter 4)?",
    ),
    "fitted-materials": Recipe(
        "fitted_materials",
        FittedMaterialsSettings,
        "Do flow algorithms err on fitted reflectance models as on the BTFs that they were fitted to (chapter 5 of the thesis)?",
    ),
    "true-wet": Recipe(
        "true_wet",
        TrueWetSettings,
        "Is a flow algorithm's error on the augmented street that on the truly wet one, more than with simpler ways to wet?",
    ),
    "wetter": Recipe(
        "wetter",
        WetterSettings,
        "How much worse do flow algorithms get as the drive gets wetter, mistier, and drops lie on the windshield, and where?",
    ),
}
