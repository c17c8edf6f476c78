"""The forward model of the diagnosis against the path tracer, which shares none of its sampling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evaluate.effects import catalogue
from evaluate.effects.given import with_given
from evaluate.mismatch import formation
from evaluate.mismatch.case import Case, build
from evaluate.mismatch.solve import predict
from evaluate.mismatch.warp import first_piece, moved
from scene.simulation import Medium, PointLight, SphereLight
from transport.render import render
from transport.world import compile_world

from .worlds import glossy, recorded, simulation


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    return recorded(tmp_path_factory.mktemp("glossy"), simulation(glossy()), {})


def test_pieces_share_out_each_pixel(case):
    p = case.pieces
    total = np.bincount(p.pixel, p.weight, len(p.start) - 1)
    np.testing.assert_allclose(total, 1, atol=1e-6)


def test_direct_light_is_what_the_path_tracer_finds(case):
    state = formation.believed(case)
    ours = formation.radiance(case, state)
    frame = 4
    lit = case.recording.frames[frame].lights
    assert lit is not None
    lamps = {n: case.simulation.lights[n] for n in lit}
    traced = render(compile_world(replace(case.simulation, lights=lamps)), case.cameras[frame], 256, 3, 1)
    edge = case.pieces.edge.reshape(case.valid.shape)[frame]
    # Within a pixel without an edge the two differ by how textures and highlights bend across it: a few per mille of what
    # is there; Monte Carlo noise comes on top. Five standard deviations for some 6000 values.
    allowed = 5 * np.sqrt(traced.variance) + 0.004 * traced.radiance.max()
    assert np.all(np.abs(ours[frame] - traced.radiance)[~edge] < allowed[~edge])


def test_the_shadows_of_spheres_of_light_are_those_of_the_path_tracer(case):
    points = simulation()
    lamps = {n: SphereLight(p.position, 0.25, p.intensity) for n, p in points.lights.items() if isinstance(p, PointLight)}
    recording, frame = case.recording, 4
    given = with_given(build(recording, replace(points, lights=dict(lamps))), {})
    soft, hard = (predict(c, [])[2][frame] for c in (given, build(recording, points)))
    lit = recording.frames[frame].lights
    assert lit is not None
    traced = render(compile_world(replace(points, lights={n: lamps[n] for n in lit})), given.cameras[frame], 256, 3, 1)

    # Means over 4 x 4 pixels; edges and textures within a pixel are taken as they come.
    def tiles(image):
        return image.reshape(12, 4, 16, 4, 3).mean(axis=(1, 3))

    allowed = 5 * np.sqrt(tiles(traced.variance) / 16) + 0.02 * traced.radiance.max()
    assert np.all(np.abs(tiles(soft) - tiles(traced.radiance)) < allowed)
    # Points of light cast other shadows.
    assert np.any(np.abs(tiles(hard) - tiles(traced.radiance)) > 2 * allowed)


def test_bounced_light_is_what_the_path_tracer_adds(case):
    matte = recorded(case.recording.root, simulation(), {})
    state = formation.believed(matte)
    direct = formation.radiance(matte, state)
    state.add_ambient(formation.bounced(matte, state, 3, 64).sum(axis=1))
    added = formation.radiance(matte, state) - direct
    frame = 0
    lit = matte.recording.frames[frame].lights
    assert lit is not None
    world = compile_world(replace(matte.simulation, lights={n: matte.simulation.lights[n] for n in lit}))
    far, near = render(world, matte.cameras[frame], 256, 4, 4), render(world, matte.cameras[frame], 256, 5, 1)
    there = far.radiance - near.radiance

    # Means over 8 x 8 pixels, whose noise is known from the two renderings; ours has about as much again.
    def tiles(image):
        return image.reshape(6, 8, 8, 8, 3).mean(axis=(1, 3))

    sigma = np.sqrt(tiles(far.variance + near.variance) / 64)
    wrong = np.abs(tiles(added[frame]) - tiles(there))
    allowed = 5 * np.sqrt(2) * sigma + 0.05 * tiles(there).max()
    assert np.all(wrong < allowed)
    # No bounce at all, or half of what there is, would be noticed.
    assert np.any(0.5 * tiles(there) > allowed)


def test_open_sky_above_the_plate_far_from_the_ball_is_all_there_is(case):
    share, p = formation.open_sky(case), case.pieces
    corner = (p.shape == 0) & (np.abs(p.position[:, :2]).min(axis=1) > 0.2)
    # The ball of radius 0.08 m at 0.3 m hides less than 2 % of the sky.
    assert share[corner].min() > 0.9
    assert share[corner].mean() > 0.97


def test_light_scattered_once_by_fog_is_what_the_path_tracer_finds(case):
    matte = recorded(case.recording.root, simulation(), {})
    sigma_t, albedo = 0.4, 0.8
    fog = next(e for e in catalogue() if e.id == "participating_medium")
    values = {p.name: p.start for p in fog.parameters(matte, None)} | {"sigma_t": sigma_t, "single_albedo": albedo, "g": 0.0}
    # No more than once: nothing comes from all around.
    values |= {f"airlight.{c}": 0.0 for c in "rgb"}
    state = formation.believed(matte)
    clear = formation.radiance(matte, state)
    fog.change(matte, state, values, None, None)
    ours = formation.radiance(matte, state)
    frame = 4
    lit = matte.recording.frames[frame].lights
    assert lit is not None
    lamps = {n: matte.simulation.lights[n] for n in lit}
    foggy = replace(matte.simulation, lights=lamps, medium=Medium(sigma_t, (albedo, albedo, albedo), 0.0))
    traced = render(compile_world(foggy), matte.cameras[frame], 256, 3, 1)
    first = first_piece(matte).reshape(matte.valid.shape)[frame]
    inside = ~matte.pieces.edge.reshape(matte.valid.shape)[frame] & (matte.pieces.shape[first] >= 0)
    # As above; and air in the shadow of the ball, some 0.1 m of it, is lit here: 0.1 sigma_t albedo / 4 pi times the lamp.
    shadow = 0.1 * sigma_t * albedo / (4 * np.pi) * 2.0
    allowed = 5 * np.sqrt(traced.variance) + 0.004 * traced.radiance.max() + shadow
    assert np.all(np.abs(ours[frame] - traced.radiance)[inside] < allowed[inside])
    # What the fog changes is far more than that.
    assert np.median(np.abs(clear[frame] - ours[frame])[inside]) > 5 * shadow


def test_two_fogs_dim_as_one_of_both(case):
    matte = recorded(case.recording.root, simulation(), {})
    fog = next(e for e in catalogue() if e.id == "participating_medium")
    values = {p.name: p.start for p in fog.parameters(matte, None)} | {"single_albedo": 0.0} | {f"airlight.{c}": 0.0 for c in "rgb"}

    def foggy(*extinctions: float):
        state = formation.believed(matte)
        for sigma_t in extinctions:
            fog.change(matte, state, values | {"sigma_t": sigma_t}, None, None)
        return formation.radiance(matte, state)

    np.testing.assert_allclose(foggy(0.2, 0.3), foggy(0.5), rtol=1e-4, atol=1e-6)
    assert np.median(foggy(0.5) / np.maximum(foggy(), 1e-6)) < 0.9


def test_a_picture_that_is_moved_never_turns_negative():
    rng = np.random.default_rng(5)
    picture = np.where(rng.uniform(size=(24, 32, 3)) < 0.5, 0, 1).astype(np.float32)
    flow = np.full((24, 32, 2), 0.4, np.float32)
    out = moved(picture, flow)
    assert out.min() == 0
    # Its own interpolation swings below: the picture tests what it means to.
    assert out.max() > 1.05
