"""JSON files of ours into typed structs, refused in the user's words: file, key as typed, what was expected, remedy."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TypeVar, get_args, get_type_hints

import msgspec

from .errors import InputError

Kind = TypeVar("Kind")


def read_typed_json(path: str | Path, kind: type[Kind], remedy: str = "See docs/formats.md.") -> Kind:
    """Read a JSON file as a msgspec struct.

    Parameters
    ----------
    path : path
        The file.
    kind : type
        A `msgspec.Struct` with `forbid_unknown_fields`.
    remedy : str
        What to do about content that the format does not have.

    Raises
    ------
    InputError
        If the file is missing or no JSON, or a key is unknown, missing or of the wrong kind, at any depth.
    """
    path = Path(path)
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except msgspec.ValidationError as error:
        raise _worded(str(error), path, remedy, kind) from error
    except msgspec.DecodeError as error:
        raise InputError("be JSON", got=error, file=path, remedy="Mend the file.") from error


def _worded(message: str, path: Path, remedy: str, kind: type) -> InputError:
    """Turn msgspec's message (`Expected `int`, got `str` - at `$.frames[0].camera.width``) into ours."""
    text, _, place = message.partition(" - at `")
    key = place.rstrip("`").removeprefix("$").lstrip(".").replace("[...]", "") or None
    if match := re.fullmatch(r"Object contains unknown field `(.*)`", text):
        return InputError("be a known key", file=path, key=_join(key, match[1]), remedy=f"Check its spelling. {remedy}")
    if match := re.fullmatch(r"Object missing required field `(.*)`", text):
        return InputError("be given", file=path, key=_join(key, match[1]), remedy=remedy)
    if match := re.fullmatch(r"Expected `(.*)`, got `(.*)`", text):
        return InputError(f"be {match[1]}", got=match[2], file=path, key=key, remedy=remedy)
    if match := re.fullmatch(r"Invalid enum value (.*)", text):
        if key == "format":
            known = " or ".join(str(word) for word in get_args(get_type_hints(kind)["format"]))
            return InputError(f"be {known}", got=match[1], file=path, key=key, remedy=remedy)
        return InputError("be a word that the format knows", got=match[1], file=path, key=key, remedy=remedy)
    return InputError("be valid", got=text[:1].lower() + text[1:], file=path, key=key, remedy=remedy)


def _join(key: str | None, name: str) -> str:
    return f"{key}.{name}" if key else name
