"""What real photographs say: glass with drops beside clean glass, and a drive whose frames predict each other.

Glass: the picture through clean glass is what was believed, the one through wet glass what was recorded. Both pairs are
diagnosed together; each is then held out once: what all frames share, such as how drops blur and veil, comes from the other
pair; what belongs to one frame alone is fitted on half of its tiles and judged on the other half. Where the drops are is found
in the pair itself, in its finest detail alone: nothing else could know. The drops are also set against a decoy in the same
places that is no physics: a factor and an offset.

Drive: each frame is predicted from the others through the reconstruction, and the diagnosis says what differs; its
figures are of frames held out of the fit, which a quarter is at a time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from evaluate.effects import catalogue
from evaluate.effects.in_drives import choose_for_drive
from evaluate.effects.in_pictures import choose
from evaluate.mismatch.diagnose import Diagnosis, diagnose
from evaluate.mismatch.drive.load import drive_settings, load_scene
from evaluate.mismatch.effect import Term
from evaluate.mismatch.outputs import write_diagnosis
from evaluate.mismatch.pictures.folders import load_folders
from evaluate.mismatch.prove import HeldOut, held_frames, prove
from evaluate.mismatch.solve import fit
from materials.foundation.files import make_folder, replacing
from scene.images import read_image, write_exr
from scene.reconstruction.build import build
from scene.reconstruction.build_settings import BuildSettings
from scene.recording import read_recording

from .data import data_folder
from .report import Report

_AVERAGE = 4
_DRIVES = {"static_ego_43_46": ("moved_object", 5), "street_122_127": ("moved_object", 6)}
_EXPECTED_GLASS = "lens_droplets"


def run(report: Report) -> None:
    """Diagnose the pairs and the drives; reports and a table go to `proof/real_photographs` beside the report."""
    folder = make_folder(report.folder / "proof" / "real_photographs")
    rows = [*_glass(report, data_folder() / "raindrop_glass", folder), *_drives(report, data_folder() / "kitti2015_drive", folder)]
    head = "| what | verdict | effects | held out | chi-square before | after | RMSE before | after |\n" + 8 * "|---" + "|\n"
    with replacing(folder / "table.md") as temporary:
        temporary.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def _glass(report: Report, data: Path, folder: Path) -> list[str]:
    for kind in ("clean", "rain"):
        for file in sorted((data / kind).glob("*_*.*")):
            picture = read_image(file)[0]
            height, width = (n // _AVERAGE * _AVERAGE for n in picture.shape[:2])
            small = picture[:height, :width].reshape(height // _AVERAGE, _AVERAGE, width // _AVERAGE, _AVERAGE, 3).mean(axis=(1, 3))
            target = folder / "glass" / kind / f"{file.stem.split('_')[0]}.exr"
            write_exr(target, dict(zip("RGB", np.moveaxis(small.astype(np.float32), -1, 0), strict=True)))
    case, effects = choose(load_folders(folder / "glass" / "clean", folder / "glass" / "rain"), catalogue())
    d = diagnose(case, effects)
    write_diagnosis(folder / "glass" / "diagnosis", d)
    named = [f.id for f in d.findings]
    report.proof(name="wet glass: drops are named", value=float(_EXPECTED_GLASS in named), bound=1, holds=_EXPECTED_GLASS in named)
    rows = []
    for seed, h in _each_held_out(d):
        rows.append(_row("wet glass", d, h))
        share = h.rmse_after / h.rmse_before
        report.proof(name=f"wet glass: RMSE of held-out pair {seed}, after / before", value=share, bound=1, holds=share < 1)
    drops = next((t for t in d.best.effects if t.effect.id == _EXPECTED_GLASS), None)
    if drops is not None:
        ratio = _against_decoy(d, drops)
        report.proof(
            name="wet glass: squared error within drops, over that of a decoy there", value=ratio, bound=1, holds=ratio < 1
        )
    return rows


def _each_held_out(d: Diagnosis) -> list[tuple[int, HeldOut]]:
    """Return the figures with each frame held out in turn."""
    found: dict[int, HeldOut] = {}
    for seed in range(40):
        frames = held_frames(d.case, seed)
        if len(frames) == 1 and int(frames[0]) not in found:
            found[int(frames[0])] = prove(d.case, d.base, d.best, seed)
    return sorted(found.items())


def _against_decoy(d: Diagnosis, drops: Term) -> float:
    """Return the squared error within the drops, over that of a factor and an offset a channel there.

    Both are fitted on the other pair; the drops stand alone, without the other effects that were found.
    """
    case, inside = d.case, drops.aux.reshape(d.case.valid.shape) > 0.5
    S, R = d.base.fit.picture, case.pictures
    ours, theirs = 0.0, 0.0
    for f in range(case.num_frames):
        weight = d.base.weight.copy()
        weight[f] = 0
        fitted = fit(case, weight, [*d.base.terms, drops], 15)
        ours += float(((fitted.picture[f] - R[f])[inside[f]] ** 2).sum())
        seen = np.arange(case.num_frames) != f
        for c in range(3):
            a, b = np.polyfit(S[seen, ..., c][inside[seen]], R[seen, ..., c][inside[seen]], 1)
            theirs += float(((a * S[f, ..., c] + b - R[f, ..., c])[inside[f]] ** 2).sum())
    return ours / theirs


def _drives(report: Report, data: Path, folder: Path) -> list[str]:
    rows = []
    for name, (expected, average) in _DRIVES.items():
        out = folder / name
        build(read_recording(data / f"{name}.recording.json"), out / "scene", BuildSettings())
        case, effects = choose_for_drive(load_scene(out / "scene", average), catalogue())
        d = diagnose(case, effects, settings=drive_settings())
        write_diagnosis(out / "diagnosis", d)
        named = [f.id for f in d.findings]
        report.proof(name=f"{name}: {expected} is named", value=float(expected in named), bound=1, holds=expected in named)
        share = d.held_out.rmse_after / d.held_out.rmse_before
        report.proof(name=f"{name}: RMSE of held-out frames, after / before", value=share, bound=1, holds=share < 1)
        rows.append(_row(name, d, d.held_out))
    return rows


def _row(what: str, d: Diagnosis, h: HeldOut) -> str:
    names = ", ".join(f"{f.id}{f' on {f.where}' if f.where else ''}" for f in d.findings) or "–"
    cells: list[Any] = [what, d.verdict, names, ", ".join(str(f) for f in h.frames)]
    cells += [f"{v:.4g}" for v in (h.chi2_before, h.chi2_after, h.rmse_before, h.rmse_after)]
    return "| " + " | ".join(cells) + " |"
