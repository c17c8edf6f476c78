from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from materials import ggx
from materials.foundation.errors import InputError
from materials.scattering import evaluate
from transport.dome import DomeSettings, Relief, acquire


def relief(height: np.ndarray, albedo: float = 0.5, scale: float = 0.0, alpha=(0.2, 0.2)) -> Relief:
    shape = height.shape
    return Relief(height, 1e-3, np.full((*shape, 3), albedo), np.full(shape, scale), np.tile(alpha, (*shape, 1)).astype(float))


def waves(amplitude: float, size: int = 12) -> np.ndarray:
    x = 2 * np.pi * np.arange(size) / size
    return amplitude * (np.sin(x)[None] + np.cos(x)[:, None])


def test_a_flat_sample_reflects_as_its_material():
    a = acquire(
        relief(np.zeros((8, 8)), scale=0.7, alpha=(0.15, 0.4)), DomeSettings(lights=20, views=18, samples=1), np.array([[1, 2]])
    )
    surface = ggx.surface((0.5, 0.5, 0.5), 0.15, specular_scale=0.7, alpha_v=0.4)
    # what single floats keep
    assert np.allclose(a.normalise().value[0], evaluate(surface, a.wo, a.wi), rtol=1e-5, atol=1e-7)
    assert a.grid == (20, 18) and not a.normalised


def test_relief_as_a_whole_is_reciprocal_and_grooves_light_themselves():
    s = DomeSettings(lights=16, views=16, samples=64, bounces=4)
    rough = relief(waves(1e-3), albedo=0.9)
    mean = acquire(rough, s).normalise().value.mean(axis=(0, 2)).reshape(16, 16)
    # The same light whichever way it goes, once averaged over a period. Smooth normals on triangles are not quite reciprocal: the
    # waves have 12 cells, whose triangles turn by 30 degrees from one to the next; it shows at grazing angles most.
    assert np.allclose(mean, mean.T, rtol=0.1) and np.median(np.abs(mean / mean.T - 1)) < 0.01
    direct = acquire(rough, replace(s, bounces=1)).normalise().value.mean(axis=(0, 2)).reshape(16, 16)
    assert direct.mean() < 0.95 * mean.mean() < 0.9 / math.pi


def test_a_ridge_casts_its_shadow_where_geometry_says():
    height = np.zeros((4, 60))
    height[:, 10] = 5e-3  # a ridge along y, seen and lit from above or from the left
    s = DomeSettings(lights=200, views=1, samples=1, bounces=1)
    a = acquire(relief(height), s, np.stack([np.full(60, 1), np.arange(60)], axis=1))
    along = np.argmin(np.abs(a.wi[:, 1]) + np.abs(a.wi[:, 0] / a.wi[:, 2] + 3))
    wi = a.wi[along]
    lit = a.value[:, along, 0] > 0
    length = 5e-3 * -wi[0] / wi[2] / 1e-3  # in texels
    edge = 10 + length
    assert not lit[13 : int(edge) - 1].any() and lit[int(edge) + 2 : 55].all()


def test_the_seed_alone_decides():
    r, s = relief(waves(5e-4), albedo=0.7), DomeSettings(lights=6, views=6, samples=2)
    one, two = (acquire(r, replace(s, seed=k)).value for k in (1, 2))
    assert np.array_equal(one, acquire(r, replace(s, seed=1)).value) and not np.array_equal(one, two)


def test_impossible_samples_are_refused():
    with pytest.raises(InputError, match="albedo must lie in"):
        relief(np.zeros((4, 4)), albedo=1.5)
    with pytest.raises(InputError, match="texels must lie within"):
        acquire(relief(np.zeros((4, 4))), DomeSettings(lights=4, views=4), np.array([[4, 0]]))
    with pytest.raises(InputError, match="be low beside its width"):
        acquire(relief(np.array([[0, 1.0], [0, 0]])), DomeSettings(lights=4, views=4))
