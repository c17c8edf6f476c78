"""A decorator for compiled functions that take arrays and make none."""

from numba import njit


def lean(**options):
    """Compile as `njit`, without counting references to arrays.

    Numba counts them around each use of an array in a tuple, by calls that LLVM can neither remove nor optimise across: a path
    made about a thousand. The caller, in the end Python, holds all arrays while kernels run, so nothing is lost. A function that
    allocates cannot be lean.
    """
    return njit(cache=True, _nrt=False, **options)  # pyright: ignore[reportCallIssue]
