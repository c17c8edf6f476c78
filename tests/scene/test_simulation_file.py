from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.images import write_exr
from scene.mesh import Mesh, write_ply
from scene.simulation import (
    AddedEffect,
    DirectionalLight,
    EnvironmentLight,
    Lens,
    Material,
    Medium,
    PointLight,
    Sensor,
    Shape,
    Simulation,
    Transport,
)
from scene.simulation_file import read_simulation, write_simulation
from transport.world import compile_world

SQUARE = Mesh(
    np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
    np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
)
FULL: dict[str, Any] = {
    "format": "simulation/1",
    "shapes": [{"name": "plate", "mesh": "meshes/plate.ply", "material": "plate"}],
    "materials": {
        "plate": {"model": "lambert", "albedo_texture": "t.exr", "albedo_scale": 0.9, "free": ["albedo_scale"]},
        "gloss": {"model": "ggx", "albedo": [0.2, 0.3, 0.4], "eta": 1.4, "alpha": 0.25, "specular_scale": 2.0, "free": ["alpha"]},
    },
    "lights": {
        "led0": {"type": "point", "position": [0, 0, 1], "intensity": [2.4, 2.4, 2.4]},
        "sun": {"type": "directional", "direction": [0, 3, -4], "irradiance": [2, 2, 2]},
        "sky": {"type": "environment", "radiance": [0.3, 0.3, 0.4]},
    },
    "transport": {"max_bounces": 1},
    "medium": None,
    "lens": {"model": "pinhole"},
    "sensor": {"response": "linear"},
    "effects": [],
}


@pytest.fixture
def folder(tmp_path) -> Path:
    write_ply(tmp_path / "meshes" / "plate.ply", SQUARE)
    texture = np.linspace(0, 1, 12, dtype=np.float32).reshape(2, 2, 3)
    write_exr(tmp_path / "t.exr", dict(zip("RGB", np.moveaxis(texture, -1, 0), strict=True)))
    return tmp_path


def read(folder: Path, **changes: Any) -> Simulation:
    (folder / "simulation.json").write_text(json.dumps(FULL | changes))
    return read_simulation(folder)


def test_a_simulation_is_read_with_its_meshes_and_textures(folder):
    simulation = read(folder)
    assert simulation.shapes[0].mesh.num_faces == 2
    plate = simulation.materials["plate"]
    assert plate.free == ("albedo_scale",)
    assert plate.albedo_texture is not None and plate.albedo_texture.shape == (2, 2, 3)
    assert simulation.materials["gloss"].alpha == 0.25
    # The reader normalises directions, as section 4 of the format promises.
    assert simulation.lights["sun"] == DirectionalLight((0.0, 0.6, -0.8), (2, 2, 2))
    assert simulation.transport == Transport(1, True)


def test_the_albedo_of_the_tracer_is_texture_times_scale(folder):
    world = compile_world(read(folder))
    assert world.arrays.material_values[0, :3] == pytest.approx([0.9] * 3)
    assert world.arrays.material_values[1, :3] == pytest.approx([0.2, 0.3, 0.4])


def test_what_is_written_is_read_back_the_same(tmp_path):
    simulation = Simulation(
        (Shape("plate", SQUARE, "m"),),
        {"m": Material("ggx", (0.1, 0.2, 0.3), alpha=0.2, alpha_u=0.1, alpha_v=0.4, eta=1.33, free=("alpha_u",))},
        {"a": PointLight((0, 0, 1), (1, 2, 3)), "sky": EnvironmentLight((0.1, 0.2, 0.3))},
        Transport(4, False),
        Medium(0.05, (0.8, 0.8, 0.9), 0.6, ((-1, -1, -1), (1, 1, 1))),
        Lens("thin_lens", 0.003, 2.0, k1=-0.1),
        Sensor("gamma", 2.2, 0.9),
        (AddedEffect("glare", None, {"strength": 0.06}),),
    )
    write_simulation(tmp_path, simulation)
    again = read_simulation(tmp_path)
    assert (again.shapes[0].mesh.vertices == SQUARE.vertices).all()
    for name in ("materials", "lights", "transport", "medium", "lens", "sensor", "effects"):
        assert getattr(again, name) == getattr(simulation, name), name


def changed(path: str, value: Any) -> dict[str, Any]:
    """Return the example with one value changed, the path's parts divided by slashes."""
    data = json.loads(json.dumps(FULL))
    *way, last = path.split("/")
    place: Any = data
    for part in way:
        place = place[int(part)] if isinstance(place, list) else place[part]
    place[last] = value
    return data


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("colour", 1, "colour must be a known key"),
        ("materials/plate/albedo_scale", -1, r"materials\.plate\.albedo_scale must lie in \[0, inf\), got -1"),
        ("materials/plate/alpha", 0.3, r"materials\.plate\.alpha must be left out of lambert"),
        ("materials/plate/free", ["alpha"], r"materials\.plate\.free must name one of albedo_scale, got alpha"),
        ("materials/gloss/alpha", None, r"materials\.gloss\.alpha must be given"),
        ("materials/gloss/alpha_u", 0.1, r"alpha_v must be given together"),
        ("shapes/0/material", "wood", r"shapes\[0\]\.material must name one of plate, gloss, got wood"),
        ("shapes/0/mesh", "../plate.ply", r"shapes\[0\]\.mesh must be a path below"),
        ("shapes/0/mesh", "meshes/none.ply", r"shapes\[0\]\.mesh must name a file that exists"),
        ("lights/sun/direction", [0, 0, 0], r"lights\.sun\.direction must have a length"),
        ("lights/led0/type", "laser", r"lights"),
        ("lights/led0/intensity", [-1, 0, 0], r"lights\.led0\.intensity must lie in \[0, inf\)"),
        ("medium", {"sigma_t": 0.1, "bounds": [[0, 0, 0], [1, 0, 1]]}, "medium.bounds must be the lower and the upper corner"),
        ("medium", {"sigma_t": 0.1, "g": 1.0}, r"medium\.g must lie in \(-1, 1\), got 1"),
        ("transport/max_bounces", 0, r"transport\.max_bounces must lie in \[1, 1024\]"),
        ("lens/model", "thin_lens", r"lens\.focus_distance must be given"),
        ("sensor/gamma", 2.2, r"sensor\.gamma must be left out"),
    ],
)
def test_what_the_format_does_not_have_is_refused(folder, path, value, words):
    (folder / "simulation.json").write_text(json.dumps(changed(path, value)))
    with pytest.raises(InputError, match=words) as caught:
        read_simulation(folder)
    assert str(caught.value).startswith(str(folder / "simulation.json"))


def test_a_mesh_of_points_and_a_texture_with_nan_are_refused(folder):
    write_ply(folder / "meshes" / "plate.ply", Mesh(SQUARE.vertices, np.zeros((0, 3), np.uint32)))
    with pytest.raises(InputError, match=r"plate\.ply: it must have triangles"):
        read(folder)
    write_ply(folder / "meshes" / "plate.ply", SQUARE)
    write_exr(folder / "t.exr", {"Y": np.full((2, 2), np.nan, np.float32)})
    with pytest.raises(InputError, match=r"t\.exr: materials\.plate\.albedo_texture must be finite"):
        read(folder)


def test_the_practice_simulations_are_read(shared_data):
    folders = sorted((shared_data / "sealed-practice").glob("*/simulation.json"))
    if not folders:
        pytest.skip("the sealed practice recordings are not here")
    for file in folders:
        simulation = read_simulation(file)
        assert all(m.free[0] == "albedo_scale" for m in simulation.materials.values())
