"""The street stands on its ground, looks outwards, and is the same each time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.simulation import DirectionalLight, EnvironmentLight
from scene.street import Street, StreetSettings, street
from scene.street import layout as at
from scene.street.drive import AHEAD, CLASSES, WALKER, object_poses, on_wheels
from scene.street.rays import RayScene
from scene.street.vehicles import CONTACTS, HATCHBACK, SALOON, WHEEL_RADIUS, car
from scene.transforms import transform_points


def test_every_mesh_is_finite_with_unit_normals_and_finite_uv(small_street: Street):
    for shape in (*small_street.static, *small_street.moving_shapes(0)):
        mesh = shape.mesh
        assert mesh.num_faces > 0, shape.name
        assert mesh.faces.max() < len(mesh.vertices), shape.name
        assert np.isfinite(mesh.vertices).all(), shape.name
        assert mesh.uv is not None and np.isfinite(mesh.uv).all(), shape.name
        assert mesh.normals is not None
        used = np.unique(mesh.faces)
        lengths = np.linalg.norm(mesh.normals[used], axis=1)
        # float32 normals: rounding of three components.
        np.testing.assert_allclose(lengths, 1.0, atol=1e-5, err_msg=shape.name)


def test_shading_normals_agree_with_the_faces_they_smooth(small_street: Street):
    for shape in (*small_street.static, *small_street.moving_shapes(0)):
        mesh = shape.mesh
        faces = mesh.face_normals()
        has_area = np.linalg.norm(faces, axis=1) > 0.5
        shading = mesh.normals[mesh.faces].mean(axis=1)  # type: ignore[index]
        against = np.einsum("fc,fc->f", faces, shading)[has_area] < 0
        # At a crease (the rim of a car's nose, the foot of a kerb) a smoothed normal may tip over a sliver's edge.
        assert against.mean() < 0.005, shape.name


def test_default_street_stays_below_the_triangle_budget(small_street: Street):
    # The ground is the only part whose mesh grows with detail; its lines are cheap to lay at full detail.
    from scene.street.ground import _lines_x, _lines_y

    x, y = _lines_x(0.04), _lines_y(small_street.relief.lines_y, 0.04)
    rest = sum(s.mesh.num_faces for s in small_street.static if s.name not in small_street.looks)
    moving = sum(s.mesh.num_faces for s in small_street.moving_shapes(0))
    assert 2 * len(x) * len(y) + rest + moving < 1_500_000


def test_kerbs_are_twelve_centimetres_high_all_along(small_street: Street):
    x = np.linspace(at.X_BACK + 1, at.X_END - 1, 400)
    for side, edge in ((1, at.ROAD_LEFT), (-1, at.ROAD_RIGHT)):
        foot = small_street.relief.height(x, np.full_like(x, edge))
        top = small_street.relief.height(x, np.full_like(x, edge + side * 0.025))
        np.testing.assert_allclose(top - foot, at.KERB_HEIGHT, atol=1e-3)


def test_the_crown_stands_six_to_eight_centimetres_above_the_left_edge(small_street: Street):
    # Averaged along the street: relief has zero mean but ruts and hollows lie below the profile, by some millimetres.
    x = np.linspace(0, 60, 2000)
    crown = small_street.relief.height(x, np.zeros_like(x)).mean()
    edge = small_street.relief.height(x, np.full_like(x, at.ROAD_LEFT - at.GUTTER)).mean()
    assert 0.05 < crown - edge < 0.08


def test_the_ground_is_one_sheet_without_gaps(small_street: Street):
    rng = np.random.default_rng(3)
    x, y = rng.uniform(at.X_BACK + 0.1, at.X_END - 0.1, 4000), rng.uniform(-20, 20, 4000)
    ground = tuple(s for s in small_street.static if s.name in small_street.looks)
    origins = np.column_stack([x, y, np.full(4000, 30.0)])
    hits = RayScene(ground).cast(origins, np.tile([0.0, 0.0, -1.0], (4000, 1)))
    assert np.isfinite(hits.distance).all()
    assert (hits.normal[:, 2] > 0).all()


def test_ground_meshes_follow_the_true_height(small_street: Street):
    # Vertices are samples of the height itself, stored as float32 (at most 86 m: 4 micrometres).
    for shape in small_street.static:
        if shape.name.startswith("road"):
            v = shape.mesh.vertices.astype(np.float64)
            np.testing.assert_allclose(v[:, 2], small_street.relief.height(v[:, 0], v[:, 1]), atol=1e-4)


@pytest.mark.parametrize("shape", [HATCHBACK, SALOON])
def test_a_car_stands_on_its_four_wheels_and_on_nothing_else(shape):
    parts = car(shape, "paint_red")
    lowest = {name: float(mesh.vertices[:, 2].min()) for name, mesh in parts.items()}
    # A tyre of 40 flat sides misses its circle by r (1 - cos(pi / 40)) at most.
    assert abs(lowest["rubber"]) <= WHEEL_RADIUS * (1 - np.cos(np.pi / 40)) + 1e-6
    assert all(z > 0.10 for name, z in lowest.items() if name != "rubber")


def test_a_car_is_as_large_as_a_car():
    vertices = np.concatenate([m.vertices for m in car(HATCHBACK, "paint_red").values()])
    length, width, height = np.ptp(vertices, axis=0)
    assert 3.9 < length < 4.5 and 1.6 < width < 2.15 and 1.4 < height < 1.6


def test_car_bodies_look_outwards():
    for shape in (HATCHBACK, SALOON):
        for name in ("paint_red", "glass"):
            mesh = car(shape, "paint_red")[name]
            faces = mesh.face_normals()
            outward = mesh.vertices[mesh.faces].mean(axis=1) - [0.0, 0.0, 0.75]
            area = np.linalg.norm(faces, axis=1) > 0.5
            assert (np.einsum("fc,fc->f", faces, outward)[area] > 0).mean() > 0.97


def test_wheels_of_all_cars_touch_the_ground_within_a_centimetre(longest_drive: Street):
    poses = [p[k] for p in longest_drive.poses for k in p if CLASSES[k] == "vehicle"]
    poses += [on_wheels(longest_drive.relief, x, at.PARKING, 0.0) for x in at.PARKED]
    for T in poses:
        # A tyre rests on a patch of some 12 cm x 16 cm; its mean height is what carries it.
        contact = transform_points(T, CONTACTS)
        spots = [(0, 0), (0.06, 0), (-0.06, 0), (0, 0.08), (0, -0.08)]
        z = np.mean([longest_drive.relief.height(contact[:, 0] + a, contact[:, 1] + b) for a, b in spots], axis=0)
        assert np.abs(contact[:, 2] - z).max() < 0.01


def test_the_pedestrian_is_of_human_size_and_stands_on_the_road(small_street: Street):
    vertices = np.concatenate([s.mesh.vertices for s in small_street.moving[WALKER]])
    assert 1.65 < np.ptp(vertices[:, 2]) < 1.95
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    for poses in small_street.poses:
        T = poses[WALKER]
        sole = transform_points(T, vertices[vertices[:, 2] < 0.005].astype(np.float64))
        ground = small_street.relief.height(sole[:, 0], sole[:, 1])
        # The sole is flat, the road is not: ruts and grain differ by less than 1.5 cm over a foot.
        assert np.abs(sole[:, 2] - ground).max() < 0.015


@pytest.fixture(scope="module")
def longest_drive(small_street: Street) -> Street:
    settings = replace(small_street.settings, frames=12)
    return replace(small_street, settings=settings, poses=object_poses(settings, small_street.relief))


def test_moving_things_never_touch_each_other_or_what_is_parked(longest_drive: Street):
    parked = [s.mesh.vertices for s in longest_drive.static if s.kind == "parked"]
    for frame in range(longest_drive.settings.frames):
        boxes = []
        for instance in longest_drive.moving:
            v = np.concatenate([s.mesh.vertices for s in longest_drive.moving_shapes(frame) if s.instance == instance])
            boxes.append((v.min(axis=0), v.max(axis=0)))
        boxes += [(np.min(v, axis=0), np.max(v, axis=0)) for v in parked]
        for i in range(len(longest_drive.moving)):
            for j, (low, high) in enumerate(boxes):
                apart = (boxes[i][0] > high).any() or (boxes[i][1] < low).any()
                assert i == j or apart


def test_poses_of_moving_things_are_rigid(small_street: Street):
    for poses in small_street.poses:
        for T in poses.values():
            np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
            assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)


def test_albedos_are_those_of_real_surfaces(small_street: Street):
    road = small_street.looks["road_near"].albedo
    assert 0.08 < np.median(road) < 0.15
    slabs = small_street.looks["pavement_right_near"].albedo
    assert 0.2 < np.median(slabs) < 0.35
    grass = np.median(small_street.looks["grass_near"].albedo.reshape(-1, 3), axis=0)
    assert grass[1] > grass[0] > grass[2] and grass[1] < 0.15
    for name, material in small_street.materials.items():
        texture = material.albedo if material.albedo_texture is None else material.albedo_texture
        assert np.min(texture) >= 0, name
        assert np.max(texture) <= 0.85, name


def test_the_clear_sky_is_blue_brighter_near_the_sun_and_never_negative():
    from scene.street.sky import clear_sky, sun_direction

    sun = sun_direction()
    zenith = clear_sky(np.array([0.0, 0.0, 1.0]), sun)
    near_sun = clear_sky(sun, sun)
    assert zenith[2] > zenith[0]
    assert near_sun[1] > 3 * zenith[1]
    # The zenith formula by hand: chi = (4/9 - 2.6/120)(pi - 2 x 0.8552) = 0.6051, (4.0453 x 2.6 - 4.9710) tan chi
    # - 0.2155 x 2.6 + 2.4192 = 5.69 kcd/m2.
    assert zenith @ [0.2126, 0.7152, 0.0722] == pytest.approx(5.69, rel=0.005)


def test_a_white_sheet_that_faces_the_sun_has_the_stated_radiance(small_street: Street):
    sun, sky = small_street.lights["sun"], small_street.lights["sky"]
    assert isinstance(sun, DirectionalLight) and isinstance(sky, EnvironmentLight) and sky.panorama is not None
    direct = 0.8 / np.pi * sun.irradiance[1]
    # The sun alone gives most of 1.6; the sky's share depends on the sheet's tilt.
    assert 1.1 < direct < 1.6
    assert sky.panorama.min() > 0 and np.isfinite(sky.panorama).all()


def test_the_overcast_street_has_no_sun():
    from scene.street.sky import lights

    assert list(lights("overcast", rows=32)) == ["sky"]


def test_the_same_seed_gives_the_same_street_and_another_another(small_street: Street):
    settings = small_street.settings
    again, other = street(settings), street(replace(settings, seed=2))
    for a, b in zip(small_street.static, again.static, strict=True):
        assert a.name == b.name
        np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
    for name, look in small_street.looks.items():
        np.testing.assert_array_equal(look.albedo, again.looks[name].albedo)
    assert not np.array_equal(small_street.relief.detail, other.relief.detail)


def test_static_meshes_are_shared_between_frames(small_street: Street):
    first, second = small_street.simulation(0, 0.5), small_street.simulation(1, 0.5)
    pairs = [(a, b) for a, b in zip(first.shapes, second.shapes, strict=True) if a.instance == 0]
    assert all(a.mesh is b.mesh for a, b in pairs)


def test_settings_out_of_range_are_refused():
    with pytest.raises(InputError, match="frames must lie in"):
        StreetSettings(frames=1)
    with pytest.raises(InputError, match="fov_deg must lie in"):
        StreetSettings(fov_deg=170)


def test_a_frame_that_does_not_exist_is_refused(small_street: Street):
    with pytest.raises(InputError, match="frame must lie in"):
        small_street.simulation(99)
    with pytest.raises(InputError, match="wetness must lie in"):
        small_street.simulation(0, 1.5)


def test_the_car_ahead_drives_on_by_its_speed(small_street: Street):
    x = [poses[AHEAD][0, 3] for poses in small_street.poses]
    np.testing.assert_allclose(np.diff(x), 1.15)
