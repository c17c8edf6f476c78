"""Pictures of a diagnosed measurement: polar plots, residuals over angles or conditions, chi-square of held-out blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from materials.foundation.files import replacing

from .diagnose import MeasuredDiagnosis, Proof
from .judge import Model
from .locate import binned
from .samples import Samples

Floats = NDArray[np.float64]
_RANGE = 6.0
_DECADES = 4.0
BEFORE, AFTER = "tab:red", "tab:blue"


def draw(d: MeasuredDiagnosis, folder: Path) -> dict[str, Path]:
    """Draw what there is to see into a folder; return files by caption."""
    assert d.samples is not None and d.base is not None and d.best is not None
    s = d.samples
    out = {}
    if d.proof.rows:
        save(blocks_figure(d.proof), folder / "blocks.png")
        out["Chi-square of blocks that the fit did not see"] = folder / "blocks.png"
    if s.kind == "directions":
        save(_polar(s, d.base, d.best), folder / "polar.png")
        save(_over_angles(s, d.base, d.best), folder / "residuals.png")
        out["In and near the plane of incidence, mean of channels; the radius is logarithmic, the line the mirror direction"] = (
            folder / "polar.png"
        )
        out["Held-out residual over half and difference angle, in units of noise, ±6: red is measured brighter"] = (
            folder / "residuals.png"
        )
    else:
        save(_over_condition(s, d.base, d.best), folder / "condition.png")
        save(_residual_spectra(s, d.base, d.best), folder / "residuals.png")
        out[f"Reflectance against {s.condition_name} at three wavelengths; predictions are of records that the fit did not see"] = (
            folder / "condition.png"
        )
        out[f"Held-out residual over wavelength and {s.condition_name}, in units of noise, ±6: red is measured brighter"] = (
            folder / "residuals.png"
        )
    return out


def blocks_figure(proof: Proof) -> Figure:
    """Return bars of chi-square per held-out block."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    axes = figure.subplots()
    at = np.arange(len(proof.rows))
    axes.bar(at - 0.2, [r[1] for r in proof.rows], 0.4, color=BEFORE, label="as believed")
    axes.bar(at + 0.2, [r[2] for r in proof.rows], 0.4, color=AFTER, label="with what was found")
    axes.axhline(1, color="black", linewidth=0.8)
    axes.set_yscale("log")
    axes.set_ylabel("held-out chi-square a value")
    axes.set_xticks(at, [r[0] for r in proof.rows], fontsize=7, rotation=20)
    axes.legend(fontsize=8)
    return figure


def _polar(s: Samples, base: Model, best: Model) -> Figure:
    """Slices near the plane of incidence at up to three incidence angles."""
    theta = np.round(s.coordinates["incidence angle"], 1)
    angles = np.unique(theta)
    chosen = angles[np.unique(np.linspace(0, len(angles) - 1, 3).round().astype(int))]
    figure = Figure(figsize=(4.2 * len(chosen), 3.0), layout="constrained")
    grid = np.atleast_1d(figure.subplots(1, len(chosen), subplot_kw={"projection": "polar"}))
    azimuth = s.coordinates["azimuth between light and view"]
    for axes, angle in zip(grid, chosen):
        near = (theta == angle) & (np.minimum(azimuth, 180 - azimuth) < 16)
        side = np.where(azimuth > 90, 1.0, -1.0)
        place = np.radians(side * s.coordinates["viewing angle"])[near]
        order = np.argsort(place)
        values = [v[near].mean(axis=1)[order] for v in (s.value, base.unseen, best.unseen)]
        top = max(float(max((v.max() for v in values if v.size), default=1.0)), 1e-12)
        radii = [np.maximum(np.log10(np.maximum(v, 1e-30) / top) + _DECADES, 0) for v in values]
        axes.plot(place[order], radii[1], color=BEFORE, linewidth=1, label="as believed")
        axes.plot(place[order], radii[2], color=AFTER, linewidth=1, label="with what was found")
        axes.plot(place[order], radii[0], "k.", markersize=3, label="measured")
        axes.plot(np.radians([angle, angle]), [0, _DECADES], color="0.6", linewidth=0.8)
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
        axes.set_thetalim(-np.pi / 2, np.pi / 2)
        axes.set_rlim(0, _DECADES)
        # A word at every other decade: more would stand over one another.
        decades = np.arange(1, _DECADES + 1)
        axes.set_rticks(decades, [f"{top * 10 ** (k - _DECADES):.1g}" if k % 2 == 0 else "" for k in decades], fontsize=6)
        axes.set_title(f"incidence {angle:g}°", fontsize=9)
        axes.tick_params(labelsize=7)
    figure.legend(*grid[0].get_legend_handles_labels(), fontsize=8, ncols=3, loc="outside lower center")
    return figure


def _over_angles(s: Samples, base: Model, best: Model) -> Figure:
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    drawn = None
    for axes, model, title in zip(figure.subplots(1, 2, sharey=True), (base, best), ("as believed", "with what was found")):
        drawn = axes.scatter(s.coordinates["half angle"], s.coordinates["difference angle"], c=np.median(model.z, axis=1), s=7,
                             cmap="RdBu_r", vmin=-_RANGE, vmax=_RANGE)  # fmt: skip
        axes.set(xlabel="half angle [°]", title=title)
    figure.axes[0].set_ylabel("difference angle [°]")
    assert drawn is not None
    figure.colorbar(drawn, ax=figure.axes, label="residual [sigma]")
    return figure


def _over_condition(s: Samples, base: Model, best: Model) -> Figure:
    assert s.condition is not None
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    channels = np.unique(np.linspace(0, len(s.channels) - 1, 5)[1:-1].round().astype(int))
    order = np.argsort(s.condition)
    for axes, c in zip(np.atleast_1d(figure.subplots(1, len(channels))), channels):
        axes.plot(s.condition, s.value[:, c], "k.", markersize=2, label="measured")
        axes.plot(s.condition[order], base.unseen[order, c], color=BEFORE, label="as believed")
        axes.plot(s.condition[order], best.unseen[order, c], color=AFTER, label="with what was found")
        axes.set(title=s.channels[c], xlabel=f"{s.condition_name} [{s.condition_unit}]")
    figure.axes[0].set_ylabel("reflectance")
    figure.axes[0].legend(fontsize=7)
    return figure


def _residual_spectra(s: Samples, base: Model, best: Model) -> Figure:
    assert s.condition is not None
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    edges = np.unique(np.quantile(s.condition, np.linspace(0, 1, 25)))
    index = np.clip(np.searchsorted(edges, s.condition, "right") - 1, 0, max(len(edges) - 2, 0))
    nm = s.wavelength_nm
    assert nm is not None
    drawn = None
    for axes, model, title in zip(figure.subplots(1, 2, sharey=True), (base, best), ("as believed", "with what was found")):
        mean, _ = binned(model.z, index)
        drawn = axes.imshow(mean, origin="lower", aspect="auto", cmap="RdBu_r", vmin=-_RANGE, vmax=_RANGE,
                            extent=(nm[0], nm[-1] + 1e-9, 0, len(mean)))  # fmt: skip
        ticks = np.linspace(0, len(edges) - 1, 5).round().astype(int)
        axes.set_yticks(ticks, [f"{edges[t]:.3g}" for t in ticks])
        axes.set(xlabel="wavelength [nm]", title=title)
    figure.axes[0].set_ylabel(f"{s.condition_name} [{s.condition_unit}]")
    assert drawn is not None
    figure.colorbar(drawn, ax=figure.axes, label="residual [sigma]")
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure; where it is, it is whole."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=100)
