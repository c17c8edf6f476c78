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
# # What differs between two sets of photographs
#
# A simulation made elsewhere comes as pictures alone. `diagnose --simulated A --recorded B` asks what the camera did that the
# simulation does not know of; this is the same, step by step. First on pictures of our own, where the answer is known, then on
# photographs through clean and wet glass (Qian et al. 2018), if the folder that `MENISCUS_DATA` names has them.

# %%
import os
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np

from evaluate.effects import catalogue
from evaluate.effects.in_pictures import choose
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.pictures.case import Given, build
from evaluate.mismatch.pictures.noise import noise_of_pair
from scene.images import read_image

# %config InlineBackend.figure_formats = ["jpeg"]
# %config InlineBackend.print_figure_kwargs = {"pil_kwargs": {"quality": 75}, "bbox_inches": "tight"}


def show(pictures, width=10.0):
    """Show captioned pictures in a row."""
    _, axes = plt.subplots(1, len(pictures), figsize=(width, 2.6), dpi=72, squeeze=False, layout="constrained")
    for axis, (caption, picture) in zip(axes[0], pictures.items(), strict=True):
        axis.imshow(picture, cmap="gray", interpolation="nearest")
        axis.set_title(caption, fontsize=9)
        axis.axis("off")
    plt.show()


def display(linear):
    return np.clip(linear, 0, 1) ** (1 / 2.2)


# %% [markdown]
# ## Four pictures, and what a camera made of them
#
# The corners are darker, all is 4 % brighter, and there is noise. Nothing of that is told to the diagnosis.

# %%
rng = np.random.default_rng(3)
simulated = []
for _ in range(4):
    p = np.ones((72, 96, 3), np.float32) * rng.uniform(0.15, 0.35, 3).astype(np.float32)
    for _ in range(30):
        x, y, w, h = *rng.integers(0, [96, 72]), *rng.integers(5, 25, 2)
        p[y : y + h, x : x + w] = rng.uniform(0.03, 0.9, 3)
    simulated.append(cv2.GaussianBlur(p, (0, 0), 0.7))
simulated = np.stack(simulated)
row, col = np.mgrid[:72, :96] + 0.5
r2 = ((col - 48) ** 2 + (row - 36) ** 2) / 96**2
clean = 1.04 * simulated * (1 + r2[..., None]) ** -1.0
noise = np.sqrt(0.002**2 + 0.0003 * clean) * rng.standard_normal(clean.shape)
recorded = (clean + noise).astype(np.float32)
show({"simulated": display(simulated[0]), "recorded": display(recorded[0])})

# %%
found = noise_of_pair(recorded, simulated, np.ones(recorded.shape[:3], bool))
case, effects = choose(build(Given(recorded, simulated, ["0", "1", "2", "3"]), found, True), catalogue())
d = diagnose(case, effects, say=print)
print(d.verdict)
for f in d.findings:
    print(f.id, {k: round(p["value"], 3) for k, p in f.parameters.items() if not isinstance(p["value"], list)})
print(f"held-out frames {d.held_out.frames}: chi-square {d.held_out.chi2_before:.2f} before, {d.held_out.chi2_after:.2f} after")


# %%
def residual(picture):
    z = ((case.pictures[0] - picture) / np.sqrt(case.variance[0])).mean(axis=2)
    return 0.5 + np.clip(z, -6, 6) / 12


show({"residual before, ±6 sigma": residual(d.base.fit.picture[0]), "after": residual(d.best.fit.picture[0])}, 8)

# %% [markdown]
# What could not be tested, and why:

# %%
for why in dict.fromkeys(case.untestable.values()):
    print(f"{why}: {', '.join(k for k, v in case.untestable.items() if v == why)}")

# %% [markdown]
# ## Photographs through wet glass
#
# Clean glass is what was believed. The drops are found where the fine detail behind the glass is missing; how bright they
# are is a matter of three numbers, fitted on one pair and judged on the other.

# %%
data = Path(os.environ.get("MENISCUS_DATA", "../../shared/data")) / "raindrop_glass"


def small(file, n=5):
    picture = read_image(file)[0]
    height, width = (v // n * n for v in picture.shape[:2])
    return picture[:height, :width].reshape(height // n, n, width // n, n, 3).mean(axis=(1, 3))


if data.is_dir():
    S, R = (np.stack([small(f) for f in sorted((data / kind).glob("*.png"))]).astype(np.float32) for kind in ("clean", "rain"))
    found = noise_of_pair(R, S, np.ones(R.shape[:3], bool))
    case, effects = choose(build(Given(R, S, [str(i) for i in range(len(R))]), found, True), catalogue())
    d = diagnose(case, effects)
    print(d.verdict, [f.id for f in d.findings])
    print(f"held-out pair: RMSE {d.held_out.rmse_before:.4f} before, {d.held_out.rmse_after:.4f} after")
    drops = [t.aux.reshape(case.valid.shape)[0] for t in d.best.effects if t.effect.id == "lens_droplets"]
    masks = {"drops": drops[0]} if drops else {}
    show(
        {"clean": display(S[0]), "wet": display(R[0]), **masks, "predicted": display(d.best.fit.picture[0])},
    )
else:
    print("the photographs are not here; set MENISCUS_DATA to their folder")
