"""Measured and fitted textures as surfaces for paths: f is the look-up's, directions are drawn with the density stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials import tabulated
from materials.abrdf import ABRDF, pairs
from materials.btf import BTF, compress
from materials.directions import even_directions, interpolation, solid_angles
from materials.foundation.errors import InputError
from materials.kernels.direction_mesh import locate
from materials.svbrdf import SVBRDF
from tests.materials.test_bsdf_sampling import NUM_SAMPLES, cell_masses, chi_square_p

MODELS = ("ct", "ward", "phong", "ggx")
UP = np.array([0.0, 0.0, 1.0])
OBLIQUE = np.array([0.48, 0.64, 0.6])


def fitted(model: str = "ggx", tilt: float = 0.4) -> SVBRDF:
    """Return 2 x 2 texels of two brushed lobes, each with another normal and tangent."""
    rng = np.random.default_rng(3)
    n = np.array([[0, 0, 1.0], [tilt, 0, 1], [0, -tilt, 1], [-tilt, tilt, 1]])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    t = np.cross(n, rng.standard_normal((4, 3)))
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    frame = np.stack([t, np.cross(n, t), n], axis=-1)
    alpha = np.tile([[[0.15, 0.3], [0.5, 0.9]]], (4, 1, 1))
    scale = 0.3 if model in ("ward", "phong") else 4.0
    specular = scale * rng.uniform(0.2, 1, (4, 2, 3))
    mask, none = np.ones((2, 2), bool), np.zeros(4)
    return SVBRDF(model, 1.5, mask, rng.uniform(0.05, 0.3, (4, 3)), specular, alpha, frame, none, none)


def measured(method: str = "fmf", rank: int = 4) -> BTF:
    """Return a BTF of the fitted surface under 60 lights and 40 views."""
    wi, wo = pairs(even_directions(60), even_directions(40))
    surface = fitted()
    value = np.stack([surface.reflect(wi, wo, np.full(len(wi), t)) for t in range(4)]).astype(np.float32)
    weight = np.outer(solid_angles(even_directions(60)), solid_angles(even_directions(40))).ravel()
    valid = np.ones(value.shape[:2], bool)
    abrdf = ABRDF(wi, wo, value, valid, weight, normalised=False, grid=(60, 40), mask=surface.mask)
    return compress(abrdf, rank, method)


def bilinear(material, uv, wi, wo):
    """Return f cos_i (Q, 3) by the look-ups of `BTF` and `SVBRDF`, texel by texel."""
    height, width = material.mask.shape
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    col, row = np.floor(x).astype(int), np.floor(y).astype(int)
    total = np.zeros((len(uv), 3))
    for i in range(2):
        for j in range(2):
            share = np.where(i, y - row, 1 - y + row) * np.where(j, x - col, 1 - x + col)
            texels = (row + i) % height * width + (col + j) % width
            found = material.reflect(texels, wi, wo) if isinstance(material, BTF) else material.reflect(wi, wo, texels)
            total += share[:, None] * found
    return total


def directions(count: int, seed: int) -> np.ndarray:
    w = np.random.default_rng(seed).standard_normal((count, 3))
    w[:, 2] = np.abs(w[:, 2]) + 1e-3
    return w / np.linalg.norm(w, axis=1, keepdims=True)


CASES = {**{model: fitted(model) for model in MODELS}, "btf": measured(), "decorrelated btf": measured("dfmf", 2)}


@pytest.mark.parametrize("name", CASES)
def test_f_is_that_of_the_look_up_bilinear_over_texels_that_repeat(name):
    material = CASES[name]
    tables = tabulated.compile_tables([fitted("phong"), material])
    wi, wo = directions(400, 1), directions(400, 2)
    uv = np.random.default_rng(4).uniform(-2, 2, (400, 2))
    got = tabulated.evaluate(tables, 1, uv, wo, wi) * wi[:, 2:]
    want = bilinear(material, uv, wi, wo)
    # float32 factors, and the lobes of fits and of paths are separate code
    np.testing.assert_allclose(got, want, rtol=2e-5, atol=1e-6 * want.max())
    assert (tabulated.evaluate(tables, 1, uv[0], UP, -UP) == 0).all()


def test_each_direction_is_between_the_measured_ones_that_interpolation_names():
    # three rings and the pole, as real domes have them, where triangles are slim
    theta = np.radians(np.repeat([15.0, 40.0, 75.0], [6, 12, 24]))
    phi = np.concatenate([np.arange(n) * 2 * np.pi / n for n in (6, 12, 24)])
    ring = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    known = np.concatenate([[UP], ring])
    queries = directions(500, 5)
    btf = replace(measured(), wi=known, angular=tuple(a[:, : len(known)] for a in measured().angular))
    tables = tabulated.compile_tables([btf])
    want = interpolation(known, queries)
    values = np.random.default_rng(6).random(len(known))
    for k, w in enumerate(queries):
        corners, weights = locate(tables, 0, tuple(w))
        got = sum(values[c] * s for c, s in zip(corners, weights, strict=True))
        assert got == pytest.approx(float(want(values)[k]), abs=1e-9)


def test_beyond_the_measured_rim_light_fades_to_the_horizon():
    tables = tabulated.compile_tables([CASES["btf"]])
    angle = np.radians([85.0, 89.0, 89.99])
    low = np.stack([np.sin(angle), np.zeros(3), np.cos(angle)], axis=-1)
    f = tabulated.evaluate(tables, 0, (0.3, 0.3), UP, low)
    assert np.allclose(f, f[0], rtol=1e-6) and f.max() > 0


@pytest.mark.parametrize("view", ["upright", "oblique"])
@pytest.mark.parametrize("name", ["ct", "ward", "phong", "ggx", "btf"])
def test_directions_are_drawn_with_the_density_stated(name, view):
    tables = tabulated.compile_tables([CASES[name]])
    wo, uv = (UP if view == "upright" else OBLIQUE), np.array([0.37, 0.81])
    drawn = tabulated.sample(tables, 0, uv, wo, np.random.default_rng(7).random((NUM_SAMPLES, 3)))

    def density(_, wo, wi):
        flat = wi.reshape(-1, 3)
        return tabulated.pdf(tables, 0, uv, wo, flat).reshape(wi.shape[:-1])

    surface = type("Kind", (), {"kind": -1})()
    # 10 tests at 1 % together (Sidak)
    kept = drawn.wi[drawn.weight.sum(axis=1) > 0]
    assert chi_square_p(kept, cell_masses(surface, wo, density_of=density)) > 1 - 0.99 ** (1 / 10)


@pytest.mark.parametrize("name", ["ct", "ward", "phong", "ggx", "btf"])
def test_drawing_finds_the_light_that_quadrature_finds(name):
    tables = tabulated.compile_tables([CASES[name]])
    uv = np.array([0.37, 0.81])
    nodes, weights = np.polynomial.legendre.leggauss(200)
    z, phi = 0.5 * (nodes + 1), 2 * np.pi * (np.arange(400) + 0.5) / 400
    s = np.sqrt(1 - z**2)[:, None]
    wi = np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), z[:, None]), axis=-1).reshape(-1, 3)
    f = tabulated.evaluate(tables, 0, uv, OBLIQUE, wi).reshape(200, 400, 3)
    albedo = np.einsum("a,abc,a->c", 0.5 * weights, f, z) * 2 * np.pi / 400
    drawn = tabulated.sample(tables, 0, uv, OBLIQUE, np.random.default_rng(8).random((NUM_SAMPLES, 3)))
    error = drawn.weight.std(axis=0) / np.sqrt(NUM_SAMPLES)
    # 15 z-tests at 1 % together are 3.4 sigma; the quadrature's own error of kinks is below a fifth of one
    assert (np.abs(drawn.weight.mean(axis=0) - albedo) < 3.6 * error).all()
    # and it is better to draw so than by the cosine, whose weights are pi f
    by_cosine = np.einsum("a,abc,a->c", 0.5 * weights, np.pi * f**2, z) * 2 * np.pi / 400 - albedo**2
    assert (drawn.weight.var(axis=0) < by_cosine).all()


def test_what_has_holes_or_no_colours_is_refused():
    with pytest.raises(InputError, match="material must be known everywhere"):
        tabulated.compile_tables([replace(fitted(), mask=np.array([[True, False], [True, True]]))])
    grey = measured()
    with pytest.raises(InputError, match="material must have three channels"):
        tabulated.compile_tables([replace(grey, angular=tuple(a[..., :1] for a in grey.angular))])
    with pytest.raises(InputError, match="wo must have unit length"):
        tabulated.pdf(tabulated.compile_tables([fitted()]), 0, (0, 0), 2 * UP, UP)
