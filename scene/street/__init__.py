"""The built-in recording: a procedural street whose truth is known."""

from .settings import StreetSettings
from .world import Street, street

__all__ = ["Street", "StreetSettings", "street"]
