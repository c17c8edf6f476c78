"""The files that a simulation/1 names, textures among them: read once each, written once each."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import numpy as np

from materials.foundation.checks import check_finite
from materials.foundation.errors import InputError

from .images import read_image, write_exr
from .simulation import Texture


def below(root: Path, name: str, key: str) -> Path:
    """Resolve a path that a JSON file names.

    Raises
    ------
    InputError
        If it leaves the folder of the JSON or does not exist.
    """
    if not name or PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
        raise InputError("be a path below the folder of the JSON", got=name, key=key)
    path = root / name
    if not path.exists():
        raise InputError("name a file that exists", got=name, key=key, remedy="Check the path.")
    return path.resolve()


class TextureReader:
    """Reads textures below a folder; a file that is named twice is one array, which the tracer stores once.

    Raises
    ------
    InputError
        As `below`, or if a file is no image or holds NaN or infinity.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._read: dict[tuple[Path, bool], Texture] = {}

    def colour(self, name: str | None, key: str) -> Texture | None:
        """Return (H, W, 3) linear colours; integers are sRGB."""
        return None if name is None else self._texture(name, key, is_colour=True)

    def numbers(self, name: str | None, key: str) -> Texture | None:
        """Return (H, W) or (H, W, 3) numbers that are no colours: integers are a share of the largest."""
        return None if name is None else self._texture(name, key, is_colour=False)

    def _texture(self, name: str, key: str, *, is_colour: bool) -> Texture:
        file = below(self._root, name, key)
        if (file, is_colour) not in self._read:
            image, encoding = read_image(file, None if is_colour else "linear")
            try:
                check_finite(key, image)
            except InputError as error:
                raise error.at(file=file) from error
            if encoding.channels == 1 and not is_colour:
                image = np.ascontiguousarray(image[..., 0])
            self._read[file, is_colour] = image
        return self._read[file, is_colour]


class TextureWriter:
    """Writes textures into `textures/` of a folder, each array once, as EXR."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._written: dict[int, str] = {}

    def colour(self, texture: Texture | None, name: str) -> str | None:
        """Return the path of a colour, grey as three equal channels."""
        if texture is not None and texture.ndim == 2:
            return self._write(texture, name, "RGB", [texture] * 3)
        return self.numbers(texture, name)

    def numbers(self, texture: Texture | None, name: str) -> str | None:
        """Return the path of numbers: one channel stays one, two get an empty third."""
        if texture is None:
            return None
        if texture.ndim == 2:
            return self._write(texture, name, "Y", [texture])
        channels = [*np.moveaxis(texture, -1, 0)[:3]]
        return self._write(texture, name, "RGB", channels + [np.zeros_like(channels[0])] * (3 - len(channels)))

    def _write(self, texture: Texture, name: str, names: str, channels: list[Texture]) -> str:
        if id(texture) not in self._written:
            self._written[id(texture)] = f"textures/{name}.exr"
            pixels = (np.ascontiguousarray(c, np.float32) for c in channels)
            write_exr(self._root / self._written[id(texture)], dict(zip(names, pixels, strict=True)))
        return self._written[id(texture)]
