"""How far a picture is from another: PSNR, relative MSE, SSIM and its map, MS-SSIM, FLIP.

All take the range of the data explicitly: SSIM and PSNR of floats mean nothing without it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

from materials.foundation.checks import check_finite, check_range
from materials.foundation.errors import InputError

Mask = NDArray[np.bool_]

DEFINITIONS = {
    "psnr": "10 log10(range² / MSE) over all channels [dB]",
    "rel_mse": "mean of (a - b)² / (b² + 0.01 range²), b the reference (Rousselle et al. 2011, whose images have range 1)",
    "ssim": "mean of the SSIM map: Gaussian window of 11 x 11, sigma 1.5 px, K1 0.01, K2 0.03, mean over channels, 5 px of border "
    "left out (Wang et al. 2004)",
    "ms_ssim": "product over five scales, exponents 0.0448 0.2856 0.3001 0.2363 0.1333, mean over channels (Wang et al. 2003)",
    "flip": "mean LDR-FLIP of sRGB pictures at 67 pixels per degree, 0 is equal (Andersson et al. 2020)",
    "hdr_flip": "mean HDR-FLIP of linear pictures over the exposures it chooses (Andersson et al. 2021)",
}
_SIGMA, _RADIUS = 1.5, 5
_K1, _K2 = 0.01, 0.03
_SCALES = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)


def psnr(a: NDArray, b: NDArray, data_range: float, region: Mask | None = None) -> float:
    """Return the peak signal-to-noise ratio [dB]; infinite for equal pictures.

    Parameters
    ----------
    a, b : (H, W) or (H, W, C)
        Pictures of one shape.
    data_range : float
        Largest possible value less the smallest: 255 for 8 bits; what the display shows for floats.
    region : (H, W) bool, optional
        Which pixels count.

    Raises
    ------
    InputError
        If shapes differ, a value is not finite, the range is not positive, or the region is empty.
    """
    a, b = _checked(a, b, data_range)
    mse = float(np.mean((a - b)[_region(region, a)] ** 2))
    return float(10 * np.log10(data_range**2 / mse)) if mse > 0 else float("inf")


def rel_mse(a: NDArray, reference: NDArray, data_range: float, region: Mask | None = None) -> float:
    """Return the mean squared error relative to the reference's own square; arguments as `psnr`."""
    a, b = _checked(a, reference, data_range)
    kept = _region(region, a)
    return float(np.mean((a - b)[kept] ** 2 / (b[kept] ** 2 + 0.01 * data_range**2)))


def ssim_map(a: NDArray, b: NDArray, data_range: float) -> NDArray[np.float32]:
    """Return the SSIM of every pixel's neighbourhood (H, W), the mean over the channels: 1 is equal, at least -1.

    Raises
    ------
    InputError
        As `psnr`, or if the pictures are smaller than the window of 11 x 11.
    """
    luminance, structure = _ssim_parts(*_checked(a, b, data_range), data_range)
    return (luminance * structure).mean(axis=-1).astype(np.float32)


def ssim(a: NDArray, b: NDArray, data_range: float, region: Mask | None = None) -> float:
    """Return the mean SSIM; without a region, over all pixels whose window lies inside the picture.

    Raises
    ------
    InputError
        As `ssim_map`.
    """
    values = ssim_map(a, b, data_range)
    if region is not None:
        return float(values[_region(region, values)].mean(dtype=np.float64))
    return float(values[_RADIUS:-_RADIUS, _RADIUS:-_RADIUS].mean(dtype=np.float64))


def ssim_picture(values: NDArray, inverse: bool = True) -> NDArray[np.uint8]:
    """Return an SSIM map as grey levels: inverse as in the thesis (4.3.3), black where equal, white at 0 and below.

    Parameters
    ----------
    values : (H, W) float
    inverse : bool
        False shows equal as white.
    """
    level = np.clip(values, 0, 1)
    return np.rint(255 * (1 - level if inverse else level)).astype(np.uint8)


def ms_ssim(a: NDArray, b: NDArray, data_range: float) -> float:
    """Return the multi-scale SSIM; a mean contrast below 0 counts as 0.

    Raises
    ------
    InputError
        As `psnr`, or if the shorter side has fewer than 176 pixels (the window would not fit the fifth scale).
    """
    a, b = _checked(a, b, data_range)
    smallest = (2 * _RADIUS + 1) * 2 ** (len(_SCALES) - 1)
    if min(a.shape[:2]) < smallest:
        raise InputError(f"be at least {smallest} pixels high and wide", got=a.shape[:2], key="pictures for MS-SSIM")
    value = np.ones(a.shape[2])
    for i, exponent in enumerate(_SCALES):
        luminance, structure = _ssim_parts(a, b, data_range)
        last = i == len(_SCALES) - 1
        inner = np.s_[_RADIUS:-_RADIUS, _RADIUS:-_RADIUS]
        part = (luminance * structure if last else structure)[inner].mean(axis=(0, 1))
        value *= np.maximum(part, 0) ** exponent
        a, b = _halved(a), _halved(b)
    return float(value.mean())


def flip(test: NDArray, reference: NDArray, hdr: bool) -> tuple[float, NDArray[np.float32]]:
    """Return the mean FLIP and its map (H, W) in [0, 1].

    Parameters
    ----------
    test, reference : (H, W, 3)
        sRGB in [0, 1] (or uint8), or, for `hdr`, linear radiance without negative values.
    hdr : bool
        Take the worst of the exposures that the reference's own luminance suggests.

    Raises
    ------
    InputError
        If shapes differ or values are out of range.
    """
    if test.dtype == np.uint8 and reference.dtype == np.uint8:
        test, reference = test / 255, reference / 255
    test, reference = _checked(test, reference, 1.0)
    if test.shape[2] != 3:
        raise InputError("have three channels", got=test.shape, key="pictures for FLIP")
    for name, image in (("test", test), ("reference", reference)):
        check_range(name, image, "[0, inf)" if hdr else "[0, 1]")
    import flip_evaluator

    pair = (np.ascontiguousarray(image, np.float32) for image in (reference, test))
    values, mean, _ = flip_evaluator.evaluate(*pair, "HDR" if hdr else "LDR", applyMagma=False)
    return float(mean), np.asarray(values, np.float32).reshape(test.shape[:2])


def _ssim_parts(a: NDArray, b: NDArray, data_range: float) -> tuple[NDArray, NDArray]:
    """Return luminance and contrast-structure (H, W, C) of Wang et al. (2004), eqs 6 and 13 with C3 = C2 / 2."""
    if min(a.shape[:2]) < 2 * _RADIUS + 1:
        raise InputError("be at least 11 pixels high and wide", got=a.shape[:2], key="pictures for SSIM")
    c1, c2 = (_K1 * data_range) ** 2, (_K2 * data_range) ** 2
    mean_a, mean_b = _blurred(a), _blurred(b)
    variance_a = _blurred(a * a) - mean_a**2
    variance_b = _blurred(b * b) - mean_b**2
    covariance = _blurred(a * b) - mean_a * mean_b
    luminance = (2 * mean_a * mean_b + c1) / (mean_a**2 + mean_b**2 + c1)
    return luminance, (2 * covariance + c2) / (variance_a + variance_b + c2)


def _blurred(image: NDArray[np.float64]) -> NDArray[np.float64]:
    x = np.arange(-_RADIUS, _RADIUS + 1)
    weights = np.exp(-0.5 * (x / _SIGMA) ** 2)
    weights /= weights.sum()
    return correlate1d(correlate1d(image, weights, axis=0, mode="reflect"), weights, axis=1, mode="reflect")


def _halved(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means over 2 x 2 pixels; an odd last row or column is left out."""
    h, w = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
    return image[:h, :w].reshape(h // 2, 2, w // 2, 2, -1).mean(axis=(1, 3))


def _checked(a: NDArray, b: NDArray, data_range: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both as (H, W, C) float64."""
    check_range("data_range", data_range, "(0, inf)")
    if a.shape != b.shape or a.ndim not in (2, 3):
        raise InputError(
            "have one shape, (height, width) or (height, width, channels)", got=f"{a.shape} and {b.shape}", key="pictures"
        )
    pair = []
    for image in (a, b):
        check_finite("pictures", image)
        pair.append(np.asarray(image, np.float64).reshape(*image.shape[:2], -1))
    return pair[0], pair[1]


def _region(region: Mask | None, image: NDArray) -> Mask:
    if region is None:
        return np.ones(image.shape[:2], bool)
    if region.shape != image.shape[:2]:
        raise InputError(f"have shape {image.shape[:2]}, as the pictures", got=region.shape, key="region")
    if not region.any():
        raise InputError("select at least one pixel", got="none", key="region")
    return region
