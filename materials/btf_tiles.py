"""Compress a BTF that no memory holds: factors from some of its texels, onto which all others are projected part by part."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .abrdf import ABRDF
from .btf import BTF, compress
from .foundation.errors import InputError


def compress_tiles(some: ABRDF, tiles: Iterable[ABRDF], mask: NDArray[np.bool_], rank: int = 32, seed: int = 0) -> BTF:
    """Compress all texels of a BTF with the factors of some (full matrix factorisation).

    Parameters
    ----------
    some : ABRDF
        Texels drawn at random, on a grid of directions; several times as many as `rank`.
    tiles : iterable of ABRDF
        All texels, in row order, on the same grid.
    mask : (H, W) bool
        Where they are.
    rank : int
        Singular vectors kept.
    seed : int
        Of the random projection.

    Returns
    -------
    btf : BTF
        `relative_error` is over all texels, not only those that the factors are from.

    Raises
    ------
    InputError
        If a tile has other directions, or there are not as many texels as the mask marks; else as `compress`.
    """
    basis = compress(some, rank, "fmf", seed)
    angular = basis.angular[0]
    right = angular.reshape(len(angular), -1)  # its rows are orthonormal
    spatial, lost, level = [], 0.0, 0.0
    for tile in tiles:
        if tile.grid != some.grid:
            raise InputError("be on the same grid of directions", got=tile.grid, key="tile")
        matrix = tile.with_cosine().flat().value.reshape(tile.num_texels, -1)
        left = matrix @ right.T
        spatial.append(left)
        lost += float(np.sum((matrix - left @ right) ** 2, dtype=np.float64))
        level += float(np.sum(matrix**2, dtype=np.float64))
    left = np.concatenate(spatial)
    if len(left) != int(mask.sum()):
        raise InputError(f"have {int(mask.sum())} texels, as the mask marks", got=len(left), key="tiles")
    return replace(basis, mask=mask, spatial=(left,), relative_error=float(np.sqrt(lost / max(level, 1e-300))))
