"""Fields of any number of components, bases that are not orthonormal, bulks and contact points by themselves."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from skfem.models.poisson import laplace, unit_load

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import Bulk, ContactPoints, DiscreteProblem, Field, Model, Quadratic, Space
from hemivar.discrete.loading import Loading
from hemivar.laws import ContactLaw
from tests import bodies

MESH = hv.rectangle((1.0, 1.0), 8)


def stretched_membrane(scale: float = 1.0, push: float = 2.0, gap: float = 0.05) -> DiscreteProblem:
    """A membrane over the unit square, held at its rim, pushed towards a rigid plane under it.

    ``scale`` stretches the unknowns, so that the basis is not orthonormal.
    """
    mesh = skfem.MeshTri(MESH.points.T, MESH.cells.T)
    basis = skfem.Basis(mesh, skfem.ElementTriP1())
    K, f = laplace.assemble(basis), push * unit_load.assemble(basis)
    free = basis.complement_dofs(basis.get_dofs())
    area = unit_load.assemble(basis)[free]
    P = sp.csr_array(sp.eye_array(len(f), format="csc")[:, free] * scale)
    field = Field(MESH, 1, P, np.zeros(len(f)), components=1, name="deflection", lift=P.T / scale**2)
    n = len(free)
    contact = ContactPoints(
        sp.csr_array(scale * sp.eye_array(n)),
        area,
        points=MESH.points[free],
        node=free,
        boundary=np.zeros(n, dtype=np.int64),
        names=("plane",),
    )
    law = ContactLaw(hv.Signorini()).at(MESH.points[free])
    bulk = Quadratic(P.T @ K @ P)
    return DiscreteProblem(Model(bulk, contact, Space((field,))), Loading(P.T @ f, np.full((n, 1), gap), law))


@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_a_membrane_on_a_plane(method: str) -> None:
    problem = stretched_membrane()
    found = hv.solve(problem, hv.solvers.METHODS[method]).raise_for_status()
    assert problem.space is not None
    deflection = problem.space["deflection"].full(found.unknowns)
    assert deflection.shape == (81, 1)
    pressed = found.multiplier[:, 0] > 1e-9
    assert 0 < np.count_nonzero(pressed) < problem.contact_points
    np.testing.assert_allclose(deflection[problem.contact.node[pressed], 0], 0.05, atol=1e-12)
    assert deflection.max() <= 0.05 + 1e-12
    # projected Gauss-Seidel, which knows nothing of laws
    K, f = problem.bulk.hessian(found.unknowns).toarray(), problem.out_of_balance(np.zeros(problem.unknowns))
    u = np.zeros(problem.unknowns)
    for _ in range(400):
        for i in range(len(u)):
            u[i] = min(u[i] + (f[i] - K[i] @ u) / K[i, i], 0.05)
    np.testing.assert_allclose(found.unknowns, u, atol=1e-10)
    assert hv.certify(problem, found.unknowns, found.multiplier).unique


def test_a_basis_need_not_be_orthonormal() -> None:
    plain, stretched = stretched_membrane(), stretched_membrane(scale=3.0)
    one, other = hv.solve(plain), hv.solve(stretched)
    np.testing.assert_allclose(3.0 * other.unknowns, one.unknowns, rtol=1e-9, atol=1e-13)
    assert plain.field is not None
    assert stretched.field is not None
    full = plain.field.full(one.unknowns)
    np.testing.assert_allclose(stretched.field.full(other.unknowns), full, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(stretched.field.restrict(full), other.unknowns, rtol=1e-9, atol=1e-13)
    first, second = (hv.certify(p, s.unknowns, s.multiplier) for p, s in ((plain, one), (stretched, other)))
    assert first.energy == pytest.approx(second.energy, rel=1e-12)


def test_a_softening_membrane_has_the_same_margin_in_any_basis() -> None:
    margins = []
    for scale in (1.0, 0.2):
        problem = stretched_membrane(scale)
        problem = problem.with_(law=ContactLaw(hv.laws.ThresholdCompliance(0.1, 3.0)).at(problem.contact.points))
        found = hv.solve(problem)
        margins.append(hv.certify(problem, found.unknowns, found.multiplier).smallness.margin)
    assert margins[0] == pytest.approx(margins[1], rel=1e-9)


def test_two_bodies_pressed_together_by_their_relative_displacement() -> None:
    """Two springs, 2 and 3, a gap of 0.1 between them, pushed by 1 and -0.5: closed form."""
    problem = DiscreteProblem.of_arrays(
        np.diag([2.0, 3.0]), [1.0, -0.5], [[1.0, -1.0]], [1.0], [0.1], ContactLaw(hv.Signorini())
    )
    found = hv.solve(problem)
    # u1 - u2 = 0.1, 2 u1 = 1 - p, 3 u2 = -0.5 + p
    p = (1.0 / 2 + 0.5 / 3 - 0.1) / (1.0 / 2 + 1.0 / 3)
    np.testing.assert_allclose(found.unknowns, [(1.0 - p) / 2, (p - 0.5) / 3], rtol=1e-12)
    assert found.pressure[0] == pytest.approx(p)


def test_what_a_field_refuses() -> None:
    n = MESH.number_of_nodes
    basis = sp.eye_array(n, format="csr")
    with pytest.raises(hv.errors.ProblemError, match="not orthonormal; give a lift"):
        Field(MESH, 1, 2.0 * basis, np.zeros(n))
    with pytest.raises(hv.errors.ProblemError, match="lift @ basis is not the identity"):
        Field(MESH, 1, 2.0 * basis, np.zeros(n), lift=basis)
    with pytest.raises(hv.errors.ProblemError, match="2 components at each of the 81 nodes"):
        Field(MESH, 1, basis, np.zeros(n), components=2)
    with pytest.raises(hv.errors.ProblemError, match="needs one for each of the 80"):
        Field(MESH, 1, basis, np.zeros(n - 1))
    field = Field(MESH, 1, basis, np.zeros(n), name="temperature")
    assert field.components == 1
    with pytest.raises(hv.errors.ProblemError, match=r"no field .displacement. \(known: temperature"):
        Space((field,))["displacement"]
    with pytest.raises(hv.errors.ProblemError, match="same name"):
        Space((field, field))
    other = Field(MESH, 1, basis[:, :5], np.zeros(n), name="deflection")
    with pytest.raises(hv.errors.ProblemError, match="differ in columns"):
        Space((field, other))


def test_the_derivatives_of_a_quadratic_bulk() -> None:
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    bulk = Quadratic(A @ A.T + np.eye(4))
    assert isinstance(bulk, Bulk)
    u, v, step = rng.normal(size=4), rng.normal(size=4), 1e-5
    slope = (bulk.value(u + step * v) - bulk.value(u - step * v)) / (2 * step)
    assert bulk.gradient(u) @ v == pytest.approx(slope, rel=1e-8)
    bent = (bulk.gradient(u + step * v) - bulk.gradient(u - step * v)) / (2 * step)
    np.testing.assert_allclose(bulk.hessian(u) @ v, bent, rtol=1e-8)
    assert bulk.value(np.zeros(4)) == 0.0
    with pytest.raises(hv.errors.ProblemError, match="not symmetric"):
        dataclasses.replace(bulk, stiffness=A + 10 * np.eye(4))


class Hardening:
    """``sum of u^2/2 + u^4/4``: a bulk that is not quadratic."""

    unknowns = 2

    def value(self, u: Array) -> float:
        return float((u**2 / 2 + u**4 / 4).sum())

    def gradient(self, u: Array) -> Array:
        return np.asarray(u + u**3)

    def hessian(self, u: Array) -> sp.csr_array:
        return sp.csr_array(np.diag(1.0 + 3.0 * u**2))

    @property
    def row_sums(self) -> Array:
        return np.ones(2)


def test_a_step_of_newton_is_a_quadratic_bulk() -> None:
    """A problem may have any bulk; its linearisations are solved by hand, and by the solver."""
    law = ContactLaw(hv.Signorini())
    linear = DiscreteProblem.of_arrays(np.eye(2), [1.0, 1.0], [[1.0, 0.0]], [1.0], [0.2], law)
    problem = linear.with_(bulk=Hardening())
    with pytest.raises(hv.errors.ProblemError, match="Hardening"):
        problem.stiffness  # noqa: B018 - it has none
    u = np.zeros(2)
    for _ in range(8):
        H = problem.bulk.hessian(u)
        u = hv.solve(problem.with_(bulk=Quadratic(H), load=H @ u + problem.out_of_balance(u))).unknowns
    assert u[0] == pytest.approx(0.2, abs=1e-12)
    assert u[1] + u[1] ** 3 == pytest.approx(1.0, rel=1e-12)
    assert problem.energy(u) == pytest.approx(Hardening().value(u) - u.sum())
    np.testing.assert_allclose(hv.solve(problem).raise_for_status().unknowns, u, rtol=1e-9)


def corner() -> DiscreteProblem:
    """A square pressed into a corner, with contact points on two boundaries that share a node."""
    contact = {"bottom": hv.Contact(hv.Compliance(5.0)), "left": hv.Contact(hv.Compliance(2.0))}
    statement = bodies.square(contact, 4, lame=(1.0, 1.0), supports={"top": hv.Prescribed((-0.1, -0.1))})
    return hv.discretize(statement)


def test_contact_points_know_their_node_and_boundary() -> None:
    problem = corner()
    contact, field = problem.contact, problem.field
    assert field is not None
    assert contact.names == ("bottom", "left")
    bottom, left = contact.on("bottom"), contact.on("left")
    assert sorted([*bottom, *left]) == list(range(contact.count))
    assert contact.points is not None
    np.testing.assert_array_equal(field.nodes[contact.node], contact.points)
    np.testing.assert_array_equal(contact.points[bottom, 1], 0.0)
    np.testing.assert_array_equal(contact.points[left, 0], 0.0)
    shared = set(contact.node[bottom]) & set(contact.node[left])
    assert [tuple(field.nodes[node]) for node in shared] == [(0.0, 0.0)]
    some = contact.take(left)
    assert some.count == len(left)
    np.testing.assert_array_equal(
        some.trace_of(np.ones(problem.unknowns)), contact.trace_of(np.ones(problem.unknowns))[left]
    )
    with pytest.raises(hv.errors.ProblemError, match=r"no contact boundary .right. \(known: .bottom., .left."):
        contact.on("right")


def test_midpoints_know_their_facet() -> None:
    statement = bodies.square(
        hv.Compliance(5.0),
        4,
        lame=(1.0, 1.0),
        supports={"top": hv.Clamped()},
        quadrature=hv.mechanics.Quadrature.MIDPOINT,
    )
    problem = hv.discretize(statement)
    contact = problem.contact
    assert (contact.node == -1).all()
    facets = statement.mesh.boundaries["bottom"][contact.facet]
    np.testing.assert_allclose(statement.mesh.points[facets].mean(axis=1), contact.points)


def test_what_contact_points_refuse() -> None:
    contact = corner().contact
    for change, words in (
        ({"boundary": np.full(contact.count, 2)}, "not indices into names"),
        ({"node": np.zeros(3)}, "node has shape"),
        ({"weights": -contact.weights}, "every weight must be positive"),
    ):
        with pytest.raises(hv.errors.ProblemError, match=words):
            dataclasses.replace(contact, **change)  # type: ignore[arg-type]


def test_a_field_adds_what_is_prescribed() -> None:
    n = MESH.number_of_nodes
    given = np.arange(2.0 * n)
    field = Field(MESH, 1, sp.csr_array(sp.eye_array(2 * n, format="csc")[:, :3]), given)
    assert (field.components, field.number_of_nodes) == (2, n)
    np.testing.assert_array_equal(field.full(np.zeros(3)), given.reshape(n, 2))
    np.testing.assert_array_equal(field.full(np.array([0.0, 1.0, 0.0]))[0], [0.0, 2.0])
    np.testing.assert_array_equal(field.restrict(field.full(np.array([3.0, 4.0, 5.0]))), [3.0, 4.0, 5.0])


def test_sums_of_many_rows() -> None:
    n = 3 * (1 << 15) + 5  # more than are summed at a time
    K = sp.diags_array([-1.0, 2.5, -1.0], offsets=(-1, 0, 1), shape=(n, n)).tocsr()
    np.testing.assert_array_equal(Quadratic(K).row_sums, abs(K).sum(axis=1))


def test_a_problem_of_arrays_has_no_energy_at_rest_and_checks_its_matrix() -> None:
    law = ContactLaw(hv.Signorini())
    given = ([1.0, 0.0], [[1.0, 0.0]], [1.0], [0.2], law)
    assert DiscreteProblem.of_arrays(np.eye(2), *given).energy(np.zeros(2)) == 0.0
    skew = np.array([[1.0, 0.1], [0.0, 1.0]])
    for make in (lambda: DiscreteProblem.of_arrays(skew, *given), lambda: Quadratic(skew)):  # type: ignore[arg-type]
        with pytest.raises(hv.errors.ProblemError, match="not symmetric"):
            make()


def test_the_residual_of_another_bulk() -> None:
    """At the solution by hand it vanishes; beside it, it is the force that is out of balance."""
    linear = DiscreteProblem.of_arrays(np.eye(2), [1.0, 1.0], [[1.0, 0.0]], [1.0], [0.2], ContactLaw(hv.Signorini()))
    problem = linear.with_(bulk=Hardening())
    free = np.roots([1.0, 0.0, 1.0, -1.0])
    y = float(free[np.abs(free.imag) < 1e-12].real[0])
    lam = np.array([[1.0 - 0.2 - 0.2**3]])
    at = hv.discrete.residual(problem, np.array([0.2, y]), lam)
    assert at.total <= at.rounding
    beside = hv.discrete.residual(problem, np.array([0.2, y + 0.1]), lam)
    assert beside.total == pytest.approx(0.1 + (y + 0.1) ** 3 - y**3)
    assert beside.scale == pytest.approx(np.sqrt(2.0))
    # rounding of sums: eight units of (1 + 3 u^2) |u| + |f|
    moved = np.array([0.2 * 1.12 + 1.0, y * (1.0 + 3.0 * y**2) + 1.0])
    assert at.rounding == pytest.approx(8.0 * np.finfo(float).eps * np.linalg.norm(moved), abs=0.0)


def test_a_component_that_is_held_borrows_the_largest_compliance() -> None:
    from hemivar.discrete.residual import contact_compliance

    problem = DiscreteProblem.of_arrays(
        np.diag([100.0, 50.0]), [0.0, 0.0], [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [0.0, 0.0]], [1.0, 2.0], [0.0, 0.0],
        ContactLaw(hv.Signorini()),
    )  # fmt: skip
    np.testing.assert_allclose(contact_compliance(problem), [[0.01, 0.02], [0.04, 0.04]])


def test_the_first_diagonal_entry_that_is_not_positive_is_named() -> None:
    with pytest.raises(hv.errors.ProblemError, match=r"stiffness\[1, 1\] = -2"):
        Quadratic(np.diag([1.0, -2.0, 3.0, -4.0]))


def test_the_energy_beyond_the_end_of_a_law_is_infinite_but_for_rounding() -> None:
    law = ContactLaw(hv.Signorini())
    problem = DiscreteProblem.of_arrays(np.eye(1), [1.0], [[1.0]], [1.0], [0.25], law)
    assert problem.energy(np.array([0.25 * (1.0 + 1e-14)])) == pytest.approx(0.5 * 0.25**2 - 0.25)
    assert problem.energy(np.array([0.25 * (1.0 + 1e-9)])) == np.inf
    assert problem.energy(np.array([-0.1])) == pytest.approx(0.5 * 0.1**2 + 0.1)


def test_a_boundary_that_supports_hold_is_known_all_the_same() -> None:
    statement = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), (1, 2), pattern="cross"),  # one facet, with both ends held
        hv.Material.lame(1.0, 1.0),
        supports={"left": hv.Clamped(), "right": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.Compliance(5.0))},
        body_force=(0.0, -1.0),
    )
    solution = hv.solve(statement)
    assert solution.problem.contact_points == 0
    bottom = solution.on("bottom")
    assert (len(bottom.index), bottom.normal_force, bottom.contact_length) == (0, 0.0, 0.0)
