"""Smallness: whether the body is stiff enough for the laws of its foundation to leave one solution only.

The survey asks for ``(H_s): m_A > (m_alpha + m_L) c_gamma^2``.  On a discrete problem the same can be asked directly,
and far more sharply: whether ``K - B'W diag(alpha) B`` is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expecting
from hemivar.basics.arrays import COUNTS
from hemivar.basics.deadline import check_time
from hemivar.basics.defined_above import defined_above
from hemivar.basics.types import Array
from hemivar.certificates.bound import Point, anywhere, equilibrium_multiplier, error_bound, friction_bound
from hemivar.certificates.linear_bodies import STRESSED, UNKNOWN, largest_strain, lower_bound_by, strain_reach
from hemivar.certificates.norms import EnergyNorm, energy_norm, factorises
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.discretize import discretize
from hemivar.fem.quadrature import at_quadrature_points
from hemivar.laws import ContactLaw, Friction
from hemivar.laws.coupled import bounded
from hemivar.laws.normal_and_friction import NormalAndFriction
from hemivar.mechanics.conditions import Spring
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_words import BoundsBy
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

#: A reach without limits for penetration and slip.
_EVERYWHERE = (np.inf, np.inf)
#: Reaches that are tried after it, in largest displacements: tests/certificates show the same with 5 for the first, and
#: without the last.
_REACHES = (10.0, 2.0, 1.25)
#: The energy of this material is the square of the norm of V.
_NORM = Material.lame(0.0, 0.5)
_RING_NORM = Material.lame(0.0, 0.5, plane="axisymmetric")
#: Roundings of an eigenvalue, in units of the condition number of K scaled to a unit diagonal.
_HIDDEN = 16.0

__all__ = ["Smallness", "TraceConstants", "ellipticity", "margin_at", "one_solution", "smallness", "trace_constants"]


@dataclass(frozen=True)
class TraceConstants:
    """Norms of the trace V -> L2(contact boundary)^d, ``|v|_V = |eps(v)|_L2``.

    Attributes
    ----------
    both, normal, tangential : float
        c_gamma of ``v``, and with ``v_nu`` or ``v_tau`` alone; units sqrt(length).
    """

    both: float
    normal: float
    tangential: float


@dataclass(frozen=True)
class Smallness:
    """Constants that decide whether a solution is the only one.

    Attributes
    ----------
    alpha_normal, alpha_tangential : float
        Largest weak convexity constant of the normal law and of the friction law over the contact boundary (force per
        area and length); inf where a derivative jumps down. Where the friction bound depends on the penetration, that
        of the profile times the largest bound that any solution can have; inf if that is not known.
    alpha_sampled : bool
        True if a law knows its alpha from samples only; what follows then holds as far as the samples do.
    m_alpha : float
        The survey's m_alpha, the larger of both.
    m_L : float
        The survey's m_L: Lipschitz constant of the friction bound in the penetration times the largest slope of the
        friction profile, or of the tractions of glue in the state whose mode it takes. It is 0 for laws that do not
        depend on the solution, inf for those that jump or need the pressure.
    m_A : float or None
        Smallest eigenvalue of the elasticity tensor over the body, ``eps : C eps >= m_A eps : eps``; None for a
        problem made of arrays.
    trace_constant : float or None
        c_gamma on this mesh; :func:`trace_constants` gives its normal and tangential parts as well.
    survey_condition : bool or None
        The survey's (H_s), ``m_A > (m_alpha + m_L) c_gamma^2``: True with ``trace_bound`` if that is there, False with
        the trace constant of this mesh; None too if the true c_gamma, which lies between both, decides, or would need
        :mod:`hemivar.bounds` where that is not installed.
    survey_margin : float or None
        ``1 - (m_alpha + m_L) c_gamma^2 / m_A``, with ``trace_bound`` if that is there; (H_s) holds if it is positive.
    constant : float
        c, largest eigenvalue of ``(B'W diag(alpha) B, K)``: the energy (for a state-dependent bound, frozen at any
        solution) is strictly convex if c < 1.
    constant_normal, constant_tangential : float or None
        The same with the normal or the tangential alpha alone; c is at most their sum, at least either.  None where
        both laws soften and multigrid serves, for each costs as much as c itself.
    coupling : float
        Bound of ``sum_j w_j m_L |r_nu(w)| |r_tau(v)|`` over ``|w|_K = |v|_K = 1``; 0 unless the bound depends on the
        penetration.
    contraction : float
        ``coupling / (1 - c)``: factor by which an outer fixed-point step on the state reduces the error in the energy
        norm; inf if c >= 1.
    margin : float
        ``1 - c - coupling``, less the rounding in it; positive if the discrete problem has one solution.
    m_L_sampled : bool
        The same as ``alpha_sampled`` for m_L: the friction bound is a function, or a formula without a bound of its
        slope.
    trace_bound : float or None
        Upper bound of the c_gamma of the continuous problem, which those of meshes approach from below
        (:func:`hemivar.bounds.lower_bounds`). It is computed where laws soften, in space, where it
        takes a second or two, only if asked for; without it (H_s) speaks of this mesh.
    reach_normal, reach_tangential, reach_strain : float
        Penetrations (and openings), slips and sizes of strains up to which the constants hold; inf where they hold for
        all.
    m_A_sampled : bool
        Whether m_A is that of the points of a rule, for moduli that are functions of the place, or of a lower tensor
        that is sampled: then so is (H_s).
    stiffness_by : str
        How the lower tensor of a material that is not linear was found: "closed form", "intervals", "sampled", "stated"
        with a bulk of the user's own, or "unknown", and then there is no margin; empty for a linear body.
    """

    alpha_normal: float
    alpha_tangential: float
    alpha_sampled: bool
    m_alpha: float
    m_L: float  # noqa: N815 - the survey's name
    m_A: float | None  # noqa: N815 - the survey's name
    trace_constant: float | None
    survey_condition: bool | None
    survey_margin: float | None
    constant: float
    constant_normal: float | None
    constant_tangential: float | None
    coupling: float
    contraction: float
    margin: float
    m_L_sampled: bool = False  # noqa: N815 - the survey's name
    trace_bound: float | None = None
    m_A_sampled: bool = False  # noqa: N815 - the survey's name
    reach_normal: float = np.inf
    reach_tangential: float = np.inf
    stiffness_by: str = ""
    reach_strain: float = np.inf

    @property
    def within(self) -> str:
        """Penetrations, slips and strains that the constants hold for, in words; empty if they hold for all."""
        reaches = {"penetrations": self.reach_normal, "slips": self.reach_tangential, "strains": self.reach_strain}
        limits = [f"{what} within the reach {reach:g}" for what, reach in reaches.items() if reach < np.inf]
        return " and ".join(limits)

    @property
    def sampled(self) -> bool:
        """Whether the margin rests on samples: then it proves nothing."""
        return self.alpha_sampled or self.m_L_sampled or self.stiffness_by == BoundsBy.SAMPLED


@expecting(factor=EnergyNorm, trace_constant=bool)
def smallness(
    problem: ProblemLike,
    *,
    displacement: Array | None = None,
    multiplier: Array | None = None,
    factor: EnergyNorm | None = None,
    trace_constant: bool = True,
    workspace: Workspace | None = None,
) -> Smallness:
    """The constants of a discrete problem; they hold for all its solutions at once.

    Parameters
    ----------
    problem : DiscreteProblem
    displacement : array (n,), optional
        Unknowns near a solution, from which the reach of all solutions is bounded: needed where friction weakens with
        the slip and its bound depends on the penetration.  Without them, or where they bound nothing, its alpha is
        infinite.
    multiplier : array (m, d), optional
        That in equilibrium with ``displacement`` by default.
    factor : EnergyNorm, optional
        The energy norm, where it is there already.
    trace_constant : bool
        Whether to compute c_gamma, which costs a factorisation, or a hierarchy, of its own, and where laws soften a
        bound of it for the continuous problem.
    workspace : Workspace, optional
        Keeps what is expensive for other laws of the same body.

    Returns
    -------
    Smallness
    """
    problem = as_discrete(problem, "smallness")
    energy = energy_norm(problem, workspace) if factor is None else factor
    constants = _constants_at(problem, energy, displacement, multiplier)
    return with_survey(problem, constants, trace_constant, workspace)


def margin_at(problem: DiscreteProblem, displacement: Array, multiplier: Array, workspace: Workspace) -> float:
    """The margin of :func:`smallness` alone, of a law that depends on the state, for many steps of one body.

    ``displacement`` is (n,); ``multiplier`` is (m, d). ``-inf`` without any work where the friction bound depends on
    the pressure, as Coulomb's does.
    """
    visible = np.diff(problem.contact.trace.indptr).reshape(problem.contact_points, problem.contact.components) > 0
    coupled = visible[:, 0] & visible[:, 1:].any(axis=1)
    if np.isinf(np.where(coupled, problem.law.lipschitz, 0.0)).any():
        return -np.inf
    return _constants_at(problem, energy_norm(problem, workspace), displacement, multiplier).margin


def _constants_at(
    problem: DiscreteProblem, energy: EnergyNorm, displacement: Array | None, multiplier: Array | None
) -> Smallness:
    """The constants without those of the survey."""
    bounds: Array | None = None
    if _bound_depends(problem):
        point: Point | None = None
        if displacement is not None:
            u = np.asarray(displacement, dtype=float)
            lam = equilibrium_multiplier(problem, u) if multiplier is None else np.asarray(multiplier, dtype=float)
            point = Point(problem, energy, u, lam)
        bounds = largest_bounds(problem, energy, point)
    return _constants(problem, energy, bounds)


def with_survey(
    problem: DiscreteProblem,
    constants: Smallness,
    trace_constant: bool,
    workspace: Workspace | None = None,
    in_space: bool = True,
) -> Smallness:
    """The constants with those of the survey: m_A, and if asked for c_gamma and (H_s).

    ``in_space`` tells whether to look for the c_gamma of the continuous problem in space, too.
    """
    known = problem.origin is not None and isinstance(problem.bulk, Quadratic | Potential)
    if problem.origin is None or not known or not problem.contact_points or constants.stiffness_by == STRESSED:
        return constants
    m_a, stated = ellipticity(problem.origin), problem.origin
    material = stated.material
    sampled = not (material.uniform and material.bounds_by.proved and material.reach == np.inf)
    constants = replace(constants, m_A=m_a, m_A_sampled=sampled)
    if not trace_constant:
        return constants
    trace = _trace_eigenvalues(problem, parts=False, workspace=workspace)[0]
    steep, above, missing = constants.m_alpha + constants.m_L, None, False
    if 0.0 < steep < np.inf and (in_space or problem.origin.mesh.dim == 2):
        above = trace_bound(problem.origin, workspace)
        missing = defined_above("smallness.trace_bound") is None
    least, needed = (0.0 if steep == 0.0 else steep * c**2 for c in (trace, trace if above is None else above))
    return replace(
        constants,
        trace_constant=trace,
        trace_bound=above,
        survey_condition=True if m_a > needed and not missing else None if m_a > least else False,
        survey_margin=-np.inf if m_a == 0.0 else 1.0 - needed / m_a,
    )


def trace_bound(statement: ContactProblem, workspace: Workspace | None) -> float | None:
    """Upper bound of the c_gamma of a body; None where none is known."""
    if any(contact.against for contact in statement.contact.values()):
        return None  # of two sides that touch it is the jump that the law sees
    proved = defined_above("smallness.trace_bound")
    if proved is None:
        return None
    check_time()
    bound: float | None = proved(statement, _RING_NORM if statement.kinematics.ring else _NORM, workspace)
    return bound


def unknown_constants(problem: DiscreteProblem) -> Smallness:
    """What is known of the constants without any work on K: alpha and m_L, and no margin."""
    bounds = np.full(problem.contact_points, np.inf) if _bound_depends(problem) else None
    return _constants(problem, None, bounds)


def _bound_depends(problem: DiscreteProblem) -> bool:
    """Whether a friction bound depends on the state, beside a normal law that does not, at every point."""
    law = problem.law
    known = isinstance(law, NormalAndFriction) and law.state_dependent
    return anywhere(problem, bool(problem.contact_points and known))


def largest_bounds(
    problem: DiscreteProblem, energy: EnergyNorm, point: Point | None, reach: tuple[float, ...] = _EVERYWHERE
) -> Array:
    """What the friction bound of each contact point is at most in any solution, (m,); inf where that is not known.

    Only where the friction also weakens with the slip: elsewhere the answer is of no use, and infinite.  The proof is
    in docs/theory/certificates.md: the law frozen at a pair bounds the distance of all solutions from it; of those
    within ``reach`` if that is finite.
    """
    m, d = problem.contact_points, problem.contact.components
    if not problem.vectors.alone:
        return np.full(m, np.inf)
    rate = np.broadcast_to(problem.law.lipschitz, (m,))
    own = bounded(problem.law)
    weakens = np.broadcast_to(own.friction.profile.weak_convexity, (m,)) > 0.0
    if point is None:
        r, lam = -problem.offset, np.zeros((m, d))
        return np.where(rate > 0.0, np.inf, friction_bound(problem, r, lam))
    if d == 1 or not (energy.definite and np.any(weakens)) or not np.isfinite(rate).all():
        return np.full(m, np.inf)
    r = problem.local(point.u)
    here = friction_bound(problem, r, point.lam)
    near = here * (1.0 + COUNTS) + rate * COUNTS * float(np.abs(r).max(initial=0.0))
    margin = _constants(problem, energy, near, reach).margin
    if not margin > 0.0:
        return np.full(m, np.inf)
    radius = error_bound(point, margin, near)
    # |(B e)_nu| at a contact point is at most |e|_K sqrt(largest eigenvalue of (B_nu'W B_nu, K) / weight)
    weight = np.zeros((m, d))
    weight[:, 0] = problem.contact.weights
    stretch = energy.largest_eigenvalue(problem.contact.trace, weight.ravel()).bound
    reached = here + rate * radius * np.sqrt(stretch / problem.contact.weights)
    return near if bool((reached <= near).all()) else np.where(np.isnan(reached), np.inf, reached)


def _constants(
    problem: DiscreteProblem, energy: EnergyNorm | None, bounds: Array | None, reach: tuple[float, ...] = _EVERYWHERE
) -> Smallness:
    """The constants, the friction bounds (m,) being at most ``bounds`` where they depend on the state.

    A ``reach`` of penetration or slip that is finite asks for the constants that are proved up to it.
    """
    m, d = problem.contact_points, problem.contact.components
    stiffness_by = lower_bound_by(problem)
    if stiffness_by == UNKNOWN:
        energy = None
    if m:
        law = problem.law
        if bounds is None:
            normal, tangential = (np.broadcast_to(alpha, (m,)) for alpha in law.proof("alpha").value(*reach))
        else:
            own = bounded(law)
            unit = ContactLaw(own.normal, Friction(1.0, own.friction.profile))
            normal, profile = (np.broadcast_to(alpha, (m,)) for alpha in unit.proof("alpha").value(*reach))
            with np.errstate(invalid="ignore"):
                tangential = np.where((profile > 0.0) & (bounds > 0.0), profile * bounds, 0.0)
        coupling_weight = np.broadcast_to(law.steering, (m,))
        sampled = not law.proof("alpha").sure
    else:
        normal = tangential = coupling_weight = np.zeros(m)
        sampled = False
    if d == 1:
        tangential = coupling_weight = np.zeros(m)
    visible = np.diff(problem.contact.trace.indptr).reshape(m, d) > 0
    seen_normal = visible[:, 0]
    seen_tangential = visible[:, 1:].any(axis=1)
    normal = np.where(seen_normal, normal, 0.0)
    tangential = np.where(seen_tangential, tangential, 0.0)
    coupling_weight = np.where(seen_normal & seen_tangential, coupling_weight, 0.0)
    w = problem.contact.weights

    def top(on_normal: Array, on_tangential: Array, near: float | None = None) -> float:
        weight = np.zeros((m, d))
        weight[:, 0] = on_normal
        weight[:, 1:] = on_tangential[:, None]
        if not anywhere(problem, weight):
            return 0.0
        if energy is None or not energy.definite or anywhere(problem, ~np.isfinite(weight)):
            return np.inf
        return energy.largest_eigenvalue(problem.contact.trace, (w[:, None] * weight).ravel(), near).bound

    none = np.zeros(m)
    both = anywhere(problem, normal) and anywhere(problem, tangential)
    c_normal: float | None = None
    c_tangential: float | None = None
    if both and energy is not None and not energy.factorised:
        c = top(normal, tangential, 1.0)
    else:
        c_normal, c_tangential = top(normal, none, 1.0), top(none, tangential, 1.0)
        c = top(normal, tangential) if both and np.isfinite(c_normal + c_tangential) else max(c_normal, c_tangential)
    slips = bool(d > 1 and np.any(seen_normal & seen_tangential))
    coupling = 0.0
    if anywhere(problem, coupling_weight) and anywhere(problem, bool(m and problem.law.depends_on_whole_state)):
        coupling = top(coupling_weight, coupling_weight)
    elif anywhere(problem, coupling_weight):
        coupling = float(np.sqrt(top(coupling_weight, none)) * np.sqrt(top(none, coupling_weight)))
    largest = problem.vectors.largest(
        *(float(values.max(initial=0.0)) for values in (normal, tangential, coupling_weight)),
        float(sampled),
        float(slips and not problem.law.proof("lipschitz").sure),
    )
    alpha_normal, alpha_tangential, m_l, sampled, sampled_rate = largest.tolist()
    m_alpha = max(alpha_normal, alpha_tangential)
    return Smallness(
        alpha_normal=alpha_normal,
        alpha_tangential=alpha_tangential,
        alpha_sampled=bool(sampled),
        m_alpha=m_alpha,
        m_L=m_l,
        m_A=None,
        trace_constant=None,
        survey_condition=None,
        survey_margin=None,
        constant=c,
        constant_normal=c_normal,
        constant_tangential=c_tangential,
        coupling=coupling,
        contraction=0.0 if coupling == 0.0 else (coupling / (1.0 - c) if c < 1.0 else np.inf),
        margin=_margin(energy, c, coupling),
        m_L_sampled=bool(sampled_rate),
        stiffness_by=stiffness_by,
        reach_strain=strain_reach(problem),
    )


def _margin(energy: EnergyNorm | None, c: float, coupling: float) -> float:
    """``1 - c - coupling``, less what rounding can hide where K is badly conditioned."""
    if energy is None or not energy.definite:
        return -np.inf
    used = c + coupling
    hidden = 0.0
    if energy.factorised and 0.0 < used < 2.0:
        hidden = _HIDDEN * float(np.finfo(float).eps) * used / max(energy.lowest, float(np.finfo(float).tiny))
    return 1.0 - used - hidden


def one_solution(problem: DiscreteProblem, constants: Smallness) -> bool:
    """Whether the constants prove that the discrete problem has one solution: nothing sampled, nothing unknown.

    Parameters
    ----------
    problem : DiscreteProblem
    constants : Smallness

    Returns
    -------
    bool
    """
    return bool(constants.margin > 0.0 and not constants.sampled and not constants.within)


def within_reach(point: Point, constants: Smallness) -> tuple[Smallness, str]:
    """The constants of penetrations and slips within a reach, where a law has none that are proved for all of them.

    The reach is that of the law, or where it leaves no margin, one found from the displacements of the point: from ten
    times the largest down to 1.25 times.  Displacements within a reach are a convex set, and on it the proof that there
    is one solution is the same.

    Returns constants, why.
    """
    problem = point.problem
    if constants.reach_strain < np.inf:
        strain = largest_strain(problem, point.u) if problem.field is not None and problem.field.order == 1 else np.inf
        if not strain <= constants.reach_strain:
            found_strains = "that are not bounded" if strain == np.inf else f"of up to {strain:.3g}"
            outside = f"strains {found_strains} may lie outside of the reach {constants.reach_strain:g} of the material"
            why = f"{outside}: whether there are other solutions is not known; give the material a larger reach"
            return replace(constants, margin=-np.inf), why
    m, d = problem.contact_points, problem.contact.components
    if not (m and constants.alpha_sampled and problem.vectors.alone):
        return constants, ""
    r, law = problem.local(point.u), problem.law
    limits = (*law.proof("alpha").reach[:d], np.inf)[:2]
    if min(limits) == 0.0:
        return constants, ""
    sizes = float(np.abs(r[:, 0]).max()), float(np.linalg.norm(r[:, 1:], axis=1).max())
    for what, size, limit in zip(("penetration", "slip"), sizes, limits, strict=True):
        if size > limit:
            outside = f"the {what} {size:.4g} lies outside of the reach {limit:g} of its law"
            return constants, f"{outside}: whether there are other solutions is not known; give the law a larger reach"
    reached = constants
    for factor in (np.inf, *_REACHES):
        near = float(f"{factor * max(sizes):.3g}")
        reach = tuple(min(limit, near) if limit < np.inf else limit for limit in limits)
        if min(reach) > 0.0:
            bounds = largest_bounds(problem, point.energy, point, reach) if _bound_depends(problem) else None
            reached = replace(
                _constants(problem, point.energy, bounds, reach),
                alpha_sampled=False,
                reach_normal=reach[0],
                reach_tangential=reach[1],
            )
        if reached.margin > 0.0:
            break
    return reached, ""


def ellipticity(statement: ContactProblem) -> float:
    """m_A, the smallest eigenvalue of the elasticity tensor over the body: ``eps : C eps >= m_A eps : eps``.

    That of the lower tensor of a material that is not linear; that of the coefficient for one component.  What varies
    is sampled at the quadrature points of the stiffness matrix.

    Parameters
    ----------
    statement : ContactProblem

    Returns
    -------
    float
    """
    mesh, material = statement.mesh, statement.material
    if material.homogeneous:
        tensor = material.lower_tensor(mesh.points[:1])
    else:
        tensor, _ = at_quadrature_points(mesh, 2 * statement.order, material.lower_tensor)
    scale = np.ones(tensor.shape[-1])
    scale[mesh.dim :] = np.sqrt(2.0)  # Mandel's form: shear strains as sqrt(2) eps_xy
    return float(np.linalg.eigvalsh(tensor * np.outer(scale, scale))[..., 0].min())


def trace_constants(problem: DiscreteProblem) -> TraceConstants:
    """c_gamma on the mesh of a problem: ``c_gamma^2`` is the largest eigenvalue of ``(B'W B, M_V)``.

    ``M_V`` is the matrix of ``int eps(u) : eps(v)``, or of ``int grad u . grad v`` for one component; the integral over
    the contact boundary is that of the discretisation, by nodes or by midpoints.  Grows to its limit as the mesh is
    refined.

    Parameters
    ----------
    problem : DiscreteProblem

    Returns
    -------
    TraceConstants

    Raises
    ------
    ProblemError
        The problem was made of arrays and has no mesh.
    """
    return TraceConstants(*_trace_eigenvalues(problem, parts=True))


def _trace_eigenvalues(problem: DiscreteProblem, parts: bool, workspace: Workspace | None = None) -> list[float]:
    """c_gamma, and if asked for that of both parts."""
    if workspace is None:
        return _find_trace_eigenvalues(problem, parts)
    name = "trace constants" if parts else "trace constant"
    return workspace.once(name, problem.model, lambda: _find_trace_eigenvalues(problem, parts))


def _find_trace_eigenvalues(problem: DiscreteProblem, parts: bool) -> list[float]:
    field = problem.field
    if field is None:
        raise ProblemError("a problem made of arrays has no mesh, so the norm of V is not known")
    check_time()
    origin = problem.origin
    if origin is not None and origin.kind:
        plain = replace(origin, material=Material.gradient(1.0, origin.kind), bedding=0.0)
        energy = energy_norm(discretize(plain, check_coercivity=False))
    elif origin is not None and not factorises(problem):
        held = {name: one for name, one in origin.supports.items() if not isinstance(one, Spring)}
        body = replace(origin, material=_RING_NORM if field.ring else _NORM, bedding=0.0, supports=held)
        energy = energy_norm(discretize(body, check_coercivity=False, evolving=True))
    else:
        strain = stiffness_matrix(field.mesh, _RING_NORM if field.ring else _NORM, field.order)
        energy = EnergyNorm(sp.csr_array(field.basis.T @ strain @ field.basis))
    both = np.repeat(problem.contact.weights[:, None], problem.contact.components, axis=1)
    normal = both * (np.arange(problem.contact.components) == 0)
    chosen = [both, normal, both - normal] if parts else [both]
    if not energy.definite:
        return [np.inf] * len(chosen)
    return [float(np.sqrt(energy.largest_eigenvalue(problem.contact.trace, w.ravel()).bound)) for w in chosen]
