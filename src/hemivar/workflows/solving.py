"""Solve a problem and certify its solution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.display import brief
from hemivar.certificates import Certificate, certify, factorises
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import HemivarError
from hemivar.fem.posed import Posable, posed
from hemivar.solvers import Controls, Progress, Solution, Solver, Status, as_method, solving, suited, transfer_solution
from hemivar.solvers.choice import choose
from hemivar.systems.workspace import Workspace
from hemivar.workflows.events import CertificateEvent, FoundEvent, MethodEvent, StartEvent, WarningEvent, Work

__all__ = ["STATIONARY", "Progress", "RunOptions", "RunResult", "certificate_of", "run", "solved"]

#: Residual, relative to the load, up to which a pair counts as a solution.
STATIONARY = 1e-8


@dataclass(frozen=True)
class RunOptions:
    """How to solve.

    Parameters
    ----------
    method : Solver or str, optional
        The method, or its name; chosen by predicted cost and memory if not given.
    controls : Controls
        Tolerances and limits of each solve; the certificate has as much time again.
    coarser : sequence of DiscreteProblem or ContactProblem
        The same body on coarser meshes, the coarsest first: each solution is the first guess on the next mesh.
    exact : bool
        Whether the certificate bounds the distance to the exact solution, too.
    """

    method: Solver | str | None = None
    controls: Controls = field(default_factory=Controls)
    coarser: Sequence[Posable] = ()
    exact: bool = False


@dataclass(frozen=True, eq=False)
class RunResult:
    """What :func:`run` found.

    Attributes
    ----------
    solution : Solution
        With its status; after an interruption the best iterate, on the finest mesh that was reached.
    certificate : Certificate or None
        None if the solution is not finite, or for the reason in ``complaint``.
    complaint : str
        Why there is no certificate, in words.
    interrupted : bool
        Whether the work was stopped from the keyboard.
    """

    solution: Solution
    certificate: Certificate | None
    complaint: str = ""
    interrupted: bool = False

    __repr__ = brief


@expecting(options=RunOptions, workspace=Workspace)
def run(problem: Posable, options: RunOptions | None = None, workspace: Workspace | None = None) -> Work[RunResult]:
    """Solve a problem, with a certificate.

    Yields :class:`WarningEvent`, :class:`MethodEvent`, for every mesh :class:`StartEvent` and its steps, then
    :class:`FoundEvent` and :class:`CertificateEvent`.  An interruption ends the solve with the best iterate, which is
    certified; one more leaves the certificate out.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    options : RunOptions, optional
    workspace : Workspace, optional
        What is known of the body, and stays known; by default the certificate gets the levels of the solve, and factors
        of the solve make room for it.

    Yields
    ------
    Event
        What happens; the generator returns a :class:`RunResult`.

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.solve`.
    """
    options = RunOptions() if options is None else options
    known = Workspace.given(workspace)
    problems = [posed(given, "run") for given in (*options.coarser, problem)]
    for warning in problems[-1].notes:
        yield WarningEvent(warning)
    solution = yield from solved(problems, options.method, options.controls, known)
    complaint, interrupted, certificate = "", solution.status is Status.INTERRUPTED, None
    try:
        if workspace is None and known.condenses(problems[-1]):
            known.forget()
        yield FoundEvent(solution)
        controls = options.controls
        certificate = certificate_of(solution, controls.rtol, controls.max_time, known, options.exact)
        if certificate is not None:
            yield CertificateEvent(certificate)
    except MemoryError:
        complaint = "not enough memory"
    except HemivarError as error:
        complaint = str(error)
    except KeyboardInterrupt:
        complaint, interrupted = "interrupted", True
    return RunResult(solution, certificate, complaint, interrupted)


def solved(
    problems: Sequence[DiscreteProblem],
    method: Solver | str | None,
    controls: Controls,
    workspace: Workspace | None = None,
) -> Work[Solution]:
    """The solution on the last of some meshes, each solution being the first guess on the next mesh.

    The workspace is for the last: what the others cost is given back before the next.
    """
    given = as_method(method)
    chosen, reason = choose(problems[-1]) if given is None else (given, "")
    yield MethodEvent(chosen, reason)
    solution: Solution | None = None
    for number, problem in enumerate(problems):
        try:
            yield StartEvent(problem, number, len(problems))
            guess = None if solution is None else transfer_solution(solution, problem)
            kept = workspace if problem is problems[-1] else None
            own = None if given is None else suited(given, problem)
            solution = yield from solving(problem, own, controls, initial=guess, workspace=kept)
        except KeyboardInterrupt:
            if solution is None:
                raise
            solution = replace(solution, status=Status.INTERRUPTED)
        if solution.status in (Status.INTERRUPTED, Status.OUT_OF_MEMORY):
            break
    assert solution is not None
    return solution


def certificate_of(
    solution: Solution,
    rtol: float = 0.0,
    max_time: float = math.inf,
    workspace: Workspace | None = None,
    exact: bool = False,
) -> Certificate | None:
    """The certificate of a solve to ``rtol``, in its own time; None if it ended with numbers that are not finite.

    Where multigrid serves, it leaves out the survey's trace constant, which needs a hierarchy of its own.
    """
    if not (np.isfinite(solution.unknowns).all() and np.isfinite(solution.multiplier).all()):
        return None
    return certify(
        solution,
        # what has converged to the tolerance that was asked for is stationary to that tolerance
        tolerance=max(rtol, STATIONARY),
        trace_constant=factorises(solution.problem),
        max_time=max_time,
        workspace=workspace,
        exact=exact,
    )
