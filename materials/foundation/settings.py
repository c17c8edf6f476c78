"""Settings of a stage: a frozen dataclass whose values come from defaults, then a TOML file, then flags.

Each field carries its help text (`setting(default, "help")`), so that the command's flags, the TOML keys and the
documentation cannot drift apart.
"""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import MISSING, asdict, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from .errors import InputError

Settings = TypeVar("Settings")


def setting(default: Any, help: str, *, choices: tuple[str, ...] | None = None) -> Any:
    """Return a dataclass field with its help text and, for words, the words allowed."""
    return field(default=default, metadata={"help": help, "choices": choices})


def add_flags(parser: argparse.ArgumentParser, kind: type, title: str) -> None:
    """Add a flag per field: `ground_depth` becomes `--ground-depth`; a bool also gets its `--no-` form."""
    group = parser.add_argument_group(title)
    hints = get_type_hints(kind)
    for item in fields(kind):
        flag = "--" + item.name.replace("_", "-")
        help = f"{item.metadata['help']} (default: {item.default})"
        basic = _basic(hints[item.name])
        if basic is bool:
            group.add_argument(flag, action=argparse.BooleanOptionalAction, default=None, help=item.metadata["help"])
        else:
            group.add_argument(
                flag, type=basic, default=None, choices=item.metadata["choices"], help=help.replace("%", "%%"), metavar=basic.__name__.upper()
            )


def from_flags(kind: type[Settings], args: argparse.Namespace, toml: dict[str, Any] | None = None, file: Path | None = None) -> Settings:
    """Combine defaults, TOML table and flags, in rising order of rank."""
    settings = from_mapping(kind, toml or {}, file=file)
    given = {item.name: getattr(args, item.name, None) for item in fields(kind)}  # type: ignore[arg-type]
    return replace(settings, **{name: value for name, value in given.items() if value is not None})  # type: ignore[type-var]


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
        hint = hints[name]
        if is_dataclass(hint):
            out[name] = from_mapping(hint, value, file=file, prefix=key + ".")  # type: ignore[arg-type]
            continue
        basic = _basic(hint)
        if basic is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if value is not None and (not isinstance(value, basic) or (basic is int and isinstance(value, bool))):
            raise InputError(f"be {basic.__name__}", got=repr(value), file=file, key=key)
        choices = known[name].metadata.get("choices")
        if choices and value not in choices:
            raise InputError(f"be one of {', '.join(choices)}", got=repr(value), file=file, key=key)
        out[name] = value
    missing = [n for n, item in known.items() if n not in out and item.default is MISSING and item.default_factory is MISSING]
    if missing:
        raise InputError("be given", file=file, key=prefix + missing[0])
    return kind(**out)


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
    except tomllib.TOMLDecodeError as error:
        raise InputError("be TOML", got=error, file=path) from error


def as_dict(settings: Any) -> dict[str, Any]:
    """Return plain values for saving beside the output."""
    return {k: str(v) if isinstance(v, Path) else v for k, v in asdict(settings).items()}


def _basic(hint: Any) -> type:
    """Strip `| None` off a type."""
    inner = [t for t in get_args(hint) if t is not type(None)]
    return inner[0] if inner else hint
