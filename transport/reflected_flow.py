"""True flow of reflected images: where the mirrored point that a pixel shows will be seen, mirrored, in the next frame.

A reflection does not move as the surface does that shows it. In a flat mirror at rest it moves as its virtual image, which
lies as far behind the mirror as the thing before it; on a curved or moving surface no closed form is left. So the place in the
next frame is searched for: the pixel position whose own mirrored ray ends at the same point of the world, by Gauss and
Newton's steps on the ray tracer itself, from where the virtual image of a flat mirror would be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.simulation import Lens
from scene.transforms import transform_points

from .kernels import mirrored as kernel
from .kernels.arrays import CameraArrays
from .kernels.optics import OpticsArrays
from .render import compile_view
from .world import World

Floats = NDArray[np.float64]
_STEPS = 12
# Pixels over which slopes are taken: of a facet's size where a mirror is far, far less than what curves.
_SLOPE = 0.25
_LONGEST_STEP = 16.0
# A place is found when what it shows is this near to what it should show, in pixels.
_FOUND = 0.02


@dataclass(frozen=True)
class Reflections:
    """What rays show by way of a mirror; see `kernels.mirrored.mirrored`."""

    kind: NDArray[np.int64]
    face: NDArray[np.int64]
    place: Floats
    length: Floats


def reflected_flow(
    world: World,
    camera: Camera,
    next_camera: Camera,
    next_world: World | None = None,
    motions: dict[int, Floats] | None = None,
    lens: Lens | None = None,
) -> NDArray[np.float32]:
    """Return how the reflection seen at each pixel's centre moves until the next frame.

    Parameters
    ----------
    world, next_world : World
        Now and then; by default nothing but the camera moves.
    camera, next_camera : Camera
    motions : dict, optional
        As for `gbuffer.flow_between`: where the things that are mirrored have gone.
    lens : Lens, optional
        As for `render`, of both frames.

    Returns
    -------
    flow : (H, W, 2) float32
        x right, y down [px]; NaN where the surface seen mirrors nothing, and where the same reflection is not to be seen in
        the next frame: hidden, off the mirror, or split by its curvature.

    Raises
    ------
    InputError
        As `compile_optics`.

    Notes
    -----
    Each mirrors about its shading normal, rough ones too: the middle of their blurred image. Only one bounce is followed.
    """
    xy = camera.pixel_centres()
    now = _reflections(world, compile_view(camera, lens, None), xy)
    wanted = _moved(world, now, motions or {})
    guess = _virtual(now, camera, next_camera, xy, lens)
    then_world = next_world or world
    found = _search(then_world, compile_view(next_camera, lens, None), now.kind, wanted, guess)
    return (found - xy).reshape(camera.height, camera.width, 2).astype(np.float32)


def _reflections(world: World, view: tuple[CameraArrays, OpticsArrays | None], xy: Floats) -> Reflections:
    n = len(xy)
    out = Reflections(np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros((n, 3)), np.zeros(n))
    kernel.mirrored(world.arrays, *view, np.ascontiguousarray(xy), out.kind, out.face, out.place, out.length)
    return out


def _moved(world: World, now: Reflections, motions: dict[int, Floats]) -> Floats:
    """Return where the points that are mirrored now lie in the next frame."""
    places = now.place.copy()
    instances = np.array([s.instance for s in world.shapes])
    on = np.where(now.face >= 0, instances[world.arrays.face_shape[np.maximum(now.face, 0)]], 0)
    for instance, T_next_now in motions.items():
        moves = (now.kind == kernel.SURFACE) & (on == instance)
        places[moves] = transform_points(T_next_now, places[moves])
    return places


def _virtual(now: Reflections, camera: Camera, next_camera: Camera, xy: Floats, lens: Lens | None) -> Floats:
    """Return where the virtual images of flat mirrors at rest would be seen, or as a first guess the same pixel."""
    bends = lens is not None and (lens.k1 or lens.k2)
    origins, directions = camera.rays(xy)
    image, _ = next_camera.project(origins + now.length[:, None] * directions)
    pose = next_camera.T_world_camera.copy()
    pose[:3, 3] = 0
    sky, _ = next_camera.moved_to(pose).project(directions)
    guess = np.where((now.kind == kernel.SKY)[:, None], sky, image)
    return xy.copy() if bends else np.where(np.isfinite(guess), guess, xy)


def _search(
    world: World, view: tuple[CameraArrays, OpticsArrays | None], kind: NDArray[np.int64], wanted: Floats, guess: Floats
) -> Floats:
    """Return the positions (N, 2) that show the wanted places; NaN where none was found."""
    out = np.full_like(guess, np.nan)
    active = np.flatnonzero(kind != kernel.NO_MIRROR)
    at = guess[active]
    for _ in range(_STEPS):
        if not len(active):
            break
        here, right, below = (_reflections(world, view, at + step) for step in ((0, 0), (_SLOPE, 0), (0, _SLOPE)))
        # A slope across the border of two things, or off the mirror, means nothing: take it to the other side there.
        left, above = _other_side(world, view, at, here, right, 0), _other_side(world, view, at, here, below, 1)
        same = (here.kind == kind[active]) & (left.kind == here.kind) & (above.kind == here.kind)
        J = np.stack([left.place - here.place, above.place - here.place], axis=-1) / _SLOPE
        miss = wanted[active] - here.place
        step, size = _least_squares(J, miss)
        good = same & np.isfinite(step).all(axis=1)
        close = good & (np.linalg.norm(miss, axis=1) <= _FOUND * size)
        out[active[close]] = at[close] + step[close]
        going = good & ~close
        longest = np.linalg.norm(step, axis=1, keepdims=True)
        at = (at + step * np.minimum(1, _LONGEST_STEP / np.maximum(longest, 1e-12)))[going]
        active = active[going]
    return out


def _other_side(
    world: World, view: tuple[CameraArrays, OpticsArrays | None], at: Floats, here: Reflections, there: Reflections, axis: int
) -> Reflections:
    """Return `there`, but mirrored about `here` from the opposite side where the two are not of one kind or one thing."""
    shape = world.arrays.face_shape

    def of(r: Reflections) -> NDArray[np.int64]:
        return np.where(r.face >= 0, shape[np.maximum(r.face, 0)], -1)

    apart = np.flatnonzero((there.kind != here.kind) | (of(there) != of(here)))
    if not len(apart):
        return there
    step = np.zeros(2)
    step[axis] = -_SLOPE
    back = _reflections(world, view, at[apart] + step)
    kind, place = there.kind.copy(), there.place.copy()
    kind[apart] = np.where(of(back) == of(here)[apart], back.kind, -1)
    place[apart] = 2 * here.place[apart] - back.place
    return Reflections(kind, there.face, place, there.length)


def _least_squares(J: Floats, miss: Floats) -> tuple[Floats, Floats]:
    """Return the steps (N, 2) that best mend what is missing (N, 3), and how far a pixel reaches there (N,)."""
    A = np.einsum("nki,nkj->nij", J, J)
    b = np.einsum("nki,nk->ni", J, miss)
    det = A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] * A[:, 1, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (A[:, 1, 1] * b[:, 0] - A[:, 0, 1] * b[:, 1]) / det
        y = (A[:, 0, 0] * b[:, 1] - A[:, 1, 0] * b[:, 0]) / det
    return np.stack([x, y], axis=1), np.sqrt(np.minimum(A[:, 0, 0], A[:, 1, 1]))
