"""The diagnosis: where a simulation and a recording differ, which physics was left out, and the proof."""
