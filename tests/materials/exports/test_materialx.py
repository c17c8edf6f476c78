from __future__ import annotations

from dataclasses import replace

import MaterialX as mx
import numpy as np
import pytest

from materials.exports.materialx import write_materialx
from materials.foundation.images import read_exr
from tests.materials.exports.samples import VIEWS, ggx, relative_rms, sample


def opened(path):
    doc = mx.createDocument()
    mx.readFromXmlFile(doc, str(path))
    libraries = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), libraries)
    doc.setDataLibrary(libraries)
    return doc


def oren_nayar(wi, wo, normal, roughness):
    """Return what MaterialX's library has for its node (mx_oren_nayar_diffuse), per texel (T,)."""
    cos_i, cos_o, s2 = normal @ wi, normal @ wo, roughness**2
    s = float(wi @ wo) - cos_i * cos_o
    return 1 - 0.5 * s2 / (s2 + 0.33) + 0.45 * s2 / (s2 + 0.09) * np.maximum(s, 0) / np.maximum(cos_i, cos_o)


@pytest.mark.parametrize(("lobes", "rough"), [(1, False), (2, False), (1, True)])
def test_materialx_finds_its_nodes_and_means_what_we_mean(tmp_path, lobes, rough):
    m = sample(lobes=lobes)
    m = replace(m, sigma=np.linspace(0, 1.2, len(m.diffuse))) if rough else m
    assert write_materialx(tmp_path / "m.mtlx", m) == {"scale": 1.0, "relative_variance": 0.0}
    doc = opened(tmp_path / "m.mtlx")
    valid, message = doc.validate()
    assert valid, message
    assert [s.getName() for s in doc.getMaterialNodes()] == ["sample_1"]
    graph = doc.getNodeGraph("reflectance")
    assert all(node.getNodeDef() is not None for node in graph.getNodes())

    def picture(node):
        file = node.getInput("file").getValueString()
        layers = read_exr(tmp_path / file)
        return np.stack([layers[c] for c in "YRGB" if c in layers], axis=-1)[m.mask].astype(np.float64)

    def image(node, key):
        return picture(graph.getNode(node.getInput(key).getNodeName()))

    def direction(name):
        v = 2 * image(graph.getNode(name), "in") - 1
        return v / np.linalg.norm(v, axis=1, keepdims=True)

    normal, tangent = direction("normal_world"), direction("tangent_world")
    for wi, wo in VIEWS[::4]:
        matte = graph.getNode("matte")
        f = image(matte, "color") / np.pi
        if rough:
            f = f * oren_nayar(wi, wo, normal, image(matte, "roughness")[:, 0])[:, None]
        assert (matte.getInput("roughness") is not None) == rough
        for gloss in (node for node in graph.getNodes() if node.getCategory() == "generalized_schlick_bsdf"):
            f0, f90, alpha = (image(gloss, key) for key in ("color0", "color90", "roughness"))
            dv, cos_d = ggx(wi, wo, tangent, normal, alpha[:, 0], alpha[:, 1])
            f = f + (f0 + (f90 - f0) * (1 - cos_d) ** 5) * dv[:, None]
        # single floats
        assert relative_rms(f * np.maximum(normal @ wi, 0)[:, None], m.reflect(wi, wo)) < 1e-4


def test_materialx_makes_shader_code_of_it(tmp_path):
    from MaterialX import PyMaterialXGenGlsl, PyMaterialXGenShader

    write_materialx(tmp_path / "m.mtlx", sample())
    doc = opened(tmp_path / "m.mtlx")
    generator = PyMaterialXGenGlsl.GlslShaderGenerator.create()
    context = PyMaterialXGenShader.GenContext(generator)
    context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
    shader = generator.generate("m", doc.getMaterialNodes()[0], context)
    assert "generalized_schlick" in shader.getSourceCode("pixel")
