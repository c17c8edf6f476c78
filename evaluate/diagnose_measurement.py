"""What `diagnose` does with a measurement in place of a recording: a measurement/1, or a file of a measured BRDF."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from materials.foundation.files import read_json

from .mismatch.attribute import SearchSettings
from .mismatch.diagnose import Finding
from .mismatch.effect import Effect

# What is believed of a file that says nothing about it: all numbers are to be fitted.
MODELS: dict[str, dict[str, Any]] = {
    "lambert": {"model": "lambert", "albedo": 0.2, "free": ["albedo"]},
    "ggx": {"model": "ggx", "albedo": 0.2, "alpha": 0.2, "specular_scale": 1.0, "free": ["albedo", "alpha", "specular_scale"]},
}


def measurement_of(path: Path, believed: str, output: Path) -> Path | None:
    """Return the measurement/1 that a path names or, if it is a file of a measured BRDF, what was written of it; None otherwise."""
    if path.is_dir():
        return path if (path / "measurement.json").is_file() and not (path / "recording.json").is_file() else None
    if not path.is_file():
        return None
    if path.suffix == ".json":
        content = read_json(path)
        return path if isinstance(content, dict) and str(content.get("format")).startswith("measurement/") else None
    from materials.measured.measurement_writer import write_measurement
    from materials.measured.source import read_brdf

    samples = read_brdf(path)
    return None if samples is None else write_measurement(output / "measurement", samples, MODELS[believed])


def diagnose_measurement(
    path: Path, output: Path, effects: list[Effect], settings: SearchSettings, say: Callable[[str], None]
) -> tuple[str, str, list[Finding]]:
    """Diagnose a measurement/1, write everything, and return (verdict, verdict in words, findings)."""
    from .mismatch.measured.diagnose import diagnose_file
    from .mismatch.measured.outputs import sentence, write_measured_diagnosis

    d = diagnose_file(path, effects, settings, say)
    write_measured_diagnosis(output, d)
    return d.verdict, sentence(d), d.findings
