"""What a diagnosis leaves behind: diagnosis.json, masks, the corrected simulation, its pictures, and the report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from materials.foundation.files import make_folder, replacing, replacing_folder, write_json
from scene.images import write_exr
from scene.simulation import AddedEffect, Simulation
from scene.simulation_file import write_simulation

from .diagnose import Diagnosis, Finding
from .effect import STAGES
from .pictures.case import PictureCase
from .report import sentence, write_report
from .solve import by_frame


def write_diagnosis(folder: str | Path, d: Diagnosis) -> None:
    """Write everything into a folder.

    `diagnosis.json` comes last: where it is, all else is whole.
    """
    folder = make_folder(Path(folder))
    (folder / "diagnosis.json").unlink(missing_ok=True)
    with replacing(folder / "affected.npz") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, located=d.located, affected=d.affected)
    with replacing_folder(folder / "corrected") as temporary:
        if not isinstance(d.case, PictureCase):
            write_simulation(temporary / "simulation.json", corrected(d))
        exposures = [f.exposure for f in d.case.recording.frames]
        for i, (frame, picture) in enumerate(zip(d.case.recording.frames, d.predicted, strict=True)):
            stem = f"{i:04d}" if len({f.name for f in d.case.recording.frames}) < d.case.num_frames else frame.name
            write_exr(
                temporary / "images" / f"{stem}.exr", dict(zip("RGB", np.moveaxis(picture * exposures[i], -1, 0), strict=True))
            )
    write_report(folder / "report.html", d)
    write_json(folder / "diagnosis.json", as_json(d))


def as_json(d: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis in the form of diagnosis/1."""
    h = d.held_out
    return {
        "format": "diagnosis/1",
        "verdict": d.verdict,
        "summary": sentence(d),
        "effects": [
            finding_json(f) | {"decoys": [{"title": r.title, "gain_over": r.gain, "standard_errors": r.sigmas} for r in f.decoys]}
            for f in d.findings
        ],
        "held_out": {
            "frames": h.frames,
            "chi2_per_pixel_before": finite_or_none(h.chi2_before),
            "chi2_per_pixel_after": finite_or_none(h.chi2_after),
            "rmse_before": finite_or_none(h.rmse_before),
            "rmse_after": finite_or_none(h.rmse_after),
            "views": h.views,
            "lights": h.lights,
            "blocks": h.blocks,
        },
        "affected": "affected.npz",
        "corrected": "corrected/images" if isinstance(d.case, PictureCase) else "corrected/simulation.json",
        "residual_depends_on": [x.name for x in d.depends_on[:4]],
        "free_parameters": {k: float(v) for k, v in d.best.terms[0].values.items()},
        "noise": {"stated": not d.case.noise_estimated, "sigma_factor": d.noise_factor},
        "tested": d.tested,
        "not_testable": d.case.untestable,
        "notes": d.notes,
        "seed": d.seed,
    }


def finding_json(f: Finding) -> dict[str, Any]:
    """Return a finding in the form of diagnosis/1."""
    out = {
        "id": f.id,
        "parameters": f.parameters,
        "p_value": f.p_value,
        "ambiguous_with": f.ambiguous_with,
        "where": f.where,
        "gain": float(f.gain),
    }
    return out | ({"decide_by": f.decides} if f.ambiguous_with else {})


def corrected(d: Diagnosis) -> Simulation:
    """Return the simulation with the fitted free parameters and with what was found: in its own fields, else as `effects`."""
    simulation = d.case.simulation
    materials = dict(simulation.materials)
    for key, value in d.best.terms[0].values.items():
        name, _, material = key.partition(".")
        materials[material] = replace(materials[material], **{name: float(value)})
    simulation = replace(simulation, materials=materials)
    for t in sorted(d.best.effects, key=lambda t: STAGES.index(t.effect.stage)):
        values = by_frame(d.case, t)
        fields = t.effect.corrected(d.best.case, simulation, values, t.target, t.aux)
        if fields is None:
            plain: dict[str, Any] = {k: v.tolist() if isinstance(v, np.ndarray) else float(v) for k, v in values.items()}
            field = t.effect.stored(d.best.case, t.target, t.aux)
            added = AddedEffect(t.effect.id, t.target, plain if field is None else plain | {"map": field})
            fields = replace(simulation, effects=(*simulation.effects, added))
        simulation = fields
    noise = [AddedEffect("noise_model", None, {"sigma_factor": d.noise_factor}) for f in d.findings if f.id == "noise_model"]
    return replace(simulation, effects=(*simulation.effects, *noise))


def finite_or_none(x: float) -> float | None:
    """Return a number as JSON can hold it."""
    return float(x) if np.isfinite(x) else None
