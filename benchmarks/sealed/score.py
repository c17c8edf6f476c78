"""Diagnoses held against the answers: was each effect named, was nothing invented, was the place right?"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Names that count as one answer, since such data cannot part them.
EQUAL = (
    {"participating_medium", "height_fog"},
    {"specular_lobe", "fresnel_grazing", "long_tail_lobe"},
    {"surface_wetness", "water_film"},
)
# An effect comes with at most two others that it cannot be told from; a longer list would name everything.
_LARGEST_SET = 3


@dataclass(frozen=True)
class Verdict:
    """How one recording was diagnosed.

    Attributes
    ----------
    kind : str
        "null", "single", "pair" or "unlisted".
    exact : bool
        All true effects named first, and no other; of a null, `consistent`; of an unlisted one, that it stays unexplained.
    in_sets : bool
        The same with `ambiguous_with` counted as named.
    """

    trial: str
    kind: str
    wanted: tuple[str, ...]
    named: tuple[str, ...]
    verdict: str
    exact: bool
    in_sets: bool
    overlap: float
    chi2: tuple[float | None, float | None]
    seconds: float
    failure: str = ""


def judge(trial: str, answer: dict, affected: NDArray[np.bool_], folder: Path, seconds: float, failure: str = "") -> Verdict:
    """Compare what `diagnose` wrote into a folder with the answer."""
    wanted = tuple(e["id"] for e in answer["effects"])
    unlisted = any(id.startswith("unlisted:") for id in wanted)
    kind = "unlisted" if unlisted else ("null", "single", "pair")[min(len(wanted), 2)]
    if failure:
        return Verdict(trial, kind, wanted, (), "failed", False, False, 0.0, (None, None), seconds, failure)
    found = json.loads((folder / "diagnosis.json").read_text())
    sets = [{e["id"], *e.get("ambiguous_with", [])} for e in found["effects"]]
    named = tuple(e["id"] for e in found["effects"])
    if kind == "null":
        exact = in_sets = found["verdict"] == "consistent" and not named
    elif kind == "unlisted":
        exact = in_sets = found["verdict"] in ("unexplained", "partly_explained")
    else:
        exact = all(is_named(w, named) for w in wanted) and all(is_named(n, wanted) for n in named)
        small = all(len(s) <= _LARGEST_SET for s in sets) and len(sets) <= len(wanted)
        in_sets = exact or (small and all(any(is_named(w, s) for s in sets) for w in wanted))
    with np.load(folder / "affected.npz") as arrays:
        overlap = intersection_over_union(arrays["affected"], affected)
    held = found.get("held_out", {})
    chi2 = (held.get("chi2_per_pixel_before"), held.get("chi2_per_pixel_after"))
    return Verdict(trial, kind, wanted, named, found["verdict"], exact, in_sets, overlap, chi2, seconds)


def is_named(id: str, others: tuple[str, ...] | set[str]) -> bool:
    """Return whether an id, or one that counts as the same answer, is among others."""
    return id in others or any(id in group and group & set(others) for group in EQUAL)


def intersection_over_union(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Return |a and b| / |a or b|; 1 if both are empty."""
    union = int((a | b).sum())
    return 1.0 if union == 0 else float((a & b).sum() / union)


def table(verdicts: list[Verdict]) -> str:
    """Return every trial as a row of a Markdown table, failures included."""

    def number(value: float | None) -> str:
        return "–" if value is None else f"{value:.2f}"

    rows = [
        "| trial | left out | verdict | named | right | IoU | held-out χ² before → after | s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for v in verdicts:
        right = "yes" if v.exact else ("in a set" if v.in_sets else "NO")
        cells = [v.trial, ", ".join(v.wanted) or "nothing", v.failure or v.verdict, ", ".join(v.named) or "–", right]
        cells += [f"{v.overlap:.2f}", f"{number(v.chi2[0])} → {number(v.chi2[1])}", f"{v.seconds:.0f}"]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def confusion(verdicts: list[Verdict]) -> tuple[list[str], list[str], NDArray[np.int64]]:
    """Return (left out, named, counts): rows are trials with one thing left out or nothing, columns what was named first."""
    single = [v for v in verdicts if v.kind != "pair"]

    def said(v: Verdict) -> str:
        return v.named[0] if v.named else v.verdict

    rows = sorted({v.wanted[0] if v.wanted else "nothing" for v in single})
    columns = sorted({said(v) for v in single}, key=lambda c: (c not in rows, c))
    counts = np.zeros((len(rows), len(columns)), np.int64)
    for v in single:
        counts[rows.index(v.wanted[0] if v.wanted else "nothing"), columns.index(said(v))] += 1
    return rows, columns, counts


def plot_confusion(verdicts: list[Verdict], path: Path) -> None:
    """Draw the confusion matrix; right answers lie where a row meets the column of its name."""
    from matplotlib.figure import Figure

    rows, columns, counts = confusion(verdicts)
    figure = Figure(figsize=(3 + 0.3 * len(columns), 2 + 0.26 * len(rows)), layout="constrained")
    axes = figure.subplots()
    axes.imshow(counts, cmap="Blues", aspect="auto", vmin=0)
    for (i, j), count in np.ndenumerate(counts):
        if count:
            axes.text(
                j, i, str(count), ha="center", va="center", color="black" if count <= counts.max() / 2 else "white", fontsize=8
            )
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.set(xlabel="named first, or the verdict where nothing was named", ylabel="left out")
    figure.savefig(path, dpi=110)
