from dataclasses import replace

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.images import write_raw
from scene.mesh import Mesh
from scene.reconstruction.frame_view import depth_map, frame_views, raycasting_scene, visible_in_frame
from scene.reconstruction.projection import class_means, fill_colours, frame_gains, project_uv
from scene.scene_file import Cardboard

from .. import toy_drive as toy


def test_projected_texture_coordinates_are_pixel_positions_over_the_size():
    cam = toy.camera(0.0)
    mesh = toy.meshes()["ground"]
    uv, inside = project_uv(mesh, cam)
    xy, depth = cam.project(mesh.vertices)
    assert np.allclose(uv[inside] * (cam.width, cam.height), xy[inside], atol=1e-4)
    assert np.array_equal(inside, (depth > 0) & (xy >= 0).all(1) & (xy < (cam.width, cam.height)).all(1))
    assert uv.min() >= 0 and uv.max() <= 1
    behind = Mesh(np.array([[-5.0, 0, 1.6]], np.float32), np.zeros((0, 3), np.uint32))
    assert not project_uv(behind, cam)[1][0]


def test_ground_behind_the_wall_is_hidden_and_ground_before_it_is_seen():
    cam = toy.camera(0.0)
    depth, _ = depth_map(raycasting_scene(toy.meshes().values()), cam)
    points = np.array([[x, y, 0.0] for x in (6.0, 10.0, 13.5, 16.0, 20.0) for y in (0.0, 2.0)])
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    seen = visible_in_frame(points, cam, depth, up)
    assert seen.tolist() == [True, True, True, True, True, True, True, False, True, False]
    assert np.array_equal(seen, visible_in_frame(points, cam, raycasting_scene(toy.meshes().values()), up))


def test_far_ground_at_grazing_angles_is_seen_in_spite_of_a_pixels_depth():
    ground = toy.sheet(np.linspace(0, 120, 121), np.linspace(-5, 5, 11))
    cam = toy.camera(0.0)
    depth, _ = depth_map(raycasting_scene([ground]), cam)
    points = np.column_stack([np.linspace(10, 110, 500), np.zeros(500), np.zeros(500)])
    # At 100 m a pixel covers 100^2 / (260 x 1.6) = 24 m of road.
    assert visible_in_frame(points, cam, depth, np.tile([0.0, 0.0, 1.0], (500, 1))).all()


def test_filled_colours_are_those_of_the_world_and_ignore_the_wall_in_front(tmp_path):
    meshes = toy.meshes()
    filled = fill_colours(meshes, toy.drive(tmp_path))
    for i, (name, mesh) in enumerate(filled.items()):
        fill = np.stack([mesh.attributes[f"fill_{c}"] for c in "rgb"], axis=1)
        # Three frames that each see a point close to an outline weigh 0.3 at most.
        seen = mesh.attributes["fill_w"] > 0.3
        true = toy.colour(mesh.vertices.astype(float), np.full(len(fill), i))
        error = np.abs(fill - true).max(axis=1) / true.max(axis=1)
        # Away from the lawn's edge, where a pixel holds both: colours vary by at most 40 % per metre, and pixels of quality
        # 0.3 span 0.25 m along the view, of which half may be to one side.
        calm = seen & (np.abs(mesh.vertices[:, 1] + 2) > 0.3 if name == "ground" else True)
        assert calm.mean() > 0.15
        assert error[calm].max() < 0.4 * 0.125
        assert mesh.attributes["fill_r"].dtype == np.float32
        assert np.all(fill[mesh.attributes["fill_w"] == 0] == 0)
    # The strip behind the wall, seen from all frames, has no colour. A pixel covers 0.5 m of road there.
    v, w = meshes["ground"].vertices, filled["ground"].attributes["fill_w"]
    assert not w[(v[:, 0] > 14.6) & (v[:, 0] < 16) & (v[:, 1] > 1.6) & (v[:, 1] < 3.0)].any()


def test_what_moves_leaves_no_colour_behind(tmp_path):
    filled = fill_colours(toy.meshes(), toy.drive(tmp_path, moving=True))
    for mesh in filled.values():
        # Nothing in the still world is brighter than its sky.
        assert max(mesh.attributes[f"fill_{c}"].max() for c in "rgb") <= 0.9


def test_exposures_that_drift_are_found_and_taken_out(tmp_path):
    meshes, gains = toy.meshes(), (1.0, 0.7, 1.3)
    recording = toy.drive(tmp_path, gains)
    found = frame_gains(meshes, recording)
    # Medians of hundreds of points that differ by a few per cent each.
    assert np.allclose(found, gains, rtol=0.01)
    steady = tmp_path / "steady"
    steady.mkdir()
    a, b = (fill_colours(meshes, r)["ground"].attributes["fill_g"] for r in (recording, toy.drive(steady)))
    assert np.allclose(a, b, rtol=0.02, atol=1e-3)


def test_recorded_exposures_are_divided_out(tmp_path):
    recording = toy.drive(tmp_path, (1.0, 2.0))
    known = replace(recording, frames=(recording.frames[0], replace(recording.frames[1], exposure=2.0)))
    assert np.allclose(frame_gains(toy.meshes(), known), 1, rtol=0.01)


def test_class_means_are_means_over_what_the_pixels_hit(tmp_path):
    recording = toy.drive(tmp_path, (1.0,), moving=True)
    board = Cardboard(3, "pedestrian", np.zeros((4, 3)))
    means = class_means(recording, toy.meshes(), ((board,),))
    assert np.allclose(means["pedestrian"], (5, 0, 5))
    assert np.allclose(means["environment"] / means["environment"][0], (1, 0.4, 0.2), atol=1e-3)
    assert 0.05 < means["ground"][1] < 0.3
    # No vehicle was seen: the environment has to do.
    assert np.array_equal(means["vehicle"], means["environment"])
    assert np.allclose(class_means(recording, toy.meshes())["vehicle"], (5, 0, 5))


def test_a_picture_of_the_wrong_size_is_refused(tmp_path):
    recording = toy.drive(tmp_path, (1.0,))
    write_raw(recording.frames[0].image, np.zeros((10, 20, 3), np.float32))
    with pytest.raises(InputError, match="must have the camera's size 320 x 140, got 20 x 10"):
        next(frame_views(recording, toy.meshes(), ""))


def test_the_real_drive_keeps_its_colours_between_frames(shared_data):
    from scene.recording import read_recording, select_frames

    recording = select_frames(read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json"), [1, 2])
    # The road is level to 5 cm below the cameras, 1.65 m up; a patch that both frames see.
    ground = toy.sheet(np.arange(20, 28, 0.1), np.arange(-1.5, 1.5, 0.1), -1.73)
    gains = frame_gains({"ground": ground}, recording)
    assert 0.5 < gains[1] < 2
    fill = fill_colours({"ground": ground}, recording, gains=gains)["ground"]
    assert (fill.attributes["fill_w"] > 0).mean() > 0.5
