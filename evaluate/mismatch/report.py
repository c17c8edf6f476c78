"""The diagnosis as one HTML page that a person can read: pictures, figures, what was tried, what remains."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.files import replacing

from .case import Floats
from .diagnose import Diagnosis, Finding
from .surface_map import BINS, bins, gathered, pieces_of

_COLOURS = {"consistent": "#2a7f3f", "explained": "#2a7f3f", "partly_explained": "#c77f00", "unexplained": "#b02a2a"}
_FRAMES, _TRIALS, _RANGE = 4, 40, 6.0


def sentence(d: Diagnosis) -> str:
    """Return the verdict in words."""
    names = [f.title + (f" on {f.where}" if f.where else "") for f in d.findings]
    listed = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    return {
        "consistent": "Simulation and recording agree: what differs is noise.",
        "explained": f"The simulation leaves out {listed}; with it, what differs is noise.",
        "partly_explained": f"The simulation leaves out {listed}; something remains that these effects do not explain.",
        "unexplained": "Simulation and recording differ, and nothing that was tried explains it.",
    }[d.verdict]


def write_report(path: Path, d: Diagnosis) -> None:
    """Write the page; it needs no other file."""
    from jinja2 import Environment, PackageLoader

    environment = Environment(loader=PackageLoader("evaluate", "templates"), autoescape=True, trim_blocks=False)
    before, after = d.base.fit.picture, d.best.fit.picture
    shown = _worst_frames(d)
    white = float(np.quantile(d.case.pictures, 0.99)) + 1e-6
    slider = None
    if shown:
        f = shown[0]
        slider = {"frame": f, "recorded": _photo(d.case.pictures[f], white)}
        slider |= {"before": _photo(before[f], white), "after": _photo(after[f], white)}
    h = d.held_out
    held = f"{h.blocks} blocks of equal pose and lamps, {h.views} views, {h.lights} lights; held out: frames {_list(h.frames)}."
    page = environment.get_template("diagnosis.html.j2").render(
        verdict=d.verdict,
        colour=_COLOURS[d.verdict],
        sentence=sentence(d),
        notes=d.notes,
        slider=slider,
        slider_json=_script_json({k: slider[k] for k in ("before", "after")} if slider else {}),
        findings=[_words(f) for f in d.findings],
        held=held if h.frames else "There is one block only: nothing could be held out.",
        chi2=(_number(h.chi2_before), _number(h.chi2_after)),
        rmse=(_number(h.rmse_before), _number(h.rmse_after)),
        rows=[_row(d, f, white) for f in shown],
        maps=_maps(d),
        map_range=3,
        trials=[_trial(t) for t in sorted(d.trials, key=lambda t: (len(t.on_top_of), -t.gain))[:_TRIALS]],
        remains=_remains(d),
        depends=[{"name": x.name, "excess": _number(x.excess), "sigmas": f"{x.sigmas:.0f}"} for x in d.depends_on[:8]],
        tested=d.tested,
        untestable=_reasons(d.case.untestable),
    )
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _script_json(value: Any) -> Any:
    from markupsafe import Markup

    return Markup(json.dumps(value).replace("</", "<\\/"))


def _worst_frames(d: Diagnosis) -> list[int]:
    each = d.base.fit.chi2.sum(axis=1)
    return [int(f) for f in np.argsort(-each)[:_FRAMES]]


def _row(d: Diagnosis, f: int, white: float) -> dict[str, Any]:
    sigma = np.sqrt(d.case.variance[f])
    pictures = [
        (_photo(d.case.pictures[f], white), "recording"),
        (_photo(d.base.fit.picture[f], white), "simulation as believed"),
        (_signed((d.case.pictures[f] - d.base.fit.picture[f]) / sigma), f"residual before, ±{_RANGE:g} sigma"),
        (_signed((d.case.pictures[f] - d.best.fit.picture[f]) / sigma), f"residual after, ±{_RANGE:g} sigma"),
        (_mask(d.located[f], d.case.pictures[f], white), "located mismatch"),
        (_mask(d.affected[f], d.case.pictures[f], white), "affected by what was found"),
        (_photo(d.best.fit.picture[f], white), "simulation with what was found"),
    ]
    return {"frame": f, "pictures": [{"data": data, "caption": caption} for data, caption in pictures]}


def _maps(d: Diagnosis) -> list[dict[str, str]]:
    out = []
    case = d.case
    z = (case.pictures - d.base.fit.picture) / np.sqrt(case.variance)
    for i, name in enumerate(case.shape_names[:8]):
        rows = pieces_of(case, i)
        if not len(rows):
            continue
        each = z.reshape(-1, 3)[case.pieces.pixel[rows]].mean(axis=1)
        total, count = gathered(np.stack([each, np.ones_like(each)], 1), bins(case, rows), 0.0)
        image = np.where(count > 0, total / np.maximum(count, 1), 0.0)
        out.append({"data": _signed(np.repeat(image[..., None], 3, 2), 3.0, 256 // BINS), "caption": name})
    return out


def _photo(picture: Floats, white: float) -> str:
    return _png(np.clip(picture / white, 0, 1) ** (1 / 2.2) * 255)


def _mask(mask: NDArray[np.bool_], picture: Floats, white: float) -> str:
    grey = np.clip(picture.mean(axis=2, keepdims=True) / white, 0, 1) ** (1 / 2.2) * 160
    return _png(np.where(mask[..., None], [255, 120, 0], np.repeat(grey, 3, axis=2)))


def _signed(z: NDArray, top: float = _RANGE, scale: int = 1) -> str:
    """Return signed values as white to red (above) and blue (below), the mean over channels."""
    t = np.clip(z.mean(axis=2) / top, -1, 1)[..., None]
    image = 255 * np.where(t > 0, 1 - t * [0.1, 0.85, 0.9], 1 + t * [0.9, 0.7, 0.1])
    return _png(np.repeat(np.repeat(image, scale, 0), scale, 1))


def _png(rgb: NDArray) -> str:
    done, data = cv2.imencode(".png", np.rint(rgb[..., ::-1]).astype(np.uint8))
    assert done
    return "data:image/png;base64," + base64.b64encode(data.tobytes()).decode()


def _words(f: Finding) -> dict[str, Any]:
    rows = []
    for name, p in f.parameters.items():
        value, interval = p["value"], p.get("ci90")
        if isinstance(value, list):
            spread = f"{_number(min(value))} to {_number(max(value))}"
            rows.append({"name": f"{name}, per {p['per']}", "value": spread, "interval": "", "unit": p["unit"]})
        else:
            words = "" if interval is None else f"{_number(interval[0])} to {_number(interval[1])}"
            rows.append({"name": name, "value": _number(value), "interval": words, "unit": p["unit"]})
    p = "< 1e-30" if f.p_value < 1e-30 else f"{f.p_value:.1e}"
    return {
        "id": f.id, "title": f.title, "says": f.says, "where": f.where, "gain": _number(f.gain), "p": p,
        "ambiguous_with": f.ambiguous_with, "decides": f.decides, "parameters": rows,
        "decoys": [f"{r.title} leaves {_number(r.gain)} more" for r in f.decoys],
    }  # fmt: skip


def _trial(t) -> dict[str, str]:
    return {
        "base": " + ".join(t.on_top_of), "id": t.id, "target": t.target or "–", "gain": _number(t.gain),
        "sigmas": f"{t.sigmas:.1f}" if t.full else "–", "excess": _number(t.model.excess) if t.model is not None else "–",
    }  # fmt: skip


def _remains(d: Diagnosis) -> str:
    m = d.best
    if d.verdict in ("consistent", "explained"):
        return f"Noise, at {d.noise_factor:.3f} of what is stated."
    return (
        f"Structure of {_number(m.structure)} times the variance of the noise; its largest tile is {m.worst:.1f} times "
        "what noise and the difference of two right renderers allow."
    )


def _reasons(untestable: dict[str, str]) -> list[tuple[str, list[str]]]:
    """Return (reason, ids) of what could not be tested."""
    return [(why, [k for k, v in untestable.items() if v == why]) for why in dict.fromkeys(untestable.values())]


def _number(x: float) -> str:
    return "–" if not np.isfinite(x) else f"{x:.4g}"


def _list(values: list[int]) -> str:
    return ", ".join(str(v) for v in values)
