"""Pictures are traced tile by tile, so that neighbouring rays find the same part of the world in the processor's caches."""

TILE = 16
