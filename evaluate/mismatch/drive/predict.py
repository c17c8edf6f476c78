"""A frame as the other frames predict it: their colours of the world's points that it sees, and how far these can be wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_fill_holes, uniform_filter

from scene.camera import Camera
from scene.images import read_ids, read_image
from scene.reconstruction.frame_view import FrameView, depth_map
from scene.recording import Frame, Noise
from scene.scene_file import Scene

from ..case import Floats
from .look import ENVIRONMENT, GROUND, Look, Surroundings, look, mirrored

# How far a mesh is off along its normal [m]: a ground point is known to 2 cm (`surface_noise` of scene-build), and no
# cell of the environment is finer than 8 cm.
_OFF = {GROUND: 0.02, ENVIRONMENT: 0.04}
_GRAZING = 0.03  # least cosine by which the error along the normal is turned into one of depth
_LEAST = 0.04  # of the fineness at which a frame sees a point: below it has no say
_RIM = 2  # [px]
_WITNESSES = 2  # frames that have to agree
# What is seen less finely than the first lacks the detail that a blur of the second [px] takes away.
_COARSE = ((0.8, 0.7), (0.5, 1.2), (0.25, 2.5))
_AGREE = 0.35  # frames that differ by more than this share from their median are not asked


@dataclass(frozen=True)
class DriveFrame:
    """A frame at the size that the diagnosis works at.

    Attributes
    ----------
    view : FrameView
        Its `linear` is divided by the exposure that the recording states.
    clipped : (H, W) bool
    sight : Look
    """

    name: str
    view: FrameView
    clipped: NDArray[np.bool_]
    sight: Look


@dataclass(frozen=True)
class Predicted:
    """A frame as the others predict it; P pixels, S frames.

    Attributes
    ----------
    picture : (P, 3) float32
    known : (P,) bool
        Whether at least two frames agree on it.
    variance : (P, 3) float32
        Of the prediction: depth, pose and the others' noise.
    colour : (S, P, 3) float32
        What each frame saw.
    share : (S, P) float32
        Its weight, in total 1.
    radius2 : (S, P) float32
        Squared distance from the principal point at which it saw it, in focal lengths.
    gloss : (P, 3) float32
        What the frame would mirror, less what the others mirrored on average.
    """

    picture: Floats
    known: NDArray[np.bool_]
    variance: Floats
    colour: Floats
    share: Floats
    radius2: Floats
    gloss: Floats


def drive_frame(frame: Frame, rays_scene: Any, factor: int) -> DriveFrame:
    """Read a frame, averaged over `factor` x `factor` pixels; rows and columns that are left over are cut off."""
    linear, encoding = read_image(frame.image, frame.response)
    height, width = frame.camera.height // factor, frame.camera.width // factor
    cut = linear[: height * factor, : width * factor]
    top = 0.98 if encoding.dtype.startswith("uint") else np.inf
    clipped = cut.max(axis=2) >= top
    small = cut.reshape(height, factor, width, factor, 3).mean(axis=(1, 3)) / np.float32(frame.exposure)
    ids = np.zeros(cut.shape[:2], np.int32)
    if frame.masks is not None:
        raw = read_ids(frame.masks.file)
        ids = (raw if raw.ndim == 2 else raw[..., 0])[: height * factor, : width * factor].astype(np.int32)
    # A body fills what it touches.
    instances = _whole_bodies(ids.reshape(height, factor, width, factor).max(axis=(1, 3)))
    dynamic = cv2.dilate((instances > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    camera = smaller(frame.camera, factor)
    depth, mesh = depth_map(rays_scene, camera)
    view = FrameView(camera, small.astype(np.float32), np.inf, instances, dynamic, depth, mesh)
    parts = np.asarray(clipped.reshape(height, factor, width, factor).any(axis=(1, 3)))
    return DriveFrame(frame.name, view, parts, look(rays_scene, camera))


def _whole_bodies(ids: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return ids (H, W) without holes, and with a rim: masks are drawn by hand, and leave out windows and shadows."""
    out = ids.copy()
    for i in np.unique(ids[ids > 0]):
        own = binary_dilation(binary_fill_holes(ids == i), iterations=_RIM)
        out[own & (out == 0)] = i
    return out


def smaller(camera: Camera, factor: int) -> Camera:
    """Return the camera of pictures averaged over `factor` x `factor` pixels."""
    width, height = camera.width // factor, camera.height // factor
    cut = Camera(**{**camera.__dict__, "width": width * factor, "height": height * factor})
    return cut.scaled_to(width, height)


def predict_frame(
    scene: Scene,
    rays_scene: Any,
    surroundings: Surroundings,
    frames: list[DriveFrame],
    t: int,
    noise: Noise,
    exposures: tuple[float, ...],
    pose_error_px: float,
) -> Predicted:
    """Predict frame t from all others.

    Parameters
    ----------
    noise, exposures
        Of pictures before they were divided by the exposures of `frames`.
    pose_error_px : float
        Standard deviation of what poses and calibration may displace points by, in pixels of `frames`.
    """
    own, others = frames[t], [f for i, f in enumerate(frames) if i != t]
    sight, camera = own.sight, own.view.camera
    gains = np.array([scene.gain(i) / scene.gain(t) for i in range(len(frames)) if i != t], np.float32)
    colour, fineness = _seen(others, sight.points, sight, camera)
    share, known = _shares(colour / gains[:, None, None], fineness)
    picture = np.einsum("sp,spc->pc", share, colour).astype(np.float32)
    radius2 = np.nan_to_num(np.stack([_radius2(f.view.camera, sight.points) for f in others])).astype(np.float32)
    mirrors = np.stack([mirrored(surroundings, rays_scene, sight, f.view.camera.position) for f in others])
    gloss = mirrored(surroundings, rays_scene, sight, camera.position) - np.einsum("sp,spc->pc", share, mirrors)
    disagreement = np.einsum("sp,spc->pc", share, (colour / gains[:, None, None]) ** 2)
    disagreement -= np.einsum("sp,spc->pc", share, colour / gains[:, None, None]) ** 2
    variance = _displaced(others, own, picture, share, pose_error_px) + _unresolved(own, (share * fineness).sum(axis=0))
    variance += _blurred(np.maximum(disagreement, 0), camera, 5)
    exposure = np.array([e for i, e in enumerate(exposures) if i != t], np.float32)
    read, shot = np.einsum("sp,s->p", share**2, exposure**-2), np.einsum("sp,s->p", share**2, 1 / exposure)
    variance += noise.read_sigma**2 * read[:, None] + noise.shot_gain * shot[:, None] * np.maximum(picture, 0)
    return Predicted(picture, known, variance.astype(np.float32), colour, share, radius2, gloss.astype(np.float32))


def _seen(others: list[DriveFrame], points: NDArray[np.float64], sight: Look, camera: Camera) -> tuple[Floats, Floats]:
    """Return what others see of points (S, P, 3), and how finely (S, P): 1 is as finely as the frame itself, 0 not at all."""
    spacing = np.where(np.isfinite(sight.depth), sight.depth, 1.0) / camera.fx
    colour, fineness = [], []
    for f in others:
        c, quality = f.view.colours(points, sight.normals, spacing)
        to_eye = f.view.camera.position - points
        cosine = np.abs((to_eye * sight.normals).sum(axis=1)) / np.maximum(np.linalg.norm(to_eye, axis=1), 1e-9)
        # Quality is the share of the points' resolution, less by the tilt, times the tilt's cosine: the frame's own is tilted too.
        fine = np.minimum(quality / np.maximum(cosine * sight.cosine, 1e-3), 1)
        colour.append(c)
        fineness.append(np.where((fine > _LEAST) & (sight.mesh >= 0), fine, 0))
    return np.stack(colour), np.stack(fineness).astype(np.float32)


def _shares(colour: Floats, fineness: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return each frame's weight (S, P), and where enough agree: frames far from the weighted median have none."""
    luminance = colour @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    order = np.argsort(luminance, axis=0)
    below = np.cumsum(np.take_along_axis(fineness, order, 0), axis=0)
    middle = np.argmax(below >= 0.5 * below[-1], axis=0)
    median = np.take_along_axis(np.take_along_axis(luminance, order, 0), middle[None], 0)
    weight = np.where(np.abs(luminance - median) <= _AGREE * np.abs(median) + 1e-6, fineness, 0)
    total = weight.sum(axis=0)
    known = ((weight > 0).sum(axis=0) >= _WITNESSES) & (total > 0.5 * fineness.sum(axis=0))
    return (weight / np.maximum(total, 1e-9)).astype(np.float32), known


def _radius2(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    xy, _ = camera.project(points)
    return ((xy - (camera.cx, camera.cy)) ** 2).sum(axis=1) / camera.fx**2


def _displaced(others: list[DriveFrame], own: DriveFrame, picture: Floats, share: Floats, pose_error_px: float) -> Floats:
    """Return the variance (P, 3) of a prediction whose depths and poses are off: what it changes by if surfaces lie nearer or
    farther, its gradient times what poses displace, and what lies between pixels."""
    sight, camera = own.sight, own.view.camera
    off = np.select([sight.mesh == m for m in _OFF], list(_OFF.values()), 0.0) / np.maximum(sight.cosine, _GRAZING)
    off = np.minimum(off, 0.1 * np.where(np.isfinite(sight.depth), sight.depth, 0.0))
    moved = []
    for sign in (-1, 1):
        colour, fineness = _seen(others, sight.points + sign * off[:, None] * sight.rays, sight, camera)
        w = share * (fineness > 0)
        total = w.sum(axis=0)[:, None]
        moved.append(np.where(total > 0, np.einsum("sp,spc->pc", w, colour) / np.maximum(total, 1e-9), picture))
    P = picture.reshape(camera.height, camera.width, 3)
    across, down = np.asarray(np.gradient(P, axis=1)), np.asarray(np.gradient(P, axis=0))
    curved = cv2.Laplacian(P, cv2.CV_32F).reshape(-1, 3) / 8
    square = ((moved[1] - moved[0]) / 2) ** 2 + curved**2 + pose_error_px**2 * (across**2 + down**2).reshape(-1, 3)
    return _blurred(square, camera, 3)


def _unresolved(own: DriveFrame, fineness: NDArray) -> Floats:
    """Return the variance (P, 3) of the detail of a frame that the others see too coarsely to know of."""
    picture, camera = own.view.linear, own.view.camera
    out = np.zeros((len(fineness), 3), np.float32)
    for below, sigma in _COARSE:
        detail = (picture - cv2.GaussianBlur(picture, (0, 0), sigma)).reshape(-1, 3) ** 2
        out = np.where((fineness < below)[:, None], _blurred(detail, camera, 7), out)
    return out


def _blurred(values: NDArray, camera: Camera, size: int) -> Floats:
    return uniform_filter(values.reshape(camera.height, camera.width, 3), (size, size, 0)).reshape(-1, 3)
