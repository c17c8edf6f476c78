"""Image files to linear radiance and back: PNG, JPEG and EXR, with their bit depth and response.

All physics happens on linear, scene-referred float32; the encoding of a file is kept beside it, so that an augmented
image can be written as its input was. Colour is RGB throughout (OpenCV's BGR never leaves this file).
"""

from __future__ import annotations

import errno
import io
import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .files import replacing

RESPONSES = ("linear", "srgb")
_PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class Encoding:
    """How linear values became the numbers in a file.

    Attributes
    ----------
    suffix : str
        `.png`, `.jpg`, `.exr`, …
    dtype : str
        `uint8`, `uint16`, `float32` or `float16`.
    channels : int
        1 (grey) or 3 (RGB).
    response : str
        `linear` or `srgb` (IEC 61966-2-1).
    """

    suffix: str
    dtype: str
    channels: int
    response: str


def read_image(path: str | Path, response: str | None = None) -> tuple[NDArray[np.float32], Encoding]:
    """Read an image as linear RGB.

    Parameters
    ----------
    path : path
        PNG, JPEG, TIFF, BMP, HDR or EXR file; an alpha channel is dropped, grey is repeated to three channels.
    response : {"linear", "srgb"}, optional
        What the recording says; by default linear for EXR and HDR and sRGB for integers.

    Returns
    -------
    linear : (H, W, 3) float32
        Linear values; integers are scaled so that the largest is 1.
    encoding : Encoding
        What `write_image` needs to write an image of the same kind.

    Raises
    ------
    InputError
        If the file is missing, damaged, or no image.
    """
    raw = read_raw(path)
    default = "linear" if raw.dtype in (np.float32, np.float16) else "srgb"
    encoding = Encoding(Path(path).suffix.lower(), str(raw.dtype), 1 if raw.ndim == 2 else 3, response or default)
    try:
        linear = decode(raw, encoding.response)
    except InputError as error:
        raise error.at(file=path) from error
    if linear.ndim == 2:
        linear = np.repeat(linear[..., None], 3, axis=2)
    return linear, encoding


def read_raw(path: str | Path) -> NDArray:
    """Read the numbers of an image file as stored: (H, W) or (H, W, 3) RGB, integer or float.

    Raises
    ------
    InputError
        If the file is missing, damaged, or no image.
    """
    path = Path(path)
    if path.suffix.lower() == ".exr":
        layers = read_exr(path)
        if all(name in layers for name in "RGB"):
            return np.stack([layers[name] for name in "RGB"], axis=-1)
        name = next((n for n in ("Y", "Z", "V") if n in layers), next(iter(layers)))
        return layers[name]
    data = _bytes(path)
    _check_whole(data, path)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION) if data else None
    if image is None:
        raise InputError("be an image", got="something that cannot be decoded", file=path, remedy="Give PNG, JPEG, TIFF or EXR.")
    if image.ndim == 3:
        image = np.ascontiguousarray(image[..., 2::-1]) if image.shape[2] >= 3 else image[..., 0]
    return image


def read_ids(path: str | Path) -> NDArray:
    """Read an image whose numbers are ids (masks, segmentations): as `read_raw`, but the stored numbers themselves.

    OpenCV turns a PNG with a palette into its colours and stretches grey of 1, 2 or 4 bits to 8; here indices and small
    numbers survive.

    Raises
    ------
    InputError
        As `read_raw`.
    """
    path = Path(path)
    header = _bytes(path, 26)
    if header[:8] != _PNG or len(header) < 26:
        return read_raw(path)
    bits, colour_type = header[24], header[25]
    if colour_type == 3:
        from PIL import Image

        data = _bytes(path)
        _check_whole(data, path)
        try:
            with Image.open(io.BytesIO(data)) as image:
                return np.array(image)
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError("be a whole PNG", got="a damaged one", file=path, remedy="Copy the file again.") from error
    raw = read_raw(path)
    return raw // (255 // (2**bits - 1)) if colour_type == 0 and bits < 8 else raw


def decode(raw: NDArray, response: str) -> NDArray[np.float32]:
    """Turn stored numbers into linear values; integers are first scaled to [0, 1]."""
    if response not in RESPONSES:
        raise InputError(f"be one of {', '.join(RESPONSES)}", got=response, key="response")
    if raw.dtype not in (np.uint8, np.uint16, np.float16, np.float32, np.float64):
        raise InputError("have 8- or 16-bit integer or floating-point pixels", got=raw.dtype, key="an image")
    if raw.dtype == np.uint8:
        # Every decoding of a byte is one of 256 values; a table makes it fast and identical everywhere.
        table = np.arange(256, dtype=np.float64) / 255
        return (_srgb_to_linear(table) if response == "srgb" else table).astype(np.float32)[raw]
    values = raw.astype(np.float64) / 65535 if raw.dtype == np.uint16 else raw.astype(np.float64)
    return (_srgb_to_linear(values) if response == "srgb" else values).astype(np.float32)


def encode(linear: NDArray, encoding: Encoding) -> NDArray:
    """Turn linear RGB (H, W, 3) into the numbers of a file; integers are clipped and rounded to nearest."""
    values = linear.astype(np.float64)
    if encoding.channels == 1 and values.ndim == 3:
        # Grey input was repeated to three equal channels; if a colour crept in, keep the Rec. 709 luminance.
        values = values @ (0.2126, 0.7152, 0.0722)
    if encoding.dtype in ("uint8", "uint16"):
        values = np.clip(values, 0, 1)
        values = _linear_to_srgb(values) if encoding.response == "srgb" else values
        top = 255 if encoding.dtype == "uint8" else 65535
        return np.rint(values * top).astype(encoding.dtype)
    return (_linear_to_srgb(values) if encoding.response == "srgb" else values).astype(encoding.dtype)


def write_image(path: str | Path, linear: NDArray, encoding: Encoding) -> None:
    """Write linear RGB as a file of the given encoding; the suffix of `path` decides the format."""
    write_raw(path, encode(linear, encoding))


def write_raw(path: str | Path, raw: NDArray) -> None:
    """Write stored numbers as they are: integers to PNG (or JPEG), floats to EXR; (H, W) or (H, W, 3) RGB."""
    path = Path(path)
    if path.suffix.lower() == ".exr":
        write_exr(path, dict(zip("RGB", np.moveaxis(raw, -1, 0), strict=True)) if raw.ndim == 3 else {"Y": raw})
        return
    options = [cv2.IMWRITE_JPEG_QUALITY, 98] if path.suffix.lower() in (".jpg", ".jpeg") else []
    if not path.suffix or not cv2.haveImageWriter(path.suffix):
        raise InputError("have a suffix that names an image format", got=path.suffix, file=path, remedy="Use .png or .exr.")
    allowed = (np.uint8,) if options else (np.uint8, np.uint16)
    if raw.dtype not in allowed:  # OpenCV would turn other numbers into bytes
        names = " or ".join(np.dtype(kind).name for kind in allowed)
        raise InputError(f"hold {names} pixels", got=raw.dtype, file=path, remedy="Write floats as .exr.")
    done, data = cv2.imencode(path.suffix, raw[..., ::-1] if raw.ndim == 3 else raw, options)
    if not done:
        raise InputError(f"hold an image that {path.suffix} can store", got=raw.shape, file=path)
    with replacing(path) as temporary:
        temporary.write_bytes(data.tobytes())


def read_exr(path: str | Path) -> dict[str, NDArray]:
    """Read all channels of an EXR file, by their names (`R`, `depth.Z`, …), each (H, W).

    Raises
    ------
    InputError
        If the file is missing, truncated, or no EXR.
    """
    import OpenEXR

    if _bytes(Path(path), 4) != b"\x76\x2f\x31\x01":
        raise InputError("be an OpenEXR file", got="something else", file=path)
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, OSError) as error:
        # The library's own words ("file has 0 parts") mislead: it has read a sound header and broken pixels.
        raise InputError(
            "be a whole OpenEXR file", got="a truncated or damaged one", file=path, remedy="Copy or render the file again."
        ) from error


def write_exr(path: str | Path, channels: dict[str, NDArray], header: dict[str, object] | None = None) -> None:
    """Write named channels (H, W) as one EXR part; float16, float32 and uint32 keep their type, others become float32.

    Layers follow the field's convention: `diffuse.R`, `normal.X`, `depth.Z`, `id.shape`.
    """
    import OpenEXR

    kept = (np.float16, np.float32, np.uint32)
    pixels = {n: np.ascontiguousarray(c if c.dtype in kept else c.astype(np.float32)) for n, c in channels.items()}
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **(header or {})}
    with replacing(path) as temporary, OpenEXR.File(head, pixels) as file:
        try:
            file.write(str(temporary))
        except RuntimeError as error:
            # The library says only in words which failure of the disk it met.
            known = (code for code in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) if os.strerror(code) in str(error))
            code = next(known, None)
            words = "a failing write (is the disk full?)" if code is None else os.strerror(code)
            raise OSError(errno.EIO if code is None else code, words, str(temporary)) from error


def _check_whole(data: bytes, path: Path) -> None:
    """Refuse a truncated PNG or JPEG, which OpenCV reads without complaint and fills with grey."""
    if data[:8] == _PNG:
        kind, whole = "PNG", b"IEND" in data[-16:]
    elif data[:2] == b"\xff\xd8":
        kind, whole = "JPEG", b"\xff\xd9" in data[-64:]
    else:
        return
    if not whole:
        # Cameras and phones append data of their own after the end of the picture, so decode once more, strictly.
        from PIL import Image

        try:
            with Image.open(io.BytesIO(data)) as image:
                image.load()
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError(f"be a whole {kind}", got="a truncated one", file=path, remedy="Copy the file again.") from error


def _bytes(path: Path, count: int = -1) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(count)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error


def _srgb_to_linear(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0) + 0.055) / 1.055) ** 2.4)


def _linear_to_srgb(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(v <= 0.0031308, v * 12.92, 1.055 * np.maximum(v, 0) ** (1 / 2.4) - 0.055)
