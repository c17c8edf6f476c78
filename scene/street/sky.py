"""Sun and sky: a clear sky after Preetham, Shirley and Smits (1999), or the CIE overcast sky.

Units: everything is scaled so that a white sheet (albedo 0.8) that faces the sun has radiance 1.6: white facades, which
stand obliquely in it, then lie just below 1, which is what an exposure of 1 maps to white. Photometric values inside the
formulas are in kcd/m² and klx.

References
----------
Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight", SIGGRAPH 1999 (appendix A.2).
CIE S 011:2003, Spatial distribution of daylight (overcast sky: Moon and Spencer, 1942).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..simulation import DirectionalLight, EnvironmentLight, Light

Floats = NDArray[np.floating]

# Behind the ego vehicle's left shoulder: right facades and the road are lit, trees throw shadows across the road.
SUN_ELEVATION, SUN_AZIMUTH = np.radians(41.0), np.radians(147.0)
SUN_RADIUS = 0.00465
TURBIDITY = 2.6
_WALL = 0.8 / 1.6
# Direct normal illuminance of the sun at that height and turbidity [klx], and its colour in linear Rec. 709 with
# luminance 1 (about 5300 K).
_SUN_KLX = 88.0
_SUN_COLOUR = np.array([1.115, 0.975, 0.905])
_OVERCAST_KLX = 18.0
# What the street below the horizon sends back where no mesh is: albedo 0.15 in open light.
_GROUND_ALBEDO = 0.15

_XYZ_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def lights(sky: str, rows: int = 256) -> dict[str, Light]:
    """Return the lights of a weather, "clear" or "overcast"."""
    d = _directions(rows)
    if sky == "overcast":
        # L = Lz (1 + 2 sin e) / 3; its horizontal illuminance is 7 pi / 9 Lz.
        zenith = 9 / (7 * np.pi)
        L = zenith * (1 + 2 * np.clip(d[..., 2], 0, 1)) / 3
        panorama = L[..., None] * np.array([0.95, 1.0, 1.06])
        # A horizontal white sheet has radiance 0.7.
        panorama = _with_ground(panorama * (0.7 * np.pi / _WALL), d, sun=0.0)
        return {"sky": EnvironmentLight(panorama=panorama.astype(np.float32))}
    sun = sun_direction()
    sky_kcd = clear_sky(d, sun)
    scale = np.pi / _WALL / (_SUN_KLX + np.pi * float(sky_kcd[..., 1][d[..., 2] > 0].mean()) * 0.5)
    irradiance = _SUN_KLX * scale * _SUN_COLOUR
    panorama = _with_ground(sky_kcd * scale, d, sun=float(irradiance[1]) * sun[2])
    return {
        "sun": DirectionalLight(tuple(-sun), tuple(irradiance), SUN_RADIUS),  # type: ignore[arg-type]
        "sky": EnvironmentLight(panorama=panorama.astype(np.float32)),
    }


def sun_direction() -> NDArray[np.float64]:
    """Return the unit vector towards the sun."""
    c = np.cos(SUN_ELEVATION)
    return np.array([c * np.cos(SUN_AZIMUTH), c * np.sin(SUN_AZIMUTH), np.sin(SUN_ELEVATION)])


def clear_sky(directions: Floats, sun: Floats, turbidity: float = TURBIDITY) -> NDArray[np.float64]:
    """Return the radiance of a clear sky, linear Rec. 709, its luminance in kcd/m².

    Parameters
    ----------
    directions : (..., 3) float
        Unit vectors; those below the horizon get the horizon's value.
    sun : (3,) float
        Unit vector towards the sun.
    turbidity : float
        2 is very clear, 10 hazy; the model holds from 2 to 6.

    Notes
    -----
    The disc of the sun is not in it; its aureole is.
    """
    T = turbidity
    theta_s = np.arccos(sun[2])
    cos_theta = np.maximum(directions[..., 2], 0.01)
    gamma = np.arccos(np.clip(directions @ sun, -1, 1))
    chi = (4 / 9 - T / 120) * (np.pi - 2 * theta_s)
    zenith_Y = (4.0453 * T - 4.9710) * np.tan(chi) - 0.2155 * T + 2.4192
    powers = theta_s ** np.arange(3, -1, -1)
    t = np.array([T * T, T, 1.0])
    zenith_x = (
        t
        @ np.array([[0.00166, -0.00375, 0.00209, 0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]])
        @ powers
    )
    zenith_y = (
        t
        @ np.array([[0.00275, -0.00610, 0.00317, 0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]])
        @ powers
    )
    perez_Y = np.array([0.1787, -0.3554, -0.0227, 0.1206, -0.0670]) * T + [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703]
    perez_x = np.array([-0.0193, -0.0665, -0.0004, -0.0641, -0.0033]) * T + [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452]
    perez_y = np.array([-0.0167, -0.0950, -0.0079, -0.0441, -0.0109]) * T + [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529]

    def relative(perez: Floats) -> Floats:
        return _perez(cos_theta, gamma, perez) / _perez(np.array(1.0), np.array(theta_s), perez)

    Y = zenith_Y * relative(perez_Y)
    x, y = zenith_x * relative(perez_x), zenith_y * relative(perez_y)
    XYZ = np.stack([x * Y / y, Y, (1 - x - y) * Y / y], axis=-1)
    return np.maximum(XYZ @ _XYZ_TO_RGB.T, 0)


def _perez(cos_theta: Floats, gamma: Floats, p: Floats) -> Floats:
    a, b, c, d, e = p
    return (1 + a * np.exp(b / cos_theta)) * (1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)


def _directions(rows: int) -> NDArray[np.float64]:
    """Return the unit vectors (rows, 2 rows, 3) of a panorama's texels, zenith first, azimuth from -pi to pi."""
    elevation = np.pi / 2 - (np.arange(rows) + 0.5) * np.pi / rows
    azimuth = -np.pi + (np.arange(2 * rows) + 0.5) * np.pi / rows
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)


def _with_ground(panorama: Floats, d: Floats, sun: float) -> NDArray[np.float64]:
    """Put an even grey below the horizon: what the unmodelled land sends back of the light that falls on it."""
    above = d[..., 2] > 0
    solid_angle = np.sqrt(1 - d[..., 2] ** 2) * (np.pi / len(d)) ** 2
    E = np.einsum("hwc,hw->c", panorama * above[..., None], solid_angle * d[..., 2])
    ground = _GROUND_ALBEDO / np.pi * (E + sun)
    return np.where(above[..., None], panorama, ground)
