"""simulation/1: what was believed about a recording, on disk (docs/formats.md)."""

from __future__ import annotations

import math
from pathlib import Path, PurePosixPath

import msgspec
import numpy as np

from materials.foundation.checks import check_finite, check_range
from materials.foundation.errors import InputError
from materials.foundation.files import write_json
from materials.foundation.typed_json import read_typed_json

from .images import write_exr
from .mesh import read_ply, write_ply
from .simulation import (
    RGB,
    AddedEffect,
    DirectionalLight,
    EnvironmentLight,
    Lens,
    Light,
    Medium,
    PointLight,
    RectangleLight,
    Sensor,
    Shape,
    Simulation,
    SphereLight,
    Transport,
)
from .simulation_json import (
    DirectionalJson,
    EffectJson,
    EnvironmentJson,
    LensJson,
    LightJson,
    MaterialJson,
    MediumJson,
    PointJson,
    RectangleJson,
    SensorJson,
    ShapeJson,
    SimulationJson,
    SphereJson,
    TransportJson,
)
from .simulation_materials import material_json, material_of
from .simulation_textures import TextureReader, TextureWriter, below


def read_simulation(path: str | Path) -> Simulation:
    """Read a simulation/1 file, or the `simulation.json` of a folder, with the meshes and textures that it names.

    Raises
    ------
    InputError
        If the file is no JSON, a key is unknown, missing, of the wrong kind or of another model, a number is out of its range,
        a shape names a material that is not there, a name comes twice, `free` names no parameter of its model, a path leaves
        the folder or does not exist, or a mesh or texture cannot be used. Names file and key.
    """
    path = Path(path)
    path = path / "simulation.json" if path.is_dir() else path
    data = read_typed_json(path, SimulationJson)
    textures = TextureReader(path.parent)
    try:
        if not data.shapes:
            raise InputError("hold at least one shape", got="none", key="shapes")
        materials = {name: material_of(m, f"materials.{name}", textures) for name, m in data.materials.items()}
        shapes = tuple(_shape(s, f"shapes[{i}]", path.parent, data.materials) for i, s in enumerate(data.shapes))
        names = [shape.name for shape in shapes]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise InputError("be given once", got=name, key=f"shapes[{i}].name")
        lights = {name: _light(light, f"lights.{name}", textures) for name, light in data.lights.items()}
        skies = [name for name, light in lights.items() if isinstance(light, EnvironmentLight)]
        if len(skies) > 1:
            raise InputError("be the only environment", key=f"lights.{skies[1]}", remedy="Add their radiances up.")
        check_range("transport.max_bounces", data.transport.max_bounces, "[1, 1024]")
        return Simulation(
            shapes,
            materials,
            lights,
            Transport(data.transport.max_bounces, data.transport.shadows),
            None if data.medium is None else _medium(data.medium),
            _lens(data.lens),
            _sensor(data.sensor),
            tuple(_effect(e, f"effects[{i}]", textures) for i, e in enumerate(data.effects)),
        )
    except InputError as error:
        raise error.at(file=path) from error


def write_simulation(path: str | Path, simulation: Simulation) -> None:
    """Write a simulation/1 file, or `simulation.json` into a folder, with its meshes and textures beside it.

    Raises
    ------
    InputError
        If a medium has no place in the format: a density, droplets, or an interior that is not even.
    """
    path = Path(path)
    path = path / "simulation.json" if path.suffix != ".json" else path
    textures = TextureWriter(path.parent)
    shapes = []
    for shape in simulation.shapes:
        file = f"meshes/{shape.name}.ply"
        write_ply(path.parent / file, shape.mesh)
        shapes.append(ShapeJson(shape.name, shape.material, mesh=file))
    materials = {name: material_json(m, name, textures) for name, m in simulation.materials.items()}
    lights = {name: _light_json(light, name, textures) for name, light in simulation.lights.items()}
    medium, lens, sensor = simulation.medium, simulation.lens, simulation.sensor
    focus = lens.focus_distance if math.isfinite(lens.focus_distance) else None
    out = SimulationJson(
        "simulation/1",
        shapes,
        materials,
        lights,
        TransportJson(simulation.transport.max_bounces, simulation.transport.shadows),
        None if medium is None else _medium_json(medium),
        LensJson(lens.model, lens.aperture_radius, focus, lens.k1, lens.k2),
        SensorJson(sensor.response, sensor.gamma, sensor.saturation),
        [_effect_json(e, path.parent) for e in simulation.effects],
    )
    write_json(path, msgspec.to_builtins(out))


def _shape(s: ShapeJson, key: str, root: Path, materials: dict[str, MaterialJson]) -> Shape:
    if s.material not in materials:
        raise InputError(f"name one of {', '.join(materials) or 'the materials'}", got=s.material, key=f"{key}.material")
    if (s.mesh is None) == (s.normal_map is None):
        raise InputError("have either `mesh` or `normal_map`", key=key)
    if not s.name or PurePosixPath(s.name).name != s.name:
        raise InputError("be usable as the name of a file", got=repr(s.name), key=f"{key}.name")
    if s.mesh is None:
        raise InputError(
            "be a mesh in this version", got="a normal map", key=f"{key}.normal_map", remedy="Give a mesh with normals and u, v."
        )
    file = below(root, s.mesh, f"{key}.mesh")
    mesh = read_ply(file)
    if mesh.num_faces == 0:
        raise InputError("have triangles", got="points alone", file=file)
    for name, values in (("x, y, z", mesh.vertices), ("nx, ny, nz", mesh.normals), ("u, v", mesh.uv)):
        if values is not None and not np.all(np.isfinite(values)):
            raise InputError("be finite", got="NaN or infinity", file=file, key=name)
    return Shape(s.name, mesh if mesh.normals is not None else mesh.with_smooth_normals(), s.material)


def _light(light: LightJson, key: str, textures: TextureReader) -> Light:
    if isinstance(light, PointJson):
        check_finite(f"{key}.position", light.position)
        check_range(f"{key}.intensity", light.intensity, "[0, inf)")
        return PointLight(light.position, light.intensity)
    if isinstance(light, EnvironmentJson):
        return _environment(light, key, textures)
    if isinstance(light, SphereJson):
        check_finite(f"{key}.position", light.position)
        check_range(f"{key}.radius", light.radius, "(0, inf)")
        check_range(f"{key}.intensity", light.intensity, "[0, inf)")
        return SphereLight(light.position, light.radius, light.intensity)
    if isinstance(light, RectangleJson):
        for name in ("corner", "edge_u", "edge_v"):
            check_finite(f"{key}.{name}", getattr(light, name))
        check_range(f"{key}.radiance", light.radiance, "[0, inf)")
        return RectangleLight(light.corner, light.edge_u, light.edge_v, light.radiance)
    check_range(f"{key}.irradiance", light.irradiance, "[0, inf)")
    length = math.sqrt(sum(x * x for x in light.direction))
    if not 0 < length < math.inf:
        raise InputError("have a length", got=light.direction, key=f"{key}.direction")
    x, y, z = (component / length for component in light.direction)
    check_range(f"{key}.angular_radius", light.angular_radius, "[0, 1.5]")
    return DirectionalLight((x, y, z), light.irradiance, light.angular_radius)


def _environment(light: EnvironmentJson, key: str, textures: TextureReader) -> EnvironmentLight:
    if (light.radiance is None) == (light.panorama is None):
        raise InputError("have either `radiance` or `panorama`", key=key)
    if light.radiance is not None:
        check_range(f"{key}.radiance", light.radiance, "[0, inf)")
        return EnvironmentLight(light.radiance)
    panorama = textures.colour(light.panorama, f"{key}.panorama")
    assert panorama is not None
    check_range(f"{key}.panorama", panorama, "[0, inf)")
    return EnvironmentLight(panorama=panorama)


def _effect(e: EffectJson, key: str, textures: TextureReader) -> AddedEffect:
    """Read an effect; its parameter `map`, if there is one, names a picture of its own."""
    parameters = dict(e.parameters)
    if "map" in parameters:
        if not isinstance(parameters["map"], str):
            raise InputError("name a file", got=parameters["map"], key=f"{key}.parameters.map")
        parameters["map"] = textures.colour(parameters["map"], f"{key}.parameters.map")
    return AddedEffect(e.id, e.target, parameters)


def _effect_json(e: AddedEffect, root: Path) -> EffectJson:
    parameters = dict(e.parameters)
    field = parameters.get("map")
    if field is not None:
        field = np.asarray(field, np.float32)
        # An image of the field has three channels: what a map lacks is zero.
        channels = [field] if field.ndim == 2 else list(np.moveaxis(field, -1, 0))
        channels += [np.zeros_like(channels[0])] * (3 - len(channels))
        parameters["map"] = f"maps/{e.id}{'_' + e.target if e.target else ''}.exr"
        write_exr(root / parameters["map"], dict(zip("RGB", (np.ascontiguousarray(c) for c in channels), strict=True)))
    return EffectJson(e.id, e.target, parameters)


def _medium_json(m: Medium) -> MediumJson:
    if m.density is not None or m.droplet_diameter_um is not None:
        got = "a density" if m.density is not None else "a droplet diameter"
        raise InputError("have a field in simulation/1", got=got, key="medium")
    return MediumJson(m.sigma_t, m.albedo, m.g, m.bounds, m.scale_height, m.base_z)


def _medium(m: MediumJson) -> Medium:
    check_range("medium.sigma_t", m.sigma_t, "[0, inf)")
    check_range("medium.albedo", m.albedo, "[0, 1]")
    check_range("medium.g", m.g, "(-1, 1)")
    if m.bounds is not None and m.scale_height is not None:
        raise InputError("be left out beside scale_height", key="medium.bounds")
    if m.bounds is not None and not all(low < high for low, high in zip(*m.bounds, strict=True)):
        raise InputError("be the lower and the upper corner of a box", got=m.bounds, key="medium.bounds")
    if m.scale_height is not None:
        check_range("medium.scale_height", m.scale_height, "(0, inf)")
    check_finite("medium.base_z", m.base_z)
    return Medium(m.sigma_t, m.albedo, m.g, m.bounds, m.scale_height, m.base_z)


def _lens(lens: LensJson) -> Lens:
    check_range("lens.aperture_radius", lens.aperture_radius, "[0, inf)")
    if lens.model == "thin_lens" and lens.focus_distance is None:
        raise InputError("be given for a thin lens", key="lens.focus_distance")
    focus = math.inf if lens.focus_distance is None else lens.focus_distance
    check_range("lens.focus_distance", focus, "(0, inf]")
    return Lens(lens.model, lens.aperture_radius, focus, lens.k1, lens.k2)


def _sensor(sensor: SensorJson) -> Sensor:
    check_range("sensor.gamma", sensor.gamma, "(0, inf)")
    if sensor.response == "linear" and sensor.gamma != 1.0:
        raise InputError("be left out of a linear response", got=sensor.gamma, key="sensor.gamma")
    if sensor.saturation is not None:
        check_range("sensor.saturation", sensor.saturation, "(0, inf)")
    return Sensor(sensor.response, sensor.gamma, sensor.saturation)


def _light_json(light: Light, name: str, textures: TextureWriter) -> LightJson:
    if isinstance(light, PointLight):
        return PointJson(_three(light.position), _three(light.intensity))
    if isinstance(light, EnvironmentLight):
        if light.panorama is not None:
            return EnvironmentJson(panorama=textures.colour(light.panorama, f"{name}_panorama"))
        return EnvironmentJson(_three(light.radiance))
    if isinstance(light, SphereLight):
        return SphereJson(_three(light.position), float(light.radius), _three(light.intensity))
    if isinstance(light, RectangleLight):
        return RectangleJson(_three(light.corner), _three(light.edge_u), _three(light.edge_v), _three(light.radiance))
    return DirectionalJson(_three(light.direction), _three(light.irradiance), float(light.angular_radius))


def _three(values: RGB) -> RGB:
    x, y, z = values
    return (float(x), float(y), float(z))
