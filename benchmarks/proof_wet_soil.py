"""Models of wet ground against spectra of real soil: darkening at levels of moisture that no fit saw, and the hue."""

from __future__ import annotations

import numpy as np

from materials.foundation.report import write_report
from materials.measured.measurement_file import read_measurement
from materials.wetness_fit import MODELS, full_factor, held_out
from materials.wetness_report import wetness_report

from .data import data_folder
from .report import Report
from .soil import write_soil_measurement


def run(report: Report) -> None:
    """Record held-out errors beside what needs no physics, and which colours a soaked soil keeps."""
    data = data_folder() / "soil_wet_dry"
    folder = report.folder / "proof" / "wet_soil"
    measured = read_measurement(write_soil_measurement(data / "karly_soilmoisture_dataset.csv", folder))
    assert measured.conditions is not None
    write_report(folder, wetness_report(measured.conditions, "soil", folder / "pictures"))
    scores = {h.name: h for h in held_out(measured.conditions.condition, measured.conditions.value)}
    best = min(scores[name].rms for name in ("mean", "linear", "quadratic"))
    best_wettest = min(scores[name].wettest for name in ("mean", "linear", "quadratic"))
    for model in MODELS:
        h = scores[model]
        report.proof(
            name=f"wet soil, {model}: held-out rms, below the best polynomial's", value=h.rms, bound=best, holds=h.rms < best
        )
        name = f"wet soil, {model}: rms at the wettest level, below the best polynomial's"
        report.proof(name=name, value=h.wettest, bound=best_wettest, holds=h.wettest < best_wettest)
    dry, wet = np.loadtxt(data / "prosail_soil_reflectance.txt").T
    at = [nm - 400 for nm in (450, 550, 650, 900)]
    # Which colours water takes less of: the brighter ones, in the soil as in the two models that know the albedo.
    measured_shift = float((wet / dry)[at][3] / (wet / dry)[at][1])
    for model in ("lekner_dorf", "twomey"):
        left = full_factor(model, dry[at], 1.5)
        shift = float(left[3] / left[1])
        name = f"soaked soil, {model}: what is left at 900 nm over 550 nm, above 1 as measured ({measured_shift:.2f})"
        report.proof(name=name, value=shift, bound=1.0, holds=shift > 1 and measured_shift > 1)
