"""Spectra of drying soil, as they came, to a measurement/1.

The data are those of Riese and Keller (2018), Hyperspectral benchmark dataset on soil moisture, CC BY 4.0.
"""

from __future__ import annotations

import csv
from pathlib import Path

from materials.foundation.files import make_folder, replacing, write_json


def write_soil_measurement(table: Path, folder: Path, step: int = 1) -> Path:
    """Write every `step`-th record of the CSV (moisture [%] in its third column, spectra from its fifth) and return the JSON."""
    make_folder(folder)
    with table.open(encoding="utf-8", newline="") as file:
        head, *records = list(csv.reader(file))
    rows = [("condition", "wavelength", "value")]
    for record in records[::step]:
        rows += [(record[2], nm, value) for nm, value in zip(head[4:], record[4:], strict=True)]
    with replacing(folder / "spectra.csv") as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    told = {"format": "measurement/1", "table": "spectra.csv", "name": "soil", "condition": "moisture", "condition_unit": "%"}
    write_json(folder / "measurement.json", told)
    return folder / "measurement.json"
