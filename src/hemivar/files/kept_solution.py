"""A solution on one line of JSON, every bit of it, without the problem that it solves."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from hemivar.basics.disk import read_text, write_text
from hemivar.basics.types import Array
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import ProblemError
from hemivar.files.kept_work import plain_json
from hemivar.solvers import Solution, Status

__all__ = ["KeptSolution"]

_NUMBERS = ("error_bound", "contraction")


@dataclass(frozen=True, eq=False)
class KeptSolution:
    """The solution on one mesh of several, as a file keeps it: all but the problem and the history of the steps.

    Attributes
    ----------
    number : int
        Which mesh, from 0.
    unknowns : array (n,)
    multiplier : array (m, d)
    said : mapping
        Status, method, residual and so on, as JSON has them.
    """

    number: int
    unknowns: Array
    multiplier: Array
    said: Mapping[str, object]

    @staticmethod
    def of(number: int, solution: Solution) -> KeptSolution:
        """What is kept of a solution.

        Parameters
        ----------
        number : int
        solution : Solution
        """
        said = {
            "status": solution.status.value,
            "method": solution.method,
            "steps": solution.steps,
            "evaluations": solution.evaluations,
            "residual": {name: plain_json(value) for name, value in asdict(solution.residual).items()},
            "timings": {name: plain_json(float(value)) for name, value in solution.timings.items()},
            "kind": None if solution.kind is None else solution.kind.value,
            **{name: plain_json(getattr(solution, name)) for name in _NUMBERS},
        }
        return KeptSolution(number, solution.unknowns, solution.multiplier, said)

    def keep(self, path: Path) -> None:
        """A file with this line alone, whole or not at all."""
        write_text(path, self.line())

    @staticmethod
    def read(path: Path, most_bytes: int) -> KeptSolution:
        """The contrary of :meth:`keep`."""
        return KeptSolution.of_line(read_text(path, "solution", most_bytes))

    def line(self) -> str:
        """The line; numbers of the two arrays as their bytes, eight for each, the lowest first, in base 64."""
        arrays = {"unknowns": _packed(self.unknowns), "multiplier": _packed(self.multiplier)}
        return json.dumps({"number": self.number, **self.said, **arrays}, allow_nan=False)

    @staticmethod
    def of_line(text: str) -> KeptSolution:
        """What a line holds.

        Raises
        ------
        ValueError, KeyError, TypeError
            It is no such line.
        """
        data = json.loads(text)
        unknowns, multiplier = _array(data.pop("unknowns")), _array(data.pop("multiplier"))
        number = data.pop("number")
        if type(number) is not int or number < 0:
            raise ValueError("the number of the mesh is no whole number")
        found = KeptSolution(number, unknowns, multiplier, data)
        status, _, _ = found._told()
        finite = np.isfinite(unknowns).all() and np.isfinite(multiplier).all()
        if not finite and status is not Status.NONFINITE:
            raise ValueError("an entry is not finite")
        return found

    def solution(self, problem: DiscreteProblem) -> Solution:
        """The solution, of the problem that it was computed for; without the history of its steps.

        Parameters
        ----------
        problem : DiscreteProblem

        Raises
        ------
        ProblemError
            The problem has another number of unknowns or contact points.
        """
        shape = (problem.contact_points, problem.contact.components)
        if self.unknowns.shape != (problem.unknowns,) or self.multiplier.shape != shape:
            raise ProblemError(
                f"what is kept of mesh {self.number} is of {self.unknowns.size} unknowns and "
                f"{len(self.multiplier)} contact points, and the mesh has {problem.unknowns} and {shape[0]}; remove "
                "the file, or name another one"
            )
        status, residual, kind = self._told()
        said = dict(self.said)
        bounds = {name: None if said[name] is None else float(str(said[name])) for name in _NUMBERS}
        timings = said["timings"]
        assert isinstance(timings, dict)
        return Solution(
            problem, self.unknowns, self.multiplier, status, residual, str(said["method"]), int(str(said["steps"])),
            int(str(said["evaluations"])), (), {str(name): float(value) for name, value in timings.items()},
            bounds["error_bound"], bounds["contraction"], kind,
        )  # fmt: skip

    def _told(self) -> tuple[Status, Residual, PointKind | None]:
        residual, kind = self.said["residual"], self.said["kind"]
        if not isinstance(residual, dict) or not isinstance(self.said["timings"], dict):
            raise TypeError
        for name in _NUMBERS:
            if self.said[name] is not None:
                float(str(self.said[name]))
        if not isinstance(self.said["method"], str):
            raise TypeError
        if any(type(count) is not int or count < 0 for count in (self.said["steps"], self.said["evaluations"])):
            raise ValueError("steps and evaluations are no whole numbers")
        for seconds in self.said["timings"].values():
            float(seconds)
        return (
            Status(self.said["status"]),
            Residual(**{name: float(value) for name, value in residual.items()}),
            None if kind is None else PointKind(str(kind)),
        )


def _packed(array: Array) -> dict[str, object]:
    data = base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")
    return {"shape": list(array.shape), "data": data}


def _array(packed: Mapping[str, object]) -> Array:
    shape = packed["shape"]
    if not isinstance(shape, list) or any(type(length) is not int or length < 0 for length in shape):
        raise TypeError
    numbers = np.frombuffer(base64.b64decode(str(packed["data"]), validate=True), dtype="<f8")
    return numbers.astype(float).reshape(shape)
