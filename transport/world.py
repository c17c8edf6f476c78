"""A world ready for rays: meshes, materials and lights gathered into the arrays of the kernels, and Embree's trees.

What stands still is compiled once; what moves is compiled per frame and joined to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.kernels.tabulated import TableArrays
from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import Light, Material, RectangleLight, Shape, Simulation

from .embree import EmbreeScene
from .kernels import arrays as a
from .light_table import compile_lights, sphere_table
from .material_table import compile_materials, compile_measured
from .media import BodyArrays, MediumArrays, compile_bodies, compile_medium

__all__ = ["World", "compile_camera", "compile_lights", "compile_world", "with_lights", "with_rectangles"]


@dataclass(frozen=True)
class World:
    """A compiled simulation.

    Attributes
    ----------
    arrays, lights
        What the kernels take.
    shapes : tuple of Shape
        In the order of `arrays.face_shape`.
    scenes : tuple of EmbreeScene
        Kept alive as long as the world: the kernels hold bare handles.
    medium : MediumArrays or None
        What fills the space.
    bodies : BodyArrays or None
        What fills bodies of glass.
    tables : TableArrays or None
        Measured and fitted materials.
    """

    arrays: a.WorldArrays
    lights: a.LightArrays
    shapes: tuple[Shape, ...]
    scenes: tuple[EmbreeScene, ...]
    medium: MediumArrays | None = None
    bodies: BodyArrays | None = None
    tables: TableArrays | None = None


def compile_world(simulation: Simulation, reuse: World | None = None) -> World:
    """Compile a simulation for the tracer.

    Parameters
    ----------
    simulation : Simulation
        Shapes with `instance` 0 are static, all others move.
    reuse : World, optional
        An earlier frame of the same drive: if its static meshes are the same objects, their tree is kept.

    Raises
    ------
    InputError
        If a shape names an unknown material, has no triangles, or a value is not finite.
    """
    simulation = with_rectangles(simulation)
    static = [s for s in simulation.shapes if s.instance == 0]
    moving = [s for s in simulation.shapes if s.instance != 0]
    if not static:
        static, moving = moving, []
    if not static:
        raise InputError("hold at least one shape", key="simulation.shapes")
    shapes = (*static, *moving)
    for shape in shapes:
        if shape.material not in simulation.materials:
            raise InputError(
                f"name one of {', '.join(simulation.materials)}", got=shape.material, key=f"material of shape {shape.name}"
            )
        if shape.mesh.num_faces == 0:
            raise InputError("have triangles", key=f"mesh of shape {shape.name}")
        _check_mesh(shape)
    vertices, faces, normals, uv, face_shape = _geometry(shapes)
    num_static = sum(s.mesh.num_faces for s in static)
    # A tree with more in it than is static now would report faces that this world does not have.
    kept = reuse is not None and reuse.arrays.num_static_faces == num_static and len(reuse.shapes) >= len(static)
    kept = kept and all(old.mesh is new.mesh for old, new in zip(reuse.shapes, static, strict=False))  # type: ignore[union-attr]
    tree = reuse.scenes[0] if kept and reuse is not None else EmbreeScene(vertices, faces[:num_static], 0)
    # Embree keeps vertices of its own: those of what moves, thousands of times fewer than all.
    first = sum(len(s.mesh.vertices) for s in static)
    moving_tree = EmbreeScene(vertices[first:], faces[num_static:] - np.uint32(first), 1) if moving else None
    scenes = (tree,) if moving_tree is None else (tree, moving_tree)
    names = list(simulation.materials)
    kind_of, values, slots, texels, info = compile_materials(simulation.materials)
    arrays = a.WorldArrays(
        static_scene=tree.handle,
        dynamic_scene=0 if moving_tree is None else moving_tree.handle,
        num_static_faces=num_static,
        has_cutouts=bool(np.any(slots[:, a.OPACITY_TEXTURE] >= 0)),
        vertices=vertices,
        faces=faces,
        normals=normals,
        uv=uv,
        face_shape=face_shape,
        shape_material=np.array([names.index(s.material) for s in shapes], np.int32),
        material_kind=kind_of,
        material_values=values,
        material_textures=slots,
        texels=texels,
        texture_info=info,
        spheres=np.zeros((0, 4)),
    )
    lights = compile_lights(simulation.lights, arrays)
    medium = None if simulation.medium is None else compile_medium(simulation.medium)
    arrays = arrays._replace(spheres=sphere_table(lights))
    bodies, tables = compile_bodies(simulation.materials), compile_measured(simulation.materials)
    return World(arrays, lights, shapes, scenes, medium, bodies, tables)


def with_lights(world: World, lights: dict[str, Light]) -> World:
    """Return the same geometry under other lights; what glows in the geometry, rectangles among it, goes on glowing.

    Raises
    ------
    InputError
        If there is a rectangle among the lights, which would be new geometry; else as `compile_lights`.
    """
    for name, light in lights.items():
        if isinstance(light, RectangleLight):
            raise InputError("be in the simulation when it is compiled", got="a rectangle", key=f"lights.{name}")
    compiled = compile_lights(lights, world.arrays)
    return replace(world, arrays=world.arrays._replace(spheres=sphere_table(compiled)), lights=compiled)


def with_rectangles(simulation: Simulation) -> Simulation:
    """Return the simulation with a glowing shape in the place of each rectangle of light.

    Raises
    ------
    InputError
        If a rectangle has no area, or the name of a material.
    """
    shapes, materials, lights = list(simulation.shapes), dict(simulation.materials), {}
    for name, light in simulation.lights.items():
        if not isinstance(light, RectangleLight):
            lights[name] = light
            continue
        u, v = np.asarray(light.edge_u, np.float64), np.asarray(light.edge_v, np.float64)
        n = np.cross(u, v)
        if not np.linalg.norm(n) > 0:
            raise InputError("span an area with edge_v", got=light.edge_u, key=f"lights.{name}.edge_u")
        if name in materials:
            raise InputError("differ from the names of materials", got=name, key=f"lights.{name}")
        vertices = np.asarray(light.corner, np.float64) + np.stack([0 * u, u, u + v, v])
        normals = np.tile(n / np.linalg.norm(n), (4, 1)).astype(np.float32)
        mesh = Mesh(vertices.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32), normals)
        materials[name] = Material("emission", emission=light.radiance, one_sided=True)
        shapes.append(Shape(name, mesh, name))
    return replace(simulation, shapes=tuple(shapes), materials=materials, lights=lights)


def compile_camera(camera: Camera) -> a.CameraArrays:
    """Turn a camera into the affine form of the kernels.

    Raises
    ------
    InputError
        If its lens distorts: the rays of this tracer are those of a pinhole or of parallel projection.
    """
    if camera.model == "OPENCV" and any((camera.k1, camera.k2, camera.p1, camera.p2)):
        raise InputError(
            "be PINHOLE or ORTHOGRAPHIC", got="OPENCV with distortion", key="camera", remedy="Undistort the images first."
        )
    R = camera.T_world_camera[:3, :3]
    origin = camera.position.copy()
    if camera.model == "ORTHOGRAPHIC":
        assert camera.pixel_size is not None
        step_x, step_y = R[:, 0] * camera.pixel_size, R[:, 1] * camera.pixel_size
        corner = origin - camera.cx * step_x - camera.cy * step_y
    else:
        step_x, step_y = R[:, 0] / camera.fx, R[:, 1] / camera.fy
        corner = R[:, 2] - camera.cx * step_x - camera.cy * step_y
    kind = camera.model == "ORTHOGRAPHIC"
    return a.CameraArrays(camera.width, camera.height, kind, origin, corner, step_x.copy(), step_y.copy(), R[:, 2].copy())


def _check_mesh(shape: Shape) -> None:
    mesh = shape.mesh
    for name, values in (("vertices", mesh.vertices), ("normals", mesh.normals), ("uv", mesh.uv)):
        if values is not None and not np.all(np.isfinite(values)):
            raise InputError("be finite", got="NaN or infinity", key=f"{name} of shape {shape.name}")
        if values is not None and len(values) != len(mesh.vertices):
            raise InputError(f"have a row per vertex, {len(mesh.vertices)}", got=len(values), key=f"{name} of shape {shape.name}")
    # The kernels trust indices: one out of range would read other memory.
    if mesh.faces.max() >= len(mesh.vertices):
        raise InputError(f"lie below {len(mesh.vertices)}", got=mesh.faces.max(), key=f"vertex indices of shape {shape.name}")


def _geometry(shapes: tuple[Shape, ...]) -> tuple[NDArray, ...]:
    meshes = [_completed(s.mesh) for s in shapes]
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    return (
        np.concatenate([m.vertices for m in meshes]).astype(np.float32),
        np.concatenate([m.faces + np.uint32(o) for m, o in zip(meshes, offsets, strict=True)]).astype(np.uint32),
        np.concatenate([m.normals for m in meshes]).astype(np.float32),  # type: ignore[misc]
        np.concatenate([m.uv for m in meshes]).astype(np.float32),  # type: ignore[misc]
        np.repeat(np.arange(len(shapes), dtype=np.int32), [m.num_faces for m in meshes]),
    )


def _completed(mesh: Mesh) -> Mesh:
    mesh = mesh if mesh.normals is not None else mesh.with_smooth_normals()
    return mesh if mesh.uv is not None else replace(mesh, uv=np.zeros((len(mesh.vertices), 2), np.float32))
