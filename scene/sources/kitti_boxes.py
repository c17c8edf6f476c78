"""3-D boxes as KITTI writes them: tracklets of a raw drive (XML), and the labels of its object benchmark (text)."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from materials.foundation.errors import InputError

from ..boxes import Box, upright_pose


def read_tracklets(path: str | Path) -> dict[int, tuple[Box, ...]]:
    """Read the `tracklet_labels.xml` of a KITTI raw drive.

    Returns
    -------
    boxes : dict of tuple of Box
        By the number of the image; in the frame of the laser scanner. A tracklet's track is its place in the file.

    Raises
    ------
    InputError
        If the file is no XML, a tracklet lacks an entry, or one is no number.

    Notes
    -----
    A pose is that of the middle of the box's lower face; of the three angles only `rz` is used, as the labels have no other
    (readme of the KITTI raw development kit).
    """
    path = Path(path)
    try:
        tracklets = ElementTree.parse(path).getroot().find("tracklets")
    except ElementTree.ParseError as error:
        raise InputError("be XML", got=error, file=path, remedy="Copy the file again.") from error
    if tracklets is None:
        raise InputError("hold <tracklets>", file=path)
    out: dict[int, list[Box]] = {}
    for number, item in enumerate(tracklets.findall("item")):
        key = f"tracklets.item[{number}]"
        category = (item.findtext("objectType") or "").strip()
        height, width, length, first = (_number(item, name, path, key) for name in ("h", "w", "l", "first_frame"))
        size = np.array([length, width, height])
        if size.min() <= 0:
            raise InputError("be positive", got=size.tolist(), file=path, key=f"{key}.h, w, l")
        for step, pose in enumerate(item.iterfind("poses/item")):
            place = f"{key}.poses.item[{step}]"
            x, y, z, yaw = (_number(pose, name, path, place) for name in ("tx", "ty", "tz", "rz"))
            centre = np.array([x, y, z + height / 2])
            out.setdefault(int(first) + step, []).append(Box(str(number), category, upright_pose(centre, yaw), size))
    return {image: tuple(boxes) for image, boxes in out.items()}


def read_object_labels(path: str | Path) -> tuple[Box, ...]:
    """Read a file of `label_2` of KITTI's object benchmark.

    Returns
    -------
    boxes : tuple of Box
        In the frame of the rectified camera 0 (x right, y down, z forward); regions that nobody labelled (`DontCare`) are
        left out. A single image has no tracks, so each box's is its line's number.

    Raises
    ------
    InputError
        If a line has fewer than 15 words, or its size or place are no numbers.

    Notes
    -----
    A place is that of the middle of the box's lower face, `rotation_y` turns its length from x towards -z (readme of the
    KITTI object development kit).
    """
    path = Path(path)
    boxes = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        words = line.split()
        if not words or words[0] == "DontCare":
            continue
        key = f"line {number}"
        if len(words) < 15:
            raise InputError("have 15 words: type, 3 numbers, box, size, place, rotation", got=len(words), file=path, key=key)
        try:
            height, width, length, x, y, z, turn = (float(word) for word in words[8:15])
        except ValueError as error:
            raise InputError("have numbers for size, place and rotation", got=error, file=path, key=key) from error
        size = np.array([length, width, height])
        if not np.all(np.isfinite([x, y, z, turn, *size])) or size.min() <= 0:
            raise InputError("have a positive size and a finite place", got=" ".join(words[8:15]), file=path, key=key)
        c, s = np.cos(turn), np.sin(turn)
        T = np.eye(4)
        T[:3, :3] = np.column_stack([(c, 0, -s), (s, 0, c), (0, -1, 0)])
        T[:3, 3] = (x, y - height / 2, z)
        boxes.append(Box(str(number), words[0], T, size))
    return tuple(boxes)


def _number(element: ElementTree.Element, name: str, path: Path, key: str) -> float:
    text = element.findtext(name)
    if text is None:
        raise InputError("be given", file=path, key=f"{key}.{name}")
    try:
        value = float(text)
    except ValueError as error:
        raise InputError("be a number", got=text, file=path, key=f"{key}.{name}") from error
    if not np.isfinite(value):
        raise InputError("be finite", got=text, file=path, key=f"{key}.{name}")
    return value
