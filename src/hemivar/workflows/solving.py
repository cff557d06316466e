"""Solve a problem, and certify a solution, whoever computed it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.display import brief
from hemivar.basics.types import Array
from hemivar.certificates import Certificate
from hemivar.certificates import certify as certificate_of_pair
from hemivar.certificates.norms import factorises
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import HemivarError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.solvers import Controls, Progress, Solution, Solver, Status, transfer_solution
from hemivar.solvers.choice import choose
from hemivar.solvers.methods import as_method
from hemivar.solvers.solve import solving, suited
from hemivar.systems.workspace import Workspace
from hemivar.workflows.events import CertificateEvent, FoundEvent, MethodEvent, StartEvent, WarningEvent, Work

__all__ = [
    "CertifyOptions",
    "Progress",
    "RunOptions",
    "RunResult",
    "certificate_of",
    "certify",
    "from_coarser",
    "run",
]

#: Residual, relative to the load, up to which a pair counts as a solution.
_STATIONARY = 1e-8


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
    coarser: Sequence[ProblemLike] = ()
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
def run(problem: ProblemLike, options: RunOptions | None = None, workspace: Workspace | None = None) -> Work[RunResult]:
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
    problems = [as_discrete(given, "run") for given in (*options.coarser, problem)]
    for warning in problems[-1].notes:
        yield WarningEvent(warning)
    solution = yield from _solved(problems, options.method, options.controls, known)
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


def _solved(
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
            kept = workspace if problem is problems[-1] else None
            solution = yield from from_coarser(problem, solution, given, controls, kept)
        except KeyboardInterrupt:
            if solution is None:
                raise
            solution = replace(solution, status=Status.INTERRUPTED)
        if solution.status in (Status.INTERRUPTED, Status.OUT_OF_MEMORY):
            break
    assert solution is not None
    return solution


def from_coarser(
    problem: DiscreteProblem,
    last: Solution | None,
    method: Solver | None,
    controls: Controls,
    workspace: Workspace | None = None,
) -> Work[Solution]:
    """Solve from the solution on a coarser mesh, if there is one, by the method as it suits the problem."""
    guess = None if last is None else transfer_solution(last, problem)
    own = None if method is None else suited(method, problem)
    return (yield from solving(problem, own, controls, initial=guess, workspace=workspace))


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
    return certificate_of_pair(
        solution,
        # what has converged to the tolerance that was asked for is stationary to that tolerance
        tolerance=max(rtol, _STATIONARY),
        trace_constant=factorises(solution.problem),
        max_time=max_time,
        workspace=workspace,
        exact=exact,
    )


@dataclass(frozen=True)
class CertifyOptions:
    """How to certify.

    Parameters
    ----------
    tolerance : float
        Residual, relative to the load, up to which a pair counts as a solution.
    controls : Controls
        Limits of the solve, if there is one; ``max_time`` limits the certificate too.
    method : Solver or str, optional
        The method, or its name, of the solve; chosen by predicted cost and memory if not given.
    exact : bool
        Whether to bound the distance to the exact solution, too.
    """

    tolerance: float = _STATIONARY
    controls: Controls = field(default_factory=Controls)
    method: Solver | str | None = None
    exact: bool = False


@expecting(options=CertifyOptions)
def certify(
    problem: ProblemLike,
    unknowns: Array | None = None,
    multiplier: Array | None = None,
    options: CertifyOptions | None = None,
) -> Work[Certificate]:
    """Certify a pair, or what a solve finds if none is given.

    Yields the events of the solve, :class:`FoundEvent`, and :class:`CertificateEvent`.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    unknowns : array (n,), optional
    multiplier : array (m, d), optional
        Recomputed from equilibrium if not given.
    options : CertifyOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`Certificate`.

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.solve` and :func:`hemivar.certify`.
    """
    options = CertifyOptions() if options is None else options
    problem = as_discrete(problem, "certify")
    workspace = Workspace()
    if unknowns is None:
        solution = yield from _solved([problem], options.method, options.controls, workspace)
        if workspace.condenses(problem):
            workspace.forget()  # factors of the solve make room for those of the certificate
        yield FoundEvent(solution)
        unknowns, multiplier = solution.unknowns, solution.multiplier
    certificate = certificate_of_pair(
        problem,
        unknowns,
        multiplier,
        tolerance=options.tolerance,
        max_time=options.controls.max_time,
        workspace=workspace,
        exact=options.exact,
    )
    yield CertificateEvent(certificate)
    return certificate
