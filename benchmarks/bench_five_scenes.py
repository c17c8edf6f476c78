"""Seconds to equal error against Mitsuba 3 on the five scenes of the proof.

Each renderer has its own best sampler, no denoiser, and is measured against a converged picture of its own: small differences
of modelling are no noise. Mitsuba's kernels are compiled before anything is timed, as ours are.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from types import ModuleType

import numba
import numpy as np
from numpy.typing import NDArray

from materials.foundation.files import make_folder
from materials.foundation.progress import stage
from transport.mitsuba_export import export, photograph
from transport.render import render
from transport.world import compile_world

from .five_scenes import FiveScene, five_scenes
from .peers import PeerMissing, mitsuba
from .report import Report
from .timing import paired

# Fewer samples, runs and threads may be asked for; both renderers get the same number of threads.
_SAMPLES, _RUNS, _THREADS = "MENISCUS_BENCH_SAMPLES", "MENISCUS_BENCH_RUNS", "MENISCUS_BENCH_THREADS"
# The references take this many times the samples: what they add to an error is then the same small share for both.
_CONVERGED = 16
_SEED = 1000
_VARIANTS = ("llvm_ad_rgb", "scalar_rgb")

Image = NDArray[np.float32]
Renderer = Callable[[int, int], Image]


def run(report: Report) -> None:
    """Measure every scene against both variants of Mitsuba, and report the geometric mean of the ratios."""
    samples, runs = int(os.environ.get(_SAMPLES, "64")), int(os.environ.get(_RUNS, "5"))
    scenes = five_scenes(make_folder(report.folder / "bench") / "five_scenes")
    converged: dict[str, Image] = {}
    for variant in _VARIANTS:
        try:
            mi = mitsuba(variant)
        except PeerMissing as error:
            report.failed(f"five scenes, {variant}", str(error))
            continue
        _limit_threads()
        ratios = []
        for name, scene in scenes.items():
            # Surfaces that Mitsuba lacks are written in Python, which its scalar variant interprets: no fair race.
            if scene.is_native or variant != "scalar_rgb":
                with stage(f"{name}, {variant}"):
                    ratios.append(_measure(report, mi, name, scene, converged, samples, runs))
        mean = float(np.exp(np.mean(np.log(ratios))))
        report.figure(
            name=f"five scenes, {len(ratios)} of them: geometric mean of the ratios", ours=mean, unit="1", peer=f"Mitsuba {variant}"
        )


def _measure(
    report: Report, mi: ModuleType, name: str, scene: FiveScene, converged: dict[str, Image], samples: int, runs: int
) -> float:
    world = compile_world(scene.simulation)

    def ours(count: int, seed: int = 0) -> Image:
        return render(world, scene.camera, count, seed, scene.bounces).radiance

    with tempfile.TemporaryDirectory() as folder:
        exported = export(mi, scene.simulation, scene.camera, folder, scene.bounces)

        def theirs(count: int, seed: int = 0) -> Image:
            return photograph(mi, exported, count, seed)

        if name not in converged:
            converged[name] = ours(_CONVERGED * samples, _SEED)
        target = relative_error(theirs(samples), theirs(_CONVERGED * samples, _SEED))
        needed = samples_for(target, ours, converged[name], samples)
        reached = relative_error(ours(needed), converged[name])
        pair = paired(lambda: ours(needed), lambda: theirs(samples), runs)
    height, width = scene.camera.height, scene.camera.width
    report.figure(
        name=f"{name}, {width} x {height}, {needed} and {samples} samples",
        ours=pair.ours,
        peer=f"Mitsuba {mi.__version__} {mi.variant()}",
        theirs=pair.theirs,
        unit="s",
        error_reached=max(reached, target),
    )
    return pair.ratio


def samples_for(target: float, picture: Renderer, converged: Image, near: int) -> int:
    """Return how many samples a renderer needs for an error: errors fall as a power of the samples, known from two counts."""
    counts = (max(near // 2, 1), 2 * near)
    errors = [relative_error(picture(n, 0), converged) for n in counts]
    slope = min(np.log(errors[1] / errors[0]) / np.log(counts[1] / counts[0]), -0.25)
    return max(int(np.ceil(counts[0] * (target / errors[0]) ** (1 / slope))), 1)


def relative_error(image: Image, reference: Image) -> float:
    """Return the relative mean squared error; a tenth of the mean keeps black from dividing."""
    a, b = image.astype(np.float64), reference.astype(np.float64)
    light = b.mean(axis=-1)
    return float((((a - b) ** 2).mean(axis=-1) / (light**2 + (0.1 * light.mean()) ** 2)).mean())


def _limit_threads() -> None:
    count = os.environ.get(_THREADS)
    if count is None:
        return
    import drjit  # pyright: ignore[reportMissingImports]

    numba.set_num_threads(int(count))
    drjit.set_thread_count(int(count))
