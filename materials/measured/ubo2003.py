"""BTFs of the University of Bonn as pictures (UBO2003): a zip with one photograph per pair of directions.

Names hold the angles in degrees: `…tl015_pl060_tv030_pv090.jpg`, theta and phi of light and view.

References
----------
Sattler, Sarlette and Klein (2003), Efficient and Realistic Visualization of Cloth.
"""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF, pairs
from ..directions import solid_angles, spherical
from ..foundation.errors import InputError
from ..foundation.images import decode
from ..foundation.progress import tracked

Floats = NDArray[np.float64]
_NAME = re.compile(r"tl(\d+)[ _]pl(\d+)[ _]tv(\d+)[ _]pv(\d+)\.(?:jpe?g|png|bmp)$", re.IGNORECASE)
_MAX_BYTES = 16 << 30


@dataclass(frozen=True)
class PictureBTF:
    """A BTF as 8-bit pictures in memory.

    Attributes
    ----------
    wi, wo : (I, 3), (O, 3) float64
    pictures : (T, I, O, 3) uint8
    height, width : int
    name : str
    """

    wi: Floats
    wo: Floats
    pictures: NDArray[np.uint8]
    height: int
    width: int
    name: str

    def block(self, first: int, last: int) -> ABRDF:
        """Return texels as an apparent BRDF, RGB, the cosine in; bytes are taken to be sRGB, the unit is `relative`."""
        value = decode(self.pictures[first:last], "srgb").reshape(last - first, -1, 3)
        wi, wo = pairs(self.wi, self.wo)
        weight = np.outer(solid_angles(self.wi), solid_angles(self.wo)).reshape(-1)
        valid, grid = np.ones(value.shape[:2], bool), (len(self.wi), len(self.wo))
        return ABRDF(wi, wo, value, valid, weight, unit="relative", normalised=False, grid=grid, name=self.name)


def read_ubo2003(path: str | Path, step: int = 1) -> PictureBTF:
    """Read all pictures of a zip.

    Parameters
    ----------
    path : path
    step : int
        Take every so-manyth texel each way: 81 x 81 pictures of 256 x 256 texels are 1.3 GB.

    Raises
    ------
    InputError
        If the file is missing or no zip, a pair of directions is missing or comes twice, or pictures are damaged or differ in size.
    """
    path = Path(path)
    if step < 1:
        raise InputError("be at least 1", got=step, key="step")
    try:
        archive = zipfile.ZipFile(path)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except zipfile.BadZipFile as error:
        raise InputError("be a zip of pictures", got=error, file=path) from error
    with archive:
        named = {name: tuple(map(int, match.groups())) for name in archive.namelist() if (match := _NAME.search(name))}
        if not named:
            raise InputError("hold pictures named tl…_pl…_tv…_pv…", got="none", file=path)
        lights = sorted({angles[:2] for angles in named.values()})
        views = sorted({angles[2:] for angles in named.values()})
        if len(named) != len(lights) * len(views) or len(set(named.values())) != len(named):
            must = f"hold each of {len(lights)} lights x {len(views)} views once"
            raise InputError(must, got=f"{len(named)} pictures", file=path)
        if max(angle[0] for angle in (*lights, *views)) > 90:
            raise InputError("have directions above the horizon", got=max(angle[0] for angle in (*lights, *views)), file=path)
        pictures: NDArray[np.uint8] | None = None
        shape = (0, 0)
        for name, angles in tracked(named.items(), "reading pictures", len(named)):
            picture = _picture(archive, name, path)[::step, ::step]
            if pictures is None:
                shape = picture.shape[:2]
                if picture.size * len(named) > _MAX_BYTES:
                    got = f"{picture.size * len(named) / 2**30:.1f} GiB"
                    raise InputError("fit into 16 GiB", got=got, file=path, remedy="Use a larger step.")
                pictures = np.empty((shape[0] * shape[1], len(lights), len(views), 3), np.uint8)
            if picture.shape[:2] != shape:
                raise InputError(f"hold pictures of {shape}", got=picture.shape[:2], file=path, key=name)
            pictures[:, lights.index(angles[:2]), views.index(angles[2:])] = picture.reshape(-1, 3)
    assert pictures is not None
    wi, wo = (spherical(*np.radians(np.array(angles, np.float64)).T) for angles in (lights, views))
    return PictureBTF(wi, wo, pictures, shape[0], shape[1], path.stem)


def _picture(archive: zipfile.ZipFile, name: str, path: Path) -> NDArray[np.uint8]:
    try:
        picture = cv2.imdecode(np.frombuffer(archive.read(name), np.uint8), cv2.IMREAD_COLOR)
    except (zipfile.BadZipFile, cv2.error, OSError) as error:
        raise InputError("be a picture", got=error, file=path, key=name) from error
    if picture is None:
        raise InputError("be a picture", got="something else", file=path, key=name)
    return np.ascontiguousarray(picture[..., ::-1], np.uint8)
