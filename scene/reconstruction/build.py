"""From a recording to a scene, stage by stage: each is kept by the content of what it reads, and made again only if that
changed. Interrupted at any point, the finished stages remain and nothing is half-written."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, read_json, write_json
from materials.foundation.progress import logger, tracked
from materials.foundation.settings import as_dict

from ..boxes import Box
from ..grid import GroundGrid
from ..images import read_exr, write_exr
from ..mesh import Mesh, read_ply, write_ply
from ..points import read_points
from ..recording import Recording, camera_json, read_recording
from ..scene_file import Cardboard, Scene, Sky, read_scene, write_scene
from ..sources.recording_copy import check_recording, copy_recording
from ..transforms import transform_points
from .boxed_objects import boxes_to_draw, with_box_masks, write_box_masks
from .build_report import measure, write_report
from .build_settings import BuildSettings
from .cardboard import GroundCaster, cardboards
from .cloud import Cloud, accumulate, moved, path_of, read_cloud, world_offset, write_cloud
from .moving_masks import read_moving, with_motion_masks, write_motion_masks, write_moving
from .stages import StageResult, Stages, digest_of, file_digest
from .surface import reconstruct_environment, reconstruct_ground

# Every 50th point is kept from the surfaces, so that their error can be measured on points they never saw.
HELD_OUT = 50
_MOVING = "moving.npz"


def build(recording: Recording, folder: str | Path, settings: BuildSettings | None = None) -> Scene:
    """Build the scene of a recording.

    Parameters
    ----------
    recording : Recording
        Images with poses, and sweeps, a cloud or stereo pairs; without frames a cloud alone gives meshes and maps.
    folder : path
        Becomes the scene: `scene.json` (written last), meshes, maps, cardboards, `preview/`, `scene.glb`, `report.json`
        and `report.md`; `.stages/` keeps what a later run may reuse, and may be deleted.
    settings : BuildSettings, optional

    Returns
    -------
    scene : Scene
        As read back from the folder.

    Raises
    ------
    InputError
        If the recording cannot be used; the message names the file or key.
    """
    settings = settings or BuildSettings()
    for index, frame in enumerate(recording.frames):
        if frame.camera.model == "ORTHOGRAPHIC":
            key = f"frames[{index}].camera.model"
            raise InputError("be PINHOLE or OPENCV for a drive", got="ORTHOGRAPHIC", file=recording.root, key=key)
    check_recording(recording)
    folder = make_folder(folder)
    offset = world_offset(recording)
    if offset.any():
        logger.info("the world is moved by %s m, so that 32-bit numbers resolve it", offset.tolist())
    recording = moved(recording, offset)
    stages = Stages(folder / ".stages")
    source = _source_digest(recording, offset)

    cloud_inputs = {"source": source, "settings": _plain(settings, "cloud", "dynamics", "ground")}
    cloud_stage = stages.run("cloud", cloud_inputs, lambda out: _cloud(recording, settings, offset, out))
    masked, boxes = _masked(recording, settings, source, cloud_stage, stages)
    copied = stages.run("recording", {"source": source, "masks": _digest(stages, "masks")}, lambda out: _copy(masked, out))
    surface_inputs = {"cloud": cloud_stage.digest, "settings": _plain(settings, "surface", "height_field")}
    ground_stage = stages.run("ground", surface_inputs, lambda out: _ground(cloud_stage, recording, settings, out))
    surface_inputs = {"cloud": cloud_stage.digest, "settings": _plain(settings, "surface")}
    environment_stage = stages.run("environment", surface_inputs, lambda out: _environment(cloud_stage, settings, out))
    board_inputs = {"copy": copied.digest, "source": source, "ground": ground_stage.digest}
    board_inputs |= {"settings": _plain(settings, "cardboards")}
    board_stage = stages.run("cardboards", board_inputs, lambda out: _boards(masked, boxes, ground_stage, settings, out))
    boards = _read_boards(board_stage)
    photos = read_recording(copied.folder / "recording" / "recording.json")
    geometry = {
        "copy": copied.digest,
        "ground": ground_stage.digest,
        "environment": environment_stage.digest,
        "boards": board_stage.digest,
    }
    bare = {"ground": ground_stage.folder / "ground.ply", "environment": environment_stage.folder / "environment.ply"}
    map_inputs = {**geometry, "settings": _plain(settings, "terrain"), "seed": settings.seed}
    map_stage = stages.run("maps", map_inputs, lambda out: _maps(bare, photos, settings, out))
    exposure_stage = stages.run("exposure", geometry, lambda out: _exposure(bare, photos, out))
    gains = np.array(read_json(exposure_stage.folder / "gains.json"), np.float64)
    lit = {**geometry, "exposure": exposure_stage.digest}
    colour_stage = stages.run("colours", lit, lambda out: _colours(bare, photos, boards, gains, out))
    sky_stage = stages.run(
        "sky", {**lit, "settings": _plain(settings, "sky")}, lambda out: _sky(bare, photos, boards, settings, gains, out)
    )

    finished = {name: result.digest for name, result in stages.results.items()}
    saved = {**as_dict(settings), "world_offset": offset.tolist()}
    key = digest_of({"stages": finished, "settings": saved, "name": recording.name})
    if _is_written(folder, key):
        logger.info("scene: unchanged, kept")
        return read_scene(folder)
    # Without its scene.json a folder is no scene: until all is written there must be none, not the last build's.
    (folder / "scene.json").unlink(missing_ok=True)
    (folder / ".stages" / "written.json").unlink(missing_ok=True)
    copy = copy_recording(photos, folder / "recording")
    scene = _assemble(recording.name, copy, colour_stage, map_stage, sky_stage, boards, saved, gains)
    _clear(folder / "cardboards")
    write_scene(folder, scene)
    _describe(folder, scene, read_cloud(cloud_stage.folder / "cloud.npz"), stages, board_stage)
    write_json(folder / ".stages" / "written.json", {"key": key})
    return read_scene(folder)


def _describe(folder: Path, scene: Scene, cloud: Cloud, stages: Stages, board_stage: StageResult) -> None:
    """Write previews, the glTF file and the report."""
    from .export import export_scene
    from .preview import write_previews

    _clear(folder / "preview")
    previews = write_previews(folder / "preview", scene)
    shown = next((i for i, boards in enumerate(scene.cardboards) if boards), 0)
    export_scene(folder / "scene.glb", scene, shown)
    boards = read_json(board_stage.folder / "cardboards.json")
    assert isinstance(boards, dict)
    report = measure(scene, cloud, stages, boards["notes"], HELD_OUT)
    write_report(folder, report, previews)


def _masked(
    recording: Recording, settings: BuildSettings, source: str, cloud: StageResult, stages: Stages
) -> tuple[Recording, list[dict[int, Box]]]:
    """Return the recording with masks, drawn from boxes or from what moved where it has none; and the boxes by their ids."""
    no_boxes: list[dict[int, Box]] = [{} for _ in recording.frames]
    if any(frame.boxes is not None and frame.masks is None for frame in recording.frames):
        drawn = boxes_to_draw(recording, settings.dynamics)
        inputs = {"source": source, "settings": _plain(settings, "dynamics")}
        stage = stages.run("masks", inputs, lambda out: write_box_masks(recording, drawn, out))
        return with_box_masks(recording, drawn, stage.folder), drawn
    if (cloud.folder / _MOVING).exists():
        moving = read_moving(cloud.folder / _MOVING)
        inputs = {"source": source, "cloud": cloud.digest}
        stage = stages.run("masks", inputs, lambda out: write_motion_masks(recording, moving, out))
        return with_motion_masks(recording, moving, stage.folder), no_boxes
    return recording, no_boxes


def _digest(stages: Stages, name: str) -> str | None:
    return stages.results[name].digest if name in stages.results else None


def _copy(recording: Recording, out: Path) -> None:
    copy_recording(recording, out / "recording")


def _cloud(recording: Recording, settings: BuildSettings, offset: NDArray[np.float64], out: Path) -> None:
    try:
        cloud = accumulate(recording, settings.cloud, settings.dynamics, settings.ground, offset)
    except InputError as error:
        raise error.at(file=recording.root) from error
    write_cloud(out / "cloud.npz", cloud)
    if cloud.moving is not None and len(cloud.moving.ids):
        write_moving(out / _MOVING, cloud.moving)


def _used(cloud: Cloud) -> NDArray[np.bool_]:
    return np.arange(len(cloud.points_world)) % HELD_OUT != 0


def _ground(stage: StageResult, recording: Recording, settings: BuildSettings, out: Path) -> None:
    cloud = read_cloud(stage.folder / "cloud.npz")
    points = cloud.points_world[cloud.is_ground & _used(cloud)]
    mesh, _ = reconstruct_ground(points, path_of(recording), settings.surface, settings.height_field)
    if mesh.num_faces == 0:
        raise InputError(
            "show enough ground for a mesh", got=f"{len(points)} ground points", file=recording.root, key="the point cloud"
        )
    write_ply(out / "ground.ply", mesh)


def _environment(stage: StageResult, settings: BuildSettings, out: Path) -> None:
    cloud = read_cloud(stage.folder / "cloud.npz")
    part = cloud.part(~cloud.is_ground & _used(cloud))
    write_ply(out / "environment.ply", reconstruct_environment(part.points_world, part.sensors_world, settings.surface))


def _boards(recording: Recording, boxes: list[dict[int, Box]], stage: StageResult, settings: BuildSettings, out: Path) -> None:
    frames, notes = [], []
    if any(frame.masks is not None for frame in recording.frames):
        caster = GroundCaster(read_ply(stage.folder / "ground.ply"))
        for frame, given in tracked(zip(recording.frames, boxes, strict=True), "cardboards", len(recording.frames)):
            sweep = None
            if frame.points is not None and frame.masks is not None:
                points = frame.points.unit * read_points(frame.points.file)[:, :3].astype(np.float64)
                sweep = transform_points(frame.points.T_world_points, points)
            start = time.perf_counter()
            boards, note = cardboards(frame, caster, sweep, settings.cardboards, given)
            each = (time.perf_counter() - start) / max(len(note), 1)
            frames.append([{"instance": b.instance, "kind": b.kind, "corners_world": b.corners_world.tolist()} for b in boards])
            notes.append({str(id): value | {"seconds": each} for id, value in note.items()})
    else:
        frames, notes = [[] for _ in recording.frames], [{} for _ in recording.frames]
    write_json(out / "cardboards.json", {"frames": frames, "notes": notes})


def _read_boards(stage: StageResult) -> tuple[tuple[Cardboard, ...], ...]:
    data = read_json(stage.folder / "cardboards.json")
    assert isinstance(data, dict)
    return tuple(
        tuple(Cardboard(b["instance"], b["kind"], np.array(b["corners_world"])) for b in frame) for frame in data["frames"]
    )


def _maps(files: dict[str, Path], photos: Recording, settings: BuildSettings, out: Path) -> None:
    from ..wetting.terrain import ground_maps

    meshes = _meshes(files)
    occluders = [mesh for name, mesh in meshes.items() if name != "ground"]
    grid, maps = ground_maps(read_ply(files["ground"]), photos, settings.terrain, settings.seed, occluders)
    write_json(
        out / "grid.json", {key: getattr(grid, key) for key in ("x_min", "y_min", "cell", "rows", "cols")} | {"maps": sorted(maps)}
    )
    for name, values in maps.items():
        write_exr(out / f"{name}.exr", {"Y": values})


def _exposure(files: dict[str, Path], photos: Recording, out: Path) -> None:
    from .projection import frame_gains

    write_json(out / "gains.json", [float(gain) for gain in frame_gains(_meshes(files), photos)])


def _colours(files: dict[str, Path], photos: Recording, boards, gains: NDArray[np.float64], out: Path) -> None:
    from .projection import class_means, fill_colours

    meshes = _meshes(files)
    coloured = fill_colours(meshes, photos, boards, gains)
    for name, file in files.items():
        write_ply(out / f"{name}.ply", coloured[name] if name in coloured else _uncoloured(read_ply(file)))
    means = class_means(photos, meshes, boards)
    write_json(out / "class_means.json", {name: [float(v) for v in value] for name, value in means.items()})


def _sky(files: dict[str, Path], photos: Recording, boards, settings: BuildSettings, gains: NDArray[np.float64], out: Path) -> None:
    from .sky import sky_panorama

    panorama = sky_panorama(photos, _meshes(files), boards, settings.sky, gains).panorama
    write_exr(out / "sky.exr", dict(zip("RGBA", np.moveaxis(panorama, -1, 0), strict=True)))


def _meshes(files: dict[str, Path]) -> dict[str, Mesh]:
    """Read meshes, without those that have no triangles: a bare square has no environment."""
    meshes = {name: read_ply(file) for name, file in files.items()}
    return {name: mesh for name, mesh in meshes.items() if mesh.num_faces}


def _uncoloured(mesh: Mesh) -> Mesh:
    blank = {f"fill_{c}": np.zeros(len(mesh.vertices), np.float32) for c in "rgbw"}
    return replace(mesh, attributes={**mesh.attributes, **blank})


def _assemble(
    name: str,
    copy: Recording,
    colours: StageResult,
    maps: StageResult,
    sky: StageResult,
    boards: tuple[tuple[Cardboard, ...], ...],
    saved: dict[str, Any],
    gains: NDArray[np.float64],
) -> Scene:
    g = read_json(maps.folder / "grid.json")
    means = read_json(colours.folder / "class_means.json")
    assert isinstance(g, dict)
    assert isinstance(means, dict)
    panorama = read_exr(sky.folder / "sky.exr")
    return Scene(
        name,
        copy,
        read_ply(colours.folder / "ground.ply"),
        read_ply(colours.folder / "environment.ply"),
        GroundGrid(g["x_min"], g["y_min"], g["cell"], g["rows"], g["cols"]),
        {key: read_exr(maps.folder / f"{key}.exr")["Y"].astype(np.float32) for key in g["maps"]},
        Sky(np.stack([panorama[c] for c in "RGBA"], axis=-1).astype(np.float32)),
        {key: np.array(value, np.float32) for key, value in means.items()},
        boards,
        saved,
        tuple(float(gain) for gain in gains),
    )


def _source_digest(recording: Recording, offset: NDArray[np.float64]) -> str:
    """Return a digest of all files and numbers of a recording."""
    files: list[Path] = [] if recording.points is None else [recording.points]
    numbers: list[Any] = [offset.tolist(), recording.name, recording.points_unit]
    for frame in recording.frames:
        parts = (frame.points, frame.masks, frame.disparity, frame.depth, frame.boxes)
        files += [frame.image, *(part.file for part in parts if part is not None)]
        files += [frame.stereo.image] if frame.stereo else []
        files += [file for file in (frame.segmentation, frame.flow) if file is not None]
        numbers.append([camera_json(frame.camera), frame.response, frame.exposure, frame.lights])
        numbers.append(frame.points and [frame.points.T_world_points.tolist(), frame.points.unit])
        numbers.append(frame.masks and [frame.masks.default_class, sorted((frame.masks.classes or {}).items())])
        numbers.append(frame.stereo and camera_json(frame.stereo.camera))
        numbers.append(frame.disparity and [frame.disparity.scale, frame.disparity.baseline])
        numbers.append(frame.depth and frame.depth.scale)
        numbers.append(frame.boxes and [frame.boxes.T_world_boxes.tolist(), frame.boxes.unit])
    return digest_of({"files": [(file.name, file_digest(file)) for file in files], "numbers": numbers})


def _plain(settings: BuildSettings, *names: str) -> dict[str, Any]:
    return {name: as_dict(getattr(settings, name)) for name in names}


def _is_written(folder: Path, key: str) -> bool:
    note = folder / ".stages" / "written.json"
    if not (note.exists() and (folder / "scene.json").exists()):
        return False
    data = read_json(note)
    return isinstance(data, dict) and data.get("key") == key


def _clear(folder: Path) -> None:
    """Remove the files of a last build: a scene must not show boards or pictures of frames that it no longer has."""
    for path in folder.glob("*") if folder.is_dir() else ():
        path.unlink()
