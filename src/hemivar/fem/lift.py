"""Dirichlet lift: prescribed displacements carried on into a nonlinear body, from which its unknowns count.

Zero inside and displaced at the supports is a strain that grows without bound as the mesh is refined.  The rest state
is that of the linear body without strain instead, on springs as stiff as the foundation is at rest, under the
prescribed displacements alone: its strains are those of the data, on every mesh, and supports do not tear off what glue
holds.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.space import Field
from hemivar.fem.energy_integral import EnergyIntegral
from hemivar.fem.near_kernel import near_kernel, node_slots
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import frozen_at
from hemivar.linear.multilevel import Hierarchy

__all__ = ["lifted", "linear_response"]

#: By what part of its way a point is moved before a law is asked how stiff it is.
_BESIDE = 1e-9


def lifted(integral: EnergyIntegral, field: Field, contact: ContactPoints, law: VectorLaw, offset: Array) -> Array:
    """Nodal values (nodes, c) of the linear body that follows its supports.

    Shapes: ``offset`` (m, c).
    """
    stiffness, force = integral.unstrained()
    response = linear_response(field, stiffness, -force)
    springs = _springs(contact, law, -offset, contact.trace_of(response))
    return field.full(linear_response(field, stiffness + springs, -force) if springs.nnz else response)


def linear_response(field: Field, stiffness: sp.csr_array, force: Array) -> Array:
    """Unknowns (n,) of a linear body under a force (n,); along motions that nothing resists as it comes."""
    hierarchy = Hierarchy.of(stiffness, near=near_kernel(field), slots=[node_slots(field, stiffness)])
    return hierarchy.solve(force)[0]


def _springs(contact: ContactPoints, law: VectorLaw, rest: Array, response: Array) -> sp.csr_array:
    """Stiffness (n, n) of the foundation at local displacements (m, c), to the side to which points go, where positive.

    ``response (m, c)`` is where they go without it.
    """
    beside = rest.copy()
    beside[:, 0] += _BESIDE * np.maximum(np.abs(response[:, 0]), np.abs(rest[:, 0])) * np.sign(response[:, 0])
    hessian = frozen_at(law, beside).linearise(beside).hessian
    stiff = contact.weights[:, None] * np.maximum(np.einsum("mcc->mc", hessian), 0.0)
    springs = sp.csr_array(contact.trace.T @ sp.diags_array(stiff.ravel()) @ contact.trace)
    springs.eliminate_zeros()
    return springs
