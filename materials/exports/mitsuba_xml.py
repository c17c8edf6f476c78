"""Mitsuba 3: a `principled` surface with bitmaps, bent by a normal map, in a scene file that renders a quad.

References
----------
Burley (2012), Physically-Based Shading at Disney; Mitsuba 3's documentation of `principled` and `normalmap`.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..foundation.files import make_folder, replacing
from ..foundation.images import write_exr
from ..svbrdf import SVBRDF
from .as_ggx import as_ggx

_LARGEST_F0 = 0.08


def write_mitsuba(path: str | Path, material: SVBRDF) -> dict[str, float]:
    """Write a material as `.xml` with EXR textures in a folder beside it, named like the file.

    Parameters
    ----------
    path : path
    material : SVBRDF
        Two lobes, other models than GGX, and an Oren-Nayar base are turned into one GGX lobe on Lambert first (`as_ggx`).

    Returns
    -------
    told : dict of str to float
        `scale` and `relative_variance` of `AsGGX`, and `clipped`: the share of texels whose albedo exceeds 1.

    Notes
    -----
    `principled` has Burley's matte part, which is brighter than Lambert's at grazing angles on rough surfaces, and a white
    gloss with one F0, up to 0.08, for the whole surface: the mean of channels and texels is taken.
    """
    path = Path(path)
    found = as_ggx(material, 1)
    ggx = found.material
    folder = make_folder(path.with_suffix(""))
    f0 = ((ggx.eta - 1) / (ggx.eta + 1)) ** 2 * ggx.specular[:, 0].mean(axis=1)
    smooth, rough = ggx.alpha[:, 0].min(axis=1), ggx.alpha[:, 0].max(axis=1)
    # Disney's: alpha_x = roughness^2 / aspect, alpha_y = roughness^2 aspect, aspect^2 = 1 - 0.9 anisotropic
    anisotropic = np.clip((1 - smooth / rough) / 0.9, 0, 1)
    maps: dict[str, NDArray] = {
        "base_color": np.clip(ggx.diffuse, 0, 1),
        "roughness": np.sqrt(np.sqrt(smooth * rough)),
    }
    scene = ElementTree.Element("scene", version="3.0.0")
    bent = ElementTree.SubElement(scene, "bsdf", type="normalmap", id="material")
    _bitmap(folder, bent, "normalmap", ggx.picture(0.5 + 0.5 * ggx.normal, 0.5))
    surface = ElementTree.SubElement(bent, "bsdf", type="principled")
    for name, values in maps.items():
        _bitmap(folder, surface, name, ggx.picture(values))
    strength = float(np.clip(f0.mean() / _LARGEST_F0, 1e-3, 1))
    ElementTree.SubElement(surface, "float", name="specular", value=f"{strength:.6g}")
    if (anisotropic > 0.05).any():
        _bitmap(folder, surface, "anisotropic", ggx.picture(anisotropic))
    shape = ElementTree.SubElement(scene, "shape", type="rectangle")
    ElementTree.SubElement(shape, "ref", id="material")
    light = ElementTree.SubElement(scene, "emitter", type="directional")
    ElementTree.SubElement(light, "vector", name="direction", value="0.3, -0.3, -1")
    sensor = ElementTree.SubElement(scene, "sensor", type="perspective")
    ElementTree.SubElement(sensor, "float", name="fov", value="40")
    turn = ElementTree.SubElement(sensor, "transform", name="to_world")
    ElementTree.SubElement(turn, "lookat", origin="0, 0, 3", target="0, 0, 0", up="0, 1, 0")
    ElementTree.SubElement(scene, "integrator", type="path")
    ElementTree.indent(scene)
    with replacing(path) as temporary:
        ElementTree.ElementTree(scene).write(temporary, encoding="utf-8")
    clipped = float((ggx.diffuse > 1).any(axis=1).mean())
    return {"scale": found.scale, "relative_variance": found.relative_variance, "clipped": clipped}


def _bitmap(folder: Path, parent: ElementTree.Element, name: str, picture: NDArray) -> None:
    channels = {"RGB"[i]: picture[..., i] for i in range(3)} if picture.ndim == 3 else {"Y": picture}
    write_exr(folder / f"{name}.exr", {key: value.astype(np.float32) for key, value in channels.items()})
    texture = ElementTree.SubElement(parent, "texture", type="bitmap", name=name)
    ElementTree.SubElement(texture, "string", name="filename", value=f"{folder.name}/{name}.exr")
    ElementTree.SubElement(texture, "boolean", name="raw", value="true")
    # Mitsuba has the first row at v = 0 and v rising with y; here the first row is on top.
    turn = ElementTree.SubElement(texture, "transform", name="to_uv")
    ElementTree.SubElement(turn, "scale", x="1", y="-1")
