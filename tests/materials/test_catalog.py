"""The named surfaces of the street."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import materials
from materials import catalog, dielectric, ggx
from materials.foundation.errors import InputError


@pytest.mark.parametrize("name", catalog.CATALOG)
def test_every_named_surface_scatters_no_more_than_it_receives(name):
    xi = np.random.default_rng(0).random((4000, 3))
    for cos_o in (1.0, 0.4):
        drawn = materials.sample(catalog.named(name).surface(), (np.sqrt(1 - cos_o**2), 0.0, cos_o), xi)
        assert 0 < drawn.weight.mean() <= 1


def test_tarmac_has_the_index_of_the_literature():
    assert catalog.named("tarmac").eta == 1.63
    assert 0.5 <= catalog.named("tarmac").porosity <= 0.7


def test_an_unknown_name_is_refused_with_those_known():
    with pytest.raises(InputError, match=r"name must be in the catalog, got 'chocolate'. Known: tarmac"):
        catalog.named("chocolate")


def test_importing_materials_loads_no_numerics():
    code = "import sys, materials; sys.exit('numpy' in sys.modules or 'numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_all_names_of_the_package_exist():
    for name in materials.__all__:
        assert getattr(materials, name) is not None


def test_surfaces_refuse_what_no_surface_has():
    with pytest.raises(InputError, match=r"albedo must lie in \[0, 1\], got 1.5 at index 2"):
        ggx.surface((0.1, 0.1, 1.5), 0.3)
    with pytest.raises(InputError, match=r"alpha must lie in \(0, 1\]"):
        ggx.surface((0.1, 0.1, 0.1), 0.0)
    with pytest.raises(InputError, match="eta must lie in"):
        dielectric.surface(0.0)
