"""The principled BRDF of Burley, "Physically Based Shading at Disney" (2012), with the shadowing of its 2014 revision.

f = (1 - metallic) (diffuse or subsurface + sheen) + GGX lobe + 0.25 clearcoat x GTR1 lobe. The lobe has separable Smith
shadowing of its own widths, the coat that of width 0.25. The model bounds no energy: sheen and coat are added on top.
"""

import math

from numba import njit

from .frames import dot, normalize, reflect
from .fresnel import schlick
from .lambert import INV_PI, pdf_cosine, sample_cosine
from .microfacet import g2_separable, ggx_d, pdf_reflected, sample_visible

METALLIC, SUBSURFACE, SPECULAR, SPECULAR_TINT, ROUGHNESS, SHEEN, SHEEN_TINT, CLEARCOAT, CLEARCOAT_GLOSS = range(9)
# Factor of the matte part and of the sheen: 1, or 0 to see the lobes alone.
MATTE = 9
_COAT_F0, _COAT_SHADOWING = 0.04, 0.25


@njit(cache=True, error_model="numpy")
def luminance(r, g, b):
    """Return the brightness by which a base colour is reduced to its hue (the weights of the reference code)."""
    return 0.3 * r + 0.6 * g + 0.1 * b


@njit(cache=True)
def _mix(a, b, t):
    return a + (b - a) * t


@njit(cache=True, error_model="numpy")
def _hue(value, brightness):
    return value / brightness if brightness > 0.0 else 1.0


@njit(cache=True, error_model="numpy")
def normal_specular(value, brightness, p):
    """Return one channel of the lobe's reflectance at normal incidence."""
    plain = 0.08 * p[SPECULAR] * _mix(1.0, _hue(value, brightness), p[SPECULAR_TINT])
    return _mix(plain, value, p[METALLIC])


@njit(cache=True, error_model="numpy")
def coat_width(p):
    """Return the width of the clear coat's facets."""
    return _mix(0.1, 0.001, p[CLEARCOAT_GLOSS])


@njit(cache=True, error_model="numpy")
def gtr1_d(z, width):
    """Return Burley's long-tailed distribution of gamma = 1 at n . h = z; 0 below the surface."""
    if z <= 0.0:
        return 0.0
    a2 = width * width
    return (a2 - 1.0) / (math.pi * math.log(a2) * (1.0 + (a2 - 1.0) * z * z))


@njit(cache=True, error_model="numpy")
def evaluate(r, g, b, alpha_u, alpha_v, p, wo, wi):
    """Return the BRDF per channel of base colour (r, g, b); both directions above the surface."""
    h = normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))
    c = dot(wo, h)
    fade_o, fade_i, fade_h = schlick(wo[2], 0.0), schlick(wi[2], 0.0), schlick(c, 0.0)
    f90 = 0.5 + 2.0 * c * c * p[ROUGHNESS]
    diffuse = _mix(1.0, f90, fade_i) * _mix(1.0, f90, fade_o)
    if p[SUBSURFACE] > 0.0:
        flat = c * c * p[ROUGHNESS]
        inner = _mix(1.0, flat, fade_i) * _mix(1.0, flat, fade_o)
        flattened = 1.25 * (inner * (1.0 / (wo[2] + wi[2]) - 0.5) + 0.5)
        diffuse = _mix(diffuse, flattened, p[SUBSURFACE])
    matte = p[MATTE] * (1.0 - p[METALLIC]) * INV_PI * diffuse
    sheen = p[MATTE] * (1.0 - p[METALLIC]) * p[SHEEN] * fade_h
    brightness = luminance(r, g, b)
    lobe = ggx_d(h, alpha_u, alpha_v) * g2_separable(wo, wi, alpha_u, alpha_v) / (4.0 * wo[2] * wi[2])
    coat = 0.0
    if p[CLEARCOAT] > 0.0:
        shadowing = g2_separable(wo, wi, _COAT_SHADOWING, _COAT_SHADOWING) / (4.0 * wo[2] * wi[2])
        coat = 0.25 * p[CLEARCOAT] * gtr1_d(h[2], coat_width(p)) * shadowing * _mix(_COAT_F0, 1.0, fade_h)
    return (
        _channel(r, brightness, p, matte, sheen, lobe, fade_h) + coat,
        _channel(g, brightness, p, matte, sheen, lobe, fade_h) + coat,
        _channel(b, brightness, p, matte, sheen, lobe, fade_h) + coat,
    )


@njit(cache=True, error_model="numpy")
def _channel(value, brightness, p, matte, sheen, lobe, fade_h):
    glow = sheen * _mix(1.0, _hue(value, brightness), p[SHEEN_TINT])
    return matte * value + glow + lobe * _mix(normal_specular(value, brightness, p), 1.0, fade_h)


@njit(cache=True, error_model="numpy")
def shares(r, g, b, p, cos_o):
    """Return the probabilities of the matte part and of the lobe; the rest is the coat."""
    brightness = luminance(r, g, b)
    matte = p[MATTE] * (1.0 - p[METALLIC]) * (brightness + 0.5 * p[SHEEN])
    fade = schlick(cos_o, 0.0)
    # Facets tilted away see more Fresnel than the mean normal: a floor keeps the lobe from being starved upright.
    lobe = max(_mix(normal_specular(brightness, brightness, p), 1.0, fade), 0.02)
    coat = 0.25 * p[CLEARCOAT] * _mix(_COAT_F0, 1.0, fade)
    total = matte + lobe + coat
    return matte / total, lobe / total


@njit(cache=True, error_model="numpy")
def pdf(r, g, b, alpha_u, alpha_v, p, wo, wi):
    """Return the density of `sample` per solid angle."""
    matte, lobe = shares(r, g, b, p, wo[2])
    h = normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))
    density = matte * pdf_cosine(wi) + lobe * pdf_reflected(wo, h, alpha_u, alpha_v)
    c = dot(wo, h)
    if p[CLEARCOAT] > 0.0 and c > 0.0:
        density += (1.0 - matte - lobe) * gtr1_d(h[2], coat_width(p)) * h[2] / (4.0 * c)
    return density


@njit(cache=True, error_model="numpy")
def sample(r, g, b, alpha_u, alpha_v, p, wo, u0, u1, u2):
    """Return a direction; it may point below the surface, where the BRDF is black."""
    matte, lobe = shares(r, g, b, p, wo[2])
    if u2 < matte:
        return sample_cosine(u0, u1)
    if u2 < matte + lobe or p[CLEARCOAT] <= 0.0:
        return reflect(wo, sample_visible(wo, alpha_u, alpha_v, u0, u1))
    a2 = coat_width(p) ** 2
    z = math.sqrt(min(max((1.0 - a2 ** (1.0 - u0)) / (1.0 - a2), 0.0), 1.0))
    s = math.sqrt(1.0 - z * z)
    phi = 2.0 * math.pi * u1
    return reflect(wo, (s * math.cos(phi), s * math.sin(phi), z))
