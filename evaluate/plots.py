"""The pictures of an evaluation: error maps with a scale, histograms, box plots, heat maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.files import replacing

from .flow_metrics import DFE_BOUNDS
from .reflectance_aware import HeatMap

Triple = tuple[float, float, float]
Curve = tuple[list[float], list[float], list[float], list[float]]
_BINS = np.linspace(0, 1.5, 61)


def jet(error: NDArray, largest: float) -> NDArray[np.uint8]:
    """Return an error map (H, W) [px] in the colours of the thesis's figures (4.8, 4.10): blue 0, red `largest`, black unknown.

    Raises
    ------
    InputError
        If `largest` is not positive.
    """
    check_range("largest", largest, "(0, inf)")
    known = np.isfinite(error)
    colours = colormaps["jet"](np.where(known, error, 0) / largest)[..., :3]
    return np.rint(255 * np.where(known[..., None], colours, 0)).astype(np.uint8)


def save_error_map(path: str | Path, error: NDArray, largest: float, title: str) -> None:
    """Write an error map with its colour bar."""
    height, width = error.shape
    # The bar and its labels take a ninth of the width.
    figure = Figure(figsize=(8, 7.1 * height / width + 0.4), layout="constrained")
    axes = figure.subplots()
    cmap = colormaps["jet"].with_extremes(bad="black")
    drawn = axes.imshow(np.ma.masked_invalid(error), cmap=cmap, vmin=0, vmax=largest, interpolation="nearest")
    figure.colorbar(drawn, ax=axes, label="px", extend="max", shrink=0.9, pad=0.01)
    axes.set_title(title, fontsize=9)
    axes.axis("off")
    _save(figure, path)


def save_difference_histogram(path: str | Path, errors: Mapping[str, NDArray], title: str) -> None:
    """Write the distribution of difference flow errors by name, with the thesis's classes marked (figures 4.6 to 4.11).

    Parameters
    ----------
    errors : mapping of name to (N,) float
        [px]; what exceeds 1.5 px is counted in the last bin.
    """
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    axes = figure.subplots()
    for name, values in errors.items():
        kept = values[np.isfinite(values)]
        counts, _ = np.histogram(np.minimum(kept, _BINS[-1]), _BINS)
        axes.stairs(100 * counts / max(counts.sum(), 1), _BINS, label=f"{name} (mean {kept.mean():.3f} px)" if len(kept) else name)
    for bound in DFE_BOUNDS:
        axes.axvline(bound, color="0.6", linewidth=0.8, linestyle=":")
    axes.set(
        xlabel="difference flow error [px] (last bin: all above)", ylabel="share of pixels [%]", title=title, xlim=(0, _BINS[-1])
    )
    axes.legend(fontsize=8)
    _save(figure, path)


def save_class_bars(path: str | Path, shares: Mapping[str, tuple[float, ...]], title: str) -> None:
    """Write the shares of the five classes of the difference flow error as stacked bars, one per name."""
    figure = Figure(figsize=(8, 1.6 + 0.32 * len(shares)), layout="constrained")
    axes = figure.subplots()
    labels = ("≤ 0.05", "≤ 0.2", "≤ 0.5", "< 1", "≥ 1 px")
    left = np.zeros(len(shares))
    colours = colormaps["viridis"](np.linspace(0.95, 0.05, 5))
    for i, label in enumerate(labels):
        width = np.array([100 * s[i] for s in shares.values()])
        axes.barh(list(shares), width, left=left, color=colours[i], label=label)
        left += width
    axes.invert_yaxis()
    axes.set(xlim=(0, 100), xlabel="share of pixels [%]", title=title)
    axes.tick_params(axis="y", labelsize=8)
    figure.legend(ncols=5, fontsize=8, loc="outside lower center")
    _save(figure, path)


def save_box_plot(path: str | Path, errors: Mapping[str, NDArray], title: str, label: str = "end-point error [px]") -> None:
    """Write box plots: median, quartiles, whiskers to 1.5 times their distance, and the mean as a triangle (figures 5.6, 5.7).

    Parameters
    ----------
    errors : mapping of name to (N,) float
        [px]; single outliers are not drawn.
    """
    figure = Figure(figsize=(1.6 + 0.75 * len(errors), 4), layout="constrained")
    axes = figure.subplots()
    box_plot(axes, errors)
    axes.set(title=title, ylabel=label)
    _save(figure, path)


def box_plot(axes: Axes, errors: Mapping[str, NDArray]) -> None:
    """Draw the boxes of `save_box_plot`."""
    values = [v[np.isfinite(v)] for v in errors.values()]
    axes.boxplot(values, tick_labels=list(errors), showfliers=False, showmeans=True, widths=0.6)
    axes.tick_params(axis="x", labelrotation=45, labelsize=8)
    axes.set_ylim(bottom=0)


class Box(NamedTuple):
    """What a box plot shows of a distribution [px]."""

    median: float
    low: float
    high: float
    low_end: float
    high_end: float
    mean: float


def save_boxes(path: str | Path, boxes: Mapping[str, Box], title: str, label: str = "end-point error [px]") -> None:
    """Write box plots as `save_box_plot`, of distributions that are known by their quantiles only."""
    figure = Figure(figsize=(1.6 + 0.75 * len(boxes), 4), layout="constrained")
    axes = figure.subplots()
    stats = [
        {"label": name, "med": b.median, "q1": b.low, "q3": b.high, "whislo": b.low_end, "whishi": b.high_end, "mean": b.mean}
        for name, b in boxes.items()
    ]
    axes.bxp(stats, showfliers=False, showmeans=True, widths=0.6)
    axes.tick_params(axis="x", labelrotation=45, labelsize=8)
    axes.set_ylim(bottom=0)
    axes.set(title=title, ylabel=label)
    _save(figure, path)


def save_heat_maps(path: str | Path, maps: Mapping[str, HeatMap], title: str, label: str) -> None:
    """Write heat maps side by side on one scale, each column normalised by its own count (figures 5.8, 5.9).

    Parameters
    ----------
    label : str
        Of the horizontal axis.
    """
    columns = min(len(maps), 4)
    rows = -(-len(maps) // columns)
    figure = Figure(figsize=(1.2 + 3.0 * columns, 0.8 + 2.6 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    shares = {name: map_.normalised() for name, map_ in maps.items()}
    top = max((np.nanmax(s) for s in shares.values() if np.isfinite(s).any()), default=1.0)
    drawn = None
    for axes in grid.flat[len(maps) :]:
        axes.axis("off")
    for axes, (name, map_) in zip(grid.flat, maps.items()):
        drawn = draw_heat_map(axes, map_, top)
        axes.set_title(f"{name}, {map_.counts.sum():.2g} vectors", fontsize=9)
    if drawn is not None:
        figure.colorbar(drawn, ax=grid, label="share of the column", shrink=0.8)
    figure.suptitle(title, fontsize=10)
    figure.supxlabel(label, fontsize=9)
    figure.supylabel("end-point error [px]", fontsize=9)
    _save(figure, path)


def draw_heat_map(axes: Axes, map_: HeatMap, top: float):
    """Draw one heat map with its intervals as ticks; `top` is the share at the end of the colour scale."""
    drawn = axes.imshow(map_.normalised(), origin="lower", aspect="auto", cmap="inferno", vmin=0, vmax=top, interpolation="nearest")
    edges = map_.error_edges
    ticks = np.arange(len(edges)) + 0.5
    step = max(1, len(map_.angle_edges) // 6)
    axes.set_xticks(np.arange(len(map_.angle_edges))[::step] - 0.5, [f"{a:.3g}" for a in map_.angle_edges[::step]], fontsize=7)
    axes.set_yticks(ticks, [f"{e:.3g}" for e in edges], fontsize=7)
    return drawn


def save_rise(path: str | Path, curves: Mapping[str, Mapping[str, Curve]], title: str) -> None:
    """Write errors over the strength of effects: one field per effect, one line with its interval per algorithm.

    Parameters
    ----------
    curves : mapping of effect to mapping of algorithm to (levels, errors, low, high)
        [px]; NaN where there is no interval.
    """
    figure = Figure(figsize=(1.0 + 2.8 * len(curves), 3.8), layout="constrained")
    grid = figure.subplots(1, len(curves), squeeze=False, sharey=True)[0]
    for axes, (effect, lines) in zip(grid, curves.items()):
        for i, (name, (level, error, low, high)) in enumerate(lines.items()):
            axes.plot(level, error, color=f"C{i}", marker="o", markersize=3, label=name)
            axes.fill_between(level, low, high, color=f"C{i}", alpha=0.15, linewidth=0)
        axes.set_title(effect, fontsize=9)
        axes.set_xlabel("level", fontsize=9)
        axes.grid(axis="y", linewidth=0.4)
    grid[0].set_ylim(bottom=0)
    grid[0].set_ylabel("end-point error [px]")
    _finish(figure, grid[0], title)
    _save(figure, path)


def save_changes(path: str | Path, bars: Mapping[str, Mapping[str, list[Triple]]], places: Sequence[str], title: str) -> None:
    """Write what effects add to the error at each place: one field per effect, one bar with its interval per algorithm.

    Parameters
    ----------
    bars : mapping of effect to mapping of algorithm to list of (value, low, high)
        [px], by place; NaN is not drawn.
    """
    figure = Figure(figsize=(1.0 + 2.8 * len(bars), 3.8), layout="constrained")
    grid = figure.subplots(1, len(bars), squeeze=False, sharey=True)[0]
    for axes, (effect, found) in zip(grid, bars.items()):
        width = 0.8 / len(found)
        for i, (name, values) in enumerate(found.items()):
            value, low, high = np.array(values, float).T
            x = np.arange(len(places)) + (i - (len(found) - 1) / 2) * width
            axes.bar(x, value, width, color=f"C{i}", label=name)
            axes.vlines(x, low, high, color="0.2", linewidth=0.8)
        axes.axhline(0, color="0.3", linewidth=0.8)
        axes.set_title(effect, fontsize=9)
        axes.set_xticks(range(len(places)), places, rotation=30, ha="right", fontsize=8)
        axes.set_xlim(-0.6, len(places) - 0.4)
        axes.grid(axis="y", linewidth=0.4)
    grid[0].set_ylabel("change of the end-point error [px]")
    _finish(figure, grid[0], title)
    _save(figure, path)


def _finish(figure: Figure, axes: Axes, title: str) -> None:
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, ncols=len(names), fontsize=8, loc="outside lower center")
    figure.suptitle(title, fontsize=10)


def _save(figure: Figure, path: str | Path) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=110)
