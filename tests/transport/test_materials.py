"""Every material of a simulation reaches the tracer with its parameters, in the frame of the mesh."""

from __future__ import annotations

import numpy as np
import pytest

from materials import conductor, cook_torrance, disney, ggx, oren_nayar, phong, scattering, ward
from materials.foundation.errors import InputError
from materials.gloss import Tail
from scene.simulation import DirectionalLight, Material
from tests.transport.worlds import camera, floor, world
from transport.render import render

RGB = (0.3, 0.2, 0.1)
TINT = (0.9, 0.6, 0.3)
TAIL = Tail(0.3, 0.8)
METAL = conductor.METALS["copper"]
LOOK = disney.Principled(metallic=0.3, roughness=0.6, anisotropic=0.6, sheen=0.5, clearcoat=0.7, clearcoat_gloss=0.2)
CASES = {
    "oren_nayar": (Material("oren_nayar", RGB, sigma=0.4), oren_nayar.surface(RGB, 0.4)),
    "ggx": (
        Material("ggx", RGB, alpha_u=0.5, alpha_v=0.2, eta=1.8, specular_scale=0.7, tint=TINT, tail=TAIL),
        ggx.surface(RGB, 0.5, alpha_v=0.2, eta=1.8, specular_scale=0.7, tint=TINT, tail=TAIL),
    ),
    "cook_torrance": (
        Material("cook_torrance", RGB, alpha=0.5, alpha_v=0.2, eta=1.8, tint=TINT, tail=TAIL),
        cook_torrance.surface(RGB, 0.5, alpha_v=0.2, eta=1.8, tint=TINT, tail=TAIL),
    ),
    "ward": (
        Material("ward", RGB, alpha_u=0.2, alpha_v=0.5, specular_scale=0.3, normalisation="duer"),
        ward.surface(RGB, 0.2, alpha_v=0.5, specular_scale=0.3, normalisation="duer"),
    ),
    "phong": (Material("phong", RGB, alpha=0.4, specular_scale=0.3), phong.surface(RGB, 0.4, specular_scale=0.3)),
    "conductor": (Material("conductor", alpha=0.4, alpha_v=0.2, metal=METAL), conductor.surface(*METAL, 0.4, alpha_v=0.2)),
    "disney": (Material("disney", RGB, principled=LOOK), disney.surface(RGB, LOOK)),
}
TOWARDS = np.array([0.4, 0.5, np.sqrt(1 - 0.41)])


def seen(material, turn=0.0):
    """Return the radiance of a floor under one sun of irradiance pi, and the view it was seen from."""
    eye = np.array([-3.0, 1.5, 4.0])
    # dp/du of the floor is the world's x axis
    lit = world({"floor": (floor(), material)}, {"sun": DirectionalLight(tuple(-TOWARDS), (np.pi,) * 3)})
    # a view so narrow that all its rays share a direction to 1e-6
    rendering = render(lit, camera(eye, (0, 0, 0), 4, 4, 1e-4), samples=1, max_bounces=1)
    return rendering.radiance.mean((0, 1)), eye / np.linalg.norm(eye)


@pytest.mark.parametrize("name", CASES)
def test_a_floor_in_sunlight_shows_its_brdf(name):
    material, surface = CASES[name]
    got, wo = seen(material)
    np.testing.assert_allclose(got, np.pi * TOWARDS[2] * scattering.evaluate(surface, wo, TOWARDS), rtol=1e-5)


@pytest.mark.parametrize("name", ["ggx", "ward", "disney"])
def test_a_turned_tangent_turns_the_brdf_with_it(name):
    material, surface = CASES[name]
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    to_local = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    got, wo = seen(Material(**{**vars(material), "tangent_angle": angle}))
    expected = np.pi * TOWARDS[2] * scattering.evaluate(surface, to_local @ wo, to_local @ TOWARDS)
    np.testing.assert_allclose(got, expected, rtol=1e-5)
    # and not by so little that the comparison could not tell: ten times its tolerance
    assert np.abs(got / seen(material)[0] - 1).max() > 1e-4


def test_textures_give_widths_along_and_across_and_the_colour_of_the_lobe():
    widths = np.broadcast_to(np.array([0.5, 0.2], np.float32), (2, 2, 2))
    tint = np.broadcast_to(np.array(TINT, np.float32), (2, 2, 3))
    textured = Material("ggx", RGB, eta=1.8, alpha_texture=widths, tint_texture=tint)
    got, wo = seen(textured)
    surface = ggx.surface(RGB, 0.5, alpha_v=0.2, eta=1.8, tint=TINT)
    # the textures are float32
    np.testing.assert_allclose(got, np.pi * TOWARDS[2] * scattering.evaluate(surface, wo, TOWARDS), rtol=1e-5)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Material("oren_nayar", sigma=-1.0), r"materials.floor.sigma must lie in"),
        (Material("ward", alpha_u=0.0), r"materials.floor.alpha must lie in \(0, 1\]"),
        (Material("phong", alpha_u=0.2, alpha_v=0.3), "materials.floor.alpha_v must equal alpha_u"),
        (Material("conductor"), "materials.floor.metal must be given"),
        (Material("ggx", tail=Tail(-1.0, 0.5)), "materials.floor.tail.scale must lie in"),
        (Material("ggx", alpha_v=-0.1), "materials.floor.alpha_v must lie in"),
        (Material("velvet"), "materials.floor.model must be one of lambert, "),  # type: ignore[arg-type]
    ],
)
def test_materials_without_meaning_are_refused_by_name(material, words):
    with pytest.raises(InputError, match=words):
        world({"floor": (floor(), material)}, {})
