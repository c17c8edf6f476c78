"""What `material-fit` leaves behind beside the textures: numbers in words and tables, and pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .abrdf import ABRDF
from .brdf_errors import MEASURES, brdf_errors
from .fit import FitSettings
from .fit_pictures import save_half_angle_plots, save_patches, save_polar, save_residuals, save_spheres, save_textures
from .fit_run import FitResult
from .foundation.report import Cell, Report, Table
from .measured.source import Source

Floats = NDArray[np.float64]
_SAMPLED = 64


def fit_report(source: Source, result: FitResult, settings: FitSettings, folder: Path) -> Report:
    """Draw the pictures into `folder` and return the report."""
    material = result.material
    some = np.unique(np.linspace(0, source.num_texels - 1, min(_SAMPLED, source.num_texels)).astype(int))
    some = some[np.isfinite(material.cost[some])]
    sampled = _gather(source, some)
    pictures: dict[str, Path] = {}
    single = source.num_texels == 1
    if single:
        pictures["Spheres of the measured and of the fitted reflectance"] = folder / "spheres.png"
        save_spheres(folder / "spheres.png", sampled, material)
    else:
        pictures["The surface as measured and as fitted"] = folder / "patches.png"
        save_patches(folder / "patches.png", material, _views(source))
        pictures["Parameters, normals and cost"] = folder / "textures.png"
        save_textures(folder / "textures.png", material)
    order = np.argsort(material.cost[some])
    quantiles = [0] if single else sorted({int(order[int(q * (len(order) - 1))]) for q in (0.1, 0.5, 0.9)})
    named = [("" if single else f"texel {some[q]}, ", int(some[q])) for q in quantiles]
    few = replace(sampled, value=sampled.value[quantiles], valid=sampled.valid[quantiles])
    if source.photographs is not None:
        pictures["Reflectance against the half angle, of texels with low, middling and high cost"] = folder / "lobes.png"
        save_half_angle_plots(folder / "lobes.png", few, material, named)
    else:
        pictures["Lobes in the plane of incidence"] = folder / "lobes.png"
        save_polar(folder / "lobes.png", few, material, named)
    pictures["Where in half and difference angle the fit errs"] = folder / "residuals.png"
    save_residuals(folder / "residuals.png", sampled, material, some.tolist())
    tables = [_quality(result), _errors(sampled, result, settings, some), _parameters(result)]
    if result.normal_error_deg:
        rows: list[list[Cell]] = [[name, error] for name, error in result.normal_error_deg.items()]
        tables.append(Table("normals", "Mean angle to the measured normals", ("estimate", "deg"), rows))
    words = [
        f"{source.name} ({source.kind}): {source.num_texels} texels, model {settings.model}, {settings.lobes} "
        f"lobe{'s' if settings.lobes > 1 else ''} over {'Lambert' if settings.base == 'lambert' else 'Oren and Nayar'}, "
        f"{'two steps within bounds' if settings.constrained else 'free'}"
        f"{', normals estimated' if settings.normals or source.photographs else ''}.",
        *source.notes,
    ]
    if material.unit == "relative":
        words.append("The scale of the data is not known: albedo and specular scales share one unknown factor.")
    definitions = {
        "cost": "mean over samples and channels of log(1 + s / 4), s the squared residual times cos θi cos θo (eqs. 5.2, 5.3.2)",
        "relative variance": "mean squared weighted residual over mean squared weighted reflectance",
        **MEASURES,
    }
    return Report(f"Material {source.name}", words, tables, pictures, definitions)


def _gather(source: Source, texels: NDArray) -> ABRDF:
    """Return some texels of a source as one ABRDF."""
    blocks = [source.block(int(t), int(t) + 1) for t in texels]
    return replace(blocks[0], value=np.concatenate([b.value for b in blocks]), valid=np.concatenate([b.valid for b in blocks]))


def _views(source: Source) -> list[tuple[str, Floats, Floats, Floats]]:
    """Return three pictures of the surface: samples whose light comes from above, from half-way and from low."""
    first = source.block(0, 1)
    theta_i = np.degrees(np.arccos(np.clip(first.wi[:, 2], -1, 1)))
    view = np.degrees(np.arccos(np.clip(first.wo[:, 2], -1, 1)))
    chosen = []
    for light, seen in ((10, 10), (35, 25), (50, 50)):
        away = np.hypot(theta_i - light, view - seen)
        away[chosen] = np.inf
        chosen.append(int(np.argmin(away)))
    step = 1024
    parts = [source.block(at, min(at + step, source.num_texels)).value[:, chosen] for at in range(0, source.num_texels, step)]
    values = np.concatenate(parts).astype(np.float64)
    return [
        (f"light {theta_i[s]:.0f}°, view {view[s]:.0f}°", first.wi[s], first.wo[s], values[:, k] * first.wi[s, 2])
        for k, s in enumerate(chosen)
    ]


def _quality(result: FitResult) -> Table:
    rows: list[list[Cell]] = []
    for name, values in (("cost", result.material.cost), ("relative variance", result.material.relative_variance)):
        known = values[np.isfinite(values)]
        rows.append([name, float(known.mean()), *(float(v) for v in np.percentile(known, (10, 50, 90))), float(known.max())])
    note = (
        f"{result.failed} of {len(result.material.cost)} texels had too few valid samples and stay black." if result.failed else ""
    )
    return Table("quality", "How well the texels are met", ("", "mean", "10 %", "median", "90 %", "largest"), rows, note)


def _errors(sampled: ABRDF, result: FitResult, settings: FitSettings, some: NDArray) -> Table:
    """Return the errors of the field within the angles of the fit, and beyond them, where nothing was fitted."""
    full = settings.full_angle_deg if settings.constrained else settings.free_angle_deg
    low = np.cos(np.radians(full))
    within = (sampled.wi[:, 2] > low) & (sampled.wo[:, 2] > low)
    measured_at = np.minimum(sampled.wi[:, 2], sampled.wo[:, 2]) > np.cos(np.radians(85))
    rows: list[list[Cell]] = []
    for name, region in ((f"fitted, both below {full:g}°", within), (f"held out, {full:g} to 85°", ~within & measured_at)):
        fitted, measured, cos_i, weight = [], [], [], []
        for row, texel in enumerate(some):
            use = sampled.valid[row] & region
            reflected = result.material.reflect(sampled.wi[use], sampled.wo[use], np.full(int(use.sum()), texel))
            cos_i.append(sampled.wi[use, 2])
            fitted.append(reflected / sampled.wi[use, 2:])
            measured.append(sampled.value[row, use])
            weight.append(sampled.weight[use])
        if sum(map(len, cos_i)):
            errors = brdf_errors(*(np.concatenate(part) for part in (fitted, measured, cos_i, weight)))
            rows.append([name, sum(map(len, cos_i)), *errors.values()])
    note = f"Over {len(some)} texels spread evenly." if len(result.material.cost) > len(some) else ""
    return Table("errors", "Errors by angle", ("elevations", "samples", *MEASURES), rows, note)


def _parameters(result: FitResult) -> Table:
    """Return medians over the texels; of a single one its values, with standard deviations."""
    material, single = result.material, len(result.material.cost) == 1
    good = np.isfinite(material.cost)
    names = [f"diffuse {c}" for c in "RGB"]
    columns = [material.diffuse[good]]
    for k in range(material.lobes):
        names += [f"specular {k + 1} {c}" for c in "RGB"]
        columns.append(material.specular[good, k])
    for k in range(material.lobes):
        names += [f"alpha {k + 1} u", f"alpha {k + 1} v"]
        columns.append(material.alpha[good, k])
    if material.sigma is not None:
        names.append("sigma [rad]")
        columns.append(material.sigma[good, None])
    values, sigma = np.concatenate(columns, axis=1), result.sigma[good]
    rows: list[list[Cell]] = []
    for p, name in enumerate(names):
        spread = [] if single else [float(v) for v in np.percentile(values[:, p], (10, 90))]
        deviation = float(np.median(sigma[:, p]))
        rows.append([name, float(np.median(values[:, p])), *spread, deviation if deviation > 0 else None])
    head = ("", "value", "standard deviation") if single else ("", "median", "10 %", "90 %", "standard deviation (median)")
    return Table("parameters", "Parameters", head, rows, "A dash: held, or at a bound.")
