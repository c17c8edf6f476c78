"""Glass and water: interfaces that reflect and refract, smooth or frosted."""

from __future__ import annotations

from .foundation.checks import check_range
from .kernels.kinds import DIELECTRIC, ROUGH_DIELECTRIC, Surface
from .scattering import blank


def surface(eta: float, alpha: float = 0.0, *, alpha_v: float | None = None) -> Surface:
    """Return a clear interface.

    Parameters
    ----------
    eta : float
        Index below the surface (z < 0) over the index above; glass 1.5, water 1.33, a bubble in water 0.75.
    alpha : float
        GGX width in [0, 1]; 0 is smooth: two delta lobes. Else Walter et al. (2007), single scattering.
    alpha_v : float, optional
        Width across, for anisotropic surfaces.

    Notes
    -----
    Weights are for radiance: what is refracted from wi to wo carries (n_o / n_i)^2, the index on the viewer's side over
    that on the light's; through a pane and out again the factors cancel.

    Examples
    --------
    >>> from materials import scattering
    >>> drawn = scattering.sample(surface(1.5), [0.0, 0.0, 1.0], [0.5, 0.5, 0.9])
    >>> float(drawn.wi[2]), bool(drawn.is_delta)
    (-1.0, True)
    """
    check_range("eta", eta, "(0, inf)")
    check_range("alpha", alpha, "[0, 1]")
    across = alpha if alpha_v is None else alpha_v
    check_range("alpha_v", across, "[0, 1]")
    kind = DIELECTRIC if alpha == 0 and across == 0 else ROUGH_DIELECTRIC
    return blank()._replace(kind=kind, eta=float(eta), alpha_u=float(alpha), alpha_v=float(across))
