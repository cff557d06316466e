"""What a VTU file holds of the solution of a scalar problem."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.fem import gradient, nodal_average
from hemivar.files.snapshot import Snapshot
from hemivar.mechanics.scalar import ScalarKind, ScalarProblem
from hemivar.solvers import Solution

__all__ = ["scalar_fields"]


def scalar_fields(solution: Solution | Snapshot) -> tuple[dict[str, Array], dict[str, Array]]:
    """Point data and cell data of a scalar problem, vectors with as many components as the mesh.

    Point data: the unknown by its name (``deflection``, ``temperature``; ``u_z`` in antiplane shear), for membranes and
    antiplane shear ``displacement`` as well, a vector across the plane to warp by; ``flux`` (``A grad u``, a vector,
    nodal averages); at contact points ``pressure``, ``gap``, ``penetration``, where there is friction ``friction`` and
    ``slip`` (numbers), ``state`` and ``tangential_state`` (as in :func:`hemivar.files.write_vtu`) and ``boundary``
    (number of the contact boundary or area; the field data ``boundary NAME`` hold the number of each); elsewhere 0, and
    -1 for states and ``boundary``.

    In time ``velocity`` as well, but of heat.  Cell data: ``gradient`` and ``flux`` in the middle of each cell.
    """
    problem, field = solution.problem, solution.problem.field
    stated = problem.origin
    assert field is not None
    assert isinstance(stated, ScalarProblem)
    values = solution.displacement[:, 0]
    slope, flux = gradient(stated, solution.displacement)
    name = "u_z" if stated.kind is ScalarKind.ANTIPLANE else stated.kind.unknown
    point_data: dict[str, Array] = {name: values}
    if isinstance(solution, Snapshot) and stated.kind is not ScalarKind.HEAT:
        point_data["velocity"] = solution.velocity[:, 0]
    if stated.kind is not ScalarKind.HEAT:
        point_data["displacement"] = np.column_stack([np.zeros((len(values), 2)), values])
    point_data["flux"] = nodal_average(stated, flux)
    contact = problem.contact
    if contact.count:
        quantities = {
            "pressure": (solution.pressure, 0.0),
            "gap": (problem.gap, 0.0),
            "penetration": (solution.penetration, 0.0),
            "state": (solution.states.codes.astype(float), -1.0),
            "tangential_state": (solution.tangential_state.astype(float), -1.0),
            "boundary": (contact.boundary.astype(float), -1.0),
        }
        if contact.components > 1:
            quantities |= {"friction": (solution.friction[:, 0], 0.0), "slip": (solution.slip[:, 0], 0.0)}
        for key, (at, fill) in quantities.items():
            point_data[key] = np.full(len(values), fill)
            point_data[key][contact.node] = at
    return point_data, {"gradient": slope, "flux": flux}
