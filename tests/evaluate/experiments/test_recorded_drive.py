"""True flow from disparity and poses: against the geometry by hand, and against a real drive's next disparity."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from evaluate.experiments.recorded_drive import RecordedDrive, flow_of_disparity
from evaluate.experiments.settings import StreetPart
from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.recording import DisparityFile, Frame, MaskFile, Recording, read_recording, write_recording

WIDTH, HEIGHT, FOCAL, BASELINE = 32, 24, 40.0, 0.5


def a_frame(folder: Path, name: str, forward: float, disparity: np.ndarray | None, mask: np.ndarray | None = None) -> Frame:
    T = np.eye(4)
    T[2, 3] = forward
    camera = Camera("PINHOLE", WIDTH, HEIGHT, T, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
    cv2.imwrite(str(folder / f"{name}.png"), np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    files = {}
    if disparity is not None:
        cv2.imwrite(str(folder / f"{name}_d.png"), np.rint(256 * disparity).astype(np.uint16))
        files["disparity"] = DisparityFile(folder / f"{name}_d.png", 256, BASELINE)
    if mask is not None:
        cv2.imwrite(str(folder / f"{name}_m.png"), mask.astype(np.uint8))
        files["masks"] = MaskFile(folder / f"{name}_m.png", "vehicle")
    return Frame(folder / f"{name}.png", camera, "srgb", **files)


def test_driving_towards_a_wall_spreads_the_picture_about_its_centre(tmp_path):
    # Wall at 8 m, 2 m driven: what lies at r from the centre moves to 8/6 r. Disparity of 8 m is 40 * 0.5 / 8 = 2.5 px.
    disparity = np.full((HEIGHT, WIDTH), 2.5)
    disparity[0] = 0
    mask = np.zeros((HEIGHT, WIDTH))
    mask[10:12, 3:6] = 7
    flow = flow_of_disparity(a_frame(tmp_path, "0", 0, disparity, mask), a_frame(tmp_path, "1", 2, None))
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, np.arange(HEIGHT) + 0.5 - HEIGHT / 2)
    inside = (np.abs(x) * 8 / 6 < WIDTH / 2) & (np.abs(y) * 8 / 6 < HEIGHT / 2)
    assert np.array_equal(flow.valid, inside & (mask == 0) & (disparity > 0))
    expected = np.stack([x, y], axis=-1) / 3
    # Disparity is stored exactly here, so only float32 rounds.
    assert np.allclose(flow.flow[flow.valid], expected[flow.valid], atol=1e-5)


def test_what_something_nearer_hides_in_the_next_frame_is_unknown(tmp_path):
    near = np.full((HEIGHT, WIDTH), 2.5)
    near[:, : WIDTH // 2] = 10  # a body at 2 m has come before the left half
    flow = flow_of_disparity(
        a_frame(tmp_path, "0", 0, np.full((HEIGHT, WIDTH), 2.5)),
        a_frame(tmp_path, "1", 0, near),
    )
    assert not flow.valid[:, : WIDTH // 2].any() and flow.valid[:, WIDTH // 2 :].all()
    assert np.allclose(flow.flow[flow.valid], 0, atol=1e-6)


def test_recordings_without_truth_are_refused(tmp_path):
    frames = tuple(a_frame(tmp_path, str(i), i, None) for i in range(2))
    write_recording(tmp_path / "r.json", Recording(frames, tmp_path, "r"))
    with pytest.raises(InputError, match="must have flow or disparity in a frame that is not the last, got none"):
        RecordedDrive(tmp_path / "r.json", tmp_path / "out", StreetPart())


def test_disparity_of_another_size_is_refused(tmp_path):
    frame = a_frame(tmp_path, "0", 0, np.ones((HEIGHT, WIDTH - 1)))
    with pytest.raises(InputError, match=r"the disparity must have shape \(24, 32\), got \(24, 31\)"):
        flow_of_disparity(frame, frame)


def test_on_a_real_drive_the_next_disparity_agrees_with_where_the_flow_leads(shared_data):
    frames = read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json").frames
    flow = flow_of_disparity(frames[0], frames[1])
    assert flow.valid.sum() > 20_000
    # A second, independent way: what is on the flow's target, projected back by the reversed poses, comes home.
    back = flow_of_disparity(frames[1], frames[0])
    rows, columns = np.nonzero(flow.valid)
    target = np.stack([columns, rows], axis=1) + 0.5 + flow.flow[rows, columns]
    c, r = target.astype(int).T
    both = back.valid[r, c]
    home = np.hypot(*(flow.flow[rows, columns] + back.flow[r, c])[both].T)
    # The targets' centres differ by up to half a pixel, which flow that grows with nearness stretches to about one.
    assert both.sum() > 5000 and np.median(home) < 1.0
