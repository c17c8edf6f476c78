"""Wet ground: what must not change, what must, and where mirror images lie."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from materials.from_image import ImageRelief
from scene.images import Encoding
from scene.scene_file import Cardboard, Scene
from transport.projected_world import ProjectedFrame, body_meshes, project_frame
from transport.separate import Separation, refine, separate, water_normals
from transport.wet import wet_frame

from .plain_street import GRID, PNG, WALL_Y, camera, plain_street

FLAT = ImageRelief(bump_height=0.0)
BOUNCES = 2


def taken_apart(
    scene: Scene, index: int = 0, samples: int = 16, seed: int = 0, relief: ImageRelief = FLAT
) -> tuple[ProjectedFrame, Separation]:
    frame = project_frame(scene, index)
    normals = water_normals(scene.maps["height"], scene.maps["coverage"], GRID.cell)
    return frame, separate(frame, GRID, normals, relief, 1.63, 0.6, "lagarde", 0.95, samples, seed, BOUNCES)


def level(value: float) -> np.ndarray:
    return np.full(GRID.shape, value, np.float32)


@pytest.mark.parametrize(
    "encoding",
    [PNG, Encoding(".png", "uint16", 3, "srgb"), Encoding(".png", "uint8", 1, "srgb"), Encoding(".exr", "float32", 3, "linear")],
)
def test_without_water_the_picture_comes_back_to_the_bit(tmp_path, encoding):
    frame, separation = taken_apart(plain_street(tmp_path, encoding=encoding), samples=4)
    wet = wet_frame(frame, separation, level(0.0), 0, BOUNCES)
    assert wet.raw.dtype == frame.raw.dtype and wet.raw.shape == frame.raw.shape
    assert np.array_equal(wet.raw, frame.raw)
    assert np.array_equal(wet.image, frame.image)


def test_a_second_seed_leaves_only_the_predicted_noise_of_the_specular_light(tmp_path):
    scene = plain_street(tmp_path)
    _, first = taken_apart(scene, seed=0, samples=32)
    _, second = taken_apart(scene, seed=1, samples=32)
    ground = first.share == 1
    difference = (first.specular - second.specular)[ground]
    sigma2 = (first.variance + second.variance)[ground]
    assert not np.array_equal(first.specular, second.specular)
    # Independent samples give a mean square z of 1; scrambled Sobol points can only be better. 10 standard errors of the
    # mean over the pixels (three channels are as good as one) are allowed above.
    z2 = difference**2 / np.maximum(sigma2, 1e-12)
    assert z2.mean() <= 1 + 10 * np.sqrt(2 / ground.sum())


def test_samples_added_later_give_the_bits_of_one_long_run(tmp_path):
    scene = plain_street(tmp_path)
    _, whole = taken_apart(scene, samples=14, relief=ImageRelief())
    frame, grown = taken_apart(scene, samples=4, relief=ImageRelief())
    grown = refine(frame, refine(frame, grown, 6), 14)
    assert grown.samples == whole.samples
    for part in ("specular", "scale", "diffuse", "share", "variance"):
        assert np.array_equal(getattr(grown, part), getattr(whole, part)), part


def test_noise_is_not_understated_where_only_some_rays_of_a_pixel_find_the_ground(tmp_path):
    scene = plain_street(tmp_path)
    runs = [taken_apart(scene, seed=seed, samples=8)[1] for seed in range(24)]
    edge = runs[0].wanted & np.any([run.share < 1 for run in runs], axis=0)
    assert edge.sum() > 100
    seen = np.var([run.specular[edge] for run in runs], axis=0, ddof=1, dtype=float).mean()
    stated = np.mean([run.variance[edge] for run in runs], dtype=float)
    # A variance from 24 runs has the relative error (2 / 23)^1/2, its mean over the pixels (three channels are as good as
    # one) that over the root of their number; 5 of these above. Below, Sobol points may be any better.
    assert seen < stated * (1 + 5 * np.sqrt(2 / 23 / edge.sum()))


def test_pixels_off_the_water_stay_to_the_bit_at_any_wetness(tmp_path):
    frame, separation = taken_apart(plain_street(tmp_path))
    x, _ = GRID.centres()
    wet = wet_frame(frame, separation, np.where(x > 0, 0.9, 0.0).astype(np.float32), 0, BOUNCES)
    dry = (frame.position[..., 0] < -0.3) | ~frame.is_ground
    # A pixel whose square reaches the wet half, or the ground from off it, may change: look one pixel further in.
    inner = np.ones_like(dry)
    for rows, cols in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        inner &= np.roll(dry, (rows, cols), (0, 1))
    assert inner.any()
    assert np.array_equal(wet.raw[inner], frame.raw[inner])
    assert np.any(
        wet.raw[frame.is_ground & (frame.position[..., 0] > 0.5)] != frame.raw[frame.is_ground & (frame.position[..., 0] > 0.5)]
    )


def test_a_trace_of_water_changes_the_picture_by_less_than_its_bound(tmp_path):
    # W = 0.005 is 1 % saturation. Diffuse light falls by 0.01 (1 - rho) with rho = 0.52. The lobe's roughness falls by
    # e = 0.005 (1 - rho), alpha by 2 e; the ratio of two GGX densities is at most (alpha/alpha')^2 = 1 + 4 e, that of
    # the masking terms as well, and Fresnel's reflectance changes by less than 2 (1 - eta'/eta) < 2 e at any angle.
    # So the specular light changes by at most 10 e of itself, to first order; 12 e covers the second.
    frame, separation = taken_apart(plain_street(tmp_path), samples=64)
    wet = wet_frame(frame, separation, level(0.005), 0, BOUNCES)
    e = 0.005 * (1 - 0.52)
    bound = 0.01 * (1 - 0.52) * np.abs(separation.diffuse) + 12 * e * separation.specular
    # Both estimates share their random numbers, but a turned ray may meet another edge: 6 standard errors.
    noise = 6 * np.sqrt(separation.variance + wet.wet.variance)
    assert np.all(np.abs(wet.image - frame.image) <= bound + noise + 1e-6)
    assert np.mean(np.abs(wet.image - frame.image)[separation.share == 1]) < np.mean(bound[separation.share == 1])


def test_wet_light_is_never_negative_and_the_parts_sum_to_the_picture(tmp_path):
    frame, separation = taken_apart(plain_street(tmp_path), relief=ImageRelief())
    wet = wet_frame(frame, separation, level(0.7), 0, BOUNCES)
    assert wet.image.min() >= 0 and wet.diffuse.min() >= 0 and wet.specular.min() >= 0
    inside = separation.share == 1
    # Three float32 sums of values below 1.
    assert np.allclose((wet.diffuse + wet.specular)[inside], wet.image[inside], atol=5e-7)
    assert np.all(separation.diffuse >= 0) and np.all(separation.scale <= 1)


def test_saturated_ground_is_darker_by_rho_in_its_diffuse_light(tmp_path):
    frame, separation = taken_apart(plain_street(tmp_path))
    wet = wet_frame(frame, separation, level(0.5), 0, BOUNCES)
    inside = separation.share == 1
    assert np.allclose(wet.diffuse[inside], 0.52 * separation.diffuse[inside], rtol=1e-5)


def test_wet_grains_darken_the_more_the_nearer_their_index_is_to_waters(tmp_path):
    # Twomey: in water grains of nearly its index scatter straight on, so light goes deeper and less of it returns.
    frame = project_frame(plain_street(tmp_path), 0)
    upright = np.tile(np.array([0, 0, 1], np.float32), (*GRID.shape, 1))
    kept = []
    for eta in (1.4, 1.63, 1.9):
        ground = separate(frame, GRID, upright, FLAT, eta, 0.6, "twomey", 0.95, 1, 0, BOUNCES).ground
        kept.append(float(ground.attenuation[frame.is_ground].mean()))
    assert kept[0] < kept[1] < kept[2] < 1


def test_a_puddle_mirrors_the_wall_where_a_mirror_would(tmp_path):
    frame, separation = taken_apart(plain_street(tmp_path), samples=32)
    ground = separation.ground._replace(strength=1.0)
    wet = wet_frame(frame, replace(separation, ground=ground), level(1.0), 0, BOUNCES)
    # With full accumulation the water is a mirror: the ray from a road point p goes up as steeply as it came down, and
    # meets the wall at height z = (WALL_Y - p_y) * 1.6 / (p_y + 5).
    p = frame.position
    with np.errstate(invalid="ignore"):
        z = (WALL_Y - p[..., 1]) * 1.6 / (p[..., 1] + 5.0)
    is_red = wet.specular[..., 0] > 2 * wet.specular[..., 1]
    inside = frame.is_ground & (separation.share == 1)
    inside[:, :20] = inside[:, -20:] = False  # there the mirrored ray meets the wall outside of the picture
    assert np.all(is_red[inside & (z > 2.1) & (z < 2.9)])
    assert not np.any(is_red[inside & ((z < 1.9) | (z > 3.1))])


def test_the_water_surface_reflects_by_fresnels_law(tmp_path):
    frame, separation = taken_apart(plain_street(tmp_path), samples=32)
    ground = separation.ground._replace(strength=1.0)
    wet = wet_frame(frame, replace(separation, ground=ground), level(1.0), 0, BOUNCES)
    p = frame.position
    with np.errstate(invalid="ignore"):
        z = (WALL_Y - p[..., 1]) * 1.6 / (p[..., 1] + 5.0)
    # The grey wall well between its foot and the red band, which single samples at a pixel's rim may meet; its radiance is
    # what its 8 bits decode to.
    grey = (separation.share == 1) & (z > 0.7) & (z < 1.4)
    grey[:, :20] = grey[:, -20:] = False
    assert grey.sum() > 100
    level_of_grey = np.rint(255 * (1.055 * 0.35 ** (1 / 2.4) - 0.055))
    radiance = ((level_of_grey / 255 + 0.055) / 1.055) ** 2.4
    rows, cols = np.nonzero(grey)
    corners = [frame.camera.rays(np.column_stack([cols + i, rows + j]))[1] for i in (0, 1) for j in (0, 1)]
    reflected = np.array([fresnel(-d[:, 2]) for d in corners]) * radiance
    # Samples fill the pixel's square, over which the angle changes: their mean lies between the corners' values. Positions
    # and radiances of 32 bits differ by a few 1e-6 of theirs.
    got = wet.wet.specular[grey][:, 0]
    assert np.all(got >= reflected.min(axis=0) * (1 - 1e-5))
    assert np.all(got <= reflected.max(axis=0) * (1 + 1e-5))


def fresnel(cos: np.ndarray) -> np.ndarray:
    """Return what water reflects of unpolarised light."""
    cos_t = np.sqrt(1 - (1 - cos**2) / 1.33**2)
    s, p = (cos - 1.33 * cos_t) / (cos + 1.33 * cos_t), (1.33 * cos - cos_t) / (1.33 * cos + cos_t)
    return (s**2 + p**2) / 2


def test_the_number_of_threads_changes_no_bit(tmp_path, thread_counts):
    scene = plain_street(tmp_path)
    images = []
    for threads in thread_counts:
        numba.set_num_threads(threads)
        frame, separation = taken_apart(scene, samples=4, relief=ImageRelief())
        images.append(wet_frame(frame, separation, level(0.8), 0, BOUNCES).image)
    assert np.array_equal(*images)


def test_the_ground_behind_a_cars_board_sees_less_light_than_behind_a_board_alone(tmp_path, monkeypatch):
    view = camera()
    board = Cardboard(1, "vehicle", np.array([[-2.0, 6, 0], [2, 6, 0], [2, 6, 1.5], [-2, 6, 1.5]]))
    mask = np.zeros((view.height, view.width), np.uint8)
    xy, _ = view.project(board.corners_world)
    (x0, y0), x1 = xy.min(axis=0), xy[:, 0].max()
    # The camera sees below the car: the mask begins 0.3 m above the road.
    foot, _ = view.project(np.array([[0, 6, 0.3]]))
    mask[int(y0) + 1 : int(foot[0, 1]), int(x0) + 1 : int(x1)] = 1
    scene = plain_street(tmp_path, masks=[mask], boards=((board,),))
    with_car, body = taken_apart(scene, samples=32)
    p = with_car.position
    below = with_car.is_ground & (np.abs(p[..., 0]) < 1.5) & (p[..., 1] > 6.2) & (p[..., 1] < 7.5)
    assert below.any()
    # The thesis's board is a plane: the ground behind it saw the sky. Hull and underside are taken away to infinity.
    whole = body_meshes

    def plane_only(board: Cardboard, eye: np.ndarray):
        plane, hull, underside = whole(board, eye)
        away = np.float32((0, 0, 1e4))
        return plane, replace(hull, vertices=hull.vertices + away), replace(underside, vertices=underside.vertices + away)

    monkeypatch.setattr("transport.projected_world.body_meshes", plane_only)
    _, plane = taken_apart(scene, samples=32)
    darker = (plane.specular - body.specular)[below].mean()
    # Pixels are independent, channels are not; what Sobol points save is left unused.
    error = np.sqrt((plane.variance + body.variance)[below].mean(axis=-1).sum()) / below.sum()
    assert darker > 5 * error


def diffuse_change(scene: Scene, waters: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return how the wet and the dry diffuse light of road points differ between two frames, along the true flow."""
    wet, dry, frames = [], [], []
    for t, water in enumerate(waters):
        frame, separation = taken_apart(scene, t, samples=64)
        wet.append(wet_frame(frame, separation, water, 0, BOUNCES).diffuse.mean(axis=-1))
        dry.append(separation.diffuse.mean(axis=-1))
        frames.append(frame)
    xy, _ = frames[1].camera.project(np.nan_to_num(frames[0].position).reshape(-1, 3))
    col, row = (xy[:, i].reshape(frames[0].is_ground.shape) for i in range(2))
    near = frames[0].is_ground & (frames[0].position[..., 1] < 3) & (row > 1) & (row < 66) & (col > 1) & (col < 158)
    at = np.array([row[near] - 0.5, col[near] - 0.5])
    return tuple(map_coordinates(layer[1], at, order=1) - layer[0][near] for layer in (wet, dry))


def test_the_diffuse_layer_of_the_road_moves_with_the_road(tmp_path):
    scene = plain_street(tmp_path, views=[camera(y=-5.0), camera(y=-4.7)])
    x, y = GRID.centres()

    def pattern(shift: float) -> np.ndarray:
        return (0.25 + 0.2 * np.sin(4 * (y + shift)) * np.cos(x)).astype(np.float32)

    wet, dry = diffuse_change(scene, [pattern(0), pattern(0)])
    # What the dry layer changes by (resampling, view, noise) the wet one may, times its factor of at most 1; on top of it
    # the factor itself, 1 - 0.48 * 2 W, is read off a picture: linear interpolation over a footprint h of up to 0.12 m
    # (4 m away, 1.6 m high, f = 135 px) is off by h^2 / 8 times its curvature 0.48 * 2 * 0.2 * 4^2, a 1/180 of 0.25.
    bound = np.abs(dry).mean() + 0.25 * 0.12**2 / 8 * 0.48 * 2 * 0.2 * 16
    assert np.abs(wet).mean() < bound
    # Water that swims with the camera, 0.3 m a frame, must be caught by the same bound.
    swimming, _ = diffuse_change(scene, [pattern(0), pattern(-0.3)])
    assert np.abs(swimming).mean() > 2 * bound
