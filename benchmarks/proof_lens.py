"""A thin lens of ours and one of Mitsuba's blur the same world alike."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from scipy.stats import norm

from materials.foundation.files import make_folder
from scene.simulation import Lens
from transport.mitsuba_export import export, photograph
from transport.render import render
from transport.world import compile_world

from .mitsuba_worlds import camera, worlds
from .peers import mitsuba
from .proof_street_mitsuba import compare, show
from .report import Report

_SAMPLES, _SEEDS, _BOUNCES = 64, 8, 4
# In focus on the balls, 6.4 m away; the ground before them and the wall behind are blurred over several pixels.
_LENS = Lens("thin_lens", 0.25, 6.4)


def run(report: Report) -> None:
    """Record the agreement, and write both pictures and their difference to `proof/lens`."""
    mi = mitsuba("llvm_ad_rgb")
    world, view = worlds()["sky, sun, texture"], camera()
    compiled = compile_world(world)
    seeds = range(_SEEDS)
    ours = np.array([render(compiled, view, _SAMPLES, seed, _BOUNCES, lens=_LENS).radiance for seed in seeds], np.float64)
    with tempfile.TemporaryDirectory() as folder:
        scene = export(mi, world, view, folder, _BOUNCES, _LENS)
        theirs = np.array([photograph(mi, scene, _SAMPLES, seed) for seed in seeds], np.float64)
    a = compare(ours, theirs)
    # Three numbers, three channels in one of them, share 1 %.
    limit = float(norm.isf(0.5 * (1 - (1 - 0.01) ** (1 / 5))))
    worst = int(np.argmax(np.abs(a.z)))
    name = f"Mitsuba agrees, thin lens: standard errors between the mean colours (ratio {a.ratio[worst]:.4f})"
    report.proof(name=name, value=float(abs(a.z[worst])), bound=limit, holds=bool(abs(a.z[worst]) <= limit))
    bound = a.share_by_chance + limit * a.share_error
    name = "Mitsuba agrees, thin lens: share of pixels beyond 3 sigma"
    report.proof(name=name, value=a.share, bound=bound, holds=a.share <= bound)
    bound = a.error_by_chance + limit * a.error_error
    report.proof(name="Mitsuba agrees, thin lens: relative squared difference", value=a.error, bound=bound, holds=a.error <= bound)
    show(make_folder(Path(report.folder) / "proof" / "lens") / "thin_lens.png", ours.mean(axis=0), theirs.mean(axis=0))
