"""What all tests share: the folder of real recordings, a plotting backend without a screen, reproducible examples, threads."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import matplotlib
import numba
import pytest

import materials.kernels  # noqa: F401  sets Numba up before it starts its threads

matplotlib.use("Agg")

# The same examples everywhere, and few of them: a test that needs thousands is a study, not a test.
hypothesis.settings.register_profile("suite", deadline=None, derandomize=True, max_examples=40, database=None)
hypothesis.settings.register_profile("thorough", deadline=None, max_examples=2000)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

CHECKOUT = Path(__file__).resolve().parent.parent


def pytest_configure(config: pytest.Config) -> None:
    """Share the cores out among workers: threads of two workers that wait for each other on one core burn most of its time."""
    if config.getoption("numprocesses", None):
        # Read by the libraries of the workers, which start after this; Numba has a number of its own.
        os.environ |= {name: os.environ.get(name, "1") for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if workers > 1:
        numba.set_num_threads(max(numba.config.NUMBA_NUM_THREADS // workers, 1))


@pytest.fixture
def thread_counts() -> Iterator[tuple[int, int]]:
    """Numbers of threads to be set one after the other: a single one, and all that there are."""
    before = numba.get_num_threads()
    yield 1, numba.config.NUMBA_NUM_THREADS
    numba.set_num_threads(before)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings: `MENISCUS_DATA`, else `shared/data` beside the checkout."""
    folder = Path(os.environ.get("MENISCUS_DATA") or CHECKOUT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip("the real recordings are not here; set MENISCUS_DATA to their folder")
    return folder
