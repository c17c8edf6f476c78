"""Time and memory of the path tracer over triangles, pixels, samples and bounces: straight lines, or a reason why not.

Trees of triangles are built in about linear time and searched in logarithmic; paths in a white room are ended by chance, so
that bounces beyond the first few cost less and less.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from materials.foundation.errors import InputError
from materials.foundation.files import replacing
from materials.foundation.progress import tracked

from .growth import SWEEPS
from .report import Report

# Figure, its unit, and the sweeps over which a straight line is expected of it.
_FIGURES = (
    ("render_s", "s", ("pixels", "samples")),
    ("compile_s", "s", ("triangles",)),
    ("peak_mib", "MiB", ("triangles", "pixels")),
)

Sweep = list[tuple[int, dict[str, float]]]


def run(report: Report) -> None:
    """Measure every sweep, report each point and how far it lies off a straight line, and draw them."""
    found: dict[str, Sweep] = {}
    points = [(sweep, value) for sweep, values in SWEEPS.items() for value in values]
    for sweep, value in tracked(points, "growth"):
        found.setdefault(sweep, []).append((value, _in_a_process(sweep, value)))
    for sweep, points_of in found.items():
        for value, figures in points_of:
            report.figure(name=f"growth, {value:,} {sweep}: rendering", ours=figures["render_s"], unit="s")
        for key, unit, straight in _FIGURES:
            if sweep in straight:
                x, y = np.array([v for v, _ in points_of], float), np.array([f[key] for _, f in points_of])
                name = f"growth of {key} over {sweep}: largest deviation from a line ({y[0]:.3g} to {y[-1]:.3g} {unit})"
                report.figure(name=name, ours=deviation(x, y), unit="1")
    _draw(found, report.folder / "growth.png")


def deviation(x: np.ndarray, y: np.ndarray) -> float:
    """Return the largest relative deviation of measurements (N,) from the straight line that is nearest to them, relatively."""
    a = np.stack([np.ones_like(x), x], axis=1) / y[:, None]
    line = np.linalg.lstsq(a, np.ones_like(y), rcond=None)[0]
    return float(np.abs(a @ line - 1).max())


def _in_a_process(sweep: str, value: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.growth", sweep, str(value)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError("run", got=done.stderr.strip()[-200:], key=f"growth over {sweep}, {value}")
    return json.loads(done.stdout)


def _draw(found: dict[str, Sweep], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6), layout="constrained")
    axes = figure.subplots(2, len(found))
    for column, (sweep, points) in enumerate(found.items()):
        x = np.array([v for v, _ in points], float)
        for row, (keys, unit) in enumerate(((("render_s", "compile_s"), "s"), (("peak_mib",), "MiB"))):
            a = axes[row, column]
            for key in keys:
                y = np.array([f[key] for _, f in points])
                (drawn,) = a.plot(x, y, "o", label=key.split("_")[0])
                line = np.polyfit(x, y, 1, w=1 / y)
                a.plot(x, np.polyval(line, x), "-", color=drawn.get_color(), linewidth=1, alpha=0.6)
            a.set_xscale("log")
            a.set_yscale("log")
            a.set_xlabel(sweep)
            a.set_ylabel(unit)
            a.legend(fontsize=8)
    figure.suptitle("Points: measured. Lines: straight lines through them (bent by the logarithmic axes).")
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=100)
