"""Is the augmented street as good as the truly wet one, for the algorithm that uses it?

The built-in street is photographed dry and, in the same light, truly wet: water where run-off leaves it, wet materials, real
geometry, sensor noise. The augmentation sees the dry recording only. Each flow algorithm runs on the truly wet pair, on a
second photograph of it with other noise (the floor: what differs although nothing does), on the augmented pair, and on pairs
wetted in simpler ways or not at all. Then, over the ground that both frames see:

- the difference flow error to the flow of the truly wet pair, with its five classes (thesis eq 4.1, 4.3.3), and
- the end-point error against the true flow, beside that of the truly wet pair, and how the two agree in rank from pixel to pixel.

How strong a shower makes how much wetness is not given, so each method takes the global wetness that gives the best PSNR to the
truth on the first pair; with more than one pair, the first is not scored.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from materials.foundation.checks import check_range
from materials.foundation.progress import tracked
from scene.flow_files import as_flow
from transport.contact_sheet import contact_sheet

from ..algorithms import algorithm
from ..flow_metrics import DEFINITIONS, DFE_CLASSES, difference_of, endpoint_error
from ..images import DEFINITIONS as IMAGE_DEFINITIONS
from ..images import psnr, ssim
from ..plots import jet, save_class_bars
from ..report import Report, Table
from .settings import TrueWetSettings
from .wet_street import WetStreet
from .wetting import METHODS

_GRID = (1 / 3, 0.5, 2 / 3, 5 / 6, 1.0)
_TRUE, _FLOOR, _DRY = "truly wet", "truly wet, again", "dry"
_ERROR_SHOWN = 1.0  # px at the end of the colour scale


def run(settings: TrueWetSettings, folder: Path) -> Report:
    """Run the experiment and return its report; pictures go below `folder`.

    Raises
    ------
    InputError
        If a shower or an algorithm is none.
    """
    check_range("showers", settings.showers, "[0, 1]")
    for name in settings.algorithms:
        algorithm(name)
    street = WetStreet(settings, folder)
    scored = street.pairs[1:] or street.pairs
    image_rows: list[list] = []
    flow_rows: list[list] = []
    pictures: dict[str, Path] = {}
    for shower in settings.showers:
        chosen = {name: _best_wetness(street, name, shower) for name in METHODS}
        kinds = [_FLOOR, *METHODS, _DRY]
        dfe: dict[tuple[str, str], list[NDArray]] = {}
        epe: dict[tuple[str, str], list[NDArray]] = {}
        shown: dict[str, NDArray] = {}
        image_scores: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
        for first, second in tracked(scored, f"flow, shower {shower:.2f}", len(scored)):
            region = street.ground(first) & street.visible(first)
            truth = street.true_flow(first)
            pair = {k: [_picture(street, k, chosen, shower, i) for i in (first, second)] for k in (_TRUE, *kinds)}
            for kind in kinds:
                scores = (measure(pair[kind][0], pair[_TRUE][0], 255, street.ground(first)) for measure in (psnr, ssim))
                image_scores[kind].append(tuple(scores))  # type: ignore[arg-type]
            shown = {k: pictures_[0] for k, pictures_ in pair.items()} if (first, second) == scored[-1] else shown
            for name in settings.algorithms:
                flows = {kind: as_flow(street.flow(name, *pictures_)) for kind, pictures_ in pair.items()}
                for kind, flow in flows.items():
                    error = endpoint_error(flow, truth)
                    kept = region & truth.valid
                    epe.setdefault((name, kind), []).append(error[kept])
                    if kind != _TRUE:
                        dfe.setdefault((name, kind), []).append(endpoint_error(flow, flows[_TRUE])[kept])
                    if (first, second) == scored[-1] and name == settings.algorithms[-1]:
                        shown[f"{kind} error"] = np.where(kept, error, np.nan)
        for kind in kinds:
            values = np.mean(image_scores[kind], axis=0)
            image_rows.append([shower, kind, chosen.get(kind), float(values[0]), float(values[1])])
            for name in settings.algorithms:
                flow_rows.append([shower, name, kind, *_compared(dfe[name, kind], epe[name, kind], epe[name, _TRUE])])
        pictures |= _draw(folder, shower, kinds, settings, dfe, shown)
    return _report(settings, street, scored, image_rows, flow_rows, pictures)


def _picture(street: WetStreet, kind: str, chosen: dict[str, float], shower: float, frame: int) -> NDArray:
    if kind == _DRY:
        return street.picture(frame)
    if kind in METHODS:
        return street.wet(frame, chosen[kind], kind)
    return street.truly_wet(frame, shower, repeat=int(kind == _FLOOR))


def _best_wetness(street: WetStreet, method: str, shower: float) -> float:
    first = street.pairs[0][0]
    truth, ground = street.truly_wet(first, shower), street.ground(first)
    return max(_GRID, key=lambda w: psnr(street.wet(first, w, method), truth, 255, ground))


def _compared(dfe: list[NDArray], epe: list[NDArray], true_epe: list[NDArray]) -> list[float]:
    """Return the cells of a row: difference with its spread over the pairs and its classes, errors and their agreement."""
    d = difference_of(np.concatenate(dfe))
    means = [float(e.mean(dtype=np.float64)) for e in dfe]
    spread = float(np.std(means, ddof=1) / np.sqrt(len(means))) if len(means) > 1 else float("nan")
    own, true = np.concatenate(epe), np.concatenate(true_epe)
    error, true_error = float(own.mean(dtype=np.float64)), float(true.mean(dtype=np.float64))
    rank = spearmanr(own, true).statistic if np.ptp(own) > 0 and np.ptp(true) > 0 else float("nan")
    return [d.mean, spread, d.median, *d.classes, error, true_error, error - true_error, float(rank)]


def _draw(
    folder: Path,
    shower: float,
    kinds: list[str],
    settings: TrueWetSettings,
    dfe: dict[tuple[str, str], list[NDArray]],
    shown: dict[str, NDArray],
) -> dict[str, Path]:
    pictures: dict[str, Path] = {}
    for name in settings.algorithms:
        path = folder / "pictures" / f"classes_{name}_{shower:.2f}.png"
        shares = {kind: difference_of(np.concatenate(dfe[name, kind])).classes for kind in kinds}
        save_class_bars(path, shares, f"{name}, shower {shower:.2f}: difference to the flow of the truly wet pair")
        pictures[f"Classes of the difference flow error, {name}, shower {shower:.2f}"] = path
    sheet = folder / "pictures" / f"street_{shower:.2f}.png"
    rows: list[tuple[str, list[NDArray]]] = []
    for kind in (_TRUE, *kinds):
        caption = f"{kind} | end-point error of {settings.algorithms[-1]} on the ground, red {_ERROR_SHOWN:g} px"
        rows.append((caption, [shown[kind], jet(shown[f"{kind} error"], _ERROR_SHOWN)]))
    contact_sheet(rows, sheet, 480)
    pictures[f"The last pair at shower {shower:.2f}: pictures, and errors against the true flow"] = sheet
    return pictures


def _report(
    settings: TrueWetSettings,
    street: WetStreet,
    scored: list[tuple[int, int]],
    image_rows: list[list],
    flow_rows: list[list],
    pictures: dict[str, Path],
) -> Report:
    columns = ("shower", "algorithm", "pictures", "dfe", "se", "dfe_median", *DFE_CLASSES, "epe", "epe_true", "epe_change", "rank")
    note = (
        "Over the ground that both frames see. `se`: standard error of the mean over the pairs. `epe_true`: error on the truly wet "
        "pair; `epe_change`: what the pictures of the row add to it; `rank`: Spearman's correlation of the two error maps."
    )
    flow_table = Table("flow", "Flow on each kind of wet street, against that on the truly wet one", columns, flow_rows, note)
    image_table = Table(
        "pictures",
        "The pictures themselves, over the ground",
        ("shower", "pictures", "wetness", "psnr", "ssim"),
        image_rows,
        "Against the truly wet photograph; `wetness` is what each method took.",
    )
    winners = _closest(flow_rows)
    paragraphs = [
        f"{len(scored)} scored pairs of {settings.width} x {settings.height} pixels, {settings.samples} paths per pixel, "
        f"seed {settings.seed}, {settings.step:g} m from frame to frame; algorithms {', '.join(settings.algorithms)}.",
        winners,
        "One street, one light: the intervals are over pairs of one drive, which share the world.",
    ]
    used = ("dfe", "epe")
    definitions = {n: DEFINITIONS[n] for n in used} | {n: IMAGE_DEFINITIONS[n] for n in ("psnr", "ssim")}
    return Report("Flow on the augmented and on the truly wet street", paragraphs, [flow_table, image_table], pictures, definitions)


def _closest(rows: list[list]) -> str:
    """Say in how many of the comparisons the augmentation's flow is nearest to that of the truly wet street."""
    by: dict[tuple[float, str], dict[str, float]] = {}
    for shower, name, kind, mean, *_ in rows:
        by.setdefault((shower, name), {})[kind] = mean
    nearest = sum(min(METHODS, key=lambda m, d=d: d[m]) == "augmented" for d in by.values())
    beyond_dry = sum(d["augmented"] < d[_DRY] for d in by.values())
    return (
        f"The flow on the augmented pictures is nearer to that on the truly wet ones than with darkening or a planar mirror in "
        f"{nearest} of {len(by)} comparisons (showers x algorithms), and nearer than on the dry pictures in {beyond_dry}."
    )
