"""Steps whose results are kept by the content of their inputs: what did not change is not done again."""

from __future__ import annotations

import hashlib
import json
import resource
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, read_json, replacing_folder, write_json
from materials.foundation.progress import logger

# Raise it when a stage's code changes its results: results of older code are then made anew.
CODE_VERSION = "5"
_KEY = "stage.json"


@dataclass(frozen=True)
class StageResult:
    """What a stage left.

    Attributes
    ----------
    folder : Path
        Where its files are.
    digest : str
        Of their content; an input of the stages that read them.
    seconds : float
        How long it took when it was run.
    peak_bytes : int
        Largest memory of the process up to its end, when it was run.
    reused : bool
        Whether it was found done.
    """

    folder: Path
    digest: str
    seconds: float
    peak_bytes: int
    reused: bool


class Stages:
    """Runs stages below one folder and remembers what came of them.

    Parameters
    ----------
    folder : path
        Gets a folder per stage, each made as a whole or not at all.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = make_folder(folder)
        self.results: dict[str, StageResult] = {}

    def run(self, name: str, inputs: dict[str, Any], make: Callable[[Path], None]) -> StageResult:
        """Return the stage's result, making it if its inputs, the code's version or its files changed.

        Parameters
        ----------
        name : str
            Of the stage, and of its folder.
        inputs : dict
            Everything the result depends on, as plain values: settings, digests of files and of earlier stages.
        make : callable
            Writes the files of the result into the folder it is given.
        """
        key = digest_of({"stage": name, "code": CODE_VERSION, "inputs": inputs})
        target = self.folder / name
        found = self._found(target, key)
        if found is None:
            logger.info("%s …", name)
            start = time.perf_counter()
            with replacing_folder(target) as temporary:
                make(temporary)
                seconds = time.perf_counter() - start
                files = {path.relative_to(temporary).as_posix(): file_digest(path) for path in _files(temporary)}
                peak = _peak_bytes()
                write_json(temporary / _KEY, {"key": key, "files": files, "seconds": round(seconds, 3), "peak_bytes": peak})
            found = StageResult(target, digest_of(files), seconds, peak, False)
            logger.info("%s: %.1f s", name, seconds)
        else:
            logger.info("%s: unchanged, kept", name)
        self.results[name] = found
        return found

    def _found(self, target: Path, key: str) -> StageResult | None:
        if not (target / _KEY).exists():
            return None
        try:
            note = read_json(target / _KEY)
        except InputError:
            return None
        if not isinstance(note, dict) or note.get("key") != key:
            return None
        files = note["files"]
        present = {path.relative_to(target).as_posix(): file_digest(path) for path in _files(target)}
        if present != files:
            logger.info("%s: its files were changed or removed, made anew", target.name)
            return None
        return StageResult(target, digest_of(files), note["seconds"], note["peak_bytes"], True)


def digest_of(value: Any) -> str:
    """Return a digest of plain values (as JSON, keys sorted)."""
    return hashlib.blake2b(json.dumps(value, sort_keys=True, allow_nan=False).encode(), digest_size=16).hexdigest()


def file_digest(path: str | Path) -> str:
    """Return a digest of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _files(folder: Path) -> Iterable[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and path.name != _KEY)


def _peak_bytes() -> int:
    # Linux counts in kB (macOS in bytes; the number is for the report only).
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
