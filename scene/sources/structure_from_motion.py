"""Cameras and sparse points from photographs alone, by COLMAP's incremental mapping on the CPU (pycolmap).

Schoenberger and Frahm: Structure-from-Motion Revisited, CVPR 2016. Seeds are fixed, but its bundle adjustment runs on
several threads; results are kept by the content of the images, so that the same images are not solved twice.
"""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, replacing_folder
from materials.foundation.progress import logger, stage, tracked

from ..camera import Camera
from ..images import read_raw
from ..points import read_points, write_points
from ..recording import Recording
from .colmap import read_model, recording_of

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
# Features are sought at no more than this many pixels along the longer side: finer detail costs time and adds no accuracy.
_MAX_SIDE = 1600
_MAX_FEATURES = 4096
# Up to this many images all pairs are matched; beyond it, neighbours in the order of names.
_ALL_PAIRS = 60
# The scale of photographs is unknown; the median distance from a camera to what it sees is set to this.
ASSUMED_DISTANCE = 10.0


def is_image_folder(path: Path) -> bool:
    """Say whether a folder, or `images` below it, holds at least two images."""
    return len(_images(path)) >= 2


def open_images(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Reconstruct a folder of photographs of one static scene.

    Parameters
    ----------
    path : path
        The folder, or the one above if the photographs are in `images`. Names give the order.
    work_folder : Path
        Keeps the model by the content of the images.
    seed : int
        For RANSAC and mapping.

    Returns
    -------
    recording : Recording
        The images that could be placed, with the sparse points. The scale is not known from images: the median distance
        of what a camera sees is taken as 10 m, and the log says so. The world is z up if the photographs were taken
        upright. One lens is assumed if all images have one size.

    Raises
    ------
    InputError
        If there are fewer than three images, one is damaged, or they cannot be placed together.
    """
    path = Path(path)
    files = _images(path)
    if len(files) < 3:
        raise InputError("hold at least three images", got=len(files), file=path, remedy="Give more views of the scene.")
    sizes = {read_raw(file).shape[:2] for file in tracked(files, "Checking images")}
    model = work_folder / f"structure_from_motion-{_key(files, seed)}"
    if not model.is_dir():
        with stage(f"Structure from motion of {len(files)} images"):
            _solve(files, len(sizes) == 1, model, seed)
    reconstruction = read_model(model)
    distance = _median_distance(reconstruction)
    recording = recording_of(
        reconstruction, files[0].parent, work_folder / "sparse_points.npz", path.resolve().name, ASSUMED_DISTANCE / distance
    )
    logger.info(
        "%s: %d of %d images placed; the scale is unknown, the median distance seen is taken as %g m",
        path,
        len(recording.frames),
        len(files),
        ASSUMED_DISTANCE,
    )
    return recording


def sparse_points(recording: Recording, work_folder: Path, seed: int = 0) -> Path | None:
    """Triangulate matches between images whose cameras are known.

    Parameters
    ----------
    recording : Recording
        With calibrated, posed frames.
    work_folder : Path
        Keeps the points by the content of images and cameras.

    Returns
    -------
    file : Path or None
        An npz of points seen by at least three frames within 2 px; None if there are none.
    """
    import pycolmap

    files = [frame.image for frame in recording.frames]
    cameras = repr([(f.camera.K.tolist(), f.camera.T_world_camera.round(9).tolist()) for f in recording.frames])
    out = (work_folder / f"sparse_points-{_key(files, seed, cameras)}.npz").resolve()
    if out.exists():
        read_points(out)
        return out
    if len(files) < 3:
        logger.warning("%s: fewer than three frames, so no points can be triangulated", recording.name)
        return None
    with stage(f"Triangulating {len(files)} images"), replacing_folder(out.with_suffix(".work")) as work:
        linked = _linked(files, work)
        database_path = work / "database.db"
        _features(database_path, linked, pycolmap.CameraMode.PER_IMAGE)
        known = pycolmap.Reconstruction()
        with pycolmap.Database.open(str(database_path)) as database:
            ids = {image.name: (image.image_id, image.camera_id) for image in database.read_all_images()}
            for name, frame in zip(linked, recording.frames, strict=True):
                image_id, camera_id = ids[name.name]
                camera = _colmap_camera(frame.camera, camera_id)
                database.update_camera(camera)
                known.add_camera_with_trivial_rig(camera)
                image = pycolmap.Image(name=name.name, camera_id=camera_id, image_id=image_id)
                pose = pycolmap.Rigid3d(frame.camera.T_camera_world[:3])
                known.add_image_with_trivial_frame(image, pose)
        _match(database_path, len(files), seed)
        make_folder(work / "out")
        options = _options(seed)
        done = pycolmap.triangulate_points(known, str(database_path), str(linked[0].parent), str(work / "out"), options=options)
        tracks = [p for p in done.points3D.values() if p.track.length() >= 3 and p.error <= 2.0]
    shutil.rmtree(out.with_suffix(".work"), ignore_errors=True)
    if not tracks:
        logger.warning("%s: no point could be triangulated", recording.name)
        return None
    xyz = np.stack([p.xyz for p in tracks])
    write_points(out, xyz[np.lexsort(xyz.T)])
    logger.info("%s: %d sparse points between the given poses", recording.name, len(xyz))
    return out


def _solve(files: list[Path], one_lens: bool, model: Path, seed: int) -> None:
    """Write the largest model of the images to a folder."""
    import pycolmap

    with replacing_folder(model) as work:
        database = work / "database.db"
        linked = _linked(files, work)
        _features(database, linked, pycolmap.CameraMode.SINGLE if one_lens else pycolmap.CameraMode.AUTO)
        _match(database, len(files), seed)
        make_folder(work / "models")
        found = pycolmap.incremental_mapping(str(database), str(linked[0].parent), str(work / "models"), options=_options(seed))
        if not found:
            raise InputError(
                "show one textured, static scene from several places",
                got="images that do not fit together",
                file=files[0].parent,
                remedy="Take more views with more overlap.",
            )
        best = max(found.values(), key=lambda r: (r.num_reg_images(), r.num_points3D()))
        best.write_binary(str(work))
        shutil.rmtree(work / "models")
        shutil.rmtree(linked[0].parent)
        database.unlink()


def _features(database: Path, linked: list[Path], mode: Any) -> None:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    options = pycolmap.FeatureExtractionOptions()
    options.max_image_size = _MAX_SIDE
    options.sift.max_num_features = _MAX_FEATURES
    # Features of doubled images are mostly noise at this size, and take three quarters of the time.
    options.sift.first_octave = 0
    with stage("Features"):
        pycolmap.extract_features(
            str(database),
            str(linked[0].parent),
            image_names=[f.name for f in linked],
            camera_mode=mode,
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )


def _match(database: Path, num_images: int, seed: int) -> None:
    import pycolmap

    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    match = pycolmap.match_exhaustive if num_images <= _ALL_PAIRS else pycolmap.match_sequential
    with stage("Matches"):
        match(str(database), verification_options=verification, device=pycolmap.Device.cpu)


def _options(seed: int) -> Any:
    import pycolmap

    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.min_model_size = 3
    options.extract_colors = False
    return options


def _linked(files: list[Path], work: Path) -> list[Path]:
    """Gather the images in one folder under the names that keep their order, as COLMAP wants them."""
    folder = make_folder(work / "images")
    same = len({f.parent for f in files}) == 1
    out = []
    for i, file in enumerate(files):
        link = folder / (file.name if same else f"{i:06d}{file.suffix}")
        try:
            link.symlink_to(file.resolve())
        except OSError:  # no links on this file system
            shutil.copyfile(file, link)
        out.append(link)
    return out


def _colmap_camera(camera: Camera, camera_id: int) -> Any:
    import pycolmap

    if camera.model == "ORTHOGRAPHIC":
        raise InputError("be PINHOLE or OPENCV", got=camera.model, key="camera.model")
    params = [camera.fx, camera.fy, camera.cx, camera.cy]
    if camera.model == "OPENCV":
        params += [camera.k1, camera.k2, camera.p1, camera.p2]
    out = pycolmap.Camera(model=camera.model, width=camera.width, height=camera.height, params=params, camera_id=camera_id)
    out.has_prior_focal_length = True
    return out


def _median_distance(reconstruction: Any) -> float:
    """Return the median, over images, of the median distance to the points that each sees."""
    out = []
    for image in reconstruction.images.values():
        ids = [p.point3D_id for p in image.points2D if p.has_point3D()] if image.has_pose else []
        if ids:
            xyz = np.stack([reconstruction.points3D[i].xyz for i in ids])
            out.append(np.median(np.linalg.norm(xyz - image.projection_center(), axis=1)))
    return float(np.median(out))


def _images(path: Path) -> list[Path]:
    for folder in (path, path / "images"):
        if folder.is_dir():
            found = sorted(f.resolve() for f in folder.iterdir() if f.suffix.lower() in IMAGE_SUFFIXES and f.is_file())
            if found:
                return found
    return []


def _key(files: list[Path], seed: int, more: str = "") -> str:
    digest = hashlib.sha256(f"structure from motion 1, seed {seed}, {more}".encode())
    for file in files:
        digest.update(file.name.encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]
