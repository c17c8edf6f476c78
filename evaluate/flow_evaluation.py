"""Compare flow fields with each other and with the truth, frame by frame; what `flow-eval` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from scene.flow_files import Flow, as_flow, read_flow, read_uncertainty, write_flow
from scene.images import read_raw, write_raw

from .flow_colour import scale_of, with_legend
from .flow_inputs import Case, check_size, read_mask
from .flow_metrics import DEFINITIONS, DFE_CLASSES, Difference, Score, difference_of, endpoint_error, pooled, regions, score_regions
from .plots import save_box_plot, save_class_bars, save_difference_histogram, save_error_map
from .report import Report, Table

_SCORES = (
    "pixels",
    "density",
    "epe",
    "epe_sd",
    "epe_median",
    "angular_error",
    "fl_all",
    "over_1px",
    "over_3px",
    "over_5px",
    "wauc",
)
_HD1K = ("within_1_sigma", "within_3_sigma", "epe_beyond_sigma")
# Pictures of so many frames go into the report; the folder has all.
_SHOWN = 3
# Of each frame so many errors are kept for box plots and histograms, drawn evenly.
_KEPT = 200_000

Estimate = Callable[[NDArray, NDArray], NDArray[np.float32]]


@dataclass
class Results:
    """What has been measured so far.

    Attributes
    ----------
    scores : dict of (method, region) to list of (frame, Score)
    differences : dict of frame to the errors (N,) between the first and the second method
    errors : dict of method to a list of end-point errors per frame
    pictures : dict of caption to file
    """

    scores: dict[tuple[str, str], list[tuple[str, Score]]] = field(default_factory=dict)
    differences: dict[str, NDArray] = field(default_factory=dict)
    errors: dict[str, list[NDArray]] = field(default_factory=dict)
    pictures: dict[str, Path] = field(default_factory=dict)


def evaluate_flow(
    cases: Sequence[Case],
    folder: Path,
    methods: Mapping[str, Estimate] | None = None,
    names: tuple[str, str] = ("A", "B"),
    sigma_scale: float | None = None,
    largest: float | None = None,
) -> Report:
    """Evaluate all cases, write fields and pictures below a folder, and return the report.

    Parameters
    ----------
    cases : sequence of Case
        From `flow_inputs.match`.
    folder : path
        Gets `flow/METHOD/` (if estimated here) and `pictures/`.
    methods : mapping of name to algorithm, optional
        A and B are then pictures, and each algorithm estimates the flow from A to B. Without, A and B are two fields.
    names : (str, str)
        What to call the two fields.
    sigma_scale : float, optional
        Of the uncertainties, see `read_uncertainty`.
    largest : float, optional
        Length at which the colours of flow are saturated, and error at the end of the error maps' scale [px].

    Raises
    ------
    InputError
        If a file cannot be used, sizes differ, or nothing is known both in the truth and in a field, or in both fields.
    """
    results = Results()
    for index, case in enumerate(tracked(cases, "frames", len(cases))):
        fields = _fields(case, folder, methods, names)
        size = next(iter(fields.values())).size
        truth = None
        if "truth" in case.files:
            truth = read_flow(case.files["truth"])
            check_size(truth, case.files["truth"], size, f"the flow of {case.name}")
            _score_case(case, fields, truth, results, sigma_scale)
        if methods is None:
            _difference_case(case, fields, results)
        _pictures(case, fields, truth, folder / "pictures", results, largest, shown=index < _SHOWN)
    _check_known(results, methods is None)
    return _report(cases, results, folder, methods, names)


def _fields(case: Case, folder: Path, methods: Mapping[str, Estimate] | None, names: tuple[str, str]) -> dict[str, Flow]:
    if methods is None:
        fields = {name: read_flow(case.files[role]) for name, role in zip(names, "ab", strict=True)}
        check_size(fields[names[1]], case.files["b"], fields[names[0]].size, names[0])
        return fields
    first, second = read_raw(case.files["a"]), read_raw(case.files["b"])
    fields = {}
    for name, estimate in methods.items():
        try:
            fields[name] = as_flow(estimate(first, second))
        except InputError as error:
            raise error.at(file=f"{case.files['a']}, {case.files['b']}") from error
        write_flow(folder / "flow" / name / f"{case.name}.flo", fields[name])
    return fields


def _score_case(case: Case, fields: Mapping[str, Flow], truth: Flow, results: Results, sigma_scale: float | None) -> None:
    read = {role: read_mask(path, truth.size, role) for role, path in case.files.items() if _is_mask(role)}
    others = {role.removeprefix("region "): mask for role, mask in read.items() if role.startswith("region ")}
    sigma = None
    if "uncertainty" in case.files:
        if sigma_scale is None:
            raise InputError(
                "be given with --uncertainty", key="--uncertainty-scale", remedy="It says how px are stored: stored / scale."
            )
        sigma = read_uncertainty(case.files["uncertainty"], sigma_scale)
        if sigma.shape != truth.size:
            raise InputError("have the size of the flow", got=sigma.shape, file=case.files["uncertainty"])
    masks = regions(read.get("visible"), read.get("masks"), others)
    for name, flow in fields.items():
        for region, score in score_regions(flow, truth, masks, sigma).items():
            results.scores.setdefault((name, region), []).append((case.name, score))
        error = endpoint_error(flow, truth)
        results.errors.setdefault(name, []).append(_thinned(error[np.isfinite(error)]))


def _difference_case(case: Case, fields: Mapping[str, Flow], results: Results) -> None:
    one, two = fields.values()
    error = endpoint_error(one, two)
    if "region compared" in case.files:
        error = error[read_mask(case.files["region compared"], one.size, "region compared")]
    results.differences[case.name] = error[np.isfinite(error)]


def _check_known(results: Results, fields: bool) -> None:
    for (name, region), scores in results.scores.items():
        if not any(score.pixels for _, score in scores):
            what = "known truth" if region == "all" else f"a pixel of the region {region} with known truth"
            raise InputError(f"have {what} in at least one frame", got="none", key=f"the flow of {name}")
    if fields and not any(len(e) for e in results.differences.values()):
        raise InputError("be known somewhere in both fields", got="nowhere", key="the flow")


def _pictures(
    case: Case, fields: Mapping[str, Flow], truth: Flow | None, folder: Path, results: Results, largest: float | None, shown: bool
) -> None:
    known = [*fields.values(), *([truth] if truth is not None else [])]
    scale = largest or scale_of(*known)

    def keep(path: Path, caption: str) -> None:
        if shown:
            results.pictures[caption] = path

    for name, flow in [*fields.items(), *([("truth", truth)] if truth is not None else [])]:
        path = folder / f"{case.name}_{name}.png"
        write_raw(path, with_legend(flow, scale))
        keep(path, f"{case.name}: flow, {name}")
    pairs: list[tuple[str, str, Flow, Flow]] = []
    if truth is not None:
        pairs += [(name, f"end-point error of {name}", flow, truth) for name, flow in fields.items()]
    elif len(fields) == 2:
        (a, one), (b, two) = fields.items()
        pairs.append(("difference", f"difference flow error of {a} and {b}", one, two))
    errors = [endpoint_error(one, two) for _, _, one, two in pairs]
    # One scale for all, so that equal colours are equal errors whoever made them.
    tops = [float(np.percentile(e[np.isfinite(e)], 95)) for e in errors if np.isfinite(e).any()]
    top = largest or max([*tops, 0.05])
    for (name, words, _, _), error in zip(pairs, errors, strict=True):
        path = folder / f"{case.name}_{name}_error.png"
        save_error_map(path, error, top, f"{case.name}: {words}")
        keep(path, f"{case.name}: {words}")


def _report(
    cases: Sequence[Case], results: Results, folder: Path, methods: Mapping[str, Estimate] | None, names: tuple[str, str]
) -> Report:
    tables: list[Table] = []
    summary = {key: pooled([score for _, score in scores]) for key, scores in results.scores.items()}
    if summary:
        has_sigma = any(score.within_1_sigma is not None for score in summary.values())
        columns = _SCORES + (_HD1K if has_sigma else ())
        rows = [[m, r, *(getattr(s, c) for c in columns)] for (m, r), s in summary.items()]
        note = (
            "" if len(cases) == 1 else f"Over {len(cases)} frames: means over all their pixels; the median is that of the frames."
        )
        tables.append(Table("scores", "Against the truth", ("flow", "region", *columns), rows, note))
        if len(cases) > 1:
            rows = [
                [frame, m, r, *(getattr(score, c) for c in columns)]
                for (m, r), scores in results.scores.items()
                for frame, score in scores
            ]
            tables.append(Table("scores_per_frame", "Against the truth, per frame", ("frame", "flow", "region", *columns), rows))
    if results.differences:
        everything = np.concatenate(list(results.differences.values()))
        listed = [("all", difference_of(everything))] if len(cases) > 1 else []
        listed += [(frame, difference_of(errors)) for frame, errors in results.differences.items() if len(errors)]
        columns = ("frame", "pixels", "dfe", "dfe_sd", "dfe_median", *DFE_CLASSES)
        rows = [[frame, *_difference_cells(d)] for frame, d in listed]
        tables.append(Table("difference", f"Difference of {names[0]} and {names[1]}", columns, rows))
        path = folder / "pictures" / "difference_histogram.png"
        save_difference_histogram(
            path, {f"{names[0]} - {names[1]}": everything}, "difference flow error, with the bounds of its classes"
        )
        results.pictures["How the difference flow error is distributed"] = path
        path = folder / "pictures" / "difference_classes.png"
        save_class_bars(path, {frame: d.classes for frame, d in listed[:20]}, "classes of the difference flow error")
        results.pictures["Classes of the difference flow error"] = path
    if results.errors:
        path = folder / "pictures" / "error_boxes.png"
        save_box_plot(path, {name: np.concatenate(errors) for name, errors in results.errors.items()}, "end-point error")
        results.pictures["End-point error: quartiles, whiskers to 1.5 of their distance, mean as triangle"] = path
    paragraphs = [_what_was_done(cases, methods, names)]
    if len(cases) > _SHOWN:
        paragraphs.append(f"Pictures of the first {_SHOWN} of {len(cases)} frames are shown; the folder pictures/ has all.")
    used = {c for t in tables for c in t.columns}
    definitions = {name: text for name, text in DEFINITIONS.items() if name in used}
    metrics: dict[str, Any] = {"frames": [c.name for c in cases]}
    return Report("Optical flow", paragraphs, tables, results.pictures, definitions, metrics)


def _difference_cells(d: Difference) -> list[float | int]:
    return [d.pixels, d.mean, d.sd, d.median, *d.classes]


def _what_was_done(cases: Sequence[Case], methods: Mapping[str, Estimate] | None, names: tuple[str, str]) -> str:
    frames = f"{len(cases)} frame{'s' if len(cases) > 1 else ''}"
    truth = "scored against the truth" if "truth" in cases[0].files else "without a truth to score against"
    if methods is not None:
        return f"The flow of {frames} by {', '.join(methods)}, {truth}."
    return f"{names[0]} and {names[1]} over {frames}, compared with each other, {truth}."


def _is_mask(role: str) -> bool:
    return role in ("masks", "visible") or role.startswith("region ")


def _thinned(errors: NDArray) -> NDArray:
    return errors[:: max(1, -(-len(errors) // _KEPT))]
