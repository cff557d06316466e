"""Adaptive refinement: solve a problem on meshes that adapt to it, until its error is known to be small."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

from hemivar.basics.arguments import expecting
from hemivar.basics.display import brief
from hemivar.basics.generators import each_as
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.bounds import AdaptiveSolution
from hemivar.bounds.adaptive import AdaptiveLevel, AdaptOptions, solving_adaptive
from hemivar.bounds.adaptive_end import AdaptiveEnd
from hemivar.bounds.exact_certificate import statement_of
from hemivar.certificates import Certificate
from hemivar.errors import HemivarError
from hemivar.mechanics import ContactProblem
from hemivar.mechanics.statement import expect_body
from hemivar.workflows.events import CertificateEvent, Notice, Work
from hemivar.workflows.solving import certificate_of

__all__ = ["AdaptOptions", "AdaptResult", "Refined", "adapt"]


@dataclass(frozen=True, eq=False)
class Refined(Notice):
    """A mesh is done, the ``number``-th (from 0).

    Attributes
    ----------
    level : AdaptiveLevel
    number : int
        Which mesh, from 0.
    """

    level: AdaptiveLevel
    number: int


@dataclass(frozen=True, eq=False)
class AdaptResult:
    """What :func:`adapt` found.

    Attributes
    ----------
    adaptive : AdaptiveSolution
        All meshes that were finished.
    certificate : Certificate or None
        Of the last solution, with its distance to the exact one; None for the reason in ``complaint``.
    complaint : str
    """

    adaptive: AdaptiveSolution
    certificate: Certificate | None
    complaint: str = ""

    __repr__ = brief

    @property
    def interrupted(self) -> bool:
        """Whether the work was stopped from the keyboard."""
        return self.adaptive.ended is AdaptiveEnd.INTERRUPTED or self.complaint == "interrupted"


@expecting(options=AdaptOptions)
def adapt(problem: ContactProblem | ManufacturedProblem, options: AdaptOptions | None = None) -> Work[AdaptResult]:
    """Solve a problem on meshes that adapt to it, and certify the last solution.

    Yields :class:`Refined` for every mesh, and :class:`CertificateEvent`; it ends after a mesh if it is sent True.  An
    interruption ends it with the meshes that were finished; one more leaves the certificate out.

    Parameters
    ----------
    problem : ContactProblem
    options : AdaptOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`AdaptResult`.

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.bounds.solve_adaptive`.
    """
    options = AdaptOptions() if options is None else options
    remedy = "give a ContactProblem; hemivar.read_problem(path) reads one from a file"
    problem = expect_body(problem, "what to solve adaptively", remedy)
    numbers = count()
    adaptive = yield from each_as(solving_adaptive(problem, options), lambda level: Refined(level, next(numbers)))
    complaint, certificate = "", None
    try:
        certificate = certificate_of(adaptive.solution, options.controls.rtol, options.controls.max_time)
        if certificate is not None:
            certificate = replace(certificate, exact=statement_of(adaptive.distance))
            yield CertificateEvent(certificate)
    except MemoryError:
        complaint = "not enough memory"
    except HemivarError as error:
        complaint = str(error)
    except KeyboardInterrupt:
        complaint = "interrupted"
    return AdaptResult(adaptive, certificate, complaint)
