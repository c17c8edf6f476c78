"""MaterialX: a Lambert or Oren-Nayar base plus one GGX lobe or two, in nodes of its physically based library that say exactly that.

References
----------
MaterialX Physically Based Shading Nodes, version 1.39: oren_nayar_diffuse_bsdf, generalized_schlick_bsdf, add.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..foundation.files import make_folder, replacing
from ..foundation.images import write_exr
from ..svbrdf import SVBRDF
from .as_ggx import as_ggx


def write_materialx(path: str | Path, material: SVBRDF) -> dict[str, float]:
    """Write a material as `.mtlx` with EXR textures in a folder beside it, named like the file.

    Parameters
    ----------
    path : path
    material : SVBRDF
        Other models than GGX are turned into it first (`as_ggx`).

    Returns
    -------
    told : dict of str to float
        `scale` and `relative_variance` of `AsGGX`.

    Notes
    -----
    The base's node is the qualitative model of Oren and Nayar with our sigma as its `roughness`: 0, its default, is Lambert.
    F0 and F90 of a lobe are our F0 and 1 times its scale, so that Schlick's Fresnel is ours; widths are GGX's alpha.
    """
    path = Path(path)
    found = as_ggx(material, material.lobes, "oren_nayar")
    ggx = found.material
    folder = make_folder(path.with_suffix(""))
    f0 = ((ggx.eta - 1) / (ggx.eta + 1)) ** 2
    document = ElementTree.Element("materialx", version="1.39", colorspace="lin_rec709")
    graph = ElementTree.SubElement(document, "nodegraph", name="reflectance")
    textures = {
        "diffuse": (ggx.diffuse, "color3"),
        "normal": (0.5 + 0.5 * ggx.normal, "vector3"),
        "tangent": (0.5 + 0.5 * ggx.frame[:, :, 0], "vector3"),
    }
    if ggx.sigma is not None:
        textures["sigma"] = (ggx.sigma[:, None], "float")
    for k in range(ggx.lobes):
        textures[f"f0_{k}"] = (f0 * ggx.specular[:, k], "color3")
        textures[f"f90_{k}"] = (ggx.specular[:, k], "color3")
        textures[f"alpha_{k}"] = (ggx.alpha[:, k], "vector2")
    for name, (values, kind) in textures.items():
        names = "RGB"[: values.shape[1]] if kind != "float" else "Y"
        picture = ggx.picture(values, 0.5 if kind.startswith("vector") else 0.0).astype(np.float32)
        write_exr(folder / f"{name}.exr", {c: picture[..., i] for i, c in enumerate(names)})
        node = ElementTree.SubElement(graph, "image", name=name, type=kind)
        ElementTree.SubElement(node, "input", name="file", type="filename", value=f"{folder.name}/{name}.exr")
    for name in ("normal", "tangent"):
        _node(graph, "normalmap", f"{name}_world", "vector3", {"in": ("vector3", name)})
    shared = {"normal": ("vector3", "normal_world")}
    matte = {"color": ("color3", "diffuse"), **shared}
    if ggx.sigma is not None:
        matte["roughness"] = ("float", "sigma")
    _node(graph, "oren_nayar_diffuse_bsdf", "matte", "BSDF", matte)
    sum_ = "matte"
    for k in range(ggx.lobes):
        told = {"color0": ("color3", f"f0_{k}"), "color90": ("color3", f"f90_{k}"), "roughness": ("vector2", f"alpha_{k}")}
        _node(graph, "generalized_schlick_bsdf", f"gloss_{k}", "BSDF", {**told, **shared, "tangent": ("vector3", "tangent_world")})
        _node(graph, "add", f"sum_{k}", "BSDF", {"in1": ("BSDF", sum_), "in2": ("BSDF", f"gloss_{k}")})
        sum_ = f"sum_{k}"
    _node(graph, "surface", "lit", "surfaceshader", {"bsdf": ("BSDF", sum_)})
    ElementTree.SubElement(graph, "output", name="out", type="surfaceshader", nodename="lit")
    surface = ElementTree.SubElement(document, "surfacematerial", name=_identifier(material.name), type="material")
    ElementTree.SubElement(surface, "input", name="surfaceshader", type="surfaceshader", nodegraph="reflectance", output="out")
    ElementTree.indent(document)
    with replacing(path) as temporary:
        ElementTree.ElementTree(document).write(temporary, encoding="utf-8", xml_declaration=True)
    return {"scale": found.scale, "relative_variance": found.relative_variance}


def _node(graph: ElementTree.Element, category: str, name: str, kind: str, inputs: dict[str, tuple[str, str]]) -> None:
    node = ElementTree.SubElement(graph, category, name=name, type=kind)
    for key, (type_, source) in inputs.items():
        ElementTree.SubElement(node, "input", name=key, type=type_, nodename=source)


def _identifier(name: str) -> str:
    word = "".join(c if c.isalnum() and c.isascii() else "_" for c in name)
    return f"m_{word}" if not word or word[0].isdigit() else word
