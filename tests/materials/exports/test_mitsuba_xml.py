from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from materials.exports.mitsuba_xml import write_mitsuba
from materials.foundation.images import read_exr
from tests.materials.exports.samples import sample


def test_mitsubas_scene_names_textures_that_are_there(tmp_path):
    m = sample()
    told = write_mitsuba(tmp_path / "m.xml", m)
    root = ElementTree.parse(tmp_path / "m.xml").getroot()
    files = [e.get("value") for e in root.iter("string") if e.get("name") == "filename"]
    assert sorted(files) == [f"m/{n}.exr" for n in ("anisotropic", "base_color", "normalmap", "roughness")]
    assert all((tmp_path / f).is_file() for f in files)
    rough = read_exr(tmp_path / "m" / "roughness.exr")["Y"][m.mask]
    # roughness^2 is the geometric mean of both widths
    assert np.allclose(rough**2, np.sqrt(m.alpha[:, 0].prod(axis=1)), rtol=1e-5)
    assert told["clipped"] == 0
