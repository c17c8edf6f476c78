from typing import NamedTuple

import numpy as np

from transport.kernels.projected import _meets_box, instance_at, is_seen, pack, sample_image

BOX = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]])
EMPTY = np.array([[np.inf] * 3, [-np.inf] * 3])


class Held(NamedTuple):
    """As much of a picture as is looked at here."""

    texels: np.ndarray


def random_rays(count):
    rng = np.random.default_rng(0)
    o = rng.uniform(-4, 4, (count, 3))
    d = rng.normal(size=(count, 3))
    return o, d / np.linalg.norm(d, axis=1, keepdims=True)


def test_a_ray_meets_a_box_just_where_one_of_many_points_on_it_lies_inside():
    o, d = random_rays(300)
    t = np.linspace(0, 12, 6001)[:, None]
    unsure = 0
    for a, b in zip(o, d):
        points = a + t * b
        inside = np.all((points >= BOX[0]) & (points <= BOX[1]), axis=1).any()
        met = _meets_box(BOX, tuple(a), tuple(b))
        assert met or not inside
        unsure += met and not inside
    # Points are 2 mm apart: only a ray that cuts off a corner thinner than that can slip between them.
    assert unsure <= 3


def test_a_ray_within_the_plane_of_a_side_is_never_ruled_out():
    assert _meets_box(BOX, (-3.0, 1.0, 1.0), (1.0, 0.0, 0.0))
    assert _meets_box(BOX, (-3.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def test_no_ray_meets_the_empty_box():
    assert not any(_meets_box(EMPTY, tuple(a), tuple(b)) for a, b in zip(*random_rays(50)))


def test_colours_of_another_object_do_not_bleed_across_its_outline():
    instance = np.array([[0, 7], [0, 7]])
    image = np.where(instance[..., None] == 7, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    texels = pack(image, 1.0, 2.0, instance)
    assert sample_image(texels, texels, 0.9, 1.0, 0) == (0.0, 0.0, 1.0)
    assert sample_image(texels, texels, 1.1, 1.0, 7) == (1.0, 0.0, 0.0)


def test_packed_texels_hold_instances_and_depths():
    near, far = np.array([[3.0, np.inf]]), np.array([[4.0, np.inf]])
    held = Held(pack(np.zeros((1, 2, 3)), near, far, np.array([[0, 65535]])))
    assert [instance_at(held, x, 0.5) for x in (0.5, 1.5, 2.5)] == [0, 65535, -1]
    assert is_seen(held, 0.5, 0.5, 3.5, 0)
    assert not is_seen(held, 0.5, 0.5, 4.5, 0)
    assert is_seen(held, 1.5, 0.5, 9.0, 65535)
