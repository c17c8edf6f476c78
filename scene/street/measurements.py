"""The recording's files that need no light: sweeps, masks, true depth, flow and normals, cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.files import replacing, write_json
from materials.foundation.progress import tracked

from ..boxes import Box, write_boxes
from ..flow_files import write_flow
from ..images import write_exr, write_raw
from ..recording import BoxesFile, DepthFile, Frame, MaskFile, Noise, PointsFile, Recording, write_recording
from .drive import CLASSES
from .lidar import LidarSettings, sweep, to_world
from .truth import FrameTruth, frame_truth, ray_scene
from .world import Street


def write_measurements(street: Street, folder: str | Path, lidar: LidarSettings | None = None) -> None:
    """Write what can be measured or known without rendering.

    `points/NNNN.npz` (key `points`, scanner frame), `masks/NNNN.png` (0 = static), and below `truth/`: `depth/NNNN.exr`,
    `normal/NNNN.exr` (world), `flow/NNNN.npy` and `flow/NNNN.png` (KITTI's 16-bit form), `visible/NNNN.png`,
    `boxes/NNNN.json` (3-D boxes of the moving things in the world), `static_cloud.npz` (all static points of all sweeps in
    the world) and `objects.json` (poses of the moving things).

    Parameters
    ----------
    folder : path
        The recording's folder; files in it are replaced one by one, each whole or absent.
    """
    folder = Path(folder)
    scene, static_points = ray_scene(street, 0), []
    for frame in tracked(range(street.settings.frames), "measuring the street", total=street.settings.frames):
        last = frame == street.settings.frames - 1
        next_scene = None if last else ray_scene(street, frame + 1, scene)
        _write_truth(folder, frame, frame_truth(street, frame, scene, next_scene))
        write_boxes(folder / "truth" / "boxes" / f"{frame:04d}.json", moving_boxes(street, frame))
        if street.settings.lidar:
            rng = np.random.default_rng([street.settings.seed, 100 + frame])
            turn = sweep(scene, street.scanner_poses[frame], rng, lidar)
            _write_npz(folder / "points" / f"{frame:04d}.npz", points=turn.points)
            static_points.append(to_world(street.scanner_poses[frame], turn.points[turn.instance == 0]).astype(np.float32))
        scene = next_scene or scene
    if static_points:
        _write_npz(folder / "truth" / "static_cloud.npz", points=np.concatenate(static_points))
    poses = [{str(k): T.tolist() for k, T in poses.items()} for poses in street.poses]
    write_json(folder / "truth" / "objects.json", {"classes": {str(k): v for k, v in CLASSES.items()}, "T_world_object": poses})


def write_street_recording(street: Street, folder: str | Path, noise: Noise | None, image: str = "images/{:04d}.png") -> Recording:
    """Write `recording.json` beside the files it names, and return it."""
    folder = Path(folder).resolve()
    frames = []
    for frame, camera in enumerate(street.cameras):
        name, truth = f"{frame:04d}", folder / "truth"
        points = PointsFile(folder / "points" / f"{name}.npz", street.scanner_poses[frame]) if street.settings.lidar else None
        frames.append(
            Frame(
                folder / image.format(frame),
                camera,
                "srgb",
                points=points,
                masks=MaskFile(folder / "masks" / f"{name}.png", "vehicle", CLASSES),
                flow=truth / "flow" / f"{name}.npy" if frame + 1 < len(street.cameras) else None,
                depth=DepthFile(truth / "depth" / f"{name}.exr"),
                boxes=BoxesFile(truth / "boxes" / f"{name}.json", np.eye(4)),
            )
        )
    recording = Recording(tuple(frames), folder, "street", None, noise)
    write_recording(folder / "recording.json", recording)
    return recording


def moving_boxes(street: Street, frame: int) -> tuple[Box, ...]:
    """Return the boxes of what moves, about all its triangles, in the world."""
    boxes = []
    for instance, shapes in street.moving.items():
        vertices = np.concatenate([shape.mesh.vertices for shape in shapes]).astype(np.float64)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        T_object_box = np.eye(4)
        T_object_box[:3, 3] = (low + high) / 2
        boxes.append(Box(str(instance), CLASSES[instance], street.poses[frame][instance] @ T_object_box, high - low, True))
    return tuple(boxes)


def _write_truth(folder: Path, frame: int, truth: FrameTruth) -> None:
    name = f"{frame:04d}"
    write_raw(folder / "masks" / f"{name}.png", truth.instance)
    write_exr(folder / "truth" / "depth" / f"{name}.exr", {"depth.Z": truth.depth})
    write_exr(folder / "truth" / "normal" / f"{name}.exr", {f"normal.{c}": truth.normal[..., i] for i, c in enumerate("XYZ")})
    if truth.flow is None or truth.visible is None:
        return
    for suffix in (".npy", ".png"):
        write_flow(folder / "truth" / "flow" / f"{name}{suffix}", truth.flow)
    write_raw(folder / "truth" / "visible" / f"{name}.png", truth.visible.astype(np.uint8) * 255)


def _write_npz(path: Path, points: NDArray[np.float32]) -> None:
    with replacing(path) as temporary:
        np.savez_compressed(temporary, points=points)
