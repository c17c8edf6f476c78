"""A simulation as a scene of Mitsuba 3, so that a renderer that is not ours can photograph the same world.

Mitsuba is optional: nothing here imports it, the caller hands it over, set to the variant `llvm_ad_rgb`. What Mitsuba has
is used as it is: `diffuse`, `plastic`, `conductor`, `dielectric`, `normalmap`, `envmap`, the `path` integrator. Two
surfaces it does not have, and `mitsuba_surfaces` writes them down in its own terms.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.mesh import Mesh, write_ply
from scene.simulation import DirectionalLight, Film, Lens, Light, Material, PointLight, RectangleLight, Simulation, SphereLight

from .mitsuba_media import interior, medium
from .mitsuba_surfaces import FILM, GLOSS, register
from .world import compile_lights, with_rectangles

# A disc in the sky stands so far off that the street (100 m) sees it move by 1/50 of the sun's radius.
_SUN_DISTANCE = 1e6
_MODELS = ("lambert", "ggx", "coated", "mirror", "dielectric", "emission")
# Local frame of Mitsuba's panoramas (zenith y) in ours (zenith z); its columns run the other way round.
_ENVMAP_TO_WORLD = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def export(
    mitsuba: ModuleType,
    simulation: Simulation,
    camera: Camera,
    folder: str | Path,
    max_bounces: int = 8,
    lens: Lens | None = None,
) -> Any:
    """Load a simulation into Mitsuba.

    Parameters
    ----------
    mitsuba : module
        With its variant set.
    folder : path
        Where the meshes are written, as PLY.
    max_bounces : int
        Scattering events per path, as for `render`.
    lens : Lens, optional
        As for `render`.

    Returns
    -------
    scene : mitsuba.Scene

    Raises
    ------
    InputError
        If the camera is no centred pinhole with square pixels, or a material cannot be said in Mitsuba's terms: opacity
        textures, other models than those of `_MODELS` (metals among them: Mitsuba masks facets by another function), and films
        whose surface is level while the ground is not; or the medium has no bounds, or the
        lens distorts.
    """
    simulation = with_rectangles(simulation)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    register(mitsuba)
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_bounces + 1, "rr_depth": 5},
        "sensor": _sensor(mitsuba, camera) | _lens(lens),
    }
    if simulation.medium is not None:
        scene["integrator"]["type"] = "volpath"
        scene["air"], inside = medium(mitsuba, simulation.medium, camera.position)
        if inside is not None:
            scene["sensor"]["medium"] = inside
    surfaces = {name: mitsuba.load_dict(_surface(mitsuba, name, m)) for name, m in simulation.materials.items()}
    for i, shape in enumerate(simulation.shapes):
        mesh = shape.mesh if shape.mesh.normals is not None else shape.mesh.with_smooth_normals()
        path = folder / f"{i:04d}.ply"
        write_ply(path, Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.uv))
        entry: dict[str, Any] = {"type": "ply", "filename": str(path), "surface": surfaces[shape.material]}
        material = simulation.materials[shape.material]
        if material.interior is not None:
            entry["interior"] = interior(mitsuba, material.interior)
            scene["integrator"]["type"] = "volpath"
        if material.model == "emission":
            # Mitsuba's lamps shine from the front of their triangles, ours from both sides unless they are one-sided.
            entry["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(material.emission)}}
        scene[f"shape_{i}"] = entry
    for name, light in simulation.lights.items():
        lamp = _light(mitsuba, light)
        if lamp is not None:
            scene[f"light_{name}"] = lamp
    return mitsuba.load_dict(scene)


def photograph(mitsuba: ModuleType, scene: Any, samples: int, seed: int) -> NDArray[np.float32]:
    """Return the radiance (H, W, 3) that Mitsuba finds."""
    return np.array(mitsuba.render(scene, spp=samples, seed=seed), np.float32)[..., :3]


def _sensor(mitsuba: ModuleType, camera: Camera) -> dict[str, Any]:
    centred = abs(camera.cx - camera.width / 2) < 1e-6 and abs(camera.cy - camera.height / 2) < 1e-6
    if camera.model != "PINHOLE" or not centred or abs(camera.fx / camera.fy - 1) > 1e-9:
        raise InputError("be a centred pinhole with square pixels", got=camera.model, key="camera")
    # Mitsuba's cameras look along z too, but with x to the left and y up.
    to_world = camera.T_world_camera @ np.diag([-1.0, -1.0, 1.0, 1.0])
    return {
        "type": "perspective",
        "fov": float(np.degrees(2 * np.arctan(camera.width / (2 * camera.fx)))),
        "fov_axis": "x",
        "near_clip": 1e-3,
        "far_clip": 1e8,
        "to_world": mitsuba.ScalarTransform4f(to_world),
        "sampler": {"type": "independent"},
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
    }


def _lens(lens: Lens | None) -> dict[str, Any]:
    if lens is None:
        return {}
    if lens.k1 or lens.k2:
        raise InputError("have an equal in Mitsuba", got="distortion", key="lens")
    if lens.model == "pinhole" or lens.aperture_radius == 0:
        return {}
    return {"type": "thinlens", "aperture_radius": lens.aperture_radius, "focus_distance": min(lens.focus_distance, 1e7)}


def _light(mitsuba: ModuleType, light: Light) -> dict[str, Any] | None:
    if isinstance(light, PointLight):
        return {"type": "point", "position": list(light.position), "intensity": {"type": "rgb", "value": list(light.intensity)}}
    if isinstance(light, DirectionalLight):
        towards = -np.asarray(light.direction, float) / np.linalg.norm(light.direction)
        if light.angular_radius == 0:
            irradiance = {"type": "rgb", "value": list(light.irradiance)}
            return {"type": "directional", "direction": (-towards).tolist(), "irradiance": irradiance}
        facing = np.pi * np.sin(light.angular_radius) ** 2
        size = _SUN_DISTANCE * np.tan(light.angular_radius)
        t = mitsuba.ScalarTransform4f
        at = (towards * _SUN_DISTANCE).tolist()
        up = [0.0, 0.0, 1.0] if abs(towards[2]) < 0.9 else [1.0, 0.0, 0.0]
        radiance = {"type": "rgb", "value": (np.array(light.irradiance) / facing).tolist()}
        to_world = t().look_at(origin=at, target=[0.0, 0.0, 0.0], up=up) @ t().scale([size, size, 1.0])
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        return {"type": "disk", "to_world": to_world, "surface": black, "emitter": {"type": "area", "radiance": radiance}}
    if isinstance(light, SphereLight):
        radiance = {"type": "rgb", "value": (np.array(light.intensity) / (np.pi * light.radius**2)).tolist()}
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        area = {"type": "area", "radiance": radiance}
        return {"type": "sphere", "center": list(light.position), "radius": light.radius, "surface": black, "emitter": area}
    assert not isinstance(light, RectangleLight)  # a glowing shape by now
    panorama = compile_lights({"sky": light}).panorama
    if len(panorama) == 0:
        return None
    bitmap = mitsuba.Bitmap(_at_poles(panorama)[:, ::-1].copy())
    return {"type": "envmap", "bitmap": bitmap, "to_world": mitsuba.ScalarTransform4f(_ENVMAP_TO_WORLD)}


def _at_poles(panorama: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a panorama on rows that Mitsuba interpolates to the same radiance.

    Its first and last rows lie on the poles, ours half a row away: twice as many rows hit all our nodes.
    """
    height = len(panorama)
    row = np.clip(np.arange(2 * height + 1) / 2 - 0.5, 0, height - 1)
    above = row.astype(int)
    below = np.minimum(above + 1, height - 1)
    share = (row - above).astype(np.float32)[:, None, None]
    return (panorama[above] * (1 - share) + panorama[below] * share).astype(np.float32)


def _surface(mitsuba: ModuleType, name: str, m: Material) -> dict[str, Any]:
    if m.opacity_texture is not None or m.model not in _MODELS:
        what = "an opacity texture" if m.opacity_texture is not None else m.model
        raise InputError("have an equal in Mitsuba", got=what, key=f"materials.{name}")
    if m.model == "dielectric" and m.eta == 1.0 and m.interior is not None:
        return {"type": "null"}
    if m.model == "dielectric":
        return {"type": "dielectric", "int_ior": m.eta, "ext_ior": 1.0}
    if m.model == "emission":
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    surface = _base(mitsuba, m)
    if m.film is not None:
        surface = _below_film(mitsuba, name, m, m.film)
    if m.normal_texture is not None:
        # Mitsuba darkens the terminator of relief by default (Estevez et al. 2019), which simulation/1 does not.
        surface = {
            "type": "normalmap",
            "normalmap": _texture(mitsuba, m.normal_texture),
            "use_shadowing_function": False,
            "flip_invalid_normals": False,
            "surface": surface,
        }
    return {"type": "twosided", "surface": surface}


def _base(mitsuba: ModuleType, m: Material) -> dict[str, Any]:
    albedo = _colour(mitsuba, m.albedo, m.albedo_texture)
    if m.model == "mirror":
        return {"type": "conductor", "material": "none", "specular_reflectance": albedo}
    if m.model == "coated":
        if m.alpha_texture is not None:
            raise InputError("have an equal in Mitsuba", got="a rough coat", key="material")
        return {"type": "plastic", "diffuse_reflectance": albedo, "int_ior": m.eta, "ext_ior": 1.0, "nonlinear": True}
    if m.model == "ggx":
        alpha = _number(mitsuba, m.alpha if m.alpha_texture is None else m.alpha_texture)
        return {"type": GLOSS, "albedo": albedo, "alpha": alpha, "eta": m.eta, "specular_scale": m.specular_scale}
    if m.model != "lambert":
        raise InputError("have an equal in Mitsuba", got=m.model, key="material")
    return {"type": "diffuse", "reflectance": albedo}


def _below_film(mitsuba: ModuleType, name: str, m: Material, film: Film) -> dict[str, Any]:
    if film.level or film.alpha > 0 or m.model == "coated":
        got = "a level or rough film" if film.level or film.alpha > 0 else "a film on a coat"
        raise InputError("have an equal in Mitsuba", got=got, key=f"materials.{name}.film")
    return {
        "type": FILM,
        "albedo": _colour(mitsuba, m.albedo, m.albedo_texture),
        "alpha": _number(mitsuba, m.alpha if m.alpha_texture is None else m.alpha_texture),
        "coverage": _number(mitsuba, film.coverage),
        "thickness": _number(mitsuba, film.thickness),
        "thickest": float(np.max(film.thickness)),
        "eta": m.eta,
        "specular_scale": m.specular_scale if m.model == "ggx" else 0.0,
        "film_eta": film.eta,
        "sigma_a_r": film.sigma_a[0],
        "sigma_a_g": film.sigma_a[1],
        "sigma_a_b": film.sigma_a[2],
    }


def _colour(mitsuba: ModuleType, value: Any, texture: NDArray | None) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)} if texture is None else _texture(mitsuba, texture)


def _number(mitsuba: ModuleType, value: Any) -> dict[str, Any]:
    return _texture(mitsuba, value) if isinstance(value, np.ndarray) else {"type": "uniform", "value": float(value)}


def _texture(mitsuba: ModuleType, texture: NDArray) -> dict[str, Any]:
    # Raw: linear values, not to be decoded again. Its rows count from the top and its texels have our centres.
    image = texture[..., None] if texture.ndim == 2 else texture
    bitmap = mitsuba.Bitmap(np.ascontiguousarray(image, np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "repeat"}
