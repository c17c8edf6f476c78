"""The effects as they act on pictures that were simulated elsewhere, of which no shapes, materials and lights are known."""

from .choose import choose

__all__ = ["choose"]
