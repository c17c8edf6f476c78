"""Recordings with something left out, photographed by Mitsuba 3, for blind tests of the diagnosis.

`python -m benchmarks.sealed OUT` makes them. Of this project it uses the writing of files alone: light is Mitsuba's matter, and
neither our tracer, nor our materials, nor the diagnosis is imported.
"""
