"""Compiled code of the lowest floor; all other kernels import it first, so the threads of Numba are chosen here."""

import numba

# OpenMP before TBB: the TBB that embreex brings is older than Numba asks for, which it would warn about at each start.
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]  # pyright: ignore[reportAttributeAccessIssue]
