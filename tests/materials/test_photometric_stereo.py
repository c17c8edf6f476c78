from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.abrdf import ABRDF
from materials.directions import even_directions
from materials.foundation.errors import InputError
from materials.measured.photographs import read_photographs
from materials.photometric_stereo import NormalSettings, angular_error_deg, lambert_normals, robust_normals

LIGHTS = even_directions(60, 50)
TRUE = even_directions(90, 60)


def photographed(gloss: float, alpha: float = 0.3, shadow: float = 0.0) -> ABRDF:
    """A sphere's normals under 60 lights: matte + gloss x a Phong-like lobe about the mirror, which the dictionary lacks."""
    cos = np.maximum(TRUE @ LIGHTS.T, 0)
    mirror = 2 * (TRUE @ LIGHTS.T) * TRUE[:, 2:] - LIGHTS[:, 2]
    n = 2 / alpha**2 - 2
    value = 0.3 / np.pi * cos + gloss * np.where(cos > 0, np.maximum(mirror, 0) ** n, 0)
    dark = np.random.default_rng(0).random(value.shape) < shadow
    value = np.where(dark, 0.02 * value, value)[..., None].astype(np.float32)
    wo = np.tile([0.0, 0, 1], (60, 1))
    return ABRDF(LIGHTS, wo, value, np.ones(value.shape[:2], bool), np.ones(60), ("R",), "relative", normalised=False)


def test_both_find_the_normals_of_a_matte_surface():
    a = photographed(0)
    assert robust_normals(a).normal == pytest.approx(TRUE, abs=np.radians(0.5))
    lit = (TRUE @ LIGHTS.T > 0).all(axis=1)  # attached shadows bias least squares
    assert lit.sum() > 20 and angular_error_deg(lambert_normals(a), TRUE)[lit].max() < 0.01


def test_gloss_outside_the_dictionary_misleads_least_squares_but_not_the_robust_fit():
    a = photographed(0.5)
    plain, robust = angular_error_deg(lambert_normals(a), TRUE), angular_error_deg(robust_normals(a).normal, TRUE)
    # The finest step is 0.25 degrees; the lobe's other shape costs some more
    assert np.median(robust) < 1 and plain.mean() > 5 * robust.mean()


def test_a_tenth_of_shadows_changes_little():
    a = photographed(0.2, shadow=0.1)
    assert np.median(angular_error_deg(robust_normals(a).normal, TRUE)) < 1


def test_pixels_do_not_depend_on_each_other():
    a = photographed(0.5)
    some = replace(a, value=a.value[10:20], valid=a.valid[10:20])
    assert np.array_equal(robust_normals(some).normal, robust_normals(a).normal[10:20])


def test_black_pixels_face_the_camera_and_stay_finite():
    a = photographed(0)
    black = replace(a, value=np.zeros_like(a.value))
    out = robust_normals(black)
    assert np.isfinite(out.normal).all() and np.isfinite(out.misfit).all()


@pytest.mark.parametrize(
    ("name", "start", "step"),
    # Every 12th pixel of the ball and every 144th of the bear, to be quick: the standard errors are 0.02 (ball, which is
    # better by two of them) and 0.3 degrees (bear, by six).
    [("diligent_ball", {0: 4.29}, 12), ("diligent_bear", {20: 9.06, 0: 8.94}, 144)],
)
def test_real_objects_come_out_better_than_the_best_method_that_does_not_learn(shared_data, name, start, step):
    best = {"diligent_ball": 1.74, "diligent_bear": 6.12}[name]  # Shi et al. 2019
    p = read_photographs(shared_data / name)
    assert p.normal is not None
    truth = p.normal[p.mask]
    for first, baseline in start.items():  # without the bear's first 20, which are damaged, and with them
        a = p.abrdf.select(np.arange(first, len(p.lights)))
        # Least squares as measured under this protocol.
        assert angular_error_deg(lambert_normals(a), truth).mean() == pytest.approx(baseline, abs=0.01)
        some = replace(a, value=a.value[::step], valid=a.valid[::step], mask=None)
        assert angular_error_deg(robust_normals(some).normal, truth[::step]).mean() < best


def test_what_cannot_be_used_is_refused():
    a = photographed(0)
    with pytest.raises(InputError, match="keep its shading"):
        robust_normals(a.normalise())
    with pytest.raises(InputError, match="at least four images"):
        lambert_normals(a.select(np.arange(3)))
    with pytest.raises(InputError, match="all samples valid"):
        lambert_normals(replace(a, valid=np.zeros_like(a.valid)))
    with pytest.raises(InputError, match="seen along z"):
        lambert_normals(replace(a, wo=LIGHTS))
    with pytest.raises(InputError, match="alphas must be numbers"):
        NormalSettings(alphas=(0.0,))
    with pytest.raises(InputError, match=r"spread must lie in \(0, 1\]"):
        NormalSettings(spread=0.0)
    with pytest.raises(InputError, match="normal must have shape"):
        angular_error_deg(TRUE, TRUE[:3])
