from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.foundation.settings import (
    add_flags,
    as_dict,
    check_settings,
    from_flags,
    from_mapping,
    read_tables,
    read_toml,
    setting,
)


@dataclass(frozen=True)
class Blur:
    radius: float = setting(0.1, "radius of the blur [m]")


@dataclass(frozen=True)
class Rain:
    wetness: float = setting(0.5, "share of the rain, 100% is a flood")
    drops: int = setting(10, "number of drops")
    lens: bool = setting(True, "drops on the lens")
    kind: str = setting("drizzle", "kind of rain", choices=("drizzle", "storm"))
    table: Path | None = setting(None, "file of drop sizes")
    wind: tuple[float, float] = setting((0.0, 0.0), "wind along x and y [m/s]")
    blur: Blur = field(default_factory=Blur)

    def __post_init__(self) -> None:
        check_range("wetness", self.wetness, "[0, 1]")


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_flags(parser, Rain, "rain")
    return parser.parse_args(list(words))


def test_flags_win_over_toml_and_toml_over_defaults():
    rain = from_flags(Rain, parsed("--wetness", "0.9"), {"wetness": 0.2, "drops": 7})
    assert (rain.wetness, rain.drops, rain.kind) == (0.9, 7, "drizzle")


def test_every_kind_of_flag_arrives():
    rain = from_flags(Rain, parsed("--no-lens", "--kind", "storm", "--table", "a.csv", "--wind", "1", "-2"))
    assert rain == Rain(lens=False, kind="storm", table=Path("a.csv"), wind=(1.0, -2.0))


def test_every_kind_of_toml_value_arrives():
    rain = from_mapping(Rain, {"wetness": 1, "lens": False, "table": "a.csv", "wind": [1, 2.5], "blur": {"radius": 2}})
    assert rain == Rain(wetness=1.0, lens=False, table=Path("a.csv"), wind=(1.0, 2.5), blur=Blur(2.0))
    assert isinstance(rain.wetness, float)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"wettness": 1.0}, r"a\.toml: wettness must be a known setting\. Known here: wetness, drops"),
        ({"blur": {"radios": 1.0}}, r"a\.toml: blur\.radios must be a known setting\. Known here: radius\."),
        ({"blur": 3}, r"a\.toml: blur must be a table of settings, got 3"),
        ({"blur": {"radius": "wide"}}, r"a\.toml: blur\.radius must be float, got 'wide'"),
        ({"drops": 1.5}, r"drops must be int, got 1\.5"),
        ({"drops": True}, "drops must be int, got True"),
        ({"wetness": False}, "wetness must be float, got False"),
        ({"wetness": None}, "wetness must be float, got None"),
        ({"kind": "hail"}, "kind must be one of drizzle, storm, got 'hail'"),
        ({"wind": [1.0]}, r"wind must be a list of 2 values, got \[1\.0\]"),
        ({"wind": [1.0, "x"]}, r"wind\[1\] must be float, got 'x'"),
        ({"wetness": 2.0}, r"a\.toml: wetness must lie in \[0, 1\], got 2"),
    ],
)
def test_what_the_dataclass_does_not_know_is_refused_by_file_and_key(values, words):
    with pytest.raises(InputError, match=words):
        from_mapping(Rain, values, file=Path("a.toml"))


def test_a_flag_out_of_range_is_named_as_it_was_typed():
    with pytest.raises(InputError, match=r"^--wetness must lie in \[0, 1\], got 3\.$"):
        from_flags(Rain, parsed("--wetness", "3"))


@pytest.mark.parametrize("value", [0, -1, 2.5, float("nan"), float("inf"), True, "1"])
def test_a_setting_outside_its_interval_cannot_exist(value):
    @dataclass(frozen=True)
    class Narrow:
        size: float = setting(1.0, "size", within="(0, 2]")

        def __post_init__(self) -> None:
            check_settings(self)

    assert Narrow(2).size == 2
    with pytest.raises(InputError, match=r"size must (lie in|be a number)"):
        Narrow(value)


def test_a_setting_without_default_must_be_given():
    @dataclass(frozen=True)
    class Needy:
        seed: int

    Needy.__annotations__["seed"] = int
    with pytest.raises(InputError, match="seed must be given"):
        from_mapping(Needy, {})


def test_settings_can_be_saved_as_json_and_read_again():
    rain = Rain(table=Path("a.csv"), wind=(1.0, 2.0))
    assert from_mapping(Rain, json.loads(json.dumps(as_dict(rain)))) == rain


def test_help_shows_units_defaults_and_percent_signs():
    parser = argparse.ArgumentParser()
    add_flags(parser, Rain, "rain")
    text = " ".join(parser.format_help().split())
    assert "100% is a flood (default: 0.5)" in text
    assert "--no-lens" in text


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"a = ", "must be TOML, got Invalid value"),
        (b"a = '\xff'", "must be TOML, got 'utf-8'"),
        (None, r"must exist\. Check the path given"),
    ],
)
def test_what_is_no_toml_is_refused(tmp_path, content, words):
    if content is not None:
        (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_toml(tmp_path / "a.toml")


def test_a_table_that_a_command_does_not_know_is_refused_by_name(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text("[render]\nsamples = 4\n[vew]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"a\.toml: vew must be a known table\b.*Known here: render, view\."):
        read_tables(str(file), "render", "view")
    assert read_tables(str(file), "render", "vew") == ({"render": {"samples": 4}, "vew": {}}, file)
    assert read_tables(None, "render") == ({}, None)
