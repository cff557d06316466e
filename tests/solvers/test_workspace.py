"""What is expensive about a body is paid once, by whoever owns the workspace, and changes no answer."""

from __future__ import annotations

import copy
import gc
import importlib
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import Quadratic
from hemivar.kernels import kernels
from hemivar.laws import ContactLaw
from hemivar.linear.pardiso import pardiso_available
from hemivar.solvers.newton_on_graph import KnownRounds
from hemivar.systems import elimination
from hemivar.systems.body_on_levels import ElasticMultigrid

from ..counting import sparse_factors
from ..problems import discrete_square


@pytest.fixture
def factorisations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Sizes of the matrices factorised."""
    sizes: list[int] = []
    original = elimination.factorise

    def counted(K: object, *rest: object) -> object:
        sizes.append(K.shape[0])  # type: ignore[attr-defined]
        return original(K, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(elimination, "factorise", counted)
    return sizes


def variants(problem: hv.DiscreteProblem) -> list[hv.DiscreteProblem]:
    other = ContactLaw(hv.Compliance(3.0), hv.Tresca(0.1))
    return [
        problem.with_(load=1.5 * problem.load),
        problem.with_(offset=problem.offset + 0.01),
        problem.with_(law=other),
    ]


def test_another_load_gap_or_law_costs_no_factorisation(factorisations: list[int]) -> None:
    problem = discrete_square(n=6)
    workspace = hv.systems.Workspace()
    newton = hv.solvers.NonsmoothNewton()
    found = [hv.solve(p, newton, workspace=workspace) for p in [problem, *variants(problem)]]
    assert len(factorisations) == 1
    alone = [hv.solve(p, newton) for p in [problem, *variants(problem)]]
    assert len(factorisations) == 5
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_array_equal(one.unknowns, other.unknowns)


def _counted(name: str, function: Callable[..., object], asked: list[str]) -> Callable[..., object]:
    def counted(*arguments: object) -> object:
        asked.append(name)
        return function(*arguments)

    return counted


def test_another_load_asks_nothing_of_law_and_body_again(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, workspace = discrete_square(n=6), hv.systems.Workspace()
    asked: list[str] = []
    module = importlib.import_module("hemivar.solvers.solve")  # which the function of this name hides
    for owner, name in ((module, "choose"), (module, "_check_coercive"), (ContactLaw, "chart")):
        monkeypatch.setattr(owner, name, _counted(name, getattr(owner, name), asked))
    for factor in (1.0, 1.5, 0.5):
        hv.solve(problem.with_(load=factor * problem.load), workspace=workspace)
    assert sorted(asked) == ["_check_coercive", "chart", "choose"]
    for other in variants(problem)[1:]:  # another gap, another law
        asked.clear()
        hv.solve(other, workspace=workspace)
        assert sorted(asked) == ["_check_coercive", "chart", "choose"]


def test_what_a_law_that_is_gone_has_left_is_not_taken_for_that_of_another() -> None:
    problem, workspace = discrete_square(n=6), hv.systems.Workspace()
    for bound in np.linspace(0.0, 0.4, 20).tolist():
        other = problem.with_(law=ContactLaw(hv.Compliance(3.0), hv.Tresca(bound)))
        assert workspace.under_any_load("bound", other, lambda bound=bound: bound) == bound  # type: ignore[misc]
        del other  # its place in memory is free for the next


def test_rounds_are_lent_to_one_at_a_time() -> None:
    known = KnownRounds()
    with known.lent() as one, known.lent() as other:
        assert one is not other
    with known.lent() as again:
        assert again in (one, other)


def test_threads_on_one_workspace_have_rounds_of_their_own() -> None:
    problem, workspace = discrete_square(n=8), hv.systems.Workspace()
    loads = [factor * problem.load for factor in np.linspace(0.2, 3.0, 40)]
    alone = [hv.solve(problem.with_(load=load)).unknowns for load in loads]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda load: hv.solve(problem.with_(load=load), workspace=workspace).unknowns, loads))
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)


@pytest.mark.skipif(pardiso_available(), reason="counts the solves of SuperLU")
def test_another_load_costs_two_sparse_solves(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, workspace, newton = discrete_square(n=12), hv.systems.Workspace(), hv.solvers.NonsmoothNewton()
    factors = sparse_factors(monkeypatch)
    first = hv.solve(problem, newton, workspace=workspace)
    spent = sum(one.solves for one in factors)
    other = problem.with_(load=1.5 * problem.load)
    found = hv.solve(other, newton, workspace=workspace, initial=first)
    assert sum(one.solves for one in factors) - spent == 2
    again = hv.discrete.residual(other, found.unknowns, found.multiplier)
    assert again.relative < 1e-12
    assert found.residual.total == pytest.approx(again.total, rel=1e-6, abs=1e-15 * again.scale)


@pytest.mark.parametrize("many", [False, True])
def test_reducing_a_load_and_extending_its_solution_against_dense_matrices(many: bool) -> None:
    problem = discrete_square(n=5)
    K, f = problem.stiffness, np.random.default_rng(2).standard_normal(problem.unknowns)
    kept = np.unique(problem.contact.trace.indices).astype(np.int64)
    inner = np.setdiff1d(np.arange(problem.unknowns), kept)
    dense = K.toarray()
    block = np.linalg.solve(dense[np.ix_(inner, inner)], f[inner])
    factor = elimination.factorise(K, kept, many)
    reduced = factor.reduce(f)
    # Half sweeps are those of the compiled kernels for many loads, and those of PARDISO for all.
    assert (reduced.inner is not None) is ((many and kernels() is not None) or pardiso_available())
    np.testing.assert_allclose(reduced.force, f[kept] - dense[np.ix_(kept, inner)] @ block, atol=1e-11)
    assert reduced.work == pytest.approx(f[inner] @ block, rel=1e-11)
    y = np.random.default_rng(3).standard_normal(kept.size)
    u = factor.extend(reduced, y)
    np.testing.assert_array_equal(u[kept], y)
    expected = np.linalg.solve(dense[np.ix_(inner, inner)], f[inner] - dense[np.ix_(inner, kept)] @ y)
    np.testing.assert_allclose(u[inner], expected, atol=1e-10 * np.abs(expected).max())
    alone = factor.solve_interior(f)
    np.testing.assert_array_equal(alone[kept], 0.0)
    np.testing.assert_allclose(alone[inner], block, atol=1e-10 * np.abs(block).max())


def test_levels_lent_to_two_solves_are_two_and_those_given_back_are_lent_again() -> None:
    problem = discrete_square(n=8)
    levels = ElasticMultigrid.of(problem).levels
    top = len(levels.sizes) - 1
    one, two = levels.borrow(top), levels.borrow(top)
    assert one is not two
    levels.give_back(one)
    assert levels.borrow(top) is one
    levels.give_back(one)
    known = weakref.ref(levels)
    del levels, two
    assert known() is None  # whose memory does not wait for the collector of circles


def test_another_body_costs_one(factorisations: list[int]) -> None:
    problem = discrete_square(n=4)
    bulk = problem.bulk
    assert isinstance(bulk, Quadratic)
    stiffer = problem.with_(bulk=Quadratic(2.0 * bulk.stiffness))
    workspace = hv.systems.Workspace()
    for p in (problem, stiffer, problem, stiffer):
        hv.solve(p, hv.solvers.NonsmoothNewton(), workspace=workspace)
    assert len(factorisations) == 2
    workspace.forget()
    hv.solve(problem, hv.solvers.NonsmoothNewton(), workspace=workspace)
    assert len(factorisations) == 3


def test_a_small_workspace_forgets_the_body_used_longest_ago(factorisations: list[int]) -> None:
    bodies = [discrete_square(n=n) for n in (2, 3, 4)]
    workspace = hv.systems.Workspace(bodies=2)
    for body in (bodies[0], bodies[1], bodies[0], bodies[2]):
        workspace.condensed(body)
    assert len(factorisations) == 3
    workspace.condensed(bodies[0])
    assert len(factorisations) == 3
    workspace.condensed(bodies[1])
    assert len(factorisations) == 4


def test_threads_wait_for_one_factorisation(factorisations: list[int]) -> None:
    problem = discrete_square(n=8)
    workspace, gate = hv.systems.Workspace(), threading.Barrier(8)
    problems = [problem, *variants(problem)] * 2

    def work(p: hv.DiscreteProblem) -> np.ndarray:
        gate.wait()
        return hv.solve(p, hv.solvers.NonsmoothNewton(), workspace=workspace).unknowns

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(work, problems))
    assert len(factorisations) == 1
    for u, p in zip(found, problems, strict=True):
        np.testing.assert_array_equal(u, hv.solve(p, hv.solvers.NonsmoothNewton()).unknowns)


def test_it_says_what_it_holds_and_travels_empty() -> None:
    workspace = hv.systems.Workspace()
    assert repr(workspace) == "Workspace(empty)"
    problem = discrete_square(n=2)
    workspace.condensed(problem)
    assert repr(workspace) == f"Workspace({problem.unknowns} unknowns: condensation)"
    assert repr(copy.deepcopy(workspace)) == "Workspace(empty)"


@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_a_solve_leaves_the_problem_as_it_was(method: str) -> None:
    problem = discrete_square(n=8)
    bulk, mesh = problem.bulk, problem.space.fields[0].mesh  # type: ignore[union-attr]
    assert isinstance(bulk, Quadratic)
    arrays = [
        bulk.stiffness.data,
        problem.load,
        problem.contact.trace.data,
        problem.offset,
        mesh.points,
        mesh.cells,
    ]
    before = [array.copy() for array in arrays]
    hv.solve(problem, hv.solvers.METHODS[method])
    for array, was in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(array, was)


def test_what_differs_is_checked_as_the_constructor_does() -> None:
    problem = discrete_square(n=2)
    with pytest.raises(hv.errors.ProblemError, match=r"load\[0\] = nan"):
        problem.with_(load=np.full(problem.unknowns, np.nan))
    with pytest.raises(hv.errors.ProblemError, match="load has 3 entries"):
        problem.with_(load=np.zeros(3))
    with pytest.raises(hv.errors.ProblemError, match="offset has shape"):
        problem.with_(offset=np.zeros((1, 2)))
    with pytest.raises(hv.errors.ProblemError, match="offset has shape"):
        problem.with_(offset=np.zeros((problem.contact_points, 1)))
    with pytest.raises(hv.errors.ProblemError, match="the bulk of a discrete problem is 3"):
        problem.with_(bulk=3)  # type: ignore[arg-type]


def test_a_body_that_is_forgotten_is_held_by_nothing() -> None:
    workspace, problem = hv.systems.Workspace(1), discrete_square(n=4)
    hv.solve(problem, workspace=workspace)
    held = weakref.ref(problem.model)
    workspace.condensed(discrete_square(n=6))
    del problem
    gc.collect()
    assert held() is None
