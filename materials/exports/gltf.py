"""glTF 2.0: a quad with a metallic-roughness material in one binary file, which Blender and viewers open.

The gloss goes into KHR_materials_specular and KHR_materials_ior, unequal widths into KHR_materials_anisotropy, and the narrow
one of two lobes into KHR_materials_clearcoat.

References
----------
Khronos (2021), glTF 2.0 Specification, appendix B; and the extensions of these names.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..foundation.files import replacing
from ..foundation.images import Encoding, encode
from ..svbrdf import SVBRDF
from .as_ggx import as_ggx

Floats = NDArray[np.float64]


def write_gltf(path: str | Path, material: SVBRDF) -> dict[str, float]:
    """Write a material as `.glb`.

    Parameters
    ----------
    path : path
    material : SVBRDF
        Other models than GGX, and an Oren-Nayar base, are turned into GGX on Lambert first (`as_ggx`).

    Returns
    -------
    told : dict of str to float
        `scale` and `relative_variance` of `AsGGX`, and `clipped`: the share of texels whose albedo or coat exceeds 1.

    Notes
    -----
    glTF dims the base by what the gloss reflects in its strongest channel; the base colour is raised by what is lost at
    normal incidence. Its gloss has one strength at grazing angles for all channels. The coat's F0 is 0.04 and it is white:
    its strength is the mean of the channels times F0 over 0.04.
    """
    import pygltflib

    found = as_ggx(material, material.lobes)
    ggx = found.material
    base = ggx.lobes - 1  # the wide lobe is the base's, the narrow one the coat's
    f0 = ((ggx.eta - 1) / (ggx.eta + 1)) ** 2
    specular, alpha = ggx.specular[:, base], ggx.alpha[:, base]
    strength = specular.max(axis=1)
    colour = ggx.diffuse / np.maximum(1 - f0 * strength, 1e-3)[:, None]
    factor = max(float(strength.max()), 1.0)
    # A strength beyond 1 goes on in the colour, whose factor may exceed 1.
    tint = specular / np.clip(strength, 1e-9, 1)[:, None] / factor
    smooth, rough = alpha.min(axis=1), alpha.max(axis=1)
    anisotropy = np.sqrt(np.clip((rough - smooth) / np.maximum(1 - smooth, 1e-9), 0, 1))
    along = np.take_along_axis(ggx.frame[:, :2, :2], alpha.argmax(axis=1)[:, None, None], axis=2)[:, :, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    ones = np.ones(len(smooth))
    maps: dict[str, bytes] = {
        "baseColor": _png(ggx, colour, srgb=True),
        "metallicRoughness": _png(ggx, np.stack([0 * ones, np.sqrt(smooth), 0 * ones], axis=1)),
        "normal": _png(ggx, 0.5 + 0.5 * ggx.normal, empty=(0.5, 0.5, 1.0)),
        "specular": _png(ggx, np.stack([ones, ones, ones, np.minimum(strength, 1)], axis=1)),
        "specularColor": _png(ggx, tint, srgb=True),
    }
    extensions: dict[str, Any] = {
        "KHR_materials_ior": {"ior": ggx.eta},
        "KHR_materials_specular": {
            "specularTexture": "specular",
            "specularColorTexture": "specularColor",
            "specularColorFactor": [factor] * 3,
        },
    }
    if (anisotropy > 0.02).any():
        maps["anisotropy"] = _png(ggx, np.concatenate([0.5 + 0.5 * along, anisotropy[:, None]], axis=1), empty=(1.0, 0.5, 0.0))
        extensions["KHR_materials_anisotropy"] = {"anisotropyStrength": 1.0, "anisotropyTexture": "anisotropy"}
    coat = np.zeros(len(ones))
    if base:
        coat = ggx.specular[:, 0].mean(axis=1) * f0 / 0.04
        width = np.sqrt(np.sqrt(ggx.alpha[:, 0].prod(axis=1)))
        maps["clearcoat"] = _png(ggx, np.stack([coat, width, 0 * ones], axis=1))
        extensions["KHR_materials_clearcoat"] = {
            "clearcoatFactor": 1.0,
            "clearcoatTexture": "clearcoat",
            "clearcoatRoughnessFactor": 1.0,
            "clearcoatRoughnessTexture": "clearcoat",
            "clearcoatNormalTexture": "normal",
        }
    _write(Path(path), material, maps, extensions, pygltflib)
    clipped = float(((colour > 1).any(axis=1) | (coat > 1)).mean())
    return {"scale": found.scale, "relative_variance": found.relative_variance, "clipped": clipped}


def _png(material: SVBRDF, values: Floats, srgb: bool = False, empty: tuple[float, ...] | None = None) -> bytes:
    from PIL import Image

    picture = np.zeros((*material.mask.shape, values.shape[1])) if empty is None else np.tile(empty, (*material.mask.shape, 1))
    picture[material.mask] = values
    encoding = Encoding(".png", "uint8", 3, "srgb" if srgb else "linear")
    out = io.BytesIO()
    Image.fromarray(encode(picture, encoding)).save(out, "PNG")
    return out.getvalue()


def _write(path: Path, material: SVBRDF, maps: dict[str, bytes], extensions: dict[str, Any], lib: Any) -> None:
    height, width = material.mask.shape
    x, y = 0.5 * width / max(width, height), 0.5 * height / max(width, height)
    corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], np.float32)
    arrays: list[tuple[NDArray, str, int]] = [
        (corners, "VEC3", lib.ARRAY_BUFFER),
        (np.tile(np.array([0, 0, 1], np.float32), (4, 1)), "VEC3", lib.ARRAY_BUFFER),
        (np.tile(np.array([1, 0, 0, 1], np.float32), (4, 1)), "VEC4", lib.ARRAY_BUFFER),
        (np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32), "VEC2", lib.ARRAY_BUFFER),
        (np.array([0, 1, 2, 0, 2, 3], np.uint16), "SCALAR", lib.ELEMENT_ARRAY_BUFFER),
    ]
    out, blob = lib.GLTF2(), b""
    out.asset = lib.Asset(version="2.0", generator="meniscus")
    for values, kind, target in arrays:
        data = values.tobytes()
        out.bufferViews.append(lib.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data), target=target))
        accessor = lib.Accessor(bufferView=len(out.bufferViews) - 1, count=len(values), type=kind)
        accessor.componentType = lib.FLOAT if values.dtype == np.float32 else lib.UNSIGNED_SHORT
        if len(out.accessors) == 0:
            accessor.min, accessor.max = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        out.accessors.append(accessor)
        blob += data + b"\0" * (-len(data) % 4)
    number: dict[str, int] = {}
    out.samplers.append(lib.Sampler(magFilter=lib.LINEAR, minFilter=lib.LINEAR_MIPMAP_LINEAR, wrapS=lib.REPEAT, wrapT=lib.REPEAT))
    for name, data in maps.items():
        out.bufferViews.append(lib.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data)))
        out.images.append(lib.Image(name=name, bufferView=len(out.bufferViews) - 1, mimeType="image/png"))
        number[name] = len(out.textures)
        out.textures.append(lib.Texture(source=len(out.images) - 1, sampler=0))
        blob += data + b"\0" * (-len(data) % 4)
    for told in extensions.values():
        for key, value in told.items():
            if key.endswith("Texture"):
                told[key] = {"index": number[value]}
    surface = lib.PbrMetallicRoughness(
        baseColorTexture=lib.TextureInfo(index=number["baseColor"]),
        metallicRoughnessTexture=lib.TextureInfo(index=number["metallicRoughness"]),
    )
    normal = lib.NormalMaterialTexture(index=number["normal"])
    name = material.name or "material"
    out.materials.append(lib.Material(name=name, pbrMetallicRoughness=surface, normalTexture=normal, extensions=extensions))
    out.extensionsUsed = list(extensions)
    attributes = lib.Attributes(POSITION=0, NORMAL=1, TANGENT=2, TEXCOORD_0=3)
    out.meshes.append(lib.Mesh(name=name, primitives=[lib.Primitive(attributes=attributes, indices=4, material=0)]))
    out.nodes.append(lib.Node(name=name, mesh=0))
    out.scenes.append(lib.Scene(nodes=[0]))
    out.scene = 0
    out.buffers.append(lib.Buffer(byteLength=len(blob)))
    out.set_binary_blob(blob)
    with replacing(path) as temporary:
        temporary.write_bytes(b"".join(out.save_to_bytes()))
