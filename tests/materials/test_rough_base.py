from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from materials import fit_run, tabulated
from materials.abrdf import ABRDF
from materials.directions import even_directions
from materials.fit import FitSettings, fit_texel, fit_where_possible
from materials.foundation.errors import InputError
from materials.kernels import oren_nayar
from materials.kernels.matte_gradients import matte
from materials.svbrdf import SVBRDF, read_svbrdf, write_svbrdf
from tests.materials.exports.samples import sample
from tests.materials.test_fit import rendered
from tests.materials.test_tabulated import bilinear, directions

ROUGH = "oren_nayar"


def rough_sample(model: str = "ggx") -> SVBRDF:
    return replace(sample(model), sigma=np.linspace(0, 1.2, 11))


def test_the_matte_part_is_the_one_that_scatters_light():
    for i, o in zip(map(tuple, directions(50, 1)), map(tuple, directions(50, 2)), strict=True):
        assert matte(i, o, 0.6)[0] / np.pi == pytest.approx(oren_nayar.evaluate(o, i, 0.6), rel=1e-12)
        assert matte(i, o, 0.0)[0] == 1


@pytest.mark.parametrize("kind", ["phong", "ward", "ct", "ggx"])
def test_a_rough_base_is_recovered_from_its_own_noisy_samples(kind):
    a, x = rendered(kind, noise=0.003, dome=even_directions(60), sigma=0.5, lobes=1)
    f = fit_texel(a, settings=FitSettings(model=kind, base=ROUGH, constrained=False, lobes=1, free_angle_deg=80))
    got = np.concatenate([f.diffuse, f.specular.ravel(), f.alpha.ravel(), [f.sigma]])
    deviation = np.sqrt(np.diag(f.covariance))[:-1]
    free = deviation > 0
    assert free[-1] and free.sum() >= 8
    # 9 parameters at 4 sigma: a chance of 6e-4 to fail by noise alone, and the noise is fixed
    assert (np.abs(got - x[:-3])[free] < 4 * deviation[free] + 1e-6).all()
    assert deviation[-1] < 0.05
    lambert = fit_texel(a, settings=FitSettings(model=kind, constrained=False, lobes=1, free_angle_deg=80))
    assert f.cost < 0.9 * lambert.cost and lambert.sigma == 0


def test_lambert_is_found_to_be_smooth():
    a, _ = rendered("ggx", noise=0.003, dome=even_directions(60), lobes=1)
    f, lambert = (fit_texel(a, settings=FitSettings(model="ggx", base=b, constrained=False, lobes=1)) for b in (ROUGH, "lambert"))
    # noise of one part in a hundred of albedo / pi stays in B < 0.03, sigma < 0.08, and may only lower the cost
    assert f.sigma < 0.08 and f.cost <= lambert.cost * (1 + 1e-6)


def test_two_steps_and_warm_starts_keep_the_spread():
    a, _ = rendered("ct", noise=0.003, dome=even_directions(40), sigma=0.6, lobes=1)
    value = np.stack([a.value] * 16).astype(np.float32)
    many = ABRDF(a.wi, a.wo, value, np.ones(value.shape[:2], bool), a.weight)
    for fit in fit_where_possible(many, FitSettings(model="ct", base=ROUGH, lobes=1, threads=1)):
        assert fit is not None and fit.sigma == pytest.approx(0.6, abs=0.05)


def test_a_block_that_was_kept_has_its_spreads(tmp_path):
    a, _ = rendered("ggx", dome=even_directions(20), sigma=0.6, lobes=1)
    fit = fit_texel(a, settings=FitSettings(model="ggx", base=ROUGH, lobes=1))
    fit_run._Kept(tmp_path, "k").save("b", [fit, None])
    (again, none) = fit_run._Kept(tmp_path, "k").load("b") or (None, fit)
    assert none is None and again is not None and again.sigma == fit.sigma > 0


def test_spreads_are_textures_that_are_read_again(tmp_path):
    m = rough_sample()
    write_svbrdf(tmp_path, m)
    again = read_svbrdf(tmp_path)
    # half floats
    assert again.base == ROUGH and np.allclose(again.spread, m.spread, atol=1e-3)
    head = json.loads((tmp_path / "material.json").read_text())
    del head["textures"]["sigma"]
    (tmp_path / "material.json").write_text(json.dumps(head))
    with pytest.raises(InputError, match=r"textures\.sigma must be given"):
        read_svbrdf(tmp_path)
    write_svbrdf(tmp_path, replace(m, sigma=np.full(11, 2.0)))
    with pytest.raises(InputError, match=r"lie in \[0, pi / 2\]"):
        read_svbrdf(tmp_path)


def test_paths_see_the_rough_base():
    m = replace(sample("ct"), mask=np.ones((1, 11), bool), sigma=np.linspace(0, 1.2, 11))
    wi, wo = directions(300, 1), directions(300, 2)
    uv = np.random.default_rng(4).uniform(-2, 2, (300, 2))
    got = tabulated.evaluate(tabulated.compile_tables([m]), 0, uv, wo, wi) * wi[:, 2:]
    want = bilinear(m, uv, wi, wo)
    np.testing.assert_allclose(got, want, rtol=2e-5, atol=1e-6 * want.max())
    assert np.abs(want - bilinear(replace(m, sigma=None), uv, wi, wo)).max() > 0.01


def test_programs_that_know_lambert_only_are_told_what_that_costs():
    from materials.exports.as_ggx import as_ggx

    kept, lost = as_ggx(rough_sample(), 1, ROUGH), as_ggx(rough_sample(), 1)
    assert kept.relative_variance == 0 and kept.material.base == ROUGH
    assert 1e-5 < lost.relative_variance < 0.02 and lost.material.base == "lambert"
