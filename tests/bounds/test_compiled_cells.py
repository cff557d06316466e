"""Energies and slopes of cells, in the compiled kernels and by NumPy: those of the stresses at points of the body."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds import admissible_stress as module
from hemivar.bounds import conjugate_sweeps
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.cell_kinds import CellKinds
from hemivar.bounds.compiled_cells import bubble_square, cell_sums
from hemivar.bounds.split_element import voigt
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.kernels import kernels
from hemivar.kernels.cell_strains import cell_strains
from hemivar.mechanics import Clamped, ContactProblem, Material
from hemivar.mesh.mesh import Mesh

from .bodies import anisotropic, plane_mesh, space_mesh

built = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")
CASES = ((2, 1), (3, 1), (2, 2))


def two_parts(mesh: Mesh) -> ContactProblem:
    """Of two materials, loaded from inside, too, and clamped on the left."""
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.5
    mesh = replace(mesh, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})
    soft = Material.lame(0.3, 0.2)
    force = (0.3, -0.2, 0.7)[: mesh.dim]
    material = Material.by_region({"left": anisotropic(mesh.dim), "right": soft})
    return ContactProblem(mesh, material, supports={"left": Clamped()}, body_force=force)


def stress_of(dim: int, order: int) -> AdmissibleStress:
    problem = replace(two_parts(plane_mesh(5) if dim == 2 else space_mesh(2)), order=order)
    field = np.random.default_rng(3).normal(size=problem.mesh.nodes(order).shape)
    return admissible_stress(body_data(problem, field))


def way(compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not compiled:
        monkeypatch.setattr(module, "cell_sums", lambda *_: None)


@pytest.mark.parametrize("compiled", [pytest.param(True, marks=built), False])
@pytest.mark.parametrize(("dim", "order"), CASES)
def test_energies_are_integrals_over_the_body(
    dim: int, order: int, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    way(compiled, monkeypatch)
    stress = stress_of(dim, order)
    data, table = stress.data, stress.data.table
    point, weight = quadrature_rule(dim, 2 * order)
    off = stress.stresses - voigt(data.stresses)[:, :1, None]
    if order == 2:  # the stress of the displacement is linear there
        own = np.stack([module._linear_at_nodes(piece, dim, order) for piece in range(dim + 1)])
        off = stress.stresses - np.einsum("pav,mvw->mpaw", own, voigt(data.stresses))
    at = np.einsum("qa,mpaw->mpqw", shape_values(order, point), off)
    expected = np.einsum("q,mpqv,mvw,mpqw->m", weight, at, data.compliance, at) * table.volumes / (dim + 1)
    assert stress.mean_square == pytest.approx(expected, rel=1e-11)
    assert np.array_equal(stress.mean_square, stress.misfit)


@pytest.mark.parametrize("compiled", [pytest.param(True, marks=built), False])
@pytest.mark.parametrize(("dim", "order"), CASES)
def test_slopes_are_derivatives_of_energies(
    dim: int, order: int, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    way(compiled, monkeypatch)
    stress = stress_of(dim, order)
    table, moments = stress.data.table, stress.tractions.moments
    change = np.random.default_rng(4).normal(size=moments.shape)
    more, less = (stress.with_moments(moments + part * change).mean_square for part in (1.0, -1.0))
    turned = np.einsum("mij,mfaj->mfai", table.inverse, table.of_cells(change)).reshape(len(table.cells), -1)
    found = (stress.slopes() * turned).sum(axis=1)
    assert 4.0 * found == pytest.approx(more - less, rel=1e-9, abs=1e-9 * np.abs(more).max())


@pytest.mark.parametrize("compiled", [pytest.param(True, marks=built), False])
@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("dim", [2, 3])
def test_bubbles_are_the_midpoints_of_quadratic_elements(
    dim: int, alike: bool, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        monkeypatch.setattr(conjugate_sweeps, "bubble_square", lambda *_: None)
    problem = two_parts(plane_mesh(5) if dim == 2 else space_mesh(2))
    problem = replace(problem, material=anisotropic(dim)) if alike else problem
    mesh = problem.mesh
    u = np.random.default_rng(3).normal(size=mesh.points.shape)
    quadratic = np.vstack([u, u[mesh.edges].mean(axis=1)])
    load = np.zeros(quadratic.shape)
    share = np.repeat(mesh.volumes / (3 if dim == 2 else 5), mesh.cell_edges.size // len(mesh.cells))
    which = mesh.cell_edges if len(mesh.cell_edges) == len(mesh.cells) else mesh.cell_edges.T
    np.add.at(load, mesh.number_of_nodes + which.ravel(), share[:, None] * np.array(problem.body_force))
    stiffness = stiffness_matrix(mesh, problem.material, 2)
    residual = load.ravel() - stiffness @ quadratic.ravel()
    outer = {tuple(sorted(pair)) for facet in mesh.boundary_facets for pair in itertools.combinations(facet, 2)}
    square = 0.0
    for number, edge in enumerate(mesh.edges):
        if tuple(sorted(edge)) not in outer:
            at = dim * (mesh.number_of_nodes + number) + np.arange(dim)
            square += residual[at] @ np.linalg.solve(stiffness[at][:, at].toarray(), residual[at])
    assert conjugate_sweeps.unresolved(body_data(problem, u)) == pytest.approx(np.sqrt(square), rel=1e-11)


@built
@pytest.mark.parametrize(("dim", "order"), CASES)
def test_kernels_and_numpy_agree_to_rounding(dim: int, order: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stress = stress_of(dim, order)
    found = stress.slopes(), stress.mean_square, stress.data.kinds.of_cells
    way(False, monkeypatch)
    monkeypatch.setattr("hemivar.bounds.split_element.kernels", lambda: None)
    other = AdmissibleStress(replace(stress.data), stress.tractions)
    for one, two in zip(found, (other.slopes(), other.mean_square, other.data.kinds.of_cells), strict=True):
        assert np.abs(one - two).max() <= 1e-13 * np.abs(two).max()


@pytest.mark.parametrize("compiled", [pytest.param(True, marks=built), False])
@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("dim", [2, 3])
def test_strains_and_forces_are_those_of_the_assembled_body(
    dim: int, alike: bool, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a linear field strains are known; forces of any field add up to the product with the stiffness."""
    if not compiled:
        monkeypatch.setattr("hemivar.bounds.body_data.cell_strains", lambda *_: None)
    problem = two_parts(plane_mesh(5) if dim == 2 else space_mesh(2))
    problem = replace(problem, material=anisotropic(dim)) if alike else problem
    points, rng = problem.mesh.points, np.random.default_rng(3)
    slope, u = rng.normal(size=(dim, dim)), rng.normal(size=points.shape)
    linear = body_data(problem, points @ slope.T)
    assert linear.strain == pytest.approx(np.broadcast_to(0.5 * (slope + slope.T), linear.strain.shape))
    data = body_data(problem, u)
    total = np.zeros(u.shape)
    np.add.at(total, data.cell_nodes, data.forces)
    expected = (stiffness_matrix(problem.mesh, problem.material, 1) @ u.ravel()).reshape(u.shape)
    assert total == pytest.approx(expected, rel=1e-11, abs=1e-11 * np.abs(expected).max())
    gradients = data.table.volumes[:, None, None] * data.table.gradients
    assert data.forces == pytest.approx(gradients @ data.stress, rel=1e-11, abs=1e-11)
    assert np.array_equal(data.stresses[:, 0], data.stresses[:, dim])


@built
@pytest.mark.parametrize("dim", [2, 3])
def test_cells_beside_a_full_row_of_eight(dim: int) -> None:
    """A cell has the same bits, whatever cells stand beside it."""
    stress = stress_of(dim, 1)
    data, table, whole = stress.data, stress.data.table, stress.mean_square
    for count in (1, 7, 8, 13):
        some = replace(
            table, cells=table.cells[:count], cell_facets=table.cell_facets[:count], signs=table.signs[:count],
            gradients=table.gradients[:count],
        )  # fmt: skip
        part = replace(data, table=some, forces=data.forces[:count], loads=data.loads[:count])
        lack = replace(stress.tractions, defect=stress.tractions.defect[:count])
        kinds = CellKinds(data.kinds.number[:count], data.kinds.compliance)
        found = cell_sums(part, lack, stress.element, kinds, False)
        assert found is not None
        assert np.array_equal(found[0], whole[:count])


@built
def test_wrong_arrays_of_cells_are_refused_at_the_door() -> None:
    stress = stress_of(2, 1)
    data, tractions, kinds = stress.data, stress.tractions, stress.data.kinds
    wrong: tuple[Callable[[Array], Array], ...] = (lambda x: x[:-1], lambda x: x[None], lambda x: x[..., None])
    for spoil in wrong:
        with pytest.raises(ValueError, match=r"must (have shape|be from)"):
            cell_sums(data, tractions, stress.element, replace(kinds, compliance=spoil(kinds.compliance)), True)
        for name in ("moments", "defect"):
            bad = replace(tractions, **{name: spoil(getattr(tractions, name))})
            with pytest.raises(ValueError, match="must have shape"):
                cell_sums(data, bad, stress.element, kinds, True)
    beyond = replace(data.table, cell_facets=data.table.cell_facets + 1)
    with pytest.raises(ValueError, match="cell_facets must be"):
        cell_sums(replace(data, table=beyond), tractions, stress.element, kinds, True)
    data = body_data(two_parts(plane_mesh(3)), np.zeros(plane_mesh(3).points.shape))
    edges, ends = data.table.cell_facets, np.array([[1, 2], [0, 2], [0, 1]])
    for bad in ((edges - 1, ends), (edges[:-1], ends), (edges, ends + 1), (edges, ends[:2])):
        with pytest.raises(ValueError, match="must be"):
            bubble_square(data, *bad)
    table = data.table
    good = (data.displacement, table.cells, table.gradients, table.sizes, np.eye(3)[None])
    assert cell_strains(*good) is not None
    for place, spoil in ((0, wrong[0]), (1, lambda x: x - 1), (2, wrong[1]), (3, wrong[2]), (4, wrong[2])):
        with pytest.raises(ValueError, match="must"):
            cell_strains(*good[:place], spoil(good[place]), *good[place + 1 :])
