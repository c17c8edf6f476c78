"""Made-up measurements of BRDFs and of ground that gets wet, with known physics and noise."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from evaluate.kernels import patch, shade
from materials.directions import spherical
from materials.wetness_fit import WetnessFit

NM = (450.0, 650.0)
ALBEDO = np.array([0.1, 0.3])
LAMBERT = {"model": "lambert", "albedo": 0.2, "free": ["albedo"]}


def directions() -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of directions (N, 3): five lights in one plane, each seen from all around."""
    theta_i = np.radians([10.0, 25.0, 40.0, 55.0, 70.0])
    theta_o, phi = (a.ravel() for a in np.meshgrid(np.radians(np.linspace(3, 75, 9)), np.radians(np.linspace(-180, 165, 12))))
    wi = np.repeat(spherical(theta_i, np.zeros(5)), len(theta_o), axis=0)
    return wi, np.tile(spherical(theta_o, phi), (5, 1))


def brdf(scale: float = 0.0, alpha: float = 0.3, scale2: float = 0.0, alpha2: float = 0.6, sigma: float = 0.0) -> np.ndarray:
    """Return a BRDF (N, 2) at the pairs of `directions`: Lambert or Oren-Nayar, and up to two GGX lobes."""
    wi, wo = directions()
    row = np.zeros(shade.NUM_SURFACE)
    row[shade.FRESNEL], row[shade.ETA], row[shade.SIGMA] = 1.0, 1.5, sigma
    row[shade.ALPHA_U] = row[shade.ALPHA_V] = alpha
    row[shade.ALPHA2], row[shade.RETRO_WIDTH] = alpha2, 1.0
    parts = patch.parts(row, wo, wi)
    return parts[0][:, None] * ALBEDO + (scale * parts[1] + scale2 * parts[2])[:, None]


def write_brdf(
    folder: Path, value: np.ndarray, model: dict | None = None, seed: int = 0, noise: float = 0.02, told: bool = True
) -> Path:
    """Write values with noise of a share of them and 0.0005 as a measurement/1; return the folder."""
    wi, wo = directions()
    sigma = np.hypot(noise * value, 0.0005)
    measured = np.maximum(value + sigma * np.random.default_rng(seed).normal(size=value.shape), 0)
    table = {"wi": np.repeat(wi, 2, axis=0), "wo": np.repeat(wo, 2, axis=0), "wavelength": np.tile(NM, len(wi))}
    table["value"] = measured.ravel()
    if told:
        table["sigma"] = sigma.ravel()
    return write_table(folder, table, LAMBERT if model is None else model)


def write_table(folder: Path, table: dict[str, np.ndarray], model: dict, **head: object) -> Path:
    """Write columns and what was believed as a measurement/1; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / "samples.npz", **table)
    told = {"format": "measurement/1", "table": "samples.npz", "model": model, **head}
    (folder / "measurement.json").write_text(json.dumps(told))
    return folder


def write_ground(folder: Path, formula: str | None, seed: int = 0) -> Path:
    """Write 80 spectra at rising moisture, wet by a formula of `materials.wetness_fit` or not at all; return the folder."""
    nm = np.linspace(450, 900, 10)
    dry = np.linspace(0.1, 0.35, 10)
    moisture = np.linspace(5.0, 40.0, 80)
    value = np.broadcast_to(dry, (80, 10))
    if formula is not None:
        value = WetnessFit(formula, dry, 8.0, 30.0, 0.6 if formula == "lagarde" else 1.5, 0.0).predict(moisture)
    sigma = np.full(value.shape, 0.002)
    measured = value + sigma * np.random.default_rng(seed).normal(size=value.shape)
    table = {"condition": np.repeat(moisture, 10), "wavelength": np.tile(nm, 80), "value": measured.ravel(), "sigma": sigma.ravel()}
    model = {"model": "lambert", "albedo": dry.tolist(), "free": ["albedo_scale"]}
    return write_table(folder, table, model, condition="moisture", condition_unit="%")
