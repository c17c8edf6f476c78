"""What chapter 5 of the thesis concludes, each sentence as a number with the range in which it holds, and its interval.

Scenes are drawn again, with all of their pixels and materials: pixels of one scene are no independent witnesses. A sentence
holds if the whole interval lies within its range, and does not if none of it does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .flow_errors import ANGLE_EDGES, FlowErrors
from .virtual_materials import REFERENCE

Floats = NDArray[np.float64]

METALS, STRUCTURED = ("copper", "alu"), ("leather", "fabric")
_MATTE, _FRESNEL = ("carpet", "felt", "wallpaper"), ("stone", "wood")
_DRAWS = 2000
_FEWEST = 4  # scenes, below which drawing them again tells nothing
_HOLDS, _FAILS, _OPEN = "holds", "does not hold", "cannot be told"
_ABOVE = math.inf
# "Virtually identical" in the thesis's classes of the difference flow error (4.3.3).
_IDENTICAL_PX = 0.05
Reading = Callable[["Drawn"], Floats]


class Case(NamedTuple):
    """What flow errors belong to."""

    sample: str
    variant: str
    algorithm: str


@dataclass(frozen=True)
class Verdict:
    """A sentence, what was measured for it, and whether it holds; the interval is at 95 %."""

    sentence: str
    algorithm: str
    measure: str
    thesis: str
    value: float
    low: float
    high: float
    holds_within: tuple[float, float]

    @property
    def word(self) -> str:
        """`holds`, `does not hold`, or `cannot be told`."""
        least, most = self.holds_within
        if least <= self.low and self.high <= most:
            return _HOLDS
        return _FAILS if self.high < least or self.low > most else _OPEN


class Drawn:
    """Averages over scenes, as they are (first) and drawn again.

    Parameters
    ----------
    errors : dict
        One record per scene for each case.
    rng : numpy.random.Generator
    """

    def __init__(self, errors: dict[Case, list[FlowErrors]], rng: np.random.Generator) -> None:
        self._errors = errors
        self.scenes = len(next(iter(errors.values())))
        draws = rng.multinomial(self.scenes, np.full(self.scenes, 1 / self.scenes), _DRAWS)
        self.weights = np.concatenate([np.ones((1, self.scenes)), draws])

    def mean(self, samples: Sequence[str], variant: str, algorithm: str) -> Floats:
        """Return the mean end-point error (1 + draws,) [px]; samples and scenes count alike."""
        return self._average([self._of(sample, variant, algorithm, "mean") for sample in samples])

    def median(self, samples: Sequence[str], variant: str, algorithm: str) -> Floats:
        """Return the mean over samples and scenes of the median error [px]."""
        return self._average([self._of(sample, variant, algorithm, "median") for sample in samples])

    def gap(self, samples: Sequence[str], variant: str, algorithm: str) -> Floats:
        """Return by how much the mean error differs from that on the BTF, scene by scene and sample by sample [px]."""
        pairs = [(self._of(s, variant, algorithm, "mean"), self._of(s, REFERENCE, algorithm, "mean")) for s in samples]
        return self._average([np.abs(one - other) for one, other in pairs])

    def kept_rank(self, samples: Sequence[str], variants: Sequence[str], one: str, other: str) -> Floats:
        """Return the share of scenes and samples where the better of two algorithms is the same one as on the BTF."""
        out = []
        for s in samples:
            sign = np.sign(self._of(s, REFERENCE, one, "mean") - self._of(s, REFERENCE, other, "mean"))
            for v in variants:
                out.append((np.sign(self._of(s, v, one, "mean") - self._of(s, v, other, "mean")) == sign).astype(float))
        return self._average(out)

    def at_angles(self, samples: Sequence[str], algorithm: str, kind: str, low: float, high: float) -> Floats:
        """Return the mean error on the BTF between two angles of a kind (`mirror` or `view`) [px], over all vectors there."""
        inside = (ANGLE_EDGES[:-1] >= low) & (ANGLE_EDGES[1:] <= high)
        total, count = np.zeros(self.scenes), np.zeros(self.scenes)
        for sample in samples:
            for k, record in enumerate(self._errors[Case(sample, REFERENCE, algorithm)]):
                total[k] += getattr(record, f"{kind}_total")[inside].sum()
                count[k] += getattr(record, kind).counts.sum(axis=0)[inside].sum()
        with np.errstate(invalid="ignore", divide="ignore"):
            return (self.weights @ total) / (self.weights @ count)

    def _of(self, sample: str, variant: str, algorithm: str, what: str) -> Floats:
        records = self._errors[Case(sample, variant, algorithm)]
        return np.array([r.mean if what == "mean" else r.quantile(0.5) for r in records])

    def _average(self, values: list[Floats]) -> Floats:
        table = np.mean(values, axis=0)
        known = np.isfinite(table)
        with np.errstate(invalid="ignore"):
            return (self.weights[:, known] @ table[known]) / self.weights[:, known].sum(axis=1)


def verdicts(errors: dict[Case, list[FlowErrors]], rng: np.random.Generator) -> list[Verdict]:
    """Return the verdict on each sentence for which there are samples, models and algorithms."""
    drawn = Drawn(errors, rng)
    out = []
    for sentence, algorithm, measure, thesis, within, read in _sentences(list(errors)):
        values = read(drawn)
        low, high = math.nan, math.nan
        if drawn.scenes >= _FEWEST and np.isfinite(values[1:]).any():
            low, high = (float(q) for q in np.nanquantile(values[1:], (0.025, 0.975)))
        out.append(Verdict(sentence, algorithm, measure, thesis, float(values[0]), low, high, within))
    return out


Sentence = tuple[str, str, str, str, tuple[float, float], Reading]


def _sentences(cases: list[Case]) -> Iterator[Sentence]:
    samples = tuple(dict.fromkeys(c.sample for c in cases))
    models = [v for v in dict.fromkeys(c.variant for c in cases) if v != REFERENCE]
    algorithms = tuple(dict.fromkeys(c.algorithm for c in cases))
    bent = [v for v in models if v.endswith("N")]
    flat = [v for v in models if not v.endswith("N")]
    for a in algorithms:
        yield from _on_all(samples, flat, bent, a)
        yield from _on_some(samples, models, a)
    if "horn-schunck" in algorithms:
        for a in algorithms:
            if a != "horn-schunck":
                yield from _between(samples, flat, bent, "horn-schunck", a)


def _on_all(samples: Sequence[str], flat: Sequence[str], bent: Sequence[str], a: str) -> Iterator[Sentence]:
    def against(variants: Sequence[str]) -> Reading:
        return lambda d: np.mean([d.median(samples, v, a) for v in variants], axis=0) / d.median(samples, REFERENCE, a)

    def nearer(d: Drawn) -> Floats:
        return np.mean([d.gap(samples, v, a) for v in flat], axis=0) - np.mean([d.gap(samples, v, a) for v in bent], axis=0)

    ratio, basic = "median error, model over BTF", a == "horn-schunck"
    said = "1.25" if basic else "1.5"
    yield "Models without normals make flow harder than the BTF does", a, ratio, said, (1, _ABOVE), against(flat)
    yield "Models with normals give the errors of the BTF, within 10 %", a, ratio, "1 or a little more", (0.9, 1.1), against(bent)
    measure = "mean distance to the BTF's error, without normals less with [px]"
    yield "Normals bring errors nearer to the BTF's", a, measure, "> 0", (0, _ABOVE), nearer


def _on_some(samples: Sequence[str], models: Sequence[str], a: str) -> Iterator[Sentence]:
    matte, metals, structured, fresnel = ([s for s in group if s in samples] for group in (_MATTE, METALS, STRUCTURED, _FRESNEL))
    others = [s for s in samples if s not in METALS]
    if matte:

        def worst(d: Drawn) -> Floats:
            return np.max([np.abs(d.mean(matte, v, a) - d.mean(matte, REFERENCE, a)) for v in models], axis=0)

        measure = "largest difference of a model's mean error from the BTF's [px]"
        yield "On matte samples any model will do", a, measure, "virtually identical", (0, _IDENTICAL_PX), worst
    if metals and others:

        def harder(d: Drawn) -> Floats:
            return d.mean(metals, REFERENCE, a) / d.mean(others, REFERENCE, a)

        yield "Metals are the hardest", a, "mean error on the BTF, metals over others", "> 1", (1, _ABOVE), harder
    bent = [v for v in ("CTN", "WardN", "PhongN") if v in models]
    if metals and len(bent) > 1:

        def spread(d: Drawn) -> Floats:
            return np.ptp([d.mean(metals, v, a) for v in bent], axis=0) / d.mean(metals, REFERENCE, a)

        measure = "spread of CTN, WardN, PhongN over the BTF's mean error"
        yield "On metals, with normals, the choice of the model hardly matters (10 %)", a, measure, "almost 0", (0, 0.1), spread
    if metals:

        def about(d: Drawn) -> Floats:
            return d.at_angles(metals, a, "mirror", 0, 6) / d.at_angles(metals, a, "mirror", 15, 30)

        basic = a == "horn-schunck"
        sentence = "On metals errors are largest in the highlight" if basic else "On metals errors are largest beside the highlight"
        measure = "mean error on the BTF, 0 to 6 over 15 to 30 degrees from the mirror direction"
        yield sentence, a, measure, "> 1" if basic else "< 1", (1, _ABOVE) if basic else (0, 1), about
    if structured:
        yield from _on_structured(structured, models, a)
    if fresnel:

        def grazing(d: Drawn) -> Floats:
            return d.at_angles(fresnel, a, "view", 60, 90) / d.at_angles(fresnel, a, "view", 0, 45)

        measure = "mean error on the BTF of stone and wood, above 60 over below 45 degrees from the normal"
        yield "Grazing views alone do no harm", a, measure, "no apparent increase", (0, 1.1), grazing


def _on_structured(samples: Sequence[str], models: Sequence[str], a: str) -> Iterator[Sentence]:
    phong = [v for v in ("Phong", "PhongN") if v in models]
    better = [v for v in ("CTN", "WardN") if v in models]
    if phong:

        def easier(d: Drawn) -> Floats:
            return np.mean([d.mean(samples, v, a) for v in phong], axis=0) / d.mean(samples, REFERENCE, a)

        measure = "mean error on leather and fabric, Phong's over the BTF's"
        yield "On brushed, structured samples Phong's model makes flow too easy", a, measure, "< 1", (0, 1), easier
    if "PhongN" in phong and better:

        def nearer(d: Drawn) -> Floats:
            return d.gap(samples, "PhongN", a) - np.mean([d.gap(samples, v, a) for v in better], axis=0)

        measure = "distance to the BTF's error on leather and fabric, PhongN less CTN and WardN [px]"
        yield "There CTN and WardN are nearer to the BTF than PhongN", a, measure, "> 0", (0, _ABOVE), nearer

    def about(d: Drawn) -> Floats:
        return d.at_angles(samples, a, "mirror", 0, 9) / d.at_angles(samples, a, "mirror", 21, 60)

    measure = "mean error on the BTF of leather and fabric, 0 to 9 over 21 to 60 degrees from the mirror direction"
    yield "There errors are largest about the mirror direction", a, measure, "> 1", (1, _ABOVE), about


def _between(samples: Sequence[str], flat: Sequence[str], bent: Sequence[str], basic: str, a: str) -> Iterator[Sentence]:
    both = f"{basic}, {a}"

    def worse(d: Drawn) -> Floats:
        return d.median(samples, REFERENCE, basic) / d.median(samples, REFERENCE, a)

    yield "Horn and Schunck's method errs more", both, "median error on the BTF, ratio", "> 2", (1, _ABOVE), worse
    share = "share of scenes and samples"
    sentence = "Models with normals keep the rank of the algorithms (95 %)"
    yield sentence, both, share, "1", (0.95, 1), lambda d: d.kept_rank(samples, bent, basic, a)

    def gain(d: Drawn) -> Floats:
        return d.kept_rank(samples, bent, basic, a) - d.kept_rank(samples, flat, basic, a)

    yield "Without normals the rank is lost more often", both, f"{share}, with normals less without", "> 0", (0, _ABOVE), gain
