"""Five kinds of light transport, traced by us and by Mitsuba 3 from the same files, are the same light."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from materials.foundation.files import make_folder, replacing
from materials.foundation.progress import stage
from transport.mitsuba_export import export, photograph
from transport.render import render
from transport.world import compile_world

from .five_scenes import FiveScene, five_scenes
from .peers import mitsuba
from .proof_street_mitsuba import Agreement, compare
from .report import Report

_SAMPLES, _SEEDS = 64, 8
_SIGNIFICANCE = 0.01


def run(report: Report) -> None:
    """Record the agreement of every scene; write files, pictures and z-scores to `proof/five_scenes`."""
    mi = mitsuba("llvm_ad_rgb")
    folder = make_folder(Path(report.folder) / "proof" / "five_scenes")
    scenes = five_scenes(folder / "files")
    # Three numbers for each, and three channels in one of them.
    limit = float(norm.isf(0.5 * (1 - (1 - _SIGNIFICANCE) ** (1 / (5 * len(scenes))))))
    for name, scene in scenes.items():
        with stage(f"{name}, by both renderers"):
            ours, theirs = pictures(mi, scene, _SAMPLES, range(_SEEDS))
        record(report, name, compare(ours, theirs), limit)
        show(folder / f"{name.replace(' ', '_')}.png", ours, theirs)


def pictures(mi, scene: FiveScene, samples: int, seeds: range) -> tuple[NDArray, NDArray]:
    """Return pictures (seeds, H, W, 3) by ours and by Mitsuba."""
    world = compile_world(scene.simulation)
    ours = [render(world, scene.camera, samples, seed, scene.bounces).radiance for seed in seeds]
    with tempfile.TemporaryDirectory() as folder:
        exported = export(mi, scene.simulation, scene.camera, folder, scene.bounces)
        theirs = [photograph(mi, exported, samples, seed) for seed in seeds]
    return np.array(ours, np.float64), np.array(theirs, np.float64)


def record(report: Report, name: str, a: Agreement, limit: float) -> None:
    """Report the three numbers of one scene against what chance allows."""
    worst = int(np.argmax(np.abs(a.z)))
    title = f"Mitsuba agrees, {name}: standard errors between the mean colours (ratio {a.ratio[worst]:.4f})"
    report.proof(name=title, value=float(abs(a.z[worst])), bound=limit, holds=bool(abs(a.z[worst]) <= limit))
    bound = a.share_by_chance + limit * a.share_error
    report.proof(name=f"Mitsuba agrees, {name}: share of pixels beyond 3 sigma", value=a.share, bound=bound, holds=a.share <= bound)
    bound = a.error_by_chance + limit * a.error_error
    report.proof(name=f"Mitsuba agrees, {name}: relMSE between the two", value=a.error, bound=bound, holds=a.error <= bound)


def show(path: Path, ours: NDArray, theirs: NDArray) -> None:
    """Write ours, theirs, and the z-scores of their difference (grey 0, white and black +-5), side by side and twice as large."""
    sigma = np.sqrt((ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / len(ours) + 1e-12)
    z = (ours.mean(axis=0) - theirs.mean(axis=0)) / sigma
    white = np.quantile(theirs.mean(axis=0), 0.99)
    panels = [(255 * np.clip(x.mean(axis=0) / white, 0, 1) ** (1 / 2.2)).astype(np.uint8) for x in (ours, theirs)]
    panels.append(np.clip(127.5 + 25.5 * z, 0, 255).astype(np.uint8))
    sheet = cv2.resize(np.concatenate(panels, axis=1), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    with replacing(path) as temporary:
        cv2.imwrite(str(temporary), np.ascontiguousarray(sheet[..., ::-1]))
