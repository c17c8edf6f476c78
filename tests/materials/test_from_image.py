"""Roughness and relief from one picture, and normals from relief at its true size."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from materials import from_image
from materials.foundation.errors import InputError
from materials.from_image import ImageRelief

SHAPE = (60, 80)


def texture(seed=0, shape=SHAPE):
    return 0.2 + 0.05 * gaussian_filter(np.random.default_rng(seed).normal(size=shape), 1.5)


def plane(shape=SHAPE, step=0.01):
    """Return a level ground seen from straight above, pixels `step` metres apart, x right and y up the picture."""
    row, col = np.mgrid[: shape[0], : shape[1]]
    points = np.stack([col * step, -row * step, np.zeros(shape)], -1)
    normals = np.zeros((*shape, 3))
    normals[..., 2] = 1
    return points, normals


def perspective(shape=SHAPE, height=1.6, focal_px=100.0):
    """Return a level ground seen ahead from `height`: the horizon is just above the picture."""
    row, col = np.mgrid[: shape[0], : shape[1]]
    z = height * focal_px / (row + 5.0)
    points = np.stack([(col - shape[1] / 2) * z / focal_px, z, np.zeros(shape)], -1)
    return points, np.broadcast_to((0.0, 0.0, 1.0), points.shape)


def test_masked_means_ignore_what_is_masked_out():
    image, mask = texture(), np.ones(SHAPE, bool)
    mask[20:40, 30:60] = False
    poisoned = np.where(mask, image, 1e9)
    assert np.array_equal(from_image.masked_gaussian(image, mask, 3.0)[mask], from_image.masked_gaussian(poisoned, mask, 3.0)[mask])


def test_the_masked_mean_of_a_constant_is_that_constant_up_to_the_edge():
    mask = np.random.default_rng(1).random(SHAPE) < 0.3
    assert np.allclose(from_image.masked_gaussian(np.full(SHAPE, 0.7), mask, 2.0)[mask], 0.7)


def test_without_a_mask_it_is_the_plain_gaussian_inside():
    image, mask = texture(), np.ones(SHAPE, bool)
    inside = (slice(16, -16), slice(16, -16))
    assert np.allclose(from_image.masked_gaussian(image, mask, 2.0)[inside], gaussian_filter(image, 2.0)[inside])


def test_roughness_spans_its_range_and_bright_detail_is_smooth():
    image, mask = texture(), np.ones(SHAPE, bool)
    image[30, 40] = 0.6
    rough = from_image.roughness_map(image, mask)
    assert rough.dtype == np.float32 and rough.min() == 0.5 and rough.max() == 1.0
    assert rough[30, 40] == 0.5


def test_height_rises_on_bright_detail_up_to_three_millimetres():
    image, mask = texture(), np.ones(SHAPE, bool)
    image[30, 40] = 0.6
    height = from_image.height_variation(image, mask)
    assert height[30, 40] == height.max() == np.float32(0.003)
    assert height.min() >= 0


def test_a_plain_road_has_middling_roughness_whatever_else_is_in_the_picture():
    mask = np.ones(SHAPE, bool)
    for contrast in (0.1, 0.9):
        image = np.full(SHAPE, 0.2)
        image[:10, :10] *= np.where(np.indices((10, 10)).sum(0) % 2, 1 + contrast, 1 - contrast)
        assert np.allclose(from_image.roughness_map(image, mask)[50:, 50:], 0.75)


def test_exposure_and_shade_do_not_change_the_relief():
    image, mask = texture(), np.ones(SHAPE, bool)
    assert np.allclose(from_image.height_variation(4 * image, mask), from_image.height_variation(image, mask), atol=1e-9)
    shaded = image.copy()
    shaded[:, 40:] *= 0.2
    away = np.ones(SHAPE, bool)
    away[:, 30:50] = False  # the shadow's edge itself is detail
    a = from_image.height_variation(shaded, away)
    b = from_image.height_variation(image, away)
    assert np.allclose(a, b, atol=1e-6)


def test_the_thesis_form_is_the_plain_difference_between_its_extremes():
    image, mask = texture(), np.ones(SHAPE, bool)
    rough = from_image.roughness_map(image, mask, ImageRelief(model="thesis"))
    gamma = from_image.masked_gaussian(image, mask, 8.0) - from_image.masked_gaussian(image, mask, 1.0)
    assert np.allclose(rough, 0.5 + 0.5 * (gamma - gamma.min()) / np.ptp(gamma), atol=1e-6)


def test_no_ground_gives_middling_values_everywhere():
    assert np.all(from_image.roughness_map(texture(), np.zeros(SHAPE, bool)) == 0.75)


def test_a_ramp_of_height_tilts_the_normal_by_its_slope():
    points, normals = plane()
    slope = np.array([0.2, -0.1])
    bumped = from_image.bump_normals(points[..., :2] @ slope, points, normals, np.ones(SHAPE, bool))
    expected = np.array([-0.2, 0.1, 1]) / np.sqrt(1.05)
    assert np.allclose(bumped, expected, atol=1e-6)


def test_in_perspective_the_same_ramp_tilts_alike_near_and_far():
    points, normals = perspective()
    bumped = from_image.bump_normals(points[..., :2] @ (0.05, 0.1), points, normals, np.ones(SHAPE, bool))
    # heights linear on the ground have exact differences, however uneven the pixels
    assert np.allclose(bumped, np.array([-0.05, -0.1, 1]) / np.sqrt(1.0125), atol=1e-5)


def test_on_a_tilted_street_the_relief_tilts_about_the_streets_normal():
    points, normals = plane()
    angle = 0.4
    rotation = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    height = points[..., :2] @ (0.2, -0.1)
    level = from_image.bump_normals(height, points, normals, np.ones(SHAPE, bool))
    tilted = from_image.bump_normals(height, points @ rotation.T, normals @ rotation.T, np.ones(SHAPE, bool))
    assert np.allclose(tilted, level @ rotation.T, atol=1e-6)


def test_relief_fades_with_distance_as_the_footprint_grows():
    height = from_image.height_variation(texture(), np.ones(SHAPE, bool))
    points, normals = perspective()
    tilt = np.arccos(np.clip(from_image.bump_normals(height, points, normals, np.ones(SHAPE, bool))[..., 2], -1, 1))
    assert tilt[1:6].mean() < 0.3 * tilt[-6:-1].mean()
    # 3 mm over the distance between the two neighbours bounds every slope
    bound = 0.003 / np.linalg.norm(points[2, 41] - points[2, 39])
    assert tilt[2, 40] <= np.hypot(bound, 0.003 / np.linalg.norm(points[3, 40] - points[1, 40]))


def test_no_slope_reaches_over_a_step_in_depth():
    points, normals = plane()
    points = points.copy()
    points[:, 40:, 2] += 0.5  # a wall half a metre high, seen from above
    points[:30, :, 1] += 3.0  # and a gap along the ground
    height = np.zeros(SHAPE)
    height[:, 40:] = 0.003
    height[:30] += 0.003
    bumped = from_image.bump_normals(height, points, normals, np.ones(SHAPE, bool))
    assert np.allclose(bumped, normals)


def test_the_edge_of_the_mask_and_lone_pixels_are_no_cliffs():
    points, normals = plane()
    mask = np.zeros(SHAPE, bool)
    mask[20:40, 20:60] = True
    mask[5, 5] = True
    mask[10, 10:14] = True
    height = np.where(mask, points[..., :2] @ (0.1, 0.0), 99.0)
    points[~mask] = np.nan
    bumped = from_image.bump_normals(height, points, normals, mask)
    assert np.allclose(bumped[20:40, 20:60], np.array([-0.1, 0, 1]) / np.sqrt(1.01), atol=1e-6)
    assert np.allclose(bumped[5, 5], (0, 0, 1))
    assert np.allclose(bumped[10, 10:14], np.array([-0.1, 0, 1]) / np.sqrt(1.01), atol=1e-6)
    assert np.all(np.isfinite(bumped))


def test_slopes_are_bounded():
    points, normals = plane(step=1e-4)
    bumped = from_image.bump_normals(np.indices(SHAPE)[0] * 0.001, points, normals, np.ones(SHAPE, bool))
    assert np.allclose(bumped[..., 2], 1 / np.sqrt(1 + 0.6**2))


def test_a_real_street_gets_a_gentle_relief(shared_data):
    cv2 = pytest.importorskip("cv2")
    coded = cv2.imread(str(shared_data / "kitti2015_drive" / "image_02" / "000122.png"))[..., ::-1] / 255.0
    image = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    mask = np.zeros(image.shape[:2], bool)
    mask[300:, 450:850] = True
    rough = from_image.roughness_map(image, mask)
    assert 0.7 < np.median(rough[mask]) < 0.8
    assert np.std(rough[mask]) > 0.05


def test_refusals_name_argument_and_remedy():
    with pytest.raises(InputError, match=r"mask must have shape \(60, 80\)"):
        from_image.roughness_map(texture(), np.ones((5, 5), bool))
    with pytest.raises(InputError, match="mask must be boolean"):
        from_image.roughness_map(texture(), np.ones(SHAPE, np.uint8))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="image must be finite"):
        from_image.roughness_map(np.full(SHAPE, np.nan), np.ones(SHAPE, bool))
    with pytest.raises(InputError, match="roughness_coarse_px must lie in"):
        from_image.roughness_map(texture(), np.ones(SHAPE, bool), ImageRelief(roughness_coarse_px=0.0))
    with pytest.raises(InputError, match="model must be one of contrast, thesis"):
        from_image.roughness_map(texture(), np.ones(SHAPE, bool), ImageRelief(model="magic"))
    with pytest.raises(InputError, match="positions_world must have shape"):
        from_image.bump_normals(texture(), np.zeros((2, 2, 3)), plane()[1], np.ones(SHAPE, bool))
