"""Fidelity of pictures against closed forms and independent implementations."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from evaluate.images import flip, ms_ssim, psnr, rel_mse, ssim, ssim_map, ssim_picture
from materials.foundation.errors import InputError


@pytest.fixture(scope="module")
def pair() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    smooth = cv2.GaussianBlur(rng.random((190, 200, 3)), (0, 0), 3)
    a = (smooth - smooth.min()) / np.ptp(smooth)
    return a, np.clip(a + rng.normal(0, 0.05, a.shape), 0, 1)


def test_ssim_is_that_of_scikit_image(pair):
    a, b = pair
    wanted, wanted_map = structural_similarity(
        a, b, data_range=1.0, channel_axis=-1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    assert ssim(a, b, 1.0) == pytest.approx(wanted, abs=1e-6)
    np.testing.assert_allclose(ssim_map(a, b, 1.0), np.asarray(wanted_map).mean(axis=-1), atol=1e-5)


def test_psnr_is_that_of_scikit_image_and_infinite_for_equals(pair):
    a, b = pair
    assert psnr(a, b, 1.0) == pytest.approx(peak_signal_noise_ratio(a, b, data_range=1.0))
    assert psnr(a, a, 1.0) == np.inf
    # A difference of one level everywhere.
    assert psnr(np.zeros((4, 4)), np.ones((4, 4)), 255) == pytest.approx(20 * np.log10(255))


def test_equal_pictures_are_equal_by_every_measure(pair):
    a, _ = pair
    assert ssim(a, a, 1.0) == pytest.approx(1) and ms_ssim(a, a, 1.0) == pytest.approx(1)
    assert rel_mse(a, a, 1.0) == 0 and flip(a, a, hdr=False)[0] == 0


def test_ssim_does_not_depend_on_the_unit_if_the_range_follows(pair):
    a, b = pair
    assert ssim(255 * a, 255 * b, 255) == pytest.approx(ssim(a, b, 1), abs=1e-7)
    assert ssim(a, b, 255) > 0.99 > ssim(a, b, 1)  # the pitfall: a range that is not the data's


def test_constant_pictures_differ_in_luminance_alone():
    a, b = np.full((16, 16), 0.4), np.full((16, 16), 0.6)
    assert ssim(a, b, 1.0) == pytest.approx((2 * 0.24 + 1e-4) / (0.16 + 0.36 + 1e-4), abs=1e-6)


def test_ms_ssim_of_constant_pictures_is_the_last_scale_luminance():
    a, b = np.full((176, 176), 0.4), np.full((176, 176), 0.6)
    luminance = (2 * 0.24 + 1e-4) / (0.16 + 0.36 + 1e-4)
    assert ms_ssim(a, b, 1.0) == pytest.approx(luminance**0.1333, abs=1e-6)


def test_ms_ssim_multiplies_what_each_scale_gives(pair):
    a, b = (image[..., :1] for image in pair)
    value = 1.0
    for i, exponent in enumerate((0.0448, 0.2856, 0.3001, 0.2363, 0.1333)):
        blur = {"ksize": (11, 11), "sigmaX": 1.5, "borderType": cv2.BORDER_REFLECT}
        x, y = np.squeeze(a).astype(float), np.squeeze(b).astype(float)
        mx, my = cv2.GaussianBlur(x, **blur), cv2.GaussianBlur(y, **blur)
        vx, vy = cv2.GaussianBlur(x * x, **blur) - mx**2, cv2.GaussianBlur(y * y, **blur) - my**2
        part = (2 * (cv2.GaussianBlur(x * y, **blur) - mx * my) + 9e-4) / (vx + vy + 9e-4)
        if i == 4:
            part = part * (2 * mx * my + 1e-4) / (mx**2 + my**2 + 1e-4)
        value *= part[5:-5, 5:-5].mean() ** exponent
        h, w = x.shape[0] // 2 * 2, x.shape[1] // 2 * 2
        a, b = (cv2.resize(image[:h, :w], (w // 2, h // 2), interpolation=cv2.INTER_AREA) for image in (x, y))
    assert ms_ssim(*(image[..., :1] for image in pair), 1.0) == pytest.approx(value, abs=1e-6)


def test_relative_error_of_a_tenth_everywhere():
    reference = np.full((5, 5), 2.0)
    assert rel_mse(1.1 * reference, reference, 1.0) == pytest.approx(0.04 / (4 + 0.01))


def test_regions_leave_the_rest_out(pair):
    a, b = pair
    region = np.zeros(a.shape[:2], bool)
    region[40:60, 40:60] = True
    worse = b.copy()
    worse[100:] = 0
    assert psnr(a, worse, 1.0, region) == psnr(a, b, 1.0, region)
    assert ssim(a, worse, 1.0, region) == ssim(a, b, 1.0, region)


def test_flip_sees_more_of_a_larger_difference_and_hdr_sees_highlights(pair):
    a, b = pair
    small, values = flip(b, a, hdr=False)
    large, _ = flip(np.clip(a + 4 * (b - a), 0, 1), a, hdr=False)
    assert values.shape == a.shape[:2] and 0 < small < large < 1
    assert values.mean() == pytest.approx(small, abs=1e-5)
    # Differences above white exist only in high dynamic range.
    bright = a * 4
    dimmer = np.where(bright > 2, bright / 2, bright)
    assert flip(dimmer, bright, hdr=True)[0] > 0.02
    with pytest.raises(InputError, match=r"reference must lie in \[0, 1\]"):
        flip(a, bright, hdr=False)


def test_the_map_of_the_thesis_is_black_where_equal():
    assert ssim_picture(np.array([[1.0, 0.0, -0.5]])).tolist() == [[0, 255, 255]]
    assert ssim_picture(np.array([[1.0, 0.0]]), inverse=False).tolist() == [[255, 0]]


def test_what_cannot_be_compared_is_refused(pair):
    a, b = pair
    with pytest.raises(InputError, match="pictures must have one shape"):
        psnr(a, b[:-1], 1.0)
    with pytest.raises(InputError, match=r"data_range must lie in \(0, inf\)"):
        ssim(a, b, 0)
    with pytest.raises(InputError, match="at least 176"):
        ms_ssim(a[:100], b[:100], 1.0)
    with pytest.raises(InputError, match="at least 11"):
        ssim(a[:8], b[:8], 1.0)
    with pytest.raises(InputError, match="region must select at least one pixel"):
        psnr(a, b, 1.0, np.zeros(a.shape[:2], bool))
    with pytest.raises(InputError, match="pictures must be finite"):
        ssim(np.full((20, 20), np.nan), np.zeros((20, 20)), 1.0)
