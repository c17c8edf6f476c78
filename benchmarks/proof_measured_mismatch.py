"""The diagnosis on real measurements: what a simple belief leaves out of paints, wet soil and photographs, on what no fit saw.

Every trial is listed, those that end as not explained among them; `proof/measured_mismatch/trials.md` has the table and
each trial's folder its report. Bounds are what is claimed: of paints and soil held-out chi-square halved at least, of photographs
normals that come nearer to measured ones, which no fit is given. Cayman's lobe is known not to be GGX's: two paints of three.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evaluate.diagnose_measurement import MODELS
from evaluate.effects import catalogue
from evaluate.mismatch.measured.diagnose import MeasuredDiagnosis, diagnose_file
from evaluate.mismatch.measured.outputs import write_measured_diagnosis
from evaluate.mismatch.measured.photographs import diagnose_photographs, stereo_of
from materials.foundation.files import make_folder, replacing, write_json
from materials.foundation.report import Cell, Table
from materials.measured.measurement_file import read_measurement
from materials.measured.measurement_writer import write_measurement
from materials.measured.photographs import read_photographs
from materials.measured.source import read_brdf

from .data import data_folder
from .report import Report
from .soil import write_soil_measurement

_DRIEST = 0.1
_PAINTS = ("cayman", "garnet_red", "krylon_blue")
_COLUMNS = (
    "measured", "believed", "verdict", "named", "not told from", "chi-square before", "chi-square after", "rmse before",
    "rmse after", "normals before [deg]", "normals after [deg]", "s",
)  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """A measurement with what was believed of it, and what came out."""

    name: str
    believed: str
    diagnosis: MeasuredDiagnosis
    seconds: float

    def row(self) -> list[Cell]:
        """Return the cells of the table of trials."""
        d, p = self.diagnosis, self.diagnosis.proof
        named = ", ".join(f.id for f in d.findings)
        alike = ", ".join(a for f in d.findings for a in f.ambiguous_with)
        normals = d.extra.get("held_out", {})
        angles = (normals.get("normal_error_deg_before"), normals.get("normal_error_deg_after"))
        figures = (p.chi2_before, p.chi2_after, p.rmse_before, p.rmse_after, *angles, self.seconds)
        return [self.name, self.believed, d.verdict, named, alike, *figures]


def run(report: Report) -> None:
    """Diagnose all measurements; tables, reports and pictures go to `proof/measured_mismatch`."""
    folder = make_folder(report.folder / "proof" / "measured_mismatch")
    trials = [*paints(folder), *soil(folder), *photographs(folder)]
    table = Table(
        "trials", "Every trial", _COLUMNS, [t.row() for t in trials], "Chi-square is per value; each block was left out of a fit."
    )
    with replacing(folder / "trials.md") as temporary:
        temporary.write_text(table.markdown(), encoding="utf-8")
    for t in trials:
        p = t.diagnosis.proof
        named = " and ".join(f.id for f in t.diagnosis.findings)
        if named and t.believed != "matte, direct light":
            name = f"{t.name} believed {t.believed}: {named}; held-out chi-square, below half of that before"
            report.proof(name=name, value=p.chi2_after, bound=0.5 * p.chi2_before, holds=p.chi2_after < 0.5 * p.chi2_before)
        normals = t.diagnosis.extra.get("held_out")
        if normals is not None:
            before, after = normals["normal_error_deg_before"], normals["normal_error_deg_after"]
            name = f"{t.name} with {named}: mean error of normals [deg], below that as believed, fitted robustly"
            report.proof(name=name, value=after, bound=before, holds=bool(named) and after < before)
    found = {(t.name, t.believed): {f.id for f in t.diagnosis.findings} for t in trials}
    glossy = sum("specular_lobe" in found[paint, "lambert"] for paint in _PAINTS)
    report.proof(name="paints believed matte in which gloss is named, of 3", value=glossy, bound=2, holds=glossy >= 2)
    wet = found["soil", "dry"] & {"surface_wetness", "water_film"}
    report.proof(name="wet soil believed dry: wetness is named", value=len(wet), bound=1, holds=len(wet) == 1)
    dry = next(t for t in trials if t.name == "soil at one level")
    calm = not dry.diagnosis.findings
    report.proof(
        name=f"dry soil believed dry: no effect is named ({dry.diagnosis.verdict})", value=float(calm), bound=1, holds=calm
    )


def paints(folder: Path, names: tuple[str, ...] = _PAINTS, beliefs: tuple[str, ...] = ("lambert", "ggx")) -> list[Trial]:
    """Diagnose the paints of Cornell, believed matte, and believed to have one lobe."""
    out = []
    for name in names:
        samples = read_brdf(data_folder() / "cornell_brdf" / f"{name}.brdf")
        assert samples is not None
        for believed in beliefs:
            out.append(
                _trial(
                    name,
                    believed,
                    write_measurement(folder / "measurements" / f"{name}_{believed}", samples, MODELS[believed]),
                    folder,
                )
            )
    return out


def photographs(folder: Path) -> list[Trial]:
    """Diagnose DiLiGenT's ball and bear, whose first 20 images are damaged, believed matte and lit by the lamp alone."""
    out = []
    for name, images in (("ball", None), ("bear", slice(20, None))):
        path = data_folder() / f"diligent_{name}"
        start = time.perf_counter()
        d = diagnose_photographs(stereo_of(read_photographs(path, images), path), catalogue(), say=lambda _: None)
        seconds = time.perf_counter() - start
        write_measured_diagnosis(folder / name, d)
        out.append(Trial(name, "matte, direct light", d, seconds))
    return out


def soil(folder: Path, step: int = 1) -> list[Trial]:
    """Diagnose spectra of soil of all moistures, believed as dry as its driest tenth; and of that tenth alone."""
    wet = write_soil_measurement(
        data_folder() / "soil_wet_dry" / "karly_soilmoisture_dataset.csv", folder / "measurements" / "soil", step
    )
    model = believe_dry(wet)
    measured = read_measurement(wet).conditions
    assert measured is not None
    driest = measured.condition <= np.quantile(measured.condition, _DRIEST)
    # The driest records in an order that says nothing of water: theirs is what they came in.
    k = int(driest.sum())
    rows = np.flatnonzero(driest)
    table = {
        "condition": np.repeat(np.arange(k, dtype=np.float64), measured.value.shape[1]),
        "wavelength": np.tile(measured.wavelength_nm, k),
        "value": measured.value[np.random.default_rng(0).permutation(rows)].ravel(),
    }
    still = make_folder(folder / "measurements" / "soil_dry")
    with replacing(still / "spectra.npz") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **table)
    head = {"format": "measurement/1", "table": "spectra.npz", "name": "soil at one level", "condition": "record", "model": model}
    write_json(still / "measurement.json", head)
    return [_trial("soil", "dry", wet, folder), _trial("soil at one level", "dry", still / "measurement.json", folder)]


def believe_dry(path: Path) -> dict[str, Any]:
    """Write into a measurement/1 of spectra that the mean of its driest tenth was believed at all levels; return that model."""
    measured = read_measurement(path).conditions
    assert measured is not None
    driest = measured.condition <= np.quantile(measured.condition, _DRIEST)
    model = {"model": "lambert", "albedo": measured.value[driest].mean(axis=0).tolist(), "free": ["albedo_scale"]}
    write_json(path, json.loads(path.read_text(encoding="utf-8")) | {"model": model})
    return model


def _trial(name: str, believed: str, path: Path, folder: Path) -> Trial:
    start = time.perf_counter()
    d = diagnose_file(path, catalogue(), say=lambda _: None)
    seconds = time.perf_counter() - start
    write_measured_diagnosis(folder / f"{name.replace(' ', '_')}_{believed}", d)
    return Trial(name, believed, d, seconds)
