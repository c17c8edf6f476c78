"""Cars: a body lofted from cross-sections along the car, glass where windows are, wheels that touch the ground.

A car's own frame: x forward, y to its left, z up; the wheels stand on z = 0, the origin lies midway between the axles.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from ..mesh import Mesh, join
from .solids import box, quads, tube

Floats = NDArray[np.floating]

WHEEL_RADIUS, AXLE_X, TRACK_Y = 0.32, 1.31, 0.775
CONTACTS = np.array([[x, y, 0.0] for x in (AXLE_X, -AXLE_X) for y in (TRACK_Y, -TRACK_Y)])
_TYRE_WIDTH = 0.205
_ARCH = 0.375


@dataclass(frozen=True)
class CarShape:
    """Curves along the car as (x, value) corners, joined without overshoot [m].

    `top` is the silhouette over the centre line, `belt` the lower edge of the side windows, `half` the half width,
    `roof` the half width at the top. `windscreen` and `rear_window` are the x ranges of the glass.
    """

    top: tuple[tuple[float, float], ...]
    belt: tuple[tuple[float, float], ...]
    half: tuple[tuple[float, float], ...]
    roof: tuple[tuple[float, float], ...]
    windscreen: tuple[float, float]
    rear_window: tuple[float, float]
    side_glass: tuple[float, float]
    pillar: float


HATCHBACK = CarShape(
    top=((-2.08, 0.70), (-2.04, 0.90), (-1.96, 1.02), (-1.55, 1.36), (-1.25, 1.44), (-0.5, 1.49), (0.0, 1.48), (0.32, 1.42),
         (1.12, 0.99), (1.6, 0.90), (1.95, 0.78), (2.08, 0.62), (2.12, 0.52)),
    belt=((-2.08, 0.66), (-2.0, 0.92), (-1.5, 0.98), (0.0, 0.94), (1.1, 0.91), (1.7, 0.80), (2.0, 0.66), (2.12, 0.50)),
    half=((-2.08, 0.66), (-1.98, 0.80), (-1.6, 0.87), (0.0, 0.89), (1.3, 0.88), (1.75, 0.83), (2.0, 0.72), (2.12, 0.55)),
    roof=((-2.08, 0.58), (-1.9, 0.66), (-1.3, 0.60), (0.0, 0.62), (0.35, 0.62),
          (1.12, 0.74), (1.7, 0.68), (2.0, 0.58), (2.12, 0.45)),
    windscreen=(0.36, 1.08),
    rear_window=(-1.93, -1.50),
    side_glass=(-1.45, 0.78),
    pillar=-0.22,
)  # fmt: skip
SALOON = CarShape(
    top=((-2.28, 0.62), (-2.24, 0.86), (-2.12, 0.98), (-1.78, 1.03), (-1.15, 1.36), (-0.75, 1.43), (-0.2, 1.45), (0.2, 1.42),
         (1.05, 0.98), (1.6, 0.90), (2.05, 0.76), (2.22, 0.58), (2.27, 0.48)),
    belt=((-2.28, 0.58), (-2.2, 0.84), (-1.6, 0.94), (0.0, 0.92), (1.0, 0.90), (1.7, 0.80), (2.1, 0.64), (2.27, 0.46)),
    half=((-2.28, 0.66), (-2.18, 0.80), (-1.7, 0.88), (0.0, 0.90), (1.3, 0.89), (1.85, 0.84), (2.15, 0.72), (2.27, 0.55)),
    roof=((-2.28, 0.58), (-2.1, 0.70), (-1.7, 0.70), (-1.1, 0.58), (0.0, 0.60), (0.25, 0.60),
          (1.05, 0.74), (1.8, 0.68), (2.15, 0.58), (2.27, 0.45)),
    windscreen=(0.26, 1.02),
    rear_window=(-1.72, -1.12),
    side_glass=(-1.28, 0.70),
    pillar=-0.28,
)  # fmt: skip

# Samples on each stretch of a half cross-section, bottom centre to top centre.
_STRETCHES = (("bottom", 4), ("sill", 2), ("door", 7), ("shoulder", 5), ("window", 7), ("rail", 2), ("roof", 7))


def car(shape: CarShape, paint: str) -> dict[str, Mesh]:
    """Return a car's meshes by material; `paint` names the body's."""
    vertices, faces, stretch, row = _loft(shape)
    centre = _of_both_halves(vertices[faces].mean(axis=1), stretch)
    material = _materials(shape, centre, stretch, row, paint)
    kept = ~_in_wheel_arch(centre, stretch)
    parts: dict[str, list[Mesh]] = {}
    for name in sorted(set(material)):
        parts.setdefault(name, []).append(_cut(vertices, faces[kept & (material == name)]))
    for x in (AXLE_X, -AXLE_X):
        for side in (1, -1):
            _wheel(parts, x, side)
            _arch(parts, x, side, float(_curve(shape.half, np.array([x]))[0]))
    front, rear = vertices[:, 0].max(), vertices[:, 0].min()
    parts.setdefault("car_plate", []).append(box((front - 0.01, -0.26, 0.36), (front + 0.012, 0.26, 0.47)))
    parts["car_plate"].append(box((rear - 0.012, -0.26, 0.48), (rear + 0.01, 0.26, 0.59)))
    for side in (1, -1):
        y0, y1 = sorted([side * 0.86, side * 1.03])
        parts[paint].append(box((0.70, y0, 0.93), (0.80, y1, 1.07)))
    return {name: join(meshes) for name, meshes in sorted(parts.items())}


def _of_both_halves(centre: Floats, stretch: NDArray[np.str_]) -> NDArray[np.float64]:
    """Return each triangle's quad's centre, so that both halves of a quad are treated alike: no saw teeth."""
    out = centre.astype(np.float64)
    is_quad = ~np.isin(stretch, ["nose", "tail"])
    out[is_quad] = np.repeat(0.5 * (centre[is_quad][0::2] + centre[is_quad][1::2]), 2, axis=0)
    return out


def _curve(corners: tuple[tuple[float, float], ...], x: Floats) -> NDArray[np.float64]:
    xs, values = np.array(corners).T
    return PchipInterpolator(xs, values)(x)


def _loft(shape: CarShape) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.str_], NDArray[np.int64]]:
    """Return vertices, triangles, and for each triangle its stretch and its row within it, from below."""
    rear, front = shape.top[0][0], shape.top[-1][0]
    x = np.unique(
        np.concatenate(
            [np.arange(rear, front, 0.035), [front], np.linspace(rear, rear + 0.1, 6), np.linspace(front - 0.12, front, 7)]
        )
    )
    top, half, roof = _curve(shape.top, x), _curve(shape.half, x), _curve(shape.roof, x)
    belt = np.minimum(_curve(shape.belt, x), top - 0.03)
    under = 0.20 + 0.09 * np.clip((np.abs(x) - 1.65) / 0.5, 0, 1) ** 2
    zero = np.zeros_like(x)
    mid = 0.45 * under + 0.55 * belt
    rail_z = top - np.minimum(0.06, 0.35 * (top - belt))
    corners = [(zero, under), (0.90 * half, under), (0.975 * half, under + 0.10), (half, mid), (0.965 * half, belt), (roof, rail_z)]
    corners += [(0.88 * roof, top - 0.018), (zero, top)]
    ring_y, ring_z, owner, rows = [], [], [], []
    for (name, count), (y0, z0), (y1, z1) in zip(_STRETCHES, corners[:-1], corners[1:], strict=True):
        s = np.arange(count)[:, None] / count
        # The roof and the bonnet are arched: a parabola through the centre.
        bow = s * (2 - s) if name == "roof" else s
        ring_y.append(y0 + (y1 - y0) * s)
        ring_z.append(z0 + (z1 - z0) * bow)
        owner += [name] * count
        rows += range(count)
    left_y, left_z = np.concatenate([*ring_y, zero[None]]), np.concatenate([*ring_z, top[None]])
    ys = np.concatenate([left_y, -left_y[-2:0:-1]])
    zs = np.concatenate([left_z, left_z[-2:0:-1]])
    ring_owner, ring_row = np.array(owner + owner[::-1]), np.array(rows + rows[::-1])
    n, m = len(x), len(ys)
    vertices = np.stack([np.broadcast_to(x[:, None], (n, m)), ys.T, zs.T], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(m), indexing="ij")
    k = (j + 1) % m
    # x forward, j to the left and up: this order looks outwards.
    a, b, c, d = i * m + j, i * m + k, (i + 1) * m + k, (i + 1) * m + j
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    stretch, row = np.repeat(ring_owner[j.ravel()], 2), np.repeat(ring_row[j.ravel()], 2)
    caps = []
    for end, offset, order in ((x[0], 0, -1), (x[-1], (n - 1) * m, 1)):
        ring = np.arange(m) + offset
        hub = len(vertices)
        vertices = np.concatenate([vertices, [[end, 0.0, zs[:, 0 if order < 0 else -1].mean()]]])
        fan = np.stack([ring, np.roll(ring, -1), np.full(m, hub)], axis=1)
        caps.append(fan[:, ::order])
    faces = np.concatenate([faces, *caps])
    stretch = np.concatenate([stretch, np.full(m, "tail"), np.full(m, "nose")])
    return vertices, faces, stretch, np.concatenate([row, np.zeros(2 * m, int)])


def _materials(shape: CarShape, c: Floats, stretch: NDArray[np.str_], row: NDArray[np.int64], paint: str) -> NDArray[np.str_]:
    """Return each triangle's material: borders follow rows and stations of the loft, so that they are straight."""
    x = c[:, 0]
    out = np.full(len(c), paint, dtype="<U16")
    out[(stretch == "bottom") | (stretch == "sill") | (stretch == "nose") | ((stretch == "door") & (row == 0))] = "car_underbody"
    in_window = (stretch == "window") & (row >= 1) & (row <= 5)
    out[in_window & (x > shape.side_glass[0]) & (x < shape.side_glass[1]) & (np.abs(x - shape.pillar) > 0.05)] = "glass"
    for low, high in (shape.windscreen, shape.rear_window):
        out[(stretch == "roof") & (x > low) & (x < high)] = "glass"
    front, rear = shape.top[-1][0], shape.top[0][0]
    out[(stretch == "shoulder") & (row >= 1) & (x > front - 0.30) & (x < front - 0.02)] = "car_headlamp"
    out[(stretch == "shoulder") & (row >= 1) & (x < rear + 0.24)] = "car_taillamp"
    return out


def _in_wheel_arch(c: Floats, stretch: NDArray[np.str_]) -> NDArray[np.bool_]:
    side = (np.abs(c[:, 1]) > 0.58) & ~np.isin(stretch, ["nose", "tail"])
    r = np.minimum(*(np.hypot(c[:, 0] - x, c[:, 2] - WHEEL_RADIUS) for x in (AXLE_X, -AXLE_X)))
    return side & (r < _ARCH + 0.01)


def _cut(vertices: Floats, faces: NDArray[np.int64]) -> Mesh:
    used, local = np.unique(faces, return_inverse=True)
    uv = np.zeros((len(used), 2), np.float32)
    return Mesh(vertices[used].astype(np.float32), local.reshape(-1, 3).astype(np.uint32), uv=uv).with_smooth_normals()


def _wheel(parts: dict[str, list[Mesh]], x: float, side: int) -> None:
    half = _TYRE_WIDTH / 2
    profile = np.array([-1.0, -0.96, -0.8, 0.8, 0.96, 1.0]) * half
    path = np.column_stack([np.full(6, x), side * TRACK_Y + profile, np.full(6, WHEEL_RADIUS)])
    parts.setdefault("rubber", []).append(tube(path, WHEEL_RADIUS - np.array([0.035, 0.012, 0, 0, 0.012, 0.035]), sides=40))
    y = side * (TRACK_Y + half + 0.002)
    angle = 2 * np.pi * np.arange(31) / 30
    spokes, gaps = [], []
    for k, (a, b) in enumerate(itertools.pairwise(angle)):
        inner, outer = (0.0, 0.205) if k % 6 in (0, 1) else (0.185, 0.205)
        for r0, r1, into in ((inner, outer, spokes), (0.0, 0.06, spokes), (0.06, 0.185, gaps)):
            if r1 <= r0 or (into is gaps and k % 6 in (0, 1)):
                continue
            corners = [(r * np.cos(t), r * np.sin(t)) for r, t in ((r0 + 1e-4, a), (r1, a), (r1, b), (r0 + 1e-4, b))]
            lift = 0.004 if into is spokes else 0.0
            quad = [(x + p, y + side * lift, WHEEL_RADIUS + q) for p, q in corners]
            into.append(quad if side < 0 else quad[::-1])
    parts.setdefault("car_rim", []).append(quads(spokes))
    parts["rubber"].append(quads(gaps))


def _arch(parts: dict[str, list[Mesh]], x: float, side: int, half: float) -> None:
    """Close the wheel's house with a dark liner and hide its cut edge below a flare."""
    angle = np.radians(np.linspace(-16, 196, 40))
    liner, flare = [], []
    for a, b in itertools.pairwise(angle):
        ring = {r: [(x + r * np.cos(t), WHEEL_RADIUS + r * np.sin(t)) for t in (a, b)] for r in (_ARCH, _ARCH + 0.055)}
        (p, q), (u, v) = ring[_ARCH], ring[_ARCH + 0.055]
        y0, y1 = side * 0.5, side * (half + 0.012)
        inside = [(p[0], y0, p[1]), (p[0], y1, p[1]), (q[0], y1, q[1]), (q[0], y0, q[1])]
        face = [(p[0], y1, p[1]), (u[0], y1, u[1]), (v[0], y1, v[1]), (q[0], y1, q[1])]
        y2 = side * (half - 0.06)
        rim = [(u[0], y1, u[1]), (u[0], y2, u[1]), (v[0], y2, v[1]), (v[0], y1, v[1])]
        for quad, into in ((inside, liner), (face, flare), (rim, flare)):
            into.append(quad if side < 0 else quad[::-1])
    back = [
        (x - _ARCH, side * 0.5, 0.12),
        (x + _ARCH, side * 0.5, 0.12),
        (x + _ARCH, side * 0.5, 0.72),
        (x - _ARCH, side * 0.5, 0.72),
    ]
    liner.append(back if side < 0 else back[::-1])
    parts.setdefault("car_underbody", []).append(quads(liner + flare))
