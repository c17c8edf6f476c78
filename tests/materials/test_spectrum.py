from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from materials.spectrum import matching_functions, rgb_weights, wavelengths_of


def test_green_light_is_brightest_at_555_nm():
    w = np.arange(400, 701)
    y = matching_functions(w)[:, 1]
    # the published table peaks at 1.0 at 555 nm; the fit is 1 % off at most
    assert abs(w[np.argmax(y)] - 555) <= 5 and y.max() == pytest.approx(1.0, abs=0.02)


def test_flat_spectra_are_grey_and_red_ones_red():
    w = np.linspace(400, 700, 31)
    assert np.allclose(rgb_weights(w).sum(axis=0), 1)
    r, g, b = (w > 600).astype(float) @ rgb_weights(w)
    assert r > 0.5 > max(g, b) and max(abs(g), abs(b)) < 0.1


def test_wavelengths_that_say_nothing_of_colour_are_refused():
    with pytest.raises(InputError, match="reach into 380 to 780 nm"):
        rgb_weights([900, 1000])
    with pytest.raises(InputError, match="wavelengths must rise"):
        rgb_weights([500, 400])
    found = wavelengths_of(("450 nm", "550 nm"))
    assert found is not None and found.tolist() == [450, 550]
