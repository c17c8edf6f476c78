"""Tables over half and difference angles: MERL's files and tensor files."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from materials.foundation.errors import InputError
from materials.measured.half_angles import directions_of, half_angles
from materials.measured.merl import read_merl, write_merl
from materials.measured.tensor_file import read_pbsdf, read_tensor_file

rng = np.random.default_rng(3)


def test_half_angles_come_back_from_their_directions():
    h, d, phi = rng.uniform(0.05, 1.5, 200), rng.uniform(0.05, 1.5, 200), rng.uniform(-3, 3, 200)
    wi, wo = directions_of(h, d, phi)
    assert np.allclose(half_angles(wi, wo), (h, d, phi))
    assert np.allclose(half_angles(wo, wi)[:2], (h, d))


def merl_table(shape=(12, 10, 20)):
    return rng.uniform(0.1, 2, (*shape, 3))


def test_a_merl_file_comes_back_with_its_colours(tmp_path):
    table = merl_table()
    table[2, 3, 4] = -1
    write_merl(tmp_path / "a.binary", table)
    a = read_merl(tmp_path / "a.binary")
    theta_h, theta_d, phi_d = half_angles(a.wi, a.wo)
    # MERL's own look-up: floor of sqrt(theta_h / 90 deg) x n, theta_d / 90 deg x n, phi_d / 180 deg x n
    cell = (
        (np.sqrt(theta_h / (np.pi / 2)) * 12).astype(int),
        (theta_d / (np.pi / 2) * 10).astype(int),
        (np.mod(phi_d, np.pi) / np.pi * 20).astype(int),
    )
    want = table[cell]
    assert np.array_equal(a.valid, (want >= 0).all(axis=1)) and not a.valid.all()
    assert np.allclose(a.value[a.valid], want[a.valid], rtol=1e-6)
    assert (a.wi[:, 2] > 0).all() and (a.wo[:, 2] > 0).all()


def test_every_so_manyth_cell_is_enough(tmp_path):
    write_merl(tmp_path / "a.binary", merl_table())
    whole, part = read_merl(tmp_path / "a.binary"), read_merl(tmp_path / "a.binary", (2, 2, 4))
    assert 0 < len(part.wi) < len(whole.wi) / 8


@pytest.mark.parametrize(
    ("head", "size", "words"),
    [
        ((90, 90, 180), 100, "have 34992012 bytes"),
        ((2**30, 2**30, 2**30), 100, "possible size"),
        ((-1, 90, 180), 100, "possible size"),
    ],
)
def test_impossible_merl_headers_are_refused_before_memory_is_taken(tmp_path, head, size, words):
    (tmp_path / "a.binary").write_bytes(struct.pack("<3i", *head) + bytes(size))
    with pytest.raises(InputError, match=words):
        read_merl(tmp_path / "a.binary")


def test_merl_files_with_nan_or_cut_short_are_refused(tmp_path):
    table = merl_table((3, 3, 4))
    table[0, 0, 0] = np.nan
    write_merl(tmp_path / "a.binary", table)
    with pytest.raises(InputError, match="finite"):
        read_merl(tmp_path / "a.binary")
    (tmp_path / "b.binary").write_bytes(b"short")
    with pytest.raises(InputError, match="whole"):
        read_merl(tmp_path / "b.binary")


def tensor_bytes(fields: dict[str, np.ndarray]) -> bytes:
    kinds = {"<u2": 3, "<f4": 10}
    size = 18 + sum(13 + len(n) + 8 * f.ndim for n, f in fields.items())
    head, body = b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)), b""
    for name, f in fields.items():
        head += struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", f.ndim, kinds[f.dtype.str], size + len(body))
        head += struct.pack(f"<{f.ndim}Q", *f.shape)
        body += f.tobytes()
    return head + body


def test_a_tensor_file_comes_back(tmp_path):
    fields = {"a": rng.random((2, 3)).astype("<f4"), "b": np.arange(5, dtype="<u2")}
    (tmp_path / "x.bsdf").write_bytes(tensor_bytes(fields))
    read = read_tensor_file(tmp_path / "x.bsdf")
    assert list(read) == ["a", "b"] and all(np.array_equal(read[n], fields[n]) for n in fields)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda d: b"nonsense" + d[8:], "tensor file"),
        (lambda d: d[:20], "truncated header"),
        (lambda d: d[:-4], "lie within the file"),
        (lambda d: d[:12] + b"\x07" + d[13:], "version 1"),
        (lambda d: d[:14] + struct.pack("<I", 10**9) + d[18:], "at most 1024 fields"),
        (lambda d: d[:23] + b"\x63" + d[24:], "known type"),
        (lambda d: d[:32] + struct.pack("<Q", 2**60) + d[40:], "lie within the file"),
    ],
)
def test_damaged_tensor_files_are_refused(tmp_path, damage, words):
    data = tensor_bytes({"a": rng.random((2, 3)).astype("<f4")})
    (tmp_path / "x.bsdf").write_bytes(damage(data))
    with pytest.raises(InputError, match=words):
        read_tensor_file(tmp_path / "x.bsdf")


def test_spectralon_is_neutral_and_nearly_matte(shared_data):
    a = read_pbsdf(shared_data / "spectralon_pbsdf" / "spectralon_lowres.pbsdf")
    assert a.channels == ("450 nm", "500 nm", "550 nm", "600 nm", "650 nm") and a.unit == "relative"
    steep = a.valid & (a.wi[:, 2] > 0.7) & (a.wo[:, 2] > 0.7)
    mean = a.value[steep].mean(axis=0)
    assert steep.sum() > 50 and np.ptp(mean) / mean.mean() < 0.05
    # near-matte away from grazing, where a diffuse white varies by tens of per cent, a gloss by factors
    assert a.value[steep, 2].std() / mean[2] < 0.3


def test_a_tensor_file_of_another_kind_is_no_polarimetric_brdf(tmp_path):
    (tmp_path / "x.pbsdf").write_bytes(tensor_bytes({"a": rng.random((2, 3)).astype("<f4")}))
    with pytest.raises(InputError, match="phi_d must be a field"):
        read_pbsdf(tmp_path / "x.pbsdf")
