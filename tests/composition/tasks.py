"""What is asked of a problem, and the second way that each answer must agree with."""

from __future__ import annotations

import copy
import functools
import json
import multiprocessing
import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certificates import PointKind
from hemivar.discrete import Quadratic
from hemivar.evolution import Checkpoint, Evolution, History, march
from hemivar.fem.stress_stiffness import stiffens, stressed_problem
from hemivar.solvers import METHODS, FixedPoint, ProximalNewton, Solution
from tests.composition.cases import Problem, Row, at_rest, problem_of_row

_MINIMISERS = (PointKind.UNIQUE_MINIMISER, PointKind.GLOBAL_MINIMISER, PointKind.LOCAL_MINIMISER)

__all__ = ["IN_TIME", "TASKS", "Refused"]

#: Until when bodies march, and in how many steps.
_UNTIL, _STEPS = 0.4, 8
#: Tolerance of solves, and how near two ways must come to each other where both are exact.
_TOLERANCE, _NEAR = hv.Controls(rtol=1e-11), 1e-6


class Refused(hv.HemivarError):
    """A task that ends with a sentence and no answer, though nothing was raised."""


def _same(one: Array, other: Array, near: float = _NEAR) -> None:
    size = max(float(np.abs(other).max(initial=0.0)), 1e-300)
    off = float(np.abs(np.asarray(one) - other).max(initial=0.0))
    assert off <= near * size, f"{off:.3g} apart, of {size:.3g}"


def _solved(row: Row, factor: float = 1.0) -> Solution:
    return hv.solve(at_rest(row, factor), controls=_TOLERANCE).raise_for_status()


def _by_another_method(solution: Solution) -> Solution:
    """The same problem by a method that shares no steps with the first one."""
    names = ("multigrid", "active-set", "augmented-lagrangian-newton", "newton", "bundle")
    others = [FixedPoint(), FixedPoint(METHODS["multigrid"]), ProximalNewton(), *(METHODS[name] for name in names)]
    said = []
    for method in others:
        try:
            found = hv.solve(solution.problem, method, controls=hv.Controls(rtol=1e-10, max_time=5.0))
        except hv.HemivarError as refused:
            said.append(f"{method.name}: {refused}")
            continue
        if found.status is hv.Status.CONVERGED and found.method != solution.method:
            return found
        said.append(f"{method.name}: {found.status}")
    raise AssertionError(f"no other method than {solution.method}: {said}")


def _solve(row: Row, folder: Path) -> None:
    solution = _solved(row)
    assert np.abs(solution.unknowns).max() > 0.0
    _same(_by_another_method(solution).unknowns, solution.unknowns)


def _certify(row: Row, folder: Path) -> None:
    """Sampling: no point nearby is lower than a minimiser; the bound is not below the distance to an exact solution."""
    rough = hv.solve(at_rest(row), controls=hv.Controls(rtol=1e-4))
    certificate, problem = hv.certify(rough, tolerance=1e-3), rough.problem
    exact = _solved(row)
    if isinstance(problem.bulk, Quadratic):
        off = np.sqrt(max(2.0 * problem.bulk.value(exact.unknowns - rough.unknowns), 0.0))
        assert off <= certificate.error_bound * (1.0 + 1e-6) + 1e-9 * np.sqrt(2.0 * problem.bulk.value(exact.unknowns))
    if hv.certify(exact).kind in _MINIMISERS and not problem.law.state_dependent:
        problem = stressed_problem(problem, exact.unknowns) if stiffens(problem) else problem
        random, size = np.random.default_rng(0), np.abs(exact.unknowns).max()
        for scale in np.repeat([1e-1, 1e-2, 1e-3], 8):
            beside = exact.unknowns + scale * size * random.normal(size=exact.unknowns.size)
            assert problem.energy(beside) >= exact.energy - 1e-12 * abs(exact.energy)


def _exact(row: Row, folder: Path) -> None:
    """Finer meshes: two answers are no farther from each other than both bounds together."""
    found = hv.certify(_solved(row), exact=True).exact
    assert found is not None
    if not np.isfinite(found.bound):
        raise Refused(found.why)
    first, last = hv.study(at_rest(row), 1, exact=True, controls=_TOLERANCE).levels  # type: ignore[arg-type]
    finer = hv.certify(last.solution, exact=True).exact
    assert finer is not None
    assert first.energy <= found.bound + finer.bound
    if found.guaranteed:
        assert first.bound == pytest.approx(found.bound, rel=1e-6)


def _all_solutions(row: Row, folder: Path) -> None:
    """Other starts lead to the same ones, and one of them is what is found from rest."""
    problem, solution = at_rest(row), _solved(row)
    found = hv.find_solutions(problem, starts=2)
    again = hv.find_solutions(problem, starts=2, seed=5)
    assert len(found) == len(again) >= 1
    _same(np.array([one.energy for one in again]), np.array([one.energy for one in found]))
    assert (
        min(np.abs(one.unknowns - solution.unknowns).max() for one in found) <= 1e-5 * np.abs(solution.unknowns).max()
    )


def _path(row: Row, folder: Path) -> None:
    """Its upper end is the static solution there."""
    path = hv.follow_path(at_rest(row), (0.0, 1.0))
    assert path.load_factor[-1] == 1.0, path.ended
    _same(path.local[-1], _solved(row).local, 1e-5)


def _bracket(row: Row, folder: Path) -> None:
    """Bodies here carry their load: the equilibrium at its whole is the static solution."""
    found = hv.branches.load_bracket(at_rest(row), 1.0)
    assert found.carried == 1.0, str(found)
    _same(found.solution.local, _solved(row).local, 1e-5)


def _evolution(row: Row, inertia: bool) -> Evolution:
    return Evolution(problem_of_row(row), inertia=inertia)  # type: ignore[arg-type]


def _marched(evolution: Evolution, steps: int = _STEPS, until: float = _UNTIL, **more: object) -> History:
    history = march(evolution, until, step=_UNTIL / steps, **more)  # type: ignore[arg-type]
    if history.ended == "refused":
        raise Refused(history.messages[-1])
    assert history.ended == "finished", (history.ended, history.messages)
    assert history.uniqueness
    return history


def _last(history: History) -> Array:
    return history.frames[-1].displacement


def _march(row: Row, folder: Path, inertia: bool = False) -> None:
    """Steps of a third of the length change little; more where the body swings."""
    evolution = _evolution(row, inertia)
    coarse, fine = _marched(evolution), _marched(evolution, 3 * _STEPS)
    assert np.abs(_last(fine)).max() > 0.0
    _same(_last(coarse), _last(fine), 0.2 if inertia else 0.1)


def _with_mass(row: Row, folder: Path) -> None:
    _march(row, folder, inertia=True)


def _resume(row: Row, folder: Path) -> None:
    """A march that is taken up in the middle is the one that was not interrupted, bit by bit."""
    evolution, kept = _evolution(row, False), Checkpoint(folder / "march.ckpt", 0.0)
    straight = _marched(evolution)
    _marched(evolution, until=0.5 * _UNTIL, checkpoint=kept)
    resumed = _marched(evolution, checkpoint=kept, resume=True)
    np.testing.assert_array_equal(_last(resumed), _last(straight))
    np.testing.assert_array_equal(resumed["normal_force"], straight["normal_force"])


def _study(row: Row, folder: Path) -> None:
    problem = problem_of_row(row)
    found = hv.study(problem, 1, controls=_TOLERANCE)  # type: ignore[arg-type]
    alone = hv.solve(problem.on(problem.mesh.refined()), controls=_TOLERANCE)  # type: ignore[union-attr]
    _same(found.levels[-1].solution.displacement, alone.displacement)


def _of_load(task: str, body: str, normal: str, friction: str, beside: str, factor: float) -> Problem:
    """A function that other processes can import."""
    return problem_of_row(Row(task, body, normal, friction, beside), factor)


def _axes(row: Row) -> dict[str, list[object]]:
    names = ("task", "body", "normal", "friction", "beside")
    return {name: [getattr(row, name)] for name in names} | {"factor": [0.5, 1.0]}


def _sweep(row: Row, folder: Path) -> None:
    found = hv.sweep(_of_load, _axes(row), starts=3)
    for point, factor in zip(found.points, (0.5, 1.0), strict=True):
        if point.failed:
            raise Refused(point.note)
        energy = _solved(row, factor).energy
        assert min(abs(one - energy) for one in point.energies) <= _NEAR * abs(energy)


@functools.cache
def _elsewhere() -> ProcessPoolExecutor:
    """Another process, as ``jobs`` starts them, for all rows."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))


def _jobs(row: Row, folder: Path) -> None:
    """Another process is sent the problem, and sends back what is found here, number by number."""
    problem = at_rest(row)
    studies = [hv.study(problem, 1), _elsewhere().submit(hv.study, problem, 1).result()]  # type: ignore[arg-type]
    if row.friction == "orthotropic":  # by the option itself, which starts processes anew
        studies.append(hv.study(problem, 1, jobs=2))  # type: ignore[arg-type]
    for levels in zip(*(found.levels for found in studies), strict=True):
        for level in levels[1:]:
            np.testing.assert_array_equal(level.solution.displacement, levels[0].solution.displacement)


def _adaptive(row: Row, folder: Path) -> None:
    found = hv.bounds.solve_adaptive(at_rest(row), rtol=0.05, max_unknowns=60, controls=_TOLERANCE)  # type: ignore[arg-type]
    if not np.isfinite(found.distance.distance):
        raise Refused("; ".join(found.distance.reasons))
    _same(_by_another_method(found.solution).unknowns, found.solution.unknowns)


def _output(row: Row, folder: Path) -> None:
    """Numbers, fields and pictures are written, are not empty, and are those of the solution."""
    solution = _solved(row)
    record = json.loads(json.dumps(solution.to_dict()))
    assert record["status"]
    figure = solution.plot()
    figure.savefig(folder / "picture.png", dpi=40)
    assert (folder / "picture.png").stat().st_size > 1000
    written = solution.to_vtu(folder / "body.vtu")
    assert written.stat().st_size > 200
    size = float(np.linalg.norm(solution.displacement))
    assert np.linalg.norm(meshio.read(written).point_data["displacement"]) == pytest.approx(size, rel=_NEAR)


def _answer(problem: object, row: Row) -> Array:
    """The displacement at rest, or after a march where something stands beside the laws."""
    if row.beside != "none":
        return _last(_marched(Evolution(problem)))  # type: ignore[arg-type]
    return hv.solve(problem, controls=_TOLERANCE).raise_for_status().displacement  # type: ignore[arg-type]


def _pickle(row: Row, folder: Path) -> None:
    problem = at_rest(row) if row.beside == "none" else problem_of_row(row)
    for again in (pickle.loads(pickle.dumps(problem)), copy.deepcopy(problem)):
        np.testing.assert_array_equal(_answer(again, row), _answer(problem, row))
    if row.beside == "none":
        solution = _solved(row)
        again = pickle.loads(pickle.dumps(solution))
        np.testing.assert_array_equal(again.displacement, solution.displacement)
        assert again.energy == solution.energy


def _file(row: Row, folder: Path) -> None:
    problem = problem_of_row(row)
    written = hv.write_problem(problem, folder / "problem.toml", beside=True)  # type: ignore[arg-type]
    _same(_answer(hv.read_problem(written), row), _answer(problem, row), 1e-9)


TASKS: Mapping[str, Callable[[Row, Path], None]] = {
    "solve": _solve,
    "certify": _certify,
    "exact": _exact,
    "all solutions": _all_solutions,
    "path": _path,
    "bracket": _bracket,
    "march": _march,
    "mass": _with_mass,
    "resume": _resume,
    "study": _study,
    "sweep": _sweep,
    "adaptive": _adaptive,
    "output": _output,
    "pickle": _pickle,
    "file": _file,
    "jobs": _jobs,
}
#: Tasks in which what stands beside the laws means something.
IN_TIME = ("march", "mass", "resume", "pickle", "file")
