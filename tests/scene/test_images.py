from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from materials.foundation.errors import InputError
from scene.images import Encoding, decode, encode, read_exr, read_ids, read_image, read_raw, write_exr, write_image, write_raw

CHECKOUT = Path(__file__).parents[2]
rng = np.random.default_rng(1)


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
@pytest.mark.parametrize("response", ["srgb", "linear"])
def test_every_integer_survives_decoding_and_encoding(dtype, response):
    top = np.iinfo(dtype).max
    raw = np.arange(top + 1, dtype=dtype).reshape(-1, 16)
    again = encode(decode(raw, response), Encoding(".png", dtype, 1, response))
    # float32 keeps 24 bits; the slope of the curve is at most 12.92, so 16-bit codes stay apart: 65535 x 12.92 < 2**24.
    assert np.array_equal(again, raw)


@pytest.mark.parametrize(("code", "linear"), [(0, 0.0), (255, 1.0), (188, 0.502886), (10, 10 / 255 / 12.92)])
def test_srgb_has_its_known_values(code, linear):
    assert decode(np.array([[code]], np.uint8), "srgb")[0, 0] == pytest.approx(linear, abs=1e-6)


@pytest.mark.parametrize(
    ("suffix", "dtype", "shape"),
    [
        (".png", "uint8", (7, 5, 3)),
        (".png", "uint8", (7, 5)),
        (".png", "uint16", (7, 5, 3)),
        (".png", "uint16", (7, 5)),
        (".exr", "float32", (7, 5, 3)),
        (".exr", "float16", (7, 5, 3)),
        (".exr", "float32", (7, 5)),
    ],
)
def test_a_file_read_and_written_again_is_the_same_to_the_bit(tmp_path, suffix, dtype, shape):
    numbers = (
        rng.integers(0, 256, shape)
        if dtype == "uint8"
        else rng.integers(0, 65536, shape)
        if dtype == "uint16"
        else rng.random(shape)
    )
    raw = numbers.astype(dtype)
    write_raw(tmp_path / f"a{suffix}", raw)
    assert np.array_equal(read_raw(tmp_path / f"a{suffix}"), raw)
    linear, encoding = read_image(tmp_path / f"a{suffix}")
    assert linear.shape == (7, 5, 3) and linear.dtype == np.float32
    write_image(tmp_path / f"b{suffix}", linear, encoding)
    assert np.array_equal(read_raw(tmp_path / f"b{suffix}"), raw)


def test_ids_behind_a_palette_survive(tmp_path):
    ids = rng.integers(0, 256, (20, 30), dtype=np.uint8)
    picture = Image.fromarray(ids, mode="P")
    picture.putpalette(rng.integers(0, 256, 768).tolist())
    picture.save(tmp_path / "mask.png")
    assert np.array_equal(read_ids(tmp_path / "mask.png"), ids)
    assert read_raw(tmp_path / "mask.png").shape == (20, 30, 3)  # as a picture it has its colours


def test_a_truncated_palette_is_refused(tmp_path):
    picture = Image.fromarray(rng.integers(0, 256, (40, 50), dtype=np.uint8), mode="P")
    picture.save(tmp_path / "mask.png")
    data = (tmp_path / "mask.png").read_bytes()
    (tmp_path / "mask.png").write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(InputError, match=r"mask\.png: it must be a whole PNG"):
        read_ids(tmp_path / "mask.png")


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_ids_of_few_bits_are_not_stretched(tmp_path, bits):
    ids = rng.integers(0, 2**bits, (8, 16), dtype=np.uint8)
    lines = np.packbits(np.unpackbits(ids[..., None], axis=-1)[..., 8 - bits :].reshape(8, -1), axis=1)
    body = zlib.compress(np.hstack([np.zeros((8, 1), np.uint8), lines]).tobytes())
    header = struct.pack(">IIBBBBB", 16, 8, bits, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", body), (b"IEND", b"")]
    data = b"".join(struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks)
    (tmp_path / "mask.png").write_bytes(b"\x89PNG\r\n\x1a\n" + data)
    assert np.array_equal(read_ids(tmp_path / "mask.png"), ids)


def test_red_is_first(tmp_path):
    red = np.zeros((4, 4, 3), np.uint8)
    red[..., 0] = 255
    write_raw(tmp_path / "a.png", red)
    assert cv2.imread(str(tmp_path / "a.png"))[0, 0].tolist() == [0, 0, 255]  # OpenCV's order is blue, green, red
    assert np.array_equal(read_raw(tmp_path / "a.png"), red)


def test_an_alpha_channel_is_dropped(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), rng.integers(0, 256, (4, 4, 4)).astype(np.uint8))
    assert read_raw(tmp_path / "a.png").shape == (4, 4, 3)


def test_what_the_recording_says_of_the_response_wins(tmp_path):
    write_raw(tmp_path / "a.png", np.full((2, 2), 128, np.uint8))
    assert read_image(tmp_path / "a.png")[0][0, 0, 0] == pytest.approx(0.2158605, abs=1e-6)
    assert read_image(tmp_path / "a.png", "linear")[0][0, 0, 0] == pytest.approx(128 / 255, abs=1e-7)


def test_layers_of_an_exr_keep_names_and_types(tmp_path):
    layers = {
        "diffuse.R": rng.random((3, 4)).astype(np.float16),
        "depth.Z": rng.random((3, 4)).astype(np.float32),
        "id.shape": np.arange(12, dtype=np.uint32).reshape(3, 4) + 2**31,
        "level": rng.random((3, 4)),
    }
    write_exr(tmp_path / "a.exr", layers)
    again = read_exr(tmp_path / "a.exr")
    assert set(again) == set(layers)
    for name, values in layers.items():
        assert again[name].dtype == (np.float32 if name == "level" else values.dtype)
        assert np.array_equal(again[name], values.astype(again[name].dtype))


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9, 0.999])
@pytest.mark.parametrize(("suffix", "words"), [(".png", "whole PNG|be an image"), (".jpg", "whole JPEG"), (".exr", "OpenEXR")])
def test_a_truncated_image_is_refused(tmp_path, suffix, words, share):
    raw = rng.integers(0, 256, (64, 64, 3)).astype(np.float32 if suffix == ".exr" else np.uint8)
    write_raw(tmp_path / f"a{suffix}", raw)
    data = (tmp_path / f"a{suffix}").read_bytes()
    (tmp_path / f"b{suffix}").write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"b\{suffix}: it must .*({words})"):
        read_raw(tmp_path / f"b{suffix}")


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_data_that_a_phone_appends_after_the_picture_do_no_harm(tmp_path, suffix):
    write_raw(tmp_path / f"a{suffix}", rng.integers(0, 256, (16, 16, 3)).astype(np.uint8))
    (tmp_path / f"b{suffix}").write_bytes((tmp_path / f"a{suffix}").read_bytes() + bytes(500))
    assert np.array_equal(read_raw(tmp_path / f"b{suffix}"), read_raw(tmp_path / f"a{suffix}"))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.png", None, r"a\.png: it must exist\. Check the path"),
        ("a.png", b"", "must be an image"),
        ("a.jpg", b"text", "must be an image, got something that cannot be decoded"),
        ("a.exr", b"text", "must be an OpenEXR file"),
    ],
)
def test_what_is_no_image_is_refused(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_image(tmp_path / name)


def test_a_file_of_an_unknown_kind_or_of_lost_precision_is_not_written(tmp_path):
    with pytest.raises(InputError, match=r"must have a suffix that names an image format, got \.xyz"):
        write_raw(tmp_path / "a.xyz", np.zeros((2, 2), np.uint8))
    with pytest.raises(InputError, match=r"must hold uint8 or uint16 pixels, got float64\. Write floats as \.exr"):
        write_raw(tmp_path / "a.png", np.zeros((2, 2)))
    with pytest.raises(InputError, match="must hold uint8 pixels, got uint16"):
        write_raw(tmp_path / "a.jpg", np.zeros((2, 2), np.uint16))
    assert list(tmp_path.iterdir()) == []


def test_a_response_that_nobody_knows_is_refused():
    with pytest.raises(InputError, match="response must be one of linear, srgb, got log"):
        decode(np.zeros((2, 2), np.uint8), "log")


@pytest.mark.skipif(sys.platform == "win32", reason="limits of the file size are of Unix")
def test_a_disk_that_takes_no_more_leaves_no_file(tmp_path):
    code = f"""
import resource
import numpy as np
from materials.foundation.command import explain
from scene.images import write_exr, write_raw
noise = np.random.default_rng(1).random((100, 100))
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
grey = (255 * noise).astype(np.uint8)
for path, write in (("a.exr", lambda p: write_exr(p, {{"Y": noise}})), ("a.png", lambda p: write_raw(p, grey))):
    try:
        write({str(tmp_path)!r} + "/" + path)
    except OSError as error:
        print(explain(error))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=CHECKOUT, check=True)
    first, second = result.stdout.splitlines()
    assert "a.exr: it must stay below the file size limit" in first
    assert "a.png: it must stay below the file size limit" in second
    assert list(tmp_path.iterdir()) == []
