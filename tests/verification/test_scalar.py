"""Scalar problems against closed forms, other methods and themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize as opt
import scipy.sparse as sp
import skfem
from skfem.models.poisson import laplace, mass, unit_load

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.fem import gradient
from hemivar.fem.quadrature import quadrature_rule
from hemivar.gallery.scalar_problems import KnownScalarProblem
from hemivar.mechanics.foundation import Side
from hemivar.mesh import Mesh
from hemivar.solvers import Solution
from hemivar.systems.body_on_levels import ElasticMultigrid

SIDES = ("left", "right", "bottom", "top")


def errors(solution: Solution, exact: Callable[[Array], Array], slope: Callable[[Array], Array]) -> tuple[float, float]:
    """L2 norms of the error of u and of its gradient, linear elements, by a rule of degree 6."""
    stated = solution.problem.origin
    assert isinstance(stated, hv.ContactProblem)
    mesh, u = stated.mesh, solution.displacement[:, 0]
    found, _ = gradient(stated, solution.displacement)
    barycentric, weights = quadrature_rule(2, 6)
    square, steep = 0.0, 0.0
    for place, weight in zip(barycentric, weights, strict=True):
        points = np.einsum("a,mad->md", place, mesh.points[mesh.cells])
        square += weight * float(mesh.volumes @ (u[mesh.cells] @ place - exact(points)) ** 2)
        steep += weight * float(mesh.volumes @ ((found - slope(points)) ** 2).sum(axis=1))
    return square**0.5, steep**0.5


def orders(make: Callable[[int], KnownScalarProblem], sizes: list[int]) -> tuple[Array, Array]:
    found = []
    for n in sizes:
        known = make(n)
        found.append(errors(hv.solve(known.problem).raise_for_status(), known.solution, known.gradient))
    values = np.log2(np.array(found))
    return values[:-1, 0] - values[1:, 0], values[:-1, 1] - values[1:, 1]


def test_the_closed_forms_are_what_they_say() -> None:
    """Gradients are those of the functions, which solve the equation; the laws hold."""
    known = gallery.membrane_obstacle()
    a = gallery.membrane_radius(0.3, 0.8, 0.5)
    rng = np.random.default_rng(5)
    points, h = rng.uniform(-0.7, 0.7, (300, 2)), 1e-4
    points = points[np.abs(np.linalg.norm(points, axis=1) - a) > 2e-3]
    steps = [np.array([h, 0.0]), np.array([0.0, h])]
    u = known.solution
    numeric = np.column_stack([(u(points + s) - u(points - s)) / (2 * h) for s in steps])
    np.testing.assert_allclose(known.gradient(points), numeric, atol=1e-7)
    bent = sum((u(points + s) - 2 * u(points) + u(points - s)) / h**2 for s in steps)
    np.testing.assert_allclose(bent, 0.5 - known.multiplier(points), atol=1e-6)
    psi = 0.3 - (points**2).sum(axis=1) / 1.6
    assert (u(points) >= psi - 1e-14).all()
    np.testing.assert_allclose((u(points) - psi)[known.multiplier(points) > 0], 0.0, atol=1e-15)
    ring = np.column_stack([np.cos(t := np.linspace(0, 6, 7)), np.sin(t)])
    np.testing.assert_allclose(u(ring), 0.0, atol=1e-14)

    known = gallery.antiplane_friction()
    points = np.column_stack([rng.uniform(-0.9, 0.9, 200), rng.uniform(0.01, 0.9, 200)])
    u = known.solution
    numeric = np.column_stack([(u(points + s) - u(points - s)) / (2 * h) for s in steps])
    np.testing.assert_allclose(known.gradient(points), numeric, atol=1e-5)
    bent = sum((u(points + s) - 2 * u(points) + u(points - s)) / h**2 for s in steps)
    np.testing.assert_allclose(bent, 0.0, atol=2e-3)
    base = np.column_stack([np.linspace(-1, 1, 21), np.zeros(21)])
    np.testing.assert_allclose(known.multiplier(base), 2.0 * known.gradient(base)[:, 1], atol=1e-14)
    slip = u(base)
    np.testing.assert_allclose(slip[base[:, 0] <= 0], 0.0, atol=1e-15)
    np.testing.assert_allclose(known.multiplier(base)[slip > 0], 1.0)
    assert (np.abs(known.multiplier(base)) <= 1.0).all()


def test_orders_of_a_membrane_on_a_hill() -> None:
    """h^2 in L2 and h in energy, and the force on the hill: pi a^2 (2/R + q) T."""
    two, one = orders(lambda n: gallery.membrane_obstacle(n), [16, 32, 64, 128])
    assert two.mean() > 1.9
    assert one.mean() > 0.95
    assert two.min() > 1.7
    known = gallery.membrane_obstacle(128, tension=3.0)
    found = hv.solve(known.problem)
    a = gallery.membrane_radius(0.3, 0.8, 0.5)
    assert found.normal_force == pytest.approx(np.pi * a**2 * 3.0 * (2 / 0.8 + 0.5), rel=4e-3)
    assert found.contact_length == pytest.approx(np.pi * a**2, rel=0.04)
    assert found.measured == "area"


def disc(n: int) -> Mesh:
    """The unit disc: a square whose rings of squares are made rings of circles."""
    square = hv.rectangle((2.0, 2.0), n, "cross", (-1.0, -1.0))
    largest, length = np.abs(square.points).max(axis=1), np.linalg.norm(square.points, axis=1)
    points = square.points * (largest / np.where(length > 0.0, length, 1.0))[:, None]
    rim = np.concatenate([square.boundaries[name] for name in SIDES])
    return Mesh(points, square.cells, {"rim": rim})


def test_a_membrane_on_a_disc() -> None:
    """u = 0 at the rim is all that is said: the same solution, without a hierarchy of meshes."""
    known = gallery.membrane_obstacle()
    found = []
    for n in (16, 32, 64):
        problem = replace(known.problem, mesh=disc(n), supports={"rim": 0.0})
        solution = hv.solve(problem).raise_for_status()
        found.append(errors(solution, known.solution, known.gradient))
        a = gallery.membrane_radius(0.3, 0.8, 0.5)
        radii = np.linalg.norm(solution.problem.contact.points[solution.pressure > 1e-9], axis=1)  # type: ignore[index]
        assert abs(radii.max() - a) < 2.0 / n
    two, one = np.log2(np.array(found[:-1]) / np.array(found[1:])).T
    assert two.mean() > 1.8
    assert one.mean() > 0.9


def test_orders_of_stick_and_slip() -> None:
    two, one = orders(lambda n: gallery.antiplane_friction(n), [8, 16, 32, 64])
    assert two.mean() > 1.85
    assert one.mean() > 0.95
    known = gallery.antiplane_friction(64)
    found = hv.solve(known.problem).raise_for_status()
    x = found.problem.contact.points[:, 0]  # type: ignore[index]
    slips = found.tangential_state == hv.solvers.TangentialState.SLIP
    assert np.abs(x[slips].min()) < 2.1 / 64
    np.testing.assert_allclose(found.friction[slips, 0], -1.0, rtol=1e-9)
    inside = np.abs(x) < 0.9
    np.testing.assert_allclose(
        found.friction[inside, 0], -known.multiplier(found.problem.contact.points)[inside], atol=0.03
    )
    assert found.certify().unique


def membrane(n: int, law: object = None, **changes: object) -> hv.ContactProblem:
    area = hv.ScalarContact(hv.Signorini() if law is None else law, 0.05)  # type: ignore[arg-type]
    stated = {"area": area, "supports": dict.fromkeys(SIDES, 0.0), "source": 2.0} | changes
    return hv.ScalarProblem(hv.rectangle((1.0, 1.0), n), 1.0, **stated)  # type: ignore[arg-type]


def by_skfem(mesh: Mesh) -> tuple[Array, Array, Array]:
    """Stiffness, mass and areas of linear elements from elsewhere, for all nodes."""
    basis = skfem.Basis(skfem.MeshTri(mesh.points.T, mesh.cells.T), skfem.ElementTriP1())
    return laplace.assemble(basis).toarray(), mass.assemble(basis).toarray(), unit_load.assemble(basis)


def test_an_obstacle_by_projected_relaxation() -> None:
    problem = membrane(8)
    K, _, area = by_skfem(problem.mesh)
    inner = np.flatnonzero((np.abs(problem.mesh.points - 0.5) < 0.49).all(axis=1))
    u = np.zeros(len(area))
    for _ in range(600):
        for i in inner:
            u[i] = min(u[i] + (2.0 * area[i] - K[i] @ u) / K[i, i], 0.05)
    for method in ("newton", "multigrid", "active-set", "augmented-lagrangian-newton"):
        found = hv.solve(problem, hv.solvers.METHODS[method]).raise_for_status()
        np.testing.assert_allclose(found.displacement[:, 0], u, atol=1e-9)


def test_mirrored_problems_have_mirrored_solutions() -> None:
    """What lies below and is met by falling is what lies above and is met by rising."""
    hill = hv.ScalarContact(hv.laws.ThresholdCompliance(0.2, 30.0), lambda x: 0.02 + 0.1 * x[:, 0])
    above = membrane(16, area=hill)
    below = membrane(
        16,
        area=hv.ScalarContact(hv.laws.ThresholdCompliance(0.2, 30.0), lambda x: -0.02 - 0.1 * x[:, 0], Side.BELOW),
        source=-2.0,
    )
    one, other = hv.solve(above), hv.solve(below)
    np.testing.assert_allclose(one.displacement, -other.displacement, atol=1e-13)
    np.testing.assert_allclose(one.pressure, other.pressure, atol=1e-11)
    assert one.energy == pytest.approx(other.energy, rel=1e-12)


def pull(r: Array) -> tuple[Array, Array]:
    """Energy and force of Softening(20, 0.02, 30), written down anew: a ramp up to 0.4 and down to 0 at 1/30."""
    up, down = np.clip(r, 0.0, 0.02), np.clip(r - 0.02, 0.0, 0.4 / 30.0)
    return 10.0 * up**2 + 0.4 * down - 15.0 * down**2, np.where(r <= 0.02, 20.0 * up, 0.4 - 30.0 * down)


@pytest.mark.parametrize("side", [Side.ABOVE, Side.BELOW])
def test_an_edge_that_softens_by_quasi_newton(side: Side) -> None:
    """A membrane pressed on a softening edge, minimised by SciPy from several starts, with matrices from elsewhere."""
    sign = 1.0 if side is Side.ABOVE else -1.0
    problem = hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), (6, 2)),
        1.5,
        contact={"right": hv.ScalarContact(hv.Softening(20.0, 0.02, 30.0), sign * 0.01, side)},
        supports={"left": 0.0},
        source=sign * 0.25,
        bedding=0.5,
    )
    K, M, area = by_skfem(problem.mesh)
    A, f = 1.5 * K + 0.5 * M, sign * 0.25 * area
    x, y = problem.mesh.points.T
    free, edge = np.flatnonzero(x > 1e-9), np.flatnonzero(x > 1.0 - 1e-9)
    weight = np.where((y[edge] < 1e-9) | (y[edge] > 1 - 1e-9), 0.5, 1.0) / 2.0

    def energy(v: Array) -> tuple[float, Array]:
        u = np.zeros(len(x))
        u[free] = v
        stored, force = pull(sign * u[edge] - 0.01)
        slope = A @ u - f
        slope[edge] += sign * weight * force
        return float(0.5 * u @ A @ u - f @ u + weight @ stored), slope[free]

    rng = np.random.default_rng(2)
    ends = [
        opt.minimize(energy, s * rng.random(len(free)), jac=True, method="BFGS", options={"gtol": 1e-10})
        for s in (0.0, 0.2, -0.2)
    ]
    best = min(ends, key=lambda end: end.fun)
    found = hv.solve(problem).raise_for_status()
    assert found.energy == pytest.approx(best.fun, rel=1e-9)
    np.testing.assert_allclose(found.unknowns, best.x, atol=1e-7)
    # it has more than one equilibrium: nothing is called the only one, and the search meets where SciPy ended
    assert max(end.fun for end in ends) > best.fun + 1e-6
    assert not found.certify().unique
    every = hv.find_solutions(hv.discretize(problem)).solutions
    assert max(solution.penetration.max() for solution in every) > 0.04
    for end in ends:
        assert min(abs(solution.energy - end.fun) for solution in every) < 1e-9


def test_the_margin_of_an_area_is_that_of_the_dense_matrices() -> None:
    """c = alpha lmax(W, K) over the inner nodes."""
    problem = membrane(10, hv.Softening(20.0, 0.01, 12.0))
    K, _, area = by_skfem(problem.mesh)
    inner = np.flatnonzero((np.abs(problem.mesh.points - 0.5) < 0.49).all(axis=1))
    import scipy.linalg as la

    c = 12.0 * la.eigh(np.diag(area[inner]), K[np.ix_(inner, inner)], eigvals_only=True)[-1]
    found = hv.certificates.smallness(problem)
    assert found.constant == pytest.approx(c, rel=1e-6)
    assert found.margin == pytest.approx(1.0 - c, rel=1e-5)
    assert found.m_A == 1.0
    assert found.trace_constant == pytest.approx(np.sqrt(c / 12.0), rel=1e-6)
    twice = hv.certificates.smallness(replace(problem, material=hv.Material.gradient(2.0, problem.kind)))
    assert twice.constant == pytest.approx(0.5 * c, rel=1e-6)
    assert twice.m_A == 2.0
    assert twice.trace_constant == pytest.approx(found.trace_constant, rel=1e-9)


@pytest.mark.parametrize(
    ("length", "force"),
    [(1e3, 1e-6), (1e-3, 1e9)],
)
@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_units_do_not_matter(method: str, length: float, force: float) -> None:
    """Lengths times ``length``, forces per area times ``force``; tensions are forces per length."""
    here = hv.solve(membrane(16, hv.Softening(20.0, 0.01, 12.0)), hv.solvers.METHODS[method])
    there = hv.solve(
        hv.ScalarProblem(
            hv.rectangle((length, length), 16),
            force * length,
            area=hv.ScalarContact(hv.Softening(20.0 * force / length, 0.01 * length, 12.0 * force / length),
                                  0.05 * length),
            supports=dict.fromkeys(SIDES, 0.0),
            source=2.0 * force,
        ),
        hv.solvers.METHODS[method],
    )  # fmt: skip
    np.testing.assert_allclose(there.displacement / length, here.displacement, atol=1e-9)
    assert there.energy == pytest.approx(here.energy * force * length**3, rel=1e-9)
    one, other = here.certify(), there.certify()
    assert one.margin == pytest.approx(other.margin, rel=1e-9)


def test_multigrid_takes_as_many_cycles_on_every_mesh() -> None:
    """Contact over the whole area at the price of few linear solves, whatever the mesh."""
    cycles = []
    for n in (16, 32, 64, 128, 256):
        problem = hv.discretize(membrane(n))
        found = hv.solve(problem, hv.solvers.NonsmoothMultigrid()).raise_for_status()
        _, linear = ElasticMultigrid.of(problem).solve(problem.load, 1e-10)
        cycles.append((found.evaluations, linear))
    assert max(found for found, _ in cycles) <= 25
    assert max(found - 2.5 * linear for found, linear in cycles[1:]) <= 0


def test_a_large_area_is_chosen_for_multigrid_and_stays_sparse() -> None:
    import tracemalloc

    problem = hv.discretize(membrane(128))
    dense = 8 * problem.unknowns**2
    tracemalloc.start()
    found = hv.solve(problem).raise_for_status()
    certificate = found.certify()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.method == "multigrid"
    assert certificate.unique
    assert peak < dense / 10


def between_plates(n: int, k: float, source: float, warm: float) -> tuple[hv.ContactProblem, Callable[[Array], Array]]:
    """Heat in a cube with the top held at ``warm`` and a law q + p (T - T0) at the base: T(z), in closed form."""
    q, p, outside = 0.1, 4.0, 0.2
    # k T'(0) = q + p (T(0) - T0), T = b + g z - s z^2/(2k), T(1) = warm
    g = (q + p * (warm + source / (2 * k) - outside)) / (k + p)
    b = warm + source / (2 * k) - g
    assert b > outside
    problem = hv.ScalarProblem(
        hv.box((1.0, 1.0, 1.0), n),
        k,
        contact={"bottom": hv.ScalarContact(hv.laws.ThresholdCompliance(q, p), outside)},
        supports={"top": warm},
        source=source,
        kind="heat",  # type: ignore[arg-type]
    )
    return problem, lambda z: b + g * z - source * z**2 / (2 * k)


def test_heat_in_space_between_plates() -> None:
    """Linear elements hold a linear temperature, and come near to a parabola like h^2; what comes in goes out."""
    problem, exact = between_plates(3, 2.0, 0.0, 1.0)
    found = hv.solve(problem).raise_for_status()
    np.testing.assert_allclose(found.displacement[:, 0], exact(problem.mesh.points[:, 2]), atol=1e-12)
    assert found.certify().unique
    wrong = []
    for n in (4, 8):
        problem, exact = between_plates(n, 2.0, 3.0, 0.0)
        for method in ("newton", "multigrid"):
            found = hv.solve(problem, hv.solvers.METHODS[method]).raise_for_status()
            assert float(found.reactions["top"][0]) + 3.0 - found.normal_force == pytest.approx(0.0, abs=1e-8)
        wrong.append(np.sqrt(np.mean((found.displacement[:, 0] - exact(problem.mesh.points[:, 2])) ** 2)))
    assert wrong[1] < 0.3 * wrong[0]


def test_matrices_are_those_of_another_library() -> None:
    """Bedding and coefficient that vary, order 1 and 2."""
    mesh = hv.rectangle((1.0, 0.7), 5)

    def tension(x: Array) -> Array:
        return 1.0 + x[:, 0] + 0.5 * x[:, 1] ** 2

    def bedding(x: Array) -> Array:
        return 2.0 + x[:, 1]

    @skfem.BilinearForm
    def both(u: object, v: object, w: object) -> object:
        x, y = w.x  # type: ignore[attr-defined]
        stiff = (1.0 + x + 0.5 * y**2) * (u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])  # type: ignore[attr-defined]
        return stiff + (2.0 + y) * u * v  # type: ignore[operator]

    for order, element in ((1, skfem.ElementTriP1()), (2, skfem.ElementTriP2())):
        basis = skfem.Basis(skfem.MeshTri(mesh.points.T, mesh.cells.T), element, intorder=6)
        other = np.linalg.eigvalsh(both.assemble(basis).toarray())
        K = hv.discretize(hv.ScalarProblem(mesh, tension, bedding=bedding, order=order)).stiffness.toarray()
        np.testing.assert_allclose(np.linalg.eigvalsh(K), other, rtol=1e-11)


def test_a_tensor_turns_with_the_mesh() -> None:
    """Quadratic elements hold u = x^2 + x y: div(A grad u) = 2 A_xx + 2 A_xy, and a turned tensor is the same."""
    A = np.array([[3.0, 0.5], [0.5, 1.0]])
    mesh = hv.rectangle((1.0, 1.0), 3)
    problem = hv.ScalarProblem(
        mesh, A, supports=dict.fromkeys(SIDES, lambda x: x[:, 0] ** 2 + x[:, 0] * x[:, 1]), source=-7.0, order=2
    )
    found = hv.solve(problem)
    x, y = found.problem.field.nodes.T  # type: ignore[union-attr]
    np.testing.assert_allclose(found.displacement[:, 0], x**2 + x * y, atol=1e-12)
    _, flux = gradient(problem, found.displacement)
    middle = mesh.points[mesh.cells].mean(axis=1)
    slope = np.column_stack([2 * middle[:, 0] + middle[:, 1], middle[:, 0]])
    np.testing.assert_allclose(flux, slope @ A, atol=1e-11)


def test_layers_in_series() -> None:
    """Two layers between plates: the flux is that of their resistances in series, linear elements exact."""
    mesh = hv.rectangle((1.0, 1.0), 4)
    middle = mesh.points[mesh.cells].mean(axis=1)
    mesh = Mesh(
        mesh.points, mesh.cells, mesh.boundaries,
        {"low": np.flatnonzero(middle[:, 1] < 0.5), "high": np.flatnonzero(middle[:, 1] > 0.5)},
    )  # fmt: skip
    problem = hv.ScalarProblem(
        mesh, {"low": 1.0, "high": lambda x: np.full(len(x), 4.0)}, supports={"bottom": 0.0, "top": 1.0}
    )
    found = hv.solve(problem)
    flux = 1.0 / (0.5 / 1.0 + 0.5 / 4.0)
    assert found.reactions["top"][0] == pytest.approx(flux)
    assert found.reactions["bottom"][0] == pytest.approx(-flux)
    assert found.displacement[np.argmin(np.abs(mesh.points - [0.5, 0.5]).sum(axis=1)), 0] == pytest.approx(0.5 * flux)


def test_a_block_between_rubbing_plates() -> None:
    """One-dimensional shear: below the bound it sticks, above it slips by w - g b/mu; half of the base each."""
    for shift, bound, slip in ((1.0, 3.0, 0.0), (1.0, 1.5, 0.25), (-1.0, 1.5, -0.25)):
        problem = hv.ScalarProblem(
            hv.rectangle((2.0, 1.0), (8, 4)),
            2.0,
            contact={"bottom": hv.ScalarContact(hv.Tresca(bound), 0.1)},
            supports={"top": 0.1 + shift},
            kind="antiplane",  # type: ignore[arg-type]
        )
        found = hv.solve(problem).raise_for_status()
        np.testing.assert_allclose(found.slip[:, 0], slip, atol=1e-12)
        force = np.clip(2.0 * shift, -bound, bound)
        np.testing.assert_allclose(found.friction[:, 0], -force, atol=1e-11)
        assert found.reactions["top"][0] == pytest.approx(2.0 * force)
        assert sp.issparse(found.problem.contact.trace)


def test_a_membrane_between_two_stops() -> None:
    """One law that ends on both sides: pushed up on one half and down on the other, it rests on both."""
    stops = hv.laws.PiecewiseQuadratic([-0.03, 0.02], [0.0, 0.0, 0.0], [0.0, 0.0], lower=-0.03, upper=0.02)
    problem = membrane(24, area=hv.ScalarContact(stops), source=lambda x: np.where(x[:, 0] < 0.5, 8.0, -8.0))
    found = {name: hv.solve(problem, hv.solvers.METHODS[name]).raise_for_status() for name in ("newton", "multigrid")}
    u = found["newton"].displacement[:, 0]
    np.testing.assert_allclose(found["multigrid"].displacement[:, 0], u, atol=1e-9)
    assert u.max() == pytest.approx(0.02, abs=1e-14)
    assert u.min() == pytest.approx(-0.03, abs=1e-14)
    x = problem.mesh.points[found["newton"].problem.contact.node, 0]
    assert (found["newton"].pressure[x < 0.5] >= -1e-9).all()
    assert (found["newton"].pressure[x > 0.5] <= 1e-9).all()
