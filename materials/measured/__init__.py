"""Measured reflectance: the files it comes in, and the one type all of them become (`materials.abrdf`)."""
