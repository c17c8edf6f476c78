from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from scene.camera import Camera
from scene.mesh import Mesh
from scene.reconstruction.cardboard import GroundCaster, cardboards
from scene.recording import Frame, MaskFile, read_recording
from scene.transforms import look_at

WIDTH, HEIGHT = 640, 240


@pytest.fixture(scope="module")
def ground() -> GroundCaster:
    corners = np.array([[-20, -40, 0], [80, -40, 0], [80, 40, 0], [-20, 40, 0]], np.float32)
    return GroundCaster(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)))


def camera() -> Camera:
    return Camera("PINHOLE", WIDTH, HEIGHT, look_at((0, 0, 1.6), (20, 0, 1.2)), 400, 400, WIDTH / 2, HEIGHT / 2)


def frame_of(polygons: dict[int, np.ndarray], folder: Path, kind: str = "vehicle") -> Frame:
    """A frame whose mask shows world polygons (K, 3)."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    for id, polygon in polygons.items():
        xy, _ = camera().project(polygon)
        # OpenCV counts from the first pixel's centre; it fills every pixel that the polygon touches.
        cv2.fillPoly(mask, [np.rint((xy - 0.5) * 16).astype(np.int32)], id, shift=4)
    cv2.imwrite(str(folder / "mask.png"), mask)
    return Frame(folder / "a.png", camera(), masks=MaskFile(folder / "mask.png", kind))


def side_view(start, end, height: float = 1.4, sill: float = 0.3) -> np.ndarray:
    """The side of a car between two contacts on the ground: two wheels, and a sill between them."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    profile = [
        (0, 0.0),
        (0.15, 0.0),
        (0.2, sill),
        (0.8, sill),
        (0.85, 0.0),
        (1, 0.0),
        (1, 0.7 * height),
        (0.7, height),
        (0.3, height),
        (0, 0.6 * height),
    ]
    return np.array([(*(start + s * (end - start)), z) for s, z in profile])


def covered(board, frame: Frame) -> float:
    from scene.reconstruction.dynamics import instance_mask

    xy, _ = frame.camera.project(board.corners_world)
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    cv2.fillPoly(image, [np.rint((xy - 0.5) * 256).astype(np.int32)], 1, shift=8)
    mask = instance_mask(frame) == board.instance
    return (image[mask] > 0).mean()


@pytest.mark.parametrize("end", [(12.0, 2.5), (16.0, 1.5), (13.5, -1.5)])
def test_a_vehicle_board_passes_through_both_wheels(ground, tmp_path, end):
    start = (12.0, 5.5) if end[1] > 0 else (11.0, -5.0)
    frame = frame_of({3: side_view(start, end)}, tmp_path)
    (board,), notes = cardboards(frame, ground)
    assert notes[3]["method"] == "contacts"
    # The mask's lower edge is known to a pixel: at distance d and 1.6 m of height that is d^2 / 1.6 / 400 m of ground. A
    # wheel touches over 0.15 of the length: the line through two places 0.7 apart is continued by 0.15 to either end.
    pixel = max(start[0], end[0]) ** 2 / 1.6 / 400
    for foot in (start, end):
        a, b = board.corners_world[0, :2], board.corners_world[1, :2]
        n = np.array([-(b - a)[1], (b - a)[0]]) / np.linalg.norm(b - a)
        assert abs((np.array(foot) - a) @ n) < pixel * (1 + 2 * 0.15 / 0.7)
    assert board.corners_world[2:, 2].max() == pytest.approx(1.4, abs=0.2)
    assert covered(board, frame) == 1.0


def test_boards_stand_vertically_with_the_camera_side_order(ground, tmp_path):
    (board,), _ = cardboards(frame_of({1: side_view((12, 5), (15, 2))}, tmp_path), ground)
    low_left, low_right, up_right, up_left = board.corners_world
    assert np.allclose(low_left[:2], up_left[:2])
    assert np.allclose(low_right[:2], up_right[:2])
    assert up_left[2] > low_left[2]
    xy, _ = camera().project(board.corners_world)
    assert xy[0, 0] < xy[1, 0]
    assert xy[3, 1] < xy[0, 1]


def test_a_pedestrian_faces_the_camera_at_the_depth_of_the_feet(ground, tmp_path):
    person = np.array([[15, y, z] for y, z in ((-2.2, 0), (-2.3, 1.0), (-2.2, 1.75), (-2.0, 1.75), (-1.9, 1.0), (-2.0, 0))], float)
    frame = frame_of({2: person}, tmp_path, "pedestrian")
    (board,), notes = cardboards(frame, ground)
    assert board.kind == "pedestrian"
    assert notes[2]["method"] == "facing"
    assert board.corners_world[:, 0] == pytest.approx(15, abs=0.4)  # a pixel: 15^2 / 1.6 / 400
    span = board.corners_world[1] - board.corners_world[0]
    assert abs(span[0]) < 1e-6 * np.linalg.norm(span) + 1e-6
    assert covered(board, frame) == 1.0


def test_a_vehicle_cut_by_the_image_stands_as_its_sweep_says(ground, tmp_path):
    start, end = np.array([9.0, 9.5]), np.array([12.0, 5.0])
    frame = frame_of({4: side_view(start, end)}, tmp_path)
    rng = np.random.default_rng(0)
    s = rng.uniform(0, 1, 800)
    sweep = np.column_stack([start + s[:, None] * (end - start), rng.uniform(0.2, 1.2, 800)])
    (board,), notes = cardboards(frame, ground, sweep)
    assert notes[4]["method"] == "sweep"
    span = (board.corners_world[1] - board.corners_world[0])[:2]
    true = end - start
    cosine = abs(span @ true) / np.linalg.norm(span) / np.linalg.norm(true)
    assert np.degrees(np.arccos(min(cosine, 1))) < 6  # directions are tried every 3 degrees
    assert covered(board, frame) == 1.0


def test_without_masks_there_are_no_boards(ground, tmp_path):
    assert cardboards(Frame(tmp_path / "a.png", camera()), ground) == ((), {})


def test_boards_of_the_real_drive_cover_their_masks(shared_data, ground):
    recording = read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json")
    level = np.array([[-20, -60, -1.68], [120, -60, -1.68], [120, 60, -1.68], [-20, 60, -1.68]], np.float32)
    street = GroundCaster(Mesh(level, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)))
    for frame in recording.frames[:2]:
        boards, _ = cardboards(frame, street)
        assert len(boards) >= 2
        for board in boards:
            xy, _ = frame.camera.project(board.corners_world)
            from scene.reconstruction.dynamics import instance_mask

            rows, cols = np.nonzero(instance_mask(frame) == board.instance)
            hull = cv2.convexHull(xy.astype(np.float32))
            inside = [
                cv2.pointPolygonTest(hull, (float(c) + 0.5, float(r) + 0.5), False) >= 0 for r, c in zip(rows, cols, strict=True)
            ]
            assert all(inside)
