"""Ground maps: the ground mesh seen from above on a metric grid, and all that the water needs to know about it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_finite, check_range
from materials.foundation.errors import InputError
from materials.foundation.progress import stage

from ..grid import GroundGrid
from ..kernels import terrain as kernel
from ..mesh import Mesh
from ..reconstruction.build_settings import TerrainSettings
from ..recording import Recording
from .hollows import hollow_maps
from .map_filters import fill_holes
from .wetness_mask import MaskSettings, wetness_mask
from .wetting_patterns import moisture_pattern, puddle_pattern

_DEFAULTS = TerrainSettings()
_LARGEST = 100_000_000  # cells; 400 MB a map


def ground_maps(
    ground: Mesh,
    recording: Recording,
    settings: TerrainSettings = _DEFAULTS,
    seed: int = 0,
    occluders: Iterable[Mesh] = (),
) -> tuple[GroundGrid, dict[str, NDArray[np.float32]]]:
    """Return the grid over a ground mesh, and its maps.

    Parameters
    ----------
    ground : Mesh
        Ground in the world, z up [m].
    recording : Recording
        Frames whose pictures (or segmentations) say what the ground is made of.
    settings : TerrainSettings
        Cell size, mask and patterns.
    seed : int
        Seed of the patterns.
    occluders : iterable of Mesh
        What stands on the ground and may hide it from a frame: give the environment, or a parked car's paint is taken for
        the ground behind it.

    Returns
    -------
    grid : GroundGrid
        Its corner lies on a multiple of the cell, so that grids of two drives line up.
    maps : dict of (rows, cols) float32
        `height` [m], holes and surroundings filled smoothly; `coverage`, 1 where the mesh is; `mask`, M of eq 6.5;
        `moisture`, S0 of eq 6.3; `puddles`, A0 of eq 6.4; `hollow` and `hollow_deepest` of `hollow_maps` [m].

    Raises
    ------
    InputError
        If the mesh has no faces, or the grid would be too large.
    """
    check_range("cell", settings.cell, "(0, inf)")
    if ground.num_faces == 0:
        raise InputError("have faces", got="none", key="ground", remedy="Check that the recording has points on the ground.")
    check_finite("ground.vertices", ground.vertices)
    used = ground.vertices[np.unique(ground.faces)]
    grid = GroundGrid.covering(used.astype(np.float64), settings.cell)
    if grid.rows * grid.cols > _LARGEST:
        got = f"{grid.rows} x {grid.cols} cells"
        raise InputError(f"give at most {_LARGEST} cells", got=got, key="cell", remedy="Choose larger cells.")
    with stage("Heights from above"):
        height, covered = height_map(ground, grid)
    with stage("Wetness mask"):
        kinds = MaskSettings(
            settings.mask_source, settings.mask_blur, settings.mask_hardly, settings.mask_seeps, settings.mask_holds
        )
        mask = wetness_mask(ground, recording, grid, height, covered, kinds, occluders)
    x, y = grid.centres()
    puddles = puddle_pattern(
        x,
        y,
        seed,
        scale=settings.puddle_scale,
        exponent=settings.puddle_exponent,
        contrast=settings.puddle_contrast,
        offset=settings.puddle_offset,
    )
    return grid, {
        "height": height,
        "mask": mask,
        "moisture": moisture_pattern(x, y, seed),
        "puddles": puddles,
        "coverage": covered.astype(np.float32),
        **hollow_maps(height, covered.astype(np.float32), grid),
    }


def height_map(ground: Mesh, grid: GroundGrid) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the height (rows, cols) of the highest face over each cell's centre [m], and where there is one.

    Cells without a face are filled with a membrane stretched over the others, so that filters find no cliffs.
    """
    height = np.full(grid.shape, -np.inf)
    kernel.rasterise_top(ground.vertices.astype(np.float64), ground.faces, grid.x_min, grid.y_min, grid.cell, height)
    covered = np.isfinite(height)
    if not covered.any():
        raise InputError("cover at least one cell", got="none", key="ground", remedy="Choose smaller cells.")
    return fill_holes(height, covered), covered
