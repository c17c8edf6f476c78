from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from evaluate.effects import catalogue
from evaluate.effects.in_drives import choose_for_drive
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.drive.load import drive_case, drive_settings, load_scene
from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.grid import GroundGrid
from scene.images import write_exr
from scene.mesh import Mesh
from scene.recording import Frame, MaskFile, Noise, Recording
from scene.scene_file import Scene, Sky

SIZE, FOCAL, HEIGHT, WALL = (120, 80), 90.0, 1.6, 18.0
NOISE = Noise(0.002, 0.0003)
FRAMES = 5


def quad(corners) -> Mesh:
    return Mesh(np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32)).with_smooth_normals()


def texture(u, v, seed):
    """Return smooth colours (N, 3) of places on a surface [m]."""
    rng = np.random.default_rng(seed)
    out = np.full((len(u), 3), 0.3)
    for _ in range(14):
        k, phase, colour = rng.uniform(-2.5, 2.5, 2), rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 0.035, 3)
        out += colour * np.sin(k[0] * u + k[1] * v + phase)[:, None]
    return out


def fresnel(cosine):
    return 0.04 + 0.96 * (1 - cosine) ** 5


def camera(f: int, shift: float = 0.0) -> Camera:
    pose = np.array([[1, 0, 0, 0.15 * f + shift], [0, 0, 1, 0.8 * f], [0, -1, 0, HEIGHT], [0, 0, 0, 1.0]])
    return Camera("PINHOLE", *SIZE, pose, FOCAL, FOCAL, SIZE[0] / 2, 0.4 * SIZE[1])


def photographed(c: Camera, gloss: float = 0.0):
    """Return what a camera sees of a road before a wall (H, W, 3), averaged over 4 points a pixel."""
    total = np.zeros((SIZE[1] * SIZE[0], 3))
    for dx, dy in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        o, d = c.rays(c.pixel_centres() + [dx, dy])
        to_wall, to_road = (WALL - o[:, 1]) / d[:, 1], np.where(d[:, 2] < 0, -o[:, 2] / np.minimum(d[:, 2], -1e-9), np.inf)
        on_road = to_road < to_wall
        p = o + np.minimum(to_wall, to_road)[:, None] * d
        road = texture(p[:, 0], p[:, 1], 1) + gloss * fresnel(-d[:, 2])[:, None] * 0.8
        total += np.where(on_road[:, None], road, texture(p[:, 0], p[:, 2], 2)) / 4
    return total.reshape(SIZE[1], SIZE[0], 3)


def drive(folder, gains=None, gloss=0.0, shift=(), body=False) -> Scene:
    rng = np.random.default_rng(7)
    frames = []
    for f in range(FRAMES):
        truth = camera(f, shift[f] if len(shift) else 0.0)
        picture = photographed(truth, gloss) * (1.0 if gains is None else gains[f])
        masks = None
        if body:
            ids = np.zeros(SIZE[::-1], np.uint8)
            x = 20 + 14 * f
            picture[34:46, x : x + 16] = [0.6, 0.1, 0.1]
            ids[34:46, x : x + 16] = 1
            cv2.imwrite(str(folder / f"{f}.png"), ids)
            masks = MaskFile(folder / f"{f}.png")
        picture = picture + np.sqrt(NOISE.read_sigma**2 + NOISE.shot_gain * picture) * rng.standard_normal(picture.shape)
        image = folder / f"{f}.exr"
        write_exr(image, dict(zip("RGB", np.moveaxis(picture.astype(np.float32), -1, 0), strict=True)))
        frames.append(Frame(image, camera(f), "linear", masks=masks))
    road = quad([[-40, -5, 0], [40, -5, 0], [40, WALL, 0], [-40, WALL, 0]])
    wall = quad([[-40, WALL, 0], [40, WALL, 0], [40, WALL, 40], [-40, WALL, 40]])
    # A wall that mirrors less than the sky, and stands in its way.
    means = {n: np.full(3, 0.8, np.float32) for n in ("ground", "environment", "vehicle", "pedestrian")}
    sky = Sky(np.concatenate([np.full((32, 64, 3), 0.8), np.ones((32, 64, 1))], axis=2).astype(np.float32))
    recording = Recording(tuple(frames), folder, noise=NOISE)
    return Scene("drive", recording, road, wall, GroundGrid(0, 0, 1, 1, 1), {}, sky, means, ((),) * FRAMES)


def diagnosed(scene: Scene):
    case, effects = choose_for_drive(drive_case(scene), catalogue())
    return diagnose(case, effects, settings=drive_settings(), say=lambda _: None)


def test_a_still_world_seen_from_several_places_is_consistent(tmp_path):
    d = diagnosed(drive(tmp_path))
    assert (d.verdict, d.findings) == ("consistent", [])
    assert d.case.valid.mean() > 0.5


def test_stated_noise_is_that_of_single_pixels_before_they_are_divided_by_the_exposure(tmp_path):
    scene = drive(tmp_path)
    exposures = np.array([1.0, 2.0, 0.5, 1.0, 4.0])
    frames = tuple(replace(f, exposure=float(e)) for f, e in zip(scene.recording.frames, exposures, strict=True))
    case = drive_case(replace(scene, recording=replace(scene.recording, frames=frames)), factor=2)
    signal, e = case.pictures, exposures[:, None, None, None]
    alone = (NOISE.read_sigma**2 + NOISE.shot_gain * signal * e) / e**2
    assert case.extra is not None
    # Means of four pixels have a fourth of the variance.
    np.testing.assert_allclose(case.noise_of(signal) - case.extra, alone / 4, rtol=1e-3, atol=1e-9)


def test_exposures_are_found_on_frames_that_the_fit_never_saw(tmp_path):
    gains = np.array([1.0, 0.9, 1.1, 0.95, 1.05])
    d = diagnosed(drive(tmp_path, gains))
    assert [f.id for f in d.findings] == ["exposure_drift"]
    p = d.findings[0].parameters
    found = np.exp([p[f"log_gain.{f}"]["value"] for f in range(FRAMES)])
    assert np.abs(found / found.mean() - gains / gains.mean()).max() < 0.01
    assert d.held_out.chi2_after < 0.5 * d.held_out.chi2_before


def test_gloss_of_the_road_is_told_from_exposure(tmp_path):
    d = diagnosed(drive(tmp_path, gloss=1.0))
    assert [(f.id, f.where) for f in d.findings] == [("specular_lobe", "ground")]
    assert abs(d.findings[0].parameters["specular_scale"]["value"] - 1.0) < 0.25


def test_a_camera_out_of_place_is_found(tmp_path):
    d = diagnosed(drive(tmp_path, shift=(0, 0, 0.08, 0, 0)))
    assert "pose_error" in [f.id for f in d.findings]


def test_a_body_that_moves_is_found_in_its_masks(tmp_path):
    d = diagnosed(drive(tmp_path, body=True))
    assert [f.id for f in d.findings] == ["moved_object"]
    assert d.held_out.chi2_after < d.held_out.chi2_before


def test_what_acts_alike_on_all_frames_is_said_not_to_have_been_tested(tmp_path):
    case, effects = choose_for_drive(drive_case(drive(tmp_path)), catalogue())
    assert case.untestable["glare"].startswith("acts on the prediction as on the recording")
    assert set(case.untestable) | {e.id for e in effects} == {e.id for e in catalogue()}


def test_drives_that_predict_nothing_are_refused(tmp_path):
    whole = drive(tmp_path)
    few = Scene(**{**whole.__dict__, "recording": Recording(whole.recording.frames[:2], tmp_path)})
    with pytest.raises(InputError, match="have at least 3 frames"):
        drive_case(few)
    with pytest.raises(InputError, match="must be a scene"):
        load_scene(tmp_path)
