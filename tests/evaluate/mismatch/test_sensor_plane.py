from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from evaluate.mismatch.sensor_plane import wide_blur


@pytest.mark.parametrize(("sigma", "step"), [(1.5, 1), (7.0, 1), (9.0, 2), (17.0, 4), (30.0, 7), (90.0, 8)])
def test_a_wide_blur_is_a_gaussian_of_the_mirrored_picture(sigma, step):
    # Of details of a few pixels: finer ones than a step of the smaller picture fold into it.
    noise = np.random.default_rng(0).standard_normal((50, 61, 3))
    picture = gaussian_filter(noise, (3, 3, 0), mode="reflect").astype(np.float32)
    # The picture is filled up to whole steps; the mirror stands behind that.
    whole = np.pad(picture, ((0, -50 % step), (0, -61 % step), (0, 0)), mode="symmetric").astype(float)
    exact = gaussian_filter(whole, (sigma, sigma, 0), mode="reflect", truncate=6)[:50, :61]
    found = wide_blur(picture[None], sigma)[0]
    # Between the smaller picture's pixels, a quarter of sigma apart, the Gaussian is taken to be straight.
    assert np.abs(found - exact).max() < 0.005 * picture.std()
