"""Materials of simulation/1: every model comes back from its file as it was, and says no more than it means."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import msgspec
import numpy as np
import pytest

from materials.conductor import METALS
from materials.disney import Principled
from materials.foundation.errors import InputError
from materials.gloss import Tail
from scene.images import Encoding, write_exr, write_image
from scene.mesh import Mesh, write_ply
from scene.simulation import DirectionalLight, EnvironmentLight, Film, Material, Medium, Shape, Simulation
from scene.simulation_file import read_simulation, write_simulation
from scene.simulation_json import MaterialJson
from scene.simulation_materials import KEYS
from transport.material_table import compile_materials

TRIANGLE = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32), np.tile(np.float32([0, 0, 1]), (3, 1)))
RNG = np.random.default_rng(0)
GREY, RGB = RNG.random((3, 4)).astype(np.float32), RNG.random((2, 3, 3)).astype(np.float32)
TINTED = {"tint": (0.9, 0.8, 0.7), "tail": Tail(0.2, 0.6, 0.7)}
MATERIALS = {
    "matte": Material("lambert", (0.1, 0.2, 0.3), one_sided=True, bump_texture=GREY, bump_scale=0.01),
    "textured": Material("lambert", albedo_texture=RGB, normal_texture=RGB, opacity_texture=GREY, free=("albedo_scale",)),
    "puddle": Material("lambert", (0.2, 0.2, 0.2), film=Film(GREY, 0.01, 1.34, (0.1, 0.2, 0.3), 0.05, level=False)),
    "rough": Material("oren_nayar", (0.4, 0.4, 0.4), sigma=0.5),
    "gloss": Material("ggx", (0.1, 0.2, 0.3), alpha_texture=GREY, eta=1.4, film=Film(0.5, GREY), **TINTED),
    "brushed": Material("ggx", alpha=0.2, alpha_u=0.1, alpha_v=0.4, tangent_angle=0.3, specular_scale=2.0, free=("alpha_u",)),
    "facets": Material("cook_torrance", alpha=0.2, eta=1.7, tint_texture=RGB, tail=Tail(0.1, 0.5)),
    "ward": Material("ward", alpha=0.2, alpha_u=0.1, alpha_v=0.4, normalisation="original", **TINTED),
    "phong": Material("phong", alpha=0.25, **TINTED),
    "gold": Material("conductor", metal=METALS["gold"], alpha=0.1),
    "odd metal": Material("conductor", metal=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), alpha=0.0, specular_scale=0.9),
    "principled": Material("disney", (0.6, 0.1, 0.1), principled=Principled(0.2, clearcoat=0.5, anisotropic=0.3)),
    "varnish": Material("coated", (0.6, 0.1, 0.1), eta=1.6),
    "mirror": Material("mirror", (0.9, 0.9, 0.9)),
    "milk": Material("dielectric", eta=1.33, interior=Medium(2.0, (0.99, 0.98, 0.9), 0.4)),
    "frosted": Material("rough_dielectric", eta=1.5, alpha=0.2),
    "lamp": Material("emission", emission=(3.0, 2.0, 1.0), emission_texture=RGB),
}


def simulation(materials, **lights) -> Simulation:
    return Simulation(tuple(Shape(n, TRIANGLE, n) for n in materials), materials, lights)


def assert_same(a, b, what):
    """Assert that two dataclasses hold the same, textures to the bit."""
    for item in fields(a):
        x, y = getattr(a, item.name), getattr(b, item.name)
        if isinstance(x, Film):
            assert_same(x, y, f"{what}.{item.name}")
        elif isinstance(x, np.ndarray):
            np.testing.assert_array_equal(x, y, err_msg=f"{what}.{item.name}")
        else:
            assert x == y, f"{what}.{item.name}"


def test_every_model_of_the_tracer_is_read_back_as_it_was_written(tmp_path):
    assert {m.model for m in MATERIALS.values()} == set(KEYS)
    write_simulation(tmp_path, simulation(MATERIALS))
    again = read_simulation(tmp_path).materials
    for name, material in MATERIALS.items():
        assert_same(material, again[name], name)
    compile_materials(again)  # as the tracer takes them


def test_the_keys_of_the_models_are_those_of_the_format():
    known = {key for keys in KEYS.values() for key in keys}
    assert known == set(MaterialJson.__struct_fields__) - {"model", "free"}
    assert set(KEYS) == set(msgspec.inspect.type_info(MaterialJson).fields[0].type.values)  # type: ignore[attr-defined]


def test_suns_with_an_extent_and_painted_skies_are_read_back(tmp_path):
    sky = RNG.random((4, 8, 3)).astype(np.float32)
    sun = DirectionalLight((0.0, 0.6, -0.8), (1.0, 2.0, 3.0), 0.05)
    write_simulation(tmp_path, simulation({"m": Material()}, sun=sun, sky=EnvironmentLight(panorama=sky)))
    lights = read_simulation(tmp_path).lights
    assert lights["sun"] == sun
    assert isinstance(lights["sky"], EnvironmentLight)
    np.testing.assert_array_equal(lights["sky"].panorama, sky)


def read(folder, entry, name="m"):
    write_ply(folder / "t.ply", TRIANGLE)
    shape = {"name": "t", "mesh": "t.ply", "material": name}
    (folder / "simulation.json").write_text(json.dumps({"format": "simulation/1", "shapes": [shape], "materials": {name: entry}}))
    return read_simulation(folder).materials[name]


def test_bytes_are_srgb_for_colours_and_shares_for_all_else(tmp_path):
    half = np.full((2, 2, 3), 128 / 255, np.float32)
    write_image(tmp_path / "t.png", half, Encoding(".png", "uint8", 3, "linear"))
    m = read(tmp_path, {"model": "lambert", "albedo_texture": "t.png", "normal_texture": "t.png"})
    np.testing.assert_allclose(m.normal_texture, 128 / 255, rtol=1e-6)
    np.testing.assert_allclose(m.albedo_texture, ((128 / 255 + 0.055) / 1.055) ** 2.4, rtol=1e-5)


def test_a_metal_is_named_or_measured_and_smooth_unless_it_has_a_width(tmp_path):
    silver = read(tmp_path, {"model": "conductor", "metal": "silver"})
    assert silver.metal == METALS["silver"] and silver.alpha == 0


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"model": "velvet"}, "materials.* must be a word that the format knows, got 'velvet'"),
        (
            {"model": "lambert", "sigma": 0.3},
            "sigma must be left out of lambert, got 0.3. It belongs to oren_nayar.",
        ),
        (
            {"model": "mirror", "alpha": 0.3},
            r"m\.alpha must be left out of mirror.*It belongs to ggx, cook_torrance",
        ),
        (
            {"model": "dielectric", "film": {"coverage": 1}},
            "film must be left out of dielectric. It belongs to lambert, ggx",
        ),
        ({"model": "lambert", "interior": {"sigma_t": 1}}, "interior must be left out of lambert"),
        ({"model": "phong", "alpha_u": 0.1, "alpha_v": 0.2}, "alpha_u must be left out of phong"),
        ({"model": "ward"}, r"materials\.m\.alpha must be given"),
        ({"model": "conductor"}, r"materials\.m\.metal must be given. Name one of aluminium"),
        ({"model": "conductor", "metal": "lead"}, "metal must be one of aluminium, copper, gold, silver, or eta and k, got lead"),
        ({"model": "conductor", "metal": {"eta": [0, 1, 1], "k": [1, 1, 1]}}, r"metal\.eta must lie in \(0, inf\)"),
        ({"model": "disney", "principled": {"metallic": 2}}, r"principled\.metallic must lie in \[0, 1\], got 2"),
        ({"model": "disney", "principled": {"shiny": 1}}, r"principled\.shiny must be a known key"),
        ({"model": "emission"}, r"materials\.m\.emission must be given"),
        ({"model": "oren_nayar", "sigma": 2}, r"sigma must lie in \[0, 1\.5708\]"),
        ({"model": "lambert", "film": {"coverage": 2}}, r"film\.coverage must lie in \[0, 1\], got 2"),
        ({"model": "lambert", "film": {"coverage": "none.exr"}}, r"film\.coverage must name a file that exists"),
        ({"model": "dielectric", "interior": {"sigma_t": 1, "g": 1}}, r"interior\.g must lie in \(-1, 1\)"),
        ({"model": "ggx", "alpha": 0.1, "alpha_texture": "t.exr"}, "alpha must be left out beside alpha_texture"),
        ({"model": "mirror", "free": ["alpha"]}, r"free must name one of albedo_scale, got alpha"),
        ({"model": "dielectric", "free": ["albedo_scale"]}, r"free must name one of eta, got albedo_scale"),
    ],
)
def test_what_means_nothing_to_a_model_is_refused(tmp_path, entry, words):
    write_exr(tmp_path / "t.exr", {"Y": GREY})
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, entry)
    assert str(caught.value).startswith(str(tmp_path / "simulation.json"))


def test_an_interior_that_the_format_cannot_say_is_refused(tmp_path):
    for bad in (Medium(1.0, scale_height=2.0), Medium(1.0, droplet_diameter_um=20.0)):
        milk = replace(MATERIALS["milk"], interior=bad)
        with pytest.raises(InputError, match=r"materials\.m\.interior must be even and have a g"):
            write_simulation(tmp_path, simulation({"m": milk}))


def test_a_sky_without_radiance_is_refused(tmp_path):
    read(tmp_path, {"model": "lambert"})
    data = json.loads((tmp_path / "simulation.json").read_text()) | {"lights": {"sky": {"type": "environment"}}}
    (tmp_path / "simulation.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"lights\.sky must have either `radiance` or `panorama`"):
        read_simulation(tmp_path)
