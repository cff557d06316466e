"""Compiled kernels: a library in C++ with its own threads. Where it was not built, pyamg and SciPy serve."""

from hemivar.kernels.library import Kernels, expect_list, kernels, threads
from hemivar.kernels.mesh_sums import BlockGraph, alike_rows, mesh_edges, mesh_facets, mesh_geometry, mesh_stars

__all__ = [
    "BlockGraph",
    "Kernels",
    "alike_rows",
    "expect_list",
    "kernels",
    "mesh_edges",
    "mesh_facets",
    "mesh_geometry",
    "mesh_stars",
    "threads",
]
