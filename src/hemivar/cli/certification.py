"""``hemivar certify``: what is known about a solution, whoever computed it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hemivar.basics.disk import shown
from hemivar.cli.options import Exact, Exit, Given, Json, MaxTime, ProblemPath, Rtol, controls_of
from hemivar.cli.printing import SolveView, print_head
from hemivar.cli.session import Session
from hemivar.errors import ProblemError

__all__ = ["certify"]

#: Cells up to which the distance to the exact solution is bounded unless that is refused: half a minute.
_CELLS = {2: 300_000, 3: 60_000}

#: Relative residual up to which a given vector counts as a solution.
_RTOL = 1e-8


def certify(
    problem: ProblemPath,
    solution: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Solution to certify, .json or .vtu (solve first).")
    ] = None,
    json: Json = None,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    exact: Exact = None,
    given: Given = None,
) -> int:
    """Certify a solution: residuals, uniqueness, guaranteed distances to the discrete and to the exact solution, kind.

    The distance to the exact solution is left out on large meshes, unless --exact asks for it. Exit code 0 if the
    residual is below the tolerance, 1 if not.
    """
    rtol = _RTOL if rtol is None else rtol
    session = Session(problem, {"--json": json}, rtol=rtol, max_time=max_time, solution=_checked(solution), given=given)
    discrete = session.discrete()
    print_head(session.stated, discrete)
    from hemivar.workflows import CertifyOptions, result_of
    from hemivar.workflows import certify as certified

    controls = controls_of(session.stated, None, max_time)
    view = SolveView(quiet=True)
    unknowns = multiplier = None
    if solution is not None:
        from hemivar.files import read_solution

        unknowns, multiplier = read_solution(solution, discrete)
    wanted = _affordable(session) if exact is None else exact
    options = CertifyOptions(rtol, controls, session.method, wanted)
    certificate = result_of(certified(discrete, unknowns, multiplier, options), view)
    if view.solution is not None:
        print(f"solution          solved here by {view.solution.method} ({view.solution.status.value})")
    else:
        print(f"solution          {shown(str(solution))}")
        print(f"multiplier        {'recomputed from equilibrium' if multiplier is None else 'read from the file'}")
    for line in certificate.lines(whole=True):
        print(line)
    if exact is None and not wanted:
        print("exact solution    its distance is left out because the mesh is large; --exact computes it")
    record = {
        "problem": session.stated.name,
        "solution": None if solution is None else str(solution),
        "fulfilled": certificate.stationary,
        "certificate": certificate.record(),
    }
    session.writer.write_record(json, record)
    session.writer.tell()
    return session.writer.ended(Exit.CONVERGED if certificate.stationary else Exit.NOT_CONVERGED)


def _affordable(session: Session) -> bool:
    """Whether the distance to the exact solution costs little time and memory."""
    mesh = session.stated.problem.mesh
    return mesh.number_of_cells <= _CELLS[mesh.dim]


def _checked(path: Path | None) -> Path | None:
    """The solution file, unless it cannot be one."""
    if path is not None and path.suffix.lower() not in (".json", ".vtu"):
        raise ProblemError(f"--solution {path}: the name must end in .json or .vtu")
    if path is not None and not path.is_file():
        raise ProblemError(f"--solution {path}: there is no such file; write it with 'hemivar solve'")
    return path
