"""A recording against pictures that were simulated elsewhere, of which no shapes, materials and lights are known."""
