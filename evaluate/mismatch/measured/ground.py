"""Spectra of ground under a condition such as moisture: what water does to them, by the models of `materials.wetness_fit`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.wetness_fit import ETA_SOLID, WetnessFit

from ..effect import Effect, Parameter
from .fit import Columns
from .patch import believed
from .samples import Samples

Floats = NDArray[np.float64]
# The formulas that stand for an effect: water in the pores (Lagarde's grey factor; Twomey's grains), or a film on top.
_FORMULAS = {"surface_wetness": ("lagarde", "twomey"), "water_film": ("lekner_dorf",)}
_LONGEST = 3.0


class Ground:
    """Spectra believed to be one, whatever the condition."""

    def __init__(self, samples: Samples, effects: list[Effect]) -> None:
        assert samples.condition is not None
        self.samples = samples
        self.believed = believed(samples)
        if self.believed["model"] != "lambert":
            raise InputError(
                "be lambert for spectra under a condition", got=self.believed["model"], file=samples.file, key="model.model"
            )
        self.free = tuple(self.believed["free"])
        if (samples.value > 1).any():
            raise InputError("be a reflectance in [0, 1]", got=float(samples.value.max()), file=samples.file, key="value")
        known = (*_FORMULAS, "albedo_error")
        self.effects = {e.id: e for e in effects if e.id in known}
        self.untested: list[str] = []
        m = samples.condition
        self.low, self.high = float(m.min()), float(m.max())

    def applicable(self, have: tuple[str, ...]) -> list[Effect]:
        """Return the effects that have a place on top of others; water is there once."""
        wet = bool(set(have) & set(_FORMULAS)) or self.high == self.low
        out = [e for e in self.effects.values() if e.id not in have and not (wet and e.id in _FORMULAS)]
        return [e for e in out if e.id != "albedo_error" or "albedo" not in self.free]

    def starts(self, effect: Effect, have: tuple[str, ...], values: dict[str, float]) -> list[dict[str, float]]:
        """Return first guesses by key."""
        span, formulas = self.high - self.low, _FORMULAS.get(effect.id, ())
        out = []
        for k in range(len(formulas)):
            for begin in (self.low - 0.5 * span, self.low - 0.05 * span):
                for length in (0.3, 0.9):
                    start = {"formula": float(k), "start": begin, "length": length * span}
                    out.append(values | {f"{effect.id}.{name}": v for name, v in start.items()})
        return out or [values]

    def parameters(self, ids: tuple[str, ...]) -> list[tuple[str, Parameter]]:
        out = []
        if "albedo_scale" in self.free:
            out.append(("free.albedo_scale", Parameter("albedo_scale", float(self.believed["albedo_scale"]), 0.1, 10.0, 0.01)))
        span, unit = self.high - self.low, self.samples.condition_unit
        for id in ids:
            if id in _FORMULAS:
                least = min(0.0, self.low - span)
                out.append((f"{id}.start", Parameter("start", self.low, least, self.high, 0.01 * span, unit)))
                out.append((f"{id}.length", Parameter("length", span, 0.02 * span, _LONGEST * span, 0.01 * span, unit)))
                out.append((f"{id}.strength", Parameter("strength", 0.5, 0.0, 1.0, 0.01)))
        return out

    def columns(self, ids: tuple[str, ...], values: dict[str, float]) -> Columns:
        num_channels = self.samples.value.shape[1]
        scale = values.get("free.albedo_scale", self.believed["albedo_scale"])
        dry = np.clip(np.broadcast_to(scale * np.asarray(self.believed["albedo"]), num_channels), 0, 1)
        factor = np.ones((len(self.samples.value), num_channels))
        for id in ids:
            if id in _FORMULAS:
                factor = factor * self._wet(id, values, dry)
        if "albedo" in self.free:
            return Columns([factor], ["free.albedo"], [None])
        if "albedo_error" in ids:
            return Columns([factor * dry], ["albedo_error.factor"], [None])
        return Columns([factor * dry], ["free.albedo"], [np.ones(num_channels)])

    def reported(self, id: str, values: dict[str, float]) -> dict[str, tuple[float, str]]:
        if id not in _FORMULAS:
            return {}
        w, unit = self._fit(id, values, np.zeros(0)), self.samples.condition_unit
        constant = "porosity" if w.model == "lagarde" else "solid_eta"
        return {"start": (w.start, unit), "full": (w.full, unit), constant: (w.constant, "1")}

    def formula(self, id: str, values: dict[str, float]) -> str:
        """Return the formula that a fit chose for an effect."""
        return _FORMULAS[id][round(values[f"{id}.formula"])] if id in _FORMULAS else ""

    def own_coordinate(self, id: str) -> str:
        """Return of what any function stands for an effect of its kind."""
        return "wavelength" if id == "albedo_error" else self.samples.condition_name

    def _fit(self, id: str, values: dict[str, float], dry: Floats) -> WetnessFit:
        model = self.formula(id, values)
        start, strength = values[f"{id}.start"], values[f"{id}.strength"]
        low, high = (0.0, 1.0) if model == "lagarde" else ETA_SOLID
        return WetnessFit(model, dry, start, start + values[f"{id}.length"], low + strength * (high - low), 0.0)

    def _wet(self, id: str, values: dict[str, float], dry: Floats) -> Floats:
        assert self.samples.condition is not None
        w = self._fit(id, values, dry)
        return w.predict(self.samples.condition) / np.maximum(dry, 1e-12)
