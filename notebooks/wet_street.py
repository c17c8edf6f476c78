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
# # A street, dry and wet
#
# All of meniscus in one walk, on the street that comes with it: photograph a drive, reconstruct the scene from what a car
# would have recorded, decide where water lies, split the ground's light into diffuse and mirrored, and wet it. As the
# street is made up, the truly wet street can be rendered too: it says how near the augmentation comes.
#
# Everything is small here, 3 frames of 320 x 135 pixels, and takes one or two minutes; the first time the tracer is
# compiled too. `make demo` does the same in full size.

# %%
import os
from pathlib import Path

# Open3D otherwise starts a viewer of its own in notebooks.
os.environ["OPEN3D_DISABLE_WEB_VISUALIZER"] = "true"

import matplotlib.pyplot as plt
import numpy as np

from scene import BuildSettings
from scene.images import encode, read_raw
from scene.reconstruction.build import build
from scene.reconstruction.preview import oblique_view
from scene.street import StreetSettings, street
from scene.wetting.water import water_level
from transport.augment import AugmentSettings, estimate_sky_gain, separate_frame
from transport.photograph import PhotographSettings, photograph
from transport.projected_world import project_frame
from transport.render import render
from transport.separate import water_normals
from transport.wet import wet_frame
from transport.world import compile_world

# %config InlineBackend.figure_formats = ["jpeg"]
# %config InlineBackend.print_figure_kwargs = {"pil_kwargs": {"quality": 80}, "bbox_inches": "tight"}
folder = Path("../out/notebooks/wet_street")


def show(pictures, width=11.0):
    """Show captioned pictures in a row."""
    height, columns = next(iter(pictures.values())).shape[:2]
    size = (width, width / len(pictures) * height / columns + 0.3)
    _, axes = plt.subplots(1, len(pictures), figsize=size, dpi=72, squeeze=False, layout="constrained")
    for axis, (caption, picture) in zip(axes[0], pictures.items(), strict=True):
        axis.imshow(picture, cmap="gray", interpolation="nearest")
        axis.set_title(caption, fontsize=9)
        axis.axis("off")
    plt.show()


# %% [markdown]
# ## Photograph
#
# A `Street` is a world of which all is known. `photograph` renders the drive through it and adds what else a car records:
# LiDAR sweeps with 1 cm of noise, poses, and masks of what moves. Pictures that are there already are kept.

# %%
world = street(StreetSettings(frames=3, width=320, height=135, detail=0.5))
photographs = PhotographSettings(samples=16)
recording = photograph(world, folder / "recording", photographs)
show({f"frame {frame.name}": read_raw(frame.image) for frame in recording.frames})

# %% [markdown]
# ## Build
#
# From here on only the recording is used. `build` keeps its stages: change a setting, and only what depends on it is made
# again.

# %%
scene = build(recording, folder / "scene", BuildSettings())
print(f"triangles: {scene.ground.num_faces} of ground, {scene.environment.num_faces} of what stands on it")
show({"the reconstruction, from behind and above": oblique_view(scene, 640, 300)}, 7.0)

# %% [markdown]
# ## Where the water is
#
# The scene has maps of the ground on a metric grid, among them its height, how well each place holds water (M) and a
# pattern of puddles. With the global wetness w they give the water level W: up to 0.5 water fills the pores, above it
# stands.

# %%
left, right, bottom, top = extent = (2, 30, -7, 7)
x, y = scene.grid.centres()
window = np.ix_((y[:, 0] > bottom) & (y[:, 0] < top), (x[0] > left) & (x[0] < right))
measured = np.where(scene.maps["coverage"][window] > 0, 1, np.nan)
maps = {
    "height [m]": scene.maps["height"],
    "holds water, M": scene.maps["mask"],
    "pattern of puddles": scene.maps["puddles"],
    "W at w = 1/3": water_level(scene.maps, scene.grid, 1 / 3),
    "W at w = 2/3": water_level(scene.maps, scene.grid, 2 / 3),
    "W at w = 1": water_level(scene.maps, scene.grid, 1.0),
}
figure, axes = plt.subplots(2, 3, figsize=(11, 4.4), dpi=72, layout="constrained")
for axis, (caption, values) in zip(axes.flat, maps.items(), strict=True):
    look = {"cmap": "Blues", "vmin": 0, "vmax": 1} if caption.startswith("W") else {"cmap": "viridis"}
    drawn = axis.imshow(values[window] * measured, origin="lower", extent=extent, **look)
    figure.colorbar(drawn, ax=axis, shrink=0.8)
    axis.set_title(caption, fontsize=9)
plt.show()

# %% [markdown]
# ## Two kinds of light
#
# The picture is projected onto the reconstruction, and the gloss of the dry ground is traced in that world. Taken off the
# picture it leaves the diffuse light. The sky above the picture is a guess; `estimate_sky_gain` lowers it to what the
# pictures allow.

# %%
settings = AugmentSettings(samples=16)
normals = water_normals(scene.maps["height"], scene.maps["coverage"], scene.grid.cell)
gain = estimate_sky_gain(scene, [0, 1, 2], normals, settings)
frame = project_frame(scene, 1, sky_gain=gain)
parts = separate_frame(frame, scene, normals, settings)

gloss = parts.scale * parts.specular
share = gloss[frame.is_ground].mean() / frame.image[frame.is_ground].mean()
print(f"unseen sky at {gain:.2f} of its level; {100 * share:.0f} % of the ground's light is mirrored")
pictures = {"recorded": frame.image, "diffuse": parts.diffuse, "mirrored by the ground, 4 times": 4 * gloss}
show({caption: encode(linear, frame.encoding) for caption, linear in pictures.items()})

# %% [markdown]
# ## Wet it
#
# Full pores darken, standing water mirrors.

# %%
wet = {}
for w in (1 / 3, 2 / 3, 1.0):
    wet[w] = wet_frame(frame, parts, water_level(scene.maps, scene.grid, w), settings.seed, settings.bounces)
show({f"w = {w:.2f}": result.raw for w, result in wet.items()})

# %% [markdown]
# ## Compare
#
# The truly wet street comes from the world itself, with its own run-off, materials and sun. Where the puddles lie is a
# choice of each side, so the figure tells how the ground looks, not whether every puddle is in its place.

# %%
true = render(compile_world(world.simulation(1, 1.0)), frame.camera, 32, clamp=photographs.clamp)
true_picture = encode(true.radiance, frame.encoding)


def psnr(picture):
    """Return the peak signal-to-noise ratio over the ground [dB]."""
    difference = picture[frame.is_ground].astype(float) - true_picture[frame.is_ground]
    return 20 * np.log10(255 / np.sqrt(np.mean(difference**2)))


show(
    {
        f"recorded, {psnr(frame.raw):.1f} dB": frame.raw,
        f"augmented, w = 1, {psnr(wet[1.0].raw):.1f} dB": wet[1.0].raw,
        "truly wet": true_picture,
    }
)

# %% [markdown]
# A whole drive is wetted by `augment SCENE -o OUT --wetness 0.33,0.67,1`, which also writes layers, label maps, and the
# ground truth that rain does not change.
