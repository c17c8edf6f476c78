"""Compiled code of the lowest floor; all other kernels import it first, so Numba is set up here.

Numba's cache on disk tells a stale function by its own file alone: after a change to what it calls, a caller would go on
with the old code. So the cache lies in a folder named after the contents of all kernels of the checkout.
"""

import hashlib
import os
import shutil
import time
from pathlib import Path

import numba

# OpenMP before TBB: the TBB that embreex brings is older than Numba asks for, which it would warn about at each start.
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]  # pyright: ignore[reportAttributeAccessIssue]

_ROOT = Path(__file__).resolve().parent.parent.parent
_KEPT_DAYS = 30


def _cache_folder() -> Path:
    digest = hashlib.sha256()
    for package in ("materials", "scene", "transport", "evaluate"):
        for file in sorted((_ROOT / package / "kernels").glob("*.py")):
            digest.update(file.read_bytes())
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "meniscus" / "numba"
    return base / digest.hexdigest()[:16]


def _prune(base: Path) -> None:
    """Remove the caches of versions not used for a month."""
    for folder in base.glob("*"):
        if time.time() - folder.stat().st_mtime > _KEPT_DAYS * 86400:
            shutil.rmtree(folder, ignore_errors=True)


if not os.environ.get("NUMBA_CACHE_DIR"):
    try:
        _folder = _cache_folder()
        _folder.mkdir(parents=True, exist_ok=True)
        os.utime(_folder)
        _prune(_folder.parent)
        numba.config.CACHE_DIR = str(_folder)  # pyright: ignore[reportAttributeAccessIssue]
    except OSError:
        pass  # without a home to write to, Numba caches beside the code or not at all
