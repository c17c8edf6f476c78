"""Pictures of diagnosed photometric stereo: a photograph that the fit did not see, and the error of normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from materials.photometric_stereo import angular_error_deg

from .diagnose import MeasuredDiagnosis
from .photographs import Stereo, StereoModel
from .pictures import AFTER, BEFORE, blocks_figure, save

Floats = NDArray[np.float64]


def draw_stereo(d: MeasuredDiagnosis, folder: Path) -> dict[str, Path]:
    """Draw what there is to see into a folder; return files by caption."""
    stereo, base, best = d.extra["stereo"]
    save(_held_out(stereo, base, best), folder / "photograph.png")
    save(blocks_figure(d.proof), folder / "blocks.png")
    out = {
        "The held-out photograph whose prediction changed most; residuals over its brightest tenth": folder / "photograph.png",
        "Chi-square of lights that the fit did not see": folder / "blocks.png",
    }
    if stereo.truth is not None:
        save(_normals(stereo, base, best), folder / "normals.png")
        out["Angle between fitted and measured normals; no fit was given the measured ones"] = folder / "normals.png"
    return out


def _held_out(stereo: Stereo, base: StereoModel, best: StereoModel) -> Figure:
    change = np.abs(best.unseen - base.unseen).sum(axis=1)
    j = int(np.argmax(change))
    measured, before, after = stereo.samples.value[j], base.unseen[j], best.unseen[j]
    top = float(np.quantile(measured, 0.98)) or 1.0
    bright = float(measured[measured >= np.quantile(measured, 0.9)].mean()) or 1.0
    figure = Figure(figsize=(12, 2.9), layout="constrained")
    grid = figure.subplots(1, 5)
    for axes, values, title in zip(
        grid, (measured, before, after), (f"measured, light {j + 1}", "as believed", "with what was found")
    ):
        axes.imshow(_placed(stereo, values), cmap="gray", vmin=0, vmax=top)
        axes.set_title(title, fontsize=9)
    drawn = None
    for axes, values, title in zip(grid[3:], (before, after), ("residual as believed", "residual after")):
        drawn = axes.imshow(_placed(stereo, (measured - values) / bright), cmap="RdBu_r", vmin=-0.3, vmax=0.3)
        axes.set_title(title, fontsize=9)
    assert drawn is not None
    figure.colorbar(drawn, ax=grid[3:], shrink=0.8)
    for axes in grid:
        axes.axis("off")
    return figure


def _normals(stereo: Stereo, base: StereoModel, best: StereoModel) -> Figure:
    assert stereo.truth is not None
    figure = Figure(figsize=(11, 3.2), layout="constrained")
    grid = figure.subplots(1, 3)
    drawn = None
    errors = [angular_error_deg(m.fit.normal, stereo.truth) for m in (base, best)]
    for axes, error, title in zip(grid, errors, ("as believed", "with what was found")):
        drawn = axes.imshow(_placed(stereo, error), cmap="inferno", vmin=0, vmax=15)
        axes.set_title(f"{title}: mean {error.mean():.2f}°", fontsize=9)
        axes.axis("off")
    assert drawn is not None
    figure.colorbar(drawn, ax=grid[:2], label="angular error [°]", shrink=0.8)
    edges = np.linspace(0, 20, 41)
    for error, colour, label in zip(errors, (BEFORE, AFTER), ("as believed", "with what was found")):
        counts, _ = np.histogram(np.minimum(error, 20), edges)
        grid[2].stairs(np.cumsum(counts) / len(error), edges, color=colour, label=label)
    grid[2].set(xlabel="angular error [°]", ylabel="share of pixels below", xlim=(0, 20), ylim=(0, 1))
    grid[2].legend(fontsize=8)
    return figure


def _placed(stereo: Stereo, values: Floats) -> Floats:
    out = np.full(stereo.mask.shape, np.nan)
    out[stereo.mask] = values
    return out
