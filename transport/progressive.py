"""Render until it is good enough: a number of samples, a noise, or a time, whichever comes first."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from materials.foundation.checks import check_range
from materials.foundation.progress import gauge

from .render import Exposure, Rendering

_MOST = 1 << 20


@dataclass(frozen=True)
class Goal:
    """When to stop.

    Attributes
    ----------
    samples : int
        Per pixel, at most.
    noise : float or None
        `relative_noise` that is enough.
    seconds : float or None
        Time that may be spent, over all runs that a picture took.
    """

    samples: int = _MOST
    noise: float | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        check_range("samples", self.samples, f"[1, {_MOST}]")
        if self.noise is not None:
            check_range("noise", self.noise, "(0, inf)")
        if self.seconds is not None:
            check_range("seconds", self.seconds, "(0, inf)")


@dataclass(frozen=True)
class Outcome:
    """A picture, its `relative_noise`, the seconds it took over all runs, and which part of its goal it reached."""

    rendering: Rendering
    noise: float
    seconds: float
    reached: str


def relative_noise(picture: Rendering) -> float:
    """Return the root mean square of the pixels' relative standard errors.

    A pixel's is the root of its variance over its radiance, both as means over the channels; a tenth of the picture's mean
    is added to the radiance (in squares), so that black does not divide. As `Rendering.variance` is an upper estimate, so
    is this.
    """
    light = picture.radiance.mean(axis=-1, dtype=np.float64)
    variance = picture.variance.mean(axis=-1, dtype=np.float64)
    floor = 0.1 * light.mean()
    if floor <= 0:
        return 0.0
    return float(np.sqrt(np.mean(variance / (light * light + floor * floor))))


def next_look(samples: int) -> int:
    """Return the count of samples at which the noise is looked at next: a quarter more, in steps of 4.

    It depends on the samples alone: a run that was interrupted stops where one that was not does.
    """
    return samples + 4 * max(1, samples // 16)


def develop(
    exposure: Exposure,
    goal: Goal,
    label: str = "rendering",
    spent: float = 0.0,
    keep: Callable[[float], None] | None = None,
    keep_every: float = 60.0,
) -> Outcome:
    """Expose until the goal is reached.

    Parameters
    ----------
    exposure : Exposure
        New, or one that goes on.
    spent : float
        Seconds that earlier runs spent on it.
    keep : callable, optional
        Called with the seconds spent so far, every `keep_every` seconds and before an interrupt leaves this function:
        it is to store what has been gathered.

    Notes
    -----
    With samples or a noise for a goal the picture is the same to the bit on any machine, however often it was interrupted.
    With seconds its samples depend on the machine, and some rows may have one step more than others.
    """
    clock = _Clock(exposure, goal, spent)
    kept = time.perf_counter()
    noise = np.inf
    try:
        with gauge(label) as show:
            while True:
                if goal.noise is not None and _is_look(exposure):
                    noise = relative_noise(exposure.rendering())
                    if noise <= goal.noise:
                        return Outcome(exposure.rendering(), noise, clock.spent, "noise")
                if exposure.samples >= goal.samples:
                    return _outcome(exposure, clock, "samples")
                for band, then in exposure.steps(min(_look(exposure), goal.samples)):
                    if goal.seconds is not None and exposure.samples and clock.spent >= goal.seconds:
                        return _outcome(exposure, clock, "seconds")
                    exposure.expose(band, then)
                    show(*clock.words(noise))
                    if keep is not None and time.perf_counter() - kept > keep_every:
                        keep(clock.spent)
                        kept = time.perf_counter()
    except KeyboardInterrupt:
        if keep is not None:
            keep(clock.spent)
        raise


def _look(exposure: Exposure) -> int:
    """Return the next look of a picture of which some rows may have been on their way to it already."""
    look = 0
    while look <= exposure.samples or look < exposure.done.max():
        look = next_look(look)
    return look


def _is_look(exposure: Exposure) -> bool:
    """Return whether all rows are where one looks; else a run that goes on might stop where another does not look."""
    look = 0
    while look < exposure.samples:
        look = next_look(look)
    return look > 0 and bool(np.all(exposure.done == look))


def _outcome(exposure: Exposure, clock: _Clock, reached: str) -> Outcome:
    picture = exposure.rendering()
    return Outcome(picture, relative_noise(picture), clock.spent, reached)


class _Clock:
    """Time spent, and what is left of it, judged by the steps taken since the first, which may have had to compile."""

    def __init__(self, exposure: Exposure, goal: Goal, spent: float) -> None:
        self._exposure, self._goal, self._before, self._start = exposure, goal, spent, time.perf_counter()
        self._first: tuple[float, float] | None = None

    @property
    def spent(self) -> float:
        return self._before + time.perf_counter() - self._start

    def words(self, noise: float) -> tuple[float, str]:
        """Return the share that is done, and what is known besides."""
        now, mean = time.perf_counter(), float(self._exposure.done.mean())
        if self._first is None:
            self._first = now, mean
        since, gained = now - self._first[0], mean - self._first[1]
        per_sample = since / gained if gained > 0 and since > 0.5 else None
        left = seconds_left(self._goal, mean, noise, self.spent, per_sample)
        words = f"{int(mean)} samples" + ("" if noise == np.inf else f", noise {noise:.4f}")
        if left is None:
            return 0.0, words
        return self.spent / max(self.spent + left, 1e-9), f"{words}, about {left:.0f} s left"


def seconds_left(goal: Goal, samples: float, noise: float, spent: float, per_sample: float | None) -> float | None:
    """Return an estimate of the time left; None while there is nothing to estimate it from.

    Parameters
    ----------
    samples, noise, spent : float
        So far; the noise at its last look, infinite before the first. It falls as the root of the samples.
    per_sample : float or None
        Seconds that one more sample per pixel takes.
    """
    ends = [] if goal.seconds is None else [max(goal.seconds - spent, 0.0)]
    if per_sample is not None:
        if goal.samples < _MOST:
            ends.append(max(goal.samples - samples, 0.0) * per_sample)
        if goal.noise is not None and noise < np.inf:
            # Stops happen at looks, a quarter of the samples apart.
            needed = samples * (noise / goal.noise) ** 2
            ends.append(max(min(needed, _MOST) - samples, 0.0) * per_sample)
    return min(ends) if ends else None
