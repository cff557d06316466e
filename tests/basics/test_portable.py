"""Problems, laws and results are pickled and copied, and answer as before."""

from __future__ import annotations

import copy
import functools
import multiprocessing
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.portable import PickleMixin
from hemivar.laws.friction import ABSOLUTE_VALUE
from hemivar.mesh.mesh import Mesh
from tests import bodies
from tests.problems import discrete_square, square

Thing = TypeVar("Thing")


def around(value: Thing) -> Thing:
    """Through pickle."""
    return pickle.loads(pickle.dumps(value))


TRIPS = {"pickle": around, "deepcopy": copy.deepcopy, "copy": copy.copy}


def half_gap(points: np.ndarray) -> np.ndarray:
    return 0.01 + 0.0 * points[:, 0]


def cubic(r: np.ndarray) -> np.ndarray:
    return r**4 / 4.0


def cubic_slope(r: np.ndarray) -> np.ndarray:
    return r**3


def cubic_curvature(r: np.ndarray) -> np.ndarray:
    return 3.0 * r**2


LAWS = {
    "compliance": hv.Compliance(50.0, 2.0),
    "survey": hv.laws.ThresholdCompliance(0.3, 2.0),
    "signorini": hv.Signorini(),
    "no contact": hv.laws.NoContact(),
    "formula": hv.FormulaLaw("10 * max(r, 0)^2"),
    "function": hv.laws.FunctionLaw(cubic, cubic_slope, cubic_curvature),
    "table": hv.table_law([0.0, 0.01, 0.02], [0.0, 1.0, 0.5]),
    "softening": hv.Softening(50.0, 1.0, 10.0),
    "function of x": hv.Compliance(functools.partial(half_gap)),
}
FRICTION = {
    "tresca": hv.Tresca(0.5),
    "weakening": hv.SlipWeakening(1.0, 0.5, 200.0),
    "static": hv.laws.StaticKinetic(1.0, 0.5, 0.01),
    "coulomb": hv.Coulomb(0.3),
    "orthotropic": hv.laws.OrthotropicFriction(hv.laws.CoulombBound(0.3), ratio=0.5),
    "bound table": hv.Tresca(hv.laws.PenetrationBound(([0.0, 1.0], [0.0, 2.0]))),
    "bound formula": hv.Tresca(hv.laws.PenetrationBound("min(8*s, 0.8)")),
}


@pytest.mark.parametrize("trip", TRIPS)
@pytest.mark.parametrize("name", LAWS)
def test_normal_laws_answer_as_before(name: str, trip: str) -> None:
    law, points = LAWS[name], np.zeros((5, 2))
    r = np.linspace(-0.03, 0.03, 5)
    there = TRIPS[trip](law)
    assert there.name == law.name
    law, there = law.at(points), there.at(points)
    np.testing.assert_array_equal(there.value(r), law.value(r))
    np.testing.assert_array_equal(there.weak_convexity, law.weak_convexity)
    there = TRIPS[trip](law)  # resolved, and with what it remembers
    np.testing.assert_array_equal(there.local_argmin(np.full(5, 1e3), r), law.local_argmin(np.full(5, 1e3), r))


@pytest.mark.parametrize("trip", TRIPS)
@pytest.mark.parametrize("name", FRICTION)
def test_friction_laws_answer_as_before(name: str, trip: str) -> None:
    law = FRICTION[name]
    there = TRIPS[trip](law)
    assert there.name == law.name
    assert there.state_dependent == law.state_dependent
    s = np.linspace(0.0, 0.5, 4)
    np.testing.assert_array_equal(there.frozen(s, s).radial.value(s), law.frozen(s, s).radial.value(s))
    assert (there.profile is ABSOLUTE_VALUE) == (law.profile is ABSOLUTE_VALUE)


@pytest.mark.parametrize("trip", ["pickle", "deepcopy"])
def test_meshes_stay_read_only_and_know_what_they_refine(trip: str) -> None:
    mesh = hv.rectangle((1.0, 1.0), (4, 4)).refined()
    assert mesh.edges.size
    assert mesh.parent is not None
    there: Mesh = TRIPS[trip](mesh)
    fields = {"points", "cells", "boundaries", "regions", "parent", "recipe", "interfaces", "reading"}
    assert set(vars(there)) == fields, "caches travelled"
    assert isinstance(there.boundaries, MappingProxyType)
    for name, part in mesh.boundaries.items():
        np.testing.assert_array_equal(there.boundaries[name], part)
        assert not there.boundaries[name].flags.writeable
    assert not there.points.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        there.points[0, 0] = 1.0
    np.testing.assert_array_equal(there.edges, mesh.edges)
    assert there.parent is not None
    np.testing.assert_array_equal(there.parent.ends, mesh.parent.ends)


@pytest.mark.parametrize("trip", TRIPS)
@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=["newton", "multigrid"]
)
def test_problems_are_solved_as_before_bit_by_bit(method: object, trip: str) -> None:
    problem = square(n=32)
    discrete = hv.discretize(problem)
    expected = hv.solve(discrete, method)
    for there in (hv.discretize(TRIPS[trip](problem)), TRIPS[trip](discrete)):
        found = hv.solve(there, method)
        np.testing.assert_array_equal(found.unknowns, expected.unknowns)
        np.testing.assert_array_equal(found.multiplier, expected.multiplier)


def test_a_hierarchy_stays_at_home() -> None:
    discrete = discrete_square(n=32)
    before = len(pickle.dumps(discrete))
    hv.solve(discrete, hv.solvers.NonsmoothMultigrid())
    assert len(pickle.dumps(discrete)) == before


@pytest.mark.parametrize("trip", TRIPS)
def test_condensed_problems(trip: str) -> None:
    discrete = discrete_square()
    system = hv.systems.condense(discrete)
    pair = TRIPS["pickle"]((discrete, system)) if trip == "pickle" else None
    there = pair[1] if pair else TRIPS[trip](system)
    np.testing.assert_array_equal(there.matrix, system.matrix)
    problem = there.problem
    if pair:
        assert problem is pair[0]
    found = hv.solve(problem, workspace=hv.systems.Workspace.holding(there))
    np.testing.assert_array_equal(found.unknowns, hv.solve(discrete).unknowns)


@pytest.mark.parametrize("trip", TRIPS)
def test_solutions_and_certificates(trip: str) -> None:
    discrete = discrete_square()
    solution = hv.solve(discrete)
    assert solution.energy
    there = TRIPS[trip](solution)
    if trip != "copy":
        assert "energy" not in vars(there)
    assert there.energy == solution.energy
    assert there.status is solution.status
    assert there.timings == solution.timings
    certificate = hv.certify(discrete, solution.unknowns, solution.multiplier)
    again = TRIPS[trip](certificate)
    assert again.record() == certificate.record()
    assert again.kind is certificate.kind


@pytest.mark.parametrize("trip", TRIPS)
def test_histories_with_what_contact_points_remember(trip: str) -> None:
    """Memories are mappings in a mapping: those inside travel too, and arrive read-only."""
    contact = hv.Contact(hv.Adhesive(5.0, 1.0, 1.0), memory=(hv.laws.Secant(),))
    problem = bodies.strip(contact, (4, 2), viscosity=(0.4, 0.4), body_force=(0.0, 0.5))
    history = hv.march(hv.Evolution(problem), 0.2, step=0.1)
    again = TRIPS[trip](history)
    assert np.array_equal(again["normal_force"], history["normal_force"])
    (name,) = history.state.memory
    made, was = again.state.memory[name], history.state.memory[name]
    assert isinstance(made, MappingProxyType)
    assert not made["0.opening"].flags.writeable
    for one, other in ((made, was), (again.frames[-1].memory, history.frames[-1].memory)):
        assert np.array_equal(one["0.opening"], other["0.opening"])
        assert one["0.opening"].flags.writeable == other["0.opening"].flags.writeable


def test_methods_controls_and_errors() -> None:
    for method in hv.solvers.METHODS.values():
        assert around(method) == method
    assert around(hv.Controls(rtol=1e-6)) == hv.Controls(rtol=1e-6)
    assert str(around(hv.errors.ProblemError("so"))) == "so"


def test_replaced_fields() -> None:
    problem = square(n=4)
    assert replace(around(problem), title="other").title == "other"
    discrete = hv.discretize(problem)
    there = around(discrete).with_(load=2.0 * discrete.load)
    np.testing.assert_array_equal(there.load, 2.0 * discrete.load)


@pytest.mark.parametrize("supports", ["number", "function"])
def test_functions_that_can_be_imported_travel(supports: str) -> None:
    value = 0.0 if supports == "number" else half_gap
    problem = replace(square(n=4), supports={"left": hv.Fixed(x=value, y=0.0)})
    problem = replace(problem, contact={"bottom": hv.Contact(hv.Signorini(), gap=half_gap)})
    here, there = hv.discretize(problem), hv.discretize(around(problem))
    np.testing.assert_array_equal(here.gap, there.gap)
    np.testing.assert_array_equal(here.load, there.load)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hv.Compliance(lambda x: 1.0 + x[:, 0]), "Compliance 'compliance' cannot be pickled: its stiffness is"),
        (lambda: hv.Contact(hv.Signorini(), gap=lambda x: 0 * x[:, 0]), "Contact cannot be pickled: its gap is the"),
        (lambda: hv.laws.FunctionLaw(lambda r: r**2, lambda r: 2 * r, lambda r: 2 + 0 * r), "give a formula as text"),
        (lambda: hv.Fixed(x=lambda x: 0 * x[:, 0]), "Fixed cannot be pickled: its x is the function"),
        (lambda: hv.Pressure(lambda x: 0 * x[:, 0]), "Pressure cannot be pickled: its value is"),
        (lambda: hv.Material.young(lambda x: 1 + x[:, 0], 0.3), "Young cannot be pickled: its E is the function"),
        (lambda: hv.laws.PenetrationBound(lambda s: 0 * s), "PenetrationBound cannot be pickled: its source is"),
        (lambda: hv.mechanics.SignedDistance(lambda x: x[:, 1]), "SignedDistance cannot be pickled"),
        (lambda: replace(square(n=2), body_force=lambda x: 0 * x), "ContactProblem cannot be pickled: its body_force"),
        (lambda: replace(square(n=2), tractions={"top": lambda x: 0 * x}), r"its tractions\['top'\] is the function"),
        (lambda: hv.discretize(replace(square(n=2), body_force=lambda x: -1 + 0 * x)), "its body_force is"),
        (lambda: hv.Compliance(functools.partial(lambda a, x: a + x[:, 0], 1.0)), "its stiffness is the function"),
    ],
)
def test_functions_that_cannot_be_imported_are_told_of(make: Callable[[], object], message: str) -> None:
    thing = make()
    with pytest.raises(hv.errors.ProblemError, match=message):
        pickle.dumps(thing)
    copy.deepcopy(thing)  # stays in this process
    copy.copy(thing)


def test_classes_that_cannot_be_imported_are_told_of() -> None:
    @dataclass(frozen=True)
    class Inner(PickleMixin):
        value: int

    with pytest.raises(hv.errors.ProblemError, match=r"Inner objects cannot be pickled: .* move it there"):
        pickle.dumps(Inner(1))
    assert copy.deepcopy(Inner(1)).value == 1


def test_other_picklers_that_send_functions_may(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cloudpickle", copy)
    with pytest.raises((AttributeError, pickle.PicklingError)):  # plain pickle's own words
        pickle.dumps(hv.Compliance(lambda x: x[:, 0]))


def test_copies_share_what_was_computed() -> None:
    discrete = discrete_square(n=4)
    assert discrete.linear.diagonal.size
    assert copy.copy(discrete).linear.diagonal is discrete.linear.diagonal
    assert discrete.with_(law=discrete.law).linear.diagonal is discrete.linear.diagonal


def test_deep_copies_share_nothing_that_can_be_written() -> None:
    discrete = discrete_square(n=4)
    there = copy.deepcopy(discrete)
    assert not np.shares_memory(there.load, discrete.load)
    assert not np.shares_memory(there.stiffness.data, discrete.stiffness.data)
    assert there.field is not None
    assert there.field.mesh is there.origin.mesh  # what was one object is one object


SPAWN = """
import multiprocessing
import numpy as np
import hemivar as hv
from tests.problems import square

if __name__ == "__main__":
    problems = [hv.discretize(square(data, 8)) for data in ("data (5.1)", "figure 4", "rigid")]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        there = pool.map(hv.solve, problems)
    for problem, solution in zip(problems, there):
        np.testing.assert_array_equal(solution.unknowns, hv.solve(problem).unknowns)
        assert hv.certify(solution.problem, solution.unknowns, solution.multiplier).stationary
    print("same")
"""


def test_a_pool_of_spawned_processes_solves(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SPAWN, encoding="utf-8")
    path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, sys.path)])
    env = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, timeout=120, env=env)
    assert done.stdout.split() == ["same"], done.stderr


def test_a_pool_tells_of_functions() -> None:
    problem = hv.discretize(replace(square(n=2), body_force=lambda x: -1.0 + 0.0 * x))
    with (
        multiprocessing.get_context("spawn").Pool(1) as pool,
        pytest.raises(hv.errors.ProblemError, match="body_force"),
    ):
        pool.map(hv.solve, [problem])
