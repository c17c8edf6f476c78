"""Pictures of a fit: what was measured beside what the model says, lobes, residuals over angles, textures, cost."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from .abrdf import ABRDF
from .foundation.files import replacing
from .measured.half_angles import half_angles
from .svbrdf import SVBRDF

Floats = NDArray[np.float64]
_ANGLES_DEG = (15, 30, 45, 60)


def save_spheres(path: Path, abrdf: ABRDF, material: SVBRDF, size: int = 220) -> None:
    """Write a sphere of one measured BRDF and of its fit under one light, and their difference.

    Between samples the measured one is interpolated from the four nearest: in half and difference angles if it is isotropic.
    """
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j]
    inside = x**2 + y**2 < 0.98
    n = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)[inside]
    tangent = np.cross((0.0, 1.0, 0.0), n)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([tangent, np.cross(n, tangent), n], axis=-1)
    rows = []
    for light_deg in (35, 70):
        light = np.array(
            [-math.sin(math.radians(light_deg)) * 0.8, math.sin(math.radians(light_deg)) * 0.6, math.cos(math.radians(light_deg))]
        )
        wi, wo = np.einsum("nab,a->nb", frame, light), frame[:, 2, :]
        seen = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
        measured, fitted = np.zeros((len(n), 3)), np.zeros((len(n), 3))
        measured[seen] = _between_samples(abrdf, wi[seen], wo[seen]) * wi[seen, 2:]
        fitted[seen] = material.reflect(wi[seen], wo[seen], np.zeros(int(seen.sum()), np.int64))
        rows.append(
            [(f"{name}, light at {light_deg}°", _placed(v, inside)) for name, v in (("measured", measured), ("fitted", fitted))]
        )
    _side_by_side(path, rows)


def save_patches(path: Path, material: SVBRDF, shown: list[tuple[str, Floats, Floats, Floats]]) -> None:
    """Write measured pictures beside those that the fit gives under the same light and view, and their difference.

    Parameters
    ----------
    shown : list of (title, wi (3,), wo (3,), measured (T, 3))
        `measured` has the cosine in, as a camera sees it.
    """
    rows = []
    for title, wi, wo, measured in shown:
        fitted = material.reflect(wi, wo)
        rows.append([(f"{title}: {name}", material.picture(v)) for name, v in (("measured", measured), ("fitted", fitted))])
    _side_by_side(path, rows)


def save_polar(path: Path, abrdf: ABRDF, material: SVBRDF, texels: list[tuple[str, int]]) -> None:
    """Write lobes in the plane of incidence: dots are samples within 8 degrees of it, lines the fit; mean of the channels.

    Parameters
    ----------
    abrdf : ABRDF
        With as many texels as are named.
    texels : list of (title, index into the material)
    """
    columns = len(_ANGLES_DEG)
    figure = Figure(figsize=(3.4 * columns, 3.0 * len(texels)), layout="constrained")
    grid = figure.subplots(len(texels), columns, squeeze=False, subplot_kw={"projection": "polar"})
    theta_i = np.degrees(np.arccos(np.clip(abrdf.wi[:, 2], -1, 1)))
    for row, (title, texel) in enumerate(texels):
        for column, target in enumerate(_ANGLES_DEG):
            axes = grid[row, column]
            angle, near = _incidence(abrdf, theta_i, target)
            if not near.any():
                axes.set_axis_off()
                continue
            wi = abrdf.wi[near][0] if not abrdf.isotropic else _tilted(angle)
            signed = _in_plane(abrdf.wi[near], abrdf.wo[near])
            keep = np.isfinite(signed) & abrdf.valid[row, near]
            axes.plot(signed[keep], abrdf.value[row, near][keep].mean(axis=-1), ".", color="0.45", markersize=5, label="measured")
            at = np.radians(np.linspace(-85, 85, 341))
            across = np.array([wi[0], wi[1], 0.0])
            across = across / max(np.linalg.norm(across), 1e-9) if wi[2] < 1 - 1e-9 else np.array([1.0, 0, 0])
            wo = np.cos(at)[:, None] * (0, 0, 1.0) - np.sin(at)[:, None] * across
            fit = material.reflect(wi, wo, np.full(len(at), texel)) / wi[2]
            axes.plot(at, fit.mean(axis=-1), color="tab:red", linewidth=1.2, label="fitted")
            axes.axvline(-math.radians(angle), color="tab:orange", linewidth=0.8)
            axes.set_theta_zero_location("N")
            axes.set_theta_direction(-1)
            axes.set_thetalim(-math.pi / 2, math.pi / 2)
            axes.tick_params(labelsize=7)
            axes.yaxis.set_major_locator(MaxNLocator(4))
            axes.set_title(f"{title}light at {angle:.0f}°", fontsize=9)
    grid[0, 0].legend(fontsize=7, loc="lower center")
    _save(figure, path)


def save_half_angle_plots(path: Path, abrdf: ABRDF, material: SVBRDF, texels: list[tuple[str, int]]) -> None:
    """Write reflectance against the half angle from the fitted normal, for data with one view; mean of the channels."""
    figure = Figure(figsize=(3.4 * len(texels), 3.0), layout="constrained")
    grid = figure.subplots(1, len(texels), squeeze=False)
    for row, (title, texel) in enumerate(texels):
        local_i, local_o = abrdf.wi @ material.frame[texel], abrdf.wo @ material.frame[texel]
        angle = np.degrees(half_angles(local_i, local_o)[0])
        fit = material.reflect(abrdf.wi, abrdf.wo, np.full(len(angle), texel)) / np.maximum(abrdf.wi[:, 2:], 1e-3)
        axes = grid[0, row]
        keep = abrdf.valid[row] & (local_i[:, 2] > 0)
        axes.plot(angle[keep], abrdf.value[row, keep].mean(axis=-1), ".", color="0.45", label="measured")
        axes.plot(angle[keep], fit[keep].mean(axis=-1), "x", color="tab:red", markersize=4, label="fitted")
        axes.set(title=title.rstrip(", "), xlabel="half angle [deg]", ylabel="f", yscale="log")
        axes.title.set_fontsize(9)
    grid[0, 0].legend(fontsize=7)
    _save(figure, path)


def save_residuals(path: Path, abrdf: ABRDF, material: SVBRDF, texels: list[int]) -> None:
    """Write the cosine-weighted residual, relative to the weighted reflectance, by half and difference angle."""
    edges = np.linspace(0, 90, 31)
    total, level, count = (np.zeros((30, 30)) for _ in range(3))
    for row, texel in enumerate(texels):
        frame = material.frame[texel]
        local_i, local_o = abrdf.wi @ frame, abrdf.wo @ frame
        keep = abrdf.valid[row] & (local_i[:, 2] > 0) & (local_o[:, 2] > 0) & (abrdf.wi[:, 2] > 1e-3)
        theta_h, theta_d, _ = half_angles(local_i[keep], local_o[keep])
        f = abrdf.value[row, keep].astype(np.float64) * abrdf.wi[keep, 2:]
        fit = material.reflect(abrdf.wi[keep], abrdf.wo[keep], np.full(int(keep.sum()), texel))
        at = (np.degrees(theta_h), np.degrees(theta_d))
        for into, values in ((total, (fit - f).mean(axis=1)), (level, f.mean(axis=1)), (count, np.ones(len(f)))):
            into += np.histogram2d(*at, bins=(edges, edges), weights=values)[0]
    figure = Figure(figsize=(6.2, 4.6), layout="constrained")
    axes = figure.subplots()
    shown = np.ma.masked_where(count == 0, total / np.maximum(level, 1e-12))
    drawn = axes.pcolormesh(edges, edges, shown.T, cmap="RdBu_r", vmin=-0.5, vmax=0.5)
    axes.set(xlabel="half angle [deg]", ylabel="difference angle [deg]", title="(fitted − measured) / measured, cosine-weighted")
    figure.colorbar(drawn, ax=axes, extend="both")
    _save(figure, path)


def save_textures(path: Path, material: SVBRDF) -> None:
    """Write the parameters and the cost as pictures."""
    shown: list[tuple[str, NDArray, str | None]] = [("albedo", _display(material.picture(material.diffuse)), None)]
    for k in range(material.lobes):
        shown.append((f"specular scale {k + 1}", _display(material.picture(material.specular[:, k])), None))
        shown.append((f"width {k + 1} (mean)", material.picture(material.alpha[:, k].mean(axis=-1), np.nan), "viridis"))
    if material.sigma is not None:
        shown.append(("sigma [rad]", material.picture(material.sigma, np.nan), "viridis"))
    normal = material.picture(material.normal)
    shown.append(("normal", np.where(material.mask[..., None], 0.5 + 0.5 * normal, 0), None))
    shown.append(("log10 cost", np.log10(np.maximum(material.picture(material.cost, np.nan), 1e-12)), "inferno"))
    columns = 4
    rows = -(-len(shown) // columns)
    height, width = material.mask.shape
    figure = Figure(figsize=(13, rows * (0.4 + 3.0 * min(max(height / width, 0.3), 2.0))), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for axes, (title, values, cmap) in zip(grid.flat, shown):
        finite = values[np.isfinite(values)]
        low, high = np.percentile(finite, (1, 99)) if cmap and len(finite) else (0.0, 1.0)
        drawn = axes.imshow(values, cmap=cmap, vmin=low, vmax=max(high, low + 1e-3), interpolation="nearest")
        axes.set_title(title, fontsize=9)
        if cmap:
            figure.colorbar(drawn, ax=axes, shrink=0.7)
    _save(figure, path)


def _between_samples(abrdf: ABRDF, wi: Floats, wo: Floats) -> Floats:
    """Return the first texel's reflectance from the four nearest samples."""
    from scipy.spatial import cKDTree

    use = np.flatnonzero(abrdf.valid[0])
    known, wanted = (_place(abrdf, a, b) for a, b in ((abrdf.wi[use], abrdf.wo[use]), (wi, wo)))
    distance, index = cKDTree(known).query(wanted, k=min(4, len(use)))
    weight = 1 / np.maximum(np.asarray(distance).reshape(len(wanted), -1), 1e-6) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    values = abrdf.value[0, use].astype(np.float64)
    return np.einsum("qk,qkc->qc", weight, values[np.asarray(index).reshape(len(wanted), -1)])


def _place(abrdf: ABRDF, wi: Floats, wo: Floats) -> Floats:
    if not abrdf.isotropic:
        return np.concatenate([wi, wo], axis=1)
    theta_h, theta_d, phi_d = half_angles(wi, wo)
    # The root spreads the highlight; reciprocity and the mirror symmetry of isotropic surfaces fold the azimuth.
    folded = np.arccos(np.clip(np.abs(np.cos(phi_d)), 0, 1))
    return np.stack([np.sqrt(theta_h), 0.7 * theta_d, 0.4 * folded * np.sin(theta_d) * np.sin(theta_h)], axis=1)


def _incidence(abrdf: ABRDF, theta_i: Floats, target: float) -> tuple[float, NDArray[np.bool_]]:
    """Return an angle of incidence near the wanted one that was measured, and its samples: of one light unless isotropic."""
    nearest = int(np.argmin(np.abs(theta_i - target)))
    if abs(theta_i[nearest] - target) > 8:
        return target, np.zeros(len(theta_i), bool)
    if abrdf.isotropic:
        return float(theta_i[nearest]), np.abs(theta_i - theta_i[nearest]) < 2
    return float(theta_i[nearest]), np.linalg.norm(abrdf.wi - abrdf.wi[nearest], axis=1) < 1e-6


def _tilted(angle_deg: float) -> Floats:
    return np.array([math.sin(math.radians(angle_deg)), 0.0, math.cos(math.radians(angle_deg))])


def _in_plane(wi: Floats, wo: Floats) -> Floats:
    """Return the angle of wo to the normal, positive opposite to the light; NaN further than 8 degrees off the plane."""
    across = wi[:, :2] / np.maximum(np.linalg.norm(wi[:, :2], axis=1, keepdims=True), 1e-9)
    along = (wo[:, :2] * across).sum(axis=1)
    off = across[:, 0] * wo[:, 1] - across[:, 1] * wo[:, 0]
    angle = np.arctan2(-along, wo[:, 2])
    return np.where(np.abs(off) < math.sin(math.radians(8)), angle, np.nan)


def _placed(values: Floats, inside: NDArray[np.bool_]) -> Floats:
    out = np.zeros((*inside.shape, 3))
    out[inside] = values
    return out


def _display(linear: NDArray, white: float | None = None) -> NDArray:
    """Return what a screen shows: the 99th percentile is white unless it is given, then sRGB's curve."""
    positive = linear[linear > 0]
    top = white or (float(np.percentile(positive, 99)) if len(positive) else 1.0)
    v = np.clip(linear / max(top, 1e-12), 0, 1)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 1e-9) ** (1 / 2.4) - 0.055)


def _side_by_side(path: Path, rows: list[list[tuple[str, NDArray]]]) -> None:
    """Draw rows of (measured, fitted) pictures on one scale each, with their difference."""
    height, width = rows[0][0][1].shape[:2]
    figure = Figure(figsize=(10, len(rows) * (0.35 + 3.2 * min(max(height / width, 0.2), 2.0))), layout="constrained")
    grid = figure.subplots(len(rows), 3, squeeze=False)
    for row, pictures in enumerate(rows):
        lit = pictures[0][1][pictures[0][1] > 0]
        white = float(np.percentile(lit, 99.5)) if len(lit) else 1.0
        for column, (title, values) in enumerate(pictures):
            grid[row, column].imshow(_display(values, white), interpolation="nearest")
            grid[row, column].set_title(title, fontsize=9)
        difference = (pictures[1][1] - pictures[0][1]).mean(axis=-1) / white
        drawn = grid[row, 2].imshow(difference, cmap="RdBu_r", vmin=-0.3, vmax=0.3, interpolation="nearest")
        grid[row, 2].set_title("fitted − measured, of white", fontsize=9)
        figure.colorbar(drawn, ax=grid[row, 2], shrink=0.8)
    for axes in grid.flat:
        axes.set_axis_off()
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=100)
