"""Fog traced by us and by Mitsuba 3 is the same fog: even, coloured, around a lamp; thinning with height; on a grid; in bodies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import norm

from materials.foundation.files import make_folder
from materials.foundation.progress import stage
from scene.simulation import EnvironmentLight, Material, Medium, PointLight, Simulation

from .mitsuba_worlds import camera, worlds
from .peers import mitsuba
from .proof_street_mitsuba import compare, pictures, show
from .report import Report

_SAMPLES = 128
_BOX = ((-8.0, -8.0, -1.0), (8.0, 8.0, 7.0))


def subjects() -> dict[str, Simulation]:
    """Return worlds in fog, within which the camera stands, and one with fog in its bodies."""
    made = worlds()
    matte, balls = made["relief by a lamp"], made["varnish and mirror"]
    lamp = {"lamp": PointLight((0.0, 0.5, 2.0), (9.0, 8.0, 7.0))}
    clouds = np.random.default_rng(1).random((6, 5, 4)).astype(np.float32) ** 2
    glass = Material("dielectric", eta=1.33, interior=Medium(1.5, (0.98, 0.9, 0.8), 0.4))
    wax = Material("dielectric", eta=1.0, interior=Medium(2.0, (0.8, 0.9, 0.95), -0.2))
    sky = {"sky": EnvironmentLight((0.5, 0.7, 1.0)), "lamp": PointLight((1.0, -1.0, 3.0), (6.0, 6.0, 6.0))}
    return {
        "even fog around a lamp": replace(matte, lights=lamp, medium=Medium(0.15, (0.95, 0.9, 0.8), 0.6, _BOX)),
        "height fog under a sky": replace(balls, lights=sky, medium=Medium(0.3, (0.9, 0.9, 0.9), 0.5, _BOX, 1.5)),
        "milk in glass, a ball of cloud": replace(balls, materials=balls.materials | {"coated": glass, "mirror": wax}, lights=sky),
        "clouds on a grid": replace(matte, lights=sky, medium=Medium(0.4, (0.9, 0.9, 0.9), -0.3, _BOX, density=clouds)),
    }


def run(report: Report) -> None:
    """Record the agreement of every world, and write both pictures and their difference to `proof/media`."""
    mi = mitsuba("llvm_ad_rgb")
    folder = make_folder(Path(report.folder) / "proof" / "media")
    made = subjects()
    # Two numbers for each world, three channels in one of them; 1 % for all together.
    limit = float(norm.isf(0.5 * (1 - (1 - 0.01) ** (1 / (4 * len(made))))))
    for name, world in made.items():
        with stage(f"{name}, by both renderers"):
            ours, theirs = pictures(mi, world, camera(), _SAMPLES)
        a = compare(ours, theirs)
        worst = int(np.argmax(np.abs(a.z)))
        title = f"Mitsuba agrees, {name}: standard errors between the mean colours (ratio {a.ratio[worst]:.4f})"
        report.proof(name=title, value=float(abs(a.z[worst])), bound=limit, holds=bool(abs(a.z[worst]) <= limit))
        bound = a.error_by_chance + limit * a.error_error
        title = f"Mitsuba agrees, {name}: relative squared difference"
        report.proof(name=title, value=a.error, bound=bound, holds=a.error <= bound)
        show(folder / f"{name.replace(',', '').replace(' ', '_')}.png", ours.mean(axis=0), theirs.mean(axis=0))
