from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.grid import GroundGrid
from scene.images import write_raw
from scene.mesh import Mesh
from scene.reconstruction.build_settings import TerrainSettings
from scene.recording import Recording
from scene.scene_file import GROUND_MAPS
from scene.wetting.terrain import ground_maps, height_map

from .. import toy_drive as toy

NOTHING = Recording((), Path())
COARSE = TerrainSettings(cell=0.1)


def test_heights_of_a_tilted_plane_are_exact():
    x, y = np.linspace(0, 4, 9), np.linspace(-1, 2, 7)
    X, Y = np.meshgrid(x, y)
    mesh = toy.sheet(x, y, 0.1 * X - 0.3 * Y + 5)
    grid = GroundGrid.covering(mesh.vertices.astype(float), 0.1)
    height, covered = height_map(mesh, grid)
    X, Y = grid.centres()
    assert covered.all()
    # Vertices and heights are single precision: half an ulp of 5 m each.
    assert np.abs(height - (0.1 * X - 0.3 * Y + 5)).max() < 2e-6


def test_of_two_surfaces_the_upper_one_is_the_ground_seen_from_above():
    low, high = toy.sheet(np.linspace(0, 2, 3), np.linspace(0, 2, 3)), toy.sheet(np.linspace(0, 1, 3), np.linspace(0, 2, 3), 0.12)
    both = Mesh(np.concatenate([low.vertices, high.vertices]), np.concatenate([low.faces, high.faces + np.uint32(9)]))
    height, _ = height_map(both, GroundGrid(0, 0, 0.1, 20, 20))
    assert np.allclose(height[:, :10], 0.12) and np.allclose(height[:, 10:], 0)


def test_a_hole_is_not_covered_but_has_a_height_like_its_rim():
    mesh = toy.sheet(np.linspace(0, 4, 41), np.linspace(0, 4, 41), 1.5)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    hole = np.abs(middle[:, :2] - 2).max(axis=1) < 0.5
    grid = GroundGrid(0, 0, 0.05, 80, 80)
    height, covered = height_map(replace(mesh, faces=mesh.faces[~hole]), grid)
    assert not covered[40, 40] and covered[10, 10]
    assert abs(covered.mean() - (1 - 1 / 16)) < 1e-9
    assert np.allclose(height, 1.5)


def test_ground_maps_hold_what_a_scene_needs_and_line_up_in_the_world():
    maps_of = {}
    for name, left in (("wide", 0.0), ("narrow", 1.0)):
        mesh = toy.sheet(np.arange(left, 5.01, 0.5), np.arange(0, 3.01, 0.5))
        grid, maps = ground_maps(mesh, NOTHING, COARSE, seed=7)
        assert set(GROUND_MAPS) <= set(maps)
        assert all(m.shape == grid.shape and m.dtype == np.float32 for m in maps.values())
        maps_of[name] = maps
    for name in ("moisture", "puddles"):
        assert np.array_equal(maps_of["wide"][name][:, 10:], maps_of["narrow"][name])


@pytest.mark.parametrize("source", ["segmentation", "colour"])
def test_a_lawn_hardly_gets_wet_and_a_road_does(tmp_path, source):
    meshes = toy.meshes()
    recording = toy.drive(tmp_path, labels=source == "segmentation")
    settings = replace(COARSE, mask_source="auto")
    grid, maps = ground_maps(meshes["ground"], recording, settings, occluders=[meshes["environment"]])
    x, y = grid.centres()
    # What the cameras see from 5 m on; the blurs (0.3 m of context, 0.15 m of the mask) touch half a metre of the edge.
    seen = (x > 6) & (x < 13) & (np.abs(y) < 3)
    assert np.allclose(maps["mask"][seen & (y < -2.8)], 0.25, atol=0.01)
    assert np.allclose(maps["mask"][seen & (y > -1.2)], 1.0, atol=0.01)
    # Between the two there is a gradient, not a step.
    column = maps["mask"][:, grid.cols // 3]
    assert np.abs(np.diff(column)).max() < 0.75 * 0.1 / (0.15 * np.sqrt(2 * np.pi)) + 0.01


def test_without_pictures_all_ground_holds_water():
    _, maps = ground_maps(toy.sheet(np.arange(4.0), np.arange(4.0)), NOTHING, COARSE)
    assert np.all(maps["mask"] == 1)


def test_bad_ground_and_missing_segmentations_are_refused(tmp_path):
    mesh = toy.sheet(np.arange(4.0), np.arange(4.0))
    with pytest.raises(InputError, match="ground must have faces"):
        ground_maps(replace(mesh, faces=mesh.faces[:0]), NOTHING, COARSE)
    with pytest.raises(InputError, match="cell must give at most"):
        ground_maps(mesh, NOTHING, TerrainSettings(cell=1e-5))
    with pytest.raises(InputError, match="segmentation must be in at least one frame"):
        ground_maps(mesh, toy.drive(tmp_path, (1.0,)), replace(COARSE, mask_source="segmentation"))
    recording = toy.drive(tmp_path, (1.0,), labels=True)
    assert recording.frames[0].segmentation is not None
    write_raw(recording.frames[0].segmentation, np.zeros((5, 5), np.uint8))
    with pytest.raises(InputError, match="must have the image's size 320 x 140, got 5 x 5"):
        ground_maps(mesh, recording, COARSE)
