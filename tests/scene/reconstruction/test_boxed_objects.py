"""3-D boxes of what moves take its points out of the cloud, and draw masks where a recording has none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scene.boxes import Box, upright_pose, write_boxes
from scene.camera import Camera
from scene.images import read_ids
from scene.mesh import Mesh
from scene.points import write_points
from scene.reconstruction.boxed_objects import box_mask, boxes_to_draw, moving_boxes, with_box_masks, write_box_masks
from scene.reconstruction.build_settings import CloudSettings
from scene.reconstruction.cardboard import GroundCaster, cardboards
from scene.reconstruction.cloud import accumulate
from scene.recording import BoxesFile, Frame, PointsFile, Recording
from scene.transforms import look_at

CAMERA = Camera("PINHOLE", 320, 120, look_at((0, 0, 1.6), (20, 0, 1.6)), 200, 200, 160, 60)
SIZE = np.array([4.0, 1.8, 1.6])


def car(track: str, x: float, y: float = 0.0, category: str = "Car", yaw: float = 0.0) -> Box:
    return Box(track, category, upright_pose(np.array([x, y, 0.8]), yaw), SIZE)


def recording(folder: Path, *frames: list[Box], T_world_boxes: np.ndarray | None = None) -> Recording:
    T = np.eye(4) if T_world_boxes is None else T_world_boxes
    out = []
    for i, boxes in enumerate(frames):
        write_boxes(folder / f"{i}.json", tuple(boxes))
        out.append(Frame(folder / f"{i}.png", CAMERA, boxes=BoxesFile(folder / f"{i}.json", T)))
    return Recording(tuple(out), folder)


def test_tracks_that_stray_people_and_what_was_seen_once_move(tmp_path):
    first = [car("parked", 8), car("driven", 20), car("child", 5, 3, "Pedestrian"), car("cone", 9, 2, "CONSTRUCTION_CONE")]
    second = [car("parked", 8.2), car("driven", 21), car("child", 5, 3, "Pedestrian"), car("once", 30)]
    moving = moving_boxes(recording(tmp_path, first, second))
    assert [[box.track for box in boxes] for boxes in moving] == [["driven", "child"], ["driven", "child", "once"]]


def test_a_parked_car_in_the_frame_of_a_moving_scanner_stands_in_the_world(tmp_path):
    rec = recording(tmp_path, [car("a", 8)], [car("a", 7)])
    T = np.eye(4)
    T[0, 3] = 1.0
    frames = (rec.frames[0], Frame(rec.frames[1].image, CAMERA, boxes=BoxesFile(tmp_path / "1.json", T)))
    assert moving_boxes(Recording(frames, tmp_path)) == [[], []]


def test_the_mask_of_a_box_is_its_projected_outline(tmp_path):
    box = car("1", 12, 1, yaw=0.4)
    mask = box_mask(CAMERA, {3: box})
    # By rays: a pixel sees the box if a point of its ray lies in it.
    origins, directions = CAMERA.rays(CAMERA.pixel_centres())
    sees = np.zeros(len(origins), bool)
    for distance in np.arange(8, 17, 0.02):
        sees |= box.contains(origins + distance * directions)
    truth = sees.reshape(mask.shape)
    assert set(np.unique(mask)) == {0, 3}
    # OpenCV also fills the pixels that the border touches: at most one row or column more on each side.
    assert not (truth & (mask == 0)).any()
    from scipy.ndimage import binary_dilation

    assert not ((mask > 0) & ~binary_dilation(truth, np.ones((3, 3)), iterations=2)).any()


def test_a_sweep_that_shows_a_whole_object_cuts_the_outline_of_its_box(tmp_path):
    rng = np.random.default_rng(0)
    box = car("1", 12, 1, yaw=0.4)
    # A body of half the box's width on the side of its back, from the road to its top.
    local = np.column_stack([np.full(800, -2.0), rng.uniform(-0.9, 0.0, 800), rng.uniform(-0.8, 0.8, 800)])
    body = local @ box.T_boxes_object[:3, :3].T + box.T_boxes_object[:3, 3]
    whole, cut = box_mask(CAMERA, {3: box}) > 0, box_mask(CAMERA, {3: box}, body) > 0
    assert cut.sum() < 0.7 * whole.sum() and not (cut & ~whole).any()
    columns, rows = CAMERA.project(body)[0].astype(int).T
    assert cut[rows, columns].all()
    # Where the sweep ends below the top, nobody knows how wide the rest is.
    low = body[local[:, 2] < 0.3]
    assert np.array_equal(box_mask(CAMERA, {3: box}, low) > 0, whole)


def test_the_nearer_box_hides_the_farther_and_one_beside_the_camera_is_cut(tmp_path):
    mask = box_mask(CAMERA, {1: car("a", 8), 2: car("b", 16)})
    assert mask[60, 160] == 1
    # A lorry that passes: its middle is behind the camera, its front fills the left side of the picture.
    passing = Box("c", "Truck", upright_pose(np.array([0.0, 2.2, 1.5]), 0.0), np.array([10.0, 2.0, 3.0]))
    mask = box_mask(CAMERA, {1: passing, 2: car("b", -9)})
    assert set(np.unique(mask)) == {0, 1}
    # Its near side, at y = 1.2, ends at x = 5: column 160 - 200 * 1.2 / 5.
    columns = np.flatnonzero(mask.any(axis=0))
    assert columns[0] == 0 and columns[-1] == pytest.approx(160 - 200 * 1.2 / 5, abs=1.5)


def test_masks_are_drawn_only_where_there_are_none_with_an_id_per_track(tmp_path):
    rec = recording(tmp_path, [car("10", 12), car("9", 20, 4)], [car("10", 13), car("9", 22, 4)])
    drawn = boxes_to_draw(rec)
    write_box_masks(rec, drawn, tmp_path / "masks")
    with_masks = with_box_masks(rec, drawn, tmp_path / "masks")
    for frame in with_masks.frames:
        assert frame.masks is not None and frame.masks.classes == {1: "vehicle", 2: "vehicle"}
        assert set(np.unique(read_ids(frame.masks.file))) == {0, 1, 2}
    assert boxes_to_draw(with_masks) == [{}, {}]


def test_a_box_tells_how_its_board_stands(tmp_path):
    rec = recording(tmp_path, [car("1", 12, 1.5, yaw=0.3)])
    drawn = boxes_to_draw(rec)
    write_box_masks(rec, drawn, tmp_path / "masks")
    frame = with_box_masks(rec, drawn, tmp_path / "masks").frames[0]
    corners = np.array([[-20, -40, 0], [80, -40, 0], [80, 40, 0], [-20, 40, 0]], np.float32)
    ground = GroundCaster(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)))
    (board,), notes = cardboards(frame, ground, boxes_world=drawn[0])
    assert notes[1]["method"] == "box"
    # Of the four sides the back fills most of the picture: its plane is the box's at x = -2, exactly.
    T = drawn[0][1].T_boxes_object
    local = (board.corners_world - T[:3, 3]) @ T[:3, :3]
    np.testing.assert_allclose(local[:, 0], -2, atol=1e-9)
    xy, _ = CAMERA.project(board.corners_world)
    rows, columns = np.nonzero(read_ids(frame.masks.file))
    assert xy[:, 0].min() <= columns.min() and xy[:, 0].max() >= columns.max() and xy[:, 1].min() <= rows.min()


def test_points_in_moving_boxes_leave_the_cloud_and_the_road_below_stays(tmp_path):
    rng = np.random.default_rng(0)
    road = np.column_stack([rng.uniform(3, 25, 40000), rng.uniform(-5, 5, 40000), np.zeros(40000)])
    frames = []
    for i, box in enumerate((car("1", 12), car("1", 14))):
        on_car = np.column_stack([rng.uniform(-2, 2, 2000), rng.uniform(-0.9, 0.9, 2000), np.full(2000, 0.79)])
        cloud = np.concatenate([road, on_car + box.T_boxes_object[:3, 3]]) - (0, 0, 1.7)
        write_points(tmp_path / f"{i}.npz", cloud)
        write_boxes(tmp_path / f"{i}.json", (box,))
        T = np.eye(4)
        T[2, 3] = 1.7
        points, boxes = PointsFile(tmp_path / f"{i}.npz", T), BoxesFile(tmp_path / f"{i}.json", np.eye(4))
        frames.append(Frame(tmp_path / f"{i}.png", CAMERA, points=points, boxes=boxes))
    cloud = accumulate(Recording(tuple(frames), tmp_path), CloudSettings(stereo=False))
    assert cloud.counts["in moving boxes removed"] == 4000
    assert cloud.points_world[:, 2].max() < 0.01
    below = np.abs(cloud.points_world[:, :2] - (12, 0)).max(axis=1) < 0.9
    assert below.sum() > 100
