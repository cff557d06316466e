"""Matrices of a body in time: mass, viscosity, branches, the bedding, and what moved supports take of them."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from skfem.helpers import ddot, dot, sym_grad, trace

from hemivar.certificates import smallness
from hemivar.certificates.smallness import trace_constants
from hemivar.discrete import DiscreteProblem
from hemivar.discrete.operator_family import Composition
from hemivar.discrete.operators import Multiple, Operator
from hemivar.errors import ProblemError, SupportError
from hemivar.fem import discretize
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.dynamics import body_family
from hemivar.fem.hierarchy import coarser
from hemivar.fem.mass import bedding_share, inertia, mass_matrix, per_volume
from hemivar.fem.reactions import support_reactions
from hemivar.laws import Compliance, Softening, Tresca
from hemivar.laws.memory import Secant
from hemivar.mechanics import Branch, Clamped, Contact, ContactProblem, Fixed, Material, Prescribed, Roller
from hemivar.mesh import Mesh, box, rectangle
from hemivar.solvers import Controls, NonsmoothMultigrid, NonsmoothNewton, Status, solve
from tests import bodies

from ..mesh.meshes import cube, distorted
from .library import library_matrix

MESHES: dict[str, Callable[[], Mesh]] = {
    "cross": lambda: distorted(rectangle((2, 1), (6, 3), "cross")),
    "turned": lambda: rectangle((1, 1), 5).rotated(0.4),
    "cube": lambda: distorted(cube(3)),
}


def assembled(mesh: Mesh, order: int, lam: object, mu: object, density: object, degree: int = 8) -> sp.csr_array:
    """``int lam tr eps(u) tr eps(v) + 2 mu eps(u) : eps(v) + density u . v`` by scikit-fem alone, in our numbering."""

    def at(value: object, x: np.ndarray) -> object:
        return value(np.moveaxis(x, 0, -1)) if callable(value) else value

    def form(u: Any, v: Any, w: Any) -> Any:
        e, d = sym_grad(u), sym_grad(v)
        elastic = at(lam, w.x) * trace(e) * trace(d) + 2 * at(mu, w.x) * ddot(e, d)
        return elastic + at(density, w.x) * dot(u, v)

    return library_matrix(mesh, order, form, degree)


def density(x: np.ndarray) -> np.ndarray:
    return np.asarray(2.0 + 0.3 * x[..., 0] - 0.2 * x[..., 1])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("varying", [False, True], ids=["constant", "varying"])
@pytest.mark.parametrize("name", MESHES)
def test_mass_equals_the_library(name: str, varying: bool, order: int) -> None:
    mesh = MESHES[name]()
    given = density if varying else 2.5
    M = mass_matrix(mesh, per_volume(given, "density"), order)
    reference = assembled(mesh, order, 0.0, 0.0, given)
    assert abs(M - reference).max() < 1e-13 * abs(reference).max()
    assert abs(M - M.T).max() < 1e-16


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", MESHES)
def test_mass_of_a_body(name: str, order: int) -> None:
    """Unit translations: the mass, which for a density that is linear is that at the middle of each cell."""
    mesh = MESHES[name]()
    M = mass_matrix(mesh, inertia(Material.lame(1, 1, density=density)), order)
    mass = float(mesh.volumes @ density(mesh.points[mesh.cells].mean(axis=1)))
    for c in range(mesh.dim):
        for e in range(mesh.dim):
            u, v = (np.tile(np.eye(mesh.dim)[k], len(mesh.nodes(order))) for k in (c, e))
            assert abs(u @ (M @ v) - (mass if c == e else 0.0)) < 1e-13 * mass


def two_regions(mesh: Mesh) -> Mesh:
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.5
    return replace(mesh, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})


@pytest.mark.parametrize("order", [1, 2])
def test_mass_by_region(order: int) -> None:
    mesh = two_regions(rectangle((1.5, 1.0), (6, 4)))
    material = Material.by_region(
        {"left": Material.lame(1, 1, density=2.0), "right": Material.lame(1, 1, density=lambda x: 1 + x[:, 1])}
    )
    M = mass_matrix(mesh, inertia(material), order)
    up = np.tile([0.0, 1.0], len(mesh.nodes(order)))
    assert abs(up @ (M @ up) - (0.5 * 2.0 + 1.0 * 1.5)) < 1e-13


def test_many_cells_go_by_portions() -> None:
    mesh = rectangle(cells=(130, 70))
    assert mesh.number_of_cells > 1 << 14
    reference = assembled(mesh, 1, 0.0, 0.0, density, 4)
    assert abs(mass_matrix(mesh, per_volume(density, "density")) - reference).max() < 1e-13 * abs(reference).max()


def moving(mesh: Mesh, order: int = 1, **changes: object) -> ContactProblem:
    """A body with everything that time asks for: supports that move, oblique rollers, contact."""
    parts: dict[str, object] = {
        "material": Material.lame(
            3.0,
            lambda x: 2.0 + 0.1 * x[:, 0],
            density=density,
            viscosity=(0.3, 0.4),
            branches=[Branch(lame=(2.0, lambda x: 1.0 + 0.2 * x[:, 1]), time=0.5), Branch(lame=(0.0, 1.0), time=0.1)],
        ),
        "contact": {"bottom": Contact(Compliance(2.0), Tresca(0.1))},
        "supports": {"top": Prescribed(lambda x: 0.01 + 0.02 * x), "left": Fixed(x=lambda x: 0.01 + 0.02 * x[:, 0])},
        "order": order,
    }
    return ContactProblem(mesh=mesh, **parts | changes)  # type: ignore[arg-type]


def three_dimensional_or_second_order() -> list[object]:
    return [
        pytest.param(lambda: distorted(rectangle((2, 1), (6, 3), "cross")), 1, id="plane"),
        pytest.param(lambda: rectangle((2, 1), (4, 2)).rotated(0.3), 1, id="turned"),
        pytest.param(lambda: distorted(rectangle((2, 1), (4, 2))), 2, id="second order"),
        pytest.param(lambda: rectangle((2, 1), (4, 2)).rotated(0.3), 2, id="turned, second order"),
        pytest.param(lambda: distorted(cube(3)), 1, id="space"),
    ]


@pytest.mark.parametrize(("make", "order"), three_dimensional_or_second_order())
def test_matrices_are_those_of_the_full_body(make: Callable[[], Mesh], order: int) -> None:
    """``U = P u + E z`` in matrices of all nodal components, by scikit-fem alone."""
    problem = moving(make(), order)
    discrete = discretize(problem)
    matrices = body_family(problem)
    field = discrete.field
    assert field is not None
    mesh = problem.mesh
    E = sp.eye_array(field.prescribed.size, format="csc")[:, matrices.moved]
    assert not np.delete(field.prescribed, matrices.moved).any()
    assert np.isin(np.flatnonzero(field.prescribed), matrices.moved).all()
    mu, mu_short = (lambda x: 2.0 + 0.1 * x[..., 0]), (lambda x: 1.0 + 0.2 * x[..., 1])
    expected = {
        "stiffness": (matrices.stiffness, assembled(mesh, order, 3.0, mu, 0.0)),
        "viscosity": (matrices.viscosity, assembled(mesh, order, 0.3, 0.4, 0.0)),
        "mass": (matrices.mass, assembled(mesh, order, 0.0, 0.0, density)),
        "short": (matrices.branches[0][1], assembled(mesh, order, 0.0, 1.0, 0.0)),
        "long": (matrices.branches[1][1], assembled(mesh, order, 2.0, mu_short, 0.0)),
    }
    assert [time for time, _ in matrices.branches] == [0.1, 0.5]
    for name, (part, full) in expected.items():
        assert part is not None
        scale = abs(full).max()
        for mine, theirs in (
            (part.inner, field.basis.T @ full @ field.basis),
            (part.coupling, field.basis.T @ full @ E),
            (part.held, E.T @ full @ E),
        ):
            assert abs(mine - theirs).max() < 1e-13 * scale, name
        rng = np.random.default_rng(2)
        u, z = rng.standard_normal(discrete.unknowns), rng.standard_normal(len(matrices.moved))
        U = field.basis @ u + E @ z
        x = np.concatenate([u, z])
        assert abs(part.energy(x) - 0.5 * U @ (full @ U)) < 1e-12 * scale * (U @ U)
        forces = np.concatenate([field.basis.T @ (full @ U), E.T @ (full @ U)])
        np.testing.assert_allclose(part.times(x), forces, atol=1e-12 * scale)


@pytest.mark.parametrize(("make", "order"), three_dimensional_or_second_order())
def test_all_matrices_share_one_sparsity(make: Callable[[], Mesh], order: int) -> None:
    problem = moving(make(), order)
    discrete = discretize(problem)
    matrices = body_family(problem, discrete)
    K = discrete.stiffness
    assert matrices.stiffness.inner is K
    assert matrices.viscosity is not None
    assert matrices.mass is not None
    step = matrices.combined(1.0, 4.0, (2.0, 3.0))
    assert step.indices is K.indices
    assert step.indptr is K.indptr
    rows = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    for part in (matrices.viscosity, matrices.mass, *(part for _, part in matrices.branches)):
        if part.places is None:
            assert part.inner.indices is K.indices
            assert part.inner.indptr is K.indptr
            continue
        entries = part.inner.tocoo()
        assert np.array_equal(K.indices[part.places], entries.col)
        assert np.array_equal(rows[part.places], entries.row)
    alone = body_family(problem).stiffness.inner
    assert np.array_equal(alone.indices, K.indices)
    assert np.array_equal(alone.indptr, K.indptr)
    assert abs(alone - K).max() == 0.0


def summed(problem: ContactProblem, a: float, g: tuple[float, ...], b: float) -> ContactProblem:
    """A problem at rest whose tensor and bedding are the sums that a step in time asks for."""
    material, own = problem.material, problem.bedding
    assert not callable(own)

    def tensor(x: np.ndarray) -> np.ndarray:
        total = material.stiffness_tensor(x) + a * material.viscosity_tensor(x)
        return np.asarray(total + sum(share * material.branch_tensor(i, x) for i, share in enumerate(g)))

    def bedding(x: np.ndarray) -> np.ndarray:
        mass = material.density_at(x)
        assert mass is not None
        return np.asarray(own + b * mass)

    return replace(problem, material=Material.tensor(tensor), bedding=bedding)


@pytest.mark.parametrize(("make", "order"), three_dimensional_or_second_order())
def test_the_matrix_of_a_step_is_that_of_the_summed_tensors(make: Callable[[], Mesh], order: int) -> None:
    problem = moving(make(), order, bedding=0.7)
    matrices = body_family(problem)
    a, g, b = 7.0, (0.3, 0.6), 11.0
    discrete = discretize(summed(problem, a, g, b))
    K = discrete.stiffness
    assert matrices.viscosity is not None
    assert matrices.mass is not None
    parts = [(1.0, matrices.stiffness), (a, matrices.viscosity), (b, matrices.mass)]
    parts += [(share, part) for share, (_, part) in zip(g, matrices.branches, strict=True)]
    whole = sum(factor * part.inner.toarray() for factor, part in parts)
    scale = np.abs(whole).max()
    assert np.abs(K.toarray() - whole).max() < 1e-14 * scale
    step = matrices.combined(a, b, g)
    assert np.array_equal(step.indices, K.indices)
    assert np.array_equal(step.indptr, K.indptr)
    assert np.abs(step.toarray() - whole).max() < 1e-14 * scale
    coupling, held = (
        sum(factor * getattr(part, name).toarray() for factor, part in parts) for name in ("coupling", "held")
    )
    field = discrete.field
    assert field is not None
    assert discrete.model.resisted
    assert discrete.model.free_motions.count == 0
    z = field.prescribed[matrices.moved]
    np.testing.assert_allclose(discrete.load, -(coupling @ z), atol=1e-13 * scale)
    assert abs(discrete.constant - 0.5 * z @ (held @ z)) < 1e-13 * scale


def in_step(problem: ContactProblem, *factors: Any) -> DiscreteProblem:
    """The body of a step in time."""
    family = body_family(problem)
    base = family.problem
    return base.fitted(Composition(family, *factors).model(True))


@pytest.mark.parametrize(
    "make", [lambda: rectangle((2, 1), (4, 2)).refined(2), lambda: cube(2).refined()], ids=["plane", "space"]
)
def test_coarser_levels_of_a_step_are_combined_of_those_of_the_body(make: Callable[[], Mesh]) -> None:
    """On every level the sum of the matrices there, whose sparsity is that of the elastic body."""
    problem = moving(make(), bedding=0.7)
    step, elastic = in_step(problem, 3.0, 10.0, (0.5, 0.25), 2.0), discretize(problem)
    mesh, levels = problem.mesh, 0
    while mesh.parent is not None:
        mesh = mesh.parent.mesh
        below, static = coarser(step), coarser(elastic)
        assert below is not None
        assert static is not None
        there = body_family(problem.on(mesh))
        assert there.viscosity is not None
        assert there.mass is not None
        parts = [(1.0, there.stiffness), (3.0, there.viscosity), (10.0, there.mass)]
        parts += [(share, part) for share, (_, part) in zip((0.5, 0.25), there.branches, strict=True)]
        whole = 2.0 * sum(factor * part.inner.toarray() for factor, part in parts)
        K = below.problem.stiffness
        assert np.abs(K.toarray() - whole).max() < 1e-14 * np.abs(whole).max()
        assert np.array_equal(K.indices, static.problem.stiffness.indices)
        assert abs(below.prolongation - static.prolongation).max() == 0.0
        assert below.problem.model.free_motions.count == 0
        assert below.problem.field is not None
        assert not below.problem.field.prescribed.any()
        step, elastic, levels = below.problem, static.problem, levels + 1
    assert levels > 0


def test_nothing_is_assembled_for_another_length_of_step(monkeypatch: pytest.MonkeyPatch) -> None:
    family = body_family(moving(rectangle((2, 1), (4, 2)).refined(2)))

    def levels(*factors: float) -> list[DiscreteProblem]:
        found = [family.problem.fitted(Composition(family, *factors).model(True))]
        while (below := coarser(found[-1])) is not None:
            found.append(below.problem)
        return found

    first = levels(3.0, 10.0)
    for module, name in (("hierarchy", "coarse_problem"), ("mass", "stiffness_blocks"), ("dynamics", "mass_blocks")):
        monkeypatch.setattr(importlib.import_module(f"hemivar.fem.{module}"), name, None)
    second = levels(6.0, 40.0)
    assert len(second) == len(first) >= 3
    for one, other in zip(first, second, strict=True):
        assert one.stiffness.shape == other.stiffness.shape
        assert abs(one.stiffness - other.stiffness).max() > 1.0


def test_a_viscosity_in_proportion_to_the_stiffness_is_not_stored_again() -> None:
    """Also with supports that move, and where a bedding makes them differ it is."""
    material = Material.lame(3.0, 2.0, viscosity=(0.3, 0.2), branches=[Branch(lame=(6.0, 4.0), time=1.0)])
    for changes in ({}, {"bedding": 2.0}):
        family = body_family(moving(rectangle((2, 1), (4, 2)), material=material, **changes))
        assert family.viscosity is not None
        assert isinstance(family.viscosity, Multiple) is not bool(changes)
        assert isinstance(family.branches[0][1], Multiple) is not bool(changes)
        plain = Material.lame(3.0, 2.0)
        one = body_family(moving(rectangle((2, 1), (4, 2)), material=plain)).stiffness
        x = np.cos(np.arange(one.unknowns + len(family.moved)))
        for part, factor in ((family.viscosity, 0.1), (family.branches[0][1], 2.0)):
            np.testing.assert_allclose(part.times(x), factor * one.times(x), rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(part.row_sums, factor * one.row_sums, rtol=1e-12)
            assert part.energy(x) == pytest.approx(factor * one.energy(x))
            for name in ("inner", "coupling", "held"):
                difference = abs(getattr(part, name) - factor * getattr(one, name)).max() if part.held.nnz else 0.0
                assert difference < 1e-13
        step = family.combined(7.0, 0.0, (0.5,)) - family.stiffness.inner
        assert abs(step - (0.7 + 1.0) * one.inner).max() < 1e-12


def test_a_multiple_is_one_where_supports_move_as_well() -> None:
    K, coupling, held = (sp.csr_array(np.array(a)) for a in ([[2.0, -1.0], [-1.0, 2.0]], [[-1.0], [0.0]], [[3.0]]))
    base = Operator(K, coupling, held)
    assert Operator(3.0 * K, 3.0 * coupling, 3.0 * held).multiple_of(base) == 3.0
    assert Operator(3.0 * K, 3.0 * coupling, 2.0 * held).multiple_of(base) is None
    assert Operator(3.0 * K, 2.0 * coupling, 3.0 * held).multiple_of(base) is None


@pytest.mark.parametrize("dim", [2, 3])
def test_a_mass_takes_the_memory_of_one_component(dim: int) -> None:
    problem = ContactProblem(
        rectangle(cells=(8, 8)) if dim == 2 else box(cells=3), Material.lame(1.0, 1.0, density=2.0)
    )
    family = body_family(problem)
    assert family.mass is not None
    assert family.mass.inner.nnz * dim == family.stiffness.inner.nnz


def test_supports_that_do_not_move_couple_to_nothing() -> None:
    problem = moving(rectangle(), supports={"left": Clamped(), "top": Roller(), "right": Fixed(x=0.0)})
    matrices = body_family(problem)
    assert matrices.moved.size == 0
    assert matrices.stiffness.coupling.shape == (matrices.stiffness.unknowns, 0)
    assert matrices.stiffness.held.shape == (0, 0)


def test_an_oblique_roller_beside_a_support_that_moves() -> None:
    """At the corner the displacement along y follows from that along x; both count as moved."""
    mesh = rectangle((1, 1), 3).rotated(0.3)
    problem = moving(mesh, supports={"top": Roller(), "left": Fixed(x=0.1)}, contact={})
    discrete = discretize(problem, check_coercivity=False)
    assert discrete.field is not None
    moved = body_family(problem).moved
    assert np.isin(np.flatnonzero(discrete.field.prescribed), moved).all()
    assert len(moved) == 5  # x of the four nodes of the left side, and y of its upper one


def test_what_a_body_does_not_have_is_none() -> None:
    matrices = body_family(moving(rectangle(), material=Material.lame(1.0, 1.0)))
    assert matrices.viscosity is None
    assert matrices.mass is None
    assert matrices.branches == ()
    with pytest.raises(ProblemError, match="no inertia"):
        inertia(Material.lame(1.0, 1.0))


def test_statics_is_not_touched() -> None:
    """A material for time has the same static solution, and the same stiffness entry by entry."""
    for order in (1, 2):
        full = moving(rectangle((2, 1), (4, 2)), order)
        plain = replace(full, material=Material.lame(3.0, lambda x: 2.0 + 0.1 * x[:, 0]))
        one, other = discretize(full), discretize(plain)
        assert abs(one.stiffness - other.stiffness).max() == 0.0
        np.testing.assert_array_equal(one.load, other.load)


# ---- bedding ------------------------------------------------------------------------------------------------


def floating(mesh: Mesh, **changes: object) -> ContactProblem:
    """A body that nothing but its bedding holds, over a foundation that softens and pulls at it."""
    dim = mesh.dim
    parts: dict[str, object] = {
        "material": Material.lame(40.0, 40.0),
        "contact": {"bottom": Contact(Softening(10.0, 0.05, 2.0), Tresca(0.05))},
        "body_force": (0.3, -0.5, -0.8)[-dim:],
        "bedding": 3.0,
    }
    return ContactProblem(mesh=mesh, **parts | changes)  # type: ignore[arg-type]


def test_uniform_displacement_of_a_bedded_body() -> None:
    """Without contact the body moves by force over bedding, and does not deform."""
    for order in (1, 2):
        problem = floating(rectangle((2, 1), (4, 2)), contact={}, order=order, bedding=lambda x: np.full(len(x), 3.0))
        solution = solve(discretize(problem))
        np.testing.assert_allclose(
            solution.displacement, np.tile([-0.5 / 3, -0.8 / 3], (len(solution.displacement), 1))
        )


@pytest.mark.parametrize(
    "make", [lambda: rectangle((1, 1), 8, "cross").refined(), lambda: box(cells=2).refined()], ids=["plane", "space"]
)
def test_every_method_solves_a_floating_body(make: Callable[[], Mesh]) -> None:
    problem = discretize(floating(make()))
    controls = Controls(rtol=1e-11)
    newton = solve(problem, NonsmoothNewton(), controls=controls)
    multigrid = solve(problem, NonsmoothMultigrid(), controls=controls)
    assert newton.status is Status.CONVERGED
    assert multigrid.status is Status.CONVERGED
    assert np.abs(newton.displacement - multigrid.displacement).max() < 1e-8 * np.abs(newton.displacement).max()
    assert np.any(newton.penetration > 0.0)
    # equilibrium of forces: loads, foundation and bedding
    assert problem.field is not None
    M = mass_matrix(problem.field.mesh, per_volume(3.0, "bedding"))
    resisted = (M @ newton.displacement.ravel()).reshape(newton.displacement.shape).sum(axis=0)
    stated = problem.origin
    assert stated is not None
    pushed = -(problem.contact.weights[:, None] * problem.contact.global_vectors(newton.multiplier)).sum(axis=0)
    np.testing.assert_allclose(np.asarray(stated.body_force) + pushed, resisted, atol=1e-8)


def test_certificate_of_a_floating_body() -> None:
    """The margin is one less the largest eigenvalue of (B'W alpha B, K), found here by dense matrices."""
    import scipy.linalg

    problem = discretize(floating(rectangle((1, 1), 4)))
    law = problem.law
    alpha = np.zeros((problem.contact_points, 2))
    alpha[:, 0] = law.normal.weak_convexity
    B = problem.contact.trace.toarray()
    S = B.T @ ((problem.contact.weights[:, None] * alpha).ravel()[:, None] * B)
    top = float(scipy.linalg.eigh(S, problem.stiffness.toarray(), eigvals_only=True)[-1])
    assert abs(smallness(problem).margin - (1.0 - top)) < 1e-8
    stronger = smallness(discretize(floating(rectangle((1, 1), 4), bedding=300.0)))
    assert stronger.margin > 1.0 - top


def test_trace_constant_takes_no_notice_of_the_bedding() -> None:
    mesh = rectangle((1, 1), 6)
    held = {"left": Clamped()}
    constants = [
        smallness(discretize(floating(mesh, supports=held, bedding=b)), trace_constant=True).trace_constant
        for b in (0.0, 50.0)
    ]
    assert constants[0] is not None
    assert constants[0] == pytest.approx(constants[1])


@pytest.mark.parametrize("order", [1, 2])
def test_reactions_with_a_bedding(order: int) -> None:
    """Loads, foundation, supports and bedding are in balance."""
    problem = floating(
        rectangle((2, 1), (6, 3)),
        supports={"left": Prescribed((0.01, -0.02))},
        order=order,
        bedding=lambda x: 3 + x[:, 0],
    )
    discrete = discretize(problem)
    solution = solve(discrete, controls=Controls(rtol=1e-12))
    reaction = support_reactions(discrete, solution.displacement, solution.multiplier)["left"]
    M = mass_matrix(problem.mesh, per_volume(lambda x: 3 + x[:, 0], "bedding"), order)
    resisted = (M @ solution.displacement.ravel()).reshape(solution.displacement.shape).sum(axis=0)
    pushed = -(discrete.contact.weights[:, None] * discrete.contact.global_vectors(solution.multiplier)).sum(axis=0)
    np.testing.assert_allclose(2.0 * np.asarray(problem.body_force) + pushed + reaction, resisted, atol=1e-9)


def islands(bedding: Callable[[np.ndarray], np.ndarray]) -> ContactProblem:
    """Two separate squares, the right one above no foundation."""
    one = rectangle((1, 1), 3)
    shift = np.array([2.0, 0.0])
    mesh = Mesh(
        np.concatenate([one.points, one.points + shift]),
        np.concatenate([one.cells, one.cells + len(one.points)]),
        {"left": one.boundaries["left"]},
    )
    return bodies.body(mesh, lame=(1, 1), body_force=(0.0, -1.0), bedding=bedding)


def test_every_part_must_be_bedded() -> None:
    assert solve(discretize(islands(lambda x: np.where(x[:, 0] > 1.5, 2.0, 1.0)))).status is Status.CONVERGED
    with pytest.raises(SupportError, match="part 2 of 2"):
        discretize(islands(lambda x: np.where(x[:, 0] > 1.5, 0.0, 1.0)))
    with pytest.raises(SupportError, match="free to move"):
        discretize(floating(rectangle(), contact={}, bedding=0.0))


def test_a_bedding_lost_in_rounding_is_warned_of() -> None:
    hard = Material.lame(40e14, 40e14)
    for lost in (floating(rectangle(), contact={}, bedding=1e-16), floating(rectangle(), material=hard, bedding=1.0)):
        discrete = discretize(lost)
        assert discrete.model.free_motions.count == 0
        assert "lose about 16 of 16 digits" in discrete.warnings[-1]
    soft = discretize(floating(rectangle(), contact={}, material=Material.lame(4e-16, 4e-16), bedding=1e-16))
    assert soft.model.free_motions.count == 0
    assert not soft.warnings


def test_units_do_not_matter() -> None:
    """N, mm, MPa and tonnes against N, m, Pa and kg: the same step in time of the same body."""

    def step(length: float, force: float, mass: float) -> DiscreteProblem:
        pressure = force / length**2
        body = Material.lame(
            3e6 * pressure,
            2e6 * pressure,
            density=1200.0 * mass / length**3,
            viscosity=(1e3 * pressure, 2e3 * pressure),
            branches=[Branch(lame=(1e6 * pressure, 1e6 * pressure), time=0.3)],
        )
        problem = bodies.strip(
            Contact(Compliance(1e6 * force / length**3), Tresca(1e2 * pressure)),
            (6, 3),
            size=(2.0 * length, length),
            material=body,
            supports={},
            body_force=(2e4 * force / length**3, -9e4 * force / length**3),
        )
        return discretize(summed(problem, 1e3, (0.9,), 1e6))

    metres, millimetres = step(1.0, 1.0, 1.0), step(1e3, 1.0, 1e-3)
    one, other = solve(metres), solve(millimetres)
    assert one.status is Status.CONVERGED
    assert other.status is Status.CONVERGED
    np.testing.assert_allclose(other.displacement, 1e3 * one.displacement, rtol=1e-8, atol=1e-12)
    assert smallness(metres).margin == pytest.approx(smallness(millimetres).margin, rel=1e-8)
    K, L = metres.stiffness, millimetres.stiffness
    np.testing.assert_allclose(L.data, 1e-6 * K.data, rtol=1e-12, atol=1e-12 * abs(L).max())


def test_stiffness_of_the_unbedded_body_is_the_old_one() -> None:
    mesh = rectangle((2, 1), (4, 2))
    problem = floating(mesh, supports={"left": Clamped()}, bedding=0.0)
    discrete = discretize(problem)
    assert discrete.field is not None
    assert not discrete.model.resisted
    full = stiffness_matrix(mesh, problem.material)
    reduced = discrete.field.basis.T @ full @ discrete.field.basis
    assert abs(discrete.stiffness - reduced).max() < 1e-15 * abs(full).max()


def test_the_coarser_level_of_a_problem_with_damping_and_memory() -> None:
    contact = {"bottom": Contact(Compliance(2.0), damping=Compliance(1.0), memory=(Secant(),))}
    problem = moving(rectangle((2, 1), (4, 2)).refined(), contact=contact)
    assert coarser(in_step(problem, 3.0, 2.0)) is not None


def test_trace_constant_of_large_bodies_takes_no_notice_of_the_bedding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies that are not factorised are discretised anew for it: without their bedding, whatever their contact."""
    contact = {"bottom": Contact(Softening(10.0, 0.05, 2.0), damping=Compliance(1.0))}
    mesh = rectangle((1, 1), 8).refined(2)
    stated = floating(mesh, supports={"left": Clamped()}, bedding=5e4, contact=contact)
    problem = discretize(stated, evolving=True)
    exact = trace_constants(problem).both
    module = importlib.import_module("hemivar.certificates.smallness")
    monkeypatch.setattr(module, "factorises", lambda problem: False)
    assert trace_constants(problem).both == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    ("rho", "tip", "energies"),
    [
        (1.0, (0.20666963, 0.89704124), (0.083057848838, 0.060053022992, 0.047717078193, 0.005834053104)),
        (0.0, (0.2371944, 1.01936226), None),
    ],
    ids=["with mass", "without"],
)
def test_implicit_euler_of_a_viscoelastic_block(
    rho: float, tip: tuple[float, float], energies: tuple[float, ...] | None
) -> None:
    """Known end and energies of a Kelvin-Voigt cantilever under a sudden load, by plain linear algebra."""
    import scipy.sparse.linalg as spla

    tau, steps = 0.1, 32
    body = Material.lame(4.0, 4.0, density=rho or None, viscosity=(4.0, 4.0))
    mesh = rectangle((2.5, 1.0), (5, 2), "cross")
    problem = ContactProblem(mesh=mesh, material=body, supports={"left": Clamped()}, body_force=(0.0, 0.2))
    discrete = discretize(problem)
    matrices = body_family(problem, discrete)
    assert matrices.viscosity is not None
    K, C, f = matrices.stiffness.inner, matrices.viscosity.inner, discrete.load
    M = sp.csr_array(K.shape) if matrices.mass is None else matrices.mass.inner
    solver = spla.splu(sp.csc_array(matrices.combined(1 / tau, rho / tau**2)))
    u, v = np.zeros(len(f)), np.zeros(len(f))
    viscous = numerical = 0.0
    for _ in range(steps):
        new = solver.solve(f + C @ u / tau + M @ (u / tau**2 + v / tau))
        du, dv = new - u, (new - u) / tau - v
        viscous += float(du @ (C @ du)) / tau
        numerical += 0.5 * float(du @ (K @ du)) + 0.5 * float(dv @ (M @ dv))
        u, v = new, v + dv
    assert discrete.field is not None
    corner = int(np.flatnonzero((mesh.points == (2.5, 0.0)).all(axis=1))[0])
    np.testing.assert_allclose(discrete.field.full(u)[corner], tip, atol=1e-8)
    if energies is not None:
        found = (0.5 * float(u @ (K @ u)), viscous, 0.5 * float(v @ (M @ v)), numerical)
        np.testing.assert_allclose(found, energies, atol=1e-11)
        assert float(f @ u) == pytest.approx(sum(energies), abs=1e-10)


def test_a_mass_of_one_density_adds_up_to_it() -> None:
    """Entries of the mass matrix add up to density times volume, by component."""
    density = inertia(Material.lame(1, 1, density=17.0))
    mesh = rectangle((2.0, 1.0), 2)
    assert density.constant == 17.0
    found = mass_matrix(mesh, density, 1)
    one = mass_matrix(mesh, per_volume(1.0, "density"), 1)
    np.testing.assert_allclose(found.toarray(), 17.0 * one.toarray(), rtol=1e-12)
    assert found.sum() == pytest.approx(2 * 2.0 * 17.0)


@pytest.mark.parametrize("stiff", [0, 1])
def test_a_bedding_is_felt_beside_the_stiffest_direction(stiff: int) -> None:
    mesh, bedding = rectangle((1.0, 1.0), 2), per_volume(1.0, "bedding")
    diagonal = np.ones(mesh.points.shape)
    share = bedding_share(mesh, 1, bedding, diagonal)
    assert share > 0.0
    diagonal[:, stiff] = 1e20
    assert bedding_share(mesh, 1, bedding, diagonal) == pytest.approx(1e-20 * share)
    assert bedding_share(mesh, 1, per_volume(0.0, "bedding"), diagonal) == 0.0
