"""What is handed to Mitsuba is the same world; that both find the same light in it is shown by `benchmarks.proof`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.proof_street_mitsuba import compare
from materials import fresnel
from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.simulation import Film, Material
from transport import mitsuba_export
from transport.mitsuba_surfaces import diffuse_internal


def test_light_sent_back_below_water_is_that_of_the_closed_form_and_less_with_depth():
    for eta in (1.2, 1.33, 1.63):
        assert abs(diffuse_internal(eta, np.zeros(1))[0] - float(fresnel.diffuse_internal(eta))) < 1e-7
    assert np.all(np.diff(diffuse_internal(1.33, np.linspace(0, 0.1, 20))) < 0)


def test_a_panorama_on_mitsubas_rows_interpolates_to_ours():
    panorama = np.random.default_rng(0).random((6, 12, 3)).astype(np.float32)
    rows = mitsuba_export._at_poles(panorama)
    assert rows.shape == (13, 12, 3)
    np.testing.assert_array_equal(rows[1::2], panorama)
    np.testing.assert_array_equal(rows[[0, -1]], panorama[[0, -1]])
    np.testing.assert_allclose(rows[2:-1:2], 0.5 * (panorama[1:] + panorama[:-1]), rtol=1e-6)


NOBODY = SimpleNamespace()  # stands for Mitsuba where a refusal comes before its first use


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Material(opacity_texture=np.ones((2, 2), np.float32)), r"materials\.thing must have an equal in Mitsuba, got an opacity"),
        (Material("rough_dielectric"), "got rough_dielectric"),
        (Material("phong"), "got phong"),
        (Material(film=Film(1.0, level=True)), r"materials\.thing\.film must have an equal in Mitsuba, got a level or rough film"),
        (Material("coated", film=Film(1.0, level=False)), "got a film on a coat"),
        (Material("coated", alpha_texture=np.ones((2, 2), np.float32)), "got a rough coat"),
    ],
)
def test_what_mitsuba_cannot_say_is_refused(material, words):
    with pytest.raises(InputError, match=words):
        mitsuba_export._surface(NOBODY, "thing", material)  # type: ignore[arg-type]


@pytest.mark.parametrize("changes", [{"model": "OPENCV"}, {"cx": 3.0}, {"fy": 9.0}])
def test_cameras_that_mitsuba_lacks_are_refused(changes):
    given = {"model": "PINHOLE", "width": 8, "height": 8, "T_world_camera": np.eye(4), "fx": 8.0, "fy": 8.0, "cx": 4.0, "cy": 4.0}
    with pytest.raises(InputError, match="camera must be a centred pinhole"):
        mitsuba_export._sensor(NOBODY, Camera(**(given | changes)))  # type: ignore[arg-type]


def test_the_comparison_of_two_renderers_notices_one_percent_and_forgives_noise():
    rng = np.random.default_rng(4)
    truth = rng.uniform(0.2, 1.0, (40, 60, 3))
    ours, theirs = (truth + s * rng.normal(size=(8, *truth.shape)) for s in (0.02, 0.05))
    same, brighter, moved = compare(ours, theirs), compare(1.01 * ours, theirs), compare(np.roll(ours, 1, axis=2), theirs)
    assert np.all(np.abs(same.z) < 4) and same.share < same.share_by_chance + 4 * same.share_error
    assert same.error < same.error_by_chance + 4 * same.error_error
    assert np.all(brighter.z > 4)
    assert moved.share > 0.5 and moved.error > 10 * moved.error_by_chance


@pytest.mark.parametrize("model", ["oren_nayar", "ward", "disney", "measured"])
def test_models_without_an_equal_are_refused_rather_than_made_matte(model):
    with pytest.raises(InputError, match=f"have an equal in Mitsuba, got {model}"):
        mitsuba_export._surface(SimpleNamespace(), "m", Material(model))
