"""The diagnosis of a measurement without a picture: calibrate, locate, attribute, prune, prove."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from materials.measured.measurement_file import read_measurement

from ..attribute import SearchSettings
from ..diagnose import Finding
from ..effect import Effect
from ..locate import Dependence
from .fit import Fit
from .ground import Ground
from .judge import Model, assess
from .locate import dependences, located
from .patch import Patch
from .samples import Samples, samples_of
from .search import Found, Trial, search

logger = logging.getLogger("meniscus")
_SIGMAS = 3.0


@dataclass(frozen=True)
class Proof:
    """Figures on blocks that no fit saw.

    Attributes
    ----------
    what : str
        What was held out, one block at a time.
    rows : list of (name, chi2 before, chi2 after, rmse before, rmse after)
        Per block; chi-square a value, rmse in the measurement's unit.
    chi2_before, chi2_after, rmse_before, rmse_after : float
        Over all blocks.
    """

    what: str
    rows: list[tuple[str, float, float, float, float]]
    chi2_before: float
    chi2_after: float
    rmse_before: float
    rmse_after: float


@dataclass
class MeasuredDiagnosis:
    """What was found, and all that it rests on."""

    name: str
    verdict: str
    findings: list[Finding]
    proof: Proof
    trials: list[Trial]
    located: NDArray[np.bool_]
    affected: NDArray[np.bool_]
    depends_on: list[Dependence]
    tested: list[str]
    untested: list[str]
    notes: list[str]
    free: dict[str, Any]
    noise_stated: bool
    samples: Samples | None = None
    base: Model | None = None
    best: Model | None = None
    extra: dict[str, Any] = field(default_factory=dict)


def diagnose_file(
    path: str | Path, effects: list[Effect], settings: SearchSettings | None = None, say: Callable[[str], None] = logger.info
) -> MeasuredDiagnosis:
    """Find out which effects the model that was believed of a measurement/1 leaves out.

    Parameters
    ----------
    path : path
        `measurement.json`, or the folder that holds it.
    """
    path = Path(path)
    file = path / "measurement.json" if path.is_dir() else path
    return diagnose_samples(samples_of(read_measurement(file), file), effects, settings, say)


def diagnose_samples(
    samples: Samples, effects: list[Effect], settings: SearchSettings | None = None, say: Callable[[str], None] = logger.info
) -> MeasuredDiagnosis:
    """Diagnose samples that are ready (`samples_of`)."""
    world = Patch(samples, effects) if samples.kind == "directions" else Ground(samples, effects)
    n, channels = samples.value.shape
    say(f"{n} samples, {channels} channels, {len(samples.block_names)} blocks to hold out")
    base = assess(world, (), [{}])
    differs = located(samples, samples.z(base.fit.prediction))
    say(f"calibrated: held-out chi-square {base.per_value:.4g} a value, {differs.mean():.1%} of the values located")
    # Even where nothing is located: what is weak everywhere shows in no bin.
    found = search(world, base, settings or SearchSettings(), say)
    best = found.best
    left = located(samples, samples.z(best.fit.prediction))
    clean = not left.any()
    findings = [_finding(world, found, id) for id in best.ids]
    verdict = ("explained" if clean else "partly_explained") if findings else ("consistent" if clean else "unexplained")
    depends = [] if clean else dependences(samples, samples.z(best.fit.prediction))
    notes = [*samples.notes, *found.notes]
    if world.untested:
        notes.append(f"These samples cannot show {', '.join(world.untested)}: the azimuths or directions for it were not measured.")
    if not clean:
        notes.append(f"{left.mean():.1%} of the values still differ by more than noise.")
    affected = differs if verdict == "unexplained" else np.zeros_like(differs)
    if findings:
        # What would have been seen of the effects above the noise.
        change = np.abs(best.fit.prediction - _without(world, best)) / samples.sigma
        affected = change > _SIGMAS
    return MeasuredDiagnosis(
        samples.name, verdict, findings, _proof(samples, base, best), found.trials, differs, affected, depends,
        list(world.effects), world.untested, notes, _free(best.fit), not samples.noise_estimated, samples, base, best,
    )  # fmt: skip


def _without(world: Patch | Ground, best: Model) -> NDArray[np.float64]:
    """Return what the final fit predicts without its effects, all else equal."""
    columns = world.columns((), {k: v for k, v in best.fit.values.items() if k.startswith("free.")})
    scales = [best.fit.scales.get(name, known) for name, known in zip(columns.names, columns.scales)]
    parts = [a * s for a, s in zip(columns.arrays, scales) if s is not None]
    return np.broadcast_to(sum(parts), best.fit.prediction.shape)


def _finding(world: Patch | Ground, found: Found, id: str) -> Finding:
    model, effect = found.best, world.effects[id]
    gain, sigmas = found.losses[id]
    parameters: dict[str, Any] = {}
    whole = world.reported(id, model.fit.values)
    folds = [world.reported(id, f.values) for f in model.folds]
    for name, (value, unit) in whole.items():
        parameters[name] = {"value": value, "unit": unit}
        if len(folds) > 1:
            low, high = interval(np.array([[f[name][0]] for f in folds]), np.array([value]))
            parameters[name]["ci90"] = [float(low[0]), float(high[0])]
    channels = world.samples.channels
    for key, scale in model.fit.scales.items():
        if key.split(".")[0] != id:
            continue
        unit = "1/sr" if key.endswith("strength") else "1"
        entry: dict[str, Any] = {"value": scale.tolist(), "unit": unit, "per": "channel", "channels": list(channels)}
        if len(model.folds) > 1:
            low, high = interval(np.array([f.scales[key] for f in model.folds]), scale)
            entry["ci90"] = np.stack([np.maximum(low, 0), high], axis=1).tolist()
        parameters[key.split(".")[1]] = entry
    if isinstance(world, Ground) and (formula := world.formula(id, model.fit.values)):
        parameters["formula"] = {"value": formula, "unit": ""}
    p = float(norm.sf(min(sigmas, 37.0)))
    return Finding(id, effect.title, effect.says, None, parameters, gain, p, found.ambiguous.get(id, []), effect.decides)


def interval(folds: NDArray[np.float64], value: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the 90 % interval about a value by the jackknife over blocks (Tukey 1958)."""
    n = len(folds)
    sigma = np.sqrt((n - 1) / n * ((folds - folds.mean(axis=0)) ** 2).sum(axis=0))
    reach = student.isf(0.05, n - 1) * sigma
    return value - reach, value + reach


def _free(fit: Fit) -> dict[str, Any]:
    out: dict[str, Any] = {k.removeprefix("free."): v for k, v in fit.values.items() if k.startswith("free.")}
    return out | {k.removeprefix("free."): s.tolist() for k, s in fit.scales.items() if k.startswith("free.")}


def _proof(s: Samples, base: Model, best: Model) -> Proof:
    def figures(own: NDArray[np.bool_]) -> tuple[float, float, float, float]:
        chi2 = [float((s.z(m.unseen)[own] ** 2).mean()) for m in (base, best)]
        rmse = [float(np.sqrt(((s.value - m.unseen)[own] ** 2).mean())) for m in (base, best)]
        return chi2[0], chi2[1], rmse[0], rmse[1]

    blocks = np.unique(s.block)
    rows = [(s.block_names[b], *figures(s.block == b)) for b in blocks] if len(blocks) > 1 else []
    what = ("incidence angle" if s.kind == "directions" else s.condition_name) if rows else "nothing"
    return Proof(what, rows, *figures(np.ones(len(s.value), bool)))
