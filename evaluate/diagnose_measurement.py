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
    """Return the measurement/1 or photometric stereo that a path names, or what was written of a file of a measured BRDF.

    None if the path is anything else.
    """
    if path.is_dir():
        is_measurement = (path / "measurement.json").is_file() and not (path / "recording.json").is_file()
        return path if is_measurement or is_photometric_stereo(path) else None
    if not path.is_file():
        return None
    if path.suffix == ".json":
        content = read_json(path)
        return path if isinstance(content, dict) and str(content.get("format")).startswith("measurement/") else None
    from materials.measured.measurement_writer import write_measurement
    from materials.measured.source import read_brdf

    samples = read_brdf(path)
    return None if samples is None else write_measurement(output / "measurement", samples, MODELS[believed])


def is_photometric_stereo(path: Path) -> bool:
    """Return whether a folder is in DiLiGenT's layout, or a recording of one shape that is given as a normal map."""
    if not path.is_dir():
        return False
    if (path / "recording.json").is_file():
        believed = read_json(path / "simulation.json") if (path / "simulation.json").is_file() else None
        shapes = believed.get("shapes") if isinstance(believed, dict) else None
        return isinstance(shapes, list) and len(shapes) == 1 and isinstance(shapes[0], dict) and "normal_map" in shapes[0]
    return (path / "light_directions.txt").is_file()


def diagnose_measurement(
    path: Path,
    output: Path,
    effects: list[Effect],
    settings: SearchSettings,
    say: Callable[[str], None],
    images: slice | None = None,
) -> tuple[str, str, list[Finding]]:
    """Diagnose a measurement, write everything, and return (verdict, verdict in words, findings)."""
    from .mismatch.measured.outputs import sentence, write_measured_diagnosis

    if is_photometric_stereo(path):
        from materials.measured.photographs import read_photographs
        from materials.measured.recording_photographs import read_recording_photographs

        from .mismatch.measured.photographs import diagnose_photographs, stereo_of

        read = read_recording_photographs if (path / "recording.json").is_file() else read_photographs
        d = diagnose_photographs(stereo_of(read(path, images=images), path), effects, settings, say)
    else:
        from .mismatch.measured.diagnose import diagnose_file

        d = diagnose_file(path, effects, settings, say)
    write_measured_diagnosis(output, d)
    return d.verdict, sentence(d), d.findings
