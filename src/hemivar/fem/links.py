"""Links: linear conditions on nodal values by which some follow others, eliminated like prescribed ones.

Bodies that are tied have no jump between them, in the mean of the mortar projection around each node of the slave, and
the nodes of a rigid plate follow few of them (:mod:`hemivar.fem.plates`).
Conditions ``J U = b`` are turned into unknowns that vanish (:mod:`hemivar.fem.mortar_basis`), so that what they link
follows in stiffness, mass and load, on every level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.contact_points import local_components, pair_projection, seen_apart
from hemivar.fem.mortar import Mortar
from hemivar.fem.plates import stated_plates
from hemivar.fem.supports import Supports
from hemivar.mechanics.statement import ContactProblem

__all__ = ["Links", "stated_links", "tied_nodes"]


@dataclass(frozen=True, eq=False)
class Links:
    """Conditions ``J U = b`` on nodal values U (nodes * c,)."""

    rows: sp.csr_array  # (k, nodes * c): J
    values: Array  # (k,): b
    node: IntArray  # (k,): the node of which a value follows
    name: str  # of what states them
    notes: tuple[str, ...] = ()
    of_plate: bool = False


def tied_nodes(problem: ContactProblem, supports: Supports) -> dict[str, Mortar]:
    """The mortar projection of each tie, at whose nodes the slave follows the master."""
    return {name: pair_projection(problem.tied, name, supports)[0] for name in problem.ties}


def stated_links(
    problem: ContactProblem, supports: Supports, ties: Mapping[str, Mortar], directions: Array, free: BoolArray
) -> list[Links]:
    """The conditions of the rigid plates and of the ties of a problem.

    ``directions (nodes, c, c)`` are those of the unknowns at every node, ``free (nodes, c)`` which of them are.
    """
    plates = [
        Links(*plate.follow(supports, directions, free), f"plate '{plate.name}'", of_plate=True)
        for plate in stated_plates(problem)
    ]
    named = {f"tie '{name}' against '{problem.ties[name].against}'": tie for name, tie in ties.items()}
    return [*plates, *(_tie(name, tie, supports, directions, free) for name, tie in named.items())]


def _tie(name: str, projection: Mortar, supports: Supports, directions: Array, free: BoolArray) -> Links:
    """No jump along the directions of the slave's nodes; along one that a support holds the master has to follow."""
    own = projection.nodes
    rows = local_components(projection.jump, directions[own])
    kept = free[own].ravel()
    kept[~kept] = seen_apart(sp.csr_array(rows[~kept]), np.repeat(supports.count == 0, free.shape[1]))
    node = np.repeat(own, free.shape[1])[kept]
    far = float(np.abs(projection.jump @ (supports.nodes - supports.nodes[own[0]])).max())
    note = (
        f"{name}: the sides are up to {far:.3g} apart, and what turns both strains them there; let them fit each other"
    )
    size = float(np.ptp(supports.nodes, axis=0).max())
    return Links(sp.csr_array(rows[kept]), np.zeros(node.size), node, name, (note,) if far > SAME * size else ())
