import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.reconstruction.build_settings import SkySettings
from scene.reconstruction.sky import generic_sky, sky_panorama, sky_report

from .. import toy_drive as toy

COARSE = SkySettings(texel_deg=1.0)


def texel(azimuth_deg: float, elevation_deg: float) -> tuple[int, int]:
    return int(90 - elevation_deg), int(azimuth_deg + 180)


def test_generic_sky_rises_from_nothing_at_the_horizon_to_full_at_15_degrees():
    elevation = np.deg2rad([-30, 0, 7.5, 15, 60])
    assert np.allclose(generic_sky(elevation), (0, 0, 0.5, 1, 1))
    assert np.allclose(generic_sky(elevation, np.array([0.2, 0.4, 0.6]))[2], (0.1, 0.2, 0.3))


def test_seen_sky_has_its_radiance_and_the_rest_is_generic(tmp_path):
    sky, report = sky_report(toy.drive(tmp_path), toy.meshes(), settings=COARSE)
    P = sky.panorama
    assert P.shape == (180, 360, 4)
    # The cameras look along +x; 50 of 260 px above the axis is 11 degrees, the axis 3.4 degrees down.
    assert np.allclose(P[texel(0, 5)], (*toy.SKY, 1), atol=1e-3)
    assert np.allclose(report["sky_level"], toy.SKY, atol=1e-3)
    assert report["clipped_share"] == 0
    # Behind the cameras nothing was seen: generic, in the measured level.
    assert P[texel(170, 40)][3] == 0 and np.allclose(P[texel(170, 40)][:3], toy.SKY, atol=1e-3)
    assert np.allclose(P[texel(170, 5)][:3], toy.SKY * 4.5 / 15, atol=1e-3)
    # A degree above the picture the seen sky is carried on, faded by a third to the generic half (7.5 of 15 degrees).
    assert 0 < P[texel(0, 8)][3] < 1 and np.allclose(P[texel(0, 8)][:3], toy.SKY * (2 / 3 + 1 / 3 * 0.5), atol=0.02)


def test_the_wall_hides_the_sky_behind_it(tmp_path):
    sky = sky_panorama(toy.drive(tmp_path, (1.0,)), toy.meshes(), settings=COARSE)
    # Seen from x = 0 the wall at 14 m reaches from 4 to 16 degrees and up to (2.5 - 1.6) / 14 = 3.7 degrees.
    assert sky.panorama[texel(10, 1)][3] < 1
    assert np.allclose(sky.panorama[texel(10, 6)][:3], toy.SKY, atol=1e-3)


def test_the_thesis_model_has_a_generic_sky_of_one(tmp_path):
    settings = SkySettings(texel_deg=2.0, model="thesis")
    P = sky_panorama(toy.drive(tmp_path, (1.0,)), toy.meshes(), settings=settings).panorama
    assert np.allclose(P[10, 5, :3], 1)


def test_what_moves_is_not_sky(tmp_path):
    P = sky_panorama(toy.drive(tmp_path, moving=True), toy.meshes(), settings=COARSE).panorama
    assert P[..., 0].max() < 0.9


def test_an_absurd_texel_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"texel_deg must lie in \[0.05, 15\], got 0"):
        sky_panorama(toy.drive(tmp_path, (1.0,)), toy.meshes(), settings=SkySettings(texel_deg=0.0))
