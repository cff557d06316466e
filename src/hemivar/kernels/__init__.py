"""Compiled kernels: a library in C++ with its own threads. Where it was not built, pyamg and SciPy serve."""

from hemivar.kernels.library import kernels, threads

__all__ = ["kernels", "threads"]
