"""A fitted material exported to Mitsuba, opened there, and evaluated beside our own."""

from __future__ import annotations

import numpy as np

from materials.directions import even_directions
from materials.exports.mitsuba_xml import write_mitsuba
from materials.fit_run import frames_of
from materials.svbrdf import SVBRDF

from .peers import mitsuba
from .report import Report


def run(report: Report) -> None:
    """Record the difference of the cosine-weighted reflectance over directions up to 60 degrees, per width of the gloss."""
    mi = mitsuba("scalar_rgb")
    folder = report.folder / "proof" / "exports"
    for alpha, bound in ((0.15, 0.08), (0.4, 0.08)):
        material = _plate(alpha)
        file = folder / f"alpha_{alpha:g}.xml"
        write_mitsuba(file, material)
        scene = mi.load_file(str(file))
        error = _difference(mi, scene, material)
        name = f"material in Mitsuba, alpha {alpha:g}: relative difference of what it reflects"
        report.proof(name=name, value=error, bound=bound, holds=error <= bound)


def _plate(alpha: float) -> SVBRDF:
    """Return paint with a white gloss whose normals lean: bright in the upper row of texels, dark in the lower."""
    normal = np.tile([0.2, 0.1, np.sqrt(0.95)], (4, 1))
    diffuse = np.repeat([[0.6, 0.5, 0.4], [0.1, 0.1, 0.2]], 2, axis=0)
    specular, widths = np.full((4, 1, 3), 0.9), np.full((4, 1, 2), alpha)
    return SVBRDF("ggx", 1.5, np.ones((2, 2), bool), diffuse, specular, widths, frames_of(normal), np.zeros(4), np.zeros(4))


def _difference(mi, scene, material: SVBRDF) -> float:
    """Return the relative root mean square over pairs of directions, in the middle of an upper and of a lower texel."""
    theirs, ours = [], []
    for y, texel in ((0.5, 0), (-0.5, 2)):
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(-0.5, y, 2), mi.Vector3f(0, 0, -1)))
        bsdf = si.bsdf()
        for wo in even_directions(12, 60):
            si.wi = mi.Vector3f(*map(float, wo))  # Mitsuba's wi points to the viewer
            for wi in even_directions(24, 60):
                value = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*map(float, wi)))
                theirs.append([float(value[c]) for c in range(3)])
                ours.append(material.reflect(wi, wo, np.array([texel]))[0])
    a, b = np.array(theirs), np.array(ours)
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))
