"""A flat patch under pairs of directions: the effects on surfaces act on it as they do on the surfaces of pictures."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from ...kernels import patch, shade
from ..case import Case
from ..effect import Effect, Parameter
from ..formation import State
from .fit import Columns
from .samples import Samples

Floats = NDArray[np.float64]
_SURFACE = "surface"
# Scales of columns, found per channel in closed form; all other parameters bend columns.
_SCALES = ("specular_scale", "strength")
_KEYS = {
    "lambert": {"model", "albedo", "albedo_scale", "free"},
    "ggx": {"model", "albedo", "albedo_scale", "eta", "alpha", "alpha_u", "alpha_v", "specular_scale", "free"},
}
_LOW_HIGH = {"alpha": (0.01, 1.0), "alpha_u": (0.01, 1.0), "alpha_v": (0.01, 1.0), "eta": (1.02, 6.0), "albedo_scale": (0.0, 100.0)}
_NEAREST_DEG = 10.0


class Patch:
    """BRDF samples believed to be Lambert or GGX."""

    def __init__(self, samples: Samples, effects: list[Effect]) -> None:
        assert samples.wi is not None and samples.wo is not None
        self.samples = samples
        self.wi, self.wo = np.ascontiguousarray(samples.wi), np.ascontiguousarray(samples.wo)
        self.believed = believed(samples)
        self.free: tuple[str, ...] = tuple(self.believed["free"])
        if samples.relative and not {"albedo", "albedo_scale"} & set(self.free):
            raise InputError(
                "be free where the unit is relative", got=list(self.free), file=samples.file, key="model.free",
                remedy='Add "albedo".',
            )  # fmt: skip
        self.effects = {e.id: e for e in effects if e.on_patch and self._testable(e)}
        self.untested = [e.id for e in effects if e.on_patch and not self._testable(e)]

    def _testable(self, e: Effect) -> bool:
        if e.id == "anisotropy":
            lights = self.samples.coordinates["azimuth of the light"]
            return not self.samples.isotropic and len(np.unique(np.round(lights))) > 2
        if e.id == "retroreflection":
            return bool(((self.wi * self.wo).sum(axis=1) > np.cos(np.radians(_NEAREST_DEG))).any())
        return True

    def applicable(self, have: tuple[str, ...]) -> list[Effect]:
        """Return the effects that have a place on top of others."""
        case = self._case(have)
        return [e for e in self.effects.values() if e.id not in have and _SURFACE in e.targets(case)]

    def starts(self, effect: Effect, have: tuple[str, ...], values: dict[str, float]) -> list[dict[str, float]]:
        """Return first guesses by key of a model with an effect more, from the values of the model without it."""
        found = effect.starts(self._case(have), _SURFACE, None)
        out = [values | {f"{effect.id}.{k}": v for k, v in s.items()} for s in found]
        if effect.id == "long_tail_lobe":
            # One lobe that was to stand for two is between them: it may have to become the core, and the new one its skirt.
            for key in ("specular_lobe.alpha", "free.alpha"):
                if key in values:
                    out += [values | {key: values[key] / d, f"{effect.id}.alpha": values[key] * u} for d, u in ((3, 1), (1.5, 2))]
        return out

    def parameters(self, ids: tuple[str, ...]) -> list[tuple[str, Parameter]]:
        out = []
        for key in self.free:
            if key in _LOW_HIGH:
                low, high = _LOW_HIGH[key]
                out.append((f"free.{key}", Parameter(key, float(self.believed[key]), low, high, 0.01)))
        for i, id in enumerate(ids):
            for p in self.effects[id].parameters(self._case(ids[:i]), _SURFACE):
                if p.name not in _SCALES:
                    out.append((f"{id}.{p.name}", p))
        return out

    def columns(self, ids: tuple[str, ...], values: dict[str, float]) -> Columns:
        row, owner = self._row(values), {shade.LOBE: "free", shade.LOBE2: "", shade.RETRO: ""}
        for i, id in enumerate(ids):
            effect, before = self.effects[id], row.copy()
            case = self._case(ids[:i])
            chosen = {p.name: values.get(f"{id}.{p.name}", p.start) for p in effect.parameters(case, _SURFACE)}
            state = cast(State, SimpleNamespace(surfaces=row[None]))
            effect.change(case, state, chosen, _SURFACE, None)
            row = state.surfaces[0]
            for column in owner:
                if row[column] > 0 and before[column] == 0:
                    owner[column] = id
        parts = patch.parts(row, self.wo, self.wi)
        num_channels = self.samples.value.shape[1]
        scale = values.get("free.albedo_scale", self.believed["albedo_scale"])
        albedo = None if "albedo" in self.free else np.broadcast_to(scale * np.asarray(self.believed["albedo"]), num_channels)
        arrays, names, scales = [parts[0][:, None]], ["free.albedo"], [albedo]
        for k, column in enumerate((shade.LOBE, shade.LOBE2, shade.RETRO), start=1):
            if row[column] <= 0:
                continue
            found = owner[column] != "free" or "specular_scale" in self.free
            arrays.append(parts[k][:, None])
            names.append(f"{owner[column]}.{'strength' if column == shade.RETRO else 'specular_scale'}")
            scales.append(None if found else np.full(num_channels, row[column]))
        return Columns(arrays, names, scales)

    def reported(self, id: str, values: dict[str, float]) -> dict[str, tuple[float, str]]:
        own = {key.split(".")[1]: (key, p.unit) for key, p in self.parameters(tuple(k for k in self.effects if k == id))}
        return {name: (values[key], unit) for name, (key, unit) in own.items() if key.startswith(f"{id}.")}

    def own_coordinate(self, id: str) -> str:
        """Return the angle over which any function stands for an effect of its kind."""
        return {"rough_diffuse": "viewing angle", "retroreflection": "difference angle"}.get(id, "half angle")

    def _row(self, values: dict[str, float]) -> Floats:
        row = np.zeros(shade.NUM_SURFACE)
        row[shade.FRESNEL], row[shade.ETA] = 1.0, 1.5
        row[shade.ALPHA_U] = row[shade.ALPHA_V] = row[shade.ALPHA2] = row[shade.ALPHA3] = 0.5
        row[shade.ETA3], row[shade.RETRO_WIDTH] = 1.33, 0.3
        if self.believed["model"] == "ggx":
            for key, columns in (("alpha", (shade.ALPHA_U, shade.ALPHA_V)), ("eta", (shade.ETA,)), ("alpha_u", (shade.ALPHA_U,)),
                                 ("alpha_v", (shade.ALPHA_V,))):  # fmt: skip
                if key in self.believed:
                    row[list(columns)] = values.get(f"free.{key}", self.believed[key])
            row[shade.LOBE] = self.believed["specular_scale"]
        return row

    def _case(self, have: tuple[str, ...]) -> Case:
        """Return as much of a case as the effects on surfaces ask for."""
        is_glossy = self.believed["model"] == "ggx" or "specular_lobe" in have
        material = SimpleNamespace(model="ggx" if is_glossy else "lambert", eta=float(self.believed.get("eta", 1.5)))
        pieces = SimpleNamespace(shape=np.zeros(1, np.int64), weight=np.ones(1), start=np.array([0, 1]))
        return cast(Case, SimpleNamespace(shape_names=(_SURFACE,), material_of=lambda _: material, pieces=pieces))


def believed(samples: Samples) -> dict[str, Any]:
    """Return the model that was believed of a BRDF, checked and with its defaults.

    Raises
    ------
    InputError
        If the model or a key is unknown, or a number is none or out of its range.
    """
    model, file = dict(samples.model), samples.file
    kind = model.get("model")
    if kind not in _KEYS:
        raise InputError(f"be one of {', '.join(_KEYS)}", got=kind, file=file, key="model.model")
    for key in model:
        if key not in _KEYS[kind]:
            raise InputError("be a known key", file=file, key=f"model.{key}", remedy=f"Known: {', '.join(sorted(_KEYS[kind]))}.")
    free = model.get("free", [])
    can = _KEYS[kind] - {"model", "free"}
    if not isinstance(free, list) or not set(free) <= can:
        raise InputError(f"list some of {', '.join(sorted(can))}", got=free, file=file, key="model.free")
    out: dict[str, Any] = {"model": kind, "albedo": 0.5, "albedo_scale": 1.0, "free": free}
    if kind == "ggx":
        out |= {"alpha": 0.25, "eta": 1.5, "specular_scale": 1.0}
    for key, value in model.items():
        if key in ("model", "free"):
            continue
        numbers = _numbers(value)
        low, high = _LOW_HIGH.get(key, (0.0, 1e4))
        count = len(samples.channels) if key == "albedo" else 1
        if numbers is None or numbers.size not in (1, count) or not ((numbers >= low) & (numbers <= high)).all():
            must = f"be a number in [{low:g}, {high:g}]" + (f" or {count} of them" if count > 1 else "")
            raise InputError(must, got=value, file=file, key=f"model.{key}")
        out[key] = numbers if numbers.size > 1 else float(numbers.reshape(-1)[0])
    return out


def _numbers(value: Any) -> Floats | None:
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    return numbers if np.isfinite(numbers).all() and not isinstance(value, bool | str) else None
