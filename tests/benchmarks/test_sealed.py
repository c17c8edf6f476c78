"""The generator of sealed recordings, as far as it needs no Mitsuba."""

from __future__ import annotations

import ast
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.proof_sealed import opened
from benchmarks.sealed import camera_changes, generate, photograph
from benchmarks.sealed.changes import CHANGES, UNLISTED, Truth
from benchmarks.sealed.score import judge, table
from benchmarks.sealed.worlds import random_world

FOLDER = Path(camera_changes.__file__).parent


@pytest.mark.parametrize("kind", ["studio", "corner", "street"])
def test_a_world_has_unit_normals_on_the_side_of_its_cameras(kind):
    world = random_world(np.random.default_rng(1), kind)
    for name, body in world.bodies.items():
        np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1, atol=1e-9)
        corners = body.vertices[body.faces]
        winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(winding, axis=1)
        solid = area > 1e-3 * np.median(area)
        agree = (winding * body.normals[body.faces].mean(axis=1)).sum(axis=1)[solid] > 0
        assert agree.all(), name


def test_a_table_is_seen_in_twenty_distinct_pairs_of_five_poses_and_six_lamps():
    world = random_world(np.random.default_rng(2), "studio")
    pairs = {(pose.tobytes(), lit) for pose, lit in world.frames}
    assert len(pairs) == 20
    assert len({p for p, _ in pairs}) <= 5 and len({lit for _, lit in pairs}) <= 6


@pytest.mark.parametrize("id", sorted(CHANGES | UNLISTED))
def test_a_change_names_itself_and_changes_something(id):
    change, kinds = (CHANGES | UNLISTED)[id]
    rng = np.random.default_rng(3)
    world = random_world(rng, kinds[0], (32, 24), glossy=id == "anisotropy")
    if id == "near_field_light":
        world = generate._directional(world)
    before = Truth(world)
    after = change(rng, before, 1.0)
    # Light that is followed through a body goes between bodies as well.
    more = ["interreflection"] if id == "subsurface" else []
    assert [e["id"].removeprefix("unlisted:") for e in after.effects] == [id, *more]
    assert after.world is not before.world or after.physics != before.physics or after.develop or after.noise_gain != 1
    json.dumps(after.effects)


def test_a_change_of_strength_zero_leaves_the_picture_alone():
    rng = np.random.default_rng(4)
    picture = rng.uniform(0.1, 0.9, (24, 32, 3))
    world = random_world(rng, "corner", (32, 24))
    for id in ("exposure_drift", "glare", "vignetting", "sensor_response", *UNLISTED):
        after = (CHANGES | UNLISTED)[id][0](np.random.default_rng(5), Truth(world), 0.0)
        for develop in after.develop:
            np.testing.assert_allclose(develop(picture, 0), picture, atol=1e-12, err_msg=id)


def test_a_rolling_shutter_takes_each_row_at_its_own_time():
    # Views whose every pixel is the time they were taken at.
    times = np.linspace(0, 1, 5)
    views = np.broadcast_to(times[:, None, None, None], (5, 10, 2, 3))
    np.testing.assert_allclose(photograph._by_row(views)[:, 0, 0], (np.arange(10) + 0.5) / 10)


def test_a_plan_holds_the_shares_that_were_asked_for():
    trials = generate.plan(np.random.default_rng(6), 2000, nulls=0.3, pairs=0.2, unlisted=0.1)
    share = [np.mean([len(t) == 0 for t in trials]), np.mean([bool(t) and t[0] in UNLISTED for t in trials])]
    # Three standard deviations of a binomial share of 2000.
    np.testing.assert_allclose(share, [0.3, 0.1], atol=3 * np.sqrt(0.25 / 2000))
    assert {t[0] for t in trials if t and t[0] in CHANGES} == set(CHANGES)


def test_the_commitment_is_the_hash_of_salt_and_answers(tmp_path):
    answers = {"trial-001": {"effects": [], "affected": np.zeros((2, 3, 4), bool)}}
    commitment, salt = generate.seal(answers, tmp_path)
    text = (tmp_path / "answers.json").read_text()
    assert hashlib.sha256((salt + text).encode()).hexdigest() == commitment
    assert json.loads(text)["trial-001"]["affected_fraction"] == 0
    assert np.load(tmp_path / "trial-001.npz")["affected"].shape == (2, 3, 4)


def test_the_generator_shares_no_physics_with_what_it_tests():
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) and node.level == 0 else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert name.split(".")[0] not in ("transport", "evaluate"), (path.name, name)
                assert not name.startswith("materials.") or name.startswith("materials.foundation"), (path.name, name)


def diagnosis(folder: Path, verdict: str, *effects: dict) -> Path:
    folder.mkdir()
    (folder / "diagnosis.json").write_text(json.dumps({"verdict": verdict, "effects": list(effects), "held_out": {}}))
    np.savez(folder / "affected.npz", affected=np.ones((1, 2, 2), bool))
    return folder


@pytest.mark.parametrize(
    ("wanted", "verdict", "named", "exact", "in_sets"),
    [
        ([], "consistent", [], True, True),
        ([], "explained", [("glare", [])], False, False),
        (["glare"], "explained", [("glare", ["ambient_light"])], True, True),
        (["glare"], "explained", [("ambient_light", ["glare"])], False, True),
        (["glare"], "explained", [("ambient_light", ["glare", "vignetting", "defocus"])], False, False),
        (["glare"], "explained", [("glare", []), ("defocus", [])], False, False),
        (["height_fog"], "explained", [("participating_medium", [])], True, True),
        (["glare", "vignetting"], "partly_explained", [("glare", [])], False, False),
        (["glare", "vignetting"], "explained", [("vignetting", []), ("glare", [])], True, True),
        (["unlisted:ghost"], "explained", [("glare", [])], False, False),
        (["unlisted:ghost"], "partly_explained", [("glare", [])], True, True),
    ],
)
def test_a_diagnosis_is_right_if_it_names_all_and_nothing_else(tmp_path, wanted, verdict, named, exact, in_sets):
    folder = diagnosis(tmp_path / "out", verdict, *({"id": id, "ambiguous_with": others} for id, others in named))
    answer = {"effects": [{"id": id} for id in wanted]}
    v = judge("trial", answer, np.array([[[True, False], [False, False]]]), folder, 1.0)
    assert (v.exact, v.in_sets) == (exact, in_sets)
    assert v.overlap == 0.25


def test_a_diagnosis_that_failed_is_wrong_and_stays_in_the_table(tmp_path):
    v = judge("trial", {"effects": []}, np.zeros((1, 1, 1), bool), tmp_path, 1.0, "exit code 2")
    assert not v.exact and not v.in_sets
    assert "exit code 2" in table([v])


def test_answers_that_were_changed_after_the_sealing_are_refused(tmp_path):
    envelope, recordings = tmp_path / "envelope", tmp_path / "recordings"
    recordings.mkdir()
    commitment, salt = generate.seal({"trial-001": {"effects": [], "affected": np.zeros((1, 1, 1), bool)}}, envelope)
    (recordings / "commitment.json").write_text(json.dumps({"sha256": commitment}))
    (envelope / "salt.json").write_text(json.dumps({"salt": salt}))
    assert opened(recordings, envelope)["trial-001"]["effects"] == []
    (envelope / "answers.json").write_text((envelope / "answers.json").read_text().replace("[]", '[{"id": "glare"}]'))
    with pytest.raises(RuntimeError, match="committed"):
        opened(recordings, envelope)
