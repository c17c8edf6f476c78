"""simulation/1 as typed: msgspec refuses unknown keys and wrong kinds at every depth."""

from __future__ import annotations

from typing import Any, Literal

import msgspec

Three = tuple[float, float, float]


class ShapeJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    name: str
    material: str
    mesh: str | None = None
    normal_map: str | None = None


class MaterialJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    model: Literal["lambert", "ggx"]
    albedo_texture: str | None = None
    albedo: Three | None = None
    albedo_scale: float = 1.0
    eta: float | None = None
    alpha: float | None = None
    alpha_u: float | None = None
    alpha_v: float | None = None
    specular_scale: float | None = None
    normal_texture: str | None = None
    free: list[str] = []


class PointJson(msgspec.Struct, forbid_unknown_fields=True, tag="point"):
    position: Three
    intensity: Three


class DirectionalJson(msgspec.Struct, forbid_unknown_fields=True, tag="directional"):
    direction: Three
    irradiance: Three


class EnvironmentJson(msgspec.Struct, forbid_unknown_fields=True, tag="environment"):
    radiance: Three


class SphereJson(msgspec.Struct, forbid_unknown_fields=True, tag="sphere"):
    position: Three
    radius: float
    intensity: Three


class RectangleJson(msgspec.Struct, forbid_unknown_fields=True, tag="rectangle"):
    corner: Three
    edge_u: Three
    edge_v: Three
    radiance: Three


LightJson = PointJson | DirectionalJson | SphereJson | RectangleJson | EnvironmentJson


class TransportJson(msgspec.Struct, forbid_unknown_fields=True):
    max_bounces: int = 8
    shadows: bool = True


class MediumJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    sigma_t: float
    albedo: Three = (1.0, 1.0, 1.0)
    g: float = 0.0
    bounds: tuple[Three, Three] | None = None
    scale_height: float | None = None
    base_z: float = 0.0


class LensJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    model: Literal["pinhole", "thin_lens"]
    aperture_radius: float = 0.0
    focus_distance: float | None = None
    k1: float = 0.0
    k2: float = 0.0


class SensorJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    response: Literal["linear", "gamma"]
    gamma: float = 1.0
    saturation: float | None = None


class EffectJson(msgspec.Struct, forbid_unknown_fields=True):
    id: str
    target: str | None = None
    parameters: dict[str, Any] = {}


class SimulationJson(msgspec.Struct, forbid_unknown_fields=True):
    format: Literal["simulation/1"]
    shapes: list[ShapeJson]
    materials: dict[str, MaterialJson]
    lights: dict[str, LightJson] = {}
    transport: TransportJson = msgspec.field(default_factory=TransportJson)
    medium: MediumJson | None = None
    lens: LensJson = msgspec.field(default_factory=lambda: LensJson("pinhole"))
    sensor: SensorJson = msgspec.field(default_factory=lambda: SensorJson("linear"))
    effects: list[EffectJson] = []
