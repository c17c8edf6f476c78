"""Tables, words and pictures of the experiment `reflectance-fields`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transport.contact_sheet import contact_sheet

from ..flow_metrics import DFE_CLASSES, difference_of
from ..images import ssim_picture
from ..plots import jet, save_class_bars, save_difference_histogram
from ..report import Report, Table
from .conclusions import Verdict
from .settings import ReflectanceFieldsSettings

REAL = "real"
# Picture; SSIM map and difference flow error of the first pair against the real one.
Shown = dict[str, tuple[NDArray, NDArray | None, NDArray | None]]
_DRAWS = 2000
_FEWEST = 4  # pairs, below which drawing them again tells nothing


@dataclass
class Differences:
    """How pictures and flow fields differ from the real ones.

    Attributes
    ----------
    likeness : dict
        By object, view and look: mean SSIM of each frame.
    flow : dict
        By object, view, look and algorithm: difference flow errors (N,) of each pair [px].
    """

    likeness: dict[tuple[str, str, str], list[float]] = field(default_factory=dict)
    flow: dict[tuple[str, str, str, str], list[NDArray]] = field(default_factory=dict)


@dataclass(frozen=True)
class Field:
    """A measured reflectance field: of which object, atlas size, bytes, loss of compression, seconds in the dome."""

    name: str
    size: int
    num_bytes: int
    relative_error: float
    seconds: float


def report(
    settings: ReflectanceFieldsSettings,
    differences: Differences,
    fields: Sequence[Field],
    shown: dict[tuple[str, str], Shown],
    folder: Path,
) -> Report:
    """Return the report; pictures go below `folder`."""
    rng = np.random.default_rng([settings.seed, 4])
    tables = [
        _conclusions(settings, differences, rng),
        _flow(settings, differences, rng),
        _likeness(differences, rng),
        _fields(fields),
    ]
    paragraphs = [
        f"{settings.frames} frames of {settings.width} x {settings.width} pixels, one degree apart, {settings.samples} paths per "
        f"pixel, {settings.bounces} scattering events, {settings.lamps} lamps, seed {settings.seed}; fields under "
        f"{settings.directions} x {settings.directions} directions, paths each: {settings.dome_samples}, {settings.rank} factors. "
        f"Real lamps are off by {settings.light_error_deg:g} degrees, real pictures by {settings.camera_error_px:g} px. "
        "The thesis: 11 frames, 512 paths, 151 x 151 directions, atlases of 1600 to 3072 texels, a brass donkey, a clay pyramid.",
        "Everything is over the pixels that see the real object. Intervals are at 95 %, from drawing the pairs of frames again: "
        "they tell of other degrees of the same turn, not of other objects.",
    ]
    definitions = {
        "dfe": "difference flow error |(u, v) - (u_real, v_real)| [px], of flow fields of rendered and real pictures (eq 4.1)",
        **{f"class_{i + 1}": text for i, text in enumerate(DFE_CLASSES)},
        "ssim": "mean structural similarity of the pictures on the sRGB curve, white at 1",
    }
    return Report(
        "Is a measured reflectance field real enough for optical flow?",
        paragraphs,
        tables,
        _draw(settings, differences, shown, folder / "pictures"),
        definitions,
    )


def _conclusions(settings: ReflectanceFieldsSettings, differences: Differences, rng: np.random.Generator) -> Table:
    """Return what the thesis found in tables 4.2 and 4.3, as ratios of mean errors, and whether it holds."""
    rows: list[list] = []
    large = max(settings.texels)
    for name, view in dict.fromkeys((k[0], k[1]) for k in differences.flow):
        for a in settings.algorithms:
            pairs = {look: differences.flow[name, view, look, a] for look in (f"BTF {large}", f"TEX {large}")}
            ratio = _ratio(pairs[f"BTF {large}"], pairs[f"TEX {large}"], rng)
            if name == "pyramid":
                text, within = "fields and textures do alike: the error changes by less than a fifth", (0.8, 1.25)
            else:
                text, within = "fields do better than textures", (0.0, 1.0)
            rows.append(_row(f"{name}, {view}: {text}", a, "dfe of BTF / TEX", ratio, within))
            if len(settings.texels) > 1 and name == "figure" and view == "frontal":
                ratio = _ratio(pairs[f"BTF {large}"], differences.flow[name, view, f"BTF {min(settings.texels)}", a], rng)
                text = "a finer atlas does better"
                rows.append(_row(f"{name}, {view}: {text}", a, "dfe of BTF fine / coarse", ratio, (0.0, 1.0)))
    columns = ("the thesis finds", "algorithm", "measure", "here", "low", "high", "verdict")
    return Table("conclusions", "What the thesis finds, and what holds here", columns, rows)


def _row(text: str, algorithm: str, measure: str, ratio: tuple[float, float, float], within: tuple[float, float]) -> list:
    return [text, algorithm, measure, *ratio, Verdict(text, algorithm, measure, "", *ratio, within).word]


def _flow(settings: ReflectanceFieldsSettings, differences: Differences, rng: np.random.Generator) -> Table:
    rows: list[list] = []
    best = {}
    for (name, view, look, a), pairs in differences.flow.items():
        mean = float(np.concatenate(pairs).mean())
        key = (name, view, a)
        best[key] = min(best.get(key, (np.inf, "")), (mean, look))
    for (name, view, look, a), pairs in differences.flow.items():
        d, (low, high) = difference_of(np.concatenate(pairs)), _interval(pairs, rng)
        mark = "best" if best[name, view, a][1] == look else ""
        rows.append([name, view, a, look, d.pixels, d.mean, low, high, d.sd, d.median, *d.classes, mark])
    rows.sort(key=lambda r: (settings.objects.index(r[0]), settings.views.index(r[1]), settings.algorithms.index(r[2])))
    columns = ("object", "view", "algorithm", "model", "pixels", "dfe", "low", "high", "dfe_sd", "median")
    classes = tuple(f"class_{i + 1}" for i in range(len(DFE_CLASSES)))
    return Table("flow", "Difference flow errors [px] (tables 4.2 and 4.3)", (*columns, *classes, "of its row"), rows)


def _likeness(differences: Differences, rng: np.random.Generator) -> Table:
    rows = []
    for (name, view, look), means in differences.likeness.items():
        low, high = _interval([np.array([m]) for m in means], rng)
        rows.append([name, view, look, float(np.mean(means)), low, high])
    return Table("likeness", "Structural similarity to the real pictures", ("object", "view", "model", "ssim", "low", "high"), rows)


def _fields(fields: Sequence[Field]) -> Table:
    rows = [[f.name, f.size, f.num_bytes / 2**20, f.relative_error, f.seconds, 1e6 * f.seconds / f.size**2] for f in fields]
    columns = ("object", "texels each way", "MiB", "relative_error", "seconds", "µs a texel")
    note = "The relative error has the noise of the dome's paths in it, which compression leaves out. Seconds are of this machine."
    return Table("fields", "The reflectance fields (table 4.1)", columns, rows, note)


def _interval(pairs: Sequence[NDArray], rng: np.random.Generator) -> tuple[float, float]:
    """Return the interval at 95 % of the mean over all values, pairs being drawn again."""
    sums = np.array([[p.size, p.sum(dtype=np.float64)] for p in pairs])
    if len(sums) < _FEWEST:
        return float("nan"), float("nan")
    drawn = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), _DRAWS) @ sums
    low, high = np.quantile(drawn[:, 1] / drawn[:, 0], (0.025, 0.975))
    return float(low), float(high)


def _ratio(above: Sequence[NDArray], below: Sequence[NDArray], rng: np.random.Generator) -> tuple[float, float, float]:
    """Return (ratio of the mean errors, and its interval) over the same pixels, pairs being drawn again together."""
    sums = np.array([[a.sum(dtype=np.float64), b.sum(dtype=np.float64)] for a, b in zip(above, below, strict=True)])
    value = float(sums[:, 0].sum() / sums[:, 1].sum())
    if len(sums) < _FEWEST:
        return value, float("nan"), float("nan")
    drawn = rng.multinomial(len(sums), np.full(len(sums), 1 / len(sums)), _DRAWS) @ sums
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], (0.025, 0.975))
    return value, float(low), float(high)


def _draw(
    settings: ReflectanceFieldsSettings, differences: Differences, shown: dict[tuple[str, str], Shown], folder: Path
) -> dict[str, Path]:
    pictures: dict[str, Path] = {}
    for (name, view), looks in shown.items():
        names = ", ".join(looks)
        rendered = {k: v for k, v in looks.items() if v[1] is not None}
        known = np.concatenate([e[np.isfinite(e)] for _, _, e in rendered.values() if e is not None])
        red = max(float(np.quantile(known, 0.98)), 1e-3)
        blank = np.full(looks[REAL][0].shape[:2], 255, np.uint8)
        likeness = [ssim_picture(m) for _, m, _ in rendered.values() if m is not None]
        errors = [jet(e, red) for _, _, e in rendered.values() if e is not None]
        algorithm = settings.algorithms[min(1, len(settings.algorithms) - 1)]
        rows = [
            (f"{name}, {view}: {names}", [p for p, _, _ in looks.values()]),
            ("SSIM against the real picture, black is alike", [blank, *likeness]),
            (f"difference flow error of {algorithm}, red {red:.2g} px", [np.repeat(blank[..., None], 3, axis=2), *errors]),
        ]
        path = folder / f"{name}_{view}.png"
        contact_sheet(rows, path, 256)
        pictures[f"{name}, {view}: pictures, structure, flow (figures 4.3 to 4.5, 4.8, 4.10, 4.12)"] = path
        for a in settings.algorithms:
            path = folder / f"{name}_{view}_{a}.png"
            every = {look: np.concatenate(differences.flow[name, view, look, a]) for look in rendered}
            save_difference_histogram(path, every, f"{name}, {view}, {a}")
            pictures[f"Distribution of difference flow errors, {name}, {view}, {a} (figures 4.6, 4.7, 4.9, 4.11)"] = path
    path = folder / "classes.png"
    shares = {" ".join(k): difference_of(np.concatenate(pairs)).classes for k, pairs in differences.flow.items()}
    save_class_bars(path, shares, "Classes of the difference flow error")
    return pictures | {"Classes of the difference flow error": path}
