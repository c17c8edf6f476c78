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
# # What a simple belief leaves out of a measurement
#
# Three kinds of measurements, each with something simple that was believed of it: paints believed matte, or to have one
# lobe; soil of all moistures believed dry; photographs of a ball and a bear under many lamps believed matte and lit
# directly. The diagnosis says what is missing, fits it, and is judged on incidence angles, moistures and lamps that the
# fit did not see. What it cannot explain it says too.
#
# The data do not come with the project: Cornell's gonioreflectometer paints, soil spectra of Riese and Keller (2018, CC
# BY 4.0), DiLiGenT (Shi et al. 2019). `MENISCUS_DATA` names their folder; without it nothing below runs. Everything is
# thinned out here to take a few minutes; `make proof ARGS="--only measured_mismatch"` runs it in full.

# %%
import time
from pathlib import Path

import cv2
from IPython.display import Image, Markdown, display

from benchmarks.data import data_folder
from benchmarks.peers import PeerMissing
from benchmarks.proof_measured_mismatch import believe_dry
from benchmarks.soil import write_soil_measurement
from evaluate.diagnose_measurement import MODELS
from evaluate.effects import catalogue
from evaluate.mismatch.measured.diagnose import diagnose_file
from evaluate.mismatch.measured.outputs import sentence, write_measured_diagnosis
from evaluate.mismatch.measured.photographs import diagnose_photographs, stereo_of
from materials.measured.measurement_writer import write_measurement
from materials.measured.photographs import read_photographs
from materials.measured.source import read_brdf

try:
    data = data_folder()
except PeerMissing as missing:
    data = None
    print(missing)
out = Path("../out/notebooks/explain_measurements")
trials = []


def show(path, width=850):
    """Show a picture, small enough to be kept in a notebook."""
    picture = cv2.imread(str(path))
    picture = cv2.resize(picture, (width, width * picture.shape[0] // picture.shape[1]), interpolation=cv2.INTER_AREA)
    display(Image(data=cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 75])[1].tobytes()))


def diagnosed(name, believed, run):
    """Run a diagnosis, write its report, and remember it for the table of trials."""
    start = time.perf_counter()
    d = run()
    folder = out / f"{name}_{believed}".replace(" ", "_")
    write_measured_diagnosis(folder, d)
    p, normals = d.proof, d.extra.get("held_out", {})
    angles = [f"{normals[k]:.2f}" if k in normals else "–" for k in ("normal_error_deg_before", "normal_error_deg_after")]
    named = ", ".join(f.id for f in d.findings) or "–"
    figures = [f"{x:.4g}" for x in (p.chi2_before, p.chi2_after, p.rmse_before, p.rmse_after)]
    trials.append([name, believed, d.verdict, named, *figures, *angles, f"{time.perf_counter() - start:.0f}"])
    print(f"{name}, believed {believed}: {d.verdict}. {sentence(d)}")
    return d, folder


def table(rows, head):
    """Show rows as a table."""
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in [head, ["---"] * len(head), *rows]]
    display(Markdown("\n".join(lines)))


# %% [markdown]
# ## Paints
#
# 1439 pairs of directions, eight incidence angles; every fourth wavelength. A measurement/1 is written of each file, with
# what is believed. Noise is not stated: it is estimated from neighbours. Each incidence angle is held out once.

# %%
paints = {}
if data is not None:
    for name in ("garnet_red", "krylon_blue", "cayman"):
        samples = read_brdf(data / "cornell_brdf" / f"{name}.brdf")
        thinned = type(samples)(
            samples.wi,
            samples.wo,
            samples.value[:, ::4],
            samples.valid,
            samples.weight,
            samples.channels[::4],
            isotropic=True,
            name=name,
        )
        for believed in ("lambert", "ggx"):
            path = write_measurement(out / "measurements" / f"{name}_{believed}", thinned, MODELS[believed])
            paints[name, believed] = diagnosed(
                name, believed, lambda path=path: diagnose_file(path, catalogue(), say=lambda _: None)
            )

# %% [markdown]
# The red paint: gloss is named, and foreseen at incidence angles that were held out. It is not all: chi-square stays far
# from 1, as no paint's lobe is exactly GGX's and the instrument repeats itself within 2 %.

# %%
if data is not None:
    d, folder = paints["garnet_red", "lambert"]
    show(folder / "pictures" / "polar.png")
    show(folder / "pictures" / "blocks.png", 600)
    rows = [[" + ".join(t.on_top_of), t.id, f"{t.gain:.3g}", f"{t.sigmas:.3g}", t.verdict] for t in d.trials]
    table(rows, ["on top of", "tried", "gain", "standard errors", ""])

# %% [markdown]
# The metallic paint is a failure, and is told as one: a GGX lobe explains less than half of what any function of the half
# angle does, so nothing is named. It says in which coordinate the rest stands still.

# %%
if data is not None:
    d, folder = paints["cayman", "lambert"]
    print("depends on:", [x.name for x in d.depends_on][:4])
    print(*d.notes, sep="\n")
    show(folder / "pictures" / "residuals.png", 700)

# %% [markdown]
# ## Soil that dries
#
# Believed: the mean spectrum of the driest tenth at all moistures, its scale free. Levels of moisture are held out.

# %%
if data is not None:
    path = write_soil_measurement(data / "soil_wet_dry" / "karly_soilmoisture_dataset.csv", out / "measurements" / "soil", 4)
    believe_dry(path)
    d, folder = diagnosed("soil", "dry", lambda: diagnose_file(path, catalogue(), say=lambda _: None))
    for f in d.findings:
        print(f.id, {k: (p["value"], p.get("ci90")) for k, p in f.parameters.items()})
    show(folder / "pictures" / "condition.png")
    table(
        [[r[0], *(f"{x:.3g}" for x in r[1:])] for r in d.proof.rows],
        ["held out", "chi-square before", "after", "rmse before", "after"],
    )

# %% [markdown]
# ## Photographs under many lamps
#
# Each fifth lamp is held out. The proof is another: normals refitted with what was found come nearer to the measured
# ones, which no fit was given. The first 20 images of the bear are damaged.

# %%
if data is not None:
    for name, images in (("ball", None), ("bear", slice(20, None))):
        photographs = read_photographs(data / f"diligent_{name}", images)
        stereo = stereo_of(photographs, data / f"diligent_{name}")
        d, folder = diagnosed(
            name, "matte, direct light", lambda s=stereo: diagnose_photographs(s, catalogue(), say=lambda _: None)
        )
        print({f.id: {k: round(p["value"], 4) for k, p in f.parameters.items()} for f in d.findings})
        show(folder / "pictures" / "photograph.png")
        show(folder / "pictures" / "normals.png", 700)

# %% [markdown]
# Bounced light is tried and not found: the ball has nothing that faces it, and of the bear's, what a pixel's own albedo
# and normal do not explain is below what the other two leave over. Shadows at the ears and the neck remain: there the
# surface has steps, over which integrated normals bend.
#
# ## Every trial

# %%
head = [
    "measured",
    "believed",
    "verdict",
    "named",
    "chi-square before",
    "after",
    "rmse before",
    "after",
    "normals before [°]",
    "after",
    "s",
]
table(trials, head)
