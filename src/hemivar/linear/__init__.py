"""Matrices in, solvers out: multigrid hierarchies, factorisations, conjugate gradients."""

from hemivar.linear.multilevel import GridLevel, Hierarchy

__all__ = ["GridLevel", "Hierarchy"]
