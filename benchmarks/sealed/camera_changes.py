"""What the lens and the sensor do to a picture, as changes of `changes`."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .changes import Truth, _signed, _twist, change
from .worlds import Floats


def _blur(picture: NDArray, sigma: float) -> NDArray:
    # Light from beyond the frame is unknown; what the border shows goes on.
    reach = int(4 * sigma + 1)
    padded = cv2.copyMakeBorder(picture, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    return cv2.GaussianBlur(padded, (0, 0), sigma)[reach:-reach, reach:-reach]


@change()
def glare(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    strength, scale = 0.08 * s, t.world.size[0] / 160

    def veil(p: NDArray, _: int) -> NDArray:
        wide = 0.6 * _blur(p, 9 * scale) + 0.4 * _blur(p, 31.5 * scale)
        return p + strength * (wide - p)

    return replace(t, develop=(*t.develop, veil)).named("glare", strength=strength)


@change()
def vignetting(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    power = 2.5 * s
    gain = (1 + _radius2(t)) ** -power
    return replace(t, develop=(*t.develop, lambda p, _: p * gain[..., None])).named("vignetting", power=power)


def _radius2(t: Truth) -> Floats:
    width, height = t.world.size
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    return (x * x + y * y) / t.world.focal**2


@change()
def defocus(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    if t.world.kind == "street":
        radius, distance = 0.02 * s, 2.5
    else:
        radius, distance = 0.008 * s, float(rng.choice([0.45, 1.2]))
    return replace(t, physics=replace(t.physics, lens=(radius, distance)), samples=256).named(
        "defocus", radius=radius, distance=distance
    )


def _sweep(rng: np.random.Generator, t: Truth, angle: float, shift: float, steps: int) -> tuple[Floats, ...]:
    """Return the poses of all frames at equal steps of a motion that has the believed pose in its middle."""
    motion = [(_twist(rng, 1.0, 0.0), _twist(rng, 0.0, 1.0)) for _ in t.world.frames]
    poses = []
    for k in np.linspace(-0.5, 0.5, steps):
        at = []
        for (pose, _), (turn, move) in zip(t.world.frames, motion, strict=True):
            step = np.eye(4)
            step[:3, :3] = cv2.Rodrigues(k * angle * cv2.Rodrigues(turn[:3, :3])[0])[0]
            step[:3, 3] = k * shift * move[:3, 3]
            at.append(pose @ step)
        poses.append(np.array(at))
    return tuple(poses)


@change()
def motion_blur(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    shift = (0.2 if t.world.kind == "street" else 0.012) * s
    sweep = _sweep(rng, t, 0.015 * s, shift, 17)
    return replace(t, physics=replace(t.physics, shutter=sweep), samples=272).named("motion_blur", angle=0.015 * s, shift=shift)


@change()
def rolling_shutter(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    shift = (0.2 if t.world.kind == "street" else 0.012) * s
    sweep = _sweep(rng, t, 0.015 * s, shift, 13)
    return replace(t, physics=replace(t.physics, shutter=sweep, rolling=True)).named(
        "rolling_shutter", angle=0.015 * s, shift=shift
    )


@change()
def lens_distortion(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    k1, focal = _signed(rng, 0.1, 0.2) * s, t.world.focal

    def warp(xy: Floats, _: int) -> Floats:
        # The recorded point xy is distorted; the ideal one solves xy = ideal (1 + k1 r^2).
        ideal = xy.copy()
        for _step in range(20):
            ideal = xy / (1 + k1 * (ideal**2).sum(axis=1, keepdims=True) / focal**2)
        return ideal

    return replace(t, physics=replace(t.physics, warp=warp), samples=256).named("lens_distortion", k1=k1)


@change()
def chromatic_aberration(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    scales = 1 + np.array([_signed(rng, 0.006, 0.012), 0, _signed(rng, 0.006, 0.012)]) * s
    physics = replace(t.physics, warp=lambda xy, c: xy / scales[c])
    return replace(t, physics=physics, samples=256).named("chromatic_aberration", scales=scales.tolist())


@change()
def lens_droplets(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    width, height = t.world.size
    drops = [(rng.uniform(-0.45, 0.45, 2) * [width, height], rng.uniform(0.025, 0.06) * width) for _ in range(max(1, round(6 * s)))]

    def warp(xy: Floats, _: int) -> Floats:
        out = xy.copy()
        for centre, radius in drops:
            d = (xy - centre) / radius
            r2 = (d * d).sum(axis=1, keepdims=True)
            # A drop turns the picture over and shrinks it.
            out = np.where(
                r2 < 1, np.clip(centre - 1.5 * radius * d, -0.6 * np.array([width, height]), 0.6 * np.array([width, height])), out
            )
        return out

    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    mask = np.zeros((height, width))
    for centre, radius in drops:
        mask = np.maximum(mask, np.clip((radius - np.hypot(x - centre[0], y - centre[1])) + 0.5, 0, 1))

    def blur(p: NDArray, _: int) -> NDArray:
        return p + mask[..., None] * (_blur(p, 0.012 * width) - p)

    t = replace(t, physics=replace(t.physics, warp=warp), samples=256, develop=(*t.develop, blur))
    return t.named("lens_droplets", drops=[[*c.tolist(), r] for c, r in drops])


@change()
def sensor_response(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    gamma = float(np.exp(_signed(rng, 0.15, 0.25) * s))
    return replace(t, develop=(*t.develop, lambda p, _: np.maximum(p, 0) ** gamma)).named("sensor_response", gamma=gamma)


@change()
def saturation(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    # The table of a studio is half as bright as a corner, whose walls are pale.
    level = float(0.45 / s**0.5 * (0.5 if t.world.kind != "corner" else 1.0))
    return replace(t, develop=(*t.develop, lambda p, _: np.minimum(p, level))).named("saturation", level=level)


@change()
def noise_model(rng: np.random.Generator, t: Truth, s: float) -> Truth:
    gain = 1 + 0.6 * s
    return replace(t, noise_gain=gain).named("noise_model", sigma_factor=gain)
