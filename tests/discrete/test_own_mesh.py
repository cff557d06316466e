"""Own arrays with a mesh: displacements of nodes, pictures and VTU as those of a problem that was stated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from tests.problems import square

FRICTION = replace(
    square(n=4), contact={"bottom": hv.Contact(normal=hv.laws.ThresholdCompliance(0.3, 2.0), friction=hv.Tresca(0.2))}
)


def rubbing_cube() -> hv.ContactProblem:
    mesh = hv.box((1.0, 1.0, 1.0), (2, 2, 2))
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        body_force=(0.1, 0.2, -0.8),
        contact={"bottom": hv.Contact(normal=hv.Compliance(2.0), friction=hv.Tresca(0.1))},
    )


def numbers_of(stated: DiscreteProblem) -> tuple[np.ndarray, np.ndarray]:
    """The unknown of each node and component, (N, d), and the sign (n,) with which the library stores it."""
    field = stated.field
    assert field is not None
    entries = field.basis.tocoo()
    assert np.abs(np.abs(entries.data[entries.data != 0.0]) - 1.0).max() < 1e-12
    numbering, sign = np.full(field.prescribed.size, -1), np.ones(stated.unknowns)
    real = entries.data != 0.0
    numbering[entries.row[real]] = entries.col[real]
    sign[entries.col[real]] = entries.data[real]
    return numbering.reshape(field.nodes.shape), sign


def given_by(stated: DiscreteProblem, turn: float = 1.0) -> dict[str, Any]:
    """A problem by arrays in the components of the mesh; ``turn`` = -1 turns the tangents of the trace round."""
    field, contact = stated.field, stated.contact
    assert field is not None
    numbering, sign = numbers_of(stated)
    S = sp.diags_array(sign)
    rows = np.tile([1.0, *[turn] * (contact.components - 1)], contact.count)
    return {
        "stiffness": sp.csr_array(S @ stated.stiffness @ S), "load": sign * stated.load,
        "trace": sp.csr_array(sp.diags_array(rows) @ contact.trace @ S), "weights": contact.weights,
        "gap": stated.gap, "law": stated.law, "mesh": field.mesh, "numbering": numbering,
        "prescribed": field.prescribed.reshape(numbering.shape),
    }  # fmt: skip


def arrays_of(stated: DiscreteProblem, turn: float = 1.0) -> DiscreteProblem:
    """The same problem by its arrays, a mesh and a numbering."""
    return DiscreteProblem.of_arrays(**given_by(stated, turn))


@pytest.mark.parametrize(
    "statement", [FRICTION, replace(FRICTION, order=2), rubbing_cube()], ids=["linear", "quadratic", "solid"]
)
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_own_arrays_with_a_mesh_give_what_the_statement_gives(statement: hv.ContactProblem, turn: float) -> None:
    stated = hv.discretize(statement)
    own = arrays_of(stated, turn)
    expected, found = hv.solve(stated).raise_for_status(), hv.solve(own).raise_for_status()
    scale = np.abs(expected.displacement).max()
    np.testing.assert_allclose(found.displacement, expected.displacement, atol=1e-9 * scale)
    assert own.contact.names == ("bottom",)
    assert own.contact.points is not None
    assert own.contact.frames is not None
    assert stated.contact.points is not None
    assert stated.contact.frames is not None
    np.testing.assert_array_equal(own.contact.node, stated.contact.node)
    np.testing.assert_allclose(own.contact.points, stated.contact.points, atol=1e-15)
    largest = np.abs(expected.tractions).max()
    np.testing.assert_allclose(found.tractions, expected.tractions, atol=1e-7 * largest)
    np.testing.assert_allclose(own.contact.frames[:, 0], stated.contact.frames[:, 0], atol=1e-12)
    gram = np.einsum("mij,mkj->mik", own.contact.frames, own.contact.frames)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(gram.shape[1]), gram.shape), atol=1e-12)


def test_nothing_is_claimed_from_a_stiffness_that_comes_from_elsewhere() -> None:
    # which motions cost a matrix of unknown origin no energy is not known, though those of its mesh are
    own = arrays_of(hv.discretize(FRICTION))
    assert own.field is not None
    assert own.field.moves
    assert not own.field.kernel_known


def test_a_mesh_that_does_not_fit_is_refused_with_the_place() -> None:
    given = given_by(hv.discretize(square(n=2)))
    numbers = np.array(given["numbering"])
    twice, beyond, lost = numbers.copy(), numbers.copy(), numbers.copy()
    free = np.argwhere(numbers >= 0)
    twice[tuple(free[0])] = numbers[tuple(free[1])]
    beyond[tuple(free[0])] = 99
    lost[tuple(free[0])] = -2
    mesh = given["mesh"]
    assert isinstance(mesh, hv.Mesh)
    no_name = hv.Mesh(mesh.points, mesh.cells, {"left": mesh.boundaries["left"]})
    for change, words in (
        ({"numbering": twice}, "unknown 0 occurs at 2 places"),
        ({"numbering": beyond}, "numbering holds 99"),
        ({"numbering": lost}, "numbering holds -2"),
        ({"numbering": numbers[:-1]}, "must hold integers, shape"),
        ({"numbering": numbers.astype(float)}, "must hold integers"),
        ({"numbering": None}, "numbering is missing"),
        ({"prescribed": np.zeros((2, 2))}, "must be that of the numbering"),
        ({"mesh": no_name}, "on none of the named boundaries"),
        ({"mesh": "mesh.msh"}, "mesh"),
        ({"mesh": None}, "go with a mesh"),
    ):
        with pytest.raises(ProblemError, match=words):
            DiscreteProblem.of_arrays(**{**given, **change})  # type: ignore[arg-type]


def test_a_huge_number_of_an_unknown_is_refused_before_anything_is_counted() -> None:
    given = given_by(hv.discretize(rubbing_cube()))
    numbers = given["numbering"].copy()
    for wrong in (10**9, np.iinfo(np.int64).max, -2):
        numbers[0, 0] = wrong
        with pytest.raises(ProblemError, match=f"numbering holds {wrong}"):
            DiscreteProblem.of_arrays(**{**given, "numbering": numbers})
    with pytest.raises(ProblemError, match="numbering is a masked array"):
        DiscreteProblem.of_arrays(**{**given, "numbering": np.ma.masked_less(given["numbering"], 0)})
    with pytest.raises(ProblemError, match="trace has entries above"):
        DiscreteProblem.of_arrays(**{**given, "trace": given["trace"] * 1e300})


def test_masks_are_not_lost_in_meshes() -> None:
    mesh = hv.rectangle((1.0, 1.0), 2)
    for call in (
        lambda: hv.Mesh(mesh.points, np.ma.masked_greater(mesh.cells, 5)),
        lambda: mesh.with_boundaries({"left": lambda p: np.ma.masked_less(p[:, 0], 0.5) < 0.7}),
        lambda: mesh.refined_where(np.ma.masked_less(np.arange(3), 1)),
    ):
        with pytest.raises(ProblemError, match="masked array"):
            call()


def test_nodes_are_those_of_order_one_or_two() -> None:
    mesh = hv.rectangle((1.0, 1.0), 1)
    for order in ("x", 3, None):
        with pytest.raises(ProblemError, match=r"order = .*; give 1 or 2"):
            mesh.nodes(order)  # type: ignore[arg-type]
