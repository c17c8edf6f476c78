from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.abrdf import from_grid
from materials.btf import compress, read_btf, write_btf
from materials.directions import even_directions
from materials.foundation.errors import InputError

WI, WO = even_directions(12, 70), even_directions(10, 70)


def measured(rank: int = 3, noise: float = 0.0):
    """A BTF of 30 texels whose matrix has a known rank, before noise."""
    rng = np.random.default_rng(0)
    value = np.einsum("tk,kioc->tioc", rng.uniform(0, 1, (30, rank)), rng.uniform(0, 0.3, (rank, 12, 10, 3)))
    value = value + noise * rng.uniform(0, 1, value.shape)
    mask = np.ones((6, 6), bool)
    mask[:, 0] = False
    return from_grid(WI, WO, value, normalised=False, mask=mask), value


@pytest.mark.parametrize("method", ["fmf", "dfmf"])
def test_a_btf_of_low_rank_comes_back_whole(method):
    abrdf, value = measured(3)
    # decorrelating mixes three channels, so that a channel's rank stays that of the whole
    btf = compress(abrdf, 3, method)
    assert btf.relative_error < 1e-5 and btf.num_texels == 30
    assert np.allclose(btf.decompress().value.reshape(value.shape), value, atol=1e-5)
    assert np.allclose(btf.decompress(4, 6).value, btf.decompress().value[4:6], atol=1e-6)


def test_the_error_is_that_of_the_best_factors():
    abrdf, value = measured(8, noise=0.05)
    s = np.linalg.svd(value.reshape(30, -1), compute_uv=False)
    for rank in (2, 5):
        best = np.sqrt((s[rank:] ** 2).sum() / (s**2).sum())
        # two powers with ten vectors more than needed come within a few percent
        assert best - 1e-6 <= compress(abrdf, rank).relative_error < 1.05 * best


def test_lookups_at_measured_directions_are_the_measured_values():
    abrdf, value = measured(3)
    btf = compress(abrdf, 3)
    got = btf.reflect([7, 7, 20], WI[[2, 5, 11]], WO[[1, 0, 9]])
    assert np.allclose(got, [value[7, 2, 1], value[7, 5, 0], value[20, 11, 9]], atol=1e-5)
    half = WI[0] + WI[1]
    between = btf.reflect([3], half / np.linalg.norm(half), WO[4])
    assert value[3, :, 4].min() <= between.min() and between.max() <= value[3, :, 4].max()
    assert (btf.reflect([3], [0, 0, -1.0], WO[4]) == 0).all()


def test_files_keep_what_half_floats_keep(tmp_path):
    btf = compress(measured(3)[0], 3)
    write_btf(tmp_path / "a.btf.npz", btf)
    again = read_btf(tmp_path / "a.btf.npz")
    assert np.array_equal(again.mask, btf.mask) and again.relative_error == btf.relative_error
    # 11 bits per factor, three factors
    assert np.allclose(again.decompress().value, btf.decompress().value, atol=3 * 2**-11 * np.abs(btf.decompress().value).max())
    (tmp_path / "a.btf.npz").write_bytes((tmp_path / "a.btf.npz").read_bytes()[:300])
    with pytest.raises(InputError, match="be a whole BTF"):
        read_btf(tmp_path / "a.btf.npz")


def test_what_cannot_be_compressed_is_refused():
    abrdf, _ = measured()
    with pytest.raises(InputError, match="grid of directions"):
        compress(replace(abrdf, grid=None))
    with pytest.raises(InputError, match="rank must be at least 1"):
        compress(abrdf, 0)
    with pytest.raises(InputError, match="method must be one of"):
        compress(abrdf, 3, "jpeg")
