"""Table 5.1 of the thesis on nine virtual samples: cost and relative variance of the models, with and without normals.

A sample has 64 x 64 texels, of which every thirteenth each way is measured under 151 x 151 directions and fitted. Intervals, at
95 %, come from drawing again: of a sample's cost its texels, which lie 2.6 mm apart; of what is said about all samples the
samples, on each of which models are compared with each other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from materials.fit import FitSettings, fit_where_possible
from materials.foundation.progress import stage
from materials.foundation.report import Cell, Table, write_report
from materials.foundation.report import Report as Page
from transport.dome import DomeSettings, acquire
from transport.dome_samples import SAMPLES, dome_sample

from .report import Report

_SIZE, _STEP = 64, 13
_DRAWS = 2000
_FITS = (("ct", 2), ("ward", 2), ("phong", 2), ("ggx", 1), ("ggx", 2))


def run(report: Report) -> None:
    """Record the order of the models and what normals gain, and write the tables."""
    at = np.arange(_STEP // 2, _SIZE, _STEP)
    texels = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    costs: dict[tuple[str, str], float] = {}
    rows: list[list[Cell]] = []
    spread: list[list[Cell]] = []
    keys = [
        f"{model}{lobes if model == 'ggx' else ''}{'N' if normals else ''}" for model, lobes in _FITS for normals in (False, True)
    ]
    for name in SAMPLES:
        with stage(f"dome and fits: {name}"):
            measured = acquire(dome_sample(name, _SIZE), DomeSettings(), texels).normalise()
            row: list[Cell] = [name]
            ends: list[Cell] = [name]
            for model, lobes in _FITS:
                for normals in (False, True):
                    settings = FitSettings(model=model, lobes=lobes, normals=normals)
                    fits = [f for f in fit_where_possible(measured, settings) if f is not None]
                    found = np.array([f.cost for f in fits])
                    key = keys[len(row) - 1]
                    costs[name, key] = float(found.mean())
                    low, high = _interval(found, rng)
                    row.append(f"{1e5 * costs[name, key]:.3g} / {100 * np.mean([f.relative_variance for f in fits]):.2g}")
                    ends.append(f"{1e5 * low:.3g} to {1e5 * high:.3g}")
            rows.append(row)
            spread.append(ends)
    by_model = {key: np.array([costs[name, key] for name in SAMPLES]) for key in keys}
    said: list[list[Cell]] = []
    for better, worse in (("ctN", "wardN"), ("wardN", "phongN"), ("ct", "ward"), ("ward", "phong")):
        # Samples differ by a factor of a thousand: ratios, so that the glossy ones are not all that counts.
        ratios = by_model[worse] / by_model[better]
        low = _told(said, f"cost of {worse} over that of {better}", ratios, rng)[0]
        report.proof(name=f"nine samples: cost of {worse} over that of {better}, low end", value=low, bound=1.0, holds=low >= 1)
    for model in ("ct", "ward", "phong"):
        gains = 1 - by_model[model + "N"] / by_model[model]
        low = _told(said, f"share of {model}'s cost that normals save", gains, rng)[0]
        report.proof(name=f"nine samples: share of {model}'s cost that normals save, low end", value=low, bound=0.0, holds=low > 0)
    note = "N: normals estimated first."
    tables = [
        Table("table_5_1", "Mean cost x 1e5 / relative variance [%], per sample", ("sample", *keys), rows, note),
        Table("intervals", "Interval of the mean cost x 1e5, texels drawn again", ("sample", *keys), spread, note),
        Table("comparisons", "Over the samples, samples drawn again", ("what", "mean", "low", "high"), said),
    ]
    write_report(report.folder / "proof" / "table_5_1", Page("Table 5.1 on nine virtual samples", [], tables))


def _told(said: list[list[Cell]], what: str, values: NDArray, rng: np.random.Generator) -> tuple[float, float]:
    low, high = _interval(values, rng)
    said.append([what, float(values.mean()), low, high])
    return low, high


def _interval(values: NDArray, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of a mean, its values drawn again."""
    drawn = rng.choice(values, (_DRAWS, len(values))).mean(axis=1)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return float(low), float(high)
