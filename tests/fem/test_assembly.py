"""Stiffness matrices and load vectors."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from skfem.helpers import ddot, sym_grad, trace

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.fem import assembly
from hemivar.fem.assembly import integrated_load, load_vector, stiffness_blocks, stiffness_matrix
from hemivar.fem.constitutive import elastic
from hemivar.fem.edge_blocks import node_graph
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.unknowns import basis_of
from hemivar.formula import Formula, FormulaArray
from hemivar.mechanics import Material, Pressure
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.instants import Instant
from hemivar.mesh import Mesh, box, rectangle
from tests.samples import sampled

from ..mesh.meshes import cube, distorted
from .library import library_elasticity, library_matrix


def library_stiffness(mesh: Mesh, lam: float, mu: float, order: int = 1) -> sp.csr_array:
    def form(u: Any, v: Any, w: Any) -> Any:
        e, d = sym_grad(u), sym_grad(v)
        return lam * trace(e) * trace(d) + 2 * mu * ddot(e, d)

    return library_matrix(mesh, order, form, 2 * order)


MESHES = {
    "cross": lambda: distorted(rectangle((2, 1), (6, 3), "cross")),
    "right": lambda: rectangle((1, 1), 5).rotated(0.4),
    "cube": lambda: distorted(cube(3)),
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("order", [1, 2])
def test_elements_equal_the_library(name: str, order: int) -> None:
    mesh = MESHES[name]()
    K = stiffness_matrix(mesh, Material.lame(3.0, 4.0), order)
    reference = library_stiffness(mesh, 3.0, 4.0, order)
    assert abs(K - reference).max() < 1e-14 * abs(reference).max()
    assert abs(K - K.T).max() == 0.0
    assert K.has_sorted_indices


@pytest.mark.parametrize(("order", "varying", "name"), sampled(itertools.product((1, 2), (False, True), MESHES), 4))
def test_general_tensor(name: str, varying: bool, order: int) -> None:
    mesh = MESHES[name]()
    size = mesh.dim * (mesh.dim + 1) // 2
    root = np.random.default_rng(1).standard_normal((size, size))
    C = root @ root.T + np.eye(size)

    def tensor(x: Array) -> Array:
        return (1 + x[:, 0] ** 2)[:, None, None] * C

    K = stiffness_matrix(mesh, Material.tensor(tensor if varying else C), order)
    reference = library_elasticity(mesh, tensor if varying else C, order, 2 * order)
    assert abs(K - reference).max() < 1e-13 * abs(reference).max()


def test_many_cells_go_by_portions() -> None:
    """More cells and more nodes than are taken at a time, numbered along the mesh and all across it."""
    for mesh in (rectangle(cells=100), rectangle(cells=25).refined(2)):
        reference = library_stiffness(mesh, 3.0, 4.0)
        assert abs(stiffness_matrix(mesh, Material.lame(3.0, 4.0)) - reference).max() < 1e-14 * abs(reference).max()


@pytest.mark.parametrize("name", MESHES)
def test_stretched_cells(name: str) -> None:
    """The blocks on the diagonal are found as differences, which must not cost digits of the small entries."""
    mesh = MESHES[name]()
    mesh = mesh.moved(np.diag([1.0, 1e-3, 1.0][: mesh.dim]))
    K = stiffness_matrix(mesh, Material.lame(3.0, 4.0))
    reference = library_stiffness(mesh, 3.0, 4.0)
    scale = np.sqrt(reference.diagonal())
    assert np.abs((K - reference).toarray() / np.outer(scale, scale)).max() < 1e-13


@pytest.mark.parametrize("mesh", [distorted(rectangle((2, 1), (6, 3))), distorted(box(cells=3))], ids=["2d", "3d"])
@pytest.mark.parametrize("fixed", ["none", "nodes", "components"])
@pytest.mark.parametrize("order", [1, 2])
def test_turned_and_reduced_blocks(mesh: Mesh, fixed: str, order: int) -> None:
    """Turning blocks and leaving out components is ``P'KP``."""
    rng = np.random.default_rng(2)
    dim = mesh.dim
    blocks = stiffness_blocks(mesh, elastic(Material.lame(3.0, 4.0), mesh.dim), node_graph(mesh, order))
    K = stiffness_matrix(mesh, Material.lame(3.0, 4.0), order)
    count = blocks.diagonal.shape[0]
    field = rng.standard_normal((count, dim)) * (rng.random(count) < 0.3)[:, None]
    np.testing.assert_allclose(blocks.times(field).ravel(), K @ field.ravel(), atol=1e-12 * abs(K).max())
    directions = np.broadcast_to(np.eye(dim), (count, dim, dim)).copy()
    some = rng.choice(count, count // 3, replace=False)
    directions[some] = np.linalg.qr(rng.standard_normal((len(some), dim, dim)))[0]
    free = np.ones((count, dim), dtype=bool)
    if fixed != "none":
        free[rng.choice(count, count // 4, replace=False)] = False
    if fixed == "components":
        free &= rng.random(free.shape) < 0.7
    P = basis_of(directions, free)
    some = rng.choice(count * dim, count // 2, replace=False)
    np.testing.assert_allclose(blocks.columns(some).toarray(), K[:, some].toarray(), atol=1e-13 * abs(K).max())
    blocks.turn(directions)
    reduced = blocks.matrix(free)
    expected = (P.T @ K @ P).toarray()
    np.testing.assert_allclose(reduced.toarray(), expected, atol=1e-13 * np.abs(expected).max())
    assert abs(reduced - reduced.T).max() == 0.0
    reduced.has_canonical_format = False
    reduced.check_format(full_check=True)
    assert np.all(np.diff(reduced.indices)[np.setdiff1d(np.arange(reduced.nnz - 1), reduced.indptr[1:-1] - 1)] > 0)


@pytest.mark.parametrize("order", [1, 2])
def test_tensor_equals_lame(order: int) -> None:
    mesh = MESHES["cross"]()
    lame = Material.lame(3.0, 2.0)
    tensor = Material.tensor([[7, 3, 0], [3, 7, 0], [0, 0, 2]])
    difference = stiffness_matrix(mesh, lame, order) - stiffness_matrix(mesh, tensor, order)
    assert abs(difference).max() < 1e-13


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", MESHES)
def test_rigid_motions_carry_no_energy(name: str, order: int) -> None:
    mesh = MESHES[name]()
    K = stiffness_matrix(mesh, Material.young(5.0, 0.3), order)
    nodes = mesh.nodes(order)
    turn = np.zeros_like(nodes)
    turn[:, 0], turn[:, 1] = -nodes[:, 1], nodes[:, 0]
    for motion in (np.ones_like(nodes), turn):
        assert np.abs(K @ motion.ravel()).max() < 1e-12 * abs(K).max()


@pytest.mark.parametrize("name", MESHES)
def test_order_two_energy_under_a_varying_modulus(name: str) -> None:
    """u = (q(x), 0, 0) with q quadratic, nu = 0: twice the energy is the integral of E(x) q'(x)^2, of degree 3."""
    mesh = MESHES[name]()
    a = np.array([1.0, -0.5, 0.25])[: mesh.dim]

    def modulus(x: Array) -> Array:
        return np.asarray(3.0 + x @ a)

    nodes = mesh.nodes(2)
    u = np.zeros_like(nodes)
    u[:, 0] = nodes[:, 0] + 0.5 * nodes[:, 0] ** 2
    K = stiffness_matrix(mesh, Material.young(modulus, 0.0), 2)
    # rules of degree 3 written out
    corner = mesh.points[mesh.cells]
    if mesh.dim == 2:
        middles = 0.5 * (corner + np.roll(corner, 1, axis=1))
        parts = [(corner, 1 / 20), (middles, 2 / 15), (corner.mean(axis=1, keepdims=True), 9 / 20)]
    else:
        faces = (corner.sum(axis=1, keepdims=True) - corner) / 3.0
        parts = [(corner, 1 / 40), (faces, 9 / 40)]
    expected = 0.0
    for places, weight in parts:
        flat = places.reshape(-1, mesh.dim)
        values = (modulus(flat) * (1.0 + flat[:, 0]) ** 2).reshape(places.shape[:2]).sum(axis=1)
        expected += weight * float(mesh.volumes @ values)
    assert u.ravel() @ (K @ u.ravel()) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_order_two_energy_of_a_quadratic_field(name: str) -> None:
    mesh = MESHES[name]()
    nodes = mesh.nodes(2)
    field = np.zeros_like(nodes)
    field[:, 0], field[:, 1] = nodes[:, 0] * nodes[:, 1], nodes[:, 0] ** 2
    energy = field.ravel() @ stiffness_matrix(mesh, Material.lame(3.0, 2.0), 2) @ field.ravel()
    # eps_xx = y, gamma_xy = 3 x
    barycentric, weights = quadrature_rule(mesh.dim, 2)
    x = np.einsum("qk,mkd->mqd", barycentric, mesh.points[mesh.cells])
    exact = np.einsum("m,q,mq->", mesh.volumes, weights, 7 * x[..., 1] ** 2 + 2 * 9 * x[..., 0] ** 2)
    assert np.isclose(energy, exact, rtol=1e-12)


def test_regions() -> None:
    mesh = rectangle((2, 1), (4, 2))
    left = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1)
    right = np.setdiff1d(np.arange(mesh.number_of_cells), left)
    mesh = Mesh(mesh.points, mesh.cells, {}, {"a": left, "b": right})
    parts = Material.by_region({"a": Material.lame(1.0, 2.0), "b": Material.lame(5.0, 6.0)})
    stepped = Material.lame(lambda x: np.where(x[:, 0] < 1, 1.0, 5.0), lambda x: np.where(x[:, 0] < 1, 2.0, 6.0))
    for order in (1, 2):
        assert abs(stiffness_matrix(mesh, parts, order) - stiffness_matrix(mesh, stepped, order)).max() < 1e-13
    homogeneous = stiffness_matrix(mesh, Material.lame(1.0, 2.0))
    assert abs(stiffness_matrix(mesh, Material.lame(lambda x: 1.0, 2.0)) - homogeneous).max() < 1e-13


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", ["cross", "cube"])
def test_loads(name: str, order: int) -> None:
    mesh = MESHES[name]()
    dim, nodes = mesh.dim, mesh.nodes(order)
    b = np.arange(1.0, dim + 1)
    constant = load_vector(mesh, order, b).reshape(-1, dim)
    np.testing.assert_allclose(constant.sum(axis=0), b * mesh.volumes.sum())
    called = load_vector(mesh, order, lambda x: np.broadcast_to(b, x.shape)).reshape(-1, dim)
    np.testing.assert_allclose(called, constant, atol=1e-15)
    # work of a linear force on a linear displacement, exact by the rule used for callables
    linear = load_vector(mesh, order, lambda x: x).reshape(-1, dim)
    barycentric, weights = quadrature_rule(dim, 2)
    x = np.einsum("qk,mkd->mqd", barycentric, mesh.points[mesh.cells])
    exact = np.einsum("m,q,mqd->", mesh.volumes, weights, x**2)
    assert np.isclose((linear * nodes).sum(), exact)
    boundary = "left" if dim == 2 else "bottom"
    _, measure = mesh.facet_normals(mesh.boundaries[boundary])
    pulled = load_vector(mesh, order, 0.0, {boundary: b}).reshape(-1, dim)
    np.testing.assert_allclose(pulled.sum(axis=0), b * measure.sum())
    pressed = load_vector(mesh, order, 0.0, {boundary: Pressure(2.0)}).reshape(-1, dim)
    direction = np.eye(dim)[0 if dim == 2 else 2]
    np.testing.assert_allclose(pressed.sum(axis=0), 2.0 * measure.sum() * direction, atol=1e-14)
    varying = load_vector(mesh, order, 0.0, {boundary: Pressure(lambda x: x[:, 1])}).reshape(-1, dim)
    np.testing.assert_allclose(varying.sum(axis=0), 0.5 * direction, atol=1e-14)


@pytest.mark.parametrize("points", [1, 50, 10_000])
def test_loads_of_functions_by_portions(points: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A density that knows the number of its cell: a force of ``k`` times a vector in cell k."""
    mesh, vector = MESHES["cube"](), np.array([1.0, -2.0, 0.5])
    numbers = np.arange(mesh.number_of_cells)
    expected = np.zeros((mesh.number_of_nodes, 3))
    np.add.at(expected, mesh.cells.ravel(), np.repeat(numbers * mesh.volumes / 4.0, 4)[:, None] * vector)
    monkeypatch.setattr(assembly, "PORTION", points)
    found = integrated_load(mesh, 1, 3, lambda x, number: number[:, None] * vector, {})
    np.testing.assert_allclose(found.reshape(-1, 3), expected, atol=1e-13 * np.abs(expected).max())


def test_a_formula_of_time_alone_is_a_load_that_is_the_same_everywhere() -> None:
    mesh = MESHES["cube"]()
    formula = FormulaArray((Formula("sin(t)"), 0.0, Formula("-t^2")), (3,))
    at = Instant(formula, 2.0)
    assert DataField(at, "a load", 3).alike
    constant = np.array([np.sin(2.0), 0.0, -4.0])
    np.testing.assert_allclose(load_vector(mesh, 1, at), load_vector(mesh, 1, constant), rtol=1e-14)
    varying = Instant(FormulaArray((Formula("x*t"), 0.0, 0.0), (3,)), 2.0)
    assert not DataField(varying, "a load", 3).alike
    middle = mesh.points[mesh.cells].mean(axis=1)
    assert load_vector(mesh, 1, varying).sum() == pytest.approx(2.0 * (mesh.volumes @ middle[:, 0]))


def test_loads_are_the_same_in_whatever_order_they_are_stated() -> None:
    """To the last bit: a problem file states pressures after tractions."""
    mesh = rectangle((1.0, 1.0), 3)
    stated = {"top": (0.1, 1.0 / 3.0), "right": Pressure(0.7), "left": (1e-3, 0.2), "bottom": Pressure(1.0 / 7.0)}
    turned = dict(reversed(stated.items()))
    one, two = (load_vector(mesh, 1, (0.3, -1.1), tractions) for tractions in (stated, turned))
    assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize(
    ("body_force", "tractions", "words"),
    [
        (lambda x: x[:, 0], {}, "body_force: the callable returned shape"),
        (lambda x: np.full(x.shape, np.nan), {}, "body_force: the callable returned .*nan"),
        (
            lambda x: np.stack([x[:, 0], np.where(x[:, 0] > 0.9, np.inf, 0.0)], axis=1),
            {},
            r"body_force: the callable returned \[0\.9\d* +inf\] at x = \[0\.9",
        ),
        (lambda x: "strong", {}, "what the callable returns is not an array of numbers"),
        (0.0, {"left": lambda x: x[:1]}, r"tractions\['left'\]"),
        (0.0, {"left": Pressure(lambda x: x)}, r"tractions\['left'\]"),
    ],
)
def test_bad_load_functions(body_force: Any, tractions: dict[str, Pressure], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        load_vector(rectangle((1, 1), 3), 1, body_force, tractions)
