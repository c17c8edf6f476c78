"""simulation/1 as typed: msgspec refuses unknown keys and wrong kinds at every depth."""

from __future__ import annotations

from typing import Any, Literal

import msgspec

from .simulation import NamedModel

Three = tuple[float, float, float]


class ShapeJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    name: str
    material: str
    mesh: str | None = None
    normal_map: str | None = None


class FilmJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    coverage: float | str
    thickness: float | str = 0.0
    eta: float = 1.33
    sigma_a: Three = (0.3, 0.06, 0.02)
    alpha: float = 0.0
    level: bool = True


class InteriorJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    sigma_t: float
    albedo: Three = (1.0, 1.0, 1.0)
    g: float = 0.0


class MetalJson(msgspec.Struct, forbid_unknown_fields=True):
    eta: Three
    k: Three


class TailJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    scale: float
    alpha: float
    alpha_v: float | None = None


class PrincipledJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    metallic: float = 0.0
    subsurface: float = 0.0
    specular: float = 0.5
    specular_tint: float = 0.0
    roughness: float = 0.5
    anisotropic: float = 0.0
    sheen: float = 0.0
    sheen_tint: float = 0.5
    clearcoat: float = 0.0
    clearcoat_gloss: float = 1.0


class MaterialJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A material with the keys of all models; which belong to which is said in `simulation_materials.KEYS`."""

    model: NamedModel
    albedo_texture: str | None = None
    albedo: Three | None = None
    albedo_scale: float | None = None
    eta: float | None = None
    alpha: float | None = None
    alpha_u: float | None = None
    alpha_v: float | None = None
    alpha_texture: str | None = None
    tangent_angle: float | None = None
    specular_scale: float | None = None
    tint: Three | None = None
    tint_texture: str | None = None
    tail: TailJson | None = None
    normalisation: Literal["bounded", "original", "duer"] | None = None
    sigma: float | None = None
    metal: str | MetalJson | None = None
    principled: PrincipledJson | None = None
    emission: Three | None = None
    emission_texture: str | None = None
    film: FilmJson | None = None
    interior: InteriorJson | None = None
    normal_texture: str | None = None
    bump_texture: str | None = None
    bump_scale: float | None = None
    opacity_texture: str | None = None
    one_sided: bool | None = None
    free: list[str] = []


class PointJson(msgspec.Struct, forbid_unknown_fields=True, tag="point"):
    position: Three
    intensity: Three


class DirectionalJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True, tag="directional"):
    direction: Three
    irradiance: Three
    angular_radius: float = 0.0


class EnvironmentJson(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True, tag="environment"):
    radiance: Three | None = None
    panorama: str | None = None


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
