"""Matrices in, solvers out: multigrid hierarchies, factorisations, conjugate gradients."""

from hemivar.linear.multilevel import Hierarchy

__all__ = ["Hierarchy"]
