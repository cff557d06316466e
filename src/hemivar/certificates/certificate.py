"""Certificates: what is known about a displacement and a multiplier, whoever computed them."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import fields, replace
from typing import Never, Protocol, TypeVar, runtime_checkable

import numpy as np

from hemivar.basics.arguments import expect, expecting, number
from hemivar.basics.arrays import SOLVED, real_array
from hemivar.basics.deadline import Budget, OutOfTime, limited
from hemivar.basics.defined_above import above
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.types import Array
from hemivar.certificates.bound import Point, anywhere, equilibrium_multiplier, error_bound
from hemivar.certificates.kind import LocalStudy, study
from hemivar.certificates.linear_bodies import STRESSED, convex_body, lower_bound_by
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.certificates.rigid_motions import motion_left
from hemivar.certificates.smallness import (
    Smallness,
    one_solution,
    smallness,
    unknown_constants,
    with_survey,
    within_reach,
)
from hemivar.certificates.wording import ESTIMATE, Certificate
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import residual
from hemivar.errors import ProblemError
from hemivar.fem.small_strain import Deformation, deformation_of
from hemivar.fem.stress_stiffness import under_own_stress
from hemivar.linear.definite import refuse_indefinite
from hemivar.linear.threads import one_thread
from hemivar.systems.workspace import Workspace

__all__ = ["ESTIMATE", "Certificate", "certified", "certify"]

_Part = TypeVar("_Part")


@runtime_checkable
class Certifiable(Protocol):
    """A problem with unknowns and a multiplier: a :class:`hemivar.Solution`."""

    @property
    def problem(self) -> DiscreteProblem:
        """What was solved."""

    @property
    def unknowns(self) -> Array:
        """The unknowns u, (n,)."""

    @property
    def multiplier(self) -> Array:
        """Force per area of the body on the foundation, (m, d): pressure, and minus the friction."""


@known_keywords
@expecting(trace_constant=bool, exact=bool)
def certify(
    problem: DiscreteProblem | Certifiable,
    displacement: Array | Certifiable | None = None,
    multiplier: Array | None = None,
    *,
    factor: EnergyNorm | None = None,
    tolerance: float = 1e-8,
    trace_constant: bool = True,
    max_time: float = math.inf,
    workspace: Workspace | None = None,
    exact: bool = False,
) -> Certificate:
    """Certify a displacement and a multiplier: recompute everything from the problem.

    Parameters
    ----------
    problem : DiscreteProblem or Solution
        A solution stands for its problem, unknowns and multiplier.
    displacement : array (n,) or (nodes, d), or Solution
        The unknowns u of the problem, or the displacement of all nodes of its mesh (checked to fulfil the supports);
        left out only where a solution is the first argument.
    multiplier : array (m, d), optional
        Force per area of the body on the foundation: pressure, and minus the friction.  Recomputed from equilibrium
        (least squares) if not given.
    factor : EnergyNorm, optional
        The norm to take in place of the one that suits the size of the problem.
    tolerance : float
        Residual, relative to the load, up to which the pair counts as a solution.
    trace_constant : bool
        Whether to compute the survey's c_gamma and (H_s), which costs a factorisation, or a hierarchy, of its own.
    max_time : float
        Seconds; what is not known by then is left out and named, all but the residual. A factorisation that is under
        way is not interrupted.
    workspace : Workspace, optional
        Keeps factors, levels and trace constants for other points, loads, gaps and laws of the same body.
    exact : bool
        Whether to bound the distance to the exact solution of the continuous problem too, by
        :func:`hemivar.bounds.exact_certificate.distance_to_exact`: in the plane it costs about two contact solves, in
        space ten, and once per body some seconds for its trace constants.

    Returns
    -------
    Certificate

    Raises
    ------
    ProblemError
        Wrong shapes, numbers that are not finite, a displacement that the supports do not allow, or a stiffness with a
        negative eigenvalue.

    Notes
    -----
    The bound and its proof are in ``docs/theory/certificates.md``.  It is of the distance to the exact solution of the
    *discrete* problem; what the mesh leaves out is in ``exact``, where it is asked for (``docs/bounds.md``).

    Examples
    --------
    >>> import hemivar as hv
    >>> solution = hv.solve(hv.gallery.survey("5.1", 8))
    >>> certificate = hv.certify(solution, exact=True)
    >>> certificate.unique, certificate.exact.guaranteed
    (True, True)
    >>> print(f"{certificate.exact.relative:.2f}")
    0.11
    """
    distance = above("certificate.certify", "exact=True") if exact else None
    deformed = getattr(problem, "deformation", None)  # what a solution knows already
    problem, given, multiplier = _pair(problem, displacement, multiplier)
    if factor is not None:
        expect(factor, EnergyNorm, "the factor", "pass hemivar.certificates.energy_norm(problem)")
    tolerance = number(tolerance, "the tolerance of a certificate")
    m, d = problem.contact_points, problem.contact.components
    u = _unknowns(problem, given)
    if not 0.0 <= tolerance <= 0.1:
        raise ProblemError(f"the tolerance of a certificate is {tolerance}; it must be between 0 and 0.1 of the load")
    problem = under_own_stress(problem, u)
    budget = Budget(max_time)
    kept = Workspace.given(workspace)
    energy = energy_norm(problem, kept) if factor is None else factor
    if energy.diagonal.size != problem.unknowns:
        raise ProblemError("the factor given belongs to another problem; pass energy_norm(problem)")
    if not energy.definite and lower_bound_by(problem) != STRESSED:
        refuse_indefinite(energy.indefinite)
    if multiplier is None:
        lam = _multiplier(problem, u)
    else:
        lam = real_array(multiplier, "the multiplier", finite=False)
        if lam.shape != (m, d):
            raise ProblemError(f"the multiplier has shape {lam.shape}; this problem needs ({m}, {d})")
        if not np.isfinite(lam).all():
            raise ProblemError("the multiplier holds nan or infinity; leave it out to have it recomputed")
    with one_thread(not energy.factorised):
        point = Point(problem, energy, u, lam)
        certificate = certified(point, tolerance, kept if trace_constant else None, budget, exact, deformed)
    if distance is None:
        return certificate
    return replace(certificate, exact=distance(problem, u, max_time=budget.left, workspace=kept))


_Classified = tuple[PointKind, bool | str | None, LocalStudy | None]


def _known(certificate: Certificate) -> Certificate:
    """The certificate, without the word unique where a number came out as nan: nothing is proved then."""
    numbers = [getattr(certificate, item.name) for item in fields(certificate)]
    numbers += [getattr(certificate.smallness, item.name) for item in fields(certificate.smallness)]
    if not any(isinstance(number, float) and math.isnan(number) for number in numbers):
        return certificate
    proved = (PointKind.UNIQUE_MINIMISER, PointKind.UNIQUE_SOLUTION, PointKind.GLOBAL_MINIMISER)
    kind = certificate.kind
    if kind in proved:
        kind = PointKind.DIRECTIONALLY_STATIONARY if kind.has_energy else PointKind.BOUND_FIXED_DIRECTIONAL
    return replace(certificate, unique=None, kind=kind)


def _pair(
    problem: object, displacement: Array | Certifiable | None, multiplier: Array | None
) -> tuple[DiscreteProblem, Array, Array | None]:
    """Problem, unknowns and multiplier, taken from a solution where one is given."""
    if isinstance(problem, Certifiable):
        if displacement is not None or multiplier is not None:
            raise ProblemError(
                "certify: a solution already contains its unknowns and multiplier; leave them out, or give "
                "solution.problem instead of the solution"
            )
        displacement = problem
        problem = displacement.problem
    remedy = "give hemivar.discretize(problem), or the solution alone: certify(solution)"
    discrete = expect(problem, DiscreteProblem, "certify: the problem", remedy)
    if isinstance(displacement, Certifiable):
        multiplier = displacement.multiplier if multiplier is None else multiplier
        displacement = displacement.unknowns
    if displacement is None:
        raise ProblemError("certify: no displacement is given; give a solution, or its unknowns (n,)")
    return discrete, displacement, multiplier


def _unknowns(problem: DiscreteProblem, given: Array) -> Array:
    """The unknowns (n,), given themselves or as the displacement of all nodes, (nodes, d)."""
    u = real_array(given, "the displacement", finite=False)
    field = problem.field
    nodal = None if field is None else (field.number_of_nodes, field.components)
    shape = (problem.unknowns,)
    if u.shape not in (shape, nodal):
        nodes = "" if nodal is None else f", the displacement of the nodes has shape {nodal}"
        raise ProblemError(f"the displacement has shape {u.shape}; the unknowns have shape {shape}{nodes}")
    if not np.isfinite(u).all():
        raise ProblemError("the displacement holds nan or infinity; give finite numbers")
    if field is None or u.shape == shape:
        return u
    unknowns = field.restrict(u)
    off = np.abs(field.full(unknowns) - u).max(axis=1)
    misses = off > SOLVED * np.abs(u).max()
    if misses.any():
        node = int(off.argmax())
        place = ", ".join(f"{x + 0.0:.6g}" for x in field.nodes[node])
        raise ProblemError(
            f"the displacement violates the supports at {np.count_nonzero(misses)} nodes; at node {node}, "
            f"x = ({place}), it differs by {off[node]:.3g}"
        )
    return unknowns


def certified(
    point: Point,
    tolerance: float,
    kept: Workspace | None,
    budget: Budget,
    exact: bool = False,
    deformed: object = None,
) -> Certificate:
    """The certificate of a point, with the trace constant where a workspace is given, in space of the body if exact.

    Of a point over many processes what takes the whole matrix is left out, and that matrix looks at the budget.
    """
    problem, vectors = point.problem, point.problem.vectors
    energy, u, lam = point.energy, point.u, point.lam
    m, r = problem.contact_points, problem.local(point.u)
    law = problem.law.frozen(r, lam) if m else None
    left_out: list[str] = []

    def in_time(name: str, work: Callable[[], _Part], instead: _Part) -> _Part:
        try:
            if vectors.largest(budget.due())[0]:
                raise OutOfTime
            with limited(budget) if energy.at_hand else nullcontext():
                return work()
        except OutOfTime:
            left_out.append(name)
            return instead

    defect = residual(problem, u, lam)
    stationary = defect.below(0.0, tolerance)
    constants, outside = in_time(
        "margin",
        lambda: within_reach(
            point, smallness(problem, displacement=u, multiplier=lam, factor=energy, trace_constant=False)
        ),
        (unknown_constants(problem), ""),
    )
    equilibrium, load_norm = in_time(
        "equilibrium",
        lambda: (point.imbalance[1], energy.least_dual_norm(problem.load)) if energy.definite else (np.inf, np.inf),
        (np.inf, np.inf),
    )
    proved = energy.by.proves
    bound = in_time("error bound", lambda: error_bound(point, constants.margin) if proved else _unproved(), np.inf)
    nothing: _Classified = (PointKind.STATIONARY if stationary else PointKind.NOT_STATIONARY, None, None)
    kind, unique, local = in_time("kind", lambda: _classify(point, constants, tolerance, stationary), nothing)
    if constants.stiffness_by == STRESSED:
        bound = np.inf
    if unique is True and constants.stiffness_by == STRESSED:
        unique = "the only one with this stress"
        kind = PointKind.LOCAL_MINIMISER if kind.has_energy else PointKind.BOUND_FIXED_MINIMISER
    if kept is not None:
        asked = constants
        constants = in_time("trace constant", lambda: with_survey(problem, asked, True, kept, exact), constants)
    elif not energy.at_hand:
        left_out.append("trace constant")
    size = energy.norm(u)
    if not isinstance(deformed, Deformation):
        deformed = deformation_of(problem, u)
    strained = None if deformed is None else deformed.warning
    with np.errstate(invalid="ignore"):
        off = law.distance(r, lam) if law is not None else np.zeros(0)
    certificate = Certificate(
        equilibrium=equilibrium,
        equilibrium_relative=_ratio(equilibrium, load_norm),
        inclusion=defect.inclusion,
        inclusion_relative=_ratio(defect.inclusion, defect.scale),
        inclusion_distance=float(vectors.largest(float(off.max(initial=0.0)))[0]),
        residual=defect,
        energy=problem.energy(u, lam),
        margin=constants.margin,
        error_bound=bound,
        error_bound_relative=_ratio(bound, size),
        kind=kind,
        unique=unique,
        curvature=None if local is None else local.curvature,
        direction=None if local is None else local.direction,
        free_motion="" if local is None else local.free_motion,
        stationary=stationary,
        tolerance=tolerance,
        smallness=constants,
        method=energy.by.method,
        seconds=budget.spent,
        warnings=tuple(warning for warning in (*problem.notes, strained, outside) if warning),
        error_bound_sampled=constants.sampled or bool(constants.within),
        left_out=tuple(left_out),
        apart=not energy.at_hand,
    )
    return _known(certificate)


def _unproved() -> Never:
    """What takes a proof, or the whole matrix, is left out where there is none."""
    raise OutOfTime


def _ratio(part: float, whole: float) -> float:
    if not math.isfinite(part):
        return math.inf
    return part / whole if whole > 0.0 and math.isfinite(whole) else part


def _multiplier(problem: DiscreteProblem, u: Array) -> Array:
    """Equilibrium where the body can move; the multiplier of the law nearest to zero where it cannot."""
    lam = equilibrium_multiplier(problem, u)
    m, d = problem.contact_points, problem.contact.components
    fixed = np.diff(problem.contact.trace.indptr).reshape(m, d) == 0
    if fixed.any():
        r = problem.local(u)
        law = problem.law.frozen(r, lam)
        bound = law.penetrations
        r[:, 0] = np.clip(r[:, 0], bound.lower, bound.upper)
        lam = np.where(fixed, law.nearest_multiplier(r, np.zeros_like(lam)), lam)
    return lam


def _classify(point: Point, constants: Smallness, tolerance: float, stationary: bool) -> _Classified:
    problem = point.problem
    m = problem.contact_points
    dependent = anywhere(problem, bool(m and problem.law.state_dependent))
    unique: bool | None = True if point.energy.by.proves and one_solution(problem, constants) else None
    if not stationary:
        return PointKind.NOT_STATIONARY, unique, None
    if unique:
        return PointKind.UNIQUE_SOLUTION if dependent else PointKind.UNIQUE_MINIMISER, True, None
    local = study(point) if point.energy.at_hand else _unproved()
    if constants.within and constants.margin > 0.0 and not constants.sampled:
        return local.kind, f"the only one with {constants.within}", local
    if dependent:
        return local.kind, None, local
    convex = convex_body(problem)
    if convex and constants.m_alpha == 0.0 and not (constants.alpha_sampled or constants.within):
        isolated = local.kind is PointKind.LOCAL_MINIMISER and point.energy.definite
        if (left := "" if isolated else motion_left(point, tolerance)) == "":
            return PointKind.UNIQUE_MINIMISER, True, replace(local, direction=None)
        local = replace(local, direction=None, free_motion="" if left is None else left[1:-1])
        return PointKind.GLOBAL_MINIMISER, None, local
    falls = local.kind in (PointKind.SADDLE, PointKind.MAXIMUM, PointKind.CLARKE_STATIONARY)
    if falls and convex and point.energy.definite and _bounded_below(problem):
        unique = False  # the energy has a global minimiser, and this is not it
    return local.kind, unique, local


def _bounded_below(problem: DiscreteProblem) -> bool:
    """Whether the law falls at most linearly, so that a positive definite stiffness makes the energy coercive."""
    return all(bool((rate > -np.inf).all()) for rate in problem.law.rates)
