"""Compiled code of the tracer; the lowest floor's is imported first, since it sets up Numba."""

import materials.kernels  # noqa: F401
