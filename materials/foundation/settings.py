"""Settings of a stage: a frozen dataclass whose values come from defaults, then a TOML file, then flags.

Each field carries its help text (`setting(default, "help")`), so that the command's flags, the TOML keys and the
documentation cannot drift apart. A field is a bool, int, float, str, Path, a tuple of one of these, another settings
dataclass, or one of them `| None`.
"""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import MISSING, Field, asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from .errors import InputError

Settings = TypeVar("Settings")


def setting(default: Any, help: str, *, choices: tuple[str, ...] | None = None, within: str | None = None) -> Any:
    """Return a dataclass field with its help text, for words the words allowed, for numbers the interval: `"(0, 10]"`."""
    return field(default=default, metadata={"help": help, "choices": choices, "within": within})


def check_settings(settings: Any) -> None:
    """Refuse numbers outside their field's interval; for `__post_init__`, so that no such settings can exist.

    Raises
    ------
    InputError
        Names the field.
    """
    # Not `checks.check_range`, which is NumPy's: settings are loaded for --help.
    for item in fields(settings):
        within, value = item.metadata.get("within"), getattr(settings, item.name)
        if within is None or value is None:
            continue
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise InputError("be a number", got=repr(value), key=item.name)
        low, high = (float(end) for end in within[1:-1].split(","))
        above = value >= low if within[0] == "[" else value > low
        below = value <= high if within[-1] == "]" else value < high
        if not (above and below):
            raise InputError(f"lie in {within}", got=f"{value:g}", key=item.name)


def add_flags(parser: argparse.ArgumentParser, kind: type, title: str) -> None:
    """Add a flag per field: `ground_depth` becomes `--ground-depth`; a bool also gets its `--no-` form.

    A tuple takes as many values as it has; settings inside settings have no flags, they come from TOML.
    """
    group = parser.add_argument_group(title)
    hints = get_type_hints(kind)
    for item in fields(kind):
        form = _form(hints[item.name], item)
        if form.nested:
            continue
        flag = "--" + item.name.replace("_", "-")
        default = "" if item.default is MISSING or item.default is None else f" (default: {_plain(item.default)})"
        help = (item.metadata.get("help", "") + default).replace("%", "%%")
        if form.basic is bool:
            group.add_argument(flag, action=argparse.BooleanOptionalAction, default=None, help=help)
        else:
            length = form.length or "+" if form.many else None
            metavar = None if form.choices else form.basic.__name__.upper()
            group.add_argument(flag, type=form.basic, default=None, nargs=length, choices=form.choices, help=help, metavar=metavar)


def from_flags(
    kind: type[Settings], args: argparse.Namespace, toml: dict[str, Any] | None = None, file: Path | None = None
) -> Settings:
    """Combine defaults, TOML table and flags, in rising order of rank.

    Raises
    ------
    InputError
        As `from_mapping`; a value refused by the dataclass names the flag if it came from one.
    """
    settings = from_mapping(kind, toml or {}, file=file)
    given = {item.name: getattr(args, item.name, None) for item in fields(kind)}  # type: ignore[arg-type]
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items() if value is not None}
    try:
        return replace(settings, **given)  # type: ignore[type-var]
    except InputError as error:
        if error.key in given:
            flag = "--" + error.key.replace("_", "-")
            raise InputError(error.must, got=error.got, key=flag, remedy=error.remedy) from error
        raise error.at(file=file) from error


def from_mapping(kind: type[Settings], values: dict[str, Any], *, file: Path | None = None, prefix: str = "") -> Settings:
    """Build settings from a mapping, refusing unknown keys and wrong types at every depth.

    Raises
    ------
    InputError
        Names file and dotted key.
    """
    hints = get_type_hints(kind)
    known = {item.name: item for item in fields(kind)}  # type: ignore[arg-type]
    out: dict[str, Any] = {}
    for name, value in values.items():
        key = prefix + name
        if name not in known:
            raise InputError("be a known setting", file=file, key=key, remedy=f"Known here: {', '.join(known)}.")
        form = _form(hints[name], known[name])
        if form.nested:
            if not isinstance(value, dict):
                raise InputError("be a table of settings", got=repr(value), file=file, key=key)
            out[name] = from_mapping(form.basic, value, file=file, prefix=key + ".")
        elif value is None and form.optional:
            out[name] = None
        elif form.many:
            if not isinstance(value, list | tuple) or (form.length is not None and len(value) != form.length):
                count = "values" if form.length is None else f"{form.length} values"
                raise InputError(f"be a list of {count}", got=repr(value), file=file, key=key)
            out[name] = tuple(_value(form, v, file, f"{key}[{i}]") for i, v in enumerate(value))
        else:
            out[name] = _value(form, value, file, key)
    missing = [n for n, item in known.items() if n not in out and item.default is MISSING and item.default_factory is MISSING]
    if missing:
        raise InputError("be given", file=file, key=prefix + missing[0])
    try:
        return kind(**out)
    except InputError as error:  # a range that the dataclass checks itself
        key = prefix + error.key if error.key is not None else None
        raise InputError(error.must, got=error.got, file=error.file or file, key=key, remedy=error.remedy) from error


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file of settings tables.

    Raises
    ------
    InputError
        If it is missing or no TOML.
    """
    path = Path(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path given to --settings.") from error
    except ValueError as error:  # TOMLDecodeError, or bytes that are no UTF-8
        raise InputError("be TOML", got=error, file=path, remedy="Mend the file.") from error


def read_tables(path: str | None, *names: str) -> tuple[dict[str, Any], Path | None]:
    """Return the tables of a command's `--settings` and the file, for errors; ({}, None) where none was given.

    Raises
    ------
    InputError
        As `read_toml`, or if a table has none of these names.
    """
    if not path:
        return {}, None
    file = Path(path)
    tables = read_toml(path)
    for name in tables:
        if name not in names:
            raise InputError("be a known table", file=file, key=name, remedy=f"Known here: {', '.join(names)}.")
    return tables, file


def as_dict(settings: Any) -> dict[str, Any]:
    """Return plain values for saving beside the output."""
    return _plain(asdict(settings))


def _plain(value: Any) -> Any:
    """Return what JSON can hold: paths as text, tuples as lists, at any depth."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return str(value) if isinstance(value, Path) else value


@dataclass(frozen=True)
class _Form:
    """What a field may hold: `many` values of a `basic` type (`length` of them, or any number), or none at all."""

    basic: Any
    many: bool
    length: int | None
    optional: bool
    choices: tuple[str, ...] | None

    @property
    def nested(self) -> bool:
        return is_dataclass(self.basic)


def _form(hint: Any, item: Field[Any]) -> _Form:
    choices = item.metadata.get("choices")
    optional = many = False
    length = None
    if get_origin(hint) in (Union, UnionType):
        inner = [t for t in get_args(hint) if t is not type(None)]
        optional = len(inner) < len(get_args(hint))
        hint = inner[0]
    if get_origin(hint) in (tuple, list):
        parts = get_args(hint)
        many, length = True, None if get_origin(hint) is list or Ellipsis in parts else len(parts)
        hint = parts[0]
    if get_origin(hint) is Literal:
        choices, hint = get_args(hint), type(get_args(hint)[0])
    return _Form(hint, many, length, optional, choices)


def _value(form: _Form, value: Any, file: Path | None, key: str) -> Any:
    """Check one value against its form."""
    if form.basic is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if form.basic is Path and isinstance(value, str):
        value = Path(value)
    if not isinstance(value, form.basic) or (form.basic is int and isinstance(value, bool)):
        raise InputError(f"be {form.basic.__name__}", got=repr(value), file=file, key=key)
    if form.choices and value not in form.choices:
        raise InputError(f"be one of {', '.join(form.choices)}", got=repr(value), file=file, key=key)
    return value
