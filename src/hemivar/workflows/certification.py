"""Certify a solution, whoever computed it."""

from __future__ import annotations

from dataclasses import dataclass, field

from hemivar.basics.arguments import expecting
from hemivar.basics.types import Array
from hemivar.certificates import Certificate
from hemivar.certificates import certify as certificate_of_pair
from hemivar.fem.posed import Posable, posed
from hemivar.solvers import Controls, Solver
from hemivar.systems.workspace import Workspace
from hemivar.workflows.events import CertificateEvent, FoundEvent, Work
from hemivar.workflows.solving import STATIONARY, solved

__all__ = ["CertifyOptions", "certify"]


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

    tolerance: float = STATIONARY
    controls: Controls = field(default_factory=Controls)
    method: Solver | str | None = None
    exact: bool = False


@expecting(options=CertifyOptions)
def certify(
    problem: Posable,
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
    problem = posed(problem, "certify")
    workspace = Workspace()
    if unknowns is None:
        solution = yield from solved([problem], options.method, options.controls, workspace)
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
