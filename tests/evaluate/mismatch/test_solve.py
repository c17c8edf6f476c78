from __future__ import annotations

import numpy as np
import pytest

from evaluate.effects import catalogue
from evaluate.mismatch.calibrate import calibrate, weigh, white_level
from evaluate.mismatch.case import subset
from evaluate.mismatch.effect import Term
from evaluate.mismatch.solve import covariance, fit, held_out

from .worlds import recorded, simulation

KNOWN = {e.id: e for e in catalogue()}


@pytest.fixture(scope="module")
def vignetted(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("vignetted"), simulation(), {"vignetting": {"power": 1.5}})


def with_effect(case, id, target=None):
    fitted, weight = calibrate(case)
    term = Term(KNOWN[id], target, None, KNOWN[id].parameters(case, target))
    return fit(case, weight, [*fitted.terms, term], 20, 1e-9), weight


def test_a_fit_finds_the_parameter_that_made_the_pictures(vignetted):
    fitted, weight = with_effect(vignetted, "vignetting")
    sigma = covariance(vignetted, fitted)
    value, s = float(fitted.terms[-1].values["power"]), float(sigma[("vignetting", None, "power")][0])
    assert abs(value - 1.5) < 4 * s
    assert s < 0.2
    # 1.3 times the degrees of freedom is 30 standard deviations off; weights from the noisy signal take off a little.
    assert 0.9 < fitted.total / (weight > 0).sum() < 1.1


def test_held_out_chi_square_is_that_of_fits_without_the_block(vignetted):
    fitted, weight = with_effect(vignetted, "vignetting")
    quick = held_out(vignetted, fitted)
    block = vignetted.block == vignetted.block[3]
    less = np.where(block[:, None, None, None], 0, weight).astype(np.float32)
    other = fit(vignetted, less, fitted.terms, 20, 1e-9)
    slow = float((weight[block] * (vignetted.pictures - other.picture)[block] ** 2).sum())
    # Both are the chi-square of about 9000 values; the quadratic form errs by less than one of them.
    assert abs(quick[block].sum() - slow) < 1.0
    assert quick.sum() >= fitted.total


def test_a_lamp_of_one_frame_is_judged_on_half_of_it(tmp_path):
    lamps = {f"log_factor.lamp{i}.{c}": 0.1 * (i - 1) for i in range(3) for c in "rgb"}
    # The third lamp is on in the last of these frames alone.
    case = subset(recorded(tmp_path, simulation(), {"light_colour": lamps}), [0, 1, 3, 4, 6, 7, 8])
    fitted, _ = with_effect(case, "light_colour")
    # Half a frame tells the three parameters well; what others know of them would cost thousands.
    assert 0 <= held_out(case, fitted).sum() - fitted.total < 100


def test_white_noise_is_told_from_structure(vignetted):
    fitted, weight = calibrate(vignetted)
    z = (vignetted.pictures - fitted.picture) * np.sqrt(weight)
    assert (z**2).mean() > 1.2
    # A median of some 60 000 absolute values is good to 0.4 %; smooth structure within 2 x 2 pixels adds little.
    assert abs(white_level(vignetted, z) - 1) < 0.05


def test_edges_weigh_less(vignetted):
    weight = weigh(vignetted, vignetted.pictures)
    edge = vignetted.pieces.edge.reshape(vignetted.valid.shape)
    plain = 1 / vignetted.variance
    assert np.all(weight[edge] <= plain[edge])
    np.testing.assert_array_equal(weight[~edge], plain[~edge])


def test_exposures_per_frame_are_fitted_apart(tmp_path):
    gains = np.log(np.linspace(0.8, 1.2, 9))
    case = recorded(tmp_path, simulation(), {"exposure_drift": {"log_gain": gains}})
    fitted, _ = with_effect(case, "exposure_drift")
    got = fitted.terms[-1].values["log_gain"]
    # Their common level belongs to the albedo as well.
    np.testing.assert_allclose(got - got.mean(), gains - gains.mean(), atol=0.004)
