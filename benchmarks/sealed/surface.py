"""One reflectance for Mitsuba 3 that covers what the sealed surfaces do, from the formulas of `simulation/1`."""

from __future__ import annotations

from types import ModuleType
from typing import Any

NAME = "sealed_reflectance"
_registered: set[str] = set()

# What a body's surface may say, with what is believed when it does not.
DEFAULTS = {
    "scale": 0.0, "alpha_u": 0.3, "alpha_v": 0.3, "eta": 1.5,  # a GGX lobe, Schlick's Fresnel from eta
    "scale2": 0.0, "alpha2": 0.6,  # a second lobe of the same eta
    "fresnel": 1.0,  # 1: rises with angle; 0: as along the normal
    "sigma": 0.0,  # Oren and Nayar's slope deviation [rad]
    "retro": 0.0, "retro_width": 0.15,  # lobe about wo = wi: value along the axis [1/sr], width [rad]
}  # fmt: skip


def register(mi: ModuleType) -> None:
    """Make the reflectance known to the current variant of Mitsuba, once."""
    if mi.variant() in _registered:
        return
    mi.register_bsdf(NAME, _reflectance(mi))
    _registered.add(mi.variant())


def _reflectance(mi: ModuleType) -> type:
    import drjit as dr  # pyright: ignore[reportMissingImports]

    flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide

    class Reflectance(mi.BSDF):
        """Lambert or Oren-Nayar, plus up to two GGX lobes, plus retroreflection; a mask fades all that is not Lambert."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            self.albedo, self.mask = props.get_texture("albedo"), props.get_texture("mask")
            self.p = {key: float(props[key]) for key in DEFAULTS}
            self.f0 = ((self.p["eta"] - 1) / (self.p["eta"] + 1)) ** 2
            self.m_components = [flags]
            self.m_flags = flags

        def traverse(self, callback: Any) -> None:
            pass

        def _lobe(self, wi: Any, wo: Any, au: float, av: float) -> Any:
            h = dr.normalize(wi + wo)

            def smith(w: Any) -> Any:
                t2 = (dr.square(au * w.x) + dr.square(av * w.y)) / dr.square(w.z)
                return 0.5 * (dr.sqrt(1 + t2) - 1)

            D = dr.rcp(dr.pi * au * av * dr.square(dr.square(h.x / au) + dr.square(h.y / av) + dr.square(h.z)))
            F = self.f0 + self.p["fresnel"] * (1 - self.f0) * (1 - dr.dot(wi, h)) ** 5
            return D * F / ((1 + smith(wi) + smith(wo)) * 4 * wi.z * wo.z)

        def _diffuse(self, wi: Any, wo: Any) -> Any:
            s2 = self.p["sigma"] ** 2
            if s2 == 0.0:
                return dr.inv_pi
            a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
            # sin sin cos(phi) is the part of wi . wo in the plane; times sin / tan it is Oren and Nayar's product.
            tangential = wi.x * wo.x + wi.y * wo.y
            return dr.inv_pi * (a + b * dr.maximum(tangential, 0) / dr.maximum(wi.z, wo.z))

        def _value(self, si: Any, wo: Any, active: Any) -> Any:
            wi, p = si.wi, self.p
            active = active & (wi.z > 0) & (wo.z > 0)
            extra = mi.Float(0)
            if p["scale"] > 0:
                extra = extra + p["scale"] * self._lobe(wi, wo, p["alpha_u"], p["alpha_v"])
            if p["scale2"] > 0:
                extra = extra + p["scale2"] * self._lobe(wi, wo, p["alpha2"], p["alpha2"])
            if p["retro"] > 0:
                angle = dr.safe_acos(dr.dot(wi, wo))
                extra = extra + p["retro"] * dr.exp(-0.5 * dr.square(angle / p["retro_width"]))
            f = self.albedo.eval(si, active) * self._diffuse(wi, wo) + self.mask.eval_1(si, active) * extra
            return dr.select(active, f * wo.z, 0)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
            wo = mi.warp.square_to_cosine_hemisphere(sample2)
            pdf = mi.warp.square_to_cosine_hemisphere_pdf(wo)
            bs = mi.BSDFSample3f()
            bs.wo, bs.pdf, bs.eta = wo, pdf, 1.0
            bs.sampled_component, bs.sampled_type = mi.UInt32(0), mi.UInt32(+flags)
            return bs, dr.select(pdf > 0, self._value(si, wo, active) / pdf, 0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self._value(si, wo, active)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return dr.select((si.wi.z > 0) & (wo.z > 0), mi.warp.square_to_cosine_hemisphere_pdf(wo), 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self) -> str:
            return "Reflectance[]"

    return Reflectance
