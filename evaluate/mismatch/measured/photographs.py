"""The diagnosis of photometric stereo: photographs of one object from one side, believed matte and lit by the lamp alone."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from materials.measured.photographs import Photographs
from materials.photometric_stereo import angular_error_deg

from ..attribute import SearchSettings
from ..diagnose import Finding
from ..effect import Effect
from .diagnose import MeasuredDiagnosis, Proof, interval
from .judge import Decoy, block_score, gain_over
from .locate import dependences, located
from .noise import of_pictures
from .samples import Samples
from .search import Trial
from .stereo import IDS, StereoFit, fit_stereo

logger = logging.getLogger("meniscus")
Floats = NDArray[np.float64]
_PIXELS, _FOLDS, _SIGMAS = 1600, 5, 3.0


@dataclass
class StereoModel:
    """A fit to all lights, those without each fifth of them, and how these do on what they did not see."""

    fit: StereoFit
    folds: list[StereoFit]
    score: Floats
    unseen: Floats

    @property
    def total(self) -> float:
        return float(self.score.sum())


@dataclass
class Stereo:
    """What is diagnosed: values (P, N) of pixels of an object, small enough for every pixel to count.

    Attributes
    ----------
    truth : (P, 3) float64 or None
        Measured normals; no fit is given them.
    samples : Samples
        The same values with a row per light and a column per pixel: lights are held out.
    """

    mask: NDArray[np.bool_]
    lights: Floats
    value: Floats
    truth: Floats | None
    factor: int
    samples: Samples
    cache: dict[frozenset[str], StereoModel] = field(default_factory=dict)


def stereo_of(photographs: Photographs, path: Path, pixels: int = _PIXELS) -> Stereo:
    """Return photographs ready for the diagnosis: means over blocks of pixels within the object, until about `pixels` are left.

    Raises
    ------
    InputError
        If there are fewer than 12 lights or 50 pixels.
    """
    if len(photographs.lights) < 12:
        raise InputError("hold at least 12 photographs", got=len(photographs.lights), file=path)
    grey = photographs.abrdf.value.mean(axis=2, dtype=np.float64)
    k = max(1, round(np.sqrt(photographs.mask.sum() / pixels)))
    whole = np.full((*photographs.mask.shape, grey.shape[1]), np.nan)
    whole[photographs.mask] = grey
    a, b, words = of_pictures(whole)
    small = _binned(whole, k)
    mask: NDArray[np.bool_] = np.asarray(np.isfinite(small).all(axis=-1))
    if mask.sum() < 50:
        raise InputError("show the object in at least 50 pixels", got=int(mask.sum()), file=path)
    value = np.maximum(small[mask], 0)
    truth = None
    if photographs.normal is not None:
        n = _binned(np.where(photographs.mask[..., None], photographs.normal, np.nan), k)[mask]
        truth = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-9)
    notes = [words, f"{len(value)} means over {k} x {k} pixels under {value.shape[1]} lights."]
    block = np.arange(value.shape[1]) % _FOLDS
    names = tuple(f"lights {f + 1}, {f + 1 + _FOLDS}, …" for f in range(_FOLDS))
    lights = np.ascontiguousarray(photographs.lights)
    where = {
        "azimuth of the light": np.degrees(np.arctan2(lights[:, 1], lights[:, 0])),
        "elevation of the light": np.degrees(np.arcsin(np.clip(lights[:, 2], -1, 1))),
    }
    sigma = np.hypot(a, b * value).T / k
    samples = Samples(
        "photographs",
        photographs.abrdf.name,
        path,
        np.ascontiguousarray(value.T),
        sigma,
        block,
        names,
        where,
        (),
        {},
        True,
        slope=b / k,
        notes=notes,
    )
    return Stereo(mask, lights, value, truth, k, samples)


def diagnose_photographs(
    stereo: Stereo, effects: list[Effect], settings: SearchSettings | None = None, say: Callable[[str], None] = logger.info
) -> MeasuredDiagnosis:
    """Find out what the belief in a matte surface and direct light leaves out of photographs."""
    settings = settings or SearchSettings()
    s = stereo.samples
    catalogue = {e.id: e for e in effects if e.id in IDS}
    say(f"{stereo.value.shape[0]} pixels, {len(stereo.lights)} lights, {_FOLDS} blocks of lights to hold out")
    base = _model(stereo, ())
    say(f"calibrated: held-out chi-square {base.total / s.value.size:.4g} a value")
    best, trials = base, []
    for _ in range(settings.most):
        step = _step(stereo, best, catalogue, settings, trials)
        if step is None:
            break
        best = step
        say("  " + " + ".join(best.fit.ids) + f": held-out chi-square {best.total / s.value.size:.4g} a value")
    losses = {}
    for id in best.fit.ids:
        losses[id] = gain_over(_decoyed(_model(stereo, tuple(i for i in best.fit.ids if i != id))), _decoyed(best), s)
    z = s.z(best.fit.prediction.T)
    left, differs = located(s, z), located(s, s.z(base.fit.prediction.T))
    findings = [_finding(stereo, best, catalogue[id], *losses[id]) for id in best.fit.ids]
    clean = not left.any()
    verdict = ("explained" if clean else "partly_explained") if findings else ("consistent" if clean else "unexplained")
    affected = np.abs(best.fit.prediction - base.fit.prediction).T / s.sigma > _SIGMAS if findings else differs & (not clean)
    d = MeasuredDiagnosis(
        s.name, verdict, findings, _proof(s, base, best), trials, differs, affected,
        [] if clean else dependences(_flat(stereo, best.fit), z.reshape(-1, 1)), list(catalogue), [], list(s.notes), {}, False,
    )  # fmt: skip
    _add_normals(stereo, d, base, best)
    d.extra["stereo"] = (stereo, base, best)
    return d


def _model(stereo: Stereo, ids: tuple[str, ...]) -> StereoModel:
    key = frozenset(ids)
    if key not in stereo.cache:
        s = stereo.samples
        everything = np.ones(len(stereo.lights), bool)
        whole = fit_stereo(ids, stereo.mask, stereo.lights, stereo.value, everything)
        folds = [fit_stereo(ids, stereo.mask, stereo.lights, stereo.value, s.block != f, whole.values) for f in range(_FOLDS)]
        unseen = np.empty_like(s.value)
        for f, fold in enumerate(folds):
            unseen[s.block == f] = fold.prediction.T[s.block == f]
        stereo.cache[key] = StereoModel(whole, folds, block_score(s, unseen), unseen)
    return stereo.cache[key]


def _step(
    stereo: Stereo, model: StereoModel, catalogue: dict[str, Effect], settings: SearchSettings, trials: list[Trial]
) -> StereoModel | None:  # fmt: skip
    s, top = stereo.samples, model.fit.ids or ("nothing",)
    false = _decoys(stereo, model)
    for d in false:
        gain, sigmas = gain_over(_decoyed(model), d, s)
        trials.append(Trial(d.name, top, gain, sigmas, d.total / s.value.size - 1, "no physics", True))
    best: tuple[StereoModel, Trial] | None = None
    for id in tracked([i for i in catalogue if i not in model.fit.ids], "trying effects"):
        candidate = _model(stereo, (*model.fit.ids, id))
        gain, sigmas = gain_over(_decoyed(model), _decoyed(candidate), s)
        trial = Trial(id, top, gain, sigmas, candidate.total / s.value.size - 1, "possible")
        trials.append(trial)
        better = [d for d in false if d.total < candidate.total]
        if gain < settings.least_gain or sigmas < settings.sigmas:
            trial.verdict = "gains too little"
        elif better:
            trial.verdict = f"{better[0].name} does better"
        elif best is None or candidate.total < best[0].total:
            best = candidate, trial
    if best is None:
        return None
    best[1].verdict = "taken"
    return best[0]


def _decoyed(model: StereoModel) -> Decoy:
    return Decoy("model", "", model.score, model.unseen)


def _decoys(stereo: Stereo, model: StereoModel) -> list[Decoy]:
    """Return what functions without physics, on top of a model, do on lights that they were not fitted to."""
    s = stereo.samples
    x, y, z = stereo.lights.T[:, :, None]
    kinds = {
        "a gain over the light's direction": lambda p: [p * x, p * y, p * z, p * x * y, p * (x**2 - y**2)],
        "a bent response of the camera": lambda p: [p**2 / p.mean(), p**3 / p.mean() ** 2],
    }
    out = []
    for name, extra in kinds.items():
        unseen = np.empty_like(s.value)
        for f, fold in enumerate(model.folds):
            p, use = fold.prediction.T, s.block != f
            columns = [np.broadcast_to(c, p.shape) for c in extra(p)]
            w = use[:, None] / s.sigma_at(p) ** 2
            # Outliers, such as highlights, count by their distance only, as in the fits.
            w = w / (1 + np.abs(s.z(p)) / _SIGMAS)
            A = np.array([[(w * a * b).sum() for b in columns] for a in columns])
            right = np.array([(w * a * (s.value - p)).sum() for a in columns])
            scale = np.linalg.lstsq(A, right, rcond=1e-10)[0]
            unseen[~use] = (p + sum(a * c for a, c in zip(scale, columns)))[~use]
        out.append(Decoy(name, "light", block_score(s, unseen), unseen))
    return out


def _finding(stereo: Stereo, model: StereoModel, effect: Effect, gain: float, sigmas: float) -> Finding:
    parameters: dict[str, Any] = {}
    for key, value in model.fit.values.items():
        if key.split(".")[0] == effect.id:
            low, high = interval(np.array([[f.values[key]] for f in model.folds]), np.array([value]))
            parameters[key.split(".")[1]] = {"value": value, "unit": "1", "ci90": [float(low[0]), float(high[0])]}
    if effect.id == "cast_shadow" and model.fit.shadow is not None:
        away = model.fit.normal @ stereo.lights.T <= 0
        for name, share in (("attached_share", away.mean()), ("cast_share", ((model.fit.shadow < 0.5) & ~away).mean())):
            parameters[name] = {"value": float(share), "unit": "1"}
    p = float(norm.sf(min(sigmas, 37.0)))
    return Finding(effect.id, effect.title, effect.says, None, parameters, gain, p, [], effect.decides)


def _proof(s: Samples, base: StereoModel, best: StereoModel) -> Proof:
    def figures(own: NDArray[np.bool_]) -> tuple[float, float, float, float]:
        chi2 = [float((s.z(m.unseen)[own] ** 2).mean()) for m in (base, best)]
        rmse = [float(np.sqrt(((s.value - m.unseen)[own] ** 2).mean())) for m in (base, best)]
        return chi2[0], chi2[1], rmse[0], rmse[1]

    rows = [(s.block_names[b], *figures(s.block == b)) for b in range(_FOLDS)]
    return Proof("lights", rows, *figures(np.ones(len(s.value), bool)))


def _add_normals(stereo: Stereo, d: MeasuredDiagnosis, base: StereoModel, best: StereoModel) -> None:
    """Hold the normals of the fits against measured ones, which no fit was given."""
    if stereo.truth is None:
        return
    before, after = (angular_error_deg(m.fit.normal, stereo.truth) for m in (base, best))
    d.extra["held_out"] = {"normal_error_deg_before": float(before.mean()), "normal_error_deg_after": float(after.mean())}
    d.notes.append(
        f"Measured normals, which no fit was given: mean angular error {before.mean():.3f}° as believed, {after.mean():.3f}° "
        f"with what was found (medians {np.median(before):.3f}° and {np.median(after):.3f}°)."
    )


def _flat(stereo: Stereo, fitted: StereoFit) -> Samples:
    """Return the values one by one, with the angles at which they were seen."""
    s = stereo.samples
    h = stereo.lights + (0.0, 0.0, 1.0)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    rows, cols = np.nonzero(stereo.mask)

    def angle(cosine: Floats) -> Floats:
        return np.degrees(np.arccos(np.clip(cosine, -1, 1))).ravel()

    num = s.value.shape
    where = {
        "half angle": angle(h @ fitted.normal.T),
        "incidence angle": angle(stereo.lights @ fitted.normal.T),
        "viewing angle": angle(np.broadcast_to(fitted.normal[:, 2], num)),
        "light": np.repeat(np.arange(num[0], dtype=np.float64), num[1]),
        "image row": np.tile(rows.astype(np.float64), num[0]),
        "image column": np.tile(cols.astype(np.float64), num[0]),
    }
    flat = s.value.reshape(-1, 1)
    return Samples(
        "photographs", s.name, s.file, flat, s.sigma.reshape(-1, 1), np.zeros(len(flat), np.int64), ("",), where, (), {}, True
    )


def _binned(picture: Floats, k: int) -> Floats:
    """Return means over blocks of k x k pixels; NaN where one is."""
    height, width = (n // k * k for n in picture.shape[:2])
    blocks = picture[:height, :width].reshape(height // k, k, width // k, k, -1)
    return blocks.mean(axis=(1, 3))
