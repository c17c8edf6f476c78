from __future__ import annotations

import numpy as np

from evaluate.effects.subsurface import Subsurface, without_surface
from evaluate.kernels.fragments import LAMP_POWER
from evaluate.mismatch.effect import Context
from evaluate.mismatch.formation import believed, frame_of, radiance

from .worlds import recorded, simulation


def test_light_below_a_surface_is_a_mean_of_what_enters_around(tmp_path):
    case = recorded(tmp_path, simulation(), {})
    effect, state = Subsurface(), believed(case)
    picture = radiance(case, state)
    aux = effect.prepare(case, "ball", Context(picture, state, np.ones_like(picture), 0 * picture))
    length = 0.03
    values = {"diffusion_length": length, "near.r": 0.5, "near.b": 2.0, "far.r": 0.3, "far.g": 0.2, "far.b": 0.1, "grazing": 0.0}
    effect.change(case, state, values, "ball", aux)
    # The same in plain NumPy.
    near = np.exp(-aux["apart"].astype(np.float64) / length)
    spread = near @ aux["E"] / near.sum(axis=1, keepdims=True)
    own = aux["own"]
    expected = np.zeros((len(own), 3))
    for i, lamps in enumerate(case.slots[frame_of(case)[own]]):
        for lamp in lamps[lamps >= 0]:
            expected[i] += (spread[aux["near"][i], lamp] @ aux["weight"][i]) * state.lamps[lamp, LAMP_POWER:]
    # Multiplied by what the surface reflects itself.
    expected *= np.array([0.3 / 0.5, 0.2, 0.1 / 2.0]) / np.pi
    # Sums of 1200 single floats.
    np.testing.assert_allclose(state.ambient[own], expected, rtol=2e-5, atol=1e-6)
    assert not state.ambient[np.setdiff1d(np.arange(len(state.ambient)), own)].any()
    # Another length is another blur, though the last one is remembered.
    effect.change(case, other := believed(case), values | {"diffusion_length": 0.3}, "ball", aux)
    assert np.ptp(other.ambient[own, 0]) < 0.5 * np.ptp(state.ambient[own, 0])


def test_a_medium_without_surface_reflects_as_much_as_its_albedo_and_is_brightest_at_grazing_angles():
    at = (np.arange(400) + 0.5) / 400
    ratio = without_surface(at[:, None], at[None])
    # Over a matte surface of the same albedo: one on average over both directions, weighted by their cosines; H is known to 4 %.
    assert abs((4 * at[:, None] * at[None] * ratio).mean() - 1) < 0.05
    np.testing.assert_allclose(ratio, ratio.T)
    assert without_surface(np.array(0.1), np.array(0.1)) > 1.5 > 1.1 > without_surface(np.array(1.0), np.array(1.0))
