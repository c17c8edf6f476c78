"""Image files, as all floors above read them; the code lies below, where measured reflectance reads photographs too."""

from materials.foundation.images import (
    RESPONSES,
    Encoding,
    decode,
    encode,
    read_exr,
    read_ids,
    read_image,
    read_raw,
    write_exr,
    write_image,
    write_raw,
)

__all__ = [
    "RESPONSES",
    "Encoding",
    "decode",
    "encode",
    "read_exr",
    "read_ids",
    "read_image",
    "read_raw",
    "write_exr",
    "write_image",
    "write_raw",
]
