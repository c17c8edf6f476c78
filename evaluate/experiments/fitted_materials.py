"""Which reflectance model is good enough for optical flow? Chapter 5 of the thesis on virtual materials.

Nine samples are measured by the virtual dome (BTF), and Cook-Torrance, Ward's, Phong's model and GGX are fitted to each, with
and without estimated normals. Random scenes (5.4.1) are path-traced with all of them, in the same light and with the same
numbers; flow algorithms run on pairs of pictures, and their errors against the ray-traced flow are compared with those on the
BTF: their distributions (figures 5.6 and 5.7), how they lie about the highlights (5.8 and 5.9), and what the thesis concludes
from them, sentence by sentence. What is drawn again for intervals is scenes, never pixels.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.progress import stage, tracked
from materials.foundation.settings import as_dict
from scene.flow_files import as_flow
from scene.images import Encoding, encode
from scene.simulation import Material, Shape, Simulation
from transport.render import render
from transport.world import World, compile_world

from ..algorithms import algorithm
from ..flow_metrics import endpoint_error
from ..reflectance_aware import angles_of_scene
from ..report import Report
from .cache import Cache
from .fitted_report import Case, Shown, report
from .flow_errors import FlowErrors
from .random_scene import RandomScene, Truth, random_scene, truth_of
from .settings import FittedMaterialsSettings
from .virtual_materials import REFERENCE, VirtualMaterials, variants

_SRGB = Encoding(".png", "uint8", 3, "srgb")
# The share of pixels that a camera's exposure would let be as bright as a bright matte surface, and how bright that is.
_EXPOSED, _LEVEL = 0.9, 0.6


def run(settings: FittedMaterialsSettings, folder: Path) -> Report:
    """Run the experiment and return its report; pictures go below `folder`.

    Raises
    ------
    InputError
        If an algorithm is none.
    """
    for name in settings.algorithms:
        algorithm(name)
    cache = Cache(folder / "cache")
    materials = VirtualMaterials(settings, cache)
    costs = _costs(settings, materials)
    errors: dict[Case, list[FlowErrors]] = {}
    shown: dict[str, Shown] = {}
    lengths: list[float] = []
    repeats = max(round(settings.width / settings.texels), 1)
    indices = range(settings.scenes)
    for index in tracked(indices, "scenes", settings.scenes):
        scene = random_scene(index, settings.width, repeats, settings.ambient_share, settings.seed)
        world = compile_world(Simulation((Shape("surface", scene.mesh, "m"),), {"m": Material()}, scene.lights(0)))
        truth = truth_of(scene, world)
        lengths.append(float(np.linalg.norm(truth.flow[truth.counted], axis=-1).mean()))
        angles = angles_of_scene(truth.buffer.position, truth.buffer.normal, scene.cameras[0], scene.lamps[0])
        for sample in settings.materials:
            pictures: dict[str, NDArray] = {}
            exposure = 0.0
            for variant in variants(settings.models):
                pair = _photographs(settings, cache, materials, sample, variant, scene, index, world)
                if variant == REFERENCE:
                    exposure = _exposure(pair[0], truth)
                pictures[variant] = np.stack([encode(radiance * np.float32(exposure), _SRGB) for radiance in pair])
                for name in settings.algorithms:
                    error = _error(cache, name, pictures[variant], truth)
                    kept = truth.counted
                    record = FlowErrors.of(error[kept], angles[0][kept], angles[1][kept])
                    errors.setdefault(Case(sample, variant, name), []).append(record)
                    if index == settings.scenes - 1 and name == settings.algorithms[-1]:
                        shown.setdefault(sample, {})[variant] = (pictures[variant][0], np.where(kept, error, np.nan))
    return report(settings, errors, costs, shown, lengths, folder)


def _costs(settings: FittedMaterialsSettings, materials: VirtualMaterials) -> dict[tuple[str, str], tuple[float, float]]:
    """Fit all; return mean cost and mean relative variance by sample and variant."""
    out = {}
    for sample in settings.materials:
        for variant in variants(settings.models):
            if variant != REFERENCE:
                found = materials.fitted(sample, variant)
                out[sample, variant] = (float(np.nanmean(found.cost)), float(np.nanmean(found.relative_variance)))
    return out


def _photographs(
    settings: FittedMaterialsSettings,
    cache: Cache,
    materials: VirtualMaterials,
    sample: str,
    variant: str,
    scene: RandomScene,
    index: int,
    reuse: World,
) -> NDArray[np.float32]:
    """Return the radiance (2, H, W, 3) of both frames."""

    def take() -> NDArray[np.float32]:
        look = Material("measured", measured=materials.material(sample, variant))
        frames = []
        with stage(f"scene {index + 1}, {sample}, {variant}"):
            for frame, camera in enumerate(scene.cameras):
                simulation = Simulation((Shape("surface", scene.mesh, "m"),), {"m": look}, scene.lights(frame))
                # The same numbers for all materials, so that noise is no difference between them; others in each frame.
                seed = settings.seed + 7919 * (2 * index + frame)
                world = compile_world(simulation, reuse)
                frames.append(render(world, camera, settings.samples, seed, settings.bounces).radiance)
        return np.stack(frames)

    parts = {k: v for k, v in as_dict(settings).items() if k not in ("scenes", "materials", "models", "algorithms")}
    return cache.array(parts | {"what": "picture", "scene": index, "sample": sample, "variant": variant}, take)


def _exposure(radiance: NDArray[np.float32], truth: Truth) -> float:
    """Return the factor that makes the surface, its brightest tenth aside, as bright as pictures have it."""
    seen = truth.buffer.face >= 0
    return _LEVEL / max(float(np.quantile(radiance[seen].mean(axis=1), _EXPOSED)), 1e-9)


def _error(cache: Cache, name: str, pair: NDArray[np.uint8], truth: Truth) -> NDArray[np.float32]:
    """Return the end-point error of a pair's flow [px]."""
    flow = cache.array({"what": "flow", "algorithm": name, "pair": pair}, lambda: algorithm(name).estimate(pair[0], pair[1]))
    return endpoint_error(as_flow(flow), as_flow(truth.flow))
