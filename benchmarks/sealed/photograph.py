"""Mitsuba 3 photographs a world, with what its lens and shutter do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .surface import DEFAULTS, NAME, register
from .worlds import Body, Floats, World

# (pixel positions (N, 2) relative to the image's centre, channel) -> positions in the ideal image, and back to it.
Warp = Callable[[Floats, int], Floats]
_MITSUBA_CAMERA = np.diag([-1.0, -1.0, 1.0, 1.0])  # x left, y up
_FINE, _MARGIN = 4, 0.15
# Longest paths through what scatters light inside.
DEEP = 64


@dataclass(frozen=True)
class Physics:
    """How light travels and the camera works beyond the world's own description.

    Attributes
    ----------
    max_bounces : int
    medium : dict or None
        `sigma_t`, `albedo`, `g`, `bounds`; with `scale_height` and `base_z` it thins exponentially upwards.
    translucent : dict of dict
        Bodies that are a medium without a surface: `sigma_t`, `albedo`, `g`.
    shutter : list of (F, 4, 4)
        Poses of the frames at equal steps through the exposure; empty: those of the world.
    rolling : bool
        Rows, instead of the whole image, go through the shutter's poses.
    lens : (radius, focus distance) or None
    warp : Warp or None
        Where in the ideal image each channel of a pixel looks.
    """

    max_bounces: int = 1
    medium: dict[str, Any] | None = None
    translucent: dict[str, dict[str, Any]] = field(default_factory=dict)
    shutter: tuple[Floats, ...] = ()
    rolling: bool = False
    lens: tuple[float, float] | None = None
    warp: Warp | None = None


def photograph(mi: ModuleType, world: World, physics: Physics, samples: int, seed: int) -> NDArray[np.float32]:
    """Return noise-free pictures (F, H, W, 3): mean radiance over each pixel's square.

    Parameters
    ----------
    samples : int
        Per pixel; a pixel of a warped picture is the mean of 16 finer ones.
    """
    register(mi)
    shapes = {name: _shape(mi, body, physics.translucent.get(name)) for name, body in world.bodies.items()}
    scenes: dict[tuple[str, ...], Any] = {}
    pictures = []
    for i, (pose, lit) in enumerate(world.frames):
        if lit not in scenes:
            scenes[lit] = _scene(mi, world, shapes, lit, physics)
        poses = [p[i] for p in physics.shutter] or [pose]
        each = max(1, samples // (1 if physics.rolling else len(poses)))
        views = [_view(mi, scenes[lit], world, p, physics, each, seed + 7919 * i + j) for j, p in enumerate(poses)]
        if physics.rolling:
            pictures.append(_by_row(np.array(views)))
        else:
            pictures.append(np.mean(views, axis=0))
    return np.array(pictures, np.float32)


def _by_row(views: NDArray) -> NDArray:
    """Return rows taken at their own time, linear between the views."""
    rows = views.shape[1]
    t = (np.arange(rows) + 0.5) / rows * (len(views) - 1)
    k = np.minimum(t.astype(int), len(views) - 2)
    share = (t - k)[:, None, None]
    row = np.arange(rows)
    return views[k, row] * (1 - share) + views[k + 1, row] * share


def _view(mi: ModuleType, scene: Any, world: World, pose: Floats, physics: Physics, samples: int, seed: int) -> NDArray:
    width, height = world.size
    if physics.warp is None:
        sensor = _sensor(mi, pose, world.focal, width, height, physics)
        return np.array(mi.render(scene, sensor=sensor, spp=samples, seed=seed))[..., :3]
    wide, high = int(width * _FINE * (1 + 2 * _MARGIN)), int(height * _FINE * (1 + 2 * _MARGIN))
    sensor = _sensor(mi, pose, world.focal * _FINE, wide, high, physics)
    fine = np.array(mi.render(scene, sensor=sensor, spp=max(1, samples // _FINE**2), seed=seed))[..., :3]
    x, y = np.meshgrid((np.arange(width * _FINE) + 0.5) / _FINE - width / 2, (np.arange(height * _FINE) + 0.5) / _FINE - height / 2)
    out = []
    for c in range(3):
        at = physics.warp(np.stack([x, y], -1).reshape(-1, 2), c).reshape(*x.shape, 2)
        # cv2 counts from texel centres.
        column, row = (
            (at[..., 0] * _FINE + wide / 2 - 0.5).astype(np.float32),
            (at[..., 1] * _FINE + high / 2 - 0.5).astype(np.float32),
        )
        warped = cv2.remap(np.ascontiguousarray(fine[..., c]), column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        out.append(warped.reshape(height, _FINE, width, _FINE).mean(axis=(1, 3)))
    return np.stack(out, -1)


def _sensor(mi: ModuleType, pose: Floats, focal: float, width: int, height: int, physics: Physics) -> Any:
    sensor: dict[str, Any] = {
        "type": "perspective",
        "fov": float(np.degrees(2 * np.arctan(width / (2 * focal)))),
        "fov_axis": "x",
        "near_clip": 1e-3,
        "far_clip": 1e4,
        "to_world": mi.ScalarTransform4f(pose @ _MITSUBA_CAMERA),
        "sampler": {"type": "independent"},
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
    }
    if physics.lens is not None:
        radius, distance = physics.lens
        sensor |= {"type": "thinlens", "aperture_radius": radius, "focus_distance": distance}
    if physics.medium is not None and _holds(physics.medium, pose[:3, 3]):
        sensor["medium"] = _medium(mi, physics.medium)
    return mi.load_dict(sensor)


def _holds(medium: dict[str, Any], point: Floats) -> bool:
    low, high = np.array(medium["bounds"])
    return bool(np.all(point > low) and np.all(point < high))


def _medium(mi: ModuleType, m: dict[str, Any]) -> dict[str, Any]:
    phase = {"type": "hg", "g": m["g"]}
    if "scale_height" not in m:
        albedo = {"type": "rgb", "value": list(np.broadcast_to(m["albedo"], 3).astype(float))}
        return {"type": "homogeneous", "sigma_t": m["sigma_t"], "albedo": albedo, "phase": phase}
    low, high = np.array(m["bounds"], float)
    # The grid's values sit at its nodes; it is constant in x and y.
    z = np.linspace(low[2], high[2], 256)
    density = m["sigma_t"] * np.exp(-np.maximum(z - m["base_z"], 0) / m["scale_height"])
    grid = np.broadcast_to(density[:, None, None, None], (256, 2, 2, 1)).astype(np.float32)
    t = mi.ScalarTransform4f
    to_world = t().translate(low.tolist()) @ t().scale((high - low).tolist())
    return {
        "type": "heterogeneous",
        "albedo": float(np.mean(m["albedo"])),
        "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid(np.ascontiguousarray(grid)), "to_world": to_world},
        "phase": phase,
    }


def _scene(mi: ModuleType, world: World, shapes: dict[str, Any], lit: tuple[str, ...], physics: Physics) -> Any:
    has_media = physics.medium is not None or physics.translucent
    deep = physics.translucent or (physics.medium is not None)
    depth = DEEP if deep else physics.max_bounces + 1
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "volpath" if has_media else "path", "max_depth": depth, "rr_depth": 16},
    }
    scene |= {f"body_{name}": shape for name, shape in shapes.items()}
    for name in lit:
        scene[f"light_{name}"] = _light(mi, world.lights[name])
    # An environment belongs to the world, not to a switch: it may be added beside the lamps.
    if "ambient" in world.lights and "ambient" not in lit:
        scene["light_ambient"] = _light(mi, world.lights["ambient"])
    if physics.medium is not None:
        low, high = np.array(physics.medium["bounds"], float)
        t = mi.ScalarTransform4f
        to_world = t().translate(((low + high) / 2).tolist()) @ t().scale(((high - low) / 2).tolist())
        scene["air"] = {"type": "cube", "to_world": to_world, "bsdf": {"type": "null"}, "interior": _medium(mi, physics.medium)}
    return mi.load_dict(scene)


def _light(mi: ModuleType, light: dict[str, Any]) -> dict[str, Any]:
    def rgb(value: Any) -> dict[str, Any]:
        return {"type": "rgb", "value": [float(v) for v in value]}

    if light["type"] == "point" and light.get("radius", 0) > 0:
        radius = light["radius"]
        radiance = np.array(light["intensity"]) / (np.pi * radius**2)
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        return {
            "type": "sphere",
            "center": list(light["position"]),
            "radius": radius,
            "bsdf": black,
            "emitter": {"type": "area", "radiance": rgb(radiance)},
        }
    if light["type"] == "point":
        return {"type": "point", "position": list(light["position"]), "intensity": rgb(light["intensity"])}
    if light["type"] == "directional":
        return {"type": "directional", "direction": list(light["direction"]), "irradiance": rgb(light["irradiance"])}
    return {"type": "constant", "radiance": rgb(light["radiance"])}


def _shape(mi: ModuleType, body: Body, translucent: dict[str, Any] | None) -> Any:
    mesh = mi.Mesh(
        "body",
        len(body.vertices),
        len(body.faces),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=_props(mi, body, translucent),
    )
    params = mi.traverse(mesh)
    params["vertex_positions"] = body.vertices.astype(np.float32).ravel()
    params["vertex_normals"] = body.normals.astype(np.float32).ravel()
    params["vertex_texcoords"] = body.uv.astype(np.float32).ravel()
    params["faces"] = body.faces.astype(np.uint32).ravel()
    params.update()
    return mesh


def _props(mi: ModuleType, body: Body, translucent: dict[str, Any] | None) -> Any:
    props = mi.Properties()
    if translucent is not None:
        props["bsdf"] = mi.load_dict({"type": "null"})
        props["interior"] = mi.load_dict(_medium(mi, translucent))
        return props
    surface = {key: value for key, value in body.surface.items() if key in DEFAULTS}
    mask = body.surface.get("mask")
    reflectance: dict[str, Any] = {
        "type": NAME,
        "albedo": _bitmap(mi, body.texture),
        "mask": {"type": "uniform", "value": 1.0} if mask is None else _bitmap(mi, np.asarray(mask)[..., None]),
        **DEFAULTS,
        **surface,
    }
    if body.normal_map is not None:
        reflectance = {
            "type": "normalmap",
            "normalmap": _bitmap(mi, 0.5 + 0.5 * body.normal_map),
            "use_shadowing_function": False,
            "flip_invalid_normals": False,
            "surface": reflectance,
        }
    props["bsdf"] = mi.load_dict({"type": "twosided", "surface": reflectance})
    return props


def _bitmap(mi: ModuleType, image: NDArray) -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(image, np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "repeat"}
