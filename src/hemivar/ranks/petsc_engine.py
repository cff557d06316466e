"""The engine ``petsc``: a command that all ranks of ``mpirun`` run, of which the first is heard."""

from __future__ import annotations

import math
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

import numpy as np

from hemivar.basics.disk import shown
from hemivar.cli.engine import Asked, Engine
from hemivar.cli.options import Exit
from hemivar.cli.outputs import one_line
from hemivar.cli.session import naming_file
from hemivar.cli.terminal import one_voice
from hemivar.errors import HemivarError, MethodError, ProblemError
from hemivar.files.film import read_film
from hemivar.files.problem_file import parse_problem_file, read_text
from hemivar.ranks import family, solve_distributed, world
from hemivar.ranks.assembly import assemble_family
from hemivar.ranks.body_on_ranks import body_of
from hemivar.ranks.certificate import certify_on_ranks
from hemivar.ranks.checkpoint import read_checkpoint, write_checkpoint
from hemivar.ranks.evolution import EvolutionOnRanks
from hemivar.ranks.on_ranks import SeriesOnRanks, pieces_of, write_json_on_ranks, write_vtu_on_ranks
from hemivar.ranks.pieces import grid_numbers
from hemivar.ranks.ranks import NO_MEMORY, Ranks, shared
from hemivar.ranks.ranks_march import prepare_march
from hemivar.ranks.solve import Saved
from hemivar.ranks.time_limit import TimeLimit
from hemivar.solvers import Status
from hemivar.workflows import RunResult, StartEvent, march

if TYPE_CHECKING:
    from hemivar.basics.types import Array, IntArray
    from hemivar.certificates import Certificate
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.evolution import Evolution, History, March
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.changes import Change
    from hemivar.files.film import Film
    from hemivar.files.mesh_table import StatedMesh
    from hemivar.files.problem_file import ProblemFile
    from hemivar.files.series import Series
    from hemivar.mechanics.statement import ContactProblem
    from hemivar.mesh.mesh import Mesh
    from hemivar.ranks.body_on_ranks import BodyOnRanks
    from hemivar.ranks.pieces import Piece
    from hemivar.solvers import Progress, Solution
    from hemivar.solvers.base import State
    from hemivar.workflows import Event, Work

__all__ = ["PetscEngine", "all_or_none"]

T = TypeVar("T")


class PetscEngine(Engine):
    """All ranks, each of which has one of these and runs the same command."""

    refusals = HemivarError

    def __init__(self, *together: str) -> None:
        self.ranks, self.limit, self.together = world(), TimeLimit(), together
        self.first = self.ranks.rank == 0
        self.meshes: list[Piece] = []

    @contextmanager
    def working(self) -> Iterator[None]:
        with all_or_none(self.ranks), self.limit.listening(), one_voice(self.first):
            yield

    def agree(self, work: Callable[[], T]) -> T:
        return self.ranks.agree(work)

    def ended(self, code: int) -> int:
        """The exit code of the first rank, which says for all that it was interrupted."""
        code = self.ranks.mpi.bcast(code)
        if code == Exit.INTERRUPTED and not self.first:
            raise SystemExit(code)
        return code

    def inputs(self, files: Sequence[Path]) -> list[Path]:
        return sorted({file for named in self.ranks.mpi.allgather(list(files)) for file in named})

    def pieces(self, option: str, path: Path) -> list[Path]:
        if option != "--vtu":
            return []
        files, (rank, size) = pieces_of(path, self.ranks.size), (self.ranks.rank, self.ranks.size)
        return [files[rank], files[size + rank], *(files[-2:] if self.first else [])]

    # ---- the problem -----------------------------------------------------------------------------------------

    def read(self, path: Path, changes: Sequence[Change], code: Sequence[str] = ()) -> ProblemFile:
        """Only the first rank reads the file and the mesh that it starts from; the statement is that on each piece."""
        text = self.ranks.mpi.bcast(self.agree(lambda: read_text(path) if self.first else ""))

        def mesh_of(stated: StatedMesh) -> Mesh:
            try:
                self.meshes = self._cut(stated)
            except ProblemError as refused:
                raise naming_file(refused, str(path), "[mesh] ") from None
            return self.meshes[-1].mesh

        # what the file says before the mesh is refused by all ranks alike, what it says after that perhaps by one only
        try:
            stated = parse_problem_file(text, path.parent, str(path), mesh_of, changes, code)
            error = None
        except ProblemError as refused:
            error = refused

        def both() -> ProblemFile:
            if error is not None:
                raise error
            return stated

        file = self.agree(both)
        if file.problem.kind:
            refusal = f"{file.name}: kind: the engine 'petsc' has no scalar problems; leave --engine out"
            raise shared(MethodError(refusal))
        if file.problem.areas:
            refusal = f"{file.name}: area: the engine 'petsc' has no contact over an area; leave --engine out"
            raise shared(MethodError(refusal))
        return file

    def _cut(self, stated: StatedMesh) -> list[Piece]:
        """The pieces of this rank, coarsest first."""
        recipe, grid = stated.recipe, stated.recipe.grid

        def number(points: Array) -> IntArray:
            assert grid is not None
            return grid_numbers(points / recipe.scale, grid.origin, grid.size, grid.cells)

        renumber = None if grid is None else number
        crossed = grid is not None and grid.pattern == "cross"
        return family(self.ranks, stated.begin, recipe.halvings, recipe.refine, renumber, crossed)

    def discrete(self, problem: ContactProblem) -> DiscreteProblem:
        return assemble_family(self.ranks, self.meshes, problem.on).problem

    def head(self, stated: ProblemFile, discrete: DiscreteProblem) -> tuple[list[str], list[str]]:
        body, piece = body_of(discrete), self.meshes[-1]
        inside = "" if body.stored is None else ", inside a proximal Newton method"
        return [
            f"mesh              {piece.total} nodes on {len(self.meshes)} levels",
            f"ranks             {self.ranks.size}, {piece.mesh.number_of_cells} cells on the first",
            f"unknowns          {body.unknowns}",
        ], [f"method            petsc: nonsmooth multigrid, with the cycles of PETSc{inside}"]

    # ---- the work --------------------------------------------------------------------------------------------

    def solved(
        self,
        asked: Asked,
        problem: DiscreteProblem,
        coarser: Sequence[DiscreteProblem],
        view: Callable[[Event], bool],
    ) -> RunResult:
        """Solve, from a checkpoint where that is asked for, and certify."""
        body, path = body_of(problem), asked.checkpoint
        resumed = asked.resume and self.ranks.mpi.bcast(path is not None and os.path.lexists(path))
        state = read_checkpoint(path, body) if resumed and path is not None else None
        view(StartEvent(problem, 0, 1))
        controls = replace(asked.controls, callback=view)
        alarm, keep = self.limit.limited(controls.max_time), None if path is None else _Keeper(path, body)
        solution = solve_distributed(body, None, controls, resume=state, watch=keep, alarm=alarm)
        certificate = certify_on_ranks(solution, alarm=alarm)
        asked.failed.extend([] if keep is None or keep.error is None else [keep.error])
        return RunResult(solution, certificate, interrupted=solution.status is Status.INTERRUPTED)

    def marching(self, evolution: Evolution, plan: March) -> Work[History]:
        self.limit = self.limit.limited(plan.max_time)

        def state(mesh: Mesh) -> Evolution:
            return replace(evolution, problem=evolution.statement.on(mesh))

        ready = prepare_march(self.ranks, tuple(self.meshes), state, plan, self.limit)
        return march(ready.discrete, ready.plan, ready.tools)

    @contextmanager
    def asked_to_end(self) -> Iterator[Callable[[], bool]]:
        with np.errstate(all="ignore"):
            yield lambda: bool(self.limit.due())

    # ---- what is written ---------------------------------------------------------------------------------------

    def write_json(
        self,
        solution: Solution,
        path: Path,
        certificate: Certificate | None,
        more: Mapping[str, object] | None,
        arrays: Path | None = None,
    ) -> object:
        return write_json_on_ranks(solution, path, certificate, more)

    def write_vtu(self, solution: Solution, path: Path) -> object:
        return write_vtu_on_ranks(solution, path)

    def series(self, path: Path, discrete: DiscreteEvolution) -> Series:
        assert isinstance(discrete, EvolutionOnRanks)
        return SeriesOnRanks(path, discrete)

    def film(self, history: History, fields: Path | None) -> Film:
        assert fields is not None
        return read_film(fields)


class _Keeper:
    """Keeps the iterate after every step; the solve continues where that fails, for a disk may have room again."""

    def __init__(self, path: Path, body: BodyOnRanks) -> None:
        self.path, self.body = path, body
        self.error: str | None = None  # why the last iterate could not be kept
        self._warned = False

    def __call__(self, state: State, history: tuple[Progress, ...]) -> None:
        try:
            write_checkpoint(self.path, self.body, Saved(state, history))
            self.error = None
        except HemivarError as error:
            if not getattr(error, "shared", False):
                raise
            self.error = f"--checkpoint: {error}"
            if not self._warned:
                sys.stderr.write(f"hemivar: warning: {one_line(self.error)}; the solve continues\n")
                sys.stderr.flush()
            self._warned = True


# ---- how it ends -------------------------------------------------------------------------------------------------


@contextmanager
def all_or_none(ranks: Ranks) -> Iterator[None]:
    """Whatever ends the work on one rank ends it on all, with one message and exit code 2 for bad input, or 70.

    With HEMIVAR_TRACEBACK=1 in the environment an error that should not occur is shown with its traceback.
    """
    who = f"rank {ranks.rank} of {ranks.size}"
    try:
        yield
    except HemivarError as error:
        line = f"hemivar: error: {_one_line(error)}"
        if not getattr(error, "shared", False):
            _end_all(ranks, 2, f"{line} ({who})")
        if ranks.rank == 0:
            _say(line)
        ranks.mpi.Barrier()
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        _end_all(ranks, 130, "hemivar: interrupted")
    except MemoryError:
        _end_all(ranks, 2, f"hemivar: error: {NO_MEMORY} ({who})")
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        where = f", {frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else ""
        reason = f"{type(error).__name__}: {_one_line(error)[:300]}{where}"
        _end_all(ranks, 70, f"hemivar: error: {who} failed ({reason}); all ranks end", error)


def _one_line(error: Exception) -> str:
    """What an error says, with escapes for what cannot be printed."""
    return one_line(shown(" ".join(str(error).split())))


def _say(line: str) -> None:
    """One line on standard error, whatever has become of the streams."""
    for stream, text in ((sys.stdout, ""), (sys.stderr, f"{line}\n")):
        with suppress(OSError, ValueError):
            stream.write(text)
            stream.flush()


def _end_all(ranks: Ranks, code: int, line: str, error: Exception | None = None) -> NoReturn:
    """End every rank; ranks that fail together leave the word to the lowest of them, whose end is that of all."""
    time.sleep(0.5 * math.log2(1 + ranks.rank))
    if error is not None and os.environ.get("HEMIVAR_TRACEBACK"):
        traceback.print_exception(error)
    _say(line)
    if ranks.size > 1:
        ranks.mpi.Abort(code)
    raise SystemExit(code)
