"""A measured BRDF that is written as a measurement/1 and read again is the same."""

from __future__ import annotations

import numpy as np
import pytest

from materials.abrdf import ABRDF
from materials.directions import spherical
from materials.foundation.errors import InputError
from materials.measured.measurement_file import read_measurement
from materials.measured.measurement_writer import write_measurement
from materials.measured.source import read_brdf


def _samples(channels: tuple[str, ...]) -> ABRDF:
    theta, phi = np.radians([10.0, 30.0, 50.0]), np.radians([0.0, 90.0, 180.0])
    wi, wo = spherical(theta, np.zeros(3)), spherical(theta[::-1], phi)
    value = np.random.default_rng(0).uniform(0.1, 1, (3, len(channels))).astype(np.float32)
    return ABRDF(wi, wo, value, np.ones(3, bool), np.ones(3), channels, isotropic=True, name="paint")


@pytest.mark.parametrize("channels", [("450 nm", "550 nm"), ("R", "G", "B")])
def test_what_is_written_is_read_again(tmp_path, channels):
    samples = _samples(channels)
    model = {"model": "lambert", "albedo": 0.2, "free": ["albedo"]}
    back = read_measurement(write_measurement(tmp_path, samples, model, np.full(samples.value.shape, 0.01)))
    assert back.samples is not None and back.sigma is not None
    assert back.model == model and back.name == "paint"
    order = np.argsort(back.samples.wi[:, 2])[::-1]
    # Wavelengths rise in what is read; red, green and blue are written as theirs, which fall.
    expected = samples.value if channels[0] != "R" else samples.value[:, ::-1]
    assert back.samples.value[order] == pytest.approx(expected)
    assert back.sigma == pytest.approx(0.01)


def test_channels_that_are_no_wavelengths_are_refused(tmp_path):
    with pytest.raises(InputError, match="channels must be wavelengths"):
        write_measurement(tmp_path, _samples(("left", "right")))


def test_a_paint_of_cornell_is_known_by_its_suffix(shared_data, tmp_path):
    samples = read_brdf(shared_data / "cornell_brdf" / "garnet_red.brdf")
    assert samples is not None and samples.value.shape == (1439, 31)
    assert read_brdf(tmp_path) is None
