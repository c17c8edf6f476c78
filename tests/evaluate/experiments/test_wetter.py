"""The recipe on a street made of textures, where it is known where each effect does harm."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluate.experiments import wetter
from evaluate.experiments.settings import WetterSettings
from evaluate.experiments.wet_street import Weather
from evaluate.report import write_report
from materials.foundation.errors import InputError

from .fake_street import FakeStreet

ALGORITHMS = ("papenberg", "dis")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("wetter")


@pytest.fixture(scope="module")
def report(folder: Path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wetter, "WetStreet", FakeStreet)
        return wetter.run(WetterSettings(pairs=2, levels=(0.5, 1.0), algorithms=ALGORITHMS), folder)


def test_each_effect_is_compared_with_the_same_pixels_in_the_dry(report):
    rows = {(r["effect"], r["level"], r["algorithm"]): r for r in report.tables[0].records()}
    assert len(rows) == 2 * (1 + 4 * 2)
    for name in ALGORITHMS:
        dry = rows["dry", 0.0, name]
        assert dry["epe_change"] is None and dry["epe"] < 1
        for effect in ("wetness", "droplets", "together"):
            row = rows[effect, 1.0, name]
            assert row["epe"] - row["epe_change"] == pytest.approx(dry["epe"]) and row["pixels"] == dry["pixels"]
            assert row["fl_all"] - row["fl_change"] == pytest.approx(dry["fl_all"])
            assert row["epe_low"] < row["epe_change"] < row["epe_high"]
        # A reflection that stands still over ground that moves harms the more, the stronger it is.
        assert 0 < rows["wetness", 0.5, name]["epe_change"] < rows["wetness", 1.0, name]["epe_change"]


def test_what_an_effect_adds_sits_where_the_effect_is(report):
    rows = {(r["effect"], r["algorithm"], r["region"]): r for r in report.tables[1].records() if r["level"] == 1.0}
    for name in ALGORITHMS:
        assert rows["wetness", name, "standing water"]["epe_change"] > rows["wetness", name, "other ground"]["epe_change"]
        assert rows["droplets", name, "drops"]["epe_change"] > 1 > abs(rows["droplets", name, "elsewhere"]["epe_change"])
        assert ("wetness", name, "drops") not in rows and ("mist", name, "standing water") not in rows
        for effect in ("wetness", "mist", "droplets", "together"):
            of_one = [r for (e, a, _), r in rows.items() if (e, a) == (effect, name)]
            assert sum(r["of_pixels"] for r in of_one) == pytest.approx(1)
            if of_one[0]["of_added"] is not None:
                assert sum(r["of_added"] for r in of_one) == pytest.approx(1)


def test_the_report_says_it_in_words_and_pictures(report, folder: Path):
    assert "On street, at level 1" in report.paragraphs[1] and "wetness +" in report.paragraphs[1]
    assert len(report.pictures) == 3 and all(path.stat().st_size > 5000 for path in report.pictures.values())
    write_report(folder, report)
    assert {"robustness.csv", "places.csv", "report.md", "report.html"} <= {p.name for p in folder.iterdir()}


def test_together_is_every_effect_at_once():
    assert wetter.weather_of("mist", 0.5) == Weather(0.0, 0.5, 0.0)
    assert wetter.weather_of("together", 0.5) == Weather(0.5, 0.5, 0.5)


def test_settings_that_cannot_be_are_refused_before_work_begins(tmp_path: Path):
    with pytest.raises(InputError, match=r"levels must lie in \(0, 1\], got 0"):
        wetter.run(WetterSettings(levels=(0.0,)), tmp_path)
    with pytest.raises(InputError, match="algorithm must be one of"):
        wetter.run(WetterSettings(algorithms=("raft",)), tmp_path)
    with pytest.raises(InputError, match="--recordings must be given with --no-street"):
        wetter.run(WetterSettings(street=False), tmp_path)
    assert not any(tmp_path.iterdir())
