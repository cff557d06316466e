"""Threads: one for BLAS while multigrid works, given back whoever leaves last; and solves that share levels."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from threadpoolctl import ThreadpoolController

import hemivar as hv
from hemivar import gallery
from hemivar.linear.threads import one_thread
from hemivar.mesh.mesh import Mesh
from hemivar.systems.body_on_levels import levels_of
from tests.samples import sampled


def counts() -> list[int]:
    return [library.num_threads for library in ThreadpoolController().select(user_api="blas").lib_controllers]


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """BLAS with two threads, whatever the machine has."""
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        pass  # a limit that is held belongs to this thread
    before = counts()
    for library in ThreadpoolController().select(user_api="blas").lib_controllers:
        library.set_num_threads(2)
        getattr(type(library), "clear_controlling_thread", lambda: None)()
    assert set(counts()) == {2}
    yield
    for library, count in zip(ThreadpoolController().select(user_api="blas").lib_controllers, before, strict=True):
        library.set_num_threads(count)
        getattr(type(library), "clear_controlling_thread", lambda: None)()


class Worker:
    """A thread that enters the context, and leaves it when it is told to."""

    def __init__(self) -> None:
        self.inside, self.leave = threading.Event(), threading.Event()
        self.done, self.end = threading.Event(), threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()
        assert self.inside.wait(10)

    def run(self) -> None:
        with one_thread():
            self.inside.set()
            self.leave.wait(10)
        self.done.set()
        self.end.wait(10)  # alive still, as the threads of a pool are

    def out(self) -> None:
        self.leave.set()
        assert self.done.wait(10)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["first in, first out", "first in, last out"])
def test_threads_leave_in_any_order(order: tuple[int, int]) -> None:
    workers = [Worker(), Worker()]
    try:
        assert set(counts()) == {1}
        workers[order[0]].out()
        assert set(counts()) == {1}, "the other is at work"
        workers[order[1]].out()
        assert set(counts()) == {2}
    finally:
        for worker in workers:
            worker.leave.set()
            worker.end.set()
            worker.thread.join()
    assert set(counts()) == {2}


def test_it_is_entered_twice_and_left_by_an_error() -> None:
    with one_thread(), one_thread():
        assert set(counts()) == {1}
    assert set(counts()) == {2}
    with pytest.raises(ZeroDivisionError), one_thread():
        _ = 1 / 0
    assert set(counts()) == {2}
    with one_thread(wanted=False):
        assert set(counts()) == {2}


def test_what_the_user_set_in_the_meantime_is_not_forgotten() -> None:
    with ThreadpoolController().limit(limits=1, user_api="blas"):
        with one_thread():
            assert set(counts()) == {1}
        assert set(counts()) == {1}
    assert set(counts()) == {2}


# ---- what solves share -----------------------------------------------------------------------------------------


def bits(thing: object, seen: set[int]) -> list[bytes]:
    """Every array that an object holds, its attributes' arrays included, as bytes."""
    if id(thing) in seen:
        return []
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        return [thing.tobytes()]
    if sp.issparse(thing):
        return [thing.data.tobytes(), thing.indices.tobytes(), thing.indptr.tobytes()]
    if isinstance(thing, tuple | list):
        return [part for item in thing for part in bits(item, seen)]
    if isinstance(thing, dict):
        return [part for _, item in sorted(thing.items(), key=lambda pair: str(pair[0])) for part in bits(item, seen)]
    if type(thing).__module__.startswith("hemivar."):
        known = [name for name in vars(thing) if not name.startswith("_")] if hasattr(thing, "__dict__") else []
        return [part for name in sorted(known) for part in bits(getattr(thing, name), seen)]
    return []


def without_meshes() -> hv.ContactProblem:
    statement = gallery.survey("5.1", 24, "right")
    mesh = statement.mesh
    return replace(statement, mesh=Mesh(mesh.points, mesh.cells, dict(mesh.boundaries)))


STATEMENTS = [lambda: gallery.survey("5.1", 16), lambda: gallery.survey_cube("5.1", 8), without_meshes]


@pytest.mark.parametrize(
    ("state", "method"),
    sampled(
        itertools.product(
            STATEMENTS,
            (hv.solvers.NonsmoothMultigrid(), hv.solvers.NonsmoothNewton()),
        ),
        3,
    ),
)
def test_a_solve_changes_no_bit_of_problem_and_workspace(
    state: Callable[[], hv.ContactProblem], method: hv.Solver
) -> None:
    problem, workspace = hv.discretize(state()), hv.systems.Workspace()
    levels = levels_of(problem, workspace)
    once = hv.solve(problem, method, workspace=workspace)
    _ = levels.solve(problem.load)  # makes what the compiled kernels read
    hv.certify(problem, once.unknowns, once.multiplier)  # and what is kept of the laws
    held = [problem, problem.space, levels.levels, levels.steps]
    before = bits(held, set())
    assert len(before) > 40
    again = hv.solve(problem, method, workspace=workspace)
    _ = levels.solve(problem.load)
    hv.certify(problem, again.unknowns, again.multiplier)
    assert bits(held, set()) == before
    np.testing.assert_array_equal(again.unknowns, once.unknowns)


def test_threads_with_two_laws_of_one_body_take_no_more_cycles() -> None:
    problem, workspace = hv.discretize(gallery.survey("5.1", 32, "right")), hv.systems.Workspace()
    at = problem.contact.points
    stiff = problem.with_(law=hv.laws.ContactLaw(hv.Compliance(20.0).at(at), hv.Tresca(0.1).at(at)))
    weak = problem.with_(load=0.5 * problem.load)
    problems = [problem, stiff, weak, stiff]
    alone = [hv.solve(one, hv.solvers.NonsmoothMultigrid()) for one in problems]
    assert {one.status for one in alone} == {hv.Status.CONVERGED}
    barrier = threading.Barrier(len(problems))

    def work(one: hv.DiscreteProblem) -> list[hv.Solution]:
        barrier.wait(30)
        return [hv.solve(one, hv.solvers.NonsmoothMultigrid(), workspace=workspace) for _ in range(3)]

    with ThreadPoolExecutor(len(problems)) as pool:
        together = list(pool.map(work, problems))
    for expected, found in zip(alone, together, strict=True):
        for solution in found:
            assert (solution.evaluations, solution.steps) == (expected.evaluations, expected.steps)
            np.testing.assert_array_equal(solution.unknowns, expected.unknowns)


def test_solves_of_one_thread_within_one_another_leave_each_other_alone() -> None:
    """A solve that a callback starts in the middle of another one works on the same levels."""
    problem, workspace = hv.discretize(gallery.survey("5.1", 16, "right")), hv.systems.Workspace()
    expected = hv.solve(problem, hv.solvers.NonsmoothMultigrid(), workspace=workspace)

    def inside(_: hv.Progress) -> bool:
        hv.solve(
            problem.with_(load=2.0 * problem.load), hv.solvers.NonsmoothMultigrid(nested=False), workspace=workspace
        )
        return False

    found = hv.solve(problem, hv.solvers.NonsmoothMultigrid(), hv.Controls(callback=inside), workspace=workspace)
    np.testing.assert_array_equal(found.unknowns, expected.unknowns)
