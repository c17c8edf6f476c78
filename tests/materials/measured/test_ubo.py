from __future__ import annotations

import struct
import zipfile

import cv2
import numpy as np
import pytest

from materials.directions import spherical
from materials.foundation.errors import InputError
from materials.foundation.images import decode
from materials.measured.source import open_source
from materials.measured.ubo2003 import read_ubo2003
from materials.measured.ubo2014 import read_ubo2014

LIGHTS, VIEWS = (
    np.array([[0, 0], [0.5, 1.0], [1.2, 4.0], [1.0, 2.0]], np.float32),
    np.array([[0.1, 0], [0.7, 2.0], [0.9, 5.0]], np.float32),
)
H, W = 2, 3


def header(signature: bytes, cosine: int = 1) -> bytes:
    told = struct.pack("<I", 4) + b"dome".ljust(80) + b"camera".ljust(80) + b"lamp".ljust(80) + struct.pack("<4f", 10, 1, 1, 1)
    told += (
        struct.pack("<I", cosine)
        + struct.pack("<I", 3)
        + b"<a>"
        + struct.pack("<I", 3)
        + b"".join(struct.pack("<I", 1) + c for c in (b"R", b"G", b"B"))
    )
    out = signature + struct.pack("<I", len(told) + 4) + told + struct.pack("<I", len(VIEWS))
    for view in VIEWS:
        out += view.tobytes() + struct.pack("<I", len(LIGHTS)) + LIGHTS.tobytes()
    out += struct.pack("<2I", W, H)
    return out + (struct.pack("<I", 0) if signature.endswith(b"R") else b"")


def factors(matrix: np.ndarray, kind="<f4") -> bytes:
    """The factors of (directions, texels) whose product is exact: U = matrix, S V = 1."""
    u, sv = matrix.astype(kind), np.eye(matrix.shape[1]).astype(kind)
    head = struct.pack("<B3I", np.dtype(kind).itemsize, u.shape[1], *matrix.shape)
    return head + np.ones(u.shape[1], kind).tobytes() + u.tobytes() + sv.tobytes()


@pytest.fixture
def rgb():
    """Values (view, light, texel, channel)."""
    return np.random.default_rng(0).uniform(0.05, 1, (3, 4, 6, 3))


def test_plain_factors_of_logarithms_are_read(tmp_path, rgb):
    matrix = np.log(rgb + 1e-5).transpose(0, 1, 3, 2).reshape(-1, 6)
    body = struct.pack("<B", 2) + struct.pack("<I", 1) + struct.pack("<2I", 0, 0) + struct.pack("<I", 6)
    (tmp_path / "a.btf").write_bytes(header(b"!FMF12FCER") + body + factors(matrix))
    btf = read_ubo2014(tmp_path / "a.btf")
    a = btf.block(0, 6)
    assert a.grid == (4, 3) and not a.normalised and a.unit == "relative" and np.allclose(btf.wi, spherical(*LIGHTS.T), atol=1e-6)
    assert np.allclose(a.value.reshape(6, 4, 3, 3), rgb.transpose(2, 1, 0, 3), rtol=1e-4)
    source = open_source(tmp_path / "a.btf")
    assert source.kind == "ubo2014" and source.mask.shape == (H, W) and source.block(2, 4).normalised


@pytest.mark.parametrize("model", [0, 1, 3, 9, 11, 12])
def test_decorrelated_channels_become_rgb(tmp_path, rgb, model):
    yuv_from_rgb = np.linalg.inv([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]])
    mean, matrix = np.array([0.1, 0.2, 0.3], np.float32), np.eye(3, dtype=np.float32)[[1, 2, 0]]
    v = rgb
    if model in (1, 9, 11):
        v = rgb @ yuv_from_rgb.T
        y = v[..., :1] + 1e-5
        if model == 11:
            v = np.concatenate([np.log(y), v[..., 1:] / y], axis=-1)
        elif model == 9:
            v = np.concatenate([np.log(y), v[..., 1:]], axis=-1)
    elif model == 3:
        v = (rgb - mean) @ matrix.T
    elif model == 12:
        v = np.log(rgb + 1e-5)
    body = struct.pack("<Ii", 6, model) + mean.tobytes() + matrix.tobytes()
    body += b"".join(factors(v[..., c].reshape(-1, 6)) for c in range(3))
    (tmp_path / "a.btf").write_bytes(header(b"!DFMF08FCR", cosine=0) + body)
    a = read_ubo2014(tmp_path / "a.btf").block(1, 3)
    assert a.normalised and np.allclose(a.value.reshape(2, 4, 3, 3), rgb.transpose(2, 1, 0, 3)[1:3], rtol=1e-4, atol=1e-5)


def test_damaged_btfs_are_refused_before_memory_is_taken(tmp_path, rgb):
    whole = (
        header(b"!DFMF08FCR")
        + struct.pack("<Ii", 6, 0)
        + bytes(48)
        + b"".join(factors(rgb[..., c].reshape(-1, 6)) for c in range(3))
    )
    file = tmp_path / "a.btf"
    for data, words in (
        (b"RIFF" + whole, "be a BTF of UBO2014"),
        (whole[:-5], "be whole"),
        (whole[:200], "be whole"),
        (header(b"!DFMF08FCR") + struct.pack("<Ii", 6, 2) + bytes(48), "known decorrelation"),
        (
            header(b"!DFMF08FCR") + struct.pack("<Ii", 6, 0) + bytes(48) + struct.pack("<B3I", 4, 60000, 1 << 31, 1 << 31),
            "be whole",
        ),
        (whole.replace(struct.pack("<2I", W, H), struct.pack("<2I", W, 1 << 30)), "width or height must lie in"),
        (whole.replace(LIGHTS.tobytes(), (LIGHTS + 2).tobytes()), "above the horizon"),
    ):
        file.write_bytes(data)
        with pytest.raises(InputError, match=words):
            read_ubo2014(file)


def test_zips_of_pictures_are_read_by_their_names(tmp_path):
    rng = np.random.default_rng(1)
    angles, kept = [(0, 0), (15, 60), (75, 300)], {}
    with zipfile.ZipFile(tmp_path / "cloth.zip", "w") as archive:
        for k, (i, o) in enumerate((a, b) for a in angles for b in angles[:2]):
            kept[i, o] = rng.integers(0, 255, (4, 6, 3), np.uint8)
            data = cv2.imencode(".png", kept[i, o][..., ::-1])[1].tobytes()
            archive.writestr(f"{k:05d}_tl{i[0]:03d}_pl{i[1]:03d}_tv{o[0]:03d}_pv{o[1]:03d}.png", data)
    btf = read_ubo2003(tmp_path / "cloth.zip")
    a = btf.block(3, 5)
    assert a.grid == (3, 2) and not a.normalised
    want = decode(kept[(15, 60), (0, 0)].reshape(-1, 3)[3:5], "srgb")
    assert np.allclose(a.value.reshape(2, 3, 2, 3)[:, 1, 0], want)
    assert (
        open_source(tmp_path / "cloth.zip").mask.shape == (4, 6) and read_ubo2003(tmp_path / "cloth.zip", 2).pictures.shape[0] == 6
    )


def test_zips_with_gaps_are_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("tl000_pl000_tv000_pv000.png", b"x")
        archive.writestr("tl015_pl000_tv015_pv000.png", b"x")
    with pytest.raises(InputError, match="hold each of 2 lights x 2 views once"):
        read_ubo2003(tmp_path / "a.zip")
    (tmp_path / "b.zip").write_bytes(b"nothing")
    with pytest.raises(InputError, match="be a zip of pictures"):
        read_ubo2003(tmp_path / "b.zip")
