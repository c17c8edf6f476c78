"""The effects as they act on a drive, of which each frame is predicted from the others through a reconstruction."""

from .choose import choose_for_drive

__all__ = ["choose_for_drive"]
