"""The formats of recordings by name; on their own, so that `--help` loads no reader."""

FORMATS = (
    "auto",
    "recording",
    "kitti-raw",
    "kitti-odometry",
    "kitti-object",
    "argoverse",
    "colmap",
    "nerfstudio",
    "images",
    "cloud",
)
