"""Tables, words and pictures of the experiment `wetter`."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from transport.contact_sheet import contact_sheet

from ..flow_metrics import DEFINITIONS
from ..plots import Curve, Triple, jet, save_changes, save_rise
from ..report import Report, Table
from .settings import WetterSettings
from .tiles import Estimate, TileSums

ALL, DRY = "all", "dry"
REGIONS = ("drops", "beside drops", "standing water", "other ground", "elsewhere")
_COLOURS = np.array([(230, 60, 60), (255, 190, 170), (40, 110, 230), (150, 150, 150), (235, 235, 235)], np.uint8)
Shown = dict[str, tuple[NDArray, NDArray, NDArray]]


class Case(NamedTuple):
    """What a sum of errors is over."""

    drive: str
    effect: str
    level: float
    algorithm: str
    region: str


def report(
    settings: WetterSettings, pairs: dict[str, int], sums: dict[Case, TileSums], shown: dict[str, Shown], folder: Path
) -> Report:
    """Return the report; pictures go below `folder`.

    Parameters
    ----------
    pairs : dict
        How many pairs of each drive were scored.
    shown : dict
        By drive and effect: picture, error map, index into `REGIONS`; of the last pair.
    """
    rng = np.random.default_rng([settings.seed, 6])
    changes = {case: s.changes(rng) for case, s in sums.items()}
    tables = [_robustness(sums, changes), _places(sums, changes)]
    pictures: dict[str, Path] = {}
    for drive in pairs:
        pictures |= _draw(drive, settings, sums, changes, shown[drive], folder / "pictures")
    counts = " and ".join(f"{n} pairs of {drive}" for drive, n in pairs.items())
    paragraphs = [
        f"{counts}; {settings.samples} paths per pixel, seed {settings.seed}; algorithms {', '.join(settings.algorithms)}. "
        f"Built-in street: {settings.width} x {settings.height} pixels, {settings.step:g} m from frame to frame.",
        *(_words(drive, settings, changes) for drive in pairs),
        "`low` and `high` are the ends of the 95 % intervals of the change before them, from drawing tiles of the pictures again, "
        "a sixth of the picture high. They tell of other places on such a drive, not of other drives, lights or cameras.",
    ]
    definitions = {name: DEFINITIONS[name] for name in ("epe", "fl_all")}
    return Report("Flow as the drive gets wetter", paragraphs, tables, pictures, definitions)


def _robustness(sums: dict[Case, TileSums], changes: dict[Case, tuple[Estimate, Estimate]]) -> Table:
    rows = []
    for case, s in sums.items():
        if case.region != ALL:
            continue
        epe, fl = changes[case]
        told = [None] * 3 if case.effect == DRY else [epe.value, epe.low, epe.high]
        fl_told = [None] * 3 if case.effect == DRY else [fl.value, fl.low, fl.high]
        rows.append([case.drive, case.effect, case.level, case.algorithm, s.pixels, s.epe(), *told, s.fl_all(), *fl_told])
    columns = (
        *("drive", "effect", "level", "algorithm", "pixels", "epe", "epe_change", "epe_low", "epe_high"),
        *("fl_all", "fl_change", "fl_low", "fl_high"),
    )
    note = "Over pixels that both frames see and whose true flow is known; changes are against the same pixels in the dry."
    return Table("robustness", "Error by effect and algorithm", columns, rows, note)


def _places(sums: dict[Case, TileSums], changes: dict[Case, tuple[Estimate, Estimate]]) -> Table:
    rows = []
    for case, s in sums.items():
        if case.region == ALL or s.pixels == 0:
            continue
        everywhere = sums[case._replace(region=ALL)]
        epe = changes[case][0]
        # A share of what is added means something only where something is added.
        share = s.added() / everywhere.added() if changes[case._replace(region=ALL)][0].low > 0 else None
        cells = [s.pixels / everywhere.pixels, s.epe(dry=True), s.epe(), epe.value, epe.low, epe.high, share]
        rows.append([case.drive, case.effect, case.level, case.algorithm, case.region, *cells])
    columns = (
        *("drive", "effect", "level", "algorithm", "region"),
        *("of_pixels", "epe_dry", "epe", "epe_change", "epe_low", "epe_high", "of_added"),
    )
    note = (
        "Regions of the first picture: drops that cover more than a tenth of the lens in either frame, what is within 4 px of "
        "them, water that stands (accumulation above a half), the other ground, all else. `epe_dry`: of the same pixels in the "
        "dry; `of_added`: share of all that the weather adds to the error, empty where that is not above 0 with confidence; "
        "negative where a region gets easier."
    )
    return Table("places", "Where the errors sit", columns, rows, note)


def _words(drive: str, settings: WetterSettings, changes: dict[Case, tuple[Estimate, Estimate]]) -> str:
    """Say what each effect does at its highest level."""
    top = max(settings.levels)
    parts = []
    for effect in settings.effects:
        found = {a: changes[Case(drive, effect, top, a, ALL)][0] for a in settings.algorithms}
        worse = sum(e.low > 0 for e in found.values())
        better = sum(e.high < 0 for e in found.values())
        least, most = min(found, key=lambda a: found[a].value), max(found, key=lambda a: found[a].value)
        span = f"{found[least].value:+.2f} px ({least}) to {found[most].value:+.2f} px ({most})"
        parts.append(f"{effect} {span}, worse for {worse} and better for {better} of {len(found)}")
    told = f"On {drive}, at level {top:.2g}, the end-point error changes by: {'; '.join(parts)}."
    return f"{told} Counted is where the interval leaves out 0."


def _draw(
    drive: str,
    settings: WetterSettings,
    sums: dict[Case, TileSums],
    changes: dict[Case, tuple[Estimate, Estimate]],
    shown: Shown,
    folder: Path,
) -> dict[str, Path]:
    levels, top = sorted(settings.levels), max(settings.levels)
    curves: dict[str, dict[str, Curve]] = {}
    bars: dict[str, dict[str, list[Triple]]] = {}
    for effect in settings.effects:
        for a in settings.algorithms:
            dry = sums[Case(drive, DRY, 0.0, a, ALL)].epe()
            found = [changes[Case(drive, effect, level, a, ALL)][0] for level in levels]
            value, low, high = ([dry, *(dry + getattr(e, end) for e in found)] for end in ("value", "low", "high"))
            curves.setdefault(effect, {})[a] = ([0.0, *levels], value, low, high)
            here = [changes[Case(drive, effect, top, a, region)][0] for region in REGIONS]
            bars.setdefault(effect, {})[a] = [(e.value, e.low, e.high) for e in here]
    rise, places, sheet = (folder / f"{kind}_{drive}.png" for kind in ("rise", "places", "pictures"))
    save_rise(rise, curves, f"{drive}: error as effects get stronger, with 95 % intervals of the change")
    save_changes(places, bars, REGIONS, f"{drive}: what level {top:.2g} adds to the error, by place in the picture")
    known = shown[DRY][1][np.isfinite(shown[DRY][1])]
    red = max(1.0, float(np.round(2 * np.quantile(known, 0.9)))) if known.size else 1.0
    rows = []
    for effect, (picture, error, place) in shown.items():
        legend = "drops red, beside pale, standing water blue, ground grey"
        caption = f"{effect} | end-point error of {settings.algorithms[-1]}, red {red:g} px | {legend}"
        rows.append((caption, [picture, jet(error, red), _COLOURS[place]]))
    contact_sheet(rows, sheet, 480)
    return {
        f"End-point error on {drive} by effect and level": rise,
        f"Where what is added sits, {drive}": places,
        f"The last pair of {drive} at level {top:.2g}: pictures, errors, places": sheet,
    }
