"""How do flow algorithms fare as the drive gets wetter, and where do their errors sit?

The built-in street, whose true flow is known, and recorded drives with measured flow or disparity are augmented with one
effect of rain at a time, and with all together, at rising levels. Each algorithm runs on the same pairs in the dry and in each
weather; the truth does not change. Told are the end-point error and Fl-all, what the weather adds to them with an interval
over tiles of the pictures, and how what it adds is shared between drops on the windshield, what is beside them, standing water, the
other ground, and all else.

Where a drop covers a pixel, the true flow stays that of the street behind it, which is what a user of the flow wants.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from scene.flow_files import Flow, as_flow

from ..algorithms import algorithm
from ..flow_metrics import endpoint_error
from ..report import Report
from .recorded_drive import RecordedDrive
from .settings import WetterSettings
from .tiles import TileSums
from .wet_street import Rain, Weather, WetStreet
from .wetter_report import ALL, DRY, REGIONS, Case, Shown, report

_COVERED = 0.1  # share of the lens above which a drop counts
_BESIDE_PX = 4  # around drops: half a patch of dis, so that a match there sees the drop
_STANDING = 0.5  # accumulation above which water stands


class Drive(Protocol):
    """What the experiment asks of a drive."""

    pairs: list[tuple[int, int]]

    def picture(self, frame: int) -> NDArray: ...
    def rain(self, frame: int, weather: Weather) -> Rain: ...
    def ground(self, frame: int) -> NDArray[np.bool_]: ...
    def visible(self, frame: int) -> NDArray[np.bool_]: ...
    def true_flow(self, frame: int) -> Flow: ...
    def flow(self, name: str, first: NDArray, second: NDArray) -> NDArray[np.float32]: ...


def run(settings: WetterSettings, folder: Path) -> Report:
    """Run the experiment and return its report; pictures go below `folder`.

    Raises
    ------
    InputError
        If a level or an algorithm is none, if there is no drive, or if a recording has no true flow.
    """
    check_range("levels", settings.levels, "(0, 1]")
    for name in settings.algorithms:
        algorithm(name)
    if not settings.street and not settings.recordings:
        raise InputError("be given with --no-street", key="--recordings", remedy="Without both there is nothing to run on.")
    drives: dict[str, Drive] = {}
    if settings.street:
        drives["street"] = WetStreet(settings, folder / "street")
    for file in settings.recordings:
        name = file.name.removesuffix(".json").removesuffix(".recording")
        drives[name] = RecordedDrive(file, folder / name, settings)
    sums: dict[Case, TileSums] = {}
    shown: dict[str, Shown] = {}
    for name, drive in drives.items():
        for first, second in tracked(drive.pairs, f"flow on {name}", len(drive.pairs)):
            shown[name] = _score_pair(name, drive, (first, second), settings, sums)
    return report(settings, {name: len(drive.pairs) for name, drive in drives.items()}, sums, shown, folder)


def weather_of(effect: str, level: float) -> Weather:
    """Return the weather with one effect, or with all `together`, at a level."""
    return Weather(*(level if effect in (name, "together") else 0.0 for name in ("wetness", "mist", "droplets")))


def _score_pair(
    name: str, drive: Drive, pair: tuple[int, int], settings: WetterSettings, sums: dict[Case, TileSums]
) -> dict[str, tuple[NDArray, NDArray, NDArray]]:
    """Add a pair to the sums; return, by effect at the highest level, its picture, the last algorithm's errors, the regions."""
    first = pair[0]
    truth = drive.true_flow(first)
    counted = truth.valid & drive.visible(first)
    length = np.hypot(truth.flow[..., 0], truth.flow[..., 1])
    ground = drive.ground(first)
    dry = [drive.picture(frame) for frame in pair]
    dry_errors = {a: endpoint_error(as_flow(drive.flow(a, *dry)), truth) for a in settings.algorithms}
    nowhere = np.zeros(counted.shape, np.float32)
    shown = {DRY: (dry[0], _kept(dry_errors[settings.algorithms[-1]], counted), _regions(nowhere, nowhere, ground))}
    for a, error in dry_errors.items():
        sums.setdefault(Case(name, DRY, 0.0, a, ALL), TileSums()).add(error, error, length, counted)
    for effect in settings.effects:
        for level in settings.levels:
            rain = [drive.rain(frame, weather_of(effect, level)) for frame in pair]
            place = _regions(np.maximum(rain[0].drops, rain[1].drops), rain[0].standing, ground)
            for a in settings.algorithms:
                error = endpoint_error(as_flow(drive.flow(a, rain[0].picture, rain[1].picture)), truth)
                for i, region in enumerate((ALL, *REGIONS)):
                    inside = counted if region == ALL else counted & (place == i - 1)
                    sums.setdefault(Case(name, effect, level, a, region), TileSums()).add(error, dry_errors[a], length, inside)
                if level == max(settings.levels) and a == settings.algorithms[-1]:
                    shown[effect] = (rain[0].picture, _kept(error, counted), place)
    return shown


def _regions(drops: NDArray, standing: NDArray, ground: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the index into `REGIONS` of every pixel; what a drop covers is the drop's, whatever lies behind it."""
    covered = drops > _COVERED
    beside = covered
    if covered.any():
        beside = distance_transform_edt(~covered) <= _BESIDE_PX
    return np.select([covered, beside, standing > _STANDING, ground], range(4), 4)


def _kept(error: NDArray, counted: NDArray[np.bool_]) -> NDArray:
    return np.where(counted, error, np.nan)
