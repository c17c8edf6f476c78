"""Arrays that cost time, kept by what they were made from, so that an interrupted experiment goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.files import replacing

_ROOT = Path(__file__).resolve().parents[2]


class Cache:
    """A folder of arrays.

    Parameters
    ----------
    folder : path
        Where they are kept. An entry is used again only if its parts and all the code of the four packages are the same.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def array(self, parts: Mapping[str, Any], make: Callable[[], NDArray]) -> NDArray:
        """Return what `make` returns, from the folder if it has been made from the same parts before.

        Parameters
        ----------
        parts : mapping
            Everything that the array depends on; what JSON can hold, and arrays, which count by their content.
        make : function
        """
        return self.arrays(parts, lambda: {"array": make()})["array"]

    def arrays(self, parts: Mapping[str, Any], make: Callable[[], Mapping[str, NDArray]]) -> dict[str, NDArray]:
        """Return what `make` returns, several arrays by name; otherwise as `array`."""
        words = json.dumps({k: _plain(v) for k, v in parts.items()} | {"code": code_digest()}, sort_keys=True)
        file = self.folder / f"{hashlib.sha256(words.encode()).hexdigest()[:24]}.npz"
        if file.exists():
            with np.load(file) as kept:
                return {name: kept[name] for name in kept.files}
        made = dict(make())
        with replacing(file) as temporary, temporary.open("wb") as out:
            np.savez(out, **made)  # type: ignore[arg-type]
        return made


@cache
def code_digest() -> str:
    """Return the hash of the code of all four packages: a change of any makes earlier results another experiment's."""
    digest = hashlib.sha256()
    for package in ("materials", "scene", "transport", "evaluate"):
        for file in sorted((_ROOT / package).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [str(value.dtype), list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    return value
