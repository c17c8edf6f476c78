from __future__ import annotations

import json

import numpy as np
import pytest

from materials.directions import even_directions
from materials.foundation.errors import InputError
from materials.foundation.images import write_exr
from materials.measured.recording_photographs import read_recording_photographs

# A camera above that looks down: its x is the world's x, its y the world's -y, its z down.
POSE = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]]


@pytest.fixture
def folder(tmp_path):
    """A matte plane of albedo pi / 5 under four lamps, tilted to the right; half of the picture is no object."""
    towards, n = even_directions(4, 40), np.array([0.3, 0.2, np.sqrt(0.87)])
    normal = np.zeros((4, 6, 3), np.float32)
    normal[:, 3:] = n
    write_exr(tmp_path / "normal.exr", dict(zip("RGB", np.moveaxis(normal, -1, 0))))
    lights, frames = {}, []
    for k, w in enumerate(towards):
        lights[f"led{k}"] = {"type": "directional", "direction": (-3 * w).tolist(), "irradiance": [2, 4, 1]}
        picture = np.zeros((4, 6, 3), np.float32)
        picture[:, 3:] = 0.5 * 0.2 * (n @ w) * np.array([2, 4, 1])
        write_exr(tmp_path / f"{k}.exr", dict(zip("RGB", np.moveaxis(picture, -1, 0))))
        camera = {"model": "ORTHOGRAPHIC", "width": 6, "height": 4, "pixel_size": 0.01, "T_world_camera": POSE}
        frames.append({"image": f"{k}.exr", "camera": camera, "lights": [f"led{k}"], "exposure": 0.5})
    shape = {"name": "plane", "normal_map": "normal.exr", "material": "m"}
    believed = {"format": "simulation/1", "shapes": [shape], "materials": {}, "lights": lights}
    (tmp_path / "recording.json").write_text(json.dumps({"format": "recording/1", "frames": frames}))
    (tmp_path / "simulation.json").write_text(json.dumps(believed))
    return tmp_path


def change(file, key, value):
    content = json.loads(file.read_text())
    at = content
    *path, last = key
    for part in path:
        at = at[part]
    at[last] = value
    file.write_text(json.dumps(content))


def test_reflectance_is_what_is_left_without_lamp_and_exposure(folder):
    p = read_recording_photographs(folder)
    assert p.mask.sum() == 12 and p.normal is not None and np.allclose(p.lights, even_directions(4, 40))
    want = 0.2 * (p.lights @ (0.3, 0.2, np.sqrt(0.87)))
    assert np.allclose(p.abrdf.value, want[None, :, None], rtol=1e-5)
    assert len(read_recording_photographs(folder / "recording.json", images=slice(1, None)).files) == 3


def test_what_photometric_stereo_cannot_use_is_named(folder):
    change(folder / "recording.json", ("frames", 1, "camera", "model"), "PINHOLE")
    with pytest.raises(InputError, match=r"frames\[1\]\.camera\.model must be ORTHOGRAPHIC"):
        read_recording_photographs(folder)
    change(folder / "recording.json", ("frames", 1, "camera", "model"), "ORTHOGRAPHIC")
    change(folder / "recording.json", ("frames", 2, "lights"), ["led0", "led1"])
    with pytest.raises(InputError, match=r"frames\[2\]\.lights must name one light"):
        read_recording_photographs(folder)
    change(folder / "recording.json", ("frames", 2, "lights"), ["led2"])
    change(folder / "simulation.json", ("lights", "led2", "direction"), [0, 0, 1])
    with pytest.raises(InputError, match="shine on the side that the camera sees"):
        read_recording_photographs(folder)
    change(folder / "simulation.json", ("lights", "led2", "type"), "point")
    with pytest.raises(InputError, match="must be directional"):
        read_recording_photographs(folder)
    change(folder / "recording.json", ("frames", 0, "image"), "../x.exr")
    with pytest.raises(InputError, match="path below the folder"):
        read_recording_photographs(folder)
