"""The recipe on a street made of textures, where it is known which way of wetting is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evaluate.command import main
from evaluate.experiments import RECIPES, true_wet
from evaluate.experiments.cache import Cache
from evaluate.experiments.settings import TrueWetSettings
from materials.foundation.errors import InputError

from .fake_street import FakeStreet


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(true_wet, "WetStreet", FakeStreet)
        settings = TrueWetSettings(pairs=3, showers=(1.0,), algorithms=("papenberg", "dis"))
        return true_wet.run(settings, tmp_path_factory.mktemp("true_wet"))


def test_what_equals_the_truth_but_for_noise_is_found_nearest_to_it(report):
    rows = {(r["algorithm"], r["pictures"]): r for r in report.tables[0].records()}
    for name in ("papenberg", "dis"):
        d = {kind: rows[name, kind]["dfe"] for kind in ("truly wet, again", "augmented", "darkened", "planar mirror", "dry")}
        # Only noise parts the first two; the mirrored texture parts the others.
        assert d["augmented"] < 2 * d["truly wet, again"] < min(d["darkened"], d["dry"])
        row = rows[name, "augmented"]
        shares = [
            value for key, value in row.items() if key.endswith(("identical", "algorithm", "scene", "error")) and key[0] in "≤0≥"
        ]
        assert sum(shares) == pytest.approx(1) and row["se"] > 0
        assert row["epe_change"] == pytest.approx(row["epe"] - row["epe_true"])
        assert rows[name, "dry"]["epe_change"] < 0  # without reflections the flow is easier than in the rain
    assert "in 2 of 2 comparisons (showers x algorithms), and nearer than on the dry pictures in 2" in report.paragraphs[1]


def test_each_method_takes_the_wetness_nearest_to_the_truth(report):
    rows = {r["pictures"]: r for r in report.tables[1].records()}
    assert rows["augmented"]["wetness"] == 1 and rows["dry"]["wetness"] is None
    assert rows["augmented"]["psnr"] > rows["planar mirror"]["psnr"] and rows["augmented"]["ssim"] > rows["darkened"]["ssim"]
    assert all(path.stat().st_size > 5000 for path in report.pictures.values()) and len(report.pictures) == 3


def test_settings_that_cannot_be_are_refused_before_work_begins(tmp_path: Path):
    with pytest.raises(InputError, match=r"showers must lie in \[0, 1\], got 2"):
        true_wet.run(TrueWetSettings(showers=(2.0,)), tmp_path)
    with pytest.raises(InputError, match="algorithm must be one of"):
        true_wet.run(TrueWetSettings(algorithms=("raft",)), tmp_path)
    assert not any(tmp_path.iterdir())


def test_the_command_lists_its_recipes_and_names_the_flag_at_fault(capsys, tmp_path: Path):
    assert main(["experiment", "--help"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in RECIPES)
    assert main(["experiment", "true-wet", "-o", str(tmp_path / "o"), "--pairs", "0"]) == 2
    assert "--pairs must lie in [1, 10], got 0" in capsys.readouterr().err


def test_cached_arrays_are_made_once_per_set_of_parts(tmp_path: Path):
    made = []

    def make(value: float):
        def inner():
            made.append(value)
            return np.array([value])

        return inner

    cache = Cache(tmp_path)
    picture = np.arange(6.0)
    assert cache.array({"w": 0.5, "picture": picture}, make(1.0))[0] == 1
    assert cache.array({"picture": picture.copy(), "w": 0.5}, make(2.0))[0] == 1
    assert cache.array({"w": 0.5, "picture": picture.astype(np.float32)}, make(3.0))[0] == 3
    assert cache.array({"w": 0.6, "picture": picture}, make(4.0))[0] == 4
    assert made == [1.0, 3.0, 4.0]
