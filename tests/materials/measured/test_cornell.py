from __future__ import annotations

import numpy as np
import pytest

from materials.directions import even_directions, spherical
from materials.foundation.errors import InputError
from materials.measured.cornell import read_cornell

GOOD = "# a paint\n2\n400 500 # nm\n0.5 0 0.5 3.14159265 0.1 0.2\n0.5 0 0.2 0 0.3 0.4\n"


@pytest.mark.parametrize("name", ["cayman", "garnet_red", "krylon_blue"])
def test_the_paints_are_read_whole(shared_data, name):
    a = read_cornell(shared_data / "cornell_brdf" / f"{name}.brdf")
    assert a.value.shape == (1439, 31) and a.channels[0] == "400 nm" and a.isotropic and a.unit == "1/sr"
    brightest = int(a.value[:, 15].argmax())
    mirror = a.wi[brightest] * (-1, -1, 1)
    # Paints gloss about the mirror direction; beyond it at grazing light (Torrance and Sparrow's off-specular peak)
    assert a.wo[brightest] @ mirror > np.cos(np.radians(15))
    assert np.isclose(a.weight.sum(), (2 * np.pi) ** 2)


def test_red_paint_reflects_red(shared_data):
    a = read_cornell(shared_data / "cornell_brdf" / "garnet_red.brdf")
    a = a.resample(spherical(np.radians([12.0]), [0.0]), even_directions(200, 75))
    albedo = (a.value * a.valid[:, None] * a.wo[:, 2:] * a.weight[:, None]).sum(axis=0) / (2 * np.pi)
    at = {name: float(albedo[i]) for i, name in enumerate(a.channels)}
    # 0.045, 0.045, 0.25 were measured at 450, 550, 650 nm (light at 10 degrees); ours leaves out the outer 15 degrees
    assert at["450 nm"] == pytest.approx(0.045, rel=0.25) and at["650 nm"] == pytest.approx(0.25, rel=0.15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "hold samples"),
        ("1000000000\n1 2 3\n", "start with the number of wavelengths"),
        (GOOD.replace("400 500", "400"), "list 2 wavelengths"),
        (GOOD[:-5], "line 5 must hold 4 angles and 2 values"),
        (GOOD.replace("0.3", "nan"), "line 5 must be finite"),
        (GOOD.replace("0.3", "-0.3"), "line 5 must hold no negative reflectance"),
        (GOOD.replace("0.2 0 0.3", "1.7 0 0.3"), "line 5 must have directions above the horizon"),
        (GOOD.replace("0.3", "abc"), "line 5 must hold numbers"),
        ("2\n400 500\n", "hold samples"),
    ],
)
def test_a_damaged_list_is_refused_by_line(tmp_path, text, words):
    file = tmp_path / "paint.brdf"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        read_cornell(file)


def test_binary_and_absent_files_are_refused(tmp_path):
    (tmp_path / "x.brdf").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="text file"):
        read_cornell(tmp_path / "x.brdf")
    with pytest.raises(InputError, match="exist"):
        read_cornell(tmp_path / "y.brdf")


def test_the_good_text_is_good(tmp_path):
    file = tmp_path / "paint.brdf"
    file.write_text(GOOD)
    a = read_cornell(file)
    assert a.value.tolist() == np.array([[0.1, 0.2], [0.3, 0.4]], np.float32).tolist()
    assert np.allclose(a.wo[0], a.wi[0] * (-1, 1, 1), atol=1e-8)
