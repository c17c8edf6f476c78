"""simulation/1: what was believed about a recording, on disk (docs/formats.md)."""

from __future__ import annotations

import math
from pathlib import Path, PurePosixPath
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_finite, check_range
from materials.foundation.errors import InputError
from materials.foundation.files import write_json
from materials.foundation.typed_json import read_typed_json

from .images import read_image, write_exr
from .mesh import read_ply, write_ply
from .simulation import (
    RGB,
    AddedEffect,
    DirectionalLight,
    EnvironmentLight,
    Lens,
    Light,
    Material,
    Medium,
    PointLight,
    RectangleLight,
    Sensor,
    Shape,
    Simulation,
    SphereLight,
    Texture,
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

FREE = {"lambert": ("albedo_scale",), "ggx": ("albedo_scale", "eta", "alpha", "alpha_u", "alpha_v", "specular_scale")}
_RANGES = {
    "albedo_scale": "[0, inf)",
    "eta": "(0, inf)",
    "alpha": "[0, inf)",
    "alpha_u": "[0, inf)",
    "alpha_v": "[0, inf)",
    "specular_scale": "[0, inf)",
}
_GGX_ONLY = ("eta", "alpha", "alpha_u", "alpha_v", "specular_scale")


def read_simulation(path: str | Path) -> Simulation:
    """Read a simulation/1 file, or the `simulation.json` of a folder, with the meshes and textures that it names.

    Raises
    ------
    InputError
        If the file is no JSON, a key is unknown, missing or of the wrong kind, a number is out of its range, a shape names a
        material that is not there, a name comes twice, `free` names no parameter of its model, a path leaves the folder or
        does not exist, or a mesh or texture cannot be used. Names file and key.
    """
    path = Path(path)
    path = path / "simulation.json" if path.is_dir() else path
    data = read_typed_json(path, SimulationJson)
    textures: dict[Path, Texture] = {}
    try:
        if not data.shapes:
            raise InputError("hold at least one shape", got="none", key="shapes")
        materials = {name: _material(m, f"materials.{name}", path.parent, textures) for name, m in data.materials.items()}
        shapes = tuple(_shape(s, f"shapes[{i}]", path.parent, data.materials) for i, s in enumerate(data.shapes))
        names = [shape.name for shape in shapes]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise InputError("be given once", got=name, key=f"shapes[{i}].name")
        lights = {name: _light(light, f"lights.{name}") for name, light in data.lights.items()}
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
            tuple(_effect(e, f"effects[{i}]", path.parent, textures) for i, e in enumerate(data.effects)),
        )
    except InputError as error:
        raise error.at(file=path) from error


def write_simulation(path: str | Path, simulation: Simulation) -> None:
    """Write a simulation/1 file, or `simulation.json` into a folder, with its meshes and textures beside it.

    Raises
    ------
    InputError
        If a material or light has no place in the format (films, emission, panoramas, sun discs).
    """
    path = Path(path)
    path = path / "simulation.json" if path.suffix != ".json" else path
    textures: dict[int, str] = {}
    shapes = []
    for shape in simulation.shapes:
        file = f"meshes/{shape.name}.ply"
        write_ply(path.parent / file, shape.mesh)
        shapes.append(ShapeJson(shape.name, shape.material, mesh=file))
    materials = {name: _material_json(m, name, path.parent, textures) for name, m in simulation.materials.items()}
    lights = {name: _light_json(light, name) for name, light in simulation.lights.items()}
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


def _material(m: MaterialJson, key: str, root: Path, textures: dict[Path, Texture]) -> Material:
    for name in _GGX_ONLY:
        if m.model == "lambert" and getattr(m, name) is not None:
            raise InputError("be left out of lambert", got=getattr(m, name), key=f"{key}.{name}", remedy="Use the model ggx.")
    for name, interval in _RANGES.items():
        if getattr(m, name) is not None:
            check_range(f"{key}.{name}", getattr(m, name), interval)
    if m.albedo is not None and m.albedo_texture is not None:
        raise InputError("be left out beside albedo_texture", got=m.albedo, key=f"{key}.albedo")
    if m.albedo is not None:
        check_range(f"{key}.albedo", m.albedo, "[0, 1]")
    if (m.alpha_u is None) != (m.alpha_v is None):
        raise InputError("be given together", key=f"{key}.alpha_u and {key}.alpha_v")
    if m.model == "ggx" and m.alpha is None and m.alpha_u is None:
        raise InputError("be given", key=f"{key}.alpha")
    for name in m.free:
        if name not in FREE[m.model]:
            raise InputError(f"name one of {', '.join(FREE[m.model])}", got=name, key=f"{key}.free")
    albedo = (0.5, 0.5, 0.5) if m.albedo is None else m.albedo
    texture = _texture(m.albedo_texture, f"{key}.albedo_texture", root, textures)
    if texture is not None:
        check_range(f"{key}.albedo_texture", texture, "[0, inf)")
    alpha = (m.alpha_u * m.alpha_v) ** 0.5 if m.alpha is None and m.alpha_u is not None and m.alpha_v is not None else m.alpha
    return Material(
        model=m.model,
        albedo=albedo,
        albedo_texture=texture,
        albedo_scale=m.albedo_scale,
        eta=1.5 if m.eta is None else m.eta,
        alpha=0.3 if alpha is None else alpha,
        alpha_u=m.alpha_u,
        alpha_v=m.alpha_v,
        specular_scale=1.0 if m.specular_scale is None else m.specular_scale,
        normal_texture=_texture(m.normal_texture, f"{key}.normal_texture", root, textures),
        free=tuple(m.free),
    )


def _texture(name: str | None, key: str, root: Path, textures: dict[Path, Texture]) -> Texture | None:
    """Read a texture, the same file once."""
    if name is None:
        return None
    file = below(root, name, key)
    if file not in textures:
        image, _ = read_image(file)
        try:
            check_finite(key, image)
        except InputError as error:
            raise error.at(file=file) from error
        textures[file] = image
    return textures[file]


def _light(light: LightJson, key: str) -> Light:
    if isinstance(light, PointJson):
        check_finite(f"{key}.position", light.position)
        check_range(f"{key}.intensity", light.intensity, "[0, inf)")
        return PointLight(light.position, light.intensity)
    if isinstance(light, EnvironmentJson):
        check_range(f"{key}.radiance", light.radiance, "[0, inf)")
        return EnvironmentLight(light.radiance)
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
    return DirectionalLight((x, y, z), light.irradiance)


def _effect(e: EffectJson, key: str, root: Path, textures: dict[Path, Texture]) -> AddedEffect:
    """Read an effect; its parameter `map`, if there is one, names a picture of its own."""
    parameters = dict(e.parameters)
    if "map" in parameters:
        if not isinstance(parameters["map"], str):
            raise InputError("name a file", got=parameters["map"], key=f"{key}.parameters.map")
        parameters["map"] = _texture(parameters["map"], f"{key}.parameters.map", root, textures)
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


def below(root: Path, name: str, key: str) -> Path:
    """Resolve a path that a JSON file names.

    Raises
    ------
    InputError
        If it leaves the folder of the JSON or does not exist.
    """
    if not name or PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
        raise InputError("be a path below the folder of the JSON", got=name, key=key)
    path = root / name
    if not path.exists():
        raise InputError("name a file that exists", got=name, key=key, remedy="Check the path.")
    return path.resolve()


def _material_json(m: Material, name: str, root: Path, textures: dict[int, str]) -> MaterialJson:
    if m.model not in ("lambert", "ggx") or m.film is not None or m.alpha_texture is not None or m.opacity_texture is not None:
        raise InputError("be a lambert or ggx without film, alpha or opacity textures", got=m.model, key=f"materials.{name}")
    ggx: dict[str, Any] = {}
    if m.model == "ggx":
        ggx = {"eta": m.eta, "alpha": m.alpha, "alpha_u": m.alpha_u, "alpha_v": m.alpha_v, "specular_scale": m.specular_scale}
    return MaterialJson(
        m.model,
        albedo_texture=_texture_json(m.albedo_texture, name, root, textures),
        albedo=_three(m.albedo) if m.albedo_texture is None else None,
        albedo_scale=m.albedo_scale,
        normal_texture=_texture_json(m.normal_texture, f"{name}_normal", root, textures),
        free=list(m.free),
        **ggx,
    )


def _texture_json(texture: Texture | None, name: str, root: Path, textures: dict[int, str]) -> str | None:
    if texture is None:
        return None
    if id(texture) not in textures:
        textures[id(texture)] = f"textures/{name}.exr"
        rgb: NDArray = np.repeat(texture[..., None], 3, axis=2) if texture.ndim == 2 else texture
        write_exr(root / textures[id(texture)], dict(zip("RGB", np.moveaxis(rgb, -1, 0), strict=True)))
    return textures[id(texture)]


def _light_json(light: Light, name: str) -> LightJson:
    if isinstance(light, PointLight):
        return PointJson(_three(light.position), _three(light.intensity))
    if isinstance(light, EnvironmentLight):
        if light.panorama is not None:
            raise InputError("be a constant radiance", got="a panorama", key=f"lights.{name}")
        return EnvironmentJson(_three(light.radiance))
    if isinstance(light, SphereLight):
        return SphereJson(_three(light.position), float(light.radius), _three(light.intensity))
    if isinstance(light, RectangleLight):
        return RectangleJson(_three(light.corner), _three(light.edge_u), _three(light.edge_v), _three(light.radiance))
    if light.angular_radius > 0:
        raise InputError("be 0", got=light.angular_radius, key=f"lights.{name}.angular_radius")
    return DirectionalJson(_three(light.direction), _three(light.irradiance))


def _three(values: RGB) -> RGB:
    x, y, z = values
    return (float(x), float(y), float(z))
