"""``hemivar solve --engine petsc``: the command run by every rank of ``mpirun``."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hemivar.basics.disk import noting_files_read, same_file, shown, try_output
from hemivar.cli.ending import all_or_none
from hemivar.cli.outputs import one_line
from hemivar.engines.petsc.alarm import Alarm
from hemivar.engines.petsc.certificate import ESTIMATE, certify_on_ranks
from hemivar.engines.petsc.ranks import shared
from hemivar.errors import FileError, HemivarError, ProblemError, SupportError
from hemivar.mesh import Grid
from hemivar.report.on_ranks import pieces_of, write_json_on_ranks, write_vtu_on_ranks
from hemivar.solvers import ContactState, Status

if TYPE_CHECKING:
    from hemivar.certify import Certificate
    from hemivar.engines.petsc import BodyOnRanks, DistributedSolution, Ranks
    from hemivar.files.mesh_table import StatedMesh
    from hemivar.files.problem_file import ProblemFile
    from hemivar.solvers import Controls, Progress
    from hemivar.solvers.base import State

__all__ = ["ProblemOnRanks", "read_on_ranks", "run_on_ranks"]


class ProblemOnRanks:
    """A problem file as the ranks hold it: the statement on this rank's piece, and the bodies of all meshes."""

    def __init__(self, stated: ProblemFile, bodies: list[BodyOnRanks]) -> None:
        self.stated = stated
        self.bodies = bodies


def read_on_ranks(path: Path, ranks: Ranks) -> ProblemOnRanks:
    """Read and discretise a problem file; only rank 0 reads the file and the mesh that it starts from.

    Raises
    ------
    ProblemError, MethodError
        The same on all ranks.
    """
    from hemivar.engines.petsc import assemble, family
    from hemivar.engines.petsc.pieces import grid_numbers
    from hemivar.files.problem_file import parse_problem_file, read_text

    text = ranks.mpi.bcast(ranks.agree(lambda: read_text(path) if ranks.rank == 0 else ""))
    pieces = []

    def place(stated: StatedMesh) -> Any:
        recipe = stated.recipe
        grid = recipe.source if isinstance(recipe.source, Grid) else None

        def number(points: Any) -> Any:
            assert grid is not None
            return grid_numbers(points / recipe.scale, grid.origin, grid.size, grid.cells)

        renumber = None if grid is None else number
        crossed = grid is not None and grid.pattern == "cross"
        try:
            pieces.extend(family(ranks, stated.begin, recipe.halvings, recipe.refine, renumber, crossed))
        except ProblemError as refused:
            raise _named(refused, str(path), "[mesh] ") from None
        return pieces[-1].mesh

    def read() -> ProblemFile:
        return parse_problem_file(text, path.parent, str(path), place)

    # what the file says before the mesh is refused by all ranks alike, what it says after that perhaps by one only
    stated: ProblemFile | None = None
    error: ProblemError | None = None
    try:
        stated = read()
    except ProblemError as refused:
        error = refused

    def both() -> ProblemFile:
        if error is not None:
            raise error
        assert stated is not None
        return stated

    stated = ranks.agree(both)
    bodies: list[BodyOnRanks] = []
    for piece in pieces:
        last = piece is pieces[-1]
        below = bodies[-1] if bodies else None
        try:
            bodies.append(assemble(ranks, piece, stated.problem.on, coarser=below, check_coercivity=last))
        except HemivarError as refused:
            raise _named(refused, stated.name, "[supports] " if isinstance(refused, SupportError) else "") from None
    return ProblemOnRanks(stated, bodies)


def _named(error: HemivarError, name: str, table: str) -> HemivarError:
    """The error with file and table before it; still one of all ranks if it was."""
    if str(error).startswith(f"{name}: "):
        return error
    named = type(error)(f"{name}: {table}{error}")
    return shared(named) if getattr(error, "shared", False) else named


def run_on_ranks(
    path: Path,
    check: Callable[[], None],
    controls_of: Callable[[ProblemFile, Callable[[Progress], bool | None] | None], Controls],
    say: Callable[[Progress], bool | None] | None,
    json: Path | None,
    vtu: Path | None,
    checkpoint: Path | None,
    restart: Path | None,
) -> int:
    """Solve a problem file on all ranks; returns the exit code.

    Parameters
    ----------
    path : Path
    check : function
        Looks at what can be looked at before work begins.
    controls_of : function
        Limits, with a function to call after every step.
    say : function or None
        Prints a step; work ends if it returns True.
    json, vtu : Path or None
        What to write.
    checkpoint : Path or None
        Where to keep the iterate after every step.
    restart : Path or None
        A checkpoint to go on from.
    """
    from hemivar.engines.petsc import read_checkpoint, solve_distributed, world

    ranks = world()
    first = ranks.rank == 0
    bell = Alarm()
    with all_or_none(ranks), bell.listening():
        ranks.agree(check)
        outputs = {"--json": json, "--vtu": vtu, "--checkpoint": checkpoint}
        ranks.agree(lambda: _try_pieces(vtu, ranks))
        with noting_files_read() as inputs:
            problem = read_on_ranks(path, ranks)
        body = problem.bodies[-1]
        ranks.agree(lambda: _keep_off(outputs, [path, *inputs], restart, ranks) if first else None)
        if first:
            _print_head(problem)
        else:
            say = None
        controls = ranks.agree(lambda: controls_of(problem.stated, say))
        resume = None if restart is None else read_checkpoint(restart, body)
        keep = None if checkpoint is None else _Keeper(checkpoint, body)
        alarm = bell.limited(controls.max_time)
        solution = solve_distributed(body, None, controls, resume=resume, watch=keep, alarm=alarm)
        certificate = certify_on_ranks(solution, alarm=alarm)
        _print_summary(solution, certificate)
        failed = [] if keep is None or keep.error is None else [keep.error]
        written: list[Path] = []
        writers: tuple[tuple[Path | None, Callable[[Path], list[Path]]], ...] = (
            (json, lambda name: [write_json_on_ranks(solution, name, certificate)]),
            (vtu, lambda name: write_vtu_on_ranks(solution, name)),
        )
        for target, write in writers:
            try:
                written += [] if target is None else write(target)
            except HemivarError as error:
                if not getattr(error, "shared", False):
                    raise
                failed.append(str(error))
        if first:
            _print_end(solution, written, failed)
        ranks.mpi.Barrier()
        if solution.status is Status.INTERRUPTED:
            if not first:
                raise SystemExit(130)  # the first rank says it for all
            return 130
        if failed:
            return 2
        return 0 if solution.status is Status.CONVERGED else 1


class _Keeper:
    """Keeps the iterate after every step; the solve goes on where that fails, for a disk may have room again.

    Attributes
    ----------
    error : str or None
        Why the last iterate could not be kept.
    """

    def __init__(self, path: Path, body: BodyOnRanks) -> None:
        self.path, self.body = path, body
        self.error: str | None = None
        self._warned = False

    def __call__(self, state: State, history: tuple[Progress, ...]) -> None:
        from hemivar.engines.petsc import Saved, write_checkpoint

        try:
            write_checkpoint(self.path, self.body, Saved(state, history))
            self.error = None
        except HemivarError as error:
            if not getattr(error, "shared", False):
                raise
            self.error = f"--checkpoint: {error}"
            if self.body.ranks.rank == 0 and not self._warned:
                sys.stderr.write(f"hemivar: warning: {one_line(self.error)}; the solve goes on\n")
                sys.stderr.flush()
            self._warned = True


def _try_pieces(vtu: Path | None, ranks: Ranks) -> None:
    """Refuse VTU files of this rank that could not be written, and on rank 0 those that name all of them."""
    if vtu is None:
        return
    files = pieces_of(vtu, ranks.size)
    own = [files[ranks.rank], files[ranks.size + ranks.rank], *(files[-2:] if ranks.rank == 0 else [])]
    for file in own:
        try:
            try_output(file)
        except FileError as error:
            raise ProblemError(f"--vtu: {error}; name another file") from error


def _keep_off(outputs: dict[str, Path | None], inputs: list[Path], restart: Path | None, ranks: Ranks) -> None:
    """Refuse outputs that would fall on a file that was read, or on one another.

    The checkpoint alone may take the place of the one that the solve goes on from.
    """
    taken: list[tuple[Path, str]] = []
    for option, path in outputs.items():
        if path is None:
            continue
        files = [path, *(pieces_of(path, ranks.size) if option == "--vtu" else [])]
        read = [*inputs, *([restart] if restart is not None and option != "--checkpoint" else [])]
        for file in files:
            if any(same_file(file, other) for other in read):
                raise ProblemError(f"{option} {shown(file)}: it was read for this problem; name another file")
            for other, what in taken:
                if same_file(file, other):
                    raise ProblemError(f"{option} {shown(file)}: this is a file of {what} already; name another one")
        taken += [(file, option) for file in files]


def _print_end(solution: DistributedSolution, written: list[Path], failed: list[str]) -> None:
    """Print on rank 0 what was written, and on standard error what went wrong."""
    if written:
        print(f"written           {', '.join(map(shown, written))}")
    sys.stdout.flush()
    if solution.status not in (Status.CONVERGED, Status.INTERRUPTED):  # of which the command itself speaks
        sys.stderr.write(
            f"hemivar: not converged: {solution.status.value} after {solution.steps} steps, relative residual "
            f"{solution.residual.relative:.1e}: {solution.status.remedy}\n"
        )
    for message in failed:
        sys.stderr.write(f"hemivar: error: {one_line(message)}\n")
    sys.stderr.flush()


def _print_head(problem: ProblemOnRanks) -> None:
    body = problem.bodies[-1]
    stated, piece = problem.stated, body.piece
    print(one_line(stated.problem.title) or shown(stated.name))
    print(f"mesh              {piece.total} nodes on {len(problem.bodies)} levels")
    print(f"ranks             {body.ranks.size}, {piece.mesh.number_of_cells} cells on the first")
    print(f"unknowns          {body.unknowns}")
    for warning in body.warnings:
        print(f"warning           {warning}")
    where = f" on {', '.join(stated.problem.contact)}" if stated.problem.contact else ""
    print(f"contact points    {body.contact_points}{where}")
    print("method            petsc: nonsmooth multigrid, with the cycles of PETSc")
    print(f"\n{'step':>6}  {'residual':>9}  {'energy':>18}  {'changed points':>14}", flush=True)


def _print_summary(solution: DistributedSolution, certificate: Certificate) -> None:
    """Print on rank 0 what was found."""
    sums, body = solution.sums, solution.body
    if body.ranks.rank:
        return
    print(
        f"\nstatus            {solution.status.value} after {solution.steps} steps, relative residual "
        f"{solution.residual.relative:.1e}"
    )
    print(f"time              {', '.join(f'{stage} {seconds:.3g} s' for stage, seconds in solution.timings.items())}")
    print(f"cycles            {solution.cycles}")
    print(f"energy            {solution.energy:.10g}")
    if solution.status is not Status.CONVERGED:
        print(f"what to do        {solution.status.remedy}")
    if certificate.smallness.alpha_sampled:
        print("note              a law knows its alpha from samples only: nothing is claimed of uniqueness")
    unique = "the only solution" if certificate.unique else "uniqueness not known"
    kind = "not known" if "kind" in certificate.left_out else certificate.kind.value
    print(f"kind              {kind}; {unique}")
    estimate = ", an estimate from above" if certificate.method == ESTIMATE else ""
    unknown = "margin" in certificate.left_out
    print(f"margin            {'not known' if unknown else format(certificate.margin, '.4g') + estimate}")
    if math.isfinite(certificate.error_bound):
        bound, relative = certificate.error_bound, certificate.error_bound_relative
        print(f"distance          at most {bound:.2e}, relative {relative:.1e}, to the exact discrete solution")
    if body.contact_points == 0:
        return
    print(f"normal force      {sums['normal_force']:.6g}")
    force = sums["force"]
    print(f"force             ({', '.join(f'{c:.6g}' for c in force)}), of the foundation on the body")
    what = "length" if body.dim == 2 else "area"
    print(f"contact {what:<10}{sums['contact_length']:.6g} of {sums['whole_length']:.6g}")
    counts = zip(sums["counts"], ContactState, strict=True)
    print(f"contact points    {', '.join(f'{count} {state.label}' for count, state in counts)}")
    print(f"max penetration   {sums['max_penetration']:.6g}")
    print(f"max pressure      {sums['max_pressure']:.6g}")
