from __future__ import annotations

import numpy as np
import pytest

from materials.directions import even_directions, spherical
from materials.foundation.errors import InputError
from materials.measured.rgl import read_rgl
from materials.measured.source import open_source
from materials.measured.tensor_file import read_tensor_file, write_tensor_file
from tests.materials.measured.rgl_tables import write_rgl


def test_tensor_files_come_back_as_written(tmp_path):
    fields = write_rgl(tmp_path / "a.bsdf")
    again = read_tensor_file(tmp_path / "a.bsdf")
    assert list(again) == list(fields) and all(np.array_equal(again[k], fields[k]) for k in fields)
    with pytest.raises(InputError, match="x must have one of the types"):
        write_tensor_file(tmp_path / "b.bsdf", {"x": np.ones(2, complex)})


def test_without_a_warp_values_lie_where_the_half_vector_points(tmp_path):
    fields = write_rgl(tmp_path / "a.bsdf", flat=True)
    brdf = read_rgl(tmp_path / "a.bsdf")
    # a viewer at a tabulated elevation; half vectors at the table's own places: u = sqrt(2 theta / pi), v = phi / 2 pi + 1/2
    k, col, row = 1, 3, 5
    view = spherical(float(fields["theta_i"][k]), 0.0)
    h = spherical((col / 7) ** 2 * np.pi / 2, (row / 7 - 0.5) * 2 * np.pi)
    light = 2 * (view @ h) * h - view
    assert light[2] > 0
    assert np.allclose(brdf.evaluate(light, view)[0] * light[2], fields["rgb"][0, k, :, row, col], rtol=1e-5)


def test_the_warp_is_the_distribution_function_of_visible_normals(tmp_path):
    write_rgl(tmp_path / "a.bsdf")
    brdf = read_rgl(tmp_path / "a.bsdf")
    tables = brdf._tables(np.zeros(3), np.full(3, brdf.theta[2]))
    u = np.array([[0.31, 0.77], [0.5, 0.2], [0.93, 0.45]])
    got = brdf._inverse(u, tables)
    # the same by sums over a fine grid of the bilinear density
    fine = 2000
    at = (np.arange(fine) + 0.5) / fine
    table = brdf.vndf[0, 2]
    rows = np.stack([np.interp(at * 6, np.arange(7), r) for r in table])
    by_row = np.stack([np.interp(at * 5, np.arange(6), c) for c in rows.T], axis=1)  # (fine, fine), rows are v
    for (x, y), (s, t) in zip(u, got):
        assert t == pytest.approx(by_row[at < y].sum() / by_row.sum(), abs=2e-3)
        line = np.stack([np.interp(y * 5, np.arange(6), c) for c in rows.T])
        assert s == pytest.approx(line[at < x].sum() / line.sum(), abs=2e-3)


def test_isotropic_tables_do_not_know_the_azimuth(tmp_path):
    write_rgl(tmp_path / "a.bsdf", jacobian=1)
    brdf = read_rgl(tmp_path / "a.bsdf")
    assert brdf.isotropic

    def turned(w, by):
        c, s = np.cos(by), np.sin(by)
        return w @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])

    wi, wo = even_directions(30, 70), even_directions(30, 75)[::-1]
    # sigma is looked up at the viewer's azimuth; that of an isotropic material has none
    flat = type(brdf)(**{**brdf.__dict__, "sigma": np.full((2, 2), 0.5)})
    assert np.allclose(flat.evaluate(wi, wo), flat.evaluate(turned(wi, 1.0), turned(wo, 1.0)), rtol=1e-9)
    assert (flat.evaluate(wi * (1, 1, -1), wo) == 0).all()
    source = open_source(tmp_path / "a.bsdf")
    assert source.kind == "rgl" and source.block(0, 1).isotropic and source.block(0, 1).value.min() >= 0


def test_files_with_missing_or_wrong_tables_are_refused(tmp_path):
    fields = write_rgl(tmp_path / "a.bsdf")
    for changed, words in (
        ({k: v for k, v in fields.items() if k != "vndf"}, "vndf must be a field"),
        ({k: v for k, v in fields.items() if k != "rgb"}, "rgb, or spectra and wavelengths must be a field"),
        (fields | {"vndf": fields["vndf"][:, :2]}, "vndf must have shape"),
        (fields | {"rgb": fields["rgb"] * np.float32(np.nan)}, "rgb must be finite"),
        (fields | {"vndf": -fields["vndf"]}, "vndf must be a density"),
        (fields | {"theta_i": fields["theta_i"][::-1].copy()}, "must rise"),
    ):
        write_tensor_file(tmp_path / "b.bsdf", changed)
        with pytest.raises(InputError, match=words):
            read_rgl(tmp_path / "b.bsdf")
