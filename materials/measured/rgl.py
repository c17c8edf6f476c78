"""Measured BRDFs in the adaptive parameterisation of EPFL's laboratory (RGL, `*.bsdf`), evaluated at any directions.

The half vector is warped by the distribution of visible normals, so that the table is spent where light goes: values are looked
up at the place on the unit square that this distribution's inverse gives.

References
----------
Dupuy and Jakob (2018), An Adaptive Parameterization for Efficient Material Acquisition and Rendering.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..abrdf import ABRDF, pairs
from ..directions import even_directions, solid_angles, spherical
from ..foundation.checks import check_unit
from ..foundation.errors import InputError
from .tensor_file import read_tensor_file

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RglBRDF:
    """A BRDF in tables.

    Attributes
    ----------
    phi, theta : (P,), (T,) float64
        Angles of the viewer for which there are tables [rad].
    ndf, sigma : (h, w) float64
        Distribution of normals, and the area that a viewer sees of them.
    vndf : (P, T, h, w) float64
        Distribution of visible normals; each of mean 1.
    values : (P, T, C, h, w) float64
        f cos theta_i, divided by the warp's density if `jacobian` is set.
    channels : tuple of str
    jacobian : bool
    name : str
    """

    phi: Floats
    theta: Floats
    ndf: Floats
    sigma: Floats
    vndf: Floats
    values: Floats
    channels: tuple[str, ...]
    jacobian: bool
    name: str

    @property
    def isotropic(self) -> bool:
        """Whether only the difference of azimuths counts."""
        return len(self.phi) <= 2

    def evaluate(self, wi: ArrayLike, wo: ArrayLike) -> Floats:
        """Return f (Q, C) [1/sr] for pairs of unit directions (Q, 3); 0 below the horizon."""
        light, view = np.atleast_2d(np.asarray(wi, np.float64)), np.atleast_2d(np.asarray(wo, np.float64))
        check_unit("wi", light)
        check_unit("wo", view)
        light, view = (a.copy() for a in np.broadcast_arrays(light, view))
        self._fold(light, view)
        above = (light[:, 2] > 1e-6) & (view[:, 2] > 1e-6)
        h = light + view
        h /= np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12)
        phi_o, phi_h = np.arctan2(view[:, 1], view[:, 0]), np.arctan2(h[:, 1], h[:, 0])
        theta_o, theta_h = _elevation(view), _elevation(h)
        u_h = np.stack([_u_theta(theta_h), (phi_h - phi_o if self.isotropic else phi_h) / (2 * math.pi) + 0.5], axis=1)
        u_h[:, 1] -= np.floor(u_h[:, 1])
        tables = self._tables(phi_o, theta_o)
        place = self._inverse(u_h, tables)
        out = np.stack([_lookup(self.values[:, :, c], tables, place) for c in range(len(self.channels))], axis=1)
        if self.jacobian:
            u_o = np.stack([_u_theta(theta_o), phi_o / (2 * math.pi) + 0.5], axis=1)
            none = [(np.zeros(len(u_o), np.int64), np.zeros(len(u_o), np.int64), np.ones(len(u_o)))]
            density = _lookup(self.ndf[None, None], none, u_h) / (4 * _lookup(self.sigma[None, None], none, u_o))
            out = out * density[:, None]
        f = np.maximum(out, 0) / np.maximum(light[:, 2:], 1e-6)
        return np.where(above[:, None], f, 0)

    def samples(self, lights: int = 24, views: int = 151, rim_deg: float = 80.0) -> ABRDF:
        """Return values on a grid of directions; for isotropic ones all lights lie over the x axis."""
        wi = even_directions(lights, rim_deg)
        if self.isotropic:
            wi = spherical(np.radians(np.linspace(0, rim_deg, lights)), 0.0)
        wo = even_directions(views, rim_deg)
        i, o = pairs(wi, wo)
        value = self.evaluate(i, o).astype(np.float32)
        # Rings of light stand for bands of the hemisphere: their weight is that of the sine.
        ring = np.sin(np.arccos(wi[:, 2])) + 1e-3 if self.isotropic else solid_angles(wi)
        weight = np.outer(ring * 2 * math.pi / ring.sum(), solid_angles(wo)).reshape(-1)
        valid, grid = np.ones(len(i), bool), None if self.isotropic else (lights, views)
        return ABRDF(i, o, value, valid, weight, self.channels, grid=grid, isotropic=self.isotropic, name=self.name)

    def _fold(self, light: Floats, view: Floats) -> None:
        """Use the symmetry of a material whose tables cover a half or a quarter of all azimuths of the viewer."""
        if self.isotropic:
            return
        reduction = round(2 * math.pi / max(float(self.phi[-1] - self.phi[0]), 1e-6))
        if reduction < 2:
            return
        sign_y = np.where(view[:, 1] < 0, -1.0, 1.0)
        sign_x = np.where(view[:, 0] < 0, -1.0, 1.0) if reduction == 4 else sign_y
        for w in (light, view):
            w[:, 0] *= sign_x
            w[:, 1] *= sign_y

    def _tables(self, phi: Floats, theta: Floats) -> list[tuple[NDArray, NDArray, Floats]]:
        """Return the four tables (phi index, theta index, weight) between which a viewer lies."""
        sides = []
        for nodes, at in ((self.phi, phi), (self.theta, theta)):
            if len(nodes) == 1:
                sides.append([(np.zeros(len(at), np.int64), np.ones(len(at)))])
                continue
            k = np.clip(np.searchsorted(nodes, at, "right") - 1, 0, len(nodes) - 2)
            t = np.clip((at - nodes[k]) / (nodes[k + 1] - nodes[k]), 0, 1)
            sides.append([(k, 1 - t), (k + 1, t)])
        return [(p, t, a * b) for p, a in sides[0] for t, b in sides[1]]

    def _inverse(self, u: Floats, tables: list[tuple[NDArray, NDArray, Floats]]) -> Floats:
        """Return the place on the unit square from which the distribution of visible normals sends samples to u."""
        height, width = self.vndf.shape[2:]
        x, y = u[:, 0] * (width - 1), u[:, 1] * (height - 1)
        i, j = np.clip(x.astype(np.int64), 0, width - 2), np.clip(y.astype(np.int64), 0, height - 2)
        x, y = x - i, y - j
        rows = 0.5 * (self.vndf[..., 1:] + self.vndf[..., :-1])
        along = np.concatenate([np.zeros((*rows.shape[:-1], 1)), np.cumsum(rows, axis=-1)], axis=-1)  # (P, T, h, w)
        sums = along[..., -1]
        down = np.concatenate([np.zeros((*sums.shape[:2], 1)), np.cumsum(0.5 * (sums[..., 1:] + sums[..., :-1]), axis=-1)], axis=-1)
        # Each table integrates to 1 before tables are mixed.
        scale = 1 / down[..., -1]

        def mixed(values: Floats, *at: NDArray) -> Floats:
            return sum((w * scale[p, t] * values[(p, t, *at)] for p, t, w in tables), np.zeros(len(u)))

        c0 = (1 - y) * mixed(self.vndf, j, i) + y * mixed(self.vndf, j + 1, i)
        c1 = (1 - y) * mixed(self.vndf, j, i + 1) + y * mixed(self.vndf, j + 1, i + 1)
        before = (1 - y) * mixed(along, j, i) + y * mixed(along, j + 1, i)
        r0, r1 = mixed(sums, j), mixed(sums, j + 1)
        row = (1 - y) * r0 + y * r1
        s = (before + x * (c0 + 0.5 * x * (c1 - c0))) / np.maximum(row, 1e-300)
        t = mixed(down, j) + y * (r0 + 0.5 * y * (r1 - r0))
        return np.clip(np.stack([s, t], axis=1), 0, 1)


def read_rgl(path: str | Path) -> RglBRDF:
    """Read a `*.bsdf`.

    Raises
    ------
    InputError
        As `read_tensor_file`; or if a field is missing, shapes disagree, or numbers are not finite.
    """
    fields = read_tensor_file(path)
    for key in ("phi_i", "theta_i", "ndf", "sigma", "vndf", "jacobian"):
        if key not in fields:
            raise InputError("be a field of the file", file=path, key=key, remedy="Give a material of the RGL database (.bsdf).")
    key = "rgb" if "rgb" in fields else "spectra"
    if key not in fields or (key == "spectra" and "wavelengths" not in fields):
        raise InputError("be a field of the file", file=path, key="rgb, or spectra and wavelengths")
    arrays = {name: np.asarray(fields[name], np.float64) for name in ("phi_i", "theta_i", "ndf", "sigma", "vndf", key)}
    phi, theta, vndf, values = (arrays[name] for name in ("phi_i", "theta_i", "vndf", key))
    channels = ("R", "G", "B") if key == "rgb" else tuple(f"{w:g} nm" for w in np.asarray(fields["wavelengths"]).reshape(-1))
    lead = (len(phi), len(theta))
    if vndf.ndim != 4 or vndf.shape[:2] != lead or min(vndf.shape[2:]) < 2:
        raise InputError(f"have shape ({lead[0]}, {lead[1]}, h, w)", got=vndf.shape, file=path, key="vndf")
    if values.ndim != 5 or values.shape[:3] != (*lead, len(channels)) or min(values.shape[3:]) < 2:
        raise InputError(f"have shape ({lead[0]}, {lead[1]}, {len(channels)}, h, w)", got=values.shape, file=path, key=key)
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise InputError("be finite", got="NaN or infinity", file=path, key=name)
        if name in ("ndf", "sigma") and (array.ndim != 2 or min(array.shape) < 2):
            raise InputError("be a table of 2 x 2 or more", got=array.shape, file=path, key=name)
    if (np.diff(phi) <= 0).any() or (np.diff(theta) <= 0).any():
        raise InputError("rise", file=path, key="phi_i and theta_i")
    if (vndf < 0).any() or (vndf.sum(axis=(2, 3)) <= 0).any():
        raise InputError("be a density", got="negative or empty", file=path, key="vndf")
    jacobian = bool(np.asarray(fields["jacobian"]).reshape(-1)[0])
    return RglBRDF(phi, theta, arrays["ndf"], arrays["sigma"], vndf, values, channels, jacobian, Path(path).stem)


def _elevation(w: Floats) -> Floats:
    """Return the angle to z by the chord, exact near 0."""
    return 2 * np.arcsin(np.clip(0.5 * np.sqrt(w[:, 0] ** 2 + w[:, 1] ** 2 + (w[:, 2] - 1) ** 2), 0, 1))


def _u_theta(theta: Floats) -> Floats:
    return np.sqrt(np.clip(theta * 2 / math.pi, 0, 1))


def _lookup(values: Floats, tables: list[tuple[NDArray, NDArray, Floats]], place: Floats) -> Floats:
    """Return values (P, T, h, w) mixed between tables, bilinear on the unit square."""
    height, width = values.shape[2:]
    x, y = place[:, 0] * (width - 1), place[:, 1] * (height - 1)
    i, j = np.clip(x.astype(np.int64), 0, width - 2), np.clip(y.astype(np.int64), 0, height - 2)
    x, y = x - i, y - j
    out = np.zeros(len(place))
    for p, t, w in tables:
        top = (1 - x) * values[p, t, j, i] + x * values[p, t, j, i + 1]
        out += w * ((1 - y) * top + y * ((1 - x) * values[p, t, j + 1, i] + x * values[p, t, j + 1, i + 1]))
    return out
