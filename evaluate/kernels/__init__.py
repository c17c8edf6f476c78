"""Compiled code of the evaluation; the lowest floor's is imported first, since it chooses Numba's threads."""

import materials.kernels  # noqa: F401
