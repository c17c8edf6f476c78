"""A reconstructed drive: each frame as the other frames predict it through the geometry, against what the camera recorded."""
