"""The renderers that we measure against: installed on demand, with the versions and hashes of the lock files."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

CHECKOUT = Path(__file__).resolve().parent.parent
_OLDEST_LLVM = 18
_BLENDER_LIBRARIES = "libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libegl1"


class PeerMissing(RuntimeError):
    """A peer cannot be had here; the message says why."""


def mitsuba(variant: str = "llvm_ad_rgb") -> ModuleType:
    """Return Mitsuba 3 set to a variant, installed into this environment first if need be.

    Raises
    ------
    PeerMissing
        If it cannot be installed, or the variant does not start (the LLVM variants need libLLVM; `scalar_rgb` needs none).
    """
    try:
        module = importlib.import_module("mitsuba")
    except ModuleNotFoundError:
        _install(Path(sys.executable), CHECKOUT / "requirements-peers.lock", "Mitsuba 3")
        importlib.invalidate_caches()
        module = importlib.import_module("mitsuba")
    if variant.startswith("llvm") and "DRJIT_LIBLLVM_PATH" not in os.environ and (library := _llvm()) is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    try:
        module.set_variant(variant)
    except (ImportError, AttributeError) as error:
        raise PeerMissing(f"Mitsuba's variant {variant} does not start: {error}") from error
    return module


def ceres() -> ModuleType:
    """Return pyceres, installed into this environment first if need be.

    Raises
    ------
    PeerMissing
        If it cannot be installed.
    """
    try:
        return importlib.import_module("pyceres")
    except ModuleNotFoundError:
        _install(Path(sys.executable), CHECKOUT / "requirements-peers.lock", "Ceres")
        importlib.invalidate_caches()
        return importlib.import_module("pyceres")


def blender_python() -> Path:
    """Return a Python that can `import bpy` (Blender as a module), in an environment of its own, `.venv/blender`.

    Blender's module needs Python 3.11 and a NumPy older than ours, so a benchmark runs it as a process.

    Raises
    ------
    PeerMissing
        If there is no Python 3.11, or it cannot be installed or started.
    """
    folder = CHECKOUT / ".venv" / "blender"
    python = folder / "bin" / "python"
    if not (folder / "complete").exists():
        base = sys.executable if sys.version_info[:2] == (3, 11) else shutil.which("python3.11")
        if base is None:
            raise PeerMissing(
                "Blender's Python module needs Python 3.11, which is not here. Install python3.11 with its venv module."
            )
        subprocess.run([base, "-m", "venv", "--clear", str(folder)], check=True)
        _install(python, CHECKOUT / "requirements-blender.lock", "Blender")
        (folder / "complete").touch()
    result = subprocess.run([python, "-c", "import bpy"], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        reason = (result.stderr.strip() or "no message").splitlines()[-1]
        raise PeerMissing(f"Blender's module does not start: {reason}. On Debian: apt-get install {_BLENDER_LIBRARIES}")
    return python


def _install(python: Path, lock: Path, name: str) -> None:
    print(f"installing {name} from {lock.name} into {python.parent.parent} …", file=sys.stderr, flush=True)
    command = [str(python), "-m", "pip", "install", "-q", "-q", "--disable-pip-version-check", "--require-hashes", "-r", str(lock)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        reason = (result.stderr.strip() or "no message").splitlines()[-1]
        raise PeerMissing(f"{name} cannot be installed: {reason}")


def _llvm() -> Path | None:
    """Find the newest libLLVM: Dr.Jit looks only for the name without a version, which Debian's packages do not have.

    Code for recent processors makes those before 18 abort ("Cannot select fminimum"), with all of Python.
    """
    found: dict[int, Path] = {}
    for pattern in ("libLLVM.so.*", "libLLVM-*.so*"):
        for path in Path("/usr/lib").glob(f"*-linux-gnu/{pattern}"):
            if version := re.search(r"libLLVM(?:\.so\.|-)(\d+)", path.name):
                found[int(version[1])] = path
    if found and max(found) < _OLDEST_LLVM:
        raise PeerMissing(f"Mitsuba needs LLVM {_OLDEST_LLVM} or newer, found {max(found)}. On Debian: apt-get install libllvm19")
    return found[max(found)] if found else None
