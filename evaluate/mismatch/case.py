"""A recording and the simulation that was believed of it, side by side and ready to be compared."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.spatial.transform import Rotation

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from scene.camera import Camera
from scene.images import read_image
from scene.mesh import Mesh
from scene.recording import Frame, Noise, Recording, read_recording, select_frames
from scene.simulation import DirectionalLight, EnvironmentLight, Material, PointLight, Simulation, SphereLight
from scene.simulation_file import read_simulation
from transport.world import World, compile_world

from ..kernels import fragments as kernel
from .pieces import PER_PIECE, Pieces, gather

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Settled:
    """Where the pieces were gathered, if not as believed: what a model has moved is traced anew now and then.

    Attributes
    ----------
    lamps : (L, 7) float64 or None
        Lamps as in `Case.lamps`.
    twist : (F, 6) float64 or None
        Of each camera, see `warp.twist_flow`.
    moves : dict of (6,) float64
        Turn about its centre and shift of shapes, in the world.
    bend : (2,) float64 or None
        What has been added to k1 and k2 of the lens.
    """

    lamps: NDArray[np.float64] | None = None
    twist: NDArray[np.float64] | None = None
    moves: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    bend: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Case:
    """What there is to explain.

    Attributes
    ----------
    pictures : (F, H, W, 3) float32
        The recording, divided by the exposure of each frame [linear units]; 0 where `valid` is false.
    valid : (F, H, W) bool
        Pixels that were measured: finite, and not masked as moving.
    variance : (F, H, W, 3) float32
        Of the sensor's noise, as stated or estimated.
    cameras : tuple of Camera
    lamps : (L, 7) float64
        Lamps, see `kernels.fragments`; `lamp_names` in the same order.
    slots : (F, S) int64
        Rows of `lamps` lit in each frame, -1 for none.
    sky : (F,) bool
        Whether the environment is on in a frame.
    believed : tuple of Term
        What the simulation believes besides shapes, materials and lights, see `effects.given`.
    block, pose, lit : (F,) int64
        Numbers of equal (pose, lamps), of equal poses, of equal lamps: repeats share one.
    """

    recording: Recording
    simulation: Simulation
    pictures: Floats
    valid: NDArray[np.bool_]
    variance: Floats
    cameras: tuple[Camera, ...]
    lamp_names: tuple[str, ...]
    lamps: NDArray[np.float64]
    slots: NDArray[np.int64]
    sky: NDArray[np.bool_]
    block: NDArray[np.int64]
    pose: NDArray[np.int64]
    lit: NDArray[np.int64]
    noise: Noise
    noise_estimated: bool = False
    notes: tuple[str, ...] = ()
    believed: tuple = ()
    settled: Settled = field(default_factory=lambda: Settled())
    cache: dict = field(default_factory=dict, compare=False, repr=False)

    @property
    def untestable(self) -> dict[str, str]:
        """Why effects could not be tested, by id: on a recording with its simulation all can."""
        return {}

    @property
    def shared_variance(self) -> float:
        """Share of the variance that neighbouring pixels have in common: none, as noise of sensors is each pixel's own."""
        return 0.0

    @property
    def num_frames(self) -> int:
        return len(self.pictures)

    @property
    def size(self) -> tuple[int, int]:
        """(height, width)"""
        return self.pictures.shape[1], self.pictures.shape[2]

    @property
    def shape_names(self) -> tuple[str, ...]:
        return tuple(s.name for s in self.world.shapes)

    def noise_of(self, picture: Floats) -> Floats:
        """Return the variance (F, H, W, 3) that noise has on a recording of `picture`, both divided by the exposures."""
        return pixel_variance(picture, self.noise, [f.exposure for f in self.recording.frames])

    @cached_property
    def world(self) -> World:
        moves = self.settled.moves
        shapes = [replace(s, mesh=moved_mesh(s.mesh, moves[s.name])) if s.name in moves else s for s in self.simulation.shapes]
        return compile_world(replace(self.simulation, shapes=tuple(shapes)))

    @property
    def traced(self) -> bool:
        """Whether what the pixels see can be traced anew, things having been moved."""
        return True

    @property
    def gathered_lamps(self) -> NDArray[np.float64]:
        """The lamps whose visibility the pieces hold (L, 7)."""
        return self.lamps if self.settled.lamps is None else self.settled.lamps

    @property
    def gathered_cameras(self) -> tuple[Camera, ...]:
        """The cameras that the pieces were seen from."""
        cameras, twist, bend = self.cameras, self.settled.twist, self.settled.bend
        if bend is not None:
            cameras = tuple(bent(c, *bend) for c in cameras)
        if twist is not None:
            cameras = tuple(c.moved_to(c.T_world_camera @ motion(t)) for c, t in zip(cameras, twist, strict=True))
        return cameras

    @cached_property
    def pieces(self) -> Pieces:
        return gather(self.world, list(self.gathered_cameras), self.gathered_lamps, self.slots)

    @cached_property
    def environment(self) -> NDArray[np.float64]:
        """Radiance of the believed sky (3,)."""
        skies = [light for light in self.simulation.lights.values() if isinstance(light, EnvironmentLight)]
        return np.array(skies[0].radiance, np.float64) if skies else np.zeros(3)

    def material_of(self, shape: int):
        """Return the believed material of a shape."""
        return self.simulation.materials[self.world.shapes[shape].material]


def bent(camera: Camera, k1: float, k2: float) -> Camera:
    """Return a camera whose lens distorts by so much more; one of parallel projection stays as it is."""
    if camera.model == "ORTHOGRAPHIC" or (k1 == 0 and k2 == 0):
        return camera
    return replace(camera, model="OPENCV", k1=camera.k1 + float(k1), k2=camera.k2 + float(k2))


def motion(twist: NDArray) -> NDArray[np.float64]:
    """Return the rigid motion (4, 4) that turns by twist[:3] [rad] and shifts by twist[3:] [m]."""
    out = np.eye(4)
    out[:3, :3] = Rotation.from_rotvec(twist[:3]).as_matrix()
    out[:3, 3] = twist[3:]
    return out


def moved_mesh(mesh: Mesh, twist: NDArray) -> Mesh:
    """Return a mesh turned about its centre and shifted."""
    T = motion(twist)
    centre = mesh.vertices.mean(axis=0, dtype=np.float64)
    vertices = (mesh.vertices - centre) @ T[:3, :3].T + centre + T[:3, 3]
    normals = None if mesh.normals is None else (mesh.normals @ T[:3, :3].T).astype(np.float32)
    return replace(mesh, vertices=vertices.astype(np.float32), normals=normals)


def load(folder: str | Path) -> Case:
    """Read `recording.json` and `simulation.json` of a folder.

    Raises
    ------
    InputError
        If either cannot be read, a picture is missing, of another size than its camera or than the other pictures, a frame
        names a light that there is not, or nothing was measured.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("be a folder with recording.json and simulation.json", file=folder)
    return build(read_recording(folder), read_simulation(folder), folder / "recording.json")


def build(recording: Recording, simulation: Simulation, file: Path | None = None) -> Case:
    """Bring a recording and a simulation together.

    Raises
    ------
    InputError
        As `load`.
    """
    try:
        return _build(recording, simulation)
    except InputError as error:
        raise error.at(file=file) from error


def _build(recording: Recording, simulation: Simulation) -> Case:
    if not recording.frames:
        raise InputError("hold at least one frame", got="none", key="frames")
    lamps = (PointLight, SphereLight, DirectionalLight)
    names = [n for n, light in simulation.lights.items() if isinstance(light, lamps)]
    other = [n for n, light in simulation.lights.items() if not isinstance(light, (*lamps, EnvironmentLight))]
    if other:
        remedy = "Put a sphere, or a point, of light in its place: `light_extent` tells whether it has one."
        raise InputError("be a point, sphere, directional or environment light", key=f"lights.{other[0]}", remedy=remedy)
    _check_diagnosable(simulation)
    skies = {n for n, light in simulation.lights.items() if isinstance(light, EnvironmentLight)}
    lit = [_lit(f, i, simulation) for i, f in enumerate(recording.frames)]
    width = max(1, *(len([n for n in on if n not in skies]) for on in lit))
    slots = np.full((len(lit), width), -1, np.int64)
    for i, on in enumerate(lit):
        rows = [names.index(n) for n in on if n not in skies]
        slots[i, : len(rows)] = rows
    pictures, valid, notes = _pictures(recording)
    if not valid.any():
        raise InputError("hold measured pixels", got="NaN or masked ones alone", key="frames")
    noise = recording.noise or estimated_noise(pictures, valid)
    poses = [f.camera.T_world_camera.round(9).tobytes() for f in recording.frames]
    return Case(
        recording,
        simulation,
        pictures,
        valid,
        sensor_variance(pictures, noise, [f.exposure for f in recording.frames]),
        tuple(bent(f.camera, simulation.lens.k1, simulation.lens.k2) for f in recording.frames),
        tuple(names),
        lamp_table(simulation, names),
        slots,
        np.array([bool(skies & set(on)) for on in lit]),
        _numbers(list(zip(poses, lit))),
        _numbers(poses),
        _numbers(lit),
        noise,
        recording.noise is None,
        tuple(notes),
    )


_UNKNOWN_TO_DIAGNOSIS = (
    "film",
    "alpha_texture",
    "opacity_texture",
    "bump_texture",
    "tangent_angle",
    "tint",
    "tint_texture",
    "tail",
    "one_sided",
)


def _check_diagnosable(simulation: Simulation) -> None:
    """Refuse what the tracer renders, and the fast model of the diagnosis does not know."""
    remedy = "`meniscus render` makes pictures of it; a diagnosis begins with lambert and ggx."
    for name, m in simulation.materials.items():
        if m.model not in ("lambert", "ggx"):
            raise InputError("be lambert or ggx to be diagnosed", got=m.model, key=f"materials.{name}.model", remedy=remedy)
        plain = Material(m.model)
        for key in _UNKNOWN_TO_DIAGNOSIS:
            value = getattr(m, key)
            if isinstance(value, np.ndarray) or value != getattr(plain, key):
                raise InputError("be left out to be diagnosed", key=f"materials.{name}.{key}", remedy=remedy)
    for name, light in simulation.lights.items():
        if isinstance(light, EnvironmentLight) and light.panorama is not None:
            raise InputError("be an even radiance to be diagnosed", got="a panorama", key=f"lights.{name}", remedy=remedy)
        if isinstance(light, DirectionalLight) and light.angular_radius > 0:
            got = light.angular_radius
            raise InputError("be 0 to be diagnosed", got=got, key=f"lights.{name}.angular_radius", remedy=remedy)


def _lit(frame: Frame, i: int, simulation: Simulation) -> tuple[str, ...]:
    if frame.lights is None:
        return tuple(simulation.lights)
    for name in frame.lights:
        if name not in simulation.lights:
            known = ", ".join(simulation.lights) or "none"
            raise InputError(f"name lights of simulation.json ({known})", got=name, key=f"frames[{i}].lights")
    return tuple(sorted(frame.lights))


def _numbers(keys: list) -> NDArray[np.int64]:
    first: dict = {}
    return np.array([first.setdefault(key, len(first)) for key in keys], np.int64)


def lamp_table(simulation: Simulation, names: list[str]) -> NDArray[np.float64]:
    """Return lamps as rows (L, 7) of `kernels.fragments`; of a sphere of light, its centre."""
    rows = np.zeros((len(names), kernel.NUM_LAMP))
    for row, name in zip(rows, names, strict=True):
        light = simulation.lights[name]
        if isinstance(light, PointLight | SphereLight):
            row[:] = [kernel.POINT, *light.position, *light.intensity]
        elif isinstance(light, DirectionalLight):
            towards = -np.array(light.direction, np.float64)
            row[:] = [kernel.DIRECTIONAL, *(towards / np.linalg.norm(towards)), *light.irradiance]
    return rows


def _pictures(recording: Recording) -> tuple[Floats, NDArray[np.bool_], list[str]]:
    pictures, notes, unmeasured = [], [], 0
    first = recording.frames[0].camera
    for i, frame in enumerate(tracked(recording.frames, "reading the pictures")):
        picture, encoding = read_image(frame.image, frame.response)
        got, want = (picture.shape[1], picture.shape[0]), (frame.camera.width, frame.camera.height)
        if got != want:
            remedy = "Give the camera of this picture; nothing is resampled here."
            raise InputError(f"be {want[0]} x {want[1]} as its camera", got=f"{got[0]} x {got[1]}", file=frame.image, remedy=remedy)
        if want != (first.width, first.height):
            raise InputError("have one size", got=f"{want[0]} x {want[1]} at frames[{i}]", key="the cameras of all frames")
        if encoding.response == "srgb" and frame.response is None and i == 0:
            notes.append("The response of 8-bit pictures was taken to be sRGB, as the recording does not say.")
        unmeasured += int(np.any(~np.isfinite(picture), axis=-1).sum())
        pictures.append(picture / np.float32(frame.exposure))
    stack = np.stack(pictures)
    valid = np.all(np.isfinite(stack), axis=-1)
    if unmeasured:
        notes.append(f"{unmeasured} pixels are NaN or infinite and were left out.")
    return np.where(valid[..., None], stack, 0).astype(np.float32), valid, notes


def sensor_variance(pictures: Floats, noise: Noise, exposures: list[float]) -> Floats:
    """Return the variance of each pixel, read_sigma² + shot_gain signal, of pictures divided by their exposure.

    The signal is the recording itself, averaged over 3 x 3 pixels: no model has a say in it, so that all of them are
    weighed alike.
    """
    return pixel_variance(uniform_filter(pictures, (0, 3, 3, 0)), noise, exposures)


def pixel_variance(signal: Floats, noise: Noise, exposures: list[float]) -> Floats:
    """Return the variance (F, H, W, 3) that noise has on a picture, both divided by the exposures."""
    exposure = np.array(exposures, np.float32)[:, None, None, None]
    signal = np.maximum(signal * exposure, 0)
    return ((noise.read_sigma**2 + noise.shot_gain * signal) / exposure**2).astype(np.float32)


def estimated_noise(pictures: Floats, valid: NDArray[np.bool_]) -> Noise:
    """Fit `read_sigma` and `shot_gain` to the finest differences between neighbouring pixels."""
    return fitted_noise(noise_levels(pictures, pictures, valid))


def noise_levels(pictures: Floats, detail: Floats, valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return rows of (brightness of `pictures`, variance of the noise in `detail`), from dark to bright.

    The second difference along rows of three pixels is blind to slopes; its median over pixels of like brightness is
    little moved by edges. J. Immerkær (1996) has the idea for one level of noise.
    """
    d = (detail[:, :, :-2] - 2 * detail[:, :, 1:-1] + detail[:, :, 2:]) / np.sqrt(6.0)
    ok = valid[:, :, :-2] & valid[:, :, 1:-1] & valid[:, :, 2:]
    level = uniform_filter(pictures, (0, 3, 3, 0))[:, :, 1:-1][ok].ravel()
    spread = np.abs(d[ok].ravel())
    if not len(level):
        return np.zeros((0, 2))
    edges = np.unique(np.quantile(level, np.linspace(0, 1, 17)))
    rows = []
    for low, high in itertools.pairwise(edges):
        inside = (level >= low) & (level <= high)
        if inside.sum() > 50:
            rows.append((float(np.median(level[inside])), float(1.4826 * np.median(spread[inside])) ** 2))
    if not rows:
        rows = [(float(np.median(level)), float(1.4826 * np.median(spread)) ** 2)]
    return np.array(rows)


def fitted_noise(rows: NDArray[np.float64], otherwise: float = 1e-3) -> Noise:
    """Fit noise to rows of (brightness, variance); `otherwise` is its `read_sigma` if there are none."""
    if not len(rows):
        return Noise(otherwise, 0.0)
    x, y = rows.T
    w = 1 / np.maximum(y, 1e-12)
    A = np.stack([np.ones_like(x), np.maximum(x, 0)], 1)
    from scipy.optimize import nnls

    (read2, gain), _ = nnls(A * w[:, None], y * w)
    return Noise(float(np.sqrt(max(read2, 1e-12))), float(gain))


def with_believed(case: Case, terms: tuple) -> Case:
    """Return the case with other terms that its simulation believes; what was gathered of it is kept."""
    out = replace(case, believed=terms, cache={})
    # Cached properties of a frozen class live in its dictionary.
    out.__dict__.update({k: v for k, v in case.__dict__.items() if k in ("world", "pieces")})
    return out


def with_noise_times(case: Case, factor: float) -> Case:
    """Return the case with noise of `factor` times the standard deviation; what was gathered of it is kept."""
    noise = replace(case.noise, read_sigma=case.noise.read_sigma * factor, shot_gain=case.noise.shot_gain * factor**2)
    out = replace(case, noise=noise, variance=(case.variance * factor**2).astype(np.float32), cache={})
    # Cached properties of a frozen class live in its dictionary.
    out.__dict__.update({k: v for k, v in case.__dict__.items() if k in ("world", "pieces")})
    return out


def subset(case: Case, frames: NDArray[np.int64] | list[int]) -> Case:
    """Return the case with some of its frames only; what was gathered of them is kept."""
    frames = np.asarray(frames)
    height, width = case.size
    size, p = height * width, case.pieces
    counts = np.diff(p.start).reshape(case.num_frames, size)[frames].ravel()
    parts = [slice(p.start[f * size], p.start[(f + 1) * size]) for f in frames]

    def taken(values: NDArray) -> NDArray:
        return np.concatenate([values[part] for part in parts])

    pixel = np.concatenate([p.pixel[part] - f * size + i * size for i, (f, part) in enumerate(zip(frames, parts, strict=True))])
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    edge = p.edge.reshape(case.num_frames, size)[frames].ravel()
    pieces = Pieces(start, pixel, **{n: taken(getattr(p, n)) for n in PER_PIECE}, edge=edge)
    out = replace(
        case,
        recording=select_frames(case.recording, frames.tolist()),
        pictures=case.pictures[frames],
        valid=case.valid[frames],
        variance=case.variance[frames],
        cameras=tuple(case.cameras[f] for f in frames),
        settled=replace(case.settled, twist=None if case.settled.twist is None else case.settled.twist[frames]),
        slots=case.slots[frames],
        sky=case.sky[frames],
        block=_numbers(case.block[frames].tolist()),
        pose=_numbers(case.pose[frames].tolist()),
        lit=_numbers(case.lit[frames].tolist()),
        cache={},
    )
    # Cached properties of a frozen class live in its dictionary.
    out.__dict__["world"], out.__dict__["pieces"] = case.world, pieces
    return out
