"""Cameras of a drive that are out of place, on pixels whose depth is known."""

from __future__ import annotations

from ..pose_error import PoseError


class DrivePose(PoseError):
    """Other frames are predicted from a frame that is out of place too: what is found is its place among them."""

    settles = False
    per = "frame"
