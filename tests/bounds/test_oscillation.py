"""What loads that vary add to the distance: their oscillation, times the constant of the facet where they act."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import exact_distance
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.oscillation import local_constants
from hemivar.bounds.trace_bounds import discrete_trace_bounds
from tests import bodies

#: ``int (t^2 - P t^2)^2`` over a unit length, P the projection on linear functions: ``1/180``.
BENT = 1.0 / 180.0


def flat_strip(side: str, material: hv.Material, pattern: str = "right") -> hv.ContactProblem:
    """A flat body of one rectangle, cut in two, drawn on one side by a traction that is quadratic along it."""
    axis, length = (0, 1.0) if side == "top" else (1, 0.25)

    def bent(x: Array) -> Array:
        return np.column_stack([(x[:, axis] / length) ** 2, np.zeros(len(x))])

    return bodies.strip(hv.Compliance(1.0), 1, pattern, size=(1.0, 0.25), material=material, tractions={side: bent})


def added(problem: hv.ContactProblem, side: str) -> float:
    """What the cell at a side adds to its misfit."""
    constants = discrete_trace_bounds(hv.discretize(problem))
    found = exact_distance(problem, hv.solve(problem).displacement, constants)
    table = found.stress.data.table
    (facet,) = table.numbers(problem.mesh.boundaries[side])
    cell = int(table.owners[facet, 0])
    return float(np.sqrt(found.cells[cell]) - np.sqrt(found.stress.misfit[cell]))


def on_side(problem: hv.ContactProblem, side: str, modulus: float) -> float:
    """The constant of the facet on that side, for a shear modulus, times the oscillation."""
    table = facet_table(problem.mesh)
    (facet,) = table.numbers(problem.mesh.boundaries[side])
    cell = int(table.owners[facet, 0])
    stiffness = hv.Material.lame(0.0, modulus).stiffness_tensor(np.zeros((1, 2)))
    (local,) = np.flatnonzero(table.cell_facets[cell] == facet)
    size = np.sqrt(BENT * table.measures[facet])
    return float(local_constants(table, stiffness).facet[cell, local] * size)


@pytest.mark.parametrize(
    ("side", "pattern"), [("top", "right"), ("right", "right"), ("right", "left"), ("top", "left")]
)
def test_a_traction_that_bends_counts_by_the_constant_of_its_own_facet(side: str, pattern: str) -> None:
    problem = flat_strip(side, hv.Material.lame(0.0, 0.5), pattern)
    assert on_side(problem, side, 0.5) * (1.0 - 1e-9) <= added(problem, side) <= 1.1 * on_side(problem, side, 0.5)


def test_where_the_material_varies_in_a_cell_its_weakest_part_counts() -> None:
    """The modulus falls from 2 to 1/2 along the body; the cell at the top has its middle at a third of the way."""
    varying = hv.Material.lame(0.0, lambda x: 2.0 - 1.5 * x[:, 0])
    problem = flat_strip("top", varying)
    found = added(problem, "top")
    assert on_side(problem, "top", 1.5) < found <= 1.1 * on_side(problem, "top", 0.5)
