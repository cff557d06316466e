"""The hierarchy of a discrete problem: the body on its mesh and the coarser ones, with the matrices of all levels."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.contact import contact_unknowns, selects
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.hierarchy import Coarser, coarser
from hemivar.fem.near_kernel import near_kernel, node_slots
from hemivar.linear.levels import COARSEST, Levels
from hemivar.linear.multilevel import Hierarchy

__all__ = ["ElasticMultigrid"]


@dataclass(frozen=True, eq=False)
class ElasticMultigrid:
    """A hierarchy of discrete problems with the matrices of all its levels; nothing in it changes."""

    steps: tuple[Coarser, ...]  # from coarse to fine: ``steps[k]`` holds the problem on mesh k and leads to mesh k + 1
    hierarchy: Hierarchy  # the matrices, with algebraic ones below that of the coarsest mesh where that is large
    seconds: float  # spent on setting up

    @staticmethod
    def of(problem: DiscreteProblem) -> ElasticMultigrid:
        """The hierarchy of a problem; it serves every other load, gap and law of the same body as well."""
        began = time.perf_counter()
        chain: list[Coarser] = []  # from fine to coarse
        coarsest = problem
        while coarsest.unknowns > COARSEST:
            step = coarser(coarsest)
            if step is None:
                break
            chain.append(step)
            coarsest = step.problem
        problems = [problem] + [step.problem for step in chain]
        nothing = np.zeros(0, dtype=np.int64)
        parts = [contact_unknowns(p.contact) if selects(p.contact.trace) else (nothing,) * 4 for p in problems]
        large = coarsest.unknowns > COARSEST
        hierarchy = Hierarchy.of(
            [p.stiffness for p in problems],
            [step.prolongation for step in chain],
            near=near_kernel(coarsest.field) if large else None,
            slots=[node_slots(p.field, p.stiffness) for p in problems],
            contacts=[part[0] for part in parts],
            points=[part[3] for part in parts],
        )
        return ElasticMultigrid(tuple(reversed(chain)), hierarchy, time.perf_counter() - began)

    @property
    def levels(self) -> Levels:
        """The matrices from coarse to fine."""
        return self.hierarchy.stack

    @property
    def first(self) -> int:
        """Level of the coarsest mesh."""
        return self.levels.algebraic

    def solve(self, load: Array, tolerance: float = 1e-10, nested: bool = True) -> tuple[Array, int]:
        """``K^-1 load`` (n,), none of the contact laws acting, and the cycles that it took: :meth:`Hierarchy.solve`."""
        return self.hierarchy.solve(load, tolerance, nested)
