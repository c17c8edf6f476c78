"""A frame's picture projected onto the reconstructed world, compiled for the kernels (thesis 6.4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.images import Encoding, decode, read_ids, read_raw
from scene.mesh import Mesh
from scene.recording import Frame
from scene.scene_file import Cardboard, Scene
from scene.simulation import Material, Shape, Simulation

from .kernels import projected as kernel
from .kernels.wet import first_seen
from .world import World, compile_camera, compile_world

# How far a vehicle reaches behind its cardboard [m]: seen from the side it shows its length and hides its width, seen
# from the end the other way round. Passenger cars are 1.8 m wide and 4.3 m long; 3 m tells the views apart.
_VEHICLE_WIDTH, _VEHICLE_LENGTH, _SIDE_VIEW = 1.8, 4.3, 3.0
_PEDESTRIAN_DEPTH = 0.4
_CLEARANCE = 0.2
# Radiance of what no camera sees, relative to the mean of its class: backs stand in other light, undersides in shade.
_BACK, _BELOW = 0.5, 0.1


@dataclass(frozen=True)
class ProjectedFrame:
    """A frame in its world.

    Attributes
    ----------
    raw : (H, W) or (H, W, 3) integer or float
        The picture as stored.
    encoding : Encoding
    image : (H, W, 3) float32
        The picture, linear.
    instance : (H, W) int32
        Moving objects' ids, 0 = static.
    is_ground : (H, W) bool
        Pixels whose centre sees the static ground.
    depth : (H, W) float64
        Along the camera's z [m]; inf beyond all meshes.
    position : (H, W, 3) float64
        What each pixel's centre sees [m]; NaN beyond all meshes.
    normal : (H, W, 3) float32
        Smooth normal of the mesh there, upright half.
    shape : (H, W) int32
        Role of what is seen (`kernels.projected.GROUND` and on), -1 beyond all meshes.
    """

    frame: Frame
    raw: NDArray
    encoding: Encoding
    image: NDArray[np.float32]
    instance: NDArray[np.int32]
    is_ground: NDArray[np.bool_]
    depth: NDArray[np.float64]
    position: NDArray[np.float64]
    normal: NDArray[np.float32]
    shape: NDArray[np.int32]
    world: World
    picture: kernel.Picture
    camera: Camera


def project_frame(scene: Scene, index: int, reuse: ProjectedFrame | None = None, sky_gain: float = 1.0) -> ProjectedFrame:
    """Compile a frame: static meshes (kept from `reuse`), its cardboards with the bodies behind them, and its picture.

    `sky_gain` scales the generic sky, where no frame saw it (see `augment.estimate_sky_gain`).

    Raises
    ------
    InputError
        If the image or the mask has another size than the camera, or cannot be read.
    """
    frame = scene.recording.frames[index]
    camera = frame.camera
    raw, image, encoding = _picture(frame)
    instance = _mask(frame)
    boards = scene.cardboards[index]
    bodies, roles = _bodies(scene, boards, camera)
    world = compile_world(bodies, None if reuse is None else reuse.world)
    picture = _empty_picture(scene, index, world, roles, image, instance, sky_gain)
    size = (camera.height, camera.width)
    face, b1, b2, depth = np.zeros(size, np.int64), np.zeros(size), np.zeros(size), np.zeros(size)
    first_seen(world.arrays, picture, compile_camera(camera), face, b1, b2, depth)
    seen = face >= 0
    corners = world.arrays.faces[np.where(seen, face, 0)]
    weights = np.stack([1 - b1 - b2, b1, b2], axis=-1)
    position = np.einsum("hwk,hwkc->hwc", weights, world.arrays.vertices[corners].astype(np.float64))
    normal = np.einsum("hwk,hwkc->hwc", weights, world.arrays.normals[corners].astype(np.float64))
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    normal *= np.where(normal[..., 2:] < 0, -1, 1)
    role = np.where(seen, picture.role[world.arrays.face_shape[np.where(seen, face, 0)]], -1).astype(np.int32)
    finite = np.where(np.isfinite(depth), depth, 1e30)
    # Depths around a pixel bound what it may show: on ground seen at a low angle, one row spans a metre.
    near = minimum_filter(finite, size=3, mode="nearest")
    far = np.where(np.isfinite(depth), maximum_filter(np.where(np.isfinite(depth), depth, -1.0), size=3, mode="nearest"), np.inf)
    picture = picture._replace(texels=kernel.pack(image, near, far, instance))
    return ProjectedFrame(
        frame=frame,
        raw=raw,
        encoding=encoding,
        image=image,
        instance=instance,
        is_ground=(role == kernel.GROUND) & (instance == 0),
        depth=depth,
        position=np.where(seen[..., None], position, np.nan),
        normal=normal.astype(np.float32),
        shape=role,
        world=world,
        picture=picture,
        camera=camera,
    )


def _picture(frame: Frame) -> tuple[NDArray, NDArray[np.float32], Encoding]:
    raw = read_raw(frame.image)
    size = (frame.camera.height, frame.camera.width)
    if raw.shape[:2] != size:
        got = f"{raw.shape[1]} x {raw.shape[0]}"
        raise InputError(f"have its camera's size {size[1]} x {size[0]}", got=got, file=frame.image, remedy="Mend image or camera.")
    default = "linear" if raw.dtype.kind == "f" else "srgb"
    encoding = Encoding(frame.image.suffix.lower(), str(raw.dtype), 1 if raw.ndim == 2 else 3, frame.response or default)
    linear = decode(raw, encoding.response)
    if not np.all(np.isfinite(linear)):
        raise InputError("be finite", got=f"{int((~np.isfinite(linear)).sum())} NaN or infinite values", file=frame.image)
    return raw, np.repeat(linear[..., None], 3, axis=2) if linear.ndim == 2 else linear, encoding


def _mask(frame: Frame) -> NDArray[np.int32]:
    size = (frame.camera.height, frame.camera.width)
    if frame.masks is None:
        return np.zeros(size, np.int32)
    mask = read_ids(frame.masks.file)
    if mask.shape != size:
        got = " x ".join(str(n) for n in mask.shape[::-1])
        raise InputError(f"have the image's size {size[1]} x {size[0]}", got=got, file=frame.masks.file)
    return mask.astype(np.int32)


def _bodies(scene: Scene, boards: tuple[Cardboard, ...], camera: Camera) -> tuple[Simulation, list[int]]:
    """Return the shapes of a frame and their roles; static ones come first and are the same objects in all frames."""
    shapes, roles = [Shape("ground", scene.ground, "any")], [kernel.GROUND]
    if scene.environment.num_faces:
        shapes.append(Shape("environment", scene.environment, "any"))
        roles.append(kernel.ENVIRONMENT)
    for board in boards:
        for role, mesh in zip((kernel.CARDBOARD, kernel.HULL, kernel.UNDERSIDE), body_meshes(board, camera.position), strict=True):
            shapes.append(Shape(f"{board.kind} {board.instance}", mesh, "any", board.instance, board.kind))
            roles.append(role)
    return Simulation(tuple(shapes), {"any": Material()}), roles


def body_meshes(board: Cardboard, eye: NDArray[np.float64]) -> tuple[Mesh, Mesh, Mesh]:
    """Return the cardboard, the hull behind it as seen from `eye`, and the underside that shades the ground below.

    The thesis's cardboards are planes: ground behind the plane saw the sky and lit up under cars. A body of the class's
    usual depth blocks it; the mask cuts the hull to the object's outline as the camera sees it.
    """
    bl, br, tr, tl = board.corners_world
    is_vehicle = board.kind == "vehicle"
    _, depth, away = _ground_plan(board, eye)
    back, lift = away * depth, np.array([0.0, 0.0, _CLEARANCE if is_vehicle else 0.0])
    low = (bl + lift, br + lift, br + lift + back, bl + lift + back)
    high = (tl, tr, tr + back, tl + back)
    sides = [(low[k], low[k + 1 - 4 * (k == 3)], high[k + 1 - 4 * (k == 3)], high[k]) for k in (1, 2, 3)]
    return _quads([(bl, br, tr, tl)]), _quads([*sides, high]), _quads([low])


def vehicle_footprint(board: Cardboard, eye: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return middle (2,) and length, width and height (3,) of the vehicle whose side or end a cardboard shows [m]."""
    bl, br, tr, _ = board.corners_world
    width, depth, away = _ground_plan(board, eye)
    middle = 0.5 * (bl + br) + 0.5 * depth * away
    return middle[:2], np.array([max(width, depth), min(width, depth), tr[2] - br[2]])


def _ground_plan(board: Cardboard, eye: NDArray[np.float64]) -> tuple[float, float, NDArray[np.float64]]:
    """Return a cardboard's width, the depth of what is behind it, and the level unit vector (3,) that way from `eye`."""
    bl, br = board.corners_world[:2]
    across = br - bl
    width = float(np.linalg.norm(across))
    away = np.cross(across / max(width, 1e-9), (0.0, 0.0, 1.0))
    away *= -np.sign(np.dot(away, eye - bl)) or 1.0
    if board.kind != "vehicle":
        return width, _PEDESTRIAN_DEPTH, away
    return width, _VEHICLE_WIDTH if width > _SIDE_VIEW else _VEHICLE_LENGTH, away


def _quads(corners: list[tuple[NDArray, ...]]) -> Mesh:
    vertices = np.concatenate([np.stack(c) for c in corners]).astype(np.float32)
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]], np.uint32) + np.uint32(4 * i) for i in range(len(corners))])
    return Mesh(vertices, faces).with_smooth_normals()


def _empty_picture(
    scene: Scene,
    index: int,
    world: World,
    roles: list[int],
    image: NDArray[np.float32],
    instance: NDArray[np.int32],
    sky_gain: float,
) -> kernel.Picture:
    """Return the picture before it is known what its pixels see; all that other frames saw is put into its exposure."""
    camera, gain = scene.recording.frames[index].camera, scene.gain(index)
    # Class means are taken over all frames at their own exposures.
    mean_gain = gain / (sum(scene.gains) / len(scene.gains)) if scene.gains else 1.0
    P = camera.K @ camera.T_camera_world[:3]
    means = np.zeros((len(roles), 3))
    for i, (role, shape) in enumerate(zip(roles, world.shapes, strict=True)):
        name = {kernel.GROUND: "ground", kernel.ENVIRONMENT: "environment"}.get(role, shape.kind)
        means[i] = mean_gain * scene.class_means[name] * {kernel.HULL: _BACK, kernel.UNDERSIDE: _BELOW}.get(role, 1.0)
    fill = np.zeros((len(world.arrays.vertices), 4), np.float32)
    start = 0
    for shape in world.shapes:
        columns = [shape.mesh.attributes.get(f"fill_{c}") for c in "rgbw"]
        if all(c is not None for c in columns):
            fill[start : start + len(shape.mesh.vertices)] = np.stack(columns, axis=1) * (gain, gain, gain, 1)  # type: ignore[arg-type]
        start += len(shape.mesh.vertices)
    instances = np.array([s.instance for s in world.shapes], np.int32)
    # Without moving things the box is empty: its low corner lies above its high one.
    moving = world.arrays.vertices[np.unique(world.arrays.faces[world.arrays.num_static_faces :])].astype(np.float64)
    box = np.stack([moving.min(axis=0), moving.max(axis=0)]) if len(moving) else np.array([[np.inf], [-np.inf]]).repeat(3, 1)
    seen = scene.sky.panorama[..., 3:]
    sky = np.ascontiguousarray(scene.sky.panorama[..., :3] * (seen + (1 - seen) * np.float32(sky_gain)) * np.float32(gain))
    return kernel.Picture(
        texels=kernel.pack(image, np.inf, np.inf, instance),
        num_ground_faces=scene.ground.num_faces,
        moving_box=box,
        P=P,
        role=np.array(roles, np.int64),
        shape_instance=instances,
        mean=means,
        fill=fill,
        sky=sky,
    )
