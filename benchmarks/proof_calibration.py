"""How often `diagnose` cries wolf, and from which strength on it names the right effect.

Nulls: recordings by Mitsuba 3 with nothing left out, at reduced size, of several scenes and noise levels, with the free
parameters truly off, and lamps and poses off by up to what `TOLERANCE` says. Power: single effects at strengths from what
no one could see to what is plain, with the share that was named against the root-mean-square change in units of noise.
From the same runs, how often the intervals that `diagnose` states held the true value.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import beta

from evaluate.effects import catalogue
from evaluate.mismatch.case import load
from evaluate.mismatch.diagnose import Diagnosis, diagnose
from materials.foundation.files import make_folder, replacing, write_json
from materials.foundation.progress import tracked

from .peers import mitsuba
from .report import Report
from .sealed.generate import Tolerance, make
from .sealed.score import is_named

TOLERANCE = Tolerance(lamps=0.001, poses=0.02, noise=(0.5, 2.0))
_NULLS, _REPEATS, _SEED = "MENISCUS_NULLS", "MENISCUS_POWER_REPEATS", "MENISCUS_CALIBRATION_SEED"
_SIZE = (64, 48)
# Draws of the noise, at a level each, of one world.
_DRAWS = 5
_FALSE_ALARMS = 0.05
_STRENGTHS = (0.06, 0.12, 0.25, 0.5, 1.0)
_EFFECTS = (
    "exposure_drift", "light_position", "light_colour", "ambient_light", "albedo_error", "specular_lobe", "surface_wetness",
    "pose_error", "moved_object", "glare", "vignetting", "lens_distortion", "sensor_response", "saturation",
)  # fmt: skip
# By id: (name in the answer, name among the parameters of the finding, what the answer's value is called there).
_COMPARED = {
    "specular_lobe": [("alpha_u", "alpha"), ("scale", "specular_scale")],
    "vignetting": [("power", "power")],
    "glare": [("strength", "strength")],
    "lens_distortion": [("k1", "k1")],
    "sensor_response": [("gamma", "gamma")],
    "saturation": [("level", "level")],
    "surface_wetness": [("diffuse_factor", "diffuse_factor"), ("alpha_u", "alpha")],
}


@dataclass(frozen=True)
class Run:
    """One recording of a known strength, and what was said of it."""

    wanted: str
    kind: str
    strength: float
    rms_z: float
    verdict: str
    named: list[str]
    right: bool
    held: dict[str, bool]


def run(report: Report) -> None:
    """Run both studies; tables and pictures go to `proof/calibration` beside the report."""
    mi = mitsuba("llvm_ad_rgb")
    folder = make_folder(report.folder / "proof" / "calibration")
    seed = int(os.environ.get(_SEED, "1"))
    worlds = range(-(-int(os.environ.get(_NULLS, "200")) // _DRAWS))
    nulls = [r for i in tracked(worlds, "recordings of nothing left out") for r in trials(mi, [seed, 0, i], [], 0.0, _DRAWS)]
    consistent = sum(r.right for r in nulls)
    low = float(beta.ppf(0.05, consistent, len(nulls) - consistent + 1)) if consistent else 0.0
    name = f"nulls consistent ({consistent} of {len(nulls)}), one-sided 95 % lower bound"
    report.proof(name=name, value=low, bound=1 - _FALSE_ALARMS, holds=low >= 1 - _FALSE_ALARMS)
    repeats = int(os.environ.get(_REPEATS, "4"))
    plan = [(id, s, k) for id in _EFFECTS for s in _STRENGTHS for k in range(repeats)]
    power = [
        trials(mi, [seed, 1, i], [id], s * float(np.random.default_rng([seed, 2, i]).uniform(0.7, 1.4)))[0]
        for i, (id, s, _) in enumerate(tracked(plan, "recordings of known strength"))
    ]
    write_json(folder / "runs.json", [r.__dict__ for r in [*nulls, *power]])
    _power(report, power, folder)
    held = [h for r in power if r.right for h in r.held.values()]
    if held:
        share = float(np.mean(held))
        report.proof(name=f"90 % intervals that hold the truth ({len(held)})", value=share, bound=0.8, holds=share >= 0.8)


def trials(mi: Any, seed: list[int], ids: list[str], strength: float, draws: int = 1) -> list[Run]:
    """Make a recording, with several draws of its noise; diagnose each without its answer, and compare."""
    with tempfile.TemporaryDirectory() as folder:
        first, *more = [Path(folder) / str(k) for k in range(draws)]
        answer = make(mi, np.random.default_rng(seed), ids, strength, _SIZE, first, TOLERANCE, more)
        found = [diagnose(load(place), catalogue(), seed=1, say=lambda _: None) for place in (first, *more)]
    return [_compared(d, ids, strength, answer) for d in found]


def _compared(d: Diagnosis, ids: list[str], strength: float, answer: dict[str, Any]) -> Run:
    named = [f.id for f in d.findings]
    if ids:
        right = len(named) == 1 and is_named(ids[0], set(named))
    else:
        right = d.verdict == "consistent" and not named
    held = _held(d, answer["effects"][0]) if ids and right else {}
    return Run(ids[0] if ids else "", answer["kind"], strength, answer["rms_z"], d.verdict, named, right, held)


def _held(d: Diagnosis, truth: dict[str, Any]) -> dict[str, bool]:
    """Return for each parameter with a true value of its own whether its 90 % interval holds it."""
    found = d.findings[0]
    out = {}
    for theirs, ours in _COMPARED.get(truth["id"], []):
        if found.id == truth["id"] and ours in found.parameters and theirs in truth:
            low, high = found.parameters[ours]["ci90"]
            out[ours] = low <= truth[theirs] <= high
    return out


def _power(report: Report, runs: list[Run], folder: Path) -> None:
    """Fit a logistic curve to each effect's share of right answers over the strength, and draw them."""
    rows = [
        "| effect | runs | named rightly | a wrong name | half of them named at rms z | 90 % at rms z |",
        "|---|---|---|---|---|---|",
    ]
    figure, axes = plt.subplots(3, 5, figsize=(15, 8), sharey=True, layout="constrained")
    for axis, id in zip(axes.flat, _EFFECTS, strict=False):
        own = [r for r in runs if r.wanted == id]
        x, y = np.log([max(r.rms_z, 1e-3) for r in own]), np.array([r.right for r in own], float)
        middle, slope = _logistic(x, y)
        wrong = sum(bool(r.named) and not r.right for r in own)
        ninety = middle + np.log(9) / slope
        rows.append(f"| {id} | {len(own)} | {int(y.sum())} | {wrong} | {np.exp(middle):.2f} | {np.exp(ninety):.2f} |")
        grid = np.linspace(x.min() - 0.3, x.max() + 0.3, 100)
        axis.plot(np.exp(grid), 1 / (1 + np.exp(-slope * (grid - middle))), color="0.4")
        axis.scatter(np.exp(x), y + np.linspace(-0.03, 0.03, len(y)), s=14, c=["C0" if v else "C3" for v in y])
        axis.set(title=id, xscale="log", xlabel="rms change / noise")
    axes[0, 0].set_ylabel("named rightly")
    for axis in axes.flat[len(_EFFECTS) :]:
        axis.set_axis_off()
    figure.savefig(folder / "power.png", dpi=80)
    plt.close(figure)
    with replacing(folder / "power.md") as temporary:
        temporary.write_text("\n".join(rows) + "\n", encoding="utf-8")
    strong = [r for r in runs if r.rms_z > 1]
    if strong:
        share = float(np.mean([r.right for r in strong]))
        name = f"named rightly where the rms change is above the noise ({len(strong)})"
        report.proof(name=name, value=share, bound=0.9, holds=share >= 0.9)


def _logistic(x: NDArray, y: NDArray) -> tuple[float, float]:
    """Return (middle, slope) of the logistic curve of greatest likelihood; the slope is kept finite where runs part cleanly."""

    def loss(p: NDArray) -> float:
        t = np.exp(p[1]) * (x - p[0])
        return float(np.sum(np.logaddexp(0, t) - y * t) + 0.02 * (p[1] - 1) ** 2)

    best = min((minimize(loss, [m, 1.0], method="Nelder-Mead") for m in np.quantile(x, [0.2, 0.5, 0.8])), key=lambda r: r.fun)
    return float(best.x[0]), float(np.exp(best.x[1]))
