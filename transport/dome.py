"""A virtual dome: the reflectance field of a height field, acquired light by light and view by view as the real one does.

The surface is seen through the texels of the plane z = 0: relief moves in parallax within them, masks and shadows itself, and
sends light to itself. What comes out is an apparent BRDF per texel (thesis, 2.4 and 4.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from materials.abrdf import ABRDF, pairs
from materials.directions import even_directions, solid_angles
from materials.foundation.checks import check_finite, check_range, check_shape
from materials.foundation.errors import InputError
from materials.foundation.settings import check_settings, setting
from materials.kernels.kinds import COOK_TORRANCE, GGX, PHONG, WARD

from .embree import EmbreeScene
from .kernels import dome as kernel

Floats = NDArray[np.float64]
_KINDS = {"ggx": GGX, "ct": COOK_TORRANCE, "ward": WARD, "phong": PHONG}


@dataclass(frozen=True)
class Relief:
    """A planar sample that repeats in both directions.

    Attributes
    ----------
    height : (H, W) float64
        Above the plane z = 0 [m]; row 0 is at the largest y, x rises with the column.
    texel : float
        Width of a cell [m].
    albedo : (H, W, 3) float64
    specular_scale : (H, W) float64
    alpha : (H, W, 2) float64
        Widths along x and y of the surface.
    model : str
        `ggx`, `ct`, `ward` or `phong`.
    eta : float
    tint : (3,) float
        Colour of the gloss.
    name : str
    """

    height: Floats
    texel: float
    albedo: Floats
    specular_scale: Floats
    alpha: Floats
    model: str = "ggx"
    eta: float = 1.5
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = ""

    def __post_init__(self) -> None:
        shape = self.height.shape
        check_shape("height", self.height, (None, None))
        check_finite("height", self.height)
        check_shape("albedo", self.albedo, (*shape, 3))
        check_shape("specular_scale", self.specular_scale, shape)
        check_shape("alpha", self.alpha, (*shape, 2))
        check_range("texel", self.texel, "(0, inf)")
        check_range("albedo", self.albedo, "[0, 1]")
        check_range("alpha", self.alpha, "(0, 1]")
        check_range("specular_scale", self.specular_scale, "[0, inf)")
        if self.model not in _KINDS:
            raise InputError(f"be one of {', '.join(_KINDS)}", got=self.model, key="model")


@dataclass(frozen=True)
class DomeSettings:
    """How the dome measures."""

    lights: int = setting(151, "directions of light", within="[1, 4096]")
    views: int = setting(151, "directions of view", within="[1, 4096]")
    rim_deg: float = setting(75.0, "largest elevation angle of both", within="(0, 80]")
    samples: int = setting(4, "paths per texel and view; each serves all lights", within="[1, 65536]")
    bounces: int = setting(3, "scattering events per path; 1 is direct light", within="[1, 64]")
    seed: int = setting(0, "seed of the paths", within="[0, 4294967295]")

    def __post_init__(self) -> None:
        check_settings(self)


def acquire(relief: Relief, settings: DomeSettings = DomeSettings(), texels: NDArray | None = None) -> ABRDF:
    """Measure a sample.

    Parameters
    ----------
    relief : Relief
    settings : DomeSettings
    texels : (T, 2) int, optional
        Rows and columns of some of the texels only; by default all, in row order.

    Returns
    -------
    abrdf : ABRDF
        On the grid of lights and views, not normalised (the irradiance's cosine is in), with a mask if all texels are measured.

    Raises
    ------
    InputError
        If a texel lies outside the sample.

    Notes
    -----
    A texel takes lights x views x 12 bytes: 270 kB at 151 x 151. Paths that leave the sample and its copies sideways are lost;
    copies reach as far as the relief can cast a shadow at the rim.
    """
    height, width = relief.height.shape
    if texels is None:
        places = np.argwhere(np.ones((height, width), bool))
    else:
        places = np.asarray(texels, np.int64)
        check_shape("texels", places, (None, 2))
        if (places < 0).any() or (places >= (height, width)).any():
            raise InputError(f"lie within {(height, width)}", got=places.max(axis=0).tolist(), key="texels")
    wi, wo = even_directions(settings.lights, settings.rim_deg), even_directions(settings.views, settings.rim_deg)
    # In texels instead of metres: how far rays start off a surface suits lengths about 1. Reflectance has no length.
    relief = replace(relief, height=relief.height / relief.texel, texel=1.0)
    scene, top = _mesh(relief, settings.rim_deg)
    maps = np.concatenate([relief.albedo, relief.specular_scale[..., None], relief.alpha], axis=2).astype(np.float64)
    out = np.zeros((len(places), len(wi), len(wo), 3), np.float32)
    tint = tuple(float(c) for c in relief.tint)
    given = (scene.handle, _slopes(relief), maps, relief.texel, top, _KINDS[relief.model], float(relief.eta), tint)
    kernel.acquire(*given, places.astype(np.int64), wi, wo, settings.samples, settings.bounces, np.uint32(settings.seed), out)
    both = pairs(wi, wo)
    weight = np.outer(solid_angles(wi), solid_angles(wo)).reshape(-1)
    value = out.reshape(len(places), -1, 3)
    mask = np.ones((height, width), bool) if texels is None else None
    valid = np.ones(value.shape[:2], bool)
    grid = (len(wi), len(wo))
    return ABRDF(*both, value, valid, weight, unit="1/sr", normalised=False, grid=grid, mask=mask, name=relief.name)


def _slopes(relief: Relief) -> Floats:
    """Return dz/dx and dz/dy (H, W, 2) by central differences, repeating."""
    h = relief.height
    by_x = (np.roll(h, -1, axis=1) - np.roll(h, 1, axis=1)) / (2 * relief.texel)
    by_y = (np.roll(h, 1, axis=0) - np.roll(h, -1, axis=0)) / (2 * relief.texel)
    return np.ascontiguousarray(np.stack([by_x, by_y], axis=-1))


def _mesh(relief: Relief, rim_deg: float) -> tuple[EmbreeScene, float]:
    """Return the relief and its copies as triangles with corners at cell centres, and a height above all of it."""
    height, width = relief.height.shape
    amplitude = float(np.ptp(relief.height))
    reach = amplitude * np.tan(np.radians(rim_deg)) + 2 * float(np.abs(relief.height).max()) * np.tan(np.radians(rim_deg))
    copies = [int(np.ceil(reach / (n * relief.texel))) + 1 for n in (height, width)]
    if max(copies) > 64:
        raise InputError(
            "be low beside its width", got=f"{amplitude:g} texels", key="height", remedy="Give a larger piece or less relief."
        )
    rows = np.arange(-copies[0] * height, (copies[0] + 1) * height + 1)
    cols = np.arange(-copies[1] * width, (copies[1] + 1) * width + 1)
    z = relief.height[np.ix_(rows % height, cols % width)]
    x, y = np.meshgrid((cols + 0.5) * relief.texel, (height - rows - 0.5) * relief.texel)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    i = np.arange((len(rows) - 1) * len(cols)).reshape(-1, len(cols))[:, :-1].ravel()
    down = i + len(cols)
    faces = np.concatenate([np.stack([i, down, i + 1], axis=1), np.stack([i + 1, down, down + 1], axis=1)])
    top = max(float(np.abs(relief.height).max()), relief.texel)
    return EmbreeScene(vertices, faces.astype(np.uint32)), top
