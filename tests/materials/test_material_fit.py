from __future__ import annotations

import json
import subprocess
import sys

import cv2
import numpy as np
import pytest

from materials import fit_run, ggx
from materials.brdf_errors import brdf_errors
from materials.cli import main
from materials.directions import even_directions
from materials.fit import FitSettings
from materials.measured.source import open_source
from materials.scattering import evaluate
from materials.svbrdf import read_svbrdf

ALBEDO, SCALE, ALPHA = (0.4, 0.2, 0.1), 0.8, 0.25


@pytest.fixture
def paint(tmp_path):
    """A measurement/1 of GGX paint at three wavelengths."""
    dome = even_directions(24, 70)
    wi, wo = np.repeat(dome, 24, axis=0), np.tile(dome, (24, 1))
    f = evaluate(ggx.surface(ALBEDO, ALPHA, specular_scale=SCALE), wo, wi)
    folder = tmp_path / "paint"
    folder.mkdir()
    columns = {"wi": np.repeat(wi, 3, axis=0), "wo": np.repeat(wo, 3, axis=0)}
    np.savez(folder / "t.npz", wavelength=np.tile([640.0, 540.0, 450.0], len(wi)), value=f.ravel(), **columns)
    (folder / "measurement.json").write_text('{"format": "measurement/1", "table": "t.npz"}')
    return folder


@pytest.fixture
def ball(tmp_path):
    """Photographs of a matte ball, 12 x 12 pixels, 20 lamps."""
    y, x = np.mgrid[1:-1:12j, -1:1:12j]
    inside = x**2 + y**2 < 0.8
    n = np.where(inside[..., None], np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1), 0)
    lights = even_directions(20, 45)
    folder = tmp_path / "ball"
    folder.mkdir()
    for k, w in enumerate(lights):
        cv2.imwrite(str(folder / f"{k:03d}.png"), np.rint(60000 * np.maximum(n @ w, 0))[..., None].repeat(3, 2).astype(np.uint16))
    cv2.imwrite(str(folder / "mask.png"), (255 * inside).astype(np.uint8))
    np.savetxt(folder / "light_directions.txt", lights)
    np.save(folder / "normal_gt.npy", n)
    return folder


def test_paint_is_found_again_and_its_folder_read(paint, tmp_path, capsys):
    out = tmp_path / "out"
    assert main([str(paint), "-o", str(out), "--model", "ggx", "--lobes", "1", "--no-constrained"]) == 0
    m = read_svbrdf(out)
    assert m.mask.shape == (1, 1) and m.alpha[0, 0] == pytest.approx(ALPHA, abs=1e-4)
    # half floats keep 11 bits
    source = open_source(paint).block(0, 1)
    assert np.allclose(
        m.reflect(source.wi, source.wo, np.zeros(576, int)) / source.wi[:, 2:], source.value[0], rtol=2e-3, atol=1e-5
    )
    assert {f.name for f in (out / "pictures").iterdir()} == {"spheres.png", "lobes.png", "residuals.png"}
    assert "alpha 1 u" in (out / "report.md").read_text() and "<img" in (out / "report.html").read_text()
    assert json.loads((out / "material.json").read_text())["fit"]["failed"] == 0
    assert not (out / ".fit").exists() and "report.html" in capsys.readouterr().out


def test_photographs_give_normals_albedo_and_a_map_of_the_cost(ball, tmp_path):
    out = tmp_path / "out"
    assert main([str(ball), "-o", str(out), "--model", "ggx", "--lobes", "1", "--quiet"]) == 0
    m, told = read_svbrdf(out), json.loads((out / "metrics.json").read_text())
    # robust normals search down to a quarter of a degree
    assert told["normals"][0]["deg"] < 0.5 and np.isfinite(m.cost).all()
    assert np.median(m.diffuse) == pytest.approx(np.pi * 60000 / 65535, rel=0.02)
    assert cv2.imread(str(out / "normal.png"), cv2.IMREAD_UNCHANGED).dtype == np.uint16


def test_an_interrupted_fit_goes_on_where_it_stopped(ball, tmp_path, monkeypatch):
    monkeypatch.setattr(fit_run, "_BLOCK_BYTES", 20 * 3 * 4 * 30)  # 30 texels
    settings, source = FitSettings(model="ggx", lobes=1), open_source(ball)
    calls = []

    def counted(*args):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return original(*args)

    original = fit_run.fit_where_possible
    monkeypatch.setattr(fit_run, "fit_where_possible", counted)
    with pytest.raises(KeyboardInterrupt):
        fit_run.run_fit(source, settings, tmp_path / "work", ball)
    resumed = fit_run.run_fit(source, settings, tmp_path / "work", ball)
    assert len(calls) == 1 + -(-source.num_texels // 30)
    whole = fit_run.run_fit(source, settings)
    assert np.array_equal(resumed.material.alpha, whole.material.alpha) and np.array_equal(resumed.sigma, whole.sigma)
    # other settings start anew
    calls.clear()
    calls += [1] * 3
    fit_run.run_fit(source, FitSettings(model="ward", lobes=1), tmp_path / "work", ball)
    assert len(calls) == 3 + -(-source.num_texels // 30)


def test_what_cannot_be_fitted_is_one_line(tmp_path, capsys):
    for argv, words in (
        ([str(tmp_path / "none.brdf"), "-o", "x"], "none.brdf: it must exist"),
        ([str(tmp_path), "-o", "x"], "must be a folder of measured reflectance"),
        ([__file__, "-o", "x"], "must be measured reflectance of a known kind"),
        ([str(tmp_path), "-o", __file__], "must be a folder, got a file"),
        ([str(tmp_path), "-o", "x", "--lobes", "3"], "--lobes must lie in [1, 2]"),
        ([str(tmp_path), "-o", "x", "--images", "a"], "--images must be FROM:TO"),
    ):
        assert main(argv) == 2
        assert words in capsys.readouterr().err


def test_help_loads_no_numerics():
    code = "import sys; from materials.cli import main; main(['--help']); assert not {'numpy', 'numba', 'cv2'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_errors_weigh_by_the_light_and_vanish_for_equals():
    f = np.array([[0.1, 0.2, 0.3], [1.0, 1.0, 1.0]])
    assert set(brdf_errors(f, f, np.ones(2)).values()) == {0.0}
    # a sample whose light is 60 degrees away counts half
    assert brdf_errors(f + 0.1, f, np.array([0.5, 0.5]))["rms"] == pytest.approx(0.05)
