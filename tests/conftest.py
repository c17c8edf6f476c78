"""What all tests share: the folder of real recordings, a plotting backend without a screen, reproducible examples."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import matplotlib
import pytest

matplotlib.use("Agg")

# The same examples everywhere, and few of them: a test that needs thousands is a study, not a test.
hypothesis.settings.register_profile("suite", deadline=None, derandomize=True, max_examples=40, database=None)
hypothesis.settings.register_profile("thorough", deadline=None, max_examples=2000)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings: `MENISCUS_DATA`, else `shared/data` beside the checkout."""
    folder = Path(os.environ.get("MENISCUS_DATA") or CHECKOUT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip("the real recordings are not here; set MENISCUS_DATA to their folder")
    return folder
