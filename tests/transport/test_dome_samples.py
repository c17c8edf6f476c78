from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from transport.dome import DomeSettings, acquire
from transport.dome_samples import SAMPLES, dome_sample


def test_the_nine_samples_differ_and_depend_on_size_and_seed_alone():
    assert len(SAMPLES) == 9
    for name in SAMPLES:
        one, again, other = (dome_sample(name, 16, seed) for seed in (0, 0, 1))
        assert np.array_equal(one.height, again.height) and np.array_equal(one.albedo, again.albedo)
        # what is woven and embossed has no chance in its relief, or little
        assert not (np.array_equal(one.height, other.height) and np.array_equal(one.albedo, other.albedo))
        slope = np.degrees(np.arctan(np.hypot(*np.gradient(one.height, one.texel))))
        assert np.median(slope) < 30


def test_metals_shine_and_felt_does_not():
    s = DomeSettings(lights=60, views=1, samples=4)
    contrast = {}
    for name in ("alu", "copper", "felt"):
        f = acquire(dome_sample(name, 16), s, np.array([[4, 4], [9, 9], [12, 3]])).normalise().value.mean(axis=(0, 2))
        contrast[name] = f.max() / np.median(f)
    assert min(contrast["alu"], contrast["copper"]) > 5 * contrast["felt"]


def test_unknown_samples_are_refused():
    with pytest.raises(InputError, match="name must be one of carpet"):
        dome_sample("velvet")
    with pytest.raises(InputError, match="size must be at least 8"):
        dome_sample("felt", 4)
