"""How a picture comes about: the world as it is supposed to be, shaded, and what lens and sensor make of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scene.simulation import Material

from ..kernels import ambient as ambient_kernel
from ..kernels import fragments as lamp_kernel
from ..kernels import shade as kernel
from .case import Case, Floats

NOTHING2, NOTHING1 = np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
_NO_BEND = np.zeros((0, 2), np.float32)
# (F, H, W, 3) -> the same.
Develop = Callable[[Floats], Floats]


@dataclass
class State:
    """A supposition about the world: what the kernel shades, and what is done to the picture afterwards.

    Attributes
    ----------
    lamps, surfaces : tables of `kernels.fragments` and `kernels.shade`
    visible : (N, S) float32
        Share of each piece that each lamp reaches.
    sky : (3,) float64
        Radiance beyond the world.
    factor, mask, bend, ambient, through, air
        Of the pieces, see `kernels.shade.shade`; without rows: not there.
    arriving : (N, S) float32
        Share of each lamp's light that comes through the air to each piece; without rows: all.
    spread : list of functions
        On what reaches the lens (F, H, W, 3): air that scatters light about its way.
    lens, sensor : list of functions
        On the pictures (F, H, W, 3), in the order in which they act.
    kept_visible : (N, S) float32 or None
        What `visible` is to stay while derivatives are taken: a border of a shadow that jumps over the middle of a few
        pixels has no derivative there.
    """

    lamps: NDArray[np.float64]
    surfaces: NDArray[np.float64]
    visible: Floats
    sky: NDArray[np.float64]
    factor: Floats = field(default_factory=lambda: NOTHING2)
    mask: Floats = field(default_factory=lambda: NOTHING1)
    bend: Floats = field(default_factory=lambda: _NO_BEND)
    ambient: Floats = field(default_factory=lambda: NOTHING2)
    through: Floats = field(default_factory=lambda: NOTHING2)
    air: Floats = field(default_factory=lambda: NOTHING2)
    arriving: Floats = field(default_factory=lambda: NOTHING2)
    spread: list[Develop] = field(default_factory=list)
    lens: list[Develop] = field(default_factory=list)
    sensor: list[Develop] = field(default_factory=list)
    kept_visible: Floats | None = None

    def copy(self) -> State:
        """Return a copy whose tables and lists can be changed; arrays of pieces are replaced as a whole."""
        return replace(
            self, lamps=self.lamps.copy(), surfaces=self.surfaces.copy(), sky=self.sky.copy(),
            spread=list(self.spread), lens=list(self.lens), sensor=list(self.sensor),
        )  # fmt: skip

    def add_ambient(self, irradiance: NDArray) -> None:
        """Add irradiance over pi (N, 3)."""
        irradiance = irradiance.astype(np.float32)
        self.ambient = irradiance if not len(self.ambient) else self.ambient + irradiance

    def veil(self, through: NDArray, air: NDArray) -> None:
        """Put something between surfaces and camera: of what came there passes `through` (N, 3), and `air` (N, 3) is added."""
        through, air = through.astype(np.float32), air.astype(np.float32)
        if len(self.through):
            through, air = through * self.through, air + through * self.air
        self.through, self.air = through, air

    def scale_albedo(self, factor: NDArray) -> None:
        """Multiply the albedo of the pieces (N, 3)."""
        factor = factor.astype(np.float32)
        self.factor = factor if not len(self.factor) else self.factor * factor


def believed(case: Case) -> State:
    """Return what the sender believed."""
    pieces = case.pieces
    surfaces = np.array([surface_row(case.material_of(i)) for i in range(len(case.world.shapes))])
    shadows = case.simulation.transport.shadows
    visible = pieces.visible if shadows else np.ones_like(pieces.visible)
    state = State(case.lamps.copy(), surfaces, visible, case.environment.copy())
    if case.environment.any():
        share = open_sky(case) if shadows else np.ones(len(pieces), np.float32)
        state.add_ambient(share[:, None] * case.environment * case.sky[frame_of(case)][:, None])
    return state


def surface_row(m: Material) -> NDArray[np.float64]:
    """Return a material as a row of `kernels.shade`."""
    row = np.zeros(kernel.NUM_SURFACE)
    base = np.ones(3) if m.albedo_texture is not None else np.array(m.albedo)
    row[kernel.SCALE : kernel.SCALE + 3] = base * m.albedo_scale
    row[kernel.ALPHA_U] = m.alpha if m.alpha_u is None else m.alpha_u
    row[kernel.ALPHA_V] = m.alpha if m.alpha_v is None else m.alpha_v
    row[kernel.ANGLE], row[kernel.ETA], row[kernel.FRESNEL] = m.tangent_angle, m.eta, 1.0
    row[kernel.LOBE] = m.specular_scale if m.model == "ggx" else 0.0
    row[kernel.ALPHA2], row[kernel.RETRO_WIDTH], row[kernel.ALPHA3], row[kernel.ETA3] = 0.6, 0.3, 0.1, 1.33
    return row


def frame_of(case: Case) -> NDArray[np.int64]:
    """Return the frame of each piece (N,)."""
    height, width = case.size
    return case.pieces.pixel // (height * width)


def sight(case: Case) -> Floats:
    """Return the direction from each piece back to the camera (N, 3), beyond the world too."""
    if "sight" not in case.cache:
        beyond = case.pieces.shape < 0
        view = case.pieces.view
        if beyond.any():
            rays = np.concatenate([-c.rays(c.pixel_centres())[1] for c in case.gathered_cameras])
            rays /= np.linalg.norm(rays, axis=1, keepdims=True)
            view = np.where(beyond[:, None], rays[case.pieces.pixel], view).astype(np.float32)
        case.cache["sight"] = view
    return case.cache["sight"]


def eyes(case: Case) -> NDArray[np.float64]:
    """Return where the cameras stand (F, 3)."""
    return np.array([c.position for c in case.gathered_cameras])


def radiance(case: Case, state: State) -> Floats:
    """Return what reaches the lens (F, H, W, 3)."""
    p, (height, width) = case.pieces, case.size
    out = np.empty((len(p.start) - 1, 3), np.float32)
    visible = state.visible * state.arriving if len(state.arriving) else state.visible
    kernel.shade(
        p.start, height * width, p.weight, p.shape, p.position, p.normal, p.tangent, p.view, p.albedo, visible,
        case.slots, state.lamps, state.surfaces, state.sky, state.factor, state.mask, state.bend, state.ambient,
        state.through, state.air, out,
    )  # fmt: skip
    picture = out.reshape(case.num_frames, height, width, 3)
    for step in state.spread:
        picture = step(picture)
    return picture


def develop(state: State, picture: Floats) -> Floats:
    """Return what the sensor delivers of what reaches the lens, without noise."""
    for step in (*state.lens, *state.sensor):
        picture = step(picture)
    return picture


def open_sky(case: Case, samples: int = 48) -> Floats:
    """Return the share of open sky above each piece, cosine-weighted (N,)."""
    if "open_sky" not in case.cache:
        p = case.pieces
        out = np.zeros(len(p), np.float32)
        ambient_kernel.open_sky(case.world.arrays, p.anchor, p.normal, p.anchor_normal, samples, 1, out)
        out[p.shape < 0] = 0
        case.cache["open_sky"] = smoothed(case, out[:, None])[:, 0]
    return case.cache["open_sky"]


def bounced(case: Case, state: State, bounces: int = 7, samples: int = 48) -> Floats:
    """Return irradiance over pi (N, bounces, 3) that came by 1, 2, ... other surfaces, under the lamps and albedos of `state`."""
    p = case.pieces
    out = np.zeros((len(p), bounces, 3), np.float32)
    rows = case.slots[frame_of(case)]
    scales = np.ascontiguousarray(state.surfaces[:, kernel.SCALE : kernel.SCALE + 3])
    sky = state.sky * float(case.sky.any())
    ambient_kernel.bounced(
        case.world.arrays, scales, p.anchor, p.normal, p.anchor_normal, rows, state.lamps, sky, bounces, samples, 2, out
    )
    out[p.shape < 0] = 0
    flat = smoothed(case, out.reshape(len(p), -1))
    return flat.reshape(out.shape)


def smoothed(case: Case, values: Floats, radius: int = 2) -> Floats:
    """Average values of pieces (N, C) over neighbouring pixels that see the same shape from about the same normal.

    What is estimated with noise on each piece and varies slowly over a surface loses most of its noise so.
    """
    p, (height, width) = case.pieces, case.size
    from ..kernels.smooth import smooth

    out = np.empty_like(values)
    smooth(p.start, height, width, p.pixel, p.shape, p.position, p.normal, p.across, p.down, values, radius, out)
    return out


def relight(case: Case, state: State, points: int = 3) -> None:
    """Bring `state.visible` up to date with lamps that are not where the pieces were gathered under them.

    Notes
    -----
    The gathered visibility comes from points on the surface itself, this one from points on the plane of each piece, which
    may dip into a curved body: what is added is the difference that the same points make between lamp there and here.
    """
    if not case.simulation.transport.shadows:
        return
    if state.kept_visible is not None:
        state.visible = state.kept_visible
        return
    moved = np.any(np.abs(state.lamps[:, :4] - case.gathered_lamps[:, :4]) > 1e-9, axis=1)
    if not moved.any():
        return
    p = case.pieces
    out = state.visible.copy()
    slots = case.slots[frame_of(case)]
    for s in range(slots.shape[1]):
        lamp = slots[:, s]
        rows = np.flatnonzero((lamp >= 0) & (p.shape >= 0) & moved[lamp])
        here, there = (_share(case, rows, lamp[rows], lamps, points) for lamps in (case.gathered_lamps, state.lamps))
        out[rows, s] = np.clip(out[rows, s] + there - here, 0, 1)
    state.visible = out


def _share(case: Case, rows: NDArray, lamp: NDArray, lamps: NDArray, points: int) -> NDArray[np.float64]:
    p, share = case.pieces, np.zeros(len(rows))
    key = ("share", points, lamps.tobytes(), rows.tobytes()) if lamps is case.gathered_lamps else None
    if key is not None and key in case.cache:
        return case.cache[key]
    lamp_kernel.visibility(case.world.arrays, rows, p.position, p.face_normal, p.across, p.down, lamp, lamps, points, share)
    if key is not None:
        case.cache[key] = share
    return share
