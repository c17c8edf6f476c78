from __future__ import annotations

import cv2
import numpy as np
import pytest

from materials.directions import even_directions
from materials.foundation.errors import InputError
from materials.measured.photographs import read_photographs


@pytest.fixture
def folder(tmp_path):
    """Five photographs of a white plane, 4 x 6 pixels, lamps of different power."""
    lights = even_directions(5, 40)
    power = np.linspace(0.5, 1.5, 15).reshape(5, 3)
    for k in range(5):
        rgb = np.rint(40000 * lights[k, 2] * power[k] / 1.5) * np.ones((4, 6, 1))
        cv2.imwrite(str(tmp_path / f"{k + 1:03d}.png"), rgb[..., ::-1].astype(np.uint16))
    mask = np.zeros((4, 6), np.uint8)
    mask[1:3, 2:5] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    np.savetxt(tmp_path / "light_directions.txt", lights)
    np.savetxt(tmp_path / "light_intensities.txt", power)
    (tmp_path / "filenames.txt").write_text("\n".join(f"{k + 1:03d}.png" for k in range(5)))
    return tmp_path


def test_images_are_divided_by_the_lights_and_keep_their_shading(folder):
    p = read_photographs(folder)
    assert p.abrdf.value.shape == (6, 5, 3) and not p.abrdf.normalised and p.normal is None
    want = 40000 / 65535 / 1.5 * p.lights[:, 2]
    assert np.allclose(p.abrdf.value, want[None, :, None], atol=1 / 65535 / 0.5)
    flat = p.abrdf.normalise().value
    assert np.ptp(flat) / flat.mean() < 1e-3


def test_some_images_can_be_left_out(folder):
    p = read_photographs(folder, slice(2, None))
    assert p.files == ("003.png", "004.png", "005.png") and p.abrdf.value.shape == (6, 3, 3)
    with pytest.raises(InputError, match="at least three images"):
        read_photographs(folder, slice(3, None))


def test_what_is_missing_or_wrong_is_named(folder):
    (folder / "002.png").rename(folder / "x.png")
    with pytest.raises(InputError, match=r"002\.png: it must exist"):
        read_photographs(folder)
    (folder / "x.png").rename(folder / "002.png")
    lights = np.loadtxt(folder / "light_directions.txt")
    np.savetxt(folder / "light_directions.txt", lights * (1, 1, -1))
    with pytest.raises(InputError, match="row 1 must hold unit vectors above the image plane"):
        read_photographs(folder)
    np.savetxt(folder / "light_directions.txt", lights[:4])
    with pytest.raises(InputError, match="one row per image"):
        read_photographs(folder)
    np.savetxt(folder / "light_directions.txt", lights)
    np.savetxt(folder / "light_intensities.txt", np.zeros((5, 3)))
    with pytest.raises(InputError, match="rows of positive numbers"):
        read_photographs(folder)
    np.savetxt(folder / "light_intensities.txt", np.ones((5, 3)))
    cv2.imwrite(str(folder / "mask.png"), np.zeros((4, 6), np.uint8))
    with pytest.raises(InputError, match="empty mask"):
        read_photographs(folder)
    cv2.imwrite(str(folder / "mask.png"), np.full((5, 6), 255, np.uint8))
    with pytest.raises(InputError, match="as large as the mask"):
        read_photographs(folder)
    (folder / "light_directions.txt").unlink()
    with pytest.raises(InputError, match="must exist"):
        read_photographs(folder)
    with pytest.raises(InputError, match="folder of photographs"):
        read_photographs(folder / "nowhere")


def test_the_ball_and_the_bear_are_read(shared_data):
    for name, count in (("diligent_ball", 15791), ("diligent_bear", 41512)):
        p = read_photographs(shared_data / name, slice(0, 6))
        assert p.abrdf.num_texels == count and p.normal is not None
        lengths = np.linalg.norm(p.normal[p.mask], axis=1)
        assert np.allclose(lengths, 1, atol=1e-3)
