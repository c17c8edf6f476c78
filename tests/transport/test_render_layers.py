"""What a picture was made of: each part of the light where geometry says that it must be."""

from __future__ import annotations

import numpy as np

from scene.simulation import DirectionalLight, EnvironmentLight, Film, Material, SphereLight
from tests.transport.worlds import WHITE, camera, floor, grey, world
from transport.render import render
from transport.render_layers import label_layers, light_layers

SKY = {"sky": EnvironmentLight(WHITE)}
VIEW = camera((-6, 1, 2), (0, 0, 0), 16, 12, 20)


def specular_alone(material, **kw):
    return render(world({"floor": (floor(), material)}, SKY), VIEW, 64, 1, specular_only=True, **kw).radiance


def test_a_matte_floor_is_diffuse_and_a_mirror_specular():
    matte = render(world({"floor": (floor(), grey(0.4))}, SKY), VIEW, 8)
    assert matte.specular.max() == 0 and matte.seen.max() == 0 and matte.scattered.max() == 0
    np.testing.assert_array_equal(matte.diffuse, matte.radiance)
    np.testing.assert_allclose(matte.albedo, 0.4, rtol=1e-6)
    np.testing.assert_allclose(matte.normal, np.broadcast_to((0, 0, 1), matte.normal.shape), atol=1e-6)
    mirror = render(world({"floor": (floor(), Material("mirror", (0.9, 0.8, 0.7)))}, SKY), VIEW, 8)
    assert mirror.diffuse.max() == 0
    np.testing.assert_array_equal(mirror.specular, mirror.radiance)
    np.testing.assert_allclose(mirror.albedo, np.broadcast_to((0.9, 0.8, 0.7), mirror.albedo.shape), rtol=1e-6)


def test_the_specular_part_of_gloss_is_what_a_tracer_of_specular_lobes_finds():
    for material in (
        Material("ggx", (0.5, 0.3, 0.1), alpha=0.3),
        Material("disney", (0.5, 0.3, 0.1)),
        Material("coated", (0.5, 0.3, 0.1)),
        Material("lambert", (0.5, 0.3, 0.1), film=Film(0.5, 0.01)),
    ):
        whole = render(world({"floor": (floor(), material)}, SKY), VIEW, 64, 2, max_bounces=1)
        alone = specular_alone(material, max_bounces=1)
        assert whole.diffuse.mean() > 0.02 and whole.specular.mean() > 0.02
        # Both are means over 192 even pixels: five standard errors of either.
        spread = (whole.specular - alone).mean(axis=-1)
        assert abs(spread.mean()) < 5 * spread.std(ddof=1) / np.sqrt(spread.size) + 1e-6, material.model


def test_lamps_and_sky_that_are_seen_are_emission():
    lamp = SphereLight((0.0, 0.0, 1.0), 0.3, (5.0, 5.0, 5.0))
    lit = world({"floor": (floor(4.0), grey(0.5))}, {"lamp": lamp, **SKY})
    seen = render(lit, camera((-6, 0, 1), (0, 0, 1), 24, 24, 60), 8)
    assert seen.seen[12, 12].min() > 10 and seen.diffuse[12, 12].max() == 0  # the lamp
    np.testing.assert_allclose(seen.seen[0], 1, rtol=1e-6)  # the sky
    assert seen.seen[16, 12].max() == 0 and seen.diffuse[16, 12].min() > 0.1  # the floor


def test_the_channels_have_the_names_of_the_field_and_the_exposure_scales_light():
    lit = world({"floor": (floor(4.0), grey(0.5))}, {"sun": DirectionalLight((0, 0, -1), WHITE)})
    picture = render(lit, VIEW, 2)
    once, twice = light_layers(picture), light_layers(picture, 2.0)
    np.testing.assert_array_equal(twice["R"], 2 * once["R"])
    np.testing.assert_array_equal(twice["variance.G"], 4 * once["variance.G"])
    np.testing.assert_array_equal(twice["albedo.B"], once["albedo.B"])
    labels = label_layers(lit, VIEW, next_camera=VIEW)
    assert {"Z", "id.shape", "id.material", "transmittance.Y", "flow.X", "flow.A", "reflected_flow.A"} <= set(labels)
    on = labels["id.shape"] == 1
    assert on.any() and not on.all()
    assert np.all(np.isinf(labels["Z"][~on])) and np.all(labels["id.material"] == on)
    assert np.all(labels["transmittance.Y"] == 1) and np.all(labels["reflected_flow.A"] == 0)
    np.testing.assert_allclose(labels["flow.X"], 0, atol=1e-3)
    assert "flow.X" not in label_layers(lit, VIEW)
