"""Texture look-up: bilinear, repeating, texel (i, j) centred at ((i + 0.5) / W, (j + 0.5) / H)."""

import math

from materials.kernels.lean import lean


@lean()
def lookup(texels, info, texture, u, v, channel):
    """Return one channel of a texture; single-channel textures answer for any."""
    offset, width, height, channels = info[texture, 0], info[texture, 1], info[texture, 2], info[texture, 3]
    x = u * width - 0.5
    y = v * height - 0.5
    fx = math.floor(x)
    fy = math.floor(y)
    ax = x - fx
    ay = y - fy
    x0 = int(fx) % width
    y0 = int(fy) % height
    x1 = x0 + 1 if x0 + 1 < width else 0
    y1 = y0 + 1 if y0 + 1 < height else 0
    c = channel if channel < channels else channels - 1
    r0 = offset + y0 * width * channels + c
    r1 = offset + y1 * width * channels + c
    top = texels[r0 + x0 * channels] * (1.0 - ax) + texels[r0 + x1 * channels] * ax
    bottom = texels[r1 + x0 * channels] * (1.0 - ax) + texels[r1 + x1 * channels] * ax
    return top * (1.0 - ay) + bottom * ay
