"""The binding to Intel Embree 4: find the library that embreex ships, build scenes, let compiled kernels shoot rays.

Embree is called directly from Numba loops: the addresses of `rtcIntersect1` and `rtcOccluded1` are registered with
LLVM under their names, which (unlike a ctypes pointer) keeps the kernels cacheable on disk.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
from pathlib import Path

import llvmlite.binding
import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

_TRIANGLES = 0
_VERTEX_BUFFER, _INDEX_BUFFER = 1, 0
_FLOAT3, _UINT3 = 0x9003, 0x5003
_ROBUST = 1 << 2
_QUALITY_HIGH = 2
_VERSION_PROPERTY = 0
_ERRORS = {
    1: "unknown error",
    2: "invalid argument",
    3: "invalid operation",
    4: "out of memory",
    5: "unsupported processor",
    6: "cancelled",
}


def _library_path() -> Path:
    """Find Embree's shared library among the files that embreex installed, on Linux, macOS and Windows."""
    try:
        files = importlib.metadata.files("embreex") or []
    except importlib.metadata.PackageNotFoundError as error:
        raise InputError("be installed", key="embreex", remedy="Run `pip install embreex`.") from error
    for file in files:
        if "embree4" in file.name and (".so" in file.name or file.suffix in (".dylib", ".dll")):
            path = Path(str(file.locate())).resolve()
            if path.exists():
                return path
    raise InputError(
        "bring the Embree 4 library",
        got="no file named *embree4*",
        key="embreex",
        remedy="Reinstall it: `pip install --force-reinstall embreex`.",
    )


def _load() -> ctypes.CDLL:
    path = _library_path()
    # Importing embreex first lets its wheel set up the search path of Embree's own dependency (TBB).
    import embreex.rtcore_scene  # noqa: F401  # pyright: ignore[reportMissingImports, reportUnusedImport]

    library = ctypes.CDLL(str(path))
    p, u, z = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
    signatures = {
        "rtcNewDevice": (p, [ctypes.c_char_p]),
        "rtcGetDeviceProperty": (ctypes.c_ssize_t, [p, ctypes.c_int]),
        "rtcGetDeviceError": (ctypes.c_int, [p]),
        "rtcNewScene": (p, [p]),
        "rtcSetSceneFlags": (None, [p, ctypes.c_int]),
        "rtcSetSceneBuildQuality": (None, [p, ctypes.c_int]),
        "rtcCommitScene": (None, [p]),
        "rtcReleaseScene": (None, [p]),
        "rtcNewGeometry": (p, [p, ctypes.c_int]),
        "rtcSetSharedGeometryBuffer": (None, [p, ctypes.c_int, u, ctypes.c_int, p, z, z, z]),
        "rtcCommitGeometry": (None, [p]),
        "rtcAttachGeometryByID": (None, [p, p, u]),
        "rtcReleaseGeometry": (None, [p]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    for name in ("rtcIntersect1", "rtcOccluded1"):
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        llvmlite.binding.add_symbol(name, address)
    return library


_library = _load()
_device = _library.rtcNewDevice(None)
version = _library.rtcGetDeviceProperty(_device, _VERSION_PROPERTY)
if not 40000 <= version < 50000:
    raise InputError(
        "be Embree 4", got=f"version {version}", key="embreex", remedy="Install a release of embreex that ships Embree 4."
    )


class EmbreeScene:
    """Triangles that rays can be shot at; `handle` is what the kernels take.

    Parameters
    ----------
    vertices : (V, 3) float32
        Positions [m].
    faces : (F, 3) uint32
        Vertex indices.
    geometry : int
        The id that hits on this scene report, so that scenes traced one after the other can be told apart.

    Raises
    ------
    InputError
        If Embree refuses, which with valid arrays means that memory ran out.
    """

    def __init__(self, vertices: NDArray[np.float32], faces: NDArray[np.uint32], geometry: int = 0) -> None:
        # Embree loads vertices 16 bytes at a time: the last one needs readable bytes behind it.
        self._vertices = np.zeros((len(vertices) + 2, 3), np.float32)
        self._vertices[: len(vertices)] = vertices
        self._faces = np.ascontiguousarray(faces, np.uint32)
        self.handle = 0
        scene = _library.rtcNewScene(_device)
        # Without the robust flag rays slip through shared edges.
        _library.rtcSetSceneFlags(scene, _ROBUST)
        _library.rtcSetSceneBuildQuality(scene, _QUALITY_HIGH)
        mesh = _library.rtcNewGeometry(_device, _TRIANGLES)
        shared = _library.rtcSetSharedGeometryBuffer
        shared(mesh, _VERTEX_BUFFER, 0, _FLOAT3, self._vertices.ctypes.data, 0, 12, len(vertices))
        shared(mesh, _INDEX_BUFFER, 0, _UINT3, self._faces.ctypes.data, 0, 12, len(faces))
        _library.rtcCommitGeometry(mesh)
        _library.rtcAttachGeometryByID(scene, mesh, geometry)
        _library.rtcReleaseGeometry(mesh)
        _library.rtcCommitScene(scene)
        self.handle = int(scene)
        code = _library.rtcGetDeviceError(_device)
        if code:
            raise InputError("be accepted by Embree", got=_ERRORS.get(code, code), key=f"a mesh of {len(faces)} triangles")

    def __del__(self) -> None:
        if getattr(self, "handle", 0):
            _library.rtcReleaseScene(self.handle)
