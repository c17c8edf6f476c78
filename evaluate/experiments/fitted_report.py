"""Tables, words and pictures of the experiment `fitted-materials`."""

from __future__ import annotations

from collections import Counter
from functools import reduce
from operator import add
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transport.contact_sheet import contact_sheet

from ..plots import Box, jet, save_boxes, save_heat_maps
from ..reflectance_aware import MIRROR, HeatMap
from ..report import Report, Table
from .conclusions import METALS, STRUCTURED, Case, Verdict, verdicts
from .flow_errors import ANGLE_EDGES, FlowErrors
from .settings import FittedMaterialsSettings
from .virtual_materials import REFERENCE, variants

__all__ = ["Case", "Shown", "report"]

Shown = dict[str, tuple[NDArray, NDArray]]
Costs = dict[tuple[str, str], tuple[float, float]]
_QUANTILES = {"q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}
# How far from the mirror direction the heat maps reach, and their intervals [degrees].
_MAPS = {"metals": (METALS, 30, 3), "leather and fabric": (STRUCTURED, 60, 6)}


def report(
    settings: FittedMaterialsSettings,
    errors: dict[Case, list[FlowErrors]],
    costs: Costs,
    shown: dict[str, Shown],
    lengths: list[float],
    folder: Path,
) -> Report:
    """Return the report; pictures go below `folder`.

    Parameters
    ----------
    errors : dict
        One record per scene for each case.
    costs : dict
        Mean cost and relative variance of the fits, by sample and variant.
    shown : dict
        By sample and variant: picture and error map of the last scene and algorithm.
    lengths : list of float
        Mean length of the true flow in each scene [px].
    """
    found = verdicts(errors, np.random.default_rng([settings.seed, 5]))
    tables = [_conclusions(found), _errors(errors), _fits(settings, costs)]
    pixels = sum(r.pixels for records in errors.values() for r in records)
    words = Counter(v.word for v in found)
    paragraphs = [
        f"{settings.scenes} random scenes of {settings.width} x {settings.width} pixels, {settings.samples} paths per pixel, "
        f"{settings.bounces} scattering events, seed {settings.seed}; samples of {settings.texels} x {settings.texels} texels "
        f"under {settings.directions} x {settings.directions} directions, {settings.rank} factors; ambient light "
        f"{100 * settings.ambient_share:.0f} %; algorithms {', '.join(settings.algorithms)}. True flow {np.mean(lengths):.2f} px "
        f"on average; {pixels:.3g} flow vectors. The thesis: 39 scenes, 512 x 512 pixels, 1024 paths, true flow 7.4 px.",
        f"Of {len(found)} sentences {words['holds']} hold, {words['does not hold']} do not, and {words['cannot be told']} cannot "
        "be told. Intervals are at 95 %, from drawing the scenes again; they tell of other scenes, not of other materials.",
    ]
    definitions = {
        "epe": "end-point error |(u, v) - (u_t, v_t)| [px], over pixels that see the surface and whose place the next frame sees",
        "cost": "mean of log(1 + s / 4) of the cosine-weighted squared residuals s (eq. 5.2), within 60 degrees",
    }
    return Report(
        "Which reflectance model is good enough for optical flow?",
        paragraphs,
        tables,
        _draw(settings, errors, shown, folder / "pictures"),
        definitions,
    )


def _conclusions(found: list[Verdict]) -> Table:
    rows = [[v.sentence, v.algorithm, v.measure, v.thesis, v.value, v.low, v.high, v.word] for v in found]
    columns = ("the thesis says", "algorithm", "measure", "its value", "here", "low", "high", "verdict")
    note = "`low` and `high`: 95 % interval over scenes; the verdict asks whether all of it lies where the sentence holds."
    return Table("conclusions", "What the thesis concludes, and what holds here", columns, rows, note)


def _errors(errors: dict[Case, list[FlowErrors]]) -> Table:
    rows = []
    for sample in ("all", *dict.fromkeys(c.sample for c in errors)):
        for algorithm in dict.fromkeys(c.algorithm for c in errors):
            for variant in dict.fromkeys(c.variant for c in errors):
                record = _pooled(errors, None if sample == "all" else (sample,), variant, algorithm)
                rows.append([sample, algorithm, variant, record.pixels, record.mean, *map(record.quantile, _QUANTILES.values())])
    return Table(
        "errors", "End-point errors [px]", ("sample", "algorithm", "model", "pixels", "mean", *_QUANTILES), rows, "Over all scenes."
    )


def _fits(settings: FittedMaterialsSettings, costs: Costs) -> Table:
    names = [v for v in variants(settings.models) if v != REFERENCE]
    rows: list[list] = []
    for sample in settings.materials:
        rows.append([sample, *(f"{1e5 * costs[sample, v][0]:.3g} / {100 * costs[sample, v][1]:.2g}" for v in names)])
    mean = [np.mean([costs[sample, v] for sample in settings.materials], axis=0) for v in names]
    rows.append(["mean", *(f"{1e5 * cost:.3g} / {100 * variance:.2g}" for cost, variance in mean)])
    note = "Two lobes; N: normals estimated first."
    return Table("fits", "Mean cost x 1e5 / relative variance [%] of the fits (table 5.1)", ("sample", *names), rows, note)


def _pooled(errors: dict[Case, list[FlowErrors]], samples: tuple[str, ...] | None, variant: str, algorithm: str) -> FlowErrors:
    kept = [
        r
        for c, records in errors.items()
        if (c.variant, c.algorithm) == (variant, algorithm) and (samples is None or c.sample in samples)
        for r in records
    ]
    return reduce(add, kept)


def _draw(
    settings: FittedMaterialsSettings, errors: dict[Case, list[FlowErrors]], shown: dict[str, Shown], folder: Path
) -> dict[str, Path]:
    pictures: dict[str, Path] = {}
    names = tuple(variants(settings.models))
    groups = {what: tuple(s for s in group if s in settings.materials) for what, (group, _, _) in _MAPS.items()}
    for a in settings.algorithms:
        for what, samples in {"all samples": settings.materials, **groups}.items():
            if not samples:
                continue
            path = folder / f"errors_{a}_{what.replace(' ', '_')}.png"
            boxes = {v: _box(_pooled(errors, samples, v, a)) for v in names}
            save_boxes(path, boxes, f"{a}, {what}: end-point error by reflectance model")
            pictures[f"Distribution of end-point errors, {a}, {what} (figures 5.6, 5.7)"] = path
        for what, (_, reach, step) in _MAPS.items():
            if not groups[what]:
                continue
            path = folder / f"angles_{a}_{what.replace(' ', '_')}.png"
            maps = {v: _until(_pooled(errors, groups[what], v, a).mirror, reach, step) for v in names}
            save_heat_maps(path, maps, f"{a}, {what}: end-point error by {MIRROR}", MIRROR)
            pictures[f"Errors about the mirror direction, {a}, {what} (figures 5.8, 5.9)"] = path
    path = folder / "materials.png"
    last = settings.algorithms[-1]
    known = np.concatenate([e[np.isfinite(e)] for s in shown.values() for _, e in s.values()])
    red = float(np.quantile(known, 0.95)) if known.size else 1.0
    rows = []
    for sample, by_variant in shown.items():
        rows.append((f"{sample} | {', '.join(by_variant)}", [picture for picture, _ in by_variant.values()]))
        rows.append((f"end-point error of {last}, red {red:.2g} px", [jet(e, max(red, 1e-3)) for _, e in by_variant.values()]))
    contact_sheet(rows, path, 160)
    return pictures | {"The last scene: pictures, and errors against the true flow": path}


def _box(record: FlowErrors) -> Box:
    low, middle, high, top = (record.quantile(q) for q in (0.25, 0.5, 0.75, 1.0))
    reach = 1.5 * (high - low)
    return Box(middle, low, high, max(record.quantile(0.0), low - reach), min(top, high + reach), record.mean)


def _until(map_: HeatMap, reach: int, step: int) -> HeatMap:
    """Return a heat map of wider intervals that ends earlier."""
    wide = round(step / (ANGLE_EDGES[1] - ANGLE_EDGES[0]))
    columns = int(np.searchsorted(ANGLE_EDGES, reach))
    counts = map_.counts[:, :columns].reshape(len(map_.counts), -1, wide).sum(axis=2)
    return HeatMap(map_.angle_edges[: columns + 1 : wide], map_.error_edges, counts)
