"""What water does to the parameters of a surface, for one point: eqs 2.18, 6.12, 6.13 (see materials/wetness.py)."""

from numba import njit

from .frames import normalize

ETA_WATER = 1.33


@njit(cache=True)
def levels(level):
    """Return saturation and accumulation of a water level."""
    return min(1.0, max(0.0, 2.0 * level)), min(1.0, max(0.0, 2.0 * level - 1.0))


@njit(cache=True)
def wet_lobe(eta, roughness, n, water_n, rho, w_sat, w_acc, strength):
    """Return (eta, roughness, normal) of a surface whose pores fill and on which water then stands."""
    keep = 1.0 - (1.0 - rho) * 0.5 * w_sat
    t = strength * w_acc
    wet_eta = ETA_WATER + (eta - ETA_WATER) * keep * (1.0 - t)
    wet_roughness = roughness * keep * (1.0 - t)
    if t > 0.0:
        n = normalize((n[0] + (water_n[0] - n[0]) * t, n[1] + (water_n[1] - n[1]) * t, n[2] + (water_n[2] - n[2]) * t))
    return wet_eta, wet_roughness, n
