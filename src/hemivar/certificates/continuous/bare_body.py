"""A body without loads and laws, on the coarsest mesh that is known of it: what constants of the body depend on.

A body that is not linear is replaced by the linear one of ``C_low``, in whose energy norm its errors are bounded.
"""

from __future__ import annotations

from dataclasses import replace

from hemivar.errors import ProblemError
from hemivar.laws import NoContact
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.conditions import Clamped, Prescribed
from hemivar.mechanics.statement import Contact, ContactProblem

__all__ = ["bare_body"]

#: Cells of the coarsest mesh of a body beyond which the systems would be too large.
_MOST = {2: 20_000, 3: 2_500}


def bare_body(problem: ContactProblem, *, coarsest: bool = True) -> ContactProblem:
    """Supports at rest, no loads, contact boundaries without a law; the directions of contact stay."""
    mesh = problem.mesh
    while coarsest and mesh.parent is not None:
        mesh = mesh.parent.mesh
    if coarsest and mesh.number_of_cells > _MOST[mesh.dim]:
        raise ProblemError(
            f"the coarsest mesh of the body has {mesh.number_of_cells} cells; lower bounds of trace constants are "
            f"computed on up to {_MOST[mesh.dim]}: begin with a coarser mesh and refine it"
        )
    supports = {
        name: Clamped() if isinstance(support, Prescribed) else support for name, support in problem.supports.items()
    }
    return replace(
        problem,
        mesh=mesh,
        material=lower_elasticity(problem.material),
        supports=supports,
        contact={
            name: Contact(NoContact(), obstacle=contact.obstacle, normals=contact.normals)
            for name, contact in problem.contact.items()
        },
        tractions={},
        body_force=(0.0,) * mesh.dim,
        order=1,
    )
