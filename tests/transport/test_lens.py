"""Lenses that bend and blur, and shutters that take their time, against geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.simulation import Lens, Material
from scene.transforms import look_at
from tests.transport.worlds import rectangle, world
from transport.gbuffer import gbuffer
from transport.lens import Shutter
from transport.render import render

AT = look_at([0, 0, 0], [0, 1, 0])  # x right is the world's x, y down its -z
VIEW = Camera("PINHOLE", 80, 40, AT, 100.0, 100.0, 40.0, 20.0)
GLOW = Material("emission", emission=(1.0, 1.0, 1.0))


def wall(y: float = 10.0):
    return world({"wall": (rectangle((-50, y, -50), (100, 0, 0), (0, 0, 100)), GLOW)}, {})


def half_wall(y: float = 10.0):
    """Return a glowing wall on the right of x = 0."""
    return world({"wall": (rectangle((0, y, -50), (100, 0, 0), (0, 0, 100)), GLOW)}, {})


def test_each_pixel_of_a_distorting_lens_sees_the_point_that_projects_to_it():
    bent = Camera("OPENCV", 80, 40, AT, 60.0, 62.0, 41.0, 19.0, k1=-0.2, k2=0.05, p1=0.01, p2=-0.02)
    seen = gbuffer(wall(), bent)
    xy, depth = bent.project(seen.position.reshape(-1, 3))
    # Where the wall is met is known to some 1e-5 m, which is 1e-4 px.
    np.testing.assert_allclose(xy, bent.pixel_centres(), atol=5e-4)
    np.testing.assert_allclose(depth, seen.depth.ravel(), rtol=1e-5)
    by_lens = gbuffer(wall(), replace(bent, model="PINHOLE", k1=0, k2=0, p1=0, p2=0), Lens(k1=-0.2, k2=0.05))
    assert np.abs(by_lens.position - seen.position).max() < 2.0  # without p1, p2


def test_an_aperture_of_no_size_is_a_pinhole():
    sharp = render(half_wall(), VIEW, samples=4)
    closed = render(half_wall(), VIEW, samples=4, lens=Lens("thin_lens", 0.0, 5.0), shutter=Shutter(AT))
    # The directions differ in the last bit, which may decide on which side of an edge a sample falls.
    assert np.mean(sharp.radiance != closed.radiance) < 0.01


@pytest.mark.parametrize(("distance", "focus"), [(10.0, 5.0), (10.0, 20.0), (4.0, 4.0), (10.0, np.inf)])
def test_a_thin_lens_blurs_an_edge_by_its_circle_of_confusion(distance, focus):
    picture = render(half_wall(distance), VIEW, samples=256, lens=Lens("thin_lens", 0.2, focus))
    # Radius of the circle in pixels: focal length times |1/d - 1/f| times the aperture's radius.
    radius = 100 * abs(1 / distance - 1 / focus) * 0.2
    edge = picture.radiance[..., 0].mean(axis=0)
    at = (np.arange(80) + 0.5 - 40 + np.linspace(-0.5, 0.5, 65)[:, None]) / max(radius, 1e-9)
    x = np.clip(at, -1, 1)
    # Share of a disc on one side of a chord, averaged over the pixel.
    share = (0.5 + (x * np.sqrt(1 - x * x) + np.arcsin(x)) / np.pi).mean(axis=0)
    np.testing.assert_allclose(edge, share, atol=0.01)


def test_a_moving_camera_blurs_an_edge_over_its_way():
    end = AT.copy()
    end[0, 3] = 0.6  # to the right: the edge moves 6 px to the left
    edge = render(half_wall(), VIEW, samples=256, shutter=Shutter(end)).radiance[..., 0].mean(axis=0)
    ramp = np.clip((np.arange(80) + 0.5 - 34) / 6, 0, 1)
    np.testing.assert_allclose(edge, ramp, atol=0.01)
    half = render(half_wall(), VIEW, samples=256, shutter=Shutter(end, exposure=0.5)).radiance[..., 0].mean(axis=0)
    np.testing.assert_allclose(half, np.clip((np.arange(80) + 0.5 - 37) / 3, 0, 1), atol=0.01)


def test_a_turning_camera_with_a_rolling_shutter_shows_each_row_at_its_time():
    end = AT.copy()
    end[:3, :3] = AT[:3, :3] @ Rotation.from_rotvec([0, 0.1, 0]).as_matrix()
    seen = gbuffer(wall(), VIEW, shutter=Shutter(end, exposure=0.0, readout=1.0))
    for row in (0, 13, 39):
        pose = AT.copy()
        pose[:3, :3] = AT[:3, :3] @ Rotation.from_rotvec([0, 0.1 * row / 40, 0]).as_matrix()
        xy, _ = VIEW.moved_to(pose).project(seen.position[row])
        np.testing.assert_allclose(xy[:, 0], np.arange(80) + 0.5, atol=1e-3)
        np.testing.assert_allclose(xy[:, 1], row + 0.5, atol=1e-3)


@pytest.mark.parametrize(
    ("camera", "lens", "shutter", "words"),
    [
        (VIEW, Lens("thin_lens", -1.0, 5.0), None, r"lens\.aperture_radius must lie in \[0, inf\)"),
        (VIEW, Lens("thin_lens", 0.1, 0.0), None, r"lens\.focus_distance must lie in \(0, inf\]"),
        (replace(VIEW, model="OPENCV", k1=0.1), Lens(k1=0.1), None, "lens must leave the distortion to the camera"),
        (VIEW, None, Shutter(AT, 0.6, 0.6), r"exposure \+ readout must lie in \[0, 1\], got 1.2"),
        (Camera("ORTHOGRAPHIC", 8, 8, AT, pixel_size=0.1), None, Shutter(AT), "camera must be PINHOLE or OPENCV"),
    ],
)
def test_optics_that_cannot_be_are_refused(camera, lens, shutter, words):
    with pytest.raises(InputError, match=words):
        render(wall(), camera, samples=1, lens=lens, shutter=shutter)
