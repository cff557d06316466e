"""Hertz, Cattaneo and Mindlin, and the patch: ``benchmarks/verification.py`` on coarse meshes."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from hemivar.fem import discretize
from hemivar.files.boundary import contact_boundaries
from hemivar.files.problem_file import read_problem
from hemivar.laws import Bilateral
from hemivar.mechanics import Contact, ContactProblem, Fixed, Material, Prescribed, Quadrature
from hemivar.solvers import Solution, solve
from tests import bodies
from tests.samples import slow

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def _benchmark() -> ModuleType:
    sys.path.insert(0, str(BENCHMARKS))
    try:
        spec = importlib.util.spec_from_file_location("verification_benchmark", BENCHMARKS / "verification.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(BENCHMARKS))
    return module


known = _benchmark()


def solved(problem: ContactProblem) -> Solution:
    return solve(discretize(problem)).raise_for_status()


# ---- the closed forms themselves ---------------------------------------------------------------------------


def divergence_of_stress(
    field: Callable[[np.ndarray], np.ndarray], points: np.ndarray, young: float, poisson: float
) -> np.ndarray:
    """``mu lap u + (lam + mu) grad div u`` by difference quotients."""
    dim, step = points.shape[1], 1e-3
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    e = step * np.eye(dim)

    def second(i: int, j: int) -> np.ndarray:
        if i == j:
            return (field(points + e[i]) - 2 * field(points) + field(points - e[i])) / step**2
        corners = field(points + e[i] + e[j]) - field(points + e[i] - e[j])
        return (corners - field(points - e[i] + e[j]) + field(points - e[i] - e[j])) / (4 * step**2)

    laplace = sum(second(i, i) for i in range(dim))
    graddiv = np.column_stack([sum(second(i, j)[:, j] for j in range(dim)) for i in range(dim)])
    return mu * laplace + (lam + mu) * graddiv


@pytest.mark.parametrize("name", ["flamant", "flamant_tangential", "boussinesq"])
def test_half_space_fields_are_in_equilibrium(name: str) -> None:
    dim = 3 if name == "boussinesq" else 2
    more = (1.0,) if dim == 2 else ()
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (40, dim)) + np.eye(dim)[-1] * 2.0

    def field(x: np.ndarray) -> np.ndarray:
        return getattr(known, name)(x, 1.0, 2.0, 0.3, *more)

    assert np.abs(divergence_of_stress(field, points, 2.0, 0.3)).max() < 1e-5


@pytest.mark.parametrize("name", ["flamant", "flamant_tangential"])
def test_forces_of_plane_half_space_fields(name: str) -> None:
    """The traction on a half circle about the origin balances the force."""
    young, poisson, step = 2.0, 0.3, 1e-5
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    angle = (np.arange(2000) + 0.5) * np.pi / 2000
    normal = np.column_stack([np.cos(angle), np.sin(angle)])

    def field(x: np.ndarray) -> np.ndarray:
        return getattr(known, name)(x, 3.0, young, poisson, 1.0)

    gradient = np.stack([(field(normal + e) - field(normal - e)) / (2 * step) for e in step * np.eye(2)], axis=2)
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    stress = 2 * mu * strain + lam * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    total = np.einsum("kij,kj->i", stress, normal) * np.pi / 2000
    expected = [0.0, -3.0] if name == "flamant" else [-3.0, 0.0]
    np.testing.assert_allclose(total, expected, atol=1e-5)


def test_approach_of_the_line_contact_is_the_integral_of_the_pressure() -> None:
    """The displacement of the middle by numerical integration of the logarithmic kernel, for Hertz's pressure."""
    hertz = known.LineHertz(3.0, 0.2, 5.0)
    t = (np.arange(400_000) + 0.5) / 400_000 * hertz.half_width
    kernel = -2.0 / (np.pi * hertz.modulus) * np.log(t / 7.0)
    found = 2.0 * (hertz.pressure(t) * kernel).mean() * hertz.half_width
    assert hertz.approach(7.0) == pytest.approx(found, rel=1e-5)


def test_reference_numbers() -> None:
    """Problems of the literature with their published numbers."""
    sphere = known.PointHertz(1.0, 0.1, 1.5e7)
    assert (sphere.force, sphere.peak, sphere.approach) == pytest.approx((2.0e4, 9.549e5, 0.01), rel=1e-4)
    cylinders, _ = known.cattaneo_data(0.3)
    found = (cylinders.normal.half_width, cylinders.normal.peak, cylinders.stick)
    assert found == pytest.approx((0.68078, 9.3514, 0.49651), rel=1e-4)


# ---- Hertz -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("view", "normals"), [("circle", "obstacle"), ("plane", "body"), slow("circle", "body"), slow("plane", "obstacle")]
)
def test_line_contact(view: str, normals: str) -> None:
    """Force to O(h^2), pressure in the mean square to O(h), h in units of a; the constants are twice the measured."""
    errors = {}
    for cells in (6, 12, 24):
        problem, hertz = known.line_problem(cells, view, normals)
        errors[cells] = found = known.hertz_errors(solved(problem), hertz)
        assert abs(found["force"]) < 0.3 / cells**2 + 1e-3, cells
        assert abs(found["half_width"]) < 0.15 / cells, cells
        assert found["pressure"] < 0.4 / cells, cells
        assert abs(found["peak"]) < 0.4 / cells**2 + 1e-3, cells
    assert errors[24]["pressure"] < 0.4 * errors[6]["pressure"]


def test_the_two_views_of_a_line_contact_agree_for_slender_contacts() -> None:
    """Normals of obstacle and body differ by O(a/R): ten times slenderer, ten times closer."""
    differences = []
    for half_width in (0.01, 0.001):
        forces = []
        for normals in ("obstacle", "body"):
            problem, hertz = known.line_problem(8, "circle", normals, half_width, 20.0)
            forces.append(known.hertz_errors(solved(problem), hertz)["force"])
        differences.append(abs(forces[0] - forces[1]))
    assert differences[0] < 2e-3
    assert differences[1] == pytest.approx(0.1 * differences[0], rel=0.1)


@pytest.mark.parametrize("view", ["sphere", "plane"])
def test_point_contact(view: str) -> None:
    forces = []
    for cells in (2, 4):
        problem, hertz = known.sphere_problem(cells, view)
        found = known.hertz_errors(solved(problem), hertz)
        forces.append(found["force"])
        assert abs(found["force"]) < 1.6 / cells**2, cells
        assert found["pressure"] < 0.5 / cells, cells
        assert abs(found["half_width"]) < 0.3 / cells, cells
    assert np.log2(forces[0] / forces[1]) > 1.3


@pytest.mark.parametrize(("view", "constant"), [("sphere", 0.26), ("plane", 0.26)])
def test_point_contact_of_quadratic_tetrahedra(view: str, constant: float) -> None:
    """Force to O(h^2); constants are twice the measured."""
    forces = []
    for cells in (2, 3):
        problem, hertz = known.sphere_problem(cells, view)
        found = known.hertz_errors(solved(replace(problem, order=2)), hertz)
        forces.append(found["force"])
        assert abs(found["force"]) < constant / cells**2, cells
    assert np.log(forces[0] / forces[1]) > 1.6 * np.log(3 / 2)


def test_quadratic_tetrahedra_of_a_round_body_touch_with_its_arcs() -> None:
    """Middles of straight edges are off the sphere; with the arcs there the gap is that of a flat body and a sphere."""
    forces = []
    for view, geometry in (("sphere", "curved"), ("plane", "curved"), ("plane", "as-meshed")):
        problem, hertz = known.sphere_problem(2, view)
        forces.append(known.hertz_errors(solved(replace(problem, order=2, geometry=geometry)), hertz)["force"])
    assert abs(forces[1] - forces[0]) < 1e-3
    assert abs(forces[2] - forces[0]) > 0.05


@pytest.mark.slow
def test_point_contact_converges() -> None:
    forces, pressures = [], []
    for cells in (3, 6):
        problem, hertz = known.sphere_problem(cells)
        found = known.hertz_errors(solved(problem), hertz)
        forces.append(found["force"])
        pressures.append(found["pressure"])
    assert np.log2(forces[0] / forces[1]) > 1.6
    assert forces[1] < 0.04
    assert pressures[1] < 0.07


def smooth_pressure_errors(cells: int) -> tuple[float, float, float]:
    """Manufactured smooth contact on a quarter: errors at the corner, on the symmetry planes and between them."""
    young, poisson = 1.0, 0.3
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))

    def exact(p: np.ndarray) -> np.ndarray:
        x, y, z = p.T
        parts = (-np.sin(x) * np.cos(y), -np.cos(x) * np.sin(y), np.cos(x) * np.cos(y))
        return np.column_stack(parts) * np.exp(-z)[:, None]

    def force(p: np.ndarray) -> np.ndarray:
        # lap u = -u, grad div u = -3 u, but for the sign of its third component
        return mu * exact(p) - (lam + mu) * 3.0 * exact(p) * [-1.0, -1.0, 1.0]

    bottom = Contact(Bilateral(), gap=lambda p: -np.cos(p[:, 0]) * np.cos(p[:, 1]))
    far = Prescribed(exact)
    problem = bodies.cube(
        bottom,
        cells,
        material=Material.young(young, poisson),
        supports={"left": Fixed(x=0.0), "front": Fixed(y=0.0), "right": far, "back": far, "top": far},
        body_force=force,
    )
    solution = solved(problem)
    points = solution.problem.contact.points
    pressure = np.cos(points[:, 0]) * np.cos(points[:, 1])
    error = solution.pressure / (3 * lam + 2 * mu) - pressure
    low, high = points[:, :2].min(axis=1), points[:, :2].max(axis=1)
    corner, inner = high < 1e-9, high < 0.6
    planes = inner & (low < 1e-9) & ~corner
    between = inner & ~planes & ~corner
    return float(np.abs(error[corner]).max()), float(np.abs(error[planes]).max()), float(np.abs(error[between]).max())


def test_pressure_on_planes_of_symmetry_converges() -> None:
    """Where the pattern of tetrahedra is mirrored, nodal pressures err by O(h); that must vanish with h."""
    coarse, fine = smooth_pressure_errors(4), smooth_pressure_errors(8)
    for before, after in zip(coarse[:2], fine[:2], strict=True):
        assert np.log2(before / after) > 0.6
    assert fine[2] < 0.5 * fine[1]


# ---- problem files -----------------------------------------------------------------------------------------

PROBLEMS = Path(__file__).parents[2] / "examples" / "problems"


def test_file_of_the_cylinder_is_hertz() -> None:
    """Force, half width and largest pressure of the file fit each other; (a/side)^2 is 1.4 per cent."""
    solution = solved(read_problem(PROBLEMS / "hertz_line.toml"))
    modulus = known.contact_modulus(210e3, 0.3)
    half_width = np.sqrt(4 * 2 * solution.normal_force * 200 / (np.pi * modulus))
    errors = known.hertz_errors(solution, known.LineHertz(200.0, float(half_width), modulus))
    assert abs(errors["half_width"]) < 0.02
    assert abs(errors["peak"]) < 0.02
    assert errors["pressure"] < 0.05


def test_file_of_the_sphere_is_hertz() -> None:
    """Four cells along the radius, which is a third of the side."""
    solution = solved(read_problem(PROBLEMS / "hertz_sphere.toml"))
    modulus = known.contact_modulus(210e3, 0.3)
    radius = (3 * 4 * solution.normal_force * 200 / (4 * modulus)) ** (1 / 3)
    errors = known.hertz_errors(solution, known.PointHertz(200.0, float(radius), modulus))
    assert abs(errors["half_width"]) < 0.1
    assert errors["pressure"] < 0.15


@pytest.mark.parametrize("quadrature", list(Quadrature))
def test_contact_boundary_is_found_with_normals_of_the_obstacle(quadrature: Quadrature) -> None:
    problem, _ = known.line_problem(4, "circle", "obstacle", 0.1, 5.0, quadrature)
    discrete = discretize(problem)
    (boundary,) = contact_boundaries(discrete)
    assert boundary.name == "contact"
    assert len(boundary.index) == discrete.contact_points


# ---- Cattaneo and Mindlin ----------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [4, 8])
def test_partial_slip_with_a_frozen_bound(cells: int) -> None:
    problem, cattaneo = known.cattaneo_problem(cells, poisson=0.3, order=1, bound=True)
    found = known.cattaneo_errors(solved(problem), cattaneo)
    assert abs(found["tangential"]) < 0.6 / cells**2
    assert abs(found["stick"]) < 0.7 / cells  # sticking nodes are counted
    assert found["friction"] < 0.6 / cells


def test_partial_slip_with_coulombs_law() -> None:
    """Nearly incompressible, so that the friction does not change the pressure: normal and tangential part decouple."""
    problem, cattaneo = known.cattaneo_problem(6)
    solution = solved(problem)
    found = known.cattaneo_errors(solution, cattaneo)
    assert abs(found["tangential"]) < 0.005
    assert abs(found["stick"]) < 0.7 / 6
    assert found["friction"] < 0.1
    assert abs(solution.normal_force / cattaneo.normal.force - 1.0) < 0.005
    bound = cattaneo.friction * np.maximum(solution.pressure, 0.0)
    assert np.all(np.abs(solution.friction[:, 0]) <= bound + 1e-8 * bound.max())


# ---- patch -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dim", [2, 3])
def test_zero_poisson_patch(dim: int) -> None:
    assert known.patch_error(dim, 3) < 1e-12
