"""``hemivar solve --engine petsc``: the command run by every rank of ``mpirun``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hemivar.distributed.certificate import certify_on_ranks
from hemivar.distributed.ranks import shared
from hemivar.errors import HemivarError, ProblemError
from hemivar.report.on_ranks import write_json_on_ranks, write_vtu_on_ranks
from hemivar.solvers import ContactState, Status

if TYPE_CHECKING:
    from hemivar.distributed import BodyOnRanks, DistributedSolution, Ranks
    from hemivar.problem_file import MeshRecipe, ProblemFile
    from hemivar.solvers import Controls, Progress

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
    from hemivar.distributed import assemble, family
    from hemivar.distributed.pieces import grid_numbers
    from hemivar.problem_file import parse_problem_file, read_text

    text = ranks.mpi.bcast(ranks.agree(lambda: read_text(path) if ranks.rank == 0 else ""))
    pieces = []

    def place(recipe: MeshRecipe) -> Any:
        def number(points: Any) -> Any:
            assert recipe.grid is not None
            return grid_numbers(points / recipe.scale, *recipe.grid)

        renumber = None if recipe.grid is None else number
        pieces.extend(family(ranks, recipe.begin, recipe.halvings, recipe.refine, renumber, recipe.crossed))
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
            message = str(refused)
            if message.startswith(f"{stated.name}: "):
                raise
            table = "[supports] " if "support" in message else ""
            named = type(refused)(f"{stated.name}: {table}{message}")
            raise (shared(named) if getattr(refused, "shared", False) else named) from None
    return ProblemOnRanks(stated, bodies)


def run_on_ranks(
    path: Path,
    check: Callable[[], None],
    controls_of: Callable[[ProblemFile, Callable[[Progress], None] | None], Controls],
    say: Callable[[Progress], None] | None,
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
        Prints a step.
    json, vtu : Path or None
        What to write.
    checkpoint : Path or None
        Where to keep the iterate after every step.
    restart : Path or None
        A checkpoint to go on from.
    """
    from hemivar.distributed import all_or_none, read_checkpoint, solve_distributed, world, write_checkpoint

    ranks = world()
    first = ranks.rank == 0
    with all_or_none(ranks):
        ranks.agree(check)
        problem = read_on_ranks(path, ranks)
        body = problem.bodies[-1]
        if first:
            _print_head(problem)
        else:
            say = None
        controls = ranks.agree(lambda: controls_of(problem.stated, say))
        resume = None if restart is None else read_checkpoint(restart, body)
        watch = None if checkpoint is None else (lambda saved: write_checkpoint(checkpoint, body, saved))
        solution = solve_distributed(problem.bodies, None, controls, resume=resume, watch=watch)
        certificate = certify_on_ranks(solution)
        _print_summary(solution, certificate)
        written = []
        if json is not None:
            written.append(write_json_on_ranks(solution, json, certificate))
        if vtu is not None:
            written += write_vtu_on_ranks(solution, vtu)
        if first and written:
            print(f"written           {', '.join(map(str, written))}")
        if solution.status is Status.CONVERGED:
            return 0
        if first:
            sys.stdout.flush()
            sys.stderr.write(
                f"hemivar: not converged: {solution.status.value} after {solution.steps} steps, relative residual "
                f"{solution.residual.relative:.1e}: {solution.status.remedy}\n"
            )
        ranks.mpi.Barrier()
        return 1


def _print_head(problem: ProblemOnRanks) -> None:
    body = problem.bodies[-1]
    stated, piece = problem.stated, body.piece
    title = "".join(c if c.isprintable() else " " for c in stated.problem.title)
    print(title or stated.name)
    print(f"mesh              {piece.total} nodes on {len(problem.bodies)} levels")
    print(f"ranks             {body.ranks.size}, {piece.mesh.number_of_cells} cells on the first")
    print(f"unknowns          {body.unknowns}")
    where = f" on {', '.join(stated.problem.contact)}" if stated.problem.contact else ""
    print(f"contact points    {body.contact_points}{where}")
    print("method            petsc: truncated nonsmooth Newton, conjugate gradients with PETSc's multigrid")
    print(f"\n{'step':>6}  {'residual':>9}  {'energy':>18}  {'changed points':>14}", flush=True)


def _print_summary(solution: DistributedSolution, certificate: dict[str, Any]) -> None:
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
    kind, margin, bound = certificate["kind"], certificate["margin"], certificate["error_bound"]
    unique = "the only solution" if certificate["unique"] else "uniqueness not known"
    print(f"kind              {kind or 'not known'}; {unique}")
    print(f"margin            {'not known' if margin is None else format(margin, '.4g')}")
    if bound is not None:
        relative = certificate["error_bound_relative"]
        if certificate["error_bound_sampled"]:
            print(f"distance          about {bound:.2e}, relative {relative:.1e}: an estimate, from sampled constants")
        else:
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
