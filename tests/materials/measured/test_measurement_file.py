from __future__ import annotations

import json

import numpy as np
import pytest

from materials.directions import spherical
from materials.foundation.errors import InputError
from materials.measured.measurement_file import read_measurement
from materials.measured.source import open_source

HEAD = "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,wavelength,value,sigma\n"


def write(folder, rows: str, **keys):
    (folder / "table.csv").write_text(rows)
    head = {"format": "measurement/1", "table": "table.csv"} | keys
    (folder / "measurement.json").write_text(json.dumps(head))
    return folder


def rows(values=(0.1, 0.2, 0.3), count=12) -> str:
    wi, wo = spherical(np.full(count, 0.3), np.zeros(count)), spherical(np.linspace(0.1, 1.2, count), np.full(count, 3.0))
    lines = [[*a, *b, w, v, 0.01] for a, b in zip(wi, wo) for w, v in zip((450, 550, 650), values)]
    return HEAD + "\n".join(",".join(repr(float(x)) for x in line) for line in lines)


def test_a_table_of_directions_becomes_an_apparent_brdf(tmp_path):
    m = read_measurement(write(tmp_path, rows(), name="paper", model={"model": "lambert", "albedo": [0.5, 0.5, 0.5]}))
    assert m.samples is not None and m.sigma is not None and m.model == {"model": "lambert", "albedo": [0.5, 0.5, 0.5]}
    assert m.name == "paper" and m.samples.channels == ("450 nm", "550 nm", "650 nm") and m.samples.value.shape == (12, 3)
    assert np.allclose(m.samples.value, (0.1, 0.2, 0.3)) and np.allclose(m.sigma, 0.01)


def test_a_sample_without_all_wavelengths_is_not_valid(tmp_path):
    m = read_measurement(write(tmp_path, rows().rsplit("\n", 1)[0]))
    assert m.samples is not None and m.samples.valid.sum() == 11


def test_wavelengths_in_metres_are_understood(tmp_path):
    table = rows().replace(",450.0,", ",450e-9,").replace(",550.0,", ",550e-9,").replace(",650.0,", ",650e-9,")
    m = read_measurement(write(tmp_path, table, wavelength_unit="m"))
    assert m.samples is not None and m.samples.channels[1] == "550 nm"


def test_an_archive_holds_directions_as_arrays(tmp_path):
    wi, wo = spherical(np.full(9, 0.2), np.zeros(9)), spherical(np.linspace(0.1, 1.2, 9), np.full(9, 3.0))
    np.savez(tmp_path / "table.npz", wi=wi, wo=wo, wavelength=np.full(9, 550.0), value=np.linspace(0.1, 0.3, 9))
    (tmp_path / "measurement.json").write_text('{"format": "measurement/1", "table": "table.npz"}')
    source = open_source(tmp_path / "measurement.json")
    assert source.kind == "measurement" and source.block(0, 1).value.shape == (1, 9, 3)


def test_repeated_conditions_stay_apart(tmp_path):
    table = "condition,wavelength,value\n0.1,500,0.3\n0.1,600,0.4\n0.2,500,0.1\n0.2,600,0.2\n0.1,500,0.31\n0.1,600,0.41"
    c = read_measurement(write(tmp_path, table, condition="moisture", condition_unit="%")).conditions
    assert c is not None and c.condition.tolist() == [0.1, 0.1, 0.2] and c.name == "moisture"
    assert np.allclose(c.value, [[0.3, 0.4], [0.31, 0.41], [0.1, 0.2]]) and np.isnan(c.sigma).all()


def test_what_is_wrong_is_named(tmp_path):
    for table, words in (
        (rows((0.1, -0.2, 0.3)), r"value, row 2 must not be negative"),
        (rows().replace("0.2,", "nan,", 1), "must be finite"),
        (rows().replace("sigma", "colour"), "colour must be a known column"),
        (rows().replace("wavelength", "x"), "have the column wavelength"),
        (HEAD, "a row of names and rows of numbers"),
        (rows() + ",1", "must have 9 cells"),
    ):
        with pytest.raises(InputError, match=words):
            read_measurement(write(tmp_path, table))
    below = HEAD + "0,0,1,0,0,-1,550,0.1,0.01"
    with pytest.raises(InputError, match="z must lie in"):
        read_measurement(write(tmp_path, below))
    with pytest.raises(InputError, match="stay below the folder"):
        read_measurement(write(tmp_path, rows(), table="../table.csv"))
    with pytest.raises(InputError, match="colour must be a known key"):
        read_measurement(write(tmp_path, rows(), colour=1))
    with pytest.raises(InputError, match="be a folder of measured reflectance"):
        open_source(tmp_path.parent)
