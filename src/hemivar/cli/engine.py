"""The engine (backend) of a command: this process, or all ranks of ``mpirun`` (:mod:`hemivar.ranks.petsc_engine`)."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeVar

from hemivar.basics.defined_above import above
from hemivar.basics.signals import handled
from hemivar.cli.options import ENGINES, check_engine
from hemivar.cli.terminal import COALESCE
from hemivar.errors import HemivarError, ProblemError

if TYPE_CHECKING:
    from hemivar.certificates import Certificate
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.evolution import Evolution, History, March
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.changes import Change
    from hemivar.files.film import Film
    from hemivar.files.problem_file import ProblemFile
    from hemivar.files.series import Series
    from hemivar.mechanics.statement import ContactProblem
    from hemivar.solvers import Controls, Solution, Solver
    from hemivar.workflows import Event, RunResult, Work

__all__ = ["Asked", "Engine", "engine_named"]

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Asked:
    """How to solve, and where to say what could not be written."""

    method: Solver | None
    controls: Controls
    exact: bool
    checkpoint: Path | None
    resume: bool
    failed: list[str]


class Engine:
    """The engine ``scipy``: this process."""

    #: Whether this process speaks for all, and writes what is not written by all together.
    first = True
    #: Options whose files all processes write together; the others are written by the first.
    together: tuple[str, ...] = ()
    #: What is refused with the name of the problem file before it.
    refusals: ClassVar[type[HemivarError]] = ProblemError

    def working(self) -> AbstractContextManager[object]:
        """Around all that a command does."""
        return nullcontext()

    def agree(self, work: Callable[[], T]) -> T:
        """What work returns that may be refused."""
        return work()

    def ended(self, code: int) -> int:
        """The exit code of all processes."""
        return code

    def inputs(self, files: Sequence[Path]) -> list[Path]:
        """The files that any process has read."""
        return list(files)

    def pieces(self, option: str, path: Path) -> list[Path]:
        """Files that this process writes in place of one."""
        return []

    def read(self, path: Path, changes: Sequence[Change], code: Sequence[str] = ()) -> ProblemFile:
        """Read a problem file, and what it names of the code that is allowed."""
        from hemivar.files.problem_file import read_problem_file

        return read_problem_file(path, changes, code=code)

    def discrete(self, problem: ContactProblem) -> DiscreteProblem:
        """The discrete problem."""
        from hemivar.fem import discretize

        return discretize(problem)

    def head(self, stated: ProblemFile, discrete: DiscreteProblem) -> tuple[list[str], list[str]]:
        """Lines that say how large the problem is, and the method where the engine has but one."""
        mesh = stated.problem.mesh
        kind = "triangles" if mesh.dim == 2 else "tetrahedra"
        order = "" if stated.problem.order == 1 else ", quadratic elements"
        size = f"{mesh.number_of_nodes} nodes, {mesh.number_of_cells} {kind}, h = {mesh.size:.4g}{order}"
        return [f"mesh              {size}", f"unknowns          {discrete.unknowns}"], []

    def solved(
        self,
        asked: Asked,
        problem: DiscreteProblem,
        coarser: Sequence[DiscreteProblem],
        view: Callable[[Event], bool],
    ) -> RunResult:
        """Solve as the command asks, and certify."""
        from hemivar.workflows import RunOptions, result_of, run

        return result_of(run(problem, RunOptions(asked.method, asked.controls, coarser, asked.exact)), view)

    def marching(self, evolution: Evolution, plan: March) -> Work[History]:
        """A march."""
        from hemivar.workflows import march

        return march(evolution, plan)

    @contextmanager
    def asked_to_end(self) -> Iterator[Callable[[], bool]]:
        """Ctrl-C, SIGTERM and SIGHUP are reported by a function; Ctrl-C again, some seconds later, ends the step as
        well."""
        asked: list[float] = []

        def note(number: int, _: object) -> None:
            now = time.monotonic()
            if asked and now - asked[-1] > COALESCE and number == signal.SIGINT:
                raise KeyboardInterrupt
            if not asked:
                asked.append(now)

        with handled(note, "SIGINT", "SIGTERM", "SIGHUP", taken=lambda before: before is not signal.SIG_IGN):
            yield lambda: bool(asked)

    def write_json(
        self,
        solution: Solution,
        path: Path,
        certificate: Certificate | None,
        more: Mapping[str, object] | None,
        arrays: Path | None = None,
    ) -> object:
        """Write a solution as JSON, its arrays to a second file where one is named."""
        from hemivar.files import write_json

        return write_json(solution, path, certificate, more, arrays)

    def write_vtu(self, solution: Solution, path: Path) -> object:
        """Write the fields of a solution."""
        from hemivar.files import write_vtu

        return write_vtu(solution, path)

    def series(self, path: Path, discrete: DiscreteEvolution) -> Series:
        """What writes frames while they come."""
        from hemivar.files.series import Series

        return Series(path, discrete)

    def film(self, history: History, fields: Path | None) -> Film | History:
        """What a film of a march is drawn of, whose frames are in a file where they were written."""
        return history


def engine_named(name: str, *together: str) -> Engine:
    """The engine of ``--engine``, for a command whose files of some options all processes write together."""
    check_engine(name)
    if name == ENGINES[0]:
        return Engine()
    engine: Engine = above("engine.engine_named", f"--engine {name}")(*together)
    return engine
