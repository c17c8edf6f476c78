"""The materials of chapter 5: BTFs from the virtual dome, and models fitted to them with and without estimated normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from materials.btf import BTF, compress
from materials.fit import fit_where_possible
from materials.fit_settings import FitSettings
from materials.foundation.progress import stage
from materials.svbrdf import SVBRDF, from_fits
from transport.dome import DomeSettings, acquire
from transport.dome_samples import dome_sample

from .cache import Cache
from .settings import FittedMaterialsSettings

REFERENCE = "BTF"
_WORDS = {"ct": "CT", "ward": "Ward", "phong": "Phong", "ggx": "GGX"}


def variants(models: tuple[str, ...]) -> dict[str, FitSettings | None]:
    """Return the reflectance models by the names of the thesis; the reference has no fit."""
    fits = {f"{_WORDS[m]}{'N' if n else ''}": FitSettings(model=m, normals=n) for m in models for n in (False, True)}
    return {REFERENCE: None, **fits}


class VirtualMaterials:
    """Measured once, fitted once per model, and kept.

    Parameters
    ----------
    settings : FittedMaterialsSettings
    cache : Cache
    """

    def __init__(self, settings: FittedMaterialsSettings, cache: Cache) -> None:
        self._settings, self._cache = settings, cache

    def btf(self, name: str) -> BTF:
        """Return the compressed BTF of a sample."""
        s = self._settings

        def measure() -> dict[str, NDArray]:
            with stage(f"dome: {name}"):
                dome = DomeSettings(lights=s.directions, views=s.directions, samples=s.dome_samples, seed=s.seed)
                found = compress(acquire(dome_sample(name, s.texels, s.seed), dome), s.rank)
            (spatial,), (angular,) = found.spatial, found.angular
            told = {"wi": found.wi, "wo": found.wo, "spatial": spatial, "angular": angular}
            return told | {"error": np.array(found.relative_error)}

        a = self._cache.arrays(self._parts(name) | {"what": "btf"}, measure)
        mask = np.ones((s.texels, s.texels), bool)
        error = float(a["error"])
        return BTF(a["wi"], a["wo"], mask, (a["spatial"],), (a["angular"],), np.eye(3), error, "1/sr", name)

    def fitted(self, name: str, variant: str) -> SVBRDF:
        """Return a model fitted to the decompressed BTF, at each texel."""
        how = variants(self._settings.models)[variant]
        assert how is not None
        fields = ("diffuse", "specular", "alpha", "frame", "cost", "relative_variance")
        mask = np.ones((self._settings.texels,) * 2, bool)

        def adapt() -> dict[str, NDArray]:
            with stage(f"fit of {variant}: {name}"):
                fits = fit_where_possible(self.btf(name).decompress(), how)
            found = from_fits(fits, how.model, how.eta, how.lobes, mask, "1/sr", name)
            return {field: getattr(found, field) for field in fields}

        a = self._cache.arrays(self._parts(name) | {"what": "fit", "variant": variant}, adapt)
        return SVBRDF(how.model, how.eta, mask, *(a[field] for field in fields), unit="1/sr", name=name)

    def material(self, name: str, variant: str) -> BTF | SVBRDF:
        """Return a sample as one of `variants`."""
        return self.btf(name) if variant == REFERENCE else self.fitted(name, variant)

    def _parts(self, name: str) -> dict[str, str | int]:
        s = self._settings
        dome = {"texels": s.texels, "directions": s.directions, "dome_samples": s.dome_samples, "rank": s.rank}
        return {"sample": name, "seed": s.seed, **dome}
