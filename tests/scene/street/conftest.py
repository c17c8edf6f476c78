"""One small street for all tests of it: coarse meshes and textures, the same shapes."""

from __future__ import annotations

import pytest

from scene.street import Street, StreetSettings, street

SMALL = StreetSettings(frames=3, width=160, height=68, detail=0.3, seed=1)


@pytest.fixture(scope="session")
def small_street() -> Street:
    return street(SMALL)
