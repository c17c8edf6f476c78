"""What a believed simulation holds besides shapes, materials and lights: terms of every model, with nothing to fit."""

from __future__ import annotations

from typing import Any

import numpy as np

from materials.foundation.errors import InputError
from scene.simulation import AddedEffect, PointLight, Simulation, SphereLight

from ..mismatch.calibrate import weigh
from ..mismatch.case import Case, with_believed, with_noise_times
from ..mismatch.effect import Effect, Parameter, Term, groups
from ..mismatch.solve import context, fit
from .defocus import Defocus
from .interreflection import Interreflection
from .light_extent import LightExtent, spheres
from .saturation import Saturation
from .sensor_response import PowerLaw


def with_given(case: Case, effects: dict[str, Effect]) -> Case:
    """Return the case with what its simulation believes of bounces, lens, sensor and `effects`.

    Parameters
    ----------
    effects : dict of Effect
        By id: all that `effects` of a simulation may name.

    Raises
    ------
    InputError
        If the simulation has a medium, lamps of several sizes, or an effect that is unknown, lacks a parameter, or is not to
        be found in the world.
    """
    simulation = case.simulation
    if simulation.medium is not None:
        remedy = "Leave it out: `participating_medium` finds it, with the light that it scatters."
        raise InputError("be null for a diagnosis", got="a medium", key="medium", remedy=remedy)
    case, others = _with_given_noise(case, simulation.effects)
    wanted: list[tuple[Effect, str | None, dict[str, Any]]] = []
    radius = _radius(simulation)
    if radius is not None and simulation.transport.shadows:
        wanted.append((LightExtent(radius), None, {"radius": radius}))
    if simulation.transport.max_bounces > 1:
        wanted.append((Interreflection(first=1), None, {"bounces": float(simulation.transport.max_bounces)}))
    lens, sensor = simulation.lens, simulation.sensor
    if lens.model == "thin_lens":
        values = {"aperture_radius": lens.aperture_radius, "inverse_focus": 1 / lens.focus_distance}
        wanted.append((Defocus(), None, values))
    if sensor.response == "gamma":
        wanted.append((PowerLaw(), None, {"gamma": 1 / sensor.gamma}))
    if sensor.saturation is not None:
        exposures = np.array([f.exposure for f in case.recording.frames])
        wanted.append((Saturation(), None, {"level": sensor.saturation / exposures.min()}))
    wanted += [_named(case, effects, added, f"effects[{i}]") for i, added in others]
    given: tuple[Term, ...] = ()
    for effect, target, values in wanted:
        case = with_believed(case, given)
        given = (*given, _term(case, effect, target, values))
    return with_believed(case, given) if given else case


def _radius(simulation: Simulation) -> float | None:
    """Return the radius [m] of the spheres of light, None if there are none."""
    balls = spheres(simulation)
    if not balls:
        return None
    (first, ball), *_ = balls.items()
    for name, light in simulation.lights.items():
        if isinstance(light, PointLight) or (isinstance(light, SphereLight) and light.radius != ball.radius):
            got = light.radius if isinstance(light, SphereLight) else "a point"
            raise InputError(f"have the radius of {first}, {ball.radius:g} m, to be diagnosed", got=got, key=f"lights.{name}")
    return ball.radius


def _with_given_noise(case: Case, effects: tuple[AddedEffect, ...]) -> tuple[Case, list[tuple[int, AddedEffect]]]:
    """Return the case with the noise that `noise_model` says, and the other effects, numbered."""
    others = []
    for i, added in enumerate(effects):
        if added.id != "noise_model":
            others.append((i, added))
            continue
        factor = added.parameters.get("sigma_factor")
        if not isinstance(factor, int | float) or not 0 < factor < np.inf:
            raise InputError("be a number above 0", got=factor, key=f"effects[{i}].parameters.sigma_factor")
        case = with_noise_times(case, float(factor))
    return case, others


def _named(case: Case, effects: dict[str, Effect], added: AddedEffect, key: str) -> tuple[Effect, str | None, dict[str, Any]]:
    if added.id not in effects:
        raise InputError(f"be one of {', '.join(effects)}", got=added.id, key=f"{key}.id")
    if added.target is not None and added.target not in (*case.shape_names, *case.simulation.lights):
        raise InputError("name a shape or light", got=added.target, key=f"{key}.target")
    effect = effects[added.id]
    for p in effect.parameters(case, added.target):
        if p.name not in added.parameters:
            raise InputError("be given", key=f"{key}.parameters.{p.name}")
        values = np.asarray(added.parameters[p.name], np.float64)
        shape = () if p.per == "" else (case.num_frames,)
        if values.shape != shape or not np.all(np.isfinite(values)):
            raise InputError("be a number" if p.per == "" else f"be {case.num_frames} numbers", key=f"{key}.parameters.{p.name}")
    return effect, added.target, added.parameters


def _term(case: Case, effect: Effect, target: str | None, values: dict[str, Any]) -> Term:
    """Return a term with its values; those per frame of a parameter per view are taken from its first frame."""
    start = fit(case, np.zeros_like(case.pictures), [], 0)
    aux = effect.restored(case, target, context(case, weigh(case, start.picture), start), values.get("map"))
    if aux is False:
        raise InputError("be found in this world", got=effect.id, key="effects")
    parameters = effect.parameters(case, target)
    return Term(effect, target, aux, parameters, {p.name: _grouped(case, p, values[p.name]) for p in parameters})


def _grouped(case: Case, p: Parameter, value: Any) -> Any:
    if p.per == "":
        return np.float64(value)
    group, values = groups(case, p.per), np.asarray(value, np.float64)
    return np.array([values[np.flatnonzero(group == g)[0]] for g in range(group.max() + 1)])
