"""Drops on the glass are found by how they look, once that is known from one of them."""

from __future__ import annotations

import numpy as np
import pytest

from evaluate.effects.lens_droplets import LensDroplets
from evaluate.mismatch.case import Case
from evaluate.mismatch.effect import Context
from evaluate.mismatch.formation import believed, develop, radiance

from .worlds import recorded, simulation

LOOKS = {"magnification": 1.5, "blur": 0.8, "size": 1.0, "transmission": 1.0}
DROPS = [(20.0, 22.0, 4.5), (38.0, 17.0, 3.5), (40.0, 32.0, 4.0)]


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    return recorded(tmp_path_factory.mktemp("clean"), simulation(), {})


def seen_through(case: Case, drops: list) -> Context:
    """Return what is known of a recording through drops by someone who believes in clean glass."""
    state = believed(case)
    plain = develop(state, radiance(case, state))
    if drops:
        LensDroplets().change(case, state, LOOKS, None, drops)
    variance = case.noise_of(plain)
    noise = np.sqrt(variance) * np.random.default_rng(8).standard_normal(plain.shape)
    residual = (develop(state, radiance(case, state)) + noise - plain).astype(np.float32)
    return Context(plain, state, (1 / variance).astype(np.float32), residual)


def test_one_drop_leads_to_the_others(case):
    x, y, radius = DROPS[0]
    first = [(x + 0.8, y - 0.6, radius * 1.3)]
    found = LensDroplets().completed(case, None, first, LOOKS, seen_through(case, DROPS))
    assert len(found) == len(DROPS)
    for drop in DROPS:
        # Searched for in steps of an eighth of a pixel; noise and texture leave some of them.
        off = np.abs(np.array(found) - drop)
        assert np.any(np.all(off < 0.6, axis=1))


def test_where_there_are_no_drops_none_are_added(case):
    first = [(30.0, 24.0, 4.0)]
    assert LensDroplets().completed(case, None, first, LOOKS, seen_through(case, [])) == first
