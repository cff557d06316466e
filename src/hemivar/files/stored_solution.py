"""A solution serialised as one line of JSON, every bit of it, without the problem that it solves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import cast

import numpy as np

from hemivar.basics.codec import array_of_text, decoded, encoded, text_of_array
from hemivar.basics.disk import read_text, write_text
from hemivar.basics.types import AnyArray, Array, Record
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import ProblemError
from hemivar.solvers import Solution, Status

__all__ = ["StoredSolution"]


@dataclass(frozen=True, eq=False)
class StoredSolution:
    """The solution on one mesh of several, as a file keeps it: all but the problem and the history of the steps."""

    number: int  # which mesh, from 0
    unknowns: Array  # (n,)
    multiplier: Array  # (m, d)
    status: Status
    residual: Residual
    method: str
    steps: int
    evaluations: int
    timings: Mapping[str, float]
    error_bound: float | None
    contraction: float | None
    kind: PointKind | None

    @staticmethod
    def of(number: int, solution: Solution) -> StoredSolution:
        """What is kept of a solution."""
        names = [field.name for field in fields(StoredSolution) if field.name != "number"]
        return StoredSolution(number, **{name: getattr(solution, name) for name in names})

    def keep(self, path: Path) -> None:
        """A file with this line alone, whole or not at all."""
        write_text(path, self.line())

    @staticmethod
    def read(path: Path, most_bytes: int) -> StoredSolution:
        """The contrary of :meth:`keep`."""
        return StoredSolution.of_line(read_text(path, "solution", most_bytes))

    def line(self) -> str:
        """The line; numbers of the two arrays as their bytes in base 64."""
        arrays: list[AnyArray] = []
        head: Record = cast(Record, encoded(self, arrays))
        return json.dumps({**head, "arrays": [text_of_array(array) for array in arrays]}, allow_nan=False)

    @staticmethod
    def of_line(text: str) -> StoredSolution:
        """What a line holds."""
        data = json.loads(text)
        arrays = [array_of_text(array) for array in data.pop("arrays")]
        stored = decoded(StoredSolution, data, arrays)
        if min(stored.number, stored.steps, stored.evaluations) < 0:
            raise ValueError("a number of meshes or steps is negative")
        finite = np.isfinite(stored.unknowns).all() and np.isfinite(stored.multiplier).all()
        if not finite and stored.status is not Status.NONFINITE:
            raise ValueError("an entry is not finite")
        return stored

    def solution(self, problem: DiscreteProblem) -> Solution:
        """The solution, of the problem that it was computed for; without the history of its steps."""
        shape = (problem.contact_points, problem.contact.components)
        if self.unknowns.shape != (problem.unknowns,) or self.multiplier.shape != shape:
            raise ProblemError(
                f"what is kept of mesh {self.number} is of {self.unknowns.size} unknowns and "
                f"{len(self.multiplier)} contact points, and the mesh has {problem.unknowns} and {shape[0]}; remove "
                "the file, or name another one"
            )
        return Solution(
            problem, self.unknowns, self.multiplier, self.status, self.residual, self.method, self.steps,
            self.evaluations, (), self.timings, self.error_bound, self.contraction, self.kind,
        )  # fmt: skip
