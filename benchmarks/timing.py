"""Fair timing of two programs on one machine: alternating runs, so that a slow minute of the machine hits both."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Paired:
    """Outcome of an alternating measurement.

    Attributes
    ----------
    ours, theirs : float
        Medians [s].
    ratio : float
        Ratio of the medians, ours / theirs.
    runs : int
        Measured runs of each; one of each before them was not counted.
    """

    ours: float
    theirs: float
    ratio: float
    runs: int


def paired(ours: Callable[[], object], theirs: Callable[[], object], runs: int = 5) -> Paired:
    """Time two functions in turn.

    The first run of each warms caches and compilers and is not counted. The order changes from round to round, since
    the second of a pair finds a warmer machine.
    """
    assert runs > 0
    ours()
    theirs()
    mine: list[float] = []
    others: list[float] = []
    for i in range(runs):
        pair = [(ours, mine), (theirs, others)]
        for function, times in pair if i % 2 == 0 else reversed(pair):
            times.append(seconds(function))
    a, b = statistics.median(mine), statistics.median(others)
    return Paired(a, b, a / b, runs)


def seconds(function: Callable[[], object]) -> float:
    """Return how long one call takes [s]."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start
