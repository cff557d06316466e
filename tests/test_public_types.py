"""``dataclasses.replace`` on the public types: what comes out is what went in, or it is refused in words."""

from __future__ import annotations

import copy
import dataclasses
import itertools
import pickle
from collections.abc import Mapping

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar import gallery
from hemivar.bounds.body_data import Kept
from hemivar.discrete import ContactPoints, Field, Quadratic, Space
from hemivar.errors import HemivarError
from hemivar.evolution.schemes.by_name import SCHEMES
from hemivar.files.problem_file import ProblemFile
from hemivar.files.settings import SolverSettings
from hemivar.formula import Formula
from hemivar.formula.graph import Graph
from hemivar.gallery.known import weighted_block
from hemivar.gallery.survey_problems import SURVEY_DATA
from hemivar.mesh import Mesh, box, rectangle
from hemivar.mesh.recipe import Grid, MeshRecipe

SCALAR = (gallery.membrane_obstacle(8), gallery.antiplane_friction(4))


#: What users do not make themselves.
NOT_MADE = {
    "FractureCriterion",
    "WinklerFoundation", "Interval", "InvariantEnergy", "Invariants", "IsotropicBounds", "LawDescription",
    "LawKink", "Linearisation", "LocalStep", "MemoryChain", "StoredEnergy",
}  # fmt: skip


def public_dataclasses() -> list[str]:
    rooms = (hv, hv.laws, hv.mechanics, hv.evolution)
    found = {name: getattr(room, name) for room in rooms for name in room.__all__ if name not in NOT_MADE}.items()
    return [name for name, value in found if isinstance(value, type) and dataclasses.is_dataclass(value)]


def examples() -> dict[str, list[object]]:
    """Objects of every public dataclass, with as much in them as they can hold."""
    problem = gallery.survey("5.1", 4)
    discrete = hv.discretize(problem)
    solution = hv.solve(discrete)
    certificate = hv.certify(discrete, solution.unknowns, solution.multiplier)
    path = hv.follow_path(discrete, (0.5, 1.0))
    adaptive = hv.bounds.solve_adaptive(problem, goal="contact.bottom.force", max_unknowns=1)
    assert adaptive.goal is not None
    steel, vector = hv.Material.young(210e3, 0.3, "stress"), (0.1, -0.2)
    regions = dataclasses.replace(rectangle(), regions={"all": np.arange(128)})
    plane_law = hv.laws.PiecewiseQuadratic([0.0, 1.0], [0.0, 2.0, 1.0], [0.5, -0.25], 0.1, upper=1.0, name="own")
    found: list[object] = [
        problem,
        discrete,
        solution,
        certificate,
        path,
        discrete.bulk,
        discrete.contact,
        discrete.space,
        discrete.field,
        problem.contact["bottom"],
        discrete.law,
        *discrete.law.sides(solution.local, solution.multiplier, np.full((4, 2), True), np.ones((4, 2)), 0.0),
        hv.mechanics.PowerLaw(3.0, 0.1, 2.0),
        hv.mechanics.SaturatingFlux(2.0, 0.25, 1.0),
        gallery.survey_cube("5.1", 2),
        hv.find_solutions(discrete),
        hv.certificates.smallness(discrete),
        regions.refined().scaled(0.5),
        rectangle().refined(2),
        rectangle((2.0, 1.0), 4, "cross"),
        box(cells=2),
        box(cells=2).refined(),
        problem.mesh.recipe,
        Grid((1.0, 2.0), (3, 4), "cross", (0.0, 1.0)),
        steel,
        hv.Material.lame(Formula("1 + x"), 2.0),
        hv.Material.tensor(np.eye(3), (0.1, 0.2, 0.3)),
        hv.materials.Branch(lame=(1, 2), time=0.5),
        hv.materials.Branch(young=Formula("1 + x"), poisson=0.3, time=2.0),
        hv.materials.Branch(tensor=np.eye(3), time=1.0),
        hv.Material.lame(
            1.0, 2.0, density=3.0, viscosity=(0, Formula("x")), branches=[hv.materials.Branch(lame=(1, 2), time=3)]
        ),
        hv.Material.by_region({"all": steel}),
        hv.Clamped(),
        hv.Roller(),
        hv.Fixed(x=0.5, y=Formula("x")),
        hv.Prescribed(vector),
        hv.mechanics.Spring(2.0, Formula("x")),
        hv.mechanics.RigidPlate(force=(0.0, Formula("2*t")), about=(0.0, 1.0), turn_z=0.0),
        hv.Pressure(2.0),
        hv.Plane(vector, (1.0, 3.0)),
        hv.mechanics.Sphere(vector, 2.0, True),
        hv.mechanics.Cylinder((1.0, 2.0, 3.0), (1.0, 1.0, 0.3), 0.5),
        hv.mechanics.SignedDistance(Formula("y + 1")),
        hv.laws.BilinearCohesion(30.0, 0.5, Formula("1e4 + x")),
        hv.laws.ExponentialCohesion(30.0, 0.5, 1e4),
        hv.laws.TrapezoidalCohesion(30.0, 0.5, 1e4, 0.005),
        hv.laws.MixedMode(hv.laws.BilinearCohesion(30.0, 0.5, 1e4), 1.5),
        hv.laws.ThresholdCompliance(0.3, Formula("1 + x")),
        hv.Signorini(),
        hv.laws.Bilateral(),
        hv.laws.Tie(),
        hv.laws.NoContact(),
        hv.Compliance(2.0, 1.5),
        hv.Softening(1.0, 2.0, 3.0),
        hv.laws.Capped(1.0, 2.0, 0.5),
        hv.laws.FinitePenetration(1.0, 2.0),
        hv.laws.BartonBandis(1.0, 2.0),
        hv.Adhesive(1.0, 2.0, 0.1),
        plane_law,
        hv.laws.Layered([1.0], [2.0]),
        hv.laws.SawTooth([1.0], [2.0]),
        hv.FormulaLaw("r^2 * max(r, 0)", reach=3.0),
        hv.table_law([0.0, 1.0], [0.0, 2.0]),
        hv.laws.Bolt(2.0),
        hv.Tresca(0.5),
        hv.SlipWeakening(0.5),
        hv.laws.SlipTable(1.0, [0.0, 1.0], [1.0, 0.5]),
        hv.Coulomb(0.3),
        hv.laws.OrthotropicFriction(1.0, ratio=0.5),
        hv.laws.OrthotropicLaw(hv.Signorini(), hv.laws.OrthotropicFriction(1.0)),
        hv.laws.CoupledFormulaLaw("r^2 + s^2", reach=1.0),
        hv.laws.BenzeggaghKenane(1.0, 2.0, 2.0),
        hv.laws.PowerCriterion(1.0, 2.0, 1.0),
        hv.laws.ModeDependentGlue(1.0, 1.5, 10.0, hv.laws.BenzeggaghKenane(1.0, 2.0, 2.0)),
        hv.laws.PlasticBond(1.0, 1.0, 1.0, 1.0, 1.0),
        hv.laws.CoulombBound(0.3),
        hv.laws.PenetrationBound("min(8*s, 0.8)", 3.0),
        hv.laws.PenetrationBound(([0.0, 1.0], [0.0, 2.0])),
        *hv.solvers.METHODS.values(),
        hv.solvers.FixedPoint(hv.solvers.NonsmoothNewton()),
        hv.solvers.SemismoothNewton(rounds=20),
        hv.solvers.LoadStepping(hv.solvers.NonsmoothNewton(), 3),
        hv.survey.Powell(),
        hv.survey.LBFGS(),
        hv.survey.ProximalBundle(),
        hv.survey.ExactInner(),
        hv.survey.NewtonKrylov(),
        hv.Controls(1e-6, 1.0, 3, 2.0, print),
        SURVEY_DATA["5.1"],
        weighted_block(),
        *(one.problem for one in SCALAR),
        SCALAR[0].problem.contact["area"],
        SCALAR[0].problem.material,
        SCALAR[1].problem.contact["bottom"],
        *SCALAR,
        SolverSettings("newton"),
        ProblemFile(problem, SolverSettings(), "name", 2),
        hv.laws.Bonding(50.0, 0.05, 0.2),
        hv.laws.DampedContact(hv.Compliance(2.0)),
        hv.laws.PenetrationMemory(30.0, 0.4),
        hv.laws.Secant(),
        hv.laws.RateAndState(0.01, 0.015, 8e-3, 1e-6, 1e-9, 1e6),
        hv.laws.SlipSum(),
        hv.laws.ViscousFoundation(2.0),
        hv.laws.Wear(Formula("1 + x")),
        hv.Evolution(problem),
        *SCHEMES.values(),
        hv.evolution.FixedStep(0.1),
        hv.evolution.AdaptiveStep(1e-3, 0.1, 0.01, 1.0),
        hv.evolution.Save(0.5, 10, {"tip": (0.5, 0.5)}),
        hv.evolution.Checkpoint("run.ckpt", 2.0),
        hv.march(hv.Evolution(problem), 0.1, step=0.1),
        hv.evolution.March(1.0, step=0.1, stops=(0.5,), events=(hv.evolution.Touch(),), jump="global"),
        hv.evolution.Touch("stop"),
        hv.evolution.Release(),
        hv.mechanics.HeatContact(2.0, Formula("x + t"), 0.5),
        hv.mechanics.HeatContact(exchange=hv.Compliance(2.0)),
        hv.mechanics.Heat(
            1.0,
            {"all": 2.0},
            expansion=0.1,
            temperature=Formula("x"),
            contact={"bottom": hv.mechanics.HeatContact(1.0)},
        ),
        adaptive,
        adaptive.levels[0],
        adaptive.distance,
        adaptive.goal,
        adaptive.goal.goal,
        hv.certify(solution, exact=True).exact,
        hv.evolution.Slip(rate=0.1),
        hv.evolution.BondBroken(below=0.1),
        hv.evolution.MarginLost(),
        hv.evolution.When(function=abs, label="own"),
        hv.study(problem, 1),
        hv.mechanics.Step("pull", tractions={"top": (0.0, -1.0)}, initial_stress=-1.0),
        hv.sweep(lambda _: problem, {"none": [0.0]}),
    ]
    made: dict[str, list[object]] = {}
    for one in found:
        for kind in type(one).__mro__:
            made.setdefault(kind.__name__, []).append(one)
    return made


@pytest.fixture(scope="module")
def made() -> dict[str, list[object]]:
    return examples()


def unlike(one: object, other: object, where: str = "") -> str | None:
    """Where two objects differ in what they hold, caches left out; None if they are alike."""
    if one is other:
        return None
    if type(one) is not type(other):
        return f"{where}: {type(one).__name__} and {type(other).__name__}"
    if isinstance(one, np.ndarray):
        same = one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")  # type: ignore[attr-defined, arg-type]
        return None if same else where
    if sp.issparse(one):
        return unlike(one.toarray(), other.toarray(), where)  # type: ignore[attr-defined]
    if isinstance(one, Mapping):
        if list(one) != list(other):  # type: ignore[call-overload]
            return where
        pairs = [(one[key], other[key], f"{where}[{key!r}]") for key in one]  # type: ignore[index]
    elif isinstance(one, tuple | list):
        if len(one) != len(other):  # type: ignore[arg-type]
            return where
        pairs = [(a, b, f"{where}[{k}]") for k, (a, b) in enumerate(zip(one, other, strict=True))]  # type: ignore[call-overload]
    elif isinstance(one, Mesh) and isinstance(
        other, Mesh
    ):  # the order of facets is no part of it, how its parents were made neither
        facets = [{name: np.unique(np.sort(f), axis=0) for name, f in mesh.boundaries.items()} for mesh in (one, other)]
        parts = ("points", "cells", "regions", "parent", *(() if ".parent" in where else ("recipe",)))
        pairs = [(facets[0], facets[1], f"{where}.boundaries")]
        pairs += [(getattr(one, name), getattr(other, name), f"{where}.{name}") for name in parts]
    elif dataclasses.is_dataclass(one):
        names = [field.name for field in dataclasses.fields(one) if not isinstance(getattr(one, field.name), Kept)]
        pairs = [(getattr(one, name), getattr(other, name), f"{where}.{name}") for name in names]
    elif isinstance(one, float) and np.isnan(one):
        return None if np.isnan(other) else where  # type: ignore[call-overload]
    elif isinstance(one, Graph):
        return unlike(one._nodes, other._nodes, where)  # type: ignore[attr-defined]
    elif callable(one) and hasattr(one, "func"):
        return unlike((one.func, one.args), (other.func, other.args), where)  # type: ignore[attr-defined]
    else:
        return None if one == other else where
    return next((place for a, b, path in pairs if (place := unlike(a, b, path))), None)


@pytest.mark.parametrize(
    "name", [*public_dataclasses(), "Grid", "MeshRecipe", "KnownProblem", "ProblemFile", "SolverSettings"]
)
def test_replacing_nothing_changes_nothing(name: str, made: dict[str, list[object]]) -> None:
    assert made.get(name), f"give an example of {name}"
    for one in made[name]:
        try:
            again = dataclasses.replace(one)  # type: ignore[type-var]
        except HemivarError:  # in words
            continue
        assert unlike(one, again) is None


def test_what_is_pickled_or_copied_is_what_it_was(made: dict[str, list[object]]) -> None:
    """Every public type, results among them: processes of their own are sent these."""
    around = (lambda one: pickle.loads(pickle.dumps(one)), copy.deepcopy, copy.copy)
    for name, ones in made.items():
        for one, trip in itertools.product(ones, around):
            try:
                again = trip(one)
            except HemivarError:  # in words: a function that another process could not import
                continue
            assert unlike(one, again) is None, name


def test_replacing_one_field_keeps_the_others(made: dict[str, list[object]]) -> None:
    mesh = rectangle((2.0, 1.0), 4).refined()
    renamed = dataclasses.replace(mesh, boundaries={"under": mesh.boundaries["bottom"]})
    assert renamed.parent is not None
    assert list(renamed.parent.mesh.boundaries) == ["under"]
    steel = dataclasses.replace(hv.Material.young(1.0, 0.3), plane="stress")  # type: ignore[call-arg]
    points = np.zeros((1, 2))
    np.testing.assert_array_equal(
        steel.stiffness_tensor(points), hv.Material.young(1.0, 0.3, "stress").stiffness_tensor(points)
    )
    for normal in np.random.default_rng(0).normal(size=(50, 3)):  # a direction is not made a unit vector twice
        plane = hv.Plane((0.0, 0.0, 0.0), normal)
        np.testing.assert_array_equal(dataclasses.replace(plane, point=(1.0, 1.0, 0.0)).normal, plane.normal)
    discrete = made["DiscreteProblem"][0]
    assert isinstance(discrete, hv.DiscreteProblem)
    for kind in (ContactPoints, Field, Quadratic, Space):
        assert made[kind.__name__]
    moved = dataclasses.replace(discrete.contact, weights=2.0 * discrete.contact.weights)
    assert unlike(dataclasses.replace(moved, weights=discrete.contact.weights), discrete.contact) is None
    assert isinstance(made["MeshRecipe"][0], MeshRecipe)
    assert made["MeshRecipe"][0].source == Grid((1.0, 1.0), (4, 4), "cross", (0.0, 0.0))


def test_arrays_that_were_given_do_not_change_what_was_made() -> None:
    point, normal, matrix = np.zeros(2), np.array([0.0, 1.0]), np.eye(3)
    plane, material = hv.Plane(point, normal), hv.Material.tensor(matrix)
    point[0], normal[0], matrix[0, 0] = 9.0, 9.0, 9.0
    assert plane.distance(np.array([[5.0, 2.0]])).tolist() == [2.0]
    assert material.stiffness_tensor(np.zeros((1, 2)))[0, 0, 0] == 1.0
    for array in (plane.point, plane.normal, dataclasses.asdict(material)["matrix"]):
        assert array is not None
    with pytest.raises(ValueError, match="read-only"):
        plane.normal[0] = 1.0  # type: ignore[index]
