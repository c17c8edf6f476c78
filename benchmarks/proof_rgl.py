"""Tables in the RGL database's format, evaluated here and by Mitsuba's `measured`: invented ones, isotropic and not."""

from __future__ import annotations

import numpy as np

from materials.directions import even_directions
from materials.measured.rgl import read_rgl
from tests.materials.measured.rgl_tables import write_rgl

from .peers import mitsuba
from .report import Report


def run(report: Report) -> None:
    """Record the largest difference of f cos theta over pairs of directions."""
    mi = mitsuba("scalar_rgb")
    file = report.folder / "proof" / "rgl.bsdf"
    file.parent.mkdir(parents=True, exist_ok=True)
    wi, wo = even_directions(200, 78), even_directions(200, 79)[::-1]
    for isotropic in (True, False):
        for jacobian in (0, 1):
            write_rgl(file, isotropic, jacobian)
            theirs, si = [], mi.SurfaceInteraction3f()
            surface = mi.load_dict({"type": "measured", "filename": str(file)})
            for light, view in zip(wi, wo, strict=True):
                si.wi = mi.Vector3f(*map(float, view))  # Mitsuba's wi points to the viewer
                theirs.append(list(surface.eval(mi.BSDFContext(), si, mi.Vector3f(*map(float, light)))))
            ours = read_rgl(file).evaluate(wi, wo) * wi[:, 2:]
            worst = float(np.abs(np.array(theirs) - ours).max() / ours.max())
            kind = f"{'isotropic' if isotropic else 'anisotropic'}{', with Jacobian' if jacobian else ''}"
            # single floats in Mitsuba, in warps that are inverted
            report.proof(name=f"RGL tables, {kind}: largest difference from Mitsuba", value=worst, bound=1e-5, holds=worst <= 1e-5)
