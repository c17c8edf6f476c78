"""Is a measured reflectance field real enough for optical flow? Chapter 4 of the thesis, on objects whose truth is known.

Two objects turn by a degree a frame under a dome of lamps. "Real" are path-traced pictures of the objects as they are, through a
camera with noise, lamps and camera being off by what a calibration leaves. "BTF" is the field that a virtual dome has measured
on a coarser mesh, "TEX" a matte texture that looks along the normal as the field does; both at several sizes of atlas, under the
calibrated lamps. Pictures are compared by their structure, flow fields by the difference flow error (eq 4.1).
"""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from materials.btf import BTF
from materials.directions import solid_angles
from materials.foundation.errors import InputError
from materials.foundation.progress import stage, tracked
from materials.foundation.settings import as_dict
from scene.flow_files import as_flow
from scene.images import Encoding, encode
from scene.mesh import Mesh
from scene.simulation import Material, Shape, Simulation, Transport
from transport.gbuffer import gbuffer
from transport.mesh_dome import MeshDome, MeshDomeSettings
from transport.render import render
from transport.world import compile_world

from ..algorithms import algorithm
from ..flow_metrics import endpoint_error
from ..images import ssim_map
from ..report import Report
from .cache import Cache
from .reflectance_fields_report import REAL, Differences, Field, Shown, report
from .settings import ReflectanceFieldsSettings
from .turntable import OBJECTS, TurntableObject
from .turntable_scene import Turntable, as_calibrated, as_it_is

_SRGB = Encoding(".png", "uint8", 3, "srgb")
# What becomes white: the object's brightest, but for this share of it.
_WHITE = 0.98
# Light in a body is noisier, and costs less a path, than light on a surface that meets all lamps: so many times the paths.
_WITHIN = 16
_Look = tuple[Mesh, Material]


def run(settings: ReflectanceFieldsSettings, folder: Path) -> Report:
    """Run the experiment and return its report; pictures go below `folder`.

    Raises
    ------
    InputError
        If an algorithm is none, or a size of atlas is out of range.
    """
    for name in settings.algorithms:
        algorithm(name)
    if not settings.texels or min(settings.texels) < 8 or max(settings.texels) > 4096:
        raise InputError("be sizes from 8 to 4096", got=list(settings.texels), key="texels")
    cache = Cache(folder / "cache")
    differences, fields, shown = Differences(), [], {}
    for name in settings.objects:
        made = OBJECTS[name](settings.detail, settings.seed)
        looks: dict[str, _Look] = {REAL: (made.fine, made.material)}
        for size in settings.texels:
            field, seconds = _measured(settings, cache, made, size)
            texture = straight_texture(field)
            looks[f"BTF {size}"] = (made.coarse, Material("measured", measured=field))
            looks[f"TEX {size}"] = (made.coarse, Material("lambert", albedo_texture=texture))
            fields.append(Field(name, size, field.num_bytes, field.relative_error, seconds))
        for view in settings.views:
            shown[name, view] = _compare(settings, cache, name, view, looks, differences)
    return report(settings, differences, fields, shown, folder)


def _measured(settings: ReflectanceFieldsSettings, cache: Cache, made: TurntableObject, size: int) -> tuple[BTF, float]:
    """Return the object's reflectance field, and how long the dome took [s]."""
    how = MeshDomeSettings(
        lights=settings.directions,
        views=settings.directions,
        samples=settings.dome_samples,
        bounces=settings.bounces,
        rank=settings.rank,
        some=16 * settings.rank,
        seed=settings.seed,
    )

    def measure() -> dict[str, NDArray]:
        start = time.perf_counter()
        world = Simulation((Shape(made.name, made.fine, "own"),), {"own": made.material}, {}, Transport(settings.bounces))
        with stage(f"dome: {made.name}, {size} x {size} texels"):
            found = MeshDome(world, made.reach, how).btf(made.coarse, size, size)
        told = {"wi": found.wi, "wo": found.wo, "spatial": found.spatial[0], "angular": found.angular[0]}
        return told | {"error": np.array(found.relative_error), "seconds": np.array(time.perf_counter() - start)}

    parts = {"what": "field", "object": made.name, "detail": settings.detail, "size": size, "dome": as_dict(how)}
    a = cache.arrays(parts | {"object_seed": settings.seed}, measure)
    mask = np.ones((size, size), bool)
    field = BTF(a["wi"], a["wo"], mask, (a["spatial"],), (a["angular"],), np.eye(3), float(a["error"]), "1/sr", made.name)
    return field, float(a["seconds"])


def straight_texture(btf: BTF) -> NDArray[np.float32]:
    """Return the radiance (H, W, 3) that each texel sends along its normal under even light of radiance 1, from above the rim.

    What a texture of an object is, photographed with best practice (thesis, 4.3.2), and the albedo of a matte surface that
    would look so. Light below the rim of what was measured is made up for by what a matte surface would lose without it.
    """
    cos, share = btf.wi[:, 2], solid_angles(btf.wi)
    share = share * np.pi / float(share @ cos)
    view = int(np.argmax(btf.wo[:, 2]))
    groups = [s @ np.einsum("i,kig->kg", share, a[:, :, view]) for s, a in zip(btf.spatial, btf.angular, strict=True)]
    colours = np.concatenate(groups, axis=1) @ btf.colour.T
    return np.clip(colours, 0, 1).reshape(*btf.mask.shape, -1).astype(np.float32)


def _compare(
    settings: ReflectanceFieldsSettings, cache: Cache, name: str, view: str, looks: dict[str, _Look], differences: Differences
) -> Shown:
    """Photograph a sequence with every look, and gather how pictures and flow fields differ from the real ones."""
    pictures = {look: _sequence(settings, cache, name, view, look, *looks[look]) for look in looks}
    regions = _regions(settings, name, view, looks[REAL])
    real = pictures[REAL]
    white = max(float(np.quantile(real[regions].max(axis=-1), _WHITE)), 1e-9)
    real = _noisy(real / np.float32(white), settings, [settings.objects.index(name), settings.views.index(view)])
    shown: Shown = {REAL: (_encoded(real[0]), None, None)}
    flows = {a: _flows(cache, a, real) for a in settings.algorithms}
    for look in list(looks)[1:]:
        own = pictures[look] / np.float32(white)
        likeness = [ssim_map(_unit(r), _unit(o), 1.0) for r, o in zip(real, own, strict=True)]
        differences.likeness[name, view, look] = [float(m[region].mean()) for m, region in zip(likeness, regions, strict=True)]
        for a in settings.algorithms:
            found = _flows(cache, a, own)
            errors = [endpoint_error(as_flow(f), as_flow(r)) for f, r in zip(found, flows[a], strict=True)]
            differences.flow[name, view, look, a] = [e[region] for e, region in zip(errors, regions[:-1], strict=True)]
            if a == settings.algorithms[min(1, len(settings.algorithms) - 1)]:
                shown[look] = (_encoded(own[0]), likeness[0], np.where(regions[0], errors[0], np.nan))
    return shown


def _sequence(
    settings: ReflectanceFieldsSettings, cache: Cache, name: str, view: str, look: str, mesh: Mesh, material: Material
) -> NDArray[np.float32]:
    """Return the radiance (frames, H, W, 3) of a sequence."""
    place: Turntable = as_it_is(settings, name, view) if look == REAL else as_calibrated(settings, name, view)

    def take() -> NDArray[np.float32]:
        out = []
        for frame in tracked(range(settings.frames), f"{name}, {view}, {look}"):
            world = compile_world(place.scene(frame, mesh, material, settings.bounces))
            # Whatever is photographed has numbers of its own: noise that is alike would be no difference.
            seed = (settings.seed + crc32(f"{look}, {frame}".encode())) % (1 << 31)
            samples = settings.samples * (1 if material.interior is None else _WITHIN)
            out.append(render(world, place.camera, samples, seed, settings.bounces).radiance)
        return np.stack(out)

    left_out = ("objects", "views", "algorithms", "texels", "read_noise", "shot_noise")
    parts = {k: v for k, v in as_dict(settings).items() if k not in left_out}
    return cache.array(parts | {"what": "sequence", "object": name, "view": view, "look": look}, take)


def _regions(settings: ReflectanceFieldsSettings, name: str, view: str, look: _Look) -> NDArray[np.bool_]:
    """Return the pixels (frames, H, W) that see the real object."""
    place = as_it_is(settings, name, view)
    matte = replace(look[1], model="lambert", interior=None, metal=None)
    out = []
    for frame in range(settings.frames):
        world = compile_world(place.scene(frame, look[0], matte, 1))
        out.append(gbuffer(world, place.camera).shape == 0)
    return np.stack(out)


def _noisy(pictures: NDArray[np.float32], settings: ReflectanceFieldsSettings, key: list[int]) -> NDArray[np.float32]:
    rng = np.random.default_rng([settings.seed, 13, *key])
    sigma = np.sqrt(settings.read_noise**2 + settings.shot_noise * np.maximum(pictures, 0))
    return np.maximum(pictures + sigma * rng.standard_normal(pictures.shape), 0).astype(np.float32)


def _flows(cache: Cache, name: str, pictures: NDArray[np.float32]) -> list[NDArray]:
    """Return the flow of each pair of consecutive pictures, which are linear: each algorithm sees of their range what it can."""
    return [
        cache.array({"what": "flow", "algorithm": name, "pair": np.stack(pair)}, lambda p=pair: algorithm(name).estimate(*p))
        for pair in pairwise(pictures)
    ]


def _encoded(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.asarray(encode(np.clip(picture, 0, 1), _SRGB), np.uint8)


def _unit(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a picture as it is looked at: on the sRGB curve, white is 1."""
    return _encoded(picture).astype(np.float32) / np.float32(255)
