"""What was recorded: cameras, images, points, meshes; and how a recorded drive becomes a scene.

`open_recording` reads a drive, `build.build` makes its scene, `read_scene` reads what that wrote.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:  # what a type checker sees of the lazy names below
    from .camera import Camera
    from .images import read_image, write_image
    from .mesh import Mesh, read_ply, write_ply
    from .reconstruction.build_settings import BuildSettings
    from .recording import Recording, read_recording
    from .scene_file import Scene, read_scene, write_scene
    from .sources.recording_source import open_recording

__all__ = [
    "BuildSettings",
    "Camera",
    "Mesh",
    "Recording",
    "Scene",
    "open_recording",
    "read_image",
    "read_ply",
    "read_recording",
    "read_scene",
    "write_image",
    "write_ply",
    "write_scene",
]

__getattr__, __dir__, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "reconstruction.build_settings": ["BuildSettings"],
        "camera": ["Camera"],
        "images": ["read_image", "write_image"],
        "mesh": ["Mesh", "read_ply", "write_ply"],
        "recording": ["Recording", "read_recording"],
        "sources.recording_source": ["open_recording"],
        "scene_file": ["Scene", "read_scene", "write_scene"],
    },
)
