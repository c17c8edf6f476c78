"""The report on spectra under rising moisture: models of wet ground beside what was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from .foundation.errors import InputError
from .foundation.files import replacing
from .foundation.report import Cell, Report, Table
from .measured.measurement_file import Conditions
from .wetness_fit import MODELS, WetnessFit, fit_wetness, held_out, moisture_levels

_BLUE_NM, _GREEN_NM, _RED_NM = 470.0, 550.0, 650.0
_COLOURS = ("tab:red", "tab:blue", "tab:green")


def wetness_report(conditions: Conditions, name: str, folder: Path) -> Report:
    """Fit all models to spectra under moisture, draw the pictures into `folder`, and return the report.

    Raises
    ------
    InputError
        If a record lacks a wavelength, or a reflectance exceeds 1.
    """
    value = conditions.value
    if np.isnan(value).any():
        raise InputError("have all wavelengths at each condition", got="gaps", key=name)
    if (value > 1).any():
        raise InputError("be a reflectance in [0, 1]", got=float(value.max()), key="value")
    m, unit = conditions.condition, conditions.unit
    fits = [fit_wetness(m, value, model) for model in MODELS]
    rows: list[list[Cell]] = [[f.model, f.start, f.full, f.constant, f.rms, float(f.dry.mean())] for f in fits]
    head = ("model", f"start [{unit}]", f"full [{unit}]", "porosity or index", "rms", "dry reflectance, mean")
    note = (
        "The fourth number is the porosity of lagarde, the refractive index of the solid of the others. Of ground that was never "
        "seen dry, it and the start are not parted."
    )
    tables = [
        Table("fits", "Models fitted to all records", head, rows, note),
        Table(
            "held_out",
            "Levels of moisture that no fit saw",
            ("model", "rms", "rms of the wettest level's mean"),
            [[h.name, h.rms, h.wettest] for h in held_out(m, value)],
            "Every third of eight levels, the wettest among them, was left out. The mean and the polynomials are per wavelength.",
        ),
    ]
    _draw_darkening(folder / "darkening.png", conditions, fits)
    _draw_spectra(folder / "spectra.png", conditions, fits)
    pictures = {
        "Reflectance and hue against the condition: dots are records, black the mean of each level": folder / "darkening.png",
        "Spectra of the driest, a middling and the wettest level (dots) and of the models": folder / "spectra.png",
    }
    span = f"{conditions.name} {m.min():g} to {m.max():g} {unit}"
    words = [f"{name}: {len(m)} spectra at {len(conditions.wavelength_nm)} wavelengths, {span}."]
    return Report(f"Wet ground {name}", words, tables, pictures)


def _nearest(wavelength: np.ndarray, nm: float) -> int:
    return int(np.argmin(np.abs(wavelength - nm)))


def _draw_darkening(path: Path, c: Conditions, fits: list[WetnessFit]) -> None:
    blue, green, red = (_nearest(c.wavelength_nm, nm) for nm in (_BLUE_NM, _GREEN_NM, _RED_NM))
    level = moisture_levels(c.condition)
    figure = Figure(figsize=(11, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    at = np.linspace(c.condition.min(), c.condition.max(), 200)
    left.plot(c.condition, c.value[:, red], ".", color="0.75", markersize=3)
    right.plot(c.condition, c.value[:, red] / c.value[:, green], ".", color="0.75", markersize=3)
    means = [(c.condition[level == k].mean(), c.value[level == k].mean(axis=0)) for k in np.unique(level)]
    left.plot([x for x, _ in means], [v[red] for _, v in means], "ks", markersize=5)
    right.plot([x for x, _ in means], [v[red] / v[green] for _, v in means], "ks", markersize=5)
    for fit, colour in zip(fits, _COLOURS):
        predicted = fit.predict(at)
        left.plot(at, predicted[:, red], color=colour, label=fit.model)
        right.plot(at, predicted[:, red] / predicted[:, green], color=colour)
    names = [f"{c.wavelength_nm[k]:.0f} nm" for k in (blue, green, red)]
    left.set(xlabel=f"{c.name} [{c.unit}]", ylabel=f"reflectance at {names[2]}")
    right.set(xlabel=f"{c.name} [{c.unit}]", ylabel=f"reflectance at {names[2]} over {names[1]}")
    left.legend(fontsize=8)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=100)


def _draw_spectra(path: Path, c: Conditions, fits: list[WetnessFit]) -> None:
    level = moisture_levels(c.condition)
    figure = Figure(figsize=(11, 4), layout="constrained")
    grid = figure.subplots(1, 3, sharey=True)
    for axes, k in zip(grid, (0, 3, int(level.max()))):
        rows = level == k
        axes.plot(c.wavelength_nm, c.value[rows].mean(axis=0), "k.", markersize=3, label="measured")
        for fit, colour in zip(fits, _COLOURS):
            axes.plot(c.wavelength_nm, fit.predict(c.condition[rows]).mean(axis=0), color=colour, label=fit.model)
        title = f"{c.name} {c.condition[rows].min():.3g} to {c.condition[rows].max():.3g} {c.unit}"
        axes.set(xlabel="wavelength [nm]", title=title)
        axes.title.set_fontsize(9)
    grid[0].set_ylabel("reflectance")
    grid[0].set_ylim(bottom=0)
    grid[0].legend(fontsize=8)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=100)
