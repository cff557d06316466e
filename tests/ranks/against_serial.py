"""A problem file over ranks, held against the serial solution."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from hemivar.basics.types import Array, Record
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem import discretize
from hemivar.files.problem_file import read_problem
from hemivar.solvers import Controls, Solution, Status, solve
from tests.ranks.running import mpirun

__all__ = ["compare", "difference", "in_one_run", "plan", "record_of", "serial_of", "solve_on"]


def solve_on(ranks: int, problem: Path, *options: str | Path) -> subprocess.CompletedProcess[str]:
    return mpirun(ranks, "-m", "hemivar", "solve", problem, "--engine", "petsc", "-q", *options)


@cache
def serial_of(path: Path) -> tuple[DiscreteProblem, Solution]:
    problem = discretize(read_problem(path))
    solution = solve(problem, None, Controls(rtol=1e-12))
    # what a fixed point solves inside, it solves to 1e-11
    assert solution.status is Status.CONVERGED or solution.residual.relative < 1e-11
    return problem, solution


def difference(problem: DiscreteProblem, reference: Solution, displacement: Array) -> float:
    """Relative, in the energy norm."""
    assert problem.field is not None
    off = problem.field.restrict(displacement) - reference.unknowns
    K = problem.bulk.at_rest.stiffness  # type: ignore[attr-defined]
    return float(np.sqrt(off @ (K @ off) / (reference.unknowns @ (K @ reference.unknowns))))


def compare(problem: Path, result: Path) -> Record:
    record: Record = json.loads(result.read_text(encoding="utf-8"))
    discrete, reference = serial_of(problem)
    assert record["status"] == "converged"
    assert difference(discrete, reference, np.array(record["displacement"])) < 1e-9
    contact = record["contact"]
    size = np.abs(reference.pressure).max()
    np.testing.assert_allclose(contact["x"], discrete.contact.points, atol=1e-12)
    np.testing.assert_allclose(contact["weight"], discrete.contact.weights, rtol=1e-12)
    np.testing.assert_allclose(contact["pressure"], reference.pressure, atol=1e-7 * size)
    assert discrete.contact.without_friction is not None
    assert contact["without_friction"] == discrete.contact.without_friction.tolist()
    # which methods took over from one another is said of the serial run alone
    assert record["warnings"] == [said for said in reference.warnings if said not in reference.remarks]
    return record


def plan(folder: Path, tolerances: Mapping[str, float]) -> None:
    """Write down which of the problem files of a folder are to be solved in one run, and how accurately."""
    (folder / "plan.json").write_text(json.dumps(tolerances), encoding="utf-8")


def in_one_run(folder: Path, ranks: int) -> Path:
    """Where the records of all problems of a plan over so many ranks are."""
    found = folder / f"on {ranks}"
    if not found.exists():
        done = mpirun(ranks, "-m", "tests.ranks.batch", folder, found, limit=400.0)
        assert done.returncode == 0, done.stderr
    return found


def record_of(folder: Path, name: str, ranks: int) -> Record:
    """The record of a problem of a plan, which is compared with the serial solution."""
    return compare(folder / f"{name}.toml", in_one_run(folder, ranks) / f"{name}.json")
