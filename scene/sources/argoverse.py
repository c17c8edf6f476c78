"""Logs of the Argoverse 2 sensor data set: poses, sweeps, calibration and boxes in Feather tables, pictures in folders.

Wilson et al.: Argoverse 2, NeurIPS Datasets and Benchmarks 2021. Its makers have undistorted the
pictures and freed the sweeps of the vehicle's own motion; boxes are given at the time of each sweep.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from materials.foundation.errors import InputError
from materials.foundation.progress import logger, tracked

from ..boxes import Box, write_boxes
from ..camera import Camera
from ..points import write_points
from ..recording import BoxesFile, Frame, PointsFile, Recording
from ..transforms import invert, transform_points
from .recording_copy import check_recording

Columns = dict[str, NDArray]
_FRONT = "ring_front_center"
_SCANNER = "up_lidar"
_POSE = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")
# A picture belongs to a sweep if it was taken within half a turn of the scanner, 0.1 s [ns].
_LATEST = 50_000_000
# Calibrations of the field count pixel positions from the centre of the first pixel, we from its corner.
_PIXEL_CENTRE = 0.5


def is_argoverse(path: Path) -> bool:
    """Say whether a folder is a log, or that of one of its cameras."""
    return (_log(path) / "city_SE3_egovehicle.feather").is_file() and (_log(path) / "sensors" / "lidar").is_dir()


def open_argoverse(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Open a log of Argoverse 2: one frame per sweep, with the picture nearest in time.

    Parameters
    ----------
    path : path
        The log's folder (camera ring_front_center), or the folder of another of its cameras, `LOG/sensors/cameras/NAME`.
    work_folder : Path
        Gets the sweeps, in the frame of the upper scanner, and the boxes.
    seed : int
        Not used: nothing is estimated.

    Returns
    -------
    recording : Recording
        World: the city's, z up. Boxes are those of the sweep's time, up to 25 ms from the picture's.

    Raises
    ------
    InputError
        If a table is missing, damaged, or lacks a column or sensor, or no picture was taken near a sweep.
    """
    del seed
    path, log, work = Path(path), _log(Path(path)).resolve(), Path(work_folder).resolve()
    name = path.name if path.parent.name == "cameras" else _FRONT
    images = _by_time(log / "sensors" / "cameras" / name, (".jpg", ".png"))
    sweeps = _by_time(log / "sensors" / "lidar", (".feather",))
    if not images or not sweeps:
        missing = log / "sensors" / (f"cameras/{name}" if not images else "lidar")
        raise InputError("hold files named by their time", file=missing, remedy="Give the log of the sensor data set.")
    camera_at, T_ego_camera = _camera(log, name)
    T_ego_scanner = _row_pose(*_sensor(log / "calibration" / "egovehicle_SE3_sensor.feather", _SCANNER, _POSE))
    track = _Track.read(log / "city_SE3_egovehicle.feather")
    boxes = _boxes(log / "annotations.feather")
    times = np.array(list(images))
    frames = []
    for time in tracked(sweeps, "reading sweeps", len(sweeps)):
        taken = int(times[np.argmin(np.abs(times - time))])
        if abs(taken - time) > _LATEST:
            continue
        file = work / "sweeps" / f"{time}.npz"
        columns = _table(sweeps[time], ("x", "y", "z", "intensity"))
        ego = np.column_stack([columns[c].astype(np.float64) for c in "xyz"])
        points = transform_points(invert(T_ego_scanner), ego)
        write_points(file, np.column_stack([points, columns["intensity"].astype(np.float64)]))
        T_world_ego = track.at(time)
        frame_boxes = None
        if boxes is not None:
            write_boxes(work / "boxes" / f"{time}.json", tuple(boxes.get(time, ())))
            frame_boxes = BoxesFile(work / "boxes" / f"{time}.json", T_world_ego)
        camera = camera_at.moved_to(track.at(taken) @ T_ego_camera)
        sweep = PointsFile(file, T_world_ego @ T_ego_scanner)
        frames.append(Frame(images[taken], camera, response="srgb", points=sweep, boxes=frame_boxes))
    if not frames:
        raise InputError("have a picture within 50 ms of a sweep", file=log / "sensors" / "cameras" / name)
    kind = "no boxes" if boxes is None else "with boxes"
    logger.info("%s: Argoverse 2, %d frames of %s, %s", log, len(frames), name, kind)
    recording = Recording(tuple(frames), log, log.name)
    check_recording(recording)
    return recording


@dataclass(frozen=True)
class _Track:
    """The vehicle's poses in the city by time [ns]."""

    times: NDArray[np.int64]
    rotations: Slerp
    places: NDArray[np.float64]
    file: Path

    @staticmethod
    def read(file: Path) -> _Track:
        columns = _table(file, ("timestamp_ns", *_POSE))
        times, first = np.unique(columns["timestamp_ns"].astype(np.int64), return_index=True)
        if len(times) < 2:
            raise InputError("hold two poses or more", got=len(times), file=file)
        places = np.column_stack([columns[c] for c in ("tx_m", "ty_m", "tz_m")]).astype(np.float64)[first]
        rotations = _rotation(columns, file)[first]
        # Nanoseconds since 1980 exceed what float64 resolves; counted from the first they do not.
        return _Track(times, Slerp((times - times[0]).astype(np.float64), rotations), places, file)

    def at(self, time: int) -> NDArray[np.float64]:
        """Return `T_world_ego` at a time, between its neighbours where it was not noted."""
        if not self.times[0] <= time <= self.times[-1]:
            raise InputError("hold poses before and after each sweep and picture", got=f"none about {time}", file=self.file)
        t = float(time - self.times[0])
        T = np.eye(4)
        T[:3, :3] = self.rotations(t).as_matrix()
        T[:3, 3] = [np.interp(t, self.times - self.times[0], self.places[:, axis]) for axis in range(3)]
        return T


def _log(path: Path) -> Path:
    return path.resolve().parents[2] if path.parent.name == "cameras" and len(path.resolve().parents) > 2 else path


def _camera(log: Path, name: str) -> tuple[Camera, NDArray[np.float64]]:
    """Return the camera with no pose yet, and `T_ego_camera`."""
    columns = ("fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px")
    row, file = _sensor(log / "calibration" / "intrinsics.feather", name, columns)
    fx, fy, cx, cy, width, height = (float(row[c][0]) for c in columns)
    if min(fx, fy, width, height) <= 0:
        raise InputError("be positive", got=[fx, fy, width, height], file=file, key=f"{name}: fx_px, fy_px, width_px, height_px")
    camera = Camera("PINHOLE", int(width), int(height), np.eye(4), fx, fy, cx + _PIXEL_CENTRE, cy + _PIXEL_CENTRE)
    return camera, _row_pose(*_sensor(log / "calibration" / "egovehicle_SE3_sensor.feather", name, _POSE))


def _boxes(file: Path) -> dict[int, list[Box]] | None:
    """Return the boxes in the vehicle's frame by time; None where a log (of the test split) has none."""
    if not file.exists():
        return None
    c = _table(file, ("timestamp_ns", "track_uuid", "category", "length_m", "width_m", "height_m", *_POSE))
    sizes = np.column_stack([c[name] for name in ("length_m", "width_m", "height_m")]).astype(np.float64)
    places = np.column_stack([c[name] for name in ("tx_m", "ty_m", "tz_m")]).astype(np.float64)
    if len(sizes) and not (np.isfinite(places).all() and sizes.min() > 0):
        raise InputError("hold finite places and positive sizes", file=file, key="boxes")
    R = _rotation(c, file).as_matrix() if len(sizes) else np.zeros((0, 3, 3))
    out: dict[int, list[Box]] = {}
    for i, time in enumerate(c["timestamp_ns"].astype(np.int64)):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R[i], places[i]
        out.setdefault(int(time), []).append(Box(str(c["track_uuid"][i]), str(c["category"][i]), T, sizes[i]))
    return out


def _sensor(file: Path, name: str, columns: tuple[str, ...]) -> tuple[Columns, Path]:
    """Return the columns of a sensor's row in a table of calibration."""
    table = _table(file, ("sensor_name", *columns))
    rows = np.flatnonzero(table["sensor_name"].astype(str) == name)
    if len(rows) != 1:
        raise InputError(f"have one row of the sensor {name}", got=len(rows), file=file)
    return {c: table[c][rows] for c in columns}, file


def _row_pose(row: Columns, file: Path) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3, :3] = _rotation(row, file).as_matrix()[0]
    T[:3, 3] = [float(row[c][0]) for c in ("tx_m", "ty_m", "tz_m")]
    return T


def _rotation(columns: Columns, file: Path) -> Rotation:
    q = np.column_stack([columns[c] for c in ("qx", "qy", "qz", "qw")]).astype(np.float64)
    length = np.linalg.norm(q, axis=1)
    if not np.all(np.abs(length - 1) < 1e-3):
        raise InputError("hold unit quaternions", got=f"length {length[np.argmax(np.abs(length - 1))]:.4g}", file=file, key="qw…qz")
    return Rotation.from_quat(q)


def _table(file: Path, columns: tuple[str, ...]) -> Columns:
    """Read columns of a Feather table."""
    import pyarrow
    from pyarrow import feather

    if not file.is_file():
        raise InputError("exist", file=file, remedy="Give the whole log of the sensor data set.")
    try:
        table = feather.read_table(file, memory_map=False)
    except (pyarrow.ArrowInvalid, OSError) as error:
        raise InputError("be a whole Feather table", got=error, file=file, remedy="Copy the file again.") from error
    for name in columns:
        if name not in table.column_names:
            raise InputError(f"have the column {name}", got=", ".join(table.column_names), file=file)
    return {name: table[name].to_numpy() for name in columns}


def _by_time(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """Return the files of a folder by the nanoseconds of their names, in order."""
    if not folder.is_dir():
        return {}
    named = {int(f.stem): f.resolve() for f in folder.iterdir() if f.suffix in suffixes and f.stem.isdigit()}
    return dict(sorted(named.items()))
