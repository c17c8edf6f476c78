"""Our path tracer and Mitsuba 3 photograph the same worlds and find the same light: small ones, and the wet street.

Both renderers make several pictures with different seeds. The spread over the seeds says how far apart their means may
be by chance. What "by chance" looks like for such skewed noise is not taken from a table: the same numbers are formed
from the same pictures with the renderers split half-half over both sides, where any difference between them cancels.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from materials.foundation.files import make_folder
from materials.foundation.progress import stage
from scene.camera import Camera
from scene.images import Encoding, write_image
from scene.simulation import DirectionalLight, Simulation
from scene.street import StreetSettings, street
from transport.mitsuba_export import export, photograph
from transport.render import render
from transport.world import compile_world

from .mitsuba_worlds import camera, worlds
from .peers import mitsuba
from .report import Report

_SEEDS = 8
_SMALL_SAMPLES, _STREET_SAMPLES = 64, 48
_BOUNCES = 8
_FRAME, _WETNESS = 0, 2 / 3
# The sun's disc ten times as wide, with the same irradiance: its mirrored glints, found by one path in millions and ten
# thousand times as bright as all else, become 100 times as frequent and 100 times weaker, and their mean comparable.
_SUN_RADIUS = 0.0465
_SIGNIFICANCE = 0.01


@dataclass(frozen=True)
class Agreement:
    """How two stacks of pictures (seeds, H, W, 3) of the same thing compare.

    Attributes
    ----------
    ratio, z : (3,)
        Ratio of the means over the image per channel, and their difference in standard errors.
    share, share_by_chance, share_error : float
        Share of pixels and channels whose difference exceeds 3 standard errors; the same of the split halves; and the
        standard error of their difference.
    error, error_by_chance, error_error : float
        Relative mean squared difference, likewise.
    """

    ratio: NDArray
    z: NDArray
    share: float
    share_by_chance: float
    share_error: float
    error: float
    error_by_chance: float
    error_error: float


def compare(ours: NDArray, theirs: NDArray) -> Agreement:
    """Compare two stacks of pictures; the number of seeds is even."""
    seeds = len(ours)
    half = seeds // 2

    def variance(x: NDArray) -> NDArray:
        # Within the halves, so that it is as independent of the split difference as of the true one.
        return 0.5 * (x[:half].var(axis=0, ddof=1) + x[half:].var(axis=0, ddof=1))

    # 1e-6 of a grey: where both see the bare sky there is no noise, and float32 rounding remains.
    sigma2 = (variance(ours) + variance(theirs)) / seeds + 1e-12
    difference = ours.mean(axis=0) - theirs.mean(axis=0)
    split = 0.5 * sum(x[:half].mean(axis=0) - x[half:].mean(axis=0) for x in (ours, theirs))
    scale = theirs.mean(axis=0) ** 2 + 1e-2
    far, far_split = (np.mean(np.abs(d) > 3 * np.sqrt(sigma2), axis=-1) for d in (difference, split))
    square, square_split = (np.mean(d * d / scale, axis=-1) for d in (difference, split))
    pixels = far.size
    return Agreement(
        ratio=ours.mean(axis=(0, 1, 2)) / theirs.mean(axis=(0, 1, 2)),
        z=difference.sum(axis=(0, 1)) / np.sqrt(sigma2.sum(axis=(0, 1))),
        share=float(far.mean()),
        share_by_chance=float(far_split.mean()),
        share_error=float(np.sqrt((far.var() + far_split.var()) / pixels)),
        error=float(square.mean()),
        error_by_chance=float(square_split.mean()),
        error_error=float(np.sqrt((square.var() + square_split.var()) / pixels)),
    )


def run(report: Report) -> None:
    """Record the agreement of every world, and write both pictures and their difference to `proof/mitsuba`."""
    mi = mitsuba("llvm_ad_rgb")
    folder = make_folder(Path(report.folder) / "proof" / "mitsuba")
    subjects = {name: (world, camera(), _SMALL_SAMPLES) for name, world in worlds().items()}
    subjects["wet street"] = (*wet_street(), _STREET_SAMPLES)
    # Three numbers for each world, and three channels in one of them.
    limit = float(norm.isf(0.5 * (1 - (1 - _SIGNIFICANCE) ** (1 / (5 * len(subjects))))))
    for name, (world, view, samples) in subjects.items():
        with stage(f"{name}, by both renderers"):
            ours, theirs = pictures(mi, world, view, samples)
        a = compare(ours, theirs)
        label = f"Mitsuba agrees, {name}"
        worst = int(np.argmax(np.abs(a.z)))
        report.proof(
            name=f"{label}: standard errors between the mean colours (ratio {a.ratio[worst]:.4f})",
            value=float(abs(a.z[worst])),
            bound=limit,
            holds=bool(abs(a.z[worst]) <= limit),
        )
        bound = a.share_by_chance + limit * a.share_error
        report.proof(name=f"{label}: share of pixels beyond 3 sigma", value=a.share, bound=bound, holds=a.share <= bound)
        bound = a.error_by_chance + limit * a.error_error
        report.proof(name=f"{label}: relative squared difference", value=a.error, bound=bound, holds=a.error <= bound)
        show(folder / f"{name.replace(', ', '_').replace(' ', '_')}.png", ours.mean(axis=0), theirs.mean(axis=0))


def wet_street() -> tuple[Simulation, Camera]:
    """Return the street's true wet world and its first camera, small."""
    world = street(StreetSettings(frames=2, width=320, height=135, lidar=False))
    simulation = world.simulation(_FRAME, _WETNESS)
    sun = simulation.lights["sun"]
    assert isinstance(sun, DirectionalLight)
    lights = simulation.lights | {"sun": replace(sun, angular_radius=_SUN_RADIUS)}
    return replace(simulation, lights=lights), world.cameras[_FRAME]


def pictures(mi: ModuleType, world: Simulation, view: Camera, samples: int) -> tuple[NDArray, NDArray]:
    """Return pictures (seeds, H, W, 3) by ours and by Mitsuba."""
    compiled = compile_world(world)
    ours = [render(compiled, view, samples, seed, max_bounces=_BOUNCES).radiance for seed in range(_SEEDS)]
    with tempfile.TemporaryDirectory() as folder:
        scene = export(mi, world, view, folder, _BOUNCES)
        theirs = [photograph(mi, scene, samples, seed) for seed in range(_SEEDS)]
    return np.array(ours, np.float64), np.array(theirs, np.float64)


def show(path: Path, ours: NDArray, theirs: NDArray) -> None:
    """Write ours, theirs, and four times their difference about grey, side by side."""
    panels = np.concatenate([ours, theirs, 0.214 + 4 * (ours - theirs)], axis=1 if ours.shape[1] < 200 else 0)
    write_image(path, panels, Encoding(".png", "uint8", 3, "srgb"))
