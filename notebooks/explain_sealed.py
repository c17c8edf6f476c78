# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # What a simulation leaves out of a recording, step by step
#
# The recordings were rendered with Mitsuba 3, which shares no code with this project; each simulation beside them leaves out
# nothing, one or two pieces of physics. First one recording is diagnosed a step at a time, then three more at once; the
# answers are opened at the end. They do not come with the project: `MENISCUS_DATA` names their folder, and without it nothing
# below runs. `make proof ARGS="--only sealed"` makes new recordings, more of them, and seals their answers by a hash first.

# %%
import json
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown, display
from matplotlib_inline.backend_inline import set_matplotlib_formats

from benchmarks.data import data_folder
from benchmarks.peers import PeerMissing
from evaluate.effects import catalogue
from evaluate.mismatch.attribute import SearchSettings, assess, search
from evaluate.mismatch.calibrate import calibrate
from evaluate.mismatch.case import load
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.locate import dependences, located
from evaluate.mismatch.outputs import write_diagnosis
from evaluate.mismatch.report import sentence

try:
    folder = data_folder() / "sealed-practice"
    recordings = sorted(p.parent for p in folder.glob("*/simulation.json"))
except PeerMissing as missing:
    folder, recordings = None, []
    print(missing)
out = Path("../out/notebooks/explain_sealed")
set_matplotlib_formats("jpeg", pil_kwargs={"quality": 75})


def quiet(text):
    """Say nothing while a diagnosis goes on."""


def pictures(columns, height=2.0):
    """Show pictures (H, W) or (H, W, 3) side by side, each with its title."""
    _, axes = plt.subplots(1, len(columns), figsize=(3 * len(columns), height), layout="constrained")
    for axis, (title, picture, options) in zip(axes, columns, strict=True):
        axis.imshow(np.clip(picture, 0, 1) ** (1 / 2.2) if picture.ndim == 3 else picture, **options)
        axis.set(title=title, xticks=[], yticks=[])
    plt.show()


# %% [markdown]
# ## Calibrate
#
# The parameters that the sender did not know exactly (scales of albedos here) are fitted first, robustly, before anything is
# blamed. What then differs is looked at in units of the sensor's noise.

# %%
if recordings:
    case = load(recordings[4])
    fitted, weight = calibrate(case)
    before = assess(case, weight, fitted)
    z = (case.pictures - fitted.picture) * np.sqrt(weight)
    print(f"{case.num_frames} frames, {len(np.unique(case.pose))} views, {len(np.unique(case.lit))} lights")
    print(f"held-out chi-square a value {before.total / (weight > 0).sum():.3f}")

# %% [markdown]
# ## Locate
#
# Averages of the residual over 3, 7 and 15 pixels against the largest that noise would show anywhere.

# %%
if recordings:
    where = located(case, z, before.white)
    frame = int(np.argmax(where.mean(axis=(1, 2))))
    scale = float(np.quantile(case.pictures[frame], 0.99))
    diverging = {"cmap": "RdBu_r", "vmin": -4, "vmax": 4}
    pictures(
        [
            ("recorded", case.pictures[frame] / scale, {}),
            ("simulated", fitted.picture[frame] / scale, {}),
            ("difference / noise", z[frame].mean(axis=-1), diverging),
            ("located", where[frame].astype(float), {"cmap": "gray"}),
        ]
    )
    for d in dependences(case, z, fitted.picture, before.white)[:5]:
        print(f"stands still in {d.name:22} excess variance {d.excess:.3f}")

# %% [markdown]
# ## Attribute
#
# Each effect of the catalogue is fitted together with the free parameters and judged on views and lights that it was not
# fitted to; then each is tried on top of the best, until nothing more gains enough.

# %%
if recordings:
    base, best, trials = search(case, weight, fitted, catalogue(), SearchSettings(), quiet)
    rows = ["| on top of | effect | where | gain in held-out chi-square | standard errors |", "|---|---|---|---|---|"]
    for t in sorted((t for t in trials if t.full), key=lambda t: -t.gain)[:8]:
        rows.append(f"| {', '.join(t.on_top_of)} | {t.id} | {t.target or '–'} | {t.gain:.4f} | {t.sigmas:.0f} |")
    display(Markdown("\n".join(rows)))

# %% [markdown]
# ## Model, and what remains
#
# `diagnose` does all of this, takes out again what is not needed, holds what is left against smooth gains that are no
# physics, and proves it on frames that no fit saw.

# %%
if recordings:
    d = diagnose(case, catalogue(), seed=1, say=quiet)
    print(d.verdict + ":", sentence(d))
    for f in d.findings:
        for name, p in f.parameters.items():
            low, high = p.get("ci90") or (np.nan, np.nan)
            interval = f" (90 %: {low:.4g} to {high:.4g})" if np.isscalar(low) and np.isfinite(low) else ""
            print(f"  {f.id}.{name}: {p['value']}{interval}")
        for r in f.decoys:
            print(f"  in its place {r.title} leaves {r.gain:.3f} more, {r.sigmas:.0f} standard errors")
    h = d.held_out
    print(f"on frames {h.frames}: chi-square {h.chi2_before:.3f} -> {h.chi2_after:.3f}")
    print(f"RMSE {h.rmse_before:.5f} -> {h.rmse_after:.5f}")
    left = ((case.pictures - d.predicted) * np.sqrt(weight))[frame].mean(axis=-1)
    pictures(
        [
            ("recorded", case.pictures[frame] / scale, {}),
            ("with what was found", d.predicted[frame] / scale, {}),
            ("difference / noise", left, diverging),
            ("affected", d.affected[frame].astype(float), {"cmap": "gray"}),
        ]
    )

# %% [markdown]
# ## Three more, then the answers

# %%
if recordings:
    found = {recordings[4].name: (d, np.nan)}
    for recording in (recordings[0], recordings[1], recordings[6]):
        start = time.perf_counter()
        other = diagnose(load(recording), catalogue(), seed=1, say=quiet)
        write_diagnosis(out / recording.name, other)
        found[recording.name] = other, time.perf_counter() - start
    answers = json.loads((folder / "answers.json").read_text())
    rows = ["| left out | verdict | named | χ² before → after | overlap with what is affected | s |", "|---|---|---|---|---|---|"]
    for name, (x, seconds) in found.items():
        with np.load(folder / "answers" / f"{name}.npz") as arrays:
            truth = arrays["affected"]
        union = (truth | x.affected).sum()
        overlap = (truth & x.affected).sum() / union if union else 1.0
        true = ", ".join(e["id"] for e in answers[name]["effects"]) or "nothing"
        named = ", ".join(f.id for f in x.findings) or "–"
        chi2 = f"{x.held_out.chi2_before:.2f} → {x.held_out.chi2_after:.2f}"
        rows.append(f"| {true} | {x.verdict} | {named} | {chi2} | {overlap:.2f} | {seconds:.0f} |")
    display(Markdown("\n".join(rows)))
