"""Two surfaces that Mitsuba 3 lacks, in its own terms: the gloss of `simulation/1`, and a water film over it.

They are written from the formulas with Mitsuba's own Fresnel, microfacets and sampling, and share no code with our
kernels: that is their point.

The film covers a share of the area. Mitsuba's `blendbsdf` could have mixed wet and dry, but in Mitsuba 3.9 it returns
with a sample the density of the part that it chose, and from `pdf` that of the mixture, so that the weights of multiple
importance sampling do not add up to 1: a white floor half below clear water in a white furnace comes out as 1.019.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

GLOSS, FILM = "meniscus_gloss", "meniscus_film"
_registered: set[str] = set()


def register(mitsuba: ModuleType) -> None:
    """Make the surfaces known to the current variant of Mitsuba, once."""
    variant = mitsuba.variant()
    if variant in _registered:
        return
    gloss, film = _classes(mitsuba)
    mitsuba.register_bsdf(GLOSS, gloss)
    mitsuba.register_bsdf(FILM, film)
    _registered.add(variant)


def diffuse_internal(eta: float, tau: np.ndarray) -> np.ndarray:
    """Return the share of diffuse light from below that an interface sends back through an optical depth, twice crossed.

    By quadrature of Fresnel's equations, apart below and above the critical angle where they have a kink.
    """
    nodes, weights = np.polynomial.legendre.leggauss(400)
    x, w = 0.5 * (nodes + 1), 0.5 * weights
    critical = np.sqrt(1 - 1 / eta**2)
    # mu = critical + (1 - critical) x^2 takes the square root at the kink away.
    mu = np.concatenate([critical * x, critical + (1 - critical) * x * x])
    dmu = np.concatenate([critical * w, (1 - critical) * 2 * x * w])
    cos_t = np.sqrt(np.maximum(1 - eta**2 * (1 - mu * mu), 0))
    F = 0.5 * (((eta * mu - cos_t) / (eta * mu + cos_t)) ** 2 + ((mu - eta * cos_t) / (mu + eta * cos_t)) ** 2)
    F = np.where(mu <= critical, 1.0, F)
    return (2 * mu * dmu * F * np.exp(-2 * np.asarray(tau)[..., None] / mu)).sum(axis=-1)


def _classes(mi: ModuleType) -> tuple[type, type]:
    import drjit as dr  # pyright: ignore[reportMissingImports]

    diffuse = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
    glossy = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
    delta = mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.FrontSide

    def lobe(wi: Any, wo: Any, alpha: Any, f0: float) -> Any:
        """Return D G F / (4 cos cos) with height-correlated Smith (Heitz 2014) and Schlick's Fresnel."""
        h = dr.normalize(wi + wo)

        def smith(w: Any) -> Any:
            return 0.5 * (dr.sqrt(1 + dr.square(alpha) * mi.Frame3f.tan_theta_2(w)) - 1)

        D = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True).eval(h)
        G = dr.rcp(1 + smith(wi) + smith(wo))
        F = f0 + (1 - f0) * (1 - dr.dot(wi, h)) ** 5
        return D * G * F / (4 * mi.Frame3f.cos_theta(wi) * mi.Frame3f.cos_theta(wo))

    def lobe_pdf(wi: Any, wo: Any, alpha: Any) -> Any:
        h = dr.normalize(wi + wo)
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True).pdf(wi, h) / (4 * dr.dot(wo, h))

    def lobe_sample(wi: Any, alpha: Any, xi: Any) -> Any:
        m, _ = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True).sample(wi, xi)
        return mi.reflect(wi, m)

    class Gloss(mi.BSDF):
        """Lambert, not reduced, plus specular_scale times a GGX lobe."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            self.albedo, self.alpha = props.get_texture("albedo"), props.get_texture("alpha")
            self.f0 = ((props["eta"] - 1) / (props["eta"] + 1)) ** 2
            self.scale = props["specular_scale"]
            self.m_components = [diffuse, glossy]
            self.m_flags = diffuse | glossy

        def traverse(self, callback: Any) -> None:
            pass

        def _value(self, si: Any, wo: Any, active: Any) -> tuple[Any, Any]:
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (cos_i > 0) & (cos_o > 0)
            alpha = self.alpha.eval_1(si, active)
            f = self.albedo.eval(si, active) * dr.inv_pi + self.scale * lobe(si.wi, wo, alpha, self.f0)
            p = 0.5 * cos_o * dr.inv_pi + 0.5 * lobe_pdf(si.wi, wo, alpha)
            return dr.select(active, f * cos_o, 0), dr.select(active, p, 0)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
            glossy_chosen = sample1 < 0.5
            wo = dr.select(
                glossy_chosen,
                lobe_sample(si.wi, self.alpha.eval_1(si, active), sample2),
                mi.warp.square_to_cosine_hemisphere(sample2),
            )
            value, pdf = self._value(si, wo, active)
            bs = mi.BSDFSample3f()
            bs.wo, bs.pdf, bs.eta = wo, pdf, 1.0
            bs.sampled_component = dr.select(glossy_chosen, mi.UInt32(1), mi.UInt32(0))
            bs.sampled_type = dr.select(
                glossy_chosen, mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
            )
            return bs, dr.select(pdf > 0, value / pdf, 0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self._value(si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self._value(si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self._value(si, wo, active)

        def to_string(self) -> str:
            return "Gloss[]"

    class WaterFilm(mi.BSDF):
        """A smooth interface over a share of a matte or glossy base, with absorption and all bounces between the two."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            self.albedo, self.alpha = props.get_texture("albedo"), props.get_texture("alpha")
            self.thickness, self.coverage = props.get_texture("thickness"), props.get_texture("coverage")
            self.eta = props["film_eta"]
            f = (props["eta"] / self.eta - 1) / (props["eta"] / self.eta + 1)
            self.f0, self.scale = f * f, props["specular_scale"]
            self.f0_dry = ((props["eta"] - 1) / (props["eta"] + 1)) ** 2
            self.sigma = [props[f"sigma_a_{c}"] for c in "rgb"]
            thickest = max(self.sigma) * props["thickest"]
            tau = np.linspace(0, max(thickest, 1e-6), 64)
            # A cubic is off by 1e-5 up to depths of 1 %, by 2e-4 up to 6 %.
            self.inner = np.polyfit(tau, diffuse_internal(self.eta, tau), 3).tolist()
            self.m_components = [delta, diffuse, glossy]
            self.m_flags = delta | diffuse | glossy

        def traverse(self, callback: Any) -> None:
            pass

        def _inside(self, w: Any) -> Any:
            z2 = 1 - (dr.square(w.x) + dr.square(w.y)) / (self.eta * self.eta)
            return mi.Vector3f(w.x / self.eta, w.y / self.eta, dr.safe_sqrt(z2))

        def _shares(self, si: Any, active: Any) -> tuple[Any, Any, float]:
            """Return Fresnel's F, the probability of the interface, and that of the lobe among the rest."""
            F = mi.fresnel(mi.Frame3f.cos_theta(si.wi), self.eta)[0]
            return F, self.coverage.eval_1(si, active) * (0.2 + 0.8 * F), 0.3 if self.scale > 0 else 0.0

        def _value(self, si: Any, wo: Any, active: Any) -> tuple[Any, Any]:
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (cos_i > 0) & (cos_o > 0)
            F, top, gloss = self._shares(si, active)
            through = (1 - F) * (1 - mi.fresnel(cos_o, self.eta)[0]) / (self.eta * self.eta)
            a, b = self._inside(si.wi), self._inside(wo)
            path = dr.rcp(a.z) + dr.rcp(b.z)
            tau = mi.Color3f(*self.sigma) * self.thickness.eval_1(si, active)
            albedo = self.albedo.eval(si, active)
            inner = mi.Color3f(0)
            for c in self.inner:
                inner = inner * tau + c
            dry = albedo * dr.inv_pi
            wet = albedo * dr.inv_pi / (1 - albedo * inner)
            p = (1 - gloss) * cos_o * dr.inv_pi
            if self.scale > 0:
                alpha = self.alpha.eval_1(si, active)
                dry += self.scale * lobe(si.wi, wo, alpha, self.f0_dry)
                wet += self.scale * lobe(a, b, alpha, self.f0)
                p += 0.5 * gloss * (lobe_pdf(si.wi, wo, alpha) + lobe_pdf(a, b, alpha) * cos_o / (self.eta * self.eta * b.z))
            f = dr.lerp(dry, through * wet * dr.exp(-tau * path), self.coverage.eval_1(si, active))
            return dr.select(active, f * cos_o, 0), dr.select(active, (1 - top) * p, 0)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
            F, top, gloss = self._shares(si, active)
            at_top = sample1 < top
            rest = (sample1 - top) / (1 - top)
            at_gloss = ~at_top & (rest < gloss)
            wo = mi.warp.square_to_cosine_hemisphere(sample2)
            if self.scale > 0:
                alpha = self.alpha.eval_1(si, active)
                bent = lobe_sample(self._inside(si.wi), alpha, sample2)
                x, y = bent.x * self.eta, bent.y * self.eta
                z2 = 1 - x * x - y * y
                out = mi.Vector3f(x, y, dr.select((z2 > 0) & (bent.z > 0), dr.safe_sqrt(z2), -1))
                lobes = dr.select(rest < 0.5 * gloss, lobe_sample(si.wi, alpha, sample2), out)
                wo = dr.select(at_gloss, lobes, wo)
            value, pdf = self._value(si, wo, active)
            bs = mi.BSDFSample3f()
            bs.wo, bs.eta = dr.select(at_top, mi.reflect(si.wi), wo), 1.0
            bs.pdf = dr.select(at_top, top, pdf)
            flags = mi.BSDFFlags
            smooth = dr.select(at_gloss, mi.UInt32(+flags.GlossyReflection), mi.UInt32(+flags.DiffuseReflection))
            bs.sampled_type = dr.select(at_top, mi.UInt32(+flags.DeltaReflection), smooth)
            bs.sampled_component = dr.select(at_top, mi.UInt32(0), dr.select(at_gloss, mi.UInt32(2), mi.UInt32(1)))
            mirrored = self.coverage.eval_1(si, active) * F / top
            weight = dr.select(at_top, mi.Color3f(mirrored), dr.select(pdf > 0, value / pdf, 0))
            return bs, weight & (active & (mi.Frame3f.cos_theta(si.wi) > 0))

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self._value(si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self._value(si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self._value(si, wo, active)

        def to_string(self) -> str:
            return "WaterFilm[]"

    return Gloss, WaterFilm
