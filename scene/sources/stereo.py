"""Dense points of a rectified stereo pair: for drives without LiDAR, and for what a LiDAR cannot see above it.

Semi-global matching (Hirschmueller, PAMI 2008) as OpenCV implements it, kept only where left and right agree, where there
is texture to match, and where other frames of the drive see the same surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.foundation.progress import tracked

from ..images import encode, read_ids, read_image, read_raw
from ..recording import Frame, Recording
from ..transforms import transform_points

# Standard deviation of a matched disparity on real, textured images [px], and of one measured by LiDAR (KITTI 2015).
SIGMA_MATCHED = 0.6
SIGMA_MEASURED = 0.1
# Side of matching windows, and how far left and right may disagree [px].
_BLOCK, _LEFT_RIGHT = 5, 1
# Least standard deviation of grey levels (of 255) along x around a pixel that can be matched: about twice sensor noise.
_TEXTURE = 2.0


@dataclass(frozen=True)
class StereoPoints:
    """Points that one frame sees.

    Attributes
    ----------
    points_world : (N, 3) float64
        Positions [m].
    rgb : (N, 3) float32
        Linear colour of their pixels in the left image.
    sigma : (N,) float32
        Standard deviation of the depth [m].
    camera_position : (3,) float64
        Where they were seen from [m].
    rows_cols : (N, 2) int32
        Their pixels.
    """

    points_world: NDArray[np.float64]
    rgb: NDArray[np.float32]
    sigma: NDArray[np.float32]
    camera_position: NDArray[np.float64]
    rows_cols: NDArray[np.int32]


@dataclass(frozen=True)
class _DepthMap:
    """Inverse depth [1/m] per pixel (0 = none) and its standard deviation."""

    inverse: NDArray[np.float64]
    sigma: NDArray[np.float64]


def stereo_points(frame: Frame, max_depth: float = 40.0) -> StereoPoints:
    """Return the points of one stereo pair.

    Parameters
    ----------
    frame : Frame
        With a `stereo` image, a measured `disparity` file, or both: where both know a pixel, the measurement wins.
    max_depth : float
        Farthest point returned [m]; depth error grows as its square.

    Returns
    -------
    points : StereoPoints
        Without the pixels of dynamic objects.

    Raises
    ------
    InputError
        If the frame has neither, or the pair is not rectified: a pinhole pair of equal focal length and size whose
        second camera stands to the right along the first one's x axis.
    """
    check_range("max_depth", max_depth, "(0, inf)")
    return _points(frame, _depth_map(frame, max_depth))


def consistent_stereo_points(
    recording: Recording,
    max_depth: float = 40.0,
    min_agreeing: int = 2,
    num_neighbours: int = 4,
    spacing: float = 0.03,
    max_sigma: float = 0.8,
) -> list[StereoPoints]:
    """Return the points of each frame that other frames see as well, their depths averaged over the frames.

    Parameters
    ----------
    recording : Recording
        Frames without a stereo image or disparity give no points.
    max_depth : float
        As in `stereo_points` [m].
    min_agreeing : int
        Number of other frames that must see the point at the same depth (within 3 standard deviations of the
        difference); at most what the drive can offer.
    num_neighbours : int
        Number of frames, nearest in the drive, that are asked.
    spacing : float
        Near pixels lie closer than any cloud is kept: of those only every second, third, … in row and column is taken, as
        long as they are no farther apart than this across the line of sight [m]. 0 takes all.
    max_sigma : float
        Points whose averaged depth is less certain than this are dropped [m].

    Returns
    -------
    points : list of StereoPoints
        One per frame of the recording.

    Notes
    -----
    A point is also dropped if more frames look through it than agree with it.
    """
    check_range("max_depth", max_depth, "(0, inf)")
    check_range("spacing", spacing, "[0, inf)")
    check_range("max_sigma", max_sigma, "(0, inf]")
    usable = [i for i, f in enumerate(recording.frames) if f.stereo is not None or f.disparity is not None]
    maps: dict[int, _DepthMap] = {}
    out: list[StereoPoints] = []
    empty = np.zeros((0, 3))
    for i, frame in enumerate(tracked(recording.frames, "Stereo points")):
        if i not in usable:
            none = np.zeros((0, 2), np.int32)
            out.append(StereoPoints(empty, empty.astype(np.float32), np.zeros(0, np.float32), frame.camera.position, none))
            continue
        neighbours = sorted((j for j in usable if j != i), key=lambda j: (abs(j - i), j))[:num_neighbours]
        for j in [i, *neighbours]:
            if j not in maps:
                maps[j] = _depth_map(recording.frames[j], max_depth)
        # Neighbours lie at most num_neighbours away, so older maps will not be asked again.
        maps = {j: m for j, m in maps.items() if abs(j - i) <= num_neighbours + 1}
        needed = min(min_agreeing, len(neighbours))
        out.append(_points(frame, _agreed(recording, i, neighbours, maps, needed, spacing, max_sigma)))
    return out


def disparity(frame: Frame) -> NDArray[np.float32]:
    """Return the disparity (H, W) [px] of a frame's stereo pair by matching; 0 where nothing is known.

    Raises
    ------
    InputError
        If the frame has no second camera or the pair is not rectified.
    """
    baseline(frame)
    assert frame.stereo is not None
    left, right = _grey(frame.image, frame.response), _grey(frame.stereo.image, frame.response)
    found = _match(left, right, int(np.ceil(frame.camera.width * 0.11 / 16)) * 16)
    grey = left.astype(np.float32)
    mean, square = cv2.blur(grey, (9, 3)), cv2.blur(grey * grey, (9, 3))
    textured = np.sqrt(np.maximum(square - mean * mean, 0)) > _TEXTURE
    return np.where(textured, found, 0).astype(np.float32)


def baseline(frame: Frame) -> float:
    """Return the distance between the two cameras of a rectified pair [m].

    Raises
    ------
    InputError
        If the frame has no second camera or the pair is not rectified.
    """
    if frame.stereo is None:
        raise InputError("have a stereo image", file=frame.image, key="the frame")
    a, b = frame.camera, frame.stereo.camera
    T_a_b = a.T_camera_world @ b.T_world_camera
    same = (a.model, a.width, a.height) == ("PINHOLE", b.width, b.height) and b.model == "PINHOLE"
    same = same and np.allclose((a.fx, a.fy, a.cy), (b.fx, b.fy, b.cy), rtol=1e-4, atol=0.05)
    # 2 % of the baseline across it is what KITTI's own rectification leaves (5 mm of 533 mm along z).
    level = np.abs(T_a_b[:3, :3] - np.eye(3)).max() < 1e-3 and np.abs(T_a_b[1:3, 3]).max() < 0.02 * abs(T_a_b[0, 3])
    if not (same and level and T_a_b[0, 3] > 0):
        raise InputError(
            "be a rectified pair, the second camera to the right",
            got=T_a_b.round(4).tolist(),
            file=frame.stereo.image,
            remedy="Rectify it.",
        )
    return float(T_a_b[0, 3])


def _depth_map(frame: Frame, max_depth: float) -> _DepthMap:
    camera = frame.camera
    inverse = np.zeros((camera.height, camera.width))
    sigma = np.ones_like(inverse)
    if frame.stereo is None and frame.disparity is None:
        raise InputError("have a stereo image or a disparity file", file=frame.image, key="the frame")
    if frame.stereo is not None:
        scale = camera.fx * baseline(frame)
        matched = disparity(frame)
        # Principal points may differ: what counts is the difference of directions.
        inverse = np.where(matched > 0, (matched - (camera.cx - frame.stereo.camera.cx)) / scale, 0)
        sigma[:] = SIGMA_MATCHED / scale
    if frame.disparity is not None:
        stored = read_raw(frame.disparity.file)
        if stored.shape != inverse.shape:
            raise InputError(f"have shape {inverse.shape}", got=stored.shape, file=frame.disparity.file, key="the disparity")
        scale = camera.fx * frame.disparity.baseline
        measured = np.isfinite(stored) & (stored > 0)
        inverse = np.where(measured, stored / frame.disparity.scale / scale, inverse)
        sigma[measured] = SIGMA_MEASURED / scale
    inverse[inverse < 1 / max_depth] = 0
    if frame.masks is not None:
        dynamic = (read_ids(frame.masks.file) > 0).astype(np.uint8)
        # Matching windows smear an object over its outline by half their size.
        inverse[cv2.dilate(dynamic, np.ones((2 * _BLOCK + 1, 2 * _BLOCK + 1), np.uint8)) > 0] = 0
    return _DepthMap(inverse, sigma)


def _points(frame: Frame, depth: _DepthMap) -> StereoPoints:
    rows, cols = np.nonzero(depth.inverse > 0)
    inverse, sigma = depth.inverse[rows, cols], depth.sigma[rows, cols]
    image, _ = read_image(frame.image, frame.response)
    world = transform_points(frame.camera.T_world_camera, _camera_points(frame, rows, cols, 1 / inverse))
    return StereoPoints(
        world,
        image[rows, cols],
        # dz = z^2 d(1/z)
        (sigma / inverse**2).astype(np.float32),
        frame.camera.position,
        np.stack([rows, cols], axis=1).astype(np.int32),
    )


def _agreed(
    recording: Recording, i: int, neighbours: list[int], maps: dict[int, _DepthMap], needed: int, spacing: float, max_sigma: float
) -> _DepthMap:
    """Keep the depths of frame i that at least `needed` neighbours confirm, averaged in inverse depth by 1 / variance."""
    frame, own = recording.frames[i], maps[i]
    rows, cols = np.nonzero(own.inverse > 0)
    step = np.maximum(spacing * frame.camera.fx * own.inverse[rows, cols], 1).astype(int)
    taken = (rows % step == 0) & (cols % step == 0)
    rows, cols = rows[taken], cols[taken]
    inverse, sigma = own.inverse[rows, cols], own.sigma[rows, cols]
    world = transform_points(frame.camera.T_world_camera, _camera_points(frame, rows, cols, 1 / inverse))
    agreeing, through = np.zeros(len(rows), int), np.zeros(len(rows), int)
    weight = 1 / sigma**2
    total, weights = inverse * weight, weight.copy()
    for j in neighbours:
        other = recording.frames[j]
        xy, depth = other.camera.project(world)
        inside = (depth > 0.5) & np.all(np.isfinite(xy), axis=1)
        inside &= (xy[:, 0] >= 0) & (xy[:, 1] >= 0) & (xy[:, 0] < other.camera.width) & (xy[:, 1] < other.camera.height)
        k = np.flatnonzero(inside)
        r, c = xy[k, 1].astype(int), xy[k, 0].astype(int)
        seen, seen_sigma = maps[j].inverse[r, c], maps[j].sigma[r, c]
        known = seen > 0
        k, r, c, seen, seen_sigma = k[known], r[known], c[known], seen[known], seen_sigma[known]
        # Our own error, seen from there: d(1/z_j) = (z_i / z_j)^2 d(1/z_i) to first order.
        expected = 1 / depth[k]
        own_sigma = sigma[k] * (expected / inverse[k]) ** 2
        difference = (seen - expected) / np.hypot(own_sigma, seen_sigma)
        good = np.abs(difference) < 3
        agreeing[k[good]] += 1
        # Seen farther away there: that frame looks through the point.
        through[k[difference < -3]] += 1
        back = transform_points(other.camera.T_world_camera, _camera_points(other, r[good], c[good], 1 / seen[good]))
        z = transform_points(frame.camera.T_camera_world, back)[:, 2]
        valid = z > 0.5
        g = k[good][valid]
        w = 1 / (seen_sigma[good][valid] * (seen[good][valid] ** -1 / z[valid]) ** 2) ** 2
        total[g] += w / z[valid]
        weights[g] += w
    keep = (agreeing >= needed) & (agreeing >= through)
    # The depth's deviation: dz = z^2 d(1/z).
    keep &= (weights / total) ** 2 * weights**-0.5 <= max_sigma
    mean, error = np.zeros_like(own.inverse), np.ones_like(own.sigma)
    mean[rows[keep], cols[keep]] = total[keep] / weights[keep]
    error[rows[keep], cols[keep]] = weights[keep] ** -0.5
    return _DepthMap(mean, error)


def _camera_points(frame: Frame, rows: NDArray, cols: NDArray, depth: NDArray[np.float64]) -> NDArray[np.float64]:
    c = frame.camera
    return np.column_stack([(cols + 0.5 - c.cx) / c.fx * depth, (rows + 0.5 - c.cy) / c.fy * depth, depth])


def _grey(path, response: str | None) -> NDArray[np.uint8]:
    """Return encoded grey levels: matching wants the contrast of the dark parts, not linear light."""
    linear, encoding = read_image(path, response)
    grey = linear @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    return encode(np.repeat(grey[..., None], 3, axis=2), replace(encoding, dtype="uint8", channels=1, response="srgb"))


def _match(left: NDArray[np.uint8], right: NDArray[np.uint8], num_disparities: int) -> NDArray[np.float32]:
    """Run semi-global matching; 0 where it found nothing."""
    # Room at the left, so that the first columns can be matched too.
    wider = [cv2.copyMakeBorder(image, 0, 0, num_disparities, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=num_disparities,
        blockSize=_BLOCK,
        P1=8 * _BLOCK**2,
        P2=32 * _BLOCK**2,
        disp12MaxDiff=_LEFT_RIGHT,
        uniquenessRatio=5,
        speckleWindowSize=120,
        speckleRange=2,
        # Four paths: the modes with three or five are biased by -0.2 to -0.5 px against LiDAR, this one by -0.1 px.
        mode=cv2.STEREO_SGBM_MODE_HH4,
    )
    found = matcher.compute(*wider)[:, num_disparities:].astype(np.float32) / 16
    return np.where(found > 0, found, 0)
