"""The open catalogue of effects: one piece of physics a file."""

from .catalogue import CATALOGUE, catalogue, load_file

__all__ = ["CATALOGUE", "catalogue", "load_file"]
