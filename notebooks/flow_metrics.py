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
# # How wrong is a flow field, and where?
#
# Flow algorithms are scored here on two real pairs with true flow, Middlebury's RubberWhale (Baker et al. 2011) and a pair of
# KITTI 2015 (Menze and Geiger 2015), if the folder that `MENISCUS_DATA` names has them. Then on the built-in street, where the
# normal of every surface is known: do errors depend on how light meets the wet ground? `flow-eval` does the first part from
# the command line.

# %%
import os
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np

from evaluate.algorithms import estimate
from evaluate.flow_colour import scale_of, with_legend
from evaluate.flow_metrics import DEFINITIONS, DFE_CLASSES, difference_of, endpoint_error, score
from evaluate.plots import draw_heat_map, jet
from evaluate.reflectance_aware import GRAZING, MIRROR, heat_map, mirror_angle_deg, view_angle_deg
from scene.flow_files import as_flow, read_flow
from scene.images import encode, read_exr, read_image, read_raw
from scene.street import StreetSettings, street
from scene.street.sky import sun_direction
from transport.photograph import PhotographSettings, photograph
from transport.render import render
from transport.world import compile_world

# %config InlineBackend.figure_formats = ["jpeg"]
# %config InlineBackend.print_figure_kwargs = {"pil_kwargs": {"quality": 75}, "bbox_inches": "tight"}
data = Path(os.environ.get("MENISCUS_DATA", "../../shared/data"))
folder = Path("../out/notebooks/flow_metrics")


def show(pictures, columns=2, width=10.0):
    """Show captioned pictures row by row."""
    height, across = next(iter(pictures.values())).shape[:2]
    rows = -(-len(pictures) // columns)
    size = (width, rows * (width / columns * height / across + 0.3))
    _, axes = plt.subplots(rows, columns, figsize=size, dpi=72, squeeze=False, layout="constrained")
    for axis in axes.flat:
        axis.axis("off")
    for axis, (caption, picture) in zip(axes.flat, pictures.items()):
        axis.imshow(picture, interpolation="nearest")
        axis.set_title(caption, fontsize=9)
    plt.show()


# %% [markdown]
# ## Two real pairs
#
# What the numbers mean is printed with them. Truth may be sparse, as KITTI's is: only pixels with truth count.

# %%
MEASURES = ("epe", "epe_median", "angular_error", "fl_all", "over_1px", "wauc")
ALGORITHMS = ("horn-schunck", "brox", "dis")
PAIRS = {
    "RubberWhale": ("middlebury_rubberwhale", "frame10.png", "frame11.png", "flow10.flo"),
    "KITTI": ("kitti_flow_pair", "frame1.png", "frame2.png", "flow_gt.png"),
}
for measure in MEASURES:
    print(f"{measure}: {DEFINITIONS[measure]}")
fields, truths = {}, {}
for name, (where, *files) in PAIRS.items():
    if not (data / where).is_dir():
        print(f"{name} is not here; set MENISCUS_DATA to its folder")
        continue
    first, second = (read_raw(data / where / file) for file in files[:2])
    truths[name] = read_flow(data / where / files[2])
    print(f"\n{name:13}", *(f"{m:>13}" for m in MEASURES))
    for algorithm in ALGORITHMS:
        fields[name, algorithm] = as_flow(estimate(first, second, algorithm))
        result = score(fields[name, algorithm], truths[name])
        print(f"{algorithm:13}", *(f"{getattr(result, m):13.3f}" for m in MEASURES))

# %% [markdown]
# RubberWhale moves by a few pixels, and all three do well. The KITTI pair moves by 51 pixels on average, beyond what five
# levels of a pyramid bridge.
#
# ## In colours
#
# Hue is direction, saturation is length; the disc says which and how much. Black is unknown. Errors are in the colours of the
# thesis: blue is none, red the number in the caption.

# %%
for name, truth in truths.items():
    top = scale_of(truth)
    red = {"RubberWhale": 1.0, "KITTI": 60.0}[name]
    # Sparse truth is thickened to be seen.
    thick = 1 if name == "RubberWhale" else 5
    known = cv2.dilate(truth.valid.astype(np.uint8), np.ones((thick, thick), np.uint8)) > 0
    spread = np.stack(
        [cv2.dilate(np.where(truth.valid, truth.flow[..., i], -1e9), np.ones((thick, thick))) for i in (0, 1)], axis=-1
    )
    pictures = {f"{name}: truth": with_legend(as_flow(spread, known), top)}
    for algorithm in ALGORITHMS[1:]:
        pictures[f"{name}: {algorithm}"] = with_legend(fields[name, algorithm], top)
    error = endpoint_error(fields[name, ALGORITHMS[1]], truth)
    error = cv2.dilate(np.where(truth.valid, error, -1), np.ones((thick, thick)))
    pictures[f"{name}: end-point error of {ALGORITHMS[1]}, red {red:g} px"] = jet(np.where(error < 0, np.nan, error), red)
    show(pictures)

# %% [markdown]
# ## Two fields compared: difference flow error
#
# Where no truth is known, two fields can still be compared (thesis eq 4.1), in five classes.

# %%
for name in truths:
    difference = difference_of(endpoint_error(fields[name, "brox"], fields[name, "dis"]).ravel())
    print(f"{name}, brox and dis: mean difference {difference.mean:.3f} px")
    for words, share in zip(DFE_CLASSES, difference.classes, strict=True):
        print(f"  {100 * share:5.1f} %  {words}")

# %% [markdown]
# ## The built-in street, dry and truly wet
#
# Two frames of 320 x 135 pixels; the wet street is rendered from the world itself, with water where run-off leaves it.

# %%
world = street(StreetSettings(frames=2, width=320, height=135, detail=0.5, step=0.5))
photographs = PhotographSettings(samples=32)
recording = photograph(world, folder / "recording", photographs)
truth = read_flow(folder / "recording" / "truth" / "flow" / "0000.npy")
seen = truth.valid & (read_raw(folder / "recording" / "truth" / "visible" / "0000.png") > 0)


def truly_wet(frame):
    """Return a frame of the truly wet street, as its file would store it."""
    linear = render(compile_world(world.simulation(frame, 1.0)), world.cameras[frame], 32, seed=frame, clamp=photographs.clamp)
    return encode(linear.radiance, read_image(recording.frames[frame].image)[1])


pairs = {"dry": [read_raw(f.image) for f in recording.frames], "truly wet": [truly_wet(0), truly_wet(1)]}
errors, pictures = {}, {}
for kind, pair in pairs.items():
    field = as_flow(estimate(pair[0], pair[1], "brox"))
    errors[kind] = np.where(seen, endpoint_error(field, truth), np.nan)
    pictures[kind] = pair[0]
    pictures[f"{kind}: end-point error of brox, mean {np.nanmean(errors[kind]):.2f} px, red 2 px"] = jet(errors[kind], 2.0)
show(pictures)

# %% [markdown]
# ## Errors by how light meets the surface
#
# The reflectance-aware end-point error (thesis 5.4.2): every flow vector belongs to the angle between view and mirrored sun, and
# to that between view and normal. Each column of the heat maps adds up to 1, so that rare angles count as much as common ones.
# The sun stands beside and behind this camera, so that no pixel sees its mirror image: what the wet ground mirrors here is sky
# and houses, the more so the flatter the view.

# %%
camera = world.cameras[0]
_, rays = camera.rays(camera.pixel_centres())
wo = -rays.reshape(*seen.shape, 3)
stored = read_exr(folder / "recording" / "truth" / "normal" / "0000.exr")
n = np.stack([stored[f"normal.{axis}"] for axis in "XYZ"], axis=-1).astype(float)
# The ground is what faces upwards, below the horizon.
ground = seen & (np.abs(np.linalg.norm(n, axis=-1) - 1) < 1e-3) & (n[..., 2] > 0.9) & (wo[..., 2] > 0)
n_ground = n[ground] / np.linalg.norm(n[ground], axis=-1, keepdims=True)
sun = np.broadcast_to(sun_direction(), n_ground.shape)
angles = {MIRROR: mirror_angle_deg(n_ground, wo[ground], sun), GRAZING: view_angle_deg(n_ground, wo[ground])}

figure, axes = plt.subplots(2, 2, figsize=(10, 5.6), dpi=72, layout="constrained")
drawn = None
for row, (label, angle) in zip(axes, angles.items(), strict=True):
    low, high = np.nanpercentile(angle, (0.5, 99.5))
    maps = {kind: heat_map(angle, error[ground], np.linspace(low, high, 15)) for kind, error in errors.items()}
    top = max(np.nanmax(m.normalised()) for m in maps.values())
    for axis, (kind, map_) in zip(row, maps.items(), strict=True):
        drawn = draw_heat_map(axis, map_, top)
        axis.set_title(kind, fontsize=9)
        axis.set_xlabel(label, fontsize=8)
    assert drawn is not None
    figure.colorbar(drawn, ax=row, label="share of the column", shrink=0.8)
figure.supylabel("end-point error [px], upper ends", fontsize=9)
plt.show()
print(f"smallest angle to the mirrored sun: {np.nanmin(angles[MIRROR]):.0f} degrees")
for kind, error in errors.items():
    e = error[ground]
    for label, angle in angles.items():
        middle = np.nanmedian(angle)
        near, far = e[angle < middle].mean(), e[angle >= middle].mean()
        print(f"{kind:10} {label}: {near:.2f} px below {middle:.0f} degrees, {far:.2f} px above")

# %% [markdown]
# Steep views see the ground near the car, which moves by more pixels and leaves the picture: what counts is wet against dry
# at one angle, not one angle against another. Water moves errors up at all of them.
