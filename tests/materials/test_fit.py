from __future__ import annotations

import math

import numpy as np
import pytest

from materials.abrdf import ABRDF, from_grid
from materials.directions import even_directions, spherical
from materials.fit import FitSettings, estimate_normal, fit, fit_texel, fit_where_possible
from materials.fit_problem import KINDS, Problem
from materials.foundation.errors import InputError
from materials.kernels import cook_torrance, ggx, oren_nayar, phong, ward
from materials.kernels.levenberg import normal_equations
from materials.kernels.lobe_gradients import lobe
from materials.measured.cornell import read_cornell

F0 = 0.04
DOME = even_directions(151)
TRUTH = {"diffuse": (0.3, 0.2, 0.1), "specular": ((0.5, 0.5, 0.4), (0.3, 0.3, 0.3)), "alpha": ((0.15, 0.3), (0.6, 0.8))}
SCALE = {"phong": 0.05, "ward": 0.05, "ct": 1.0, "ggx": 1.0, "half_vector": 0.05}


def problem(kind: str, dome=DOME, tilt=(0.0, 0.0), turn=0.3, lobes=2, sigma=None) -> tuple[Problem, np.ndarray]:
    n = len(dome)
    wi, wo = np.repeat(dome, n, axis=0), np.tile(dome, (n, 1))
    alpha = [(a, a) for a, _ in TRUTH["alpha"]] if kind == "phong" else TRUTH["alpha"]
    x = np.concatenate(
        [
            TRUTH["diffuse"],
            SCALE[kind] * np.array(TRUTH["specular"][:lobes]).ravel(),
            np.array(alpha[:lobes]).ravel(),
            [] if sigma is None else [sigma],
            [*tilt, 0.0 if kind == "phong" else turn],
        ]
    )
    return Problem(wi, wo, np.zeros((n * n, 3)), KINDS[kind], F0, np.eye(3), lobes, 1.0, rough_base=sigma is not None), x


def rendered(kind: str, noise: float = 0.0, seed: int = 0, **rest) -> tuple[ABRDF, np.ndarray]:
    from materials.kernels.brdf_fit import terms

    p, x = problem(kind, **rest)
    d, s, a, _ = p.split(x)
    factor, t = terms(p.wi, p.wo, p.kind, F0, p.frame(x), np.ascontiguousarray(a))
    frame = p.frame(x)
    matte = (
        [oren_nayar.evaluate(o, i, p.sigma(x)) for i, o in zip(p.wi @ frame, p.wo @ frame, strict=True)]
        if p.rough_base
        else 1 / np.pi
    )
    value = factor[:, None] * (np.multiply.outer(matte, d) + t[:, :, 0] @ s)
    value = np.maximum(value + noise * np.random.default_rng(seed).standard_normal(value.shape), 0)
    n = int(math.sqrt(len(value)))
    return from_grid(p.wi[::n], p.wo[:n], value.reshape(n, n, 3)), x


def test_the_lobes_are_those_that_scatter_light():
    wi, wo = even_directions(40, 85), spherical(np.linspace(0.1, 1.4, 40), np.linspace(0, 6, 40))
    for i, o in zip(map(tuple, wi), map(tuple, wo), strict=True):
        assert lobe(KINDS["phong"], i, o, 0.3, 0.3, F0)[0] == pytest.approx(phong.evaluate(o, i, 0.3), rel=1e-10)
        assert lobe(KINDS["ward"], i, o, 0.2, 0.4, F0)[0] == pytest.approx(ward.evaluate(o, i, 0.2, 0.4, 0), rel=1e-10)
        assert lobe(KINDS["ggx"], i, o, 0.2, 0.4, F0)[0] == pytest.approx(ggx.evaluate_schlick(o, i, F0, 0.2, 0.4), rel=1e-10)
        want = cook_torrance.evaluate(o, i, F0, 0.2, 0.4)
        assert lobe(KINDS["ct"], i, o, 0.2, 0.4, F0)[0] == pytest.approx(want, rel=1e-10)


@pytest.mark.parametrize(
    ("kind", "sigma"),
    [*((kind, None) for kind in ("phong", "ward", "ct", "ggx", "half_vector")), ("phong", 0.7), ("ct", 0.2), ("ggx", 1.2)],
)
def test_gradients_agree_with_differences(kind, sigma):
    # Few directions, seen at a tilt; residuals of all sizes, since the measured values are 0
    p, x = problem(kind, even_directions(12, 70), (0.2, -0.1), sigma=sigma)
    x[-1] = 0.3
    gradient, step = np.empty(p.size), 1e-6
    p.cost(x, gradient)
    for k in range(p.size):
        up, down = x.copy(), x.copy()
        up[k] += step
        down[k] -= step
        central = (p.cost(up, np.empty(0)) - p.cost(down, np.empty(0))) / (2 * step)
        # central differences err by step² and by 1e-16 / step: about 1e-9 of the largest derivative; the tables of ct have
        # kinks, which a step crosses rarely
        assert gradient[k] == pytest.approx(central, rel=1e-5, abs=2e-7 * np.abs(gradient).max()), k


@pytest.mark.parametrize("kind", ["phong", "ward", "ct", "ggx"])
def test_a_model_is_recovered_from_its_own_noisy_samples(kind):
    a, x = rendered(kind, noise=0.005)
    f = fit_texel(a, settings=FitSettings(model=kind, constrained=False, lobes=2, free_angle_deg=75.1))
    got = np.concatenate([f.diffuse, f.specular.ravel(), f.alpha.ravel()])
    sigma = np.sqrt(np.diag(f.covariance))[:-1]
    free = sigma > 0
    assert free.sum() >= 9
    # 13 parameters at 4 sigma: a chance of 1e-3 to fail by noise alone, and the noise is fixed
    assert (np.abs(got - x[:-3])[free] < 4 * sigma[free] + 1e-6).all()
    # clipping at 0 adds a little; the weighted noise is the relative variance
    assert f.relative_variance < 0.02


@pytest.mark.parametrize(
    ("kind", "base"), [("phong", "lambert"), ("ward", "lambert"), ("ct", "lambert"), ("ggx", "lambert"), ("ggx", "oren_nayar")]
)
def test_both_solvers_reach_the_same_cost(kind, base):
    a, _ = rendered(kind, noise=0.005, dome=even_directions(40), tilt=(0.1, -0.05), turn=1.0)
    ours, theirs = (fit_texel(a, settings=FitSettings(model=kind, base=base, solver=s)) for s in ("levenberg", "slsqp"))
    # each stops when a step gains less than 1e-7 of the cost, short of the bottom by some such steps; it may find a lower valley
    assert ours.cost <= theirs.cost * (1 + 1e-5)


@pytest.mark.parametrize("sigma", [None, 0.4])
def test_the_compiled_gradient_and_cost_are_those_of_the_objective(sigma):
    p, x = problem("ct", even_directions(12, 70), (0.2, -0.1), sigma=sigma)
    gradient, other = np.empty(p.size), np.empty(p.size)
    value = p.cost(x, gradient)
    hessian = np.empty((p.size, p.size))
    args = (p.wi, p.wo, p.value, p.kind, p.f0, p.tied, p.base, x, p.lobes, 1.0, 1)
    assert normal_equations(*args, hessian, other, np.empty((0, 0))) == pytest.approx(value, rel=1e-12)
    assert np.allclose(gradient, other, rtol=1e-9, atol=1e-12 * np.abs(gradient).max())


@pytest.mark.parametrize("turn", [0.3, 0.8, 1.4, 2.5])
def test_brushed_lobes_are_found_whatever_their_tangent(turn):
    a, _ = rendered("ward", noise=0.002, dome=even_directions(60), turn=turn)
    f = fit_texel(a, settings=FitSettings(model="ward"))
    # two widths of 0.15 and 0.3 under any name, along the tangent that belongs to them
    narrow = int(np.argmin(f.alpha[0]))
    assert np.allclose(np.sort(f.alpha[0]), (0.15, 0.3), atol=0.01)
    along = f.frame[:, narrow]
    assert abs(along @ (math.cos(turn), math.sin(turn), 0)) == pytest.approx(1, abs=1e-3)


def test_the_two_steps_stay_within_their_bounds():
    a, _ = rendered("ct", noise=0.002)
    f = fit_texel(a, settings=FitSettings(model="ct"))
    assert ((f.alpha[0] >= 0.1) & (f.alpha[0] <= 0.5)).all() and ((f.alpha[1] >= 0.5) & (f.alpha[1] <= 0.95)).all()
    assert f.relative_variance < 0.01


def test_normals_are_found_within_half_a_degree():
    errors = []
    for k, (theta, phi) in enumerate([(0, 0), (10, 50), (20, 190), (30, 300), (15, 120)]):
        n = spherical(math.radians(theta), math.radians(phi))
        tilt = (math.atan2(n[0], n[2]), -math.asin(n[1]))  # n = Ry(a) Rx(b) z
        a, _ = rendered("ct", noise=0.002, seed=k, tilt=tilt, lobes=1)
        errors.append(math.degrees(math.acos(min(float(estimate_normal(a)[:, 2] @ n), 1.0))))
    assert np.median(errors) < 0.5


def test_normals_lower_the_cost_of_tilted_texels():
    a, _ = rendered("ward", noise=0.002, tilt=(0.3, 0.1))
    without = fit_texel(a, settings=FitSettings(model="ward"))
    with_ = fit_texel(a, settings=FitSettings(model="ward", normals=True))
    assert with_.relative_variance < 0.5 * without.relative_variance


def test_texels_in_parallel_are_as_one_by_one():
    a, _ = rendered("ggx", noise=0.01, dome=even_directions(40))
    two = ABRDF(a.wi, a.wo, np.stack([a.value, 0.5 * a.value]), np.stack([a.valid] * 2), a.weight)
    one, many = fit(two, FitSettings(model="ggx", threads=1)), fit(two, FitSettings(model="ggx", threads=2))
    assert [f.cost for f in one] == [f.cost for f in many] and np.array_equal(one[1].alpha, many[1].alpha)


def test_real_paint_is_met_better_by_facets_than_by_phong(shared_data):
    a = read_cornell(shared_data / "cornell_brdf" / "krylon_blue.brdf")
    keep = np.array([5, 15, 25])
    a = ABRDF(a.wi, a.wo, a.value[:, keep], a.valid, a.weight, tuple(a.channels[k] for k in keep), isotropic=True)
    found = {m: fit_texel(a, settings=FitSettings(model=m, constrained=False)).relative_variance for m in ("phong", "ggx", "ct")}
    assert found["ggx"] < found["phong"] and found["ct"] < found["phong"]


def test_what_cannot_be_fitted_is_refused():
    a, _ = rendered("ward", dome=even_directions(5))
    with pytest.raises(InputError, match="valid samples within 45 degrees"):
        fit_texel(a)
    with pytest.raises(InputError, match="texel must lie in"):
        fit_texel(a, 3)
    with pytest.raises(InputError, match="base must be one of lambert, oren_nayar"):
        FitSettings(base="orennayar")
    with pytest.raises(InputError, match=r"lobes must lie in \[1, 2\]"):
        FitSettings(lobes=3)


def test_warm_starts_reach_what_fits_from_scratch_reach():
    a, _ = rendered("ct", noise=0.005, dome=even_directions(24))
    rng = np.random.default_rng(3)
    value = np.stack([np.maximum(a.value + 0.005 * rng.standard_normal(a.value.shape), 0) for _ in range(20)]).astype(np.float32)
    many = ABRDF(a.wi, a.wo, value, np.ones(value.shape[:2], bool), a.weight)
    cold, warm = (
        fit_where_possible(many, FitSettings(model="ct", constrained=False, warm_starts=w, threads=t))
        for w, t in ((False, 1), (True, 2))
    )
    ratio = [w.cost / c.cost for w, c in zip(warm, cold) if w is not None and c is not None]
    # two valleys may lie close; none of these is lower by more than the noise of the cost itself
    assert len(ratio) == 20 and max(ratio) < 1.02
    again = fit_where_possible(many, FitSettings(model="ct", constrained=False, threads=1))
    assert [f.cost for f in again if f] == [f.cost for f in warm if f]
