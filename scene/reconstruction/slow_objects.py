"""Slow traffic, which never leaves its own place within a recording, so that no beam sees through it: told by its motion.

Each sweep's things (points above the ground, connected as seen from above) are laid onto the sweep two further on, and two
back, by the level translation that fits best. A thing moves if it fits the other sweep clearly better moved than unmoved.
Only plan positions count: a scanner's rings lie at other heights on a standing face when the scanner has moved, and would
otherwise seem to move along with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from materials.foundation.progress import tracked

from .dynamics import things

Floats = NDArray[np.floating]

# Sweeps that are compared lie so far apart: at 10 per second, traffic at walking pace moves by 0.3 m.
_APART = 2
# From further apart a standing thing shows other sides and hides behind others [m].
_BASELINE = 4.0
# Things of a pedestrian to a lorry with its trailer [points, m].
_FEWEST, _LONGEST = 40, 20.0
# Registration and edges: places within this distance agree [m].
_AGREE = 0.12
# Share of a thing that must agree when moved; how much more than unmoved; and what part of the disagreement may be left. A
# lorry's side agrees with itself either way, so that only a tenth of it, its back, may tell.
_FIT, _GAIN, _LEFT = 0.7, 0.08, 0.4
_WITNESSES = 2  # sweeps of a track that must have a verdict
_LEAST_MOTION = 0.1  # between the sweeps compared [m]
_STEPS = np.arange(-3.0, 3.01, 0.1)  # tried along the drive and across it [m]
_NEAR = 0.5  # places further apart do not belong together [m]
_CELL, _SAMPLES = 0.1, 300


@dataclass(frozen=True)
class _Motion:
    """How a thing of one sweep lies in another: the translation, and which of the other's things holds most of it."""

    moves: bool
    step: NDArray[np.float64]
    target: int


def slowly_moving(
    points_world: Floats, sweep_of_point: NDArray[np.integer], above: Floats, path_world: Floats, farthest: float = 50.0
) -> NDArray[np.bool_]:
    """Return which points belong to things that move from sweep to sweep.

    Parameters
    ----------
    points_world : (N, 3) float64
    sweep_of_point : (N,) int
        Index of the sweep that each point came from, in order of time.
    above : (N,) float
        Height above the ground [m].
    path_world : (P, 3) float
        The scanner's place in each sweep [m].
    farthest : float
        Things beyond this distance from their scanner are too thinly sampled to tell [m].

    Notes
    -----
    A thing's verdict is that of the majority of its track through the sweeps, so that a single sweep's failure leaves no
    remnant. What is seen only along its own side, a long wall of a lorry, cannot be told from a standing wall. Sweeps taken
    more than 4 m apart are not compared.
    """
    out = np.zeros(len(points_world), bool)
    count = len(path_world)
    if count <= _APART:
        return out
    sweeps = [_things_of(i, points_world, sweep_of_point, above, path_world, farthest) for i in range(count)]
    direction = path_world[-1, :2] - path_world[0, :2]
    length = float(np.linalg.norm(direction))
    direction = direction / length if length > 0.5 else np.array([1.0, 0.0])
    found: dict[tuple[int, int], list[_Motion]] = {}
    tracks = _Tracks()
    for i in tracked(range(count), "slow traffic", count):
        members, label = sweeps[i]
        for j in (i - _APART, i + _APART):
            if not 0 <= j < count or len(sweeps[j][0]) == 0 or np.linalg.norm(path_world[j] - path_world[i]) > _BASELINE:
                continue
            xy = points_world[sweeps[j][0], :2]
            tree = cKDTree(xy)
            for id in np.unique(label):
                motion = _laid_onto(points_world[members[label == id], :2], tree, sweeps[j][1], direction)
                if motion is not None:
                    found.setdefault((i, int(id)), []).append(motion)
                    tracks.join((i, int(id)), (j, motion.target))
    votes: dict[tuple[int, int], list[bool]] = {}
    for thing, motions in found.items():
        # Forth and back, what moves steadily moves by opposite steps.
        moves = all(m.moves for m in motions)
        if len(motions) == 2:
            a, b = motions[0].step, motions[1].step
            moves &= bool(np.linalg.norm(a + b) < 0.5 * max(np.linalg.norm(a), np.linalg.norm(b)))
        votes.setdefault(tracks.root(thing), []).append(moves)
    moving = {track for track, given in votes.items() if len(given) >= _WITNESSES and np.mean(given) > 0.5}
    for i, (members, label) in enumerate(sweeps):
        gone = [id for id in np.unique(label) if tracks.root((i, int(id))) in moving]
        out[members[np.isin(label, gone)]] = True
    return out


def _things_of(i: int, points: Floats, sweep_of_point, above: Floats, path: Floats, farthest: float):
    """Return the points of a sweep's things and the number of the thing that each belongs to."""
    reach = np.linalg.norm(points[:, :2] - path[i, :2], axis=1)
    members = np.flatnonzero((sweep_of_point == i) & (above > 0.25) & (above < 4.5) & (reach < farthest))
    if len(members) == 0:
        return members, np.zeros(0, np.int64)
    label = things(points[members])
    size = np.bincount(label)
    keep = size >= _FEWEST
    for id in np.flatnonzero(keep):
        keep[id] = np.ptp(points[members[label == id], :2], axis=0).max() < _LONGEST
    chosen = keep[label]
    return members[chosen], label[chosen]


def _laid_onto(xy: Floats, tree: cKDTree, labels: NDArray[np.integer], direction: NDArray[np.float64]) -> _Motion | None:
    """Fit a thing to another sweep by translation: along the drive or across it, then freely."""
    # One point per cell: near parts, which a scanner samples densely, must not outvote the rest.
    _, first = np.unique(np.floor(xy / _CELL).astype(np.int64), axis=0, return_index=True)
    xy = xy[first[:: max(1, len(first) // _SAMPLES)]]
    still = tree.query(xy)[0]
    # Not from the unmoved place by nearest points alone: a lorry's side meets itself there, and holds the rest back.
    across = np.array([-direction[1], direction[0]])
    tried = np.concatenate([np.outer(_STEPS, direction), np.outer(_STEPS, across)])
    away = tree.query((xy + tried[:, None]).reshape(-1, 2), distance_upper_bound=_NEAR)[0].reshape(len(tried), -1)
    step = tried[np.minimum(away, _NEAR).mean(axis=1).argmin()]
    for _ in range(5):
        away, nearest = tree.query(xy + step)
        good = away <= max(float(np.quantile(away, 0.7)), 0.02)
        step = step + (tree.data[nearest[good]] - xy[good] - step).mean(axis=0)
    away, nearest = tree.query(xy + step)
    best, unmoved = float((away < _AGREE).mean()), float((still < _AGREE).mean())
    if max(best, unmoved) < _FIT:
        return None
    moves = best > unmoved + _GAIN and 1 - best < _LEFT * (1 - unmoved) and float(np.linalg.norm(step)) > _LEAST_MOTION
    return _Motion(moves, step, int(np.bincount(labels[nearest[away < _AGREE]], minlength=1).argmax()))


class _Tracks:
    """Things of several sweeps joined into tracks (union-find)."""

    def __init__(self) -> None:
        self._parent: dict[tuple[int, int], tuple[int, int]] = {}

    def root(self, thing: tuple[int, int]) -> tuple[int, int]:
        while (parent := self._parent.get(thing, thing)) != thing:
            thing = parent
        return thing

    def join(self, a: tuple[int, int], b: tuple[int, int]) -> None:
        self._parent[self.root(a)] = self.root(b)
