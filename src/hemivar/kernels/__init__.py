"""Compiled kernels: a library in C++ with its own threads. Where it was not built, pyamg and SciPy serve."""

from hemivar.kernels.library import Kernels, kernels, threads

__all__ = ["Kernels", "kernels", "threads"]
