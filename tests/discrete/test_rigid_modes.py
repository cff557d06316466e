"""Bodies in several parts, and parts that hang together at a node or an edge: found, named, and held by contact."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from hemivar.discrete import rigid_modes as rigid
from hemivar.discrete.rigid_modes import admitted, rigid_basis
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Adhesive, Bilateral, Compliance, Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Roller
from hemivar.mesh import Mesh, box, rectangle
from hemivar.solvers import METHODS, NonsmoothMultigrid, Status, solve
from tests import bodies

MATERIAL = Material.lame(4.0, 4.0)
DOWN = (0.0, -0.5)


def joined(*meshes: Mesh, digits: int = 9) -> Mesh:
    """Meshes as one: nodes at one place become one node, boundaries are numbered."""
    points = np.vstack([mesh.points for mesh in meshes])
    first = np.cumsum([0, *(mesh.number_of_nodes for mesh in meshes)])
    _, keep, place = np.unique(np.round(points, digits), axis=0, return_index=True, return_inverse=True)
    place = place.ravel()
    cells = place[np.vstack([mesh.cells + start for mesh, start in zip(meshes, first, strict=False)])]
    boundaries = {
        f"{name}{i}": place[facets + start]
        for i, (mesh, start) in enumerate(zip(meshes, first, strict=False))
        for name, facets in mesh.boundaries.items()
    }
    return Mesh(points[keep], cells, boundaries)


def square_at(x: float, y: float, cells: int = 3, size: float = 1.0) -> Mesh:
    return rectangle((size, size), cells).moved(np.eye(2), (x, y))


def cube_at(x: float, y: float, z: float, cells: int = 2) -> Mesh:
    return box((1.0, 1.0, 1.0), (cells, cells, cells)).moved(np.eye(3), (x, y, z))


def kernel_size(problem: DiscreteProblem) -> int:
    """Dimension of the kernel of the stiffness, by its eigenvalues."""
    root = np.sqrt(problem.linear.diagonal)
    values = np.linalg.eigvalsh(problem.stiffness.toarray() / np.outer(root, root))
    assert not np.any((values > 1e-12) & (values < 1e-6))
    return int(np.count_nonzero(values < 1e-12))


SHAPES = {
    "one": (lambda: square_at(0, 0), 1),
    "apart": (lambda: joined(square_at(0, 0), square_at(2, 0)), 2),
    "at a corner": (lambda: joined(square_at(0, 0), square_at(1, 1)), 2),
    "chain": (lambda: joined(square_at(0, 0), square_at(1, 1), square_at(2, 0), square_at(3, 1)), 4),
    "ring": (lambda: joined(square_at(0, 0), square_at(1, 1), square_at(0, 2), square_at(-1, 1)), 4),
    "cubes apart": (lambda: joined(cube_at(0, 0, 0), cube_at(3, 0, 0)), 2),
    "at an edge": (lambda: joined(cube_at(0, 0, 0), cube_at(1, 1, 0)), 2),
    "at a vertex": (lambda: joined(cube_at(0, 0, 0), cube_at(1, 1, 1)), 2),
    "edge and vertex": (lambda: joined(cube_at(0, 0, 0), cube_at(1, 1, 0), cube_at(2, 2, 1)), 3),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("support", ["none", "clamped", "roller", "pin"])
@pytest.mark.parametrize("order", [1, 2])
def test_motions_are_the_kernel_of_the_stiffness(shape: str, support: str, order: int) -> None:
    mesh, count = SHAPES[shape][0](), SHAPES[shape][1]
    if mesh.dim == 3 and order == 2:
        pytest.skip("eigenvalues of a large dense matrix")
    rng = np.random.default_rng(4)
    turn = np.linalg.qr(rng.standard_normal((mesh.dim, mesh.dim)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    name = next(iter(name for name in mesh.boundaries if name.startswith("bottom")))
    kinds = {"none": {}, "clamped": {name: Clamped()}, "roller": {name: Roller()}, "pin": {name: Fixed(x=0.0)}}
    statement = ContactProblem(mesh.moved(turn), MATERIAL, {}, kinds[support], order=order)
    problem = discretize(statement, check_coercivity=False)
    assert problem.field is not None
    assert statement.mesh.parts.count == count
    found = problem.field.free_motions
    assert found.count == kernel_size(problem)
    unknowns = problem.field.basis.T @ found.motions
    if found.count:
        assert abs(problem.stiffness @ unknowns).max() < 1e-11 * abs(problem.stiffness).max()
        assert abs(problem.field.basis @ unknowns - found.motions).max() < 1e-9
        assert np.linalg.matrix_rank(unknowns.toarray()) == found.count


def test_refined_and_moved_meshes_have_the_parts_of_the_coarse_one() -> None:
    mesh = joined(square_at(0, 0), square_at(1, 1)).refined(2).rotated(0.3)
    assert mesh.parts.count == 2
    assert rectangle((1.0, 1.0), 32).parts.count == 1
    assert set(mesh.parts.cell) == {0, 1}


@pytest.mark.parametrize("dim", [2, 3])
def test_a_part_that_nothing_holds_is_named(dim: int) -> None:
    mesh = joined(square_at(0, 0), square_at(2, 0)) if dim == 2 else joined(cube_at(0, 0, 0), cube_at(3, 0, 0))
    load = DOWN if dim == 2 else (0.0, 0.0, -0.5)
    problem = ContactProblem(mesh, MATERIAL, {}, {"left0": Clamped()}, body_force=load)
    with pytest.raises(ProblemError, match=r"part [12] of 2 of the body, around x = \((2|3)\..*free to move") as caught:
        discretize(problem)
    assert "'left1'" in str(caught.value)
    assert "'left0'" not in str(caught.value)
    assert "common facets" in str(caught.value)
    held = ContactProblem(mesh, MATERIAL, {}, {"left0": Clamped(), "right1": Clamped()}, body_force=load)
    discretize(held)


def test_a_part_on_a_hinge_is_named_with_its_joint() -> None:
    mesh = joined(square_at(0, 0), square_at(1, 1))
    problem = ContactProblem(mesh, MATERIAL, {}, {"left0": Clamped()}, body_force=DOWN)
    with pytest.raises(ProblemError, match=r"joined to others at x = \(1, 1\) only.*rotation"):
        discretize(problem)
    edge = ContactProblem(joined(cube_at(0, 0, 0), cube_at(1, 1, 0)), MATERIAL, {}, {"left0": Clamped()})
    with pytest.raises(ProblemError, match=r"joined to others at x = .* only.*rotation.*in balance"):
        discretize(edge)


@pytest.mark.parametrize("method", [*METHODS.values()])
def test_a_mechanism_that_no_contact_point_sees_is_refused_before_any_work(method: hv.Solver) -> None:
    """Even where discretisation was told to let it pass, at any angle: pivots of rounding size do not count."""
    for angle in (0.0, 0.05, 0.7):
        mesh = joined(square_at(0, 0), square_at(1, 1)).rotated(angle)
        contact = {"right0": Contact(Compliance(1.0))}
        for loads in ({"body_force": DOWN}, {"tractions": {"top0": (0.1, -0.2)}}):  # the second leaves it in balance
            statement = ContactProblem(mesh, MATERIAL, contact, {"left0": Clamped()}, **loads)
            problem = discretize(statement, check_coercivity=False)
            with pytest.raises(ProblemError, match=r"no lower bound|free to move"):
                solve(problem, method)


def resultant(problem: DiscreteProblem, solution: hv.Solution, part: int) -> np.ndarray:
    """Force of the foundation on a part."""
    assert problem.field is not None
    found = problem.field.mesh.parts
    mine = np.zeros(problem.field.number_of_nodes, dtype=bool)
    mine[problem.field.mesh.cells[found.cell == part]] = True
    force = problem.field.basis @ problem.contact_force(solution.multiplier)
    return np.asarray(force.reshape(-1, problem.field.components)[mine].sum(axis=0))


@pytest.mark.parametrize("method", [None, NonsmoothMultigrid()])
@pytest.mark.parametrize("law", [Signorini(), Compliance(3.0), ThresholdCompliance(0.8, 2.0)])
def test_parts_that_contact_holds_are_solved(method: hv.Solver | None, law: hv.laws.Superpotential) -> None:
    """Two blocks beside one another, each under its own weight, on a rough foundation; one is clamped as well."""
    mesh = joined(square_at(0, 0, 4), square_at(2, 0, 4))
    contact = Contact(law, Tresca(0.4))
    statement = ContactProblem(
        mesh, MATERIAL, {"bottom0": contact, "bottom1": contact}, {"left0": Clamped()}, body_force=(0.1, -0.5)
    )
    problem = discretize(statement)
    solution = solve(problem, method)
    assert solution.status is Status.CONVERGED
    loose = int(mesh.parts.cell[np.argmax(mesh.points[mesh.cells].mean(axis=1)[:, 0])])
    np.testing.assert_allclose(resultant(problem, solution, loose), (0.1, -0.5), atol=1e-8)
    certificate = hv.certify(problem, solution.unknowns, solution.multiplier) if callable(hv.certify) else None
    if certificate is not None:
        assert certificate.error_bound == np.inf
    with pytest.raises(ProblemError, match=r"part . of 2.*translation \(1, 0\)"):
        discretize(ContactProblem(mesh, MATERIAL, statement.contact, statement.supports, body_force=(0.5, -0.5)))


def test_a_lever_on_a_hinge_that_contact_holds() -> None:
    """A square hangs at a corner of a clamped one and leans on a wall, whose force balances moments about the hinge."""
    mesh = joined(square_at(0, 0, 4), square_at(1, 1, 4))
    wall = Contact(Bilateral())
    statement = ContactProblem(mesh, MATERIAL, {"right1": wall}, {"left0": Clamped()}, body_force=DOWN)
    problem = discretize(statement)
    assert problem.field is not None
    assert problem.field.free_motions.count == 1
    solution = solve(problem)
    assert solution.status is Status.CONVERGED
    assert problem.contact.points is not None
    moment = float((problem.contact.weights * solution.pressure) @ (problem.contact.points[:, 1] - 1.0))
    assert moment == pytest.approx(0.5 * 0.5, rel=1e-9)


def test_gap_that_is_never_closed_gives_the_linear_problem() -> None:
    mesh = rectangle((1.0, 1.0), 8)
    linear = discretize(ContactProblem(mesh, MATERIAL, {}, {"left": Clamped()}, body_force=DOWN))
    assert linear.field is not None
    expected = linear.field.full(solve(linear).unknowns)
    for gap in (1e3, 1e6, 1e9, 1e12):
        for law in (Signorini(), Compliance(10.0), ThresholdCompliance(0.3, 2.0)):
            contact = {"bottom": Contact(law, gap=gap)}
            problem = discretize(ContactProblem(mesh, MATERIAL, contact, {"left": Clamped()}, body_force=DOWN))
            for method in (None, NonsmoothMultigrid()):
                found = solve(problem, method)
                assert found.status is Status.CONVERGED, (gap, law, method)
                assert problem.field is not None
                np.testing.assert_allclose(problem.field.full(found.unknowns), expected, atol=1e-10)


def test_no_load_and_an_adhesive_law() -> None:
    law = Adhesive(stiffness=100.0, strength=1.0, softening=200.0)
    problem = discretize(bodies.square(law, 8, material=Material.young(10.0, 0.3)))
    for method in (None, NonsmoothMultigrid()):
        found = solve(problem, method)
        assert found.status is Status.CONVERGED
        assert found.residual.total == 0.0
        assert found.steps == 0
        assert not found.unknowns.any()


def test_rigid_motions_by_hand() -> None:
    """About the middle of the box, the farthest corner moving by one."""
    nodes = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 0.5]])
    motions, names = rigid_basis(nodes)
    assert names == ["(1, 0)", "(0, 1)", ""]
    half = 0.5 * np.sqrt(5.0)
    turn = np.array([[0.5, -1.0], [0.5, 1.0], [-0.5, 1.0], [0.0, 0.0]]) / half
    np.testing.assert_allclose(motions[:, 0].reshape(4, 2), np.tile([1.0, 0.0], (4, 1)))
    np.testing.assert_allclose(motions[:, 1].reshape(4, 2), np.tile([0.0, 1.0], (4, 1)))
    np.testing.assert_allclose(motions[:, 2].reshape(4, 2), turn, atol=1e-15)
    part = rigid_basis(nodes[:1], (np.array([0.0, 0.0]), np.array([2.0, 1.0])))[0]
    np.testing.assert_allclose(part, motions[:2], atol=1e-15)
    solid, names = rigid_basis(np.array([[0.0, 0.0, 0.0], [2.0, 4.0, 4.0]]))  # half the diagonal is 3
    assert names[3:] == [" about the z axis", " about the y axis", " about the x axis"]
    np.testing.assert_allclose(solid[3:, 3:] * 3.0, [[-2, -2, 0], [1, 0, -2], [0, 1, 2]], atol=1e-15)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_motions_that_move_no_support_are_admitted(size: float) -> None:
    """A billionth of what the others move counts as rounding."""
    np.testing.assert_array_equal(admitted(np.zeros((0, 3))), np.eye(3))
    for small, count in ((0.0, 2), (1e-11, 2), (1e-7, 1)):
        found = admitted(size * np.array([[1.0, 1.0, 0.0], [0.0, 0.0, small]]))
        assert found.shape == (3, count)
        np.testing.assert_allclose(found.T @ found, np.eye(count), atol=1e-14)
        np.testing.assert_allclose(found.sum(axis=0) - found[2], 0.0, atol=1e-12)
    assert admitted(size * np.eye(3)).shape == (3, 0)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("support", ["none", "pin"])
def test_coefficients_say_what_each_part_does(shape: str, support: str) -> None:
    mesh = SHAPES[shape][0]()
    name = next(iter(name for name in mesh.boundaries if name.startswith("bottom")))
    supports = {name: Fixed(x=0.0)} if support == "pin" else {}
    problem = discretize(ContactProblem(mesh, MATERIAL, {}, supports), check_coercivity=False)  # type: ignore[arg-type]
    field = problem.field
    assert field is not None
    found, dim = field.free_motions, mesh.dim
    owners = [np.unique(mesh.cells[found.parts.cell == part]) for part in range(found.parts.count)]
    seen = np.concatenate([group.parts for group in found.groups])
    assert len(set(seen.tolist())) == len(seen)
    width = 0
    for group in found.groups:
        assert group.columns == slice(width, width + group.coefficients.shape[2])
        width = group.columns.stop
        moved = found.motions[:, group.columns].toarray().reshape(-1, dim, width - group.columns.start)
        apart = np.setdiff1d(np.arange(len(field.nodes)), np.concatenate([owners[part] for part in group.parts]))
        assert not moved[apart].any()
        for part, coefficients in zip(group.parts, group.coefficients, strict=True):
            own = rigid_basis(field.nodes[owners[part]])[0] @ coefficients
            np.testing.assert_allclose(moved[owners[part]].reshape(own.shape), own, atol=1e-9)
        counted = np.bincount(np.concatenate(owners), minlength=len(field.nodes))
        mine = np.unique(np.concatenate([owners[part] for part in group.parts]))
        np.testing.assert_array_equal(group.hinges, mine[counted[mine] > 1] if found.parts.count > 1 else [])
    assert width == found.count


def test_what_hangs_on_held_parts_is_held_and_what_hangs_on_one_joint_is_not() -> None:
    """A row of squares joined at corners: the clamped end holds itself alone; both ends hold a triangle of joints."""
    row = [square_at(0, 0), square_at(1, 1), square_at(2, 0)]
    for names, count in ((("left0",), 2), (("left0", "right2"), 0)):
        statement = ContactProblem(joined(*row), MATERIAL, {}, {name: Clamped() for name in names})
        problem = discretize(statement, check_coercivity=False)
        assert problem.field is not None
        found = problem.field.free_motions
        assert found.count == count == kernel_size(problem)
        moving = sorted(int(part) for group in found.groups for part in group.parts)
        assert len(moving) == count
        assert [group.hinges.size for group in found.groups] == ([2] if count else [])


@pytest.mark.parametrize(("largest", "refused"), [(12, False), (11, True)])
def test_very_many_parts_at_joints_are_refused(largest: int, refused: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four squares of three motions each; what is named is the number of parts and the place of one of them."""
    monkeypatch.setattr(rigid, "_LARGEST", largest)
    statement = ContactProblem(SHAPES["chain"][0](), MATERIAL)
    if not refused:
        field = discretize(statement, check_coercivity=False).field
        assert field is not None
        assert field.free_motions.count == 6
        return
    with pytest.raises(ProblemError, match=r"4 parts of the body, one of them around x = \(.*, are connected at nodes"):
        discretize(statement, check_coercivity=False).field.free_motions  # type: ignore[union-attr]  # noqa: B018
