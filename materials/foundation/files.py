"""Files that are whole or absent: written under a temporary name, then renamed."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from .errors import InputError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it takes the name at the end, or vanishes if anything fails.

    The suffix is kept, since image and mesh writers choose their format by it.

    Raises
    ------
    InputError
        If `path` is a folder, or its folder cannot be made or written to.
    OSError
        If the disk fails or is full; its `filename` is `path`, the name that the user knows.
    """
    path = Path(path)
    make_folder(path.parent)
    if path.is_dir():
        raise InputError("be a file", got="a folder", file=path, remedy="Choose another name.")
    temporary = None
    try:
        with _writable(path):
            handle, name = tempfile.mkstemp(prefix=_hidden(path.stem), suffix=path.suffix, dir=path.parent)
        temporary = Path(name)
        os.close(handle)
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
            _name(error, temporary, path)
        raise


@contextmanager
def replacing_folder(path: str | Path) -> Iterator[Path]:
    """As `replacing`, for a folder: an earlier one of that name is replaced as a whole, and kept if anything fails.

    Raises
    ------
    InputError, OSError
        As `replacing`.
    """
    path = Path(path)
    make_folder(path.parent)
    if path.exists() and not path.is_dir():
        raise InputError("be a folder", got="a file", file=path, remedy="Choose another name.")
    temporary = earlier = None
    try:
        with _writable(path):
            temporary = Path(tempfile.mkdtemp(prefix=_hidden(path.name), dir=path.parent))
        yield temporary
        temporary.chmod(0o777 & ~_umask())
        if path.exists():
            # A folder with content cannot be renamed over, so the earlier one steps aside for a moment.
            earlier = Path(tempfile.mkdtemp(prefix=_hidden(path.name), dir=path.parent)) / path.name
            path.replace(earlier)
        temporary.replace(path)
    except BaseException as error:
        if earlier is not None and earlier.exists() and not path.exists():
            earlier.replace(path)
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
            _name(error, temporary, path)
        raise
    finally:
        if earlier is not None:
            shutil.rmtree(earlier.parent, ignore_errors=True)


def make_folder(path: str | Path) -> Path:
    """Create a folder with its parents.

    Raises
    ------
    InputError
        If a file is in the way or the place cannot be written to.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError("be a folder", got="a file", file=path, remedy="Choose another place.") from error
    except PermissionError as error:
        _refuse_place(path, error)
    return path


def write_json(path: str | Path, value: object) -> None:
    """Write JSON that a person can read: two spaces, keys in the given order, floats as Python prints them."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8")


def read_json(path: str | Path) -> object:
    """Read a JSON file.

    Raises
    ------
    InputError
        If it is missing or is no JSON (which has no NaN and no infinity); names line and column.
    """
    path = Path(path)
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except json.JSONDecodeError as error:
        raise InputError(
            "be JSON", got=f"{error.msg} at line {error.lineno}, column {error.colno}", file=path, remedy="Mend the file."
        ) from error
    except ValueError as error:
        raise InputError("be JSON in UTF-8", got=error, file=path, remedy="Mend the file.") from error


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"the constant {name}, which JSON does not have")


@contextmanager
def _writable(path: Path) -> Iterator[None]:
    """Word the refusal of a folder that exists but takes no files."""
    try:
        yield
    except PermissionError as error:
        _refuse_place(path, error)


def _refuse_place(path: Path, error: PermissionError) -> NoReturn:
    raise InputError(
        "be in a folder that can be written to", file=path, remedy="Choose another place or change its permissions."
    ) from error


def _hidden(name: str) -> str:
    # File systems allow 255 bytes; a name that fills them would leave no room for the random part.
    return f".{name[:40]}-"


def _name(error: BaseException, temporary: Path, path: Path) -> None:
    """Let a failure name the file that the user knows: not the temporary one, and not nothing, as a full disk does."""
    if isinstance(error, OSError) and error.errno is not None:
        given = error.filename
        if given is None:
            error.filename = str(path)
        elif isinstance(given, str | os.PathLike):
            error.filename = str(given).replace(str(temporary), str(path))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
