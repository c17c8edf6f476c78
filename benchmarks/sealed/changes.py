"""What a sender may have left out: each change turns the believed world into the true one, and says by how much.

A change takes a random generator, the true world so far and a strength (1: plain to see; 0.3: subtle), and returns what
it did. `CHANGES` holds those that the diagnosis should name, `UNLISTED` those that no catalogue has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .photograph import DEEP, Physics
from .worlds import Floats, World

# (picture (H, W, 3), frame) -> picture, before noise.
Develop = Callable[[NDArray, int], NDArray]


@dataclass(frozen=True)
class Truth:
    """A world as it is.

    Attributes
    ----------
    noise_gain : float
        Factor on the standard deviation that the recording states.
    effects : list of dict
        Id, `where` and parameters of what was changed.
    """

    world: World
    physics: Physics = field(default_factory=Physics)
    develop: tuple[Develop, ...] = ()
    noise_gain: float = 1.0
    effects: tuple[dict, ...] = ()
    samples: int = 64

    def named(self, id: str, where: str | None = None, /, **parameters: object) -> Truth:
        """Return the truth with one more effect on its list."""
        return replace(self, effects=(*self.effects, {"id": id, "where": where, **parameters}))


Change = Callable[[np.random.Generator, Truth, float], Truth]
CHANGES: dict[str, tuple[Change, tuple[str, ...]]] = {}
UNLISTED: dict[str, tuple[Change, tuple[str, ...]]] = {}
_ANY = ("studio", "corner", "street")
_TABLE = ("studio", "corner")


def change(kinds: tuple[str, ...] = _ANY, unlisted: bool = False) -> Callable[[Change], Change]:
    """Register a change, and the kinds of world that it can be seen in."""

    def register(function: Change) -> Change:
        (UNLISTED if unlisted else CHANGES)[function.__name__] = (function, kinds)
        return function

    return register


def _lamps(world: World, make: Callable[[str, dict], dict]) -> World:
    return replace(world, lights={name: make(name, light) for name, light in world.lights.items()})


def _unit(rng: np.random.Generator) -> Floats:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.choice([-1, 1]) * rng.uniform(low, high))


# ---- light


@change()
def exposure_drift(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    gains = np.exp(0.12 * s * rng.standard_normal(len(t.world.frames)))
    return replace(t, develop=(*t.develop, lambda p, i: p * gains[i])).named("exposure_drift", gains=gains.tolist())


@change(_TABLE)
def light_position(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    moved = str(rng.choice(sorted(t.world.lights)))
    d = 0.15 * s * _unit(rng)
    light = t.world.lights[moved]
    lights = t.world.lights | {moved: light | {"position": (np.array(light["position"]) + d).tolist()}}
    return replace(t, world=replace(t.world, lights=lights)).named("light_position", moved, offset=d.tolist())


@change(_TABLE)
def light_colour(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    factors = {name: np.exp(0.15 * s * rng.standard_normal(3)) for name in t.world.lights}
    world = _lamps(t.world, lambda n, light: light | {"intensity": (np.array(light["intensity"]) * factors[n]).tolist()})
    return replace(t, world=world).named("light_colour", factors={n: f.tolist() for n, f in factors.items()})


@change(_TABLE)
def near_field_light(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    # The generator has made the believed lamps directional.
    distance = 0.6 / s

    def near(_: str, light: dict) -> dict:
        towards = -np.array(light["direction"])
        return {
            "type": "point",
            "position": (distance * towards).tolist(),
            "intensity": (np.array(light["irradiance"]) * distance**2).tolist(),
        }

    return replace(t, world=_lamps(t.world, near)).named("near_field_light", distance=distance)


@change(_TABLE)
def light_extent(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    radius = 0.12 * s
    world = _lamps(t.world, lambda _, light: light | {"radius": radius})
    return replace(t, world=world, samples=256).named("light_extent", radius=radius)


@change(_TABLE)
def ambient_light(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    radiance = (0.06 * s * np.array([0.9, 1.0, 1.15])).tolist()
    lights = t.world.lights | {"ambient": {"type": "environment", "radiance": radiance}}
    return replace(t, world=replace(t.world, lights=lights), samples=256).named("ambient_light", radiance=radiance)


@change(("studio",))
def missing_occluder(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    from .worlds import _stone

    azimuth = rng.uniform(-np.pi, np.pi)
    centre = np.array([0.17 * np.cos(azimuth), 0.17 * np.sin(azimuth), rng.uniform(0.3, 0.4)])
    radius = 0.06 * s**0.5
    body = _stone(rng, centre, radius, np.full((4, 4, 3), 0.05))
    world = replace(t.world, bodies=t.world.bodies | {"unseen": body})
    return replace(t, world=world).named("missing_occluder", centre=centre.tolist(), radius=radius)


# ---- surface


def _spot(rng: np.random.Generator, size: int = 128, radius: float = 0.2) -> Floats:
    """Return a soft irregular spot (size, size) with values in [0, 1]."""
    v, u = np.meshgrid(*(2 * ((np.arange(size) + 0.5) / size,)), indexing="ij")
    cu, cv = rng.uniform(0.3, 0.7, 2)
    angle = np.arctan2(v - cv, u - cu)
    edge = radius * (1 + 0.2 * np.sin(3 * angle + rng.uniform(0, 6)))
    return 1 / (1 + np.exp((np.hypot(u - cu, v - cv) - edge) / 0.012))


@change()
def albedo_error(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    where = "plate"
    factor = 1 + _signed(rng, 0.2, 0.35) * s
    texture = t.world.bodies[where].texture
    texture = texture * (1 + (factor - 1) * _spot(rng, len(texture))[..., None])
    return replace(t, world=t.world.with_body(where, texture=texture)).named("albedo_error", where, factor=factor)


def _surface(t: Truth, id: str, where: str, **values: float) -> Truth:
    body = t.world.bodies[where]
    return replace(t, world=t.world.with_body(where, surface=body.surface | values)).named(id, where, **values)


@change(_TABLE)
def specular_lobe(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    alpha = rng.uniform(0.15, 0.35)
    return _surface(t, "specular_lobe", "object", scale=1.5 * s, alpha_u=alpha, alpha_v=alpha, eta=1.5)


@change(_TABLE)
def long_tail_lobe(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    return _surface(t, "long_tail_lobe", "object", scale2=2.5 * s, alpha2=rng.uniform(0.55, 0.8))


@change(_TABLE)
def anisotropy(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    ratio = 1 + 2.2 * s
    alpha = t.world.bodies["object"].surface["alpha_u"]
    u, v = (alpha / np.sqrt(ratio), alpha * np.sqrt(ratio))[:: int(rng.choice([-1, 1]))]
    return _surface(t, "anisotropy", "object", alpha_u=float(u), alpha_v=float(v), scale=4.0)


@change(_TABLE)
def rough_diffuse(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    return _surface(t, "rough_diffuse", str(rng.choice(["object", "plate"])), sigma=0.6 * s)


@change(_TABLE)
def retroreflection(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    return _surface(t, "retroreflection", "plate", retro=0.2 * s, retro_width=rng.uniform(0.3, 0.5))


@change(_TABLE)
def mesoscopic_normals(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    from .worlds import mottled

    where = "plate"
    slopes = [0.12 * s * (mottled(rng, 128, 8, 0.5) - 1) / 0.5 for _ in range(2)]
    normals = np.stack([*slopes, np.ones((128, 128))], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return replace(t, world=t.world.with_body(where, normal_map=normals)).named("mesoscopic_normals", where, slope=0.12 * s)


@change(("studio",))
def subsurface(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    body = t.world.bodies["object"]
    # Wide texels: a translucent body has no crisp pattern, and the believed albedo is its mean.
    path, albedo = 0.006 * s, [0.985, 0.975, 0.965]
    translucent = {"object": {"sigma_t": 1 / path, "albedo": albedo, "g": 0.0}}
    world = t.world.with_body("object", texture=np.broadcast_to(body.texture.mean(axis=(0, 1)), body.texture.shape))
    physics = replace(t.physics, translucent=translucent)
    named = replace(t, world=world, physics=physics, samples=512).named("subsurface", "object", mean_free_path=path, albedo=albedo)
    # Light has to be followed far to come out again, and is between the bodies too.
    return named.named("interreflection", max_bounces=DEEP - 1)


def _wet(rng: np.random.Generator, t: Truth, id: str, factor: float, /, **lobe: float) -> Truth:
    body = t.world.bodies["plate"]
    spot = _spot(rng, len(body.texture))
    texture = body.texture * (1 + (factor - 1) * spot[..., None])
    surface = body.surface | lobe | {"mask": spot}
    return replace(t, world=t.world.with_body("plate", texture=texture, surface=surface)).named(
        id, "plate", diffuse_factor=factor, **lobe
    )


@change(_TABLE)
def surface_wetness(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    return _wet(rng, t, "surface_wetness", 1 - 0.55 * s, scale=1.0, alpha_u=0.12, alpha_v=0.12, eta=1.33)


@change(_TABLE)
def water_film(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    return _wet(rng, t, "water_film", 1 - 0.4 * s, scale=1.0, alpha_u=0.05, alpha_v=0.05, eta=1.33)


# ---- geometry and transport


def _twist(rng: np.random.Generator, angle: float, shift: float) -> Floats:
    import cv2

    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(angle * _unit(rng))[0]
    pose[:3, 3] = shift * _unit(rng)
    return pose


@change()
def pose_error(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    far = 6.0 if t.world.kind == "street" else 0.7
    # A pose is that of a place, not of a picture: frames from one place share its error.
    errors: dict[bytes, Floats] = {}
    frames = []
    for pose, lit in t.world.frames:
        error = errors.setdefault(pose.tobytes(), _twist(rng, 0.006 * s, 0.003 * s * far))
        frames.append((pose @ error, lit))
    return replace(t, world=replace(t.world, frames=tuple(frames))).named("pose_error", angle=0.006 * s, shift=0.003 * s * far)


@change()
def moved_object(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    where = "post2" if t.world.kind == "street" else "object"
    body = t.world.bodies[where]
    twist = _twist(rng, 0.03 * s, 0.0)
    shift = (0.25 if where == "post2" else 0.008) * s * _unit(rng)
    centre = body.vertices.mean(axis=0)
    vertices = (body.vertices - centre) @ twist[:3, :3].T + centre + shift
    world = t.world.with_body(where, vertices=vertices, normals=body.normals @ twist[:3, :3].T)
    return replace(t, world=world).named("moved_object", where, translation=shift.tolist())


@change(("corner",))
def interreflection(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    bounces = 7 if s > 0.7 else 2
    return replace(t, physics=replace(t.physics, max_bounces=bounces), samples=512).named("interreflection", max_bounces=bounces)


# ---- medium


@change(("street",))
def participating_medium(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    medium = {"sigma_t": 0.05 * s, "albedo": 0.85, "g": 0.6, "bounds": [[-26, -8, -0.5], [26, 44, 18.5]]}
    return replace(t, physics=replace(t.physics, medium=medium), samples=512).named("participating_medium", **medium)


@change(("street",))
def height_fog(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    medium = {"sigma_t": 0.1 * s, "albedo": 0.85, "g": 0.6, "scale_height": 1.5, "base_z": 0.0}
    bounded = medium | {"bounds": [[-26, -8, -0.5], [26, 44, 18.5]]}
    return replace(t, physics=replace(t.physics, medium=bounded), samples=512).named("height_fog", **medium)


# ---- outside the catalogue


@change(_TABLE, unlisted=True)
def spot_lamp(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    """Each picture lit through a striped gobo: bands across the plate that belong to the lamp, not to the surface."""
    waves = {lit: rng.normal(size=2) * 0.09 for lit in {lit for _, lit in t.world.frames}}
    height, width = t.world.size[1], t.world.size[0]
    x, y = np.meshgrid(np.arange(width) * 160 / width, np.arange(height) * 160 / width)

    def bands(p: NDArray, i: int) -> NDArray:
        k = waves[t.world.frames[i][1]]
        return p * (1 + 0.2 * s * np.sin(2 * np.pi * (k[0] * x + k[1] * y)))[..., None]

    return replace(t, develop=(*t.develop, bands)).named("unlisted:spot_lamp")


@change(unlisted=True)
def channel_crosstalk(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    """Only where the picture is bright do its channels mix."""

    def mix(p: NDArray, _: int) -> NDArray:
        return p + 0.5 * s * p * np.roll(p, 1, axis=-1) - 0.3 * s * p * p

    return replace(t, develop=(*t.develop, mix)).named("unlisted:channel_crosstalk")


@change(unlisted=True)
def lens_ghost(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    return replace(t, develop=(*t.develop, lambda p, _: p + 0.08 * s * p[::-1, ::-1])).named("unlisted:lens_ghost")


@change(unlisted=True)
def row_flicker(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    rows = np.arange(t.world.size[1])
    phase = rng.uniform(0, 2 * np.pi, len(t.world.frames))

    def flicker(p: NDArray, i: int) -> NDArray:
        return p * (1 + 0.1 * s * np.sin(2 * np.pi * rows / 17 + phase[i]))[:, None, None]

    return replace(t, develop=(*t.develop, flicker)).named("unlisted:row_flicker")


@change(unlisted=True)
def column_pattern(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    columns = 0.02 * s * rng.standard_normal(t.world.size[0])
    return replace(t, develop=(*t.develop, lambda p, _: p + columns[None, :, None])).named("unlisted:column_pattern")
