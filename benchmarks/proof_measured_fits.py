"""Every model fitted to every measured BRDF: errors within the angles of the fit and beyond, in the measures of the field."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from materials.abrdf import ABRDF
from materials.brdf_errors import MEASURES, brdf_errors
from materials.fit import FitSettings, TexelFit, fit_texel
from materials.foundation.report import Cell, Table, write_report
from materials.foundation.report import Report as Page
from materials.measured.source import open_source
from materials.svbrdf import from_fits

from .data import data_folder
from .report import Report

_MODELS = ("ct", "ggx", "ward", "phong")
_BASES = ("lambert", "oren_nayar")
_FILES = (
    "cornell_brdf/cayman.brdf",
    "cornell_brdf/garnet_red.brdf",
    "cornell_brdf/krylon_blue.brdf",
    "spectralon_pbsdf/spectralon_lowres.pbsdf",
)
_FREE_DEG = 60.0


def run(report: Report) -> None:
    """Record, per glossy material, that facet models foresee angles that Phong does not; write all errors to a page."""
    rows: list[list[Cell]] = []
    for file in _FILES:
        measured = open_source(data_folder() / file).block(0, 1)
        scores: dict[tuple[str, int], float] = {}
        for model, base, lobes, constrained in product(_MODELS, _BASES, (1, 2), (True, False)):
            settings = FitSettings(model=model, base=base, lobes=lobes, constrained=constrained, free_angle_deg=_FREE_DEG)
            fit = fit_texel(measured, 0, settings)
            within, beyond = (_errors(measured, fit, settings, region) for region in _regions(measured))
            kind = "two steps" if constrained else "free"
            told = [file.split("/")[1], model, base, fit.sigma, lobes, kind]
            rows.append([*told, *within.values(), beyond["relative"], beyond["cube root"]])
            if not constrained and base == "lambert":
                scores[model, lobes] = beyond["relative"]
        if "spectralon" not in file:  # nearly matte: no model has a lobe to win by
            for model in ("ct", "ggx"):
                name = f"{file.split('/')[1]}, free, two lobes: relative error from 60 to 85°, unseen, of {model}, below Phong's"
                value, bound = scores[model, 2], scores["phong", 2]
                report.proof(name=name, value=value, bound=bound, holds=value < bound)
    columns = ("material", "model", "base", "sigma [rad]", "lobes", "fit", *MEASURES, "relative, 60 to 85°", "cube root, 60 to 85°")
    table = Table("errors", "Errors below 60°, where all was fitted, and beyond, where nothing was", columns, rows)
    write_report(report.folder / "proof" / "measured_fits", Page("Measured BRDFs and models", [], [table], {}, MEASURES))


def _regions(a: ABRDF) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    lowest = np.minimum(a.wi[:, 2], a.wo[:, 2])
    within = lowest > np.cos(np.radians(_FREE_DEG))
    return within, ~within & (lowest > np.cos(np.radians(85)))


def _errors(a: ABRDF, fit: TexelFit, settings: FitSettings, region: NDArray[np.bool_]) -> dict[str, float]:
    material = from_fits([fit], settings.model, settings.eta, settings.lobes, np.ones((1, 1), bool), a.unit, a.name, settings.base)
    use = region & a.valid[0]
    fitted = material.reflect(a.wi[use], a.wo[use], np.zeros(int(use.sum()), np.int64)) / a.wi[use, 2:]
    return brdf_errors(fitted, a.value[0, use], a.wi[use, 2], a.weight[use])
