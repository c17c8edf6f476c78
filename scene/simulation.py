"""A synthetic world in memory: shapes, materials and lights, as `simulation/1` names them and the tracer compiles them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from materials.btf import BTF
from materials.disney import Principled
from materials.gloss import Tail
from materials.svbrdf import SVBRDF

from .mesh import Mesh

RGB = tuple[float, float, float]
# Textures are (H, W) or (H, W, 3) float32, texel (i, j) centred at ((i + 0.5) / W, (j + 0.5) / H), bilinear, repeating.
Texture = NDArray[np.float32]


# Models that simulation/1 has a name for.
NamedModel = Literal[
    "lambert",
    "oren_nayar",
    "ggx",
    "cook_torrance",
    "ward",
    "phong",
    "conductor",
    "disney",
    "coated",
    "mirror",
    "dielectric",
    "rough_dielectric",
    "emission",
]


@dataclass(frozen=True)
class Film:
    """A layer of water on a material.

    Attributes
    ----------
    coverage : float or texture
        Share of the area below water, 0 to 1.
    thickness : float or texture
        Depth of the water [m].
    eta : float
        Its refractive index.
    sigma_a : RGB
        Absorption [1/m].
    alpha : float
        GGX width of its surface; 0 is smooth.
    level : bool
        Whether the water's surface is horizontal (a puddle) rather than parallel to the ground (a thin film).
    """

    coverage: float | Texture
    thickness: float | Texture = 0.0
    eta: float = 1.33
    sigma_a: RGB = (0.3, 0.06, 0.02)
    alpha: float = 0.0
    level: bool = True


@dataclass(frozen=True)
class Material:
    """How a shape scatters. `model` is one of

    - `lambert`: albedo / pi
    - `oren_nayar`: rough matte, the qualitative model of Oren and Nayar (1994) with `sigma` [rad]
    - `ggx`: Lambert (not reduced by the specular term) + specular_scale x GGX (height-correlated Smith, Schlick from eta)
    - `cook_torrance`: the same with the facets of Ashikhmin and Shirley; `ward` and `phong`: the same with these lobes,
      which know no Fresnel. `normalisation` is Ward's
    - `conductor`: a metal of complex index `metal` = (eta, k) per channel, GGX facets; `alpha` 0 is a mirror
    - `disney`: the principled BRDF, base colour `albedo`, all else in `principled`
    - `coated`: a smooth dielectric interface (eta, exact Fresnel) over a Lambertian base, all internal bounces included
    - `mirror`: a perfect mirror times albedo
    - `dielectric`: smooth glass or water, eta inside over outside; `rough_dielectric` with alpha
    - `emission`: black, emits
    - `measured`: what `measured` holds, a BTF or textures fitted to one, through u and v; x is dp/du, turned as below, and all
      other parameters but `opacity_texture`, `normal_texture` and `bump_texture` are passed over

    The albedo is `albedo_texture`, where there is one, else `albedo`, times `albedo_scale`. Widths are microfacet widths for
    all models (a Phong exponent is 2 / alpha**2 - 2). Where `alpha_u` or `alpha_v` is given it replaces `alpha` along or
    across; along is dp/du of the mesh, turned by `tangent_angle` [rad] about the normal. `alpha_texture` replaces `alpha`, or
    with two or more channels both widths, and scales `alpha_u` and `alpha_v` where they are given. `tint` colours the lobes of
    `ggx`, `cook_torrance`, `ward` and `phong`; `tail` adds a second lobe to them. `emission` is times `emission_texture`.
    `normal_texture` holds tangent-space normals as 2 c - 1, `bump_texture` heights, times `bump_scale` [m]. A `one_sided`
    surface is black from behind: it neither reflects nor emits there. `interior`, an even medium without bounds, fills a body of
    `dielectric` or `rough_dielectric` whose faces look outwards; with `eta` 1 its surface is none to light. A `film` may lie
    on `lambert`, `ggx` and `coated`. `free` names the parameters that were not known exactly: a diagnosis fits them first.
    """

    model: NamedModel | Literal["measured"] = "lambert"
    albedo: RGB = (0.5, 0.5, 0.5)
    albedo_texture: Texture | None = None
    eta: float = 1.5
    alpha: float = 0.3
    alpha_texture: Texture | None = None
    specular_scale: float = 1.0
    normal_texture: Texture | None = None
    opacity_texture: Texture | None = None
    emission: RGB = (0.0, 0.0, 0.0)
    film: Film | None = None
    albedo_scale: float = 1.0
    alpha_u: float | None = None
    alpha_v: float | None = None
    free: tuple[str, ...] = ()
    tangent_angle: float = 0.0
    emission_texture: Texture | None = None
    bump_texture: Texture | None = None
    bump_scale: float = 1.0
    one_sided: bool = False
    sigma: float = 0.3
    tint: RGB = (1.0, 1.0, 1.0)
    tint_texture: Texture | None = None
    tail: Tail | None = None
    normalisation: Literal["bounded", "original", "duer"] = "bounded"
    metal: tuple[RGB, RGB] | None = None
    principled: Principled | None = None
    interior: Medium | None = None
    measured: BTF | SVBRDF | None = None


@dataclass(frozen=True)
class Shape:
    """A mesh with its material; `instance` is the id of a dynamic object, 0 for the static world.

    `kind` is what a segmentation would say: "road", "pavement", "soil", "vegetation", "building", "vehicle", ….
    """

    name: str
    mesh: Mesh
    material: str
    instance: int = 0
    kind: str = "other"


@dataclass(frozen=True)
class DirectionalLight:
    """Light from far away, travelling along `direction`; `irradiance` on a plane facing it [W/m²].

    `angular_radius` [rad] makes it a disc in the sky (the sun: 0.00465); 0 is a delta light.
    """

    direction: RGB
    irradiance: RGB
    angular_radius: float = 0.0


@dataclass(frozen=True)
class PointLight:
    """`intensity` [W/sr] in all directions."""

    position: RGB
    intensity: RGB


@dataclass(frozen=True)
class SphereLight:
    """A glowing ball that sends `intensity` [W/sr] in all directions: radiance is intensity / (pi radius²). It is seen."""

    position: RGB
    radius: float
    intensity: RGB


@dataclass(frozen=True)
class RectangleLight:
    """A glowing parallelogram of even `radiance` [W/(m² sr)] on the side of edge_u x edge_v; black from behind.

    Other glowing shapes are meshes with the material `emission`.
    """

    corner: RGB
    edge_u: RGB
    edge_v: RGB
    radiance: RGB


@dataclass(frozen=True)
class EnvironmentLight:
    """Radiance from infinity: a constant, or a panorama (H, W, 3) laid out as `scene_file.Sky`."""

    radiance: RGB = (0.0, 0.0, 0.0)
    panorama: NDArray[np.float32] | None = None


Light = DirectionalLight | PointLight | SphereLight | RectangleLight | EnvironmentLight


@dataclass(frozen=True)
class Medium:
    """What fills the space: homogeneous within `bounds` (everywhere if None), or thinning with height.

    Attributes
    ----------
    sigma_t : float
        Extinction [1/m]; with `scale_height`, at `base_z`: sigma_t exp(-(z - base_z) / scale_height).
    albedo : RGB
        Single-scattering albedo.
    g : float
        Mean cosine of scattering.
    bounds : ((x, y, z), (x, y, z)) or None
        Opposite corners of the box that it fills [m].
    scale_height : float or None
        [m]
    base_z : float
        [m]
    density : (nz, ny, nx) float32 or None
        Factors on `sigma_t` at the centres of as many cells of `bounds`, trilinear between them.
    droplet_diameter_um : float or None
        Scatter as water droplets of this size do (`materials.phase.droplets`) rather than by `g` [micrometres].

    The last two have no field in simulation/1.
    """

    sigma_t: float
    albedo: RGB = (1.0, 1.0, 1.0)
    g: float = 0.0
    bounds: tuple[RGB, RGB] | None = None
    scale_height: float | None = None
    base_z: float = 0.0
    density: NDArray[np.float32] | None = None
    droplet_diameter_um: float | None = None


@dataclass(frozen=True)
class AddedEffect:
    """Physics that no other field of the format holds, by its name in the catalogue of `evaluate.mismatch`.

    `target` is the name of a shape, light or frame, or None for everything. The parameter `map`, where there is one, is a
    texture: a mask or slopes over the shape's texture coordinates, or spots on the glass.
    """

    id: str
    target: str | None = None
    parameters: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Transport:
    """How far light is followed: `max_bounces` scattering events (1 is direct light), with or without `shadows`."""

    max_bounces: int = 8
    shadows: bool = True


@dataclass(frozen=True)
class Lens:
    """A pinhole, or a thin lens (`aperture_radius`, `focus_distance` [m]), with `k1`, `k2` of Brown-Conrady's distortion."""

    model: Literal["pinhole", "thin_lens"] = "pinhole"
    aperture_radius: float = 0.0
    focus_distance: float = math.inf
    k1: float = 0.0
    k2: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """How radiance becomes pixels: `linear`, or `gamma` (value ** (1 / gamma)); clipped at `saturation` if that is given."""

    response: Literal["linear", "gamma"] = "linear"
    gamma: float = 1.0
    saturation: float | None = None


@dataclass(frozen=True)
class Simulation:
    """Shapes, the materials they name, and the lights. Static shapes come first for the tracer's sake: it sorts them.

    What the tracer does not take from here (it is given its own arguments) is what a file says about how the image came about:
    `transport`, `lens`, `sensor`, and `effects` in the order in which they act.
    """

    shapes: tuple[Shape, ...]
    materials: dict[str, Material]
    lights: dict[str, Light] = field(default_factory=dict)
    transport: Transport = Transport()
    medium: Medium | None = None
    lens: Lens = Lens()
    sensor: Sensor = Sensor()
    effects: tuple[AddedEffect, ...] = ()
