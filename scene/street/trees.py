"""Street trees: a trunk that forks into branches, and leaves as small quadrilaterals in clumps around the twigs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh, join
from .solids import quads, tube

Floats = NDArray[np.floating]


def tree(
    foot: Floats, rng: np.random.Generator, leaves: int = 5200, height: float = 6.4, spread: float = 1.75
) -> tuple[Mesh, Mesh]:
    """Return wood and leaves of one tree.

    Parameters
    ----------
    foot : (3,) float
        Where it stands [m]; the trunk begins 10 cm below.
    leaves : int
        Number of leaves, two triangles each.
    height, spread : float
        Of the crown's top, and radius of the crown [m].
    """
    fork = 0.36 * height
    lean = rng.normal(0, 0.05, 2)
    steps = np.linspace(0, 1, 7)
    trunk = np.column_stack([lean[0] * steps**2, lean[1] * steps**2, -0.1 + (fork + 0.1) * steps])
    wood = [tube(foot + trunk, 0.14 - 0.045 * steps + 0.07 * np.exp(-8 * steps), sides=12, uv_scale=0.5)]
    tips = []
    count = 9
    for i in range(count):
        angle = 2 * np.pi * (i + rng.uniform(-0.3, 0.3)) / count * 2.4
        reach = spread * rng.uniform(0.45, 0.85)
        top = fork + (height - fork) * rng.uniform(0.35, 0.85)
        s = np.linspace(0, 1, 6)
        out = reach * s**0.8
        branch = np.column_stack([out * np.cos(angle), out * np.sin(angle), fork - 0.25 + (top - fork + 0.25) * s**1.15])
        branch[:, :2] += lean
        wood.append(tube(foot + branch, 0.06 * (1 - s) + 0.012, sides=7, uv_scale=0.5))
        tips += [branch[k] for k in (3, 4, 5)]
    centre = np.array([lean[0], lean[1], 0.5 * (fork + height) + 0.1])
    clumps = np.concatenate([np.array(tips), centre + _ball(22, rng) * [spread * 0.75, spread * 0.75, 0.38 * (height - fork)]])
    radius = rng.uniform(0.38, 0.62, len(clumps))
    which = rng.integers(len(clumps), size=leaves)
    # Leaves grow where there is light: towards the skin of a clump.
    place = clumps[which] + _ball(leaves, rng, skin=0.35) * radius[which, None] * [1, 1, 0.8]
    return join(wood), _leaves(foot + place, rng)


def _leaves(place: Floats, rng: np.random.Generator) -> Mesh:
    n = len(place)
    # Leaves face the sky more often than not.
    normal = rng.standard_normal((n, 3)) + [0, 0, 0.9]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    a = np.cross(normal, rng.standard_normal((n, 3)))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(normal, a)
    length, width = rng.uniform(0.10, 0.16, (n, 1)) / 2, rng.uniform(0.06, 0.10, (n, 1)) / 2
    corners = np.stack([place - a * length, place - b * width, place + a * length, place + b * width], axis=1)
    uv = np.repeat(((rng.integers(64, size=(n, 1, 2)) + 0.5) / 64), 4, axis=1)
    return quads(corners, uv=uv)


def _ball(n: int, rng: np.random.Generator, skin: float = 1 / 3) -> NDArray[np.float64]:
    d = rng.standard_normal((n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True) * rng.random((n, 1)) ** skin
