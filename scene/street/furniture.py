"""Lamp posts, signs at the crossing, bollards and bins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh, join
from .solids import box, moved, pose, tube

Floats = NDArray[np.floating]


def lamp_post(foot: Floats, towards: float) -> dict[str, Mesh]:
    """Return a lamp post 6.2 m high whose arm reaches 1.4 m to `towards` (+1 or -1 along y)."""
    s = np.linspace(0, 1, 12)
    arm = np.column_stack([0 * s, towards * 1.4 * s, 6.2 + 0.35 * np.sin(s * np.pi / 2)])
    steel = [
        tube(foot + np.array([[0, 0, -0.1], [0, 0, 1.1]]), [0.085, 0.085], sides=16),
        tube(foot + np.array([[0, 0, 1.1], [0, 0, 1.16], [0, 0, 6.2]]), [0.085, 0.06, 0.05], sides=16),
        tube(foot + arm, np.linspace(0.045, 0.03, 12), sides=12),
    ]
    end = foot + arm[-1]
    head = box(end + [-0.14, -0.32, -0.03], end + [0.14, 0.32, 0.07])
    pane = box(end + [-0.11, -0.28, -0.05], end + [0.11, 0.28, -0.03])
    return {"steel": join([*steel, head]), "lamp_pane": pane}


def crossing_sign(foot: Floats, facing: float) -> dict[str, Mesh]:
    """Return a blue square sign on a post; it faces -x for `facing` = -1."""
    post = tube(foot + np.array([[0, 0, -0.1], [0, 0, 2.75]]), [0.03, 0.03], sides=12)
    x = facing * 0.035
    low, high = sorted([x, x + facing * 0.012])
    plate = box(foot + [low, -0.3, 2.1], foot + [high, 0.3, 2.7])
    front = x + facing * 0.013
    low, high = sorted([front, front + facing * 0.002])
    mark = box(foot + [low, -0.16, 2.2], foot + [high, 0.16, 2.55])
    return {"steel": post, "sign_blue": plate, "sign_white": mark}


def bin_(foot: Floats, yaw: float) -> dict[str, Mesh]:
    """Return a wheeled bin 1.05 m high."""
    body = box((-0.28, -0.33, 0.04), (0.28, 0.33, 0.95))
    lid = box((-0.31, -0.36, 0.95), (0.31, 0.36, 1.03))
    T = pose(float(foot[0]), float(foot[1]), float(foot[2]), yaw)
    wheels = [tube(np.array([[x, 0.30, 0.1], [x + 0.06, 0.30, 0.1]]), [0.1, 0.1], sides=14) for x in (-0.3, 0.24)]
    return {"bin_green": moved(join([body, lid]), T), "rubber": moved(join(wheels), T)}
