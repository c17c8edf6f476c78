"""What can be wrong with an installation, one check a function; each says what it found and what to do."""

from __future__ import annotations

import ctypes
import importlib
import importlib.metadata
import os
import platform
import shutil
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

PACKAGES = ("materials", "scene", "transport", "evaluate")
_LIBRARIES = {"libGL.so.1": "libgl1", "libusb-1.0.so.0": "libusb-1.0-0", "libgomp.so.1": "libgomp1"}
_MODULES = {
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "cv2": "opencv-contrib-python-headless",
    "OpenEXR": "openexr",
    "open3d": "open3d",
    "pymeshlab": "pymeshlab",
    "pycolmap": "pycolmap",
    "nlopt": "nlopt",
    "small_gicp": "small_gicp",
    "laspy": "laspy",
    "msgspec": "msgspec",
    "rich": "rich",
    "plyfile": "plyfile",
    "skimage": "scikit-image",
    "matplotlib": "matplotlib",
    "pygltflib": "pygltflib",
}
_SCENE_BYTES = 2 << 30  # a full-size scene with its clouds, meshes and previews


@dataclass(frozen=True)
class Finding:
    """One line of the examination: `fail` means that the toolkit cannot work, `warn` that it may surprise."""

    grade: Literal["ok", "warn", "fail"]
    text: str

    def __str__(self) -> str:
        return f"{self.grade:<5}{self.text}"


def version() -> str:
    """Return the version of the installed distribution, or "not installed" for a bare checkout."""
    try:
        return importlib.metadata.version("meniscus")
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def examine() -> list[Finding]:
    """Run all checks."""
    return [python(), *clashes(), *system_libraries(), *modules(), embree(), machine(), disk(Path.cwd())]


def python() -> Finding:
    """Say what runs here."""
    return Finding("ok", f"meniscus {version()}, Python {platform.python_version()} on {platform.platform()}")


def clashes(distributions: Iterable[importlib.metadata.Distribution] | None = None) -> list[Finding]:
    """Look for other distributions whose packages have the names of ours, and for modules that hide ours.

    Parameters
    ----------
    distributions : iterable, optional
        Where to look; by default everything that is installed here.
    """
    found = []
    for distribution in importlib.metadata.distributions() if distributions is None else distributions:
        name = distribution.metadata["Name"]
        if name == "meniscus":
            continue
        tops = {Path(str(file)).parts[0].removesuffix(".py") for file in distribution.files or [] if str(file).endswith(".py")}
        for package in PACKAGES:
            if package in tops:
                found.append(
                    Finding(
                        "warn",
                        f"the distribution {name} also provides a package named {package}. "
                        "Keep meniscus in an environment of its own (make setup does).",
                    )
                )
    root = Path(__file__).resolve().parent.parent
    for package in PACKAGES:
        file = getattr(importlib.import_module(package), "__file__", None)
        if file is None or Path(file).resolve().parent.parent != root:
            found.append(
                Finding("fail", f"`import {package}` finds {file or 'a stray folder'}, not ours. Use an environment of its own.")
            )
    return found or [Finding("ok", f"nothing else provides {', '.join(PACKAGES)}")]


def system_libraries() -> list[Finding]:
    """Check the shared libraries that the wheels expect from a Linux system."""
    if sys.platform != "linux":
        return []
    findings = []
    for library, package in _LIBRARIES.items():
        try:
            ctypes.CDLL(library)
            findings.append(Finding("ok", library))
        except OSError:
            findings.append(Finding("fail", f"{library} is missing. Debian, Ubuntu: apt-get install {package}; or run make setup."))
    return findings


def modules(names: dict[str, str] | None = None) -> list[Finding]:
    """Import what we depend on, since a wheel may be installed and still not load.

    Parameters
    ----------
    names : dict, optional
        Distribution by module; by default everything that we need.
    """
    findings = []
    for module, distribution in (_MODULES if names is None else names).items():
        try:
            importlib.import_module(module)
            findings.append(Finding("ok", f"{distribution} {importlib.metadata.version(distribution)}"))
        except Exception as error:  # whatever a compiled module throws while it loads
            reason = " ".join(str(error).split())
            findings.append(Finding("fail", f"{distribution} cannot be imported: {reason}. Run make setup."))
    return findings


def embree() -> Finding:
    """Load the ray tracer's library through our own binding."""
    try:
        importlib.import_module("transport.embree")
        return Finding("ok", f"Embree 4 loads (embreex {importlib.metadata.version('embreex')})")
    except Exception as error:
        return Finding("fail", f"Embree cannot be loaded: {' '.join(str(error).split())} Run make setup.")


def machine() -> Finding:
    """Count cores and memory; little memory is a warning."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    text = f"{cores} cores"
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        gib = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30
        text += f", {gib:.1f} GiB of memory"
        if gib < 7:
            return Finding("warn", f"{text}: Poisson at depth 13 wants about 8 GiB. Choose a smaller --ground-depth.")
    return Finding("ok", text)


def disk(folder: Path) -> Finding:
    """Check the space where the user stands."""
    free = shutil.disk_usage(folder).free
    text = f"{free / 2**30:.1f} GiB free at {folder}"
    if free < _SCENE_BYTES:
        return Finding("warn", f"{text}: a scene can take {_SCENE_BYTES / 2**30:.0f} GiB. Free some space or choose another -o.")
    return Finding("ok", text)
