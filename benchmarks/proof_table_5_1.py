"""Table 5.1 of the thesis on nine virtual samples: cost and relative variance of the models, with and without normals.

A sample has 64 x 64 texels, of which every thirteenth each way is measured under 151 x 151 directions and fitted.
"""

from __future__ import annotations

import numpy as np

from materials.fit import FitSettings, fit_where_possible
from materials.foundation.progress import stage
from materials.foundation.report import Cell, Table, write_report
from materials.foundation.report import Report as Page
from transport.dome import DomeSettings, acquire
from transport.dome_samples import SAMPLES, dome_sample

from .report import Report

_SIZE, _STEP = 64, 13
_FITS = (("ct", 2), ("ward", 2), ("phong", 2), ("ggx", 1), ("ggx", 2))


def run(report: Report) -> None:
    """Record the order of the models and what normals gain, and write the table."""
    at = np.arange(_STEP // 2, _SIZE, _STEP)
    texels = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2)
    costs: dict[tuple[str, str], float] = {}
    rows: list[list[Cell]] = []
    keys = [
        f"{model}{lobes if model == 'ggx' else ''}{'N' if normals else ''}" for model, lobes in _FITS for normals in (False, True)
    ]
    for name in SAMPLES:
        with stage(f"dome and fits: {name}"):
            measured = acquire(dome_sample(name, _SIZE), DomeSettings(), texels).normalise()
            row: list[Cell] = [name]
            for model, lobes in _FITS:
                for normals in (False, True):
                    settings = FitSettings(model=model, lobes=lobes, normals=normals)
                    fits = [f for f in fit_where_possible(measured, settings) if f is not None]
                    key = keys[len(row) - 1]
                    costs[name, key] = float(np.mean([f.cost for f in fits]))
                    row.append(f"{1e5 * costs[name, key]:.3g} / {100 * np.mean([f.relative_variance for f in fits]):.2g}")
            rows.append(row)
    table = Table(
        "table_5_1", "Mean cost x 1e5 / relative variance [%], per sample", ("sample", *keys), rows, "N: normals estimated first."
    )
    write_report(report.folder / "proof" / "table_5_1", Page("Table 5.1 on nine virtual samples", [], [table]))
    mean = {key: float(np.mean([costs[name, key] for name in SAMPLES])) for key in keys}
    for better, worse in (("ctN", "wardN"), ("wardN", "phongN"), ("ct", "ward"), ("ward", "phong")):
        name = f"nine samples: mean cost of {better} (x 1e5), at most that of {worse}"
        report.proof(name=name, value=1e5 * mean[better], bound=1e5 * mean[worse], holds=mean[better] <= mean[worse])
    for model in ("ct", "ward", "phong"):
        gains = [1 - costs[name, model + "N"] / costs[name, model] for name in SAMPLES]
        middle = float(np.mean(gains))
        report.proof(name=f"nine samples: share of {model}'s cost that normals save", value=middle, bound=0.0, holds=middle > 0)
