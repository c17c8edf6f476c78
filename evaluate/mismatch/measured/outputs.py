"""What the diagnosis of a measurement leaves behind: diagnosis.json, masks, the model with its effects, and the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from materials.foundation.files import make_folder, replacing, write_json
from materials.foundation.report import Cell, Report, Table, write_report

from ..outputs import finding_json, finite_or_none
from .diagnose import MeasuredDiagnosis
from .pictures import draw

_TRIALS = 40
_LEAST_P = 1e-30  # smaller ones say nothing that blocks could tell


def sentence(d: MeasuredDiagnosis) -> str:
    """Return the verdict in words."""
    listed = " and ".join(f.title for f in d.findings)
    return {
        "consistent": "What was believed and what was measured agree: what differs is noise.",
        "explained": f"What was believed leaves out {listed}; with it, what differs is noise.",
        "partly_explained": f"What was believed leaves out {listed}; something remains that this does not explain.",
        "unexplained": "What was believed and what was measured differ, and nothing that was tried explains it.",
    }[d.verdict]


def write_measured_diagnosis(folder: str | Path, d: MeasuredDiagnosis) -> None:
    """Write everything into a folder.

    `diagnosis.json` comes last: where it is, all else is whole.
    """
    folder = make_folder(Path(folder))
    (folder / "diagnosis.json").unlink(missing_ok=True)
    with replacing(folder / "affected.npz") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, located=d.located, affected=d.affected)
    make_folder(folder / "corrected")
    if "stereo" in d.extra:
        from .stereo_pictures import draw_stereo

        stereo, _, best = d.extra["stereo"]
        with replacing(folder / "corrected" / "normals.npz") as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file, normal=best.fit.normal, albedo=best.fit.albedo, mask=stereo.mask, prediction=best.fit.prediction
            )
        pictures = draw_stereo(d, make_folder(folder / "pictures"))
    else:
        pictures = draw(d, make_folder(folder / "pictures"))
    if d.samples is not None and d.best is not None:
        with replacing(folder / "corrected" / "prediction.npz") as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, believed=d.base.fit.prediction if d.base else 0, corrected=d.best.fit.prediction)
        write_json(folder / "corrected" / "model.json", corrected(d))
    write_report(folder, report(d, pictures))
    write_json(folder / "diagnosis.json", as_json(d))


def corrected(d: MeasuredDiagnosis) -> dict[str, Any]:
    """Return the believed model with the fitted free parameters, and with what was found as `effects`."""
    assert d.samples is not None
    effects = [{"id": f.id, "target": f.where, "parameters": {k: p["value"] for k, p in f.parameters.items()}} for f in d.findings]
    return {**d.samples.model, **d.free, "effects": effects}


def as_json(d: MeasuredDiagnosis) -> dict[str, Any]:
    """Return the diagnosis in the form of diagnosis/1."""
    p = d.proof
    return {
        "format": "diagnosis/1",
        "verdict": d.verdict,
        "summary": sentence(d),
        "effects": [finding_json(f) for f in d.findings],
        "held_out": {
            "what": p.what,
            "blocks": [row[0] for row in p.rows],
            "chi2_per_pixel_before": finite_or_none(p.chi2_before),
            "chi2_per_pixel_after": finite_or_none(p.chi2_after),
            "rmse_before": finite_or_none(p.rmse_before),
            "rmse_after": finite_or_none(p.rmse_after),
        }
        | d.extra.get("held_out", {}),
        "affected": "affected.npz",
        "corrected": "corrected/normals.npz" if "stereo" in d.extra else "corrected/model.json",
        "residual_depends_on": [x.name for x in d.depends_on[:4]],
        "free_parameters": d.free,
        "noise": {"stated": d.noise_stated},
        "tested": d.tested,
        "untested": d.untested,
        "notes": d.notes,
        "seed": 0,
    }


def report(d: MeasuredDiagnosis, pictures: dict[str, Path]) -> Report:
    """Return the page for a person."""
    tables = []
    if d.findings:
        found: list[list[Cell]] = []
        for f in d.findings:
            for name, p in f.parameters.items():
                p_value = f.p_value if f.p_value >= _LEAST_P else f"< {_LEAST_P:g}"
                found.append([f.id, name, *_words(p), p["unit"], f.gain, p_value, ", ".join(f.ambiguous_with) or None])
        columns = ("effect", "parameter", "value", "90 % interval", "unit", "gain", "p", "not told from")
        note = "Gain: what held-out chi-square a value rises by without the effect. Intervals: jackknife over the held-out blocks."
        tables.append(Table("effects", "What was found", columns, found, note))
    tables += d.extra.get("tables", [])
    if d.proof.rows:
        rows: list[list[Cell]] = [[*r] for r in d.proof.rows]
        p = d.proof
        rows.append(["all", p.chi2_before, p.chi2_after, p.rmse_before, p.rmse_after])
        columns = (p.what, "chi-square before", "chi-square after", "rmse before", "rmse after")
        tables.append(
            Table(
                "held_out",
                "On blocks that no fit saw",
                columns,
                rows,
                "Each block was left out of a fit of its own. Chi-square is per value.",
            )
        )
    tried: list[list[Cell]] = [[" + ".join(t.on_top_of), t.id, t.gain, t.sigmas, t.excess, t.verdict] for t in d.trials[:_TRIALS]]
    note = (
        "Those called no physics are smooth functions that an effect in other coordinates has to beat. Left over: held-out "
        "chi-square beyond noise."
    )
    tables.append(Table("trials", "What was tried", ("on top of", "what", "gain", "standard errors", "left over", ""), tried, note))
    if d.depends_on:
        depends: list[list[Cell]] = [[x.name, x.excess, x.sigmas] for x in d.depends_on[:8]]
        tables.append(
            Table("depends", "What remains stands still in", ("coordinate", "excess variance", "standard deviations"), depends)
        )
    words = [f"{d.verdict}: {sentence(d)}"]
    for f in d.findings:
        also = (
            f" These data cannot tell it from {' or '.join(f.ambiguous_with)}; to decide: {f.decides}." if f.ambiguous_with else ""
        )
        words.append(f"{f.title} ({f.id}): {f.says}.{also}")
    words += [*d.notes, f"Tested: {', '.join(d.tested)}."]
    return Report(f"What was left out of {d.name}", words, tables, pictures)


def _words(p: dict[str, Any]) -> list[Cell]:
    value, interval = p["value"], p.get("ci90")
    if isinstance(value, list):
        return [f"{min(value):.4g} to {max(value):.4g}, per {p['per']}", None]
    return [value, None if interval is None else f"{interval[0]:.4g} to {interval[1]:.4g}"]
