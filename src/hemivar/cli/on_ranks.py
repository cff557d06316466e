"""``hemivar solve --engine petsc``: the command run by every rank of ``mpirun``."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import noting_files_read, shown, try_output
from hemivar.basics.units import Units
from hemivar.certificates.wording import lower_bound_words
from hemivar.cli.end_on_ranks import all_or_none
from hemivar.cli.options import Exit, controls_of
from hemivar.cli.outputs import Writer, check_distinct, keep_off, one_line
from hemivar.cli.printing import print_not_converged, print_step, print_step_head
from hemivar.cli.session import naming_file
from hemivar.engines.petsc.certificate import ESTIMATE, certify_on_ranks
from hemivar.engines.petsc.discrete_on_ranks import body_of
from hemivar.engines.petsc.ranks import shared
from hemivar.engines.petsc.time_limit import TimeLimit
from hemivar.errors import FileError, HemivarError, MethodError, ProblemError
from hemivar.report.on_ranks import pieces_of, write_json_on_ranks, write_vtu_on_ranks
from hemivar.report.summary import Summary, contact_rows, extreme_rows
from hemivar.solvers import Status

if TYPE_CHECKING:
    from hemivar.basics.types import Array, IntArray
    from hemivar.certificates import Certificate
    from hemivar.engines.petsc import BodyOnRanks, Piece, Ranks
    from hemivar.files.mesh_table import StatedMesh
    from hemivar.files.problem_file import ProblemFile
    from hemivar.mesh.mesh import Mesh
    from hemivar.solvers import Progress, Solution
    from hemivar.solvers.base import State

__all__ = [
    "ProblemOnRanks",
    "end_of_all",
    "named",
    "print_head_on_ranks",
    "read_on_ranks",
    "run_on_ranks",
    "stated_on_ranks",
]


@dataclass(frozen=True, eq=False)
class ProblemOnRanks:
    """A problem file as the ranks hold it: the statement on this rank's piece, and the bodies of all meshes."""

    stated: ProblemFile
    bodies: list[BodyOnRanks]


def read_on_ranks(path: Path, ranks: Ranks, given: Sequence[str] = ()) -> ProblemOnRanks:
    """Read and discretise a problem file; only rank 0 reads the file and the mesh that it starts from.

    Raises
    ------
    ProblemError, MethodError
        The same on all ranks.
    """
    from hemivar.engines.petsc import assemble

    stated, pieces = stated_on_ranks(path, ranks, given)
    problem = stated.problem
    bodies: list[BodyOnRanks] = []
    for piece in pieces:
        last = piece is pieces[-1]
        below = bodies[-1] if bodies else None
        try:
            bodies.append(assemble(ranks, piece, problem.on, coarser=below, check_coercivity=last))
        except HemivarError as refused:
            raise named(refused, stated.name) from None
    return ProblemOnRanks(stated, bodies)


def stated_on_ranks(path: Path, ranks: Ranks, given: Sequence[str] = ()) -> tuple[ProblemFile, list[Piece]]:
    """Read a problem file, and cut the mesh that it starts from; the statement is that on the piece of each rank.

    Raises
    ------
    ProblemError, MethodError
        The same on all ranks.
    """
    from hemivar.engines.petsc import family
    from hemivar.engines.petsc.pieces import grid_numbers
    from hemivar.files.changes import read_change
    from hemivar.files.problem_file import parse_problem_file, read_text

    changes = ranks.agree(lambda: [read_change(one) for one in given])
    text = ranks.mpi.bcast(ranks.agree(lambda: read_text(path) if ranks.rank == 0 else ""))
    pieces: list[Piece] = []

    def place(stated: StatedMesh) -> Mesh:
        recipe = stated.recipe
        grid = recipe.grid

        def number(points: Array) -> IntArray:
            assert grid is not None
            return grid_numbers(points / recipe.scale, grid.origin, grid.size, grid.cells)

        renumber = None if grid is None else number
        crossed = grid is not None and grid.pattern == "cross"
        try:
            pieces.extend(family(ranks, stated.begin, recipe.halvings, recipe.refine, renumber, crossed))
        except ProblemError as refused:
            raise named(refused, str(path), "[mesh] ") from None
        return pieces[-1].mesh

    def read() -> ProblemFile:
        return parse_problem_file(text, path.parent, str(path), place, changes)

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

    found = ranks.agree(both)
    if found.problem.kind:
        raise shared(MethodError(f"{found.name}: kind: the engine 'petsc' has no scalar problems; leave --engine out"))
    return found, pieces


def named(error: HemivarError, name: str, table: str = "") -> HemivarError:
    """The error with file and table before it; still one of all ranks if it was."""
    told = naming_file(error, name, table)
    return shared(told) if getattr(error, "shared", False) else told


def run_on_ranks(
    path: Path,
    outputs: Mapping[str, Path | None],
    resume: bool,
    limits: tuple[float | None, float | None, int | None],
    check: Callable[[], None],
    quiet: bool,
    given: Sequence[str] | None = None,
) -> int:
    """Solve a problem file on all ranks; returns the exit code.

    Parameters
    ----------
    path : Path
    outputs : mapping of option to Path or None
        Of ``--json``, ``--vtu`` and ``--checkpoint``, where the iterate is kept after every step.
    resume : bool
        Whether to continue from the checkpoint, if it exists.
    limits : tuple
        Relative tolerance, seconds and steps of the command line.
    check : function
        Looks at what can be looked at before work begins.
    quiet : bool
        Whether no step is printed.
    given : sequence of str, optional
        ``key=value`` of ``--set``.
    """
    from hemivar.engines.petsc import read_checkpoint, solve_distributed, world

    ranks = world()
    first = ranks.rank == 0
    limit = TimeLimit()
    json, vtu, checkpoint = (outputs[option] for option in ("--json", "--vtu", "--checkpoint"))
    with all_or_none(ranks), limit.listening():
        ranks.agree(check)
        ranks.agree(lambda: _try_pieces(vtu, ranks))
        with noting_files_read() as inputs:
            problem = read_on_ranks(path, ranks, given or ())
        body = problem.bodies[-1]
        ranks.agree(lambda: _keep_off(outputs, [path, *inputs], ranks) if first else None)
        if first:
            print_head_on_ranks(problem.stated, body, len(problem.bodies))
            print_step_head()
        say = print_step if first and not quiet else None
        controls = ranks.agree(lambda: controls_of(problem.stated, *limits, say))
        begun = resume and ranks.mpi.bcast(checkpoint is not None and os.path.lexists(checkpoint))
        state = read_checkpoint(checkpoint, body) if begun and checkpoint is not None else None
        keep = None if checkpoint is None else _Keeper(checkpoint, body)
        alarm = limit.limited(controls.max_time)
        solution = solve_distributed(body, None, controls, resume=state, watch=keep, alarm=alarm)
        certificate = certify_on_ranks(solution, alarm=alarm)
        _print_summary(solution, certificate)
        writer = Writer()
        writer.failed += [] if keep is None or keep.error is None else [keep.error]
        writers: tuple[tuple[Path | None, Callable[[Path], list[Path]]], ...] = (
            (json, lambda name: [write_json_on_ranks(solution, name, certificate)]),
            (vtu, lambda name: write_vtu_on_ranks(solution, name)),
        )
        for target, write in writers:
            try:
                writer.written += [] if target is None else write(target)
            except HemivarError as error:
                if not getattr(error, "shared", False):
                    raise
                writer.failed.append(str(error))
        ended = {Status.CONVERGED: Exit.CONVERGED, Status.INTERRUPTED: Exit.INTERRUPTED}
        code = ended.get(solution.status, Exit.NOT_CONVERGED)
        if first:
            writer.tell()
            if code == Exit.NOT_CONVERGED:
                print_not_converged(solution)
            code = Exit(writer.ended(code))
        return end_of_all(ranks, code)


def end_of_all(ranks: Ranks, code: Exit) -> int:
    """The exit code of the first rank, which all ranks return; the first says for all that it was interrupted."""
    code = Exit(ranks.mpi.bcast(code))
    if code == Exit.INTERRUPTED and ranks.rank:
        raise SystemExit(code)
    return code


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


def _keep_off(outputs: Mapping[str, Path | None], inputs: list[Path], ranks: Ranks) -> None:
    """Refuse outputs that would fall on a file that was read, or on one another."""
    files = {option: [] if path is None else [path] for option, path in outputs.items()}
    files["--vtu"] += [piece for path in files["--vtu"] for piece in pieces_of(path, ranks.size)]
    check_distinct(files)
    keep_off(files, inputs)


def print_head_on_ranks(stated: ProblemFile, body: BodyOnRanks, levels: int) -> None:
    """Print what the problem is, and how it lies over the ranks."""
    piece = body.piece
    print(one_line(stated.problem.title) or shown(stated.name))
    for change in stated.changes:
        print(f"set               {one_line(str(change))}")
    print(f"mesh              {piece.total} nodes on {levels} levels")
    print(f"ranks             {body.ranks.size}, {piece.mesh.number_of_cells} cells on the first")
    print(f"unknowns          {body.unknowns}")
    for warning in body.warnings:
        print(f"warning           {warning}")
    where = f" on {', '.join(stated.problem.contact)}" if stated.problem.contact else ""
    print(f"contact points    {body.contact_points}{where}")
    inside = "" if body.stored is None else ", inside a proximal Newton method"
    print(f"method            petsc: nonsmooth multigrid, with the cycles of PETSc{inside}", flush=True)


def _print_summary(solution: Solution, certificate: Certificate | None) -> None:
    """Print on rank 0 what was found."""
    body, contact, deformed = body_of(solution.problem), solution.contact, solution.deformation
    forces, energy, normal_force = solution.force, solution.energy, solution.normal_force  # which all ranks make
    normal, tangential = solution.states.counts  # together
    whole, *counts = body.ranks.total(float(contact.weights.sum()), *normal.values(), *tangential.values()).tolist()
    found = [int(count) for count in counts]
    states = dict(zip(normal, found, strict=False)), dict(zip(tangential, found[len(normal) :], strict=True))
    extremes = (float(values.max(initial=-np.inf)) for values in (solution.penetration, solution.pressure))
    deepest, pressure = body.ranks.largest(*extremes).tolist()
    closed = solution.contact_length
    if body.ranks.rank:
        return
    print(
        f"\nstatus            {solution.status.value} after {solution.steps} steps, relative residual "
        f"{solution.residual.relative:.1e}"
    )
    print(f"time              {', '.join(f'{stage} {seconds:.3g} s' for stage, seconds in solution.timings.items())}")
    print(f"cycles            {solution.evaluations}")
    print(f"energy            {energy:.10g}")
    if deformed is not None:
        print(f"largest           {deformed.sizes}")
    if deformed is not None and deformed.warning is not None:
        print(f"warning           {deformed.warning}")
    if solution.status is not Status.CONVERGED:
        print(f"what to do        {solution.status.remedy}")
    if certificate is not None:
        _print_certificate(certificate)
    if body.contact_points == 0:
        return
    print(f"normal force      {normal_force:.6g}")
    print(f"force             ({', '.join(f'{c:.6g}' for c in forces)}), of the foundation on the body")
    what = "length" if body.dim == 2 else "area"
    rows = [
        *contact_rows(what, closed, whole, states, Units()),
        *extreme_rows(deepest, pressure, Units()),
    ]
    print("\n".join(Summary(tuple(rows)).lines()))


def _print_certificate(certificate: Certificate) -> None:
    """Print what is known of a solution."""
    if certificate.smallness.alpha_sampled:
        print("note              alpha of a law is not proved for all penetrations: nothing is claimed of uniqueness")
    kind = "not known" if "kind" in certificate.left_out else certificate.kind.value
    print(f"kind              {kind}; {certificate.uniqueness}")
    estimate = ", an estimate" if certificate.method == ESTIMATE else ""
    unknown = "margin" in certificate.left_out
    print(f"margin            {'not known' if unknown else format(certificate.margin, '.4g') + estimate}")
    if math.isfinite(certificate.error_bound):
        bound, relative = certificate.error_bound, certificate.error_bound_relative
        most = "about" if certificate.error_bound_sampled else "at most"
        print(f"distance          {most} {bound:.2e}, relative {relative:.1e}, to the exact discrete solution")
    if certificate.smallness.stiffness_by:
        print(f"body              {lower_bound_words(certificate.smallness.stiffness_by)}")
