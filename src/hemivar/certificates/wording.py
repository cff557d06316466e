"""A certificate and its words: every claim as far as it was shown, estimates called estimates."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import expect, quoted
from hemivar.basics.display import ReprMixin
from hemivar.basics.rounding import rounded_down, rounded_up
from hemivar.basics.rows import Claim
from hemivar.basics.types import Array, Record
from hemivar.certificates.linear_bodies import STATED, STRESSED, UNKNOWN
from hemivar.certificates.smallness import Smallness
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.residual import Residual
from hemivar.errors import ProblemError
from hemivar.mechanics.material_words import BoundsBy

if TYPE_CHECKING:
    from hemivar.bounds.stated_distance import DistanceToExact

__all__ = ["ESTIMATE", "Certificate", "lower_bound_words"]

#: The method of an eigenvalue that nothing shows.
ESTIMATE = "LOBPCG, an estimate"
#: Characters of a line before its sentence.
_LABEL = 18


@dataclass(frozen=True, eq=False)
class Certificate(ReprMixin):
    """What is known about a pair ``(u, lambda)``.

    K is the stiffness of the body. Of one that is not linear ``K u`` is the derivative of its stored energy, and
    elsewhere K is the stiffness of its lower tensor C_low: ``smallness.stiffness_by`` tells how that was found.

    Attributes
    ----------
    equilibrium : float
        ``|f - K u - B'W lambda|_{K^-1}``, in the unit of ``|u|_K``; inf if K is singular.
    equilibrium_relative : float
        The same over ``|f|_{K^-1}``.
    inclusion : float
        ``|W e|_2`` with ``e_j`` the distance of ``(r_j, lambda_j)`` to the graph of the law, units of force.
    inclusion_relative : float
        The same over ``|f|_2``.
    inclusion_distance : float
        Largest distance of ``lambda_j`` to ``dj(r_j)`` at the very r_j (force per area); a rounding away from a kink
        it is as large as the jump, which is why :attr:`inclusion` is the measure.
    residual : Residual
        The residual that the solvers use.
    energy : float
        E(u), units of work.  Where the friction bound depends on the state there is no energy, and this is that with
        the bound held fixed at this pair.
    margin : float
        ``1 - c - coupling`` of :class:`Smallness`; positive if the discrete problem has one solution.
    error_bound : float
        Bound of ``|u - u*|_K`` to the exact discrete solution; inf without a positive margin.  Guaranteed unless
        :attr:`error_bound_sampled`.
    error_bound_relative : float
        The same over ``|u|_K``.
    kind : PointKind
        What kind of point it is.
    unique : bool, str or None
        Whether the discrete problem has one solution only; None if that is not known.  Where constants of a law are
        those of its reach, a text that says so: "the only one with penetrations within the reach 0.2".
    curvature : float or None
        Smallest curvature on the critical directions, 1 being that of the body alone; None if not computed.
    direction : array (m, d) or None
        Local displacement along which the energy falls, where it does.
    stationary : bool
        Whether the pair solves the problem to the tolerance.
    tolerance : float
        The tolerance, relative to the load.
    smallness : Smallness
        The constants behind the margin.
    method : str
        "factorisation", or "multigrid" for a large problem: then the constants are less accurate, on the safe side.
    seconds : float
        Spent on it.
    warnings : tuple of str
        What it does not cover on this problem, such as locking; one sentence each.
    error_bound_sampled : bool
        Whether margin and error bound rest on sampled constants, and so are estimates.
    left_out : tuple of str
        Parts for which the time did not suffice: "margin", "equilibrium", "error bound", "kind", "trace constant". What
        stands in their place says the least that can be said: inf, -inf, None or "stationary".
    free_motion : str
        Where the law is convex: the rigid motion, such as "translation (1, 0)", up to which it is the only
        solution, and along which there may be others; empty without one.
    exact : DistanceToExact or None
        The distance to the exact solution of the continuous problem, or why it is not known; None if it was not asked
        for.
    apart : bool
        Whether many processes made it: they leave out what takes the whole matrix, and what they have no proof of.
    """

    equilibrium: float
    equilibrium_relative: float
    inclusion: float
    inclusion_relative: float
    inclusion_distance: float
    residual: Residual
    energy: float
    margin: float
    error_bound: float
    error_bound_relative: float
    kind: PointKind
    unique: bool | str | None
    curvature: float | None
    direction: Array | None
    stationary: bool
    tolerance: float
    smallness: Smallness
    method: str = "factorisation"
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
    error_bound_sampled: bool = False
    left_out: tuple[str, ...] = ()
    free_motion: str = ""
    exact: DistanceToExact | None = None
    apart: bool = False

    @property
    def proved(self) -> bool:
        """Whether an eigenvalue behind the margin was shown, and not only found."""
        return self.method != ESTIMATE

    @property
    def uniqueness(self) -> str:
        """:attr:`unique` in words."""
        if isinstance(self.unique, str):
            return self.unique
        if self.free_motion:
            return f"the only one up to a rigid motion, {self.free_motion}"
        return {True: "the only solution", False: "there are other solutions", None: "uniqueness not known"}[
            self.unique
        ]

    def claims(self) -> list[Claim]:
        """All that is claimed: value, sentence, and what is in doubt; every output reads them."""
        return _claims(self)

    def claim(self, label: str) -> Claim:
        """The first claim of a label, such as "kind", "margin" or "distance"."""
        claims = self.claims()
        labelled = [one for one in claims if isinstance(label, str) and one.label == label]
        if not labelled:
            raise ProblemError(
                f"nothing is claimed of {quoted(label)}; choose one of {', '.join(one.label for one in claims)}"
            )
        return labelled[0]

    def lines(self, whole: bool = False) -> list[str]:
        """The certificate as lines of text: kind, bound and what is missing; if ``whole``, every constant."""
        expect(whole, bool, "whole", "give True or False")
        return _lines(self, whole)

    def brief(self) -> str:
        """The certificate in one line: residual, kind, uniqueness, margin, distance; pictures have it at their foot."""
        return _brief(self)

    def __repr__(self) -> str:
        residual = f"residual          {self.residual.relative:.1e} relative, tolerance {self.tolerance:.0e}"
        return "\n  ".join(["Certificate", residual, *self.lines()])

    def record(self) -> Record:
        """Plain numbers and strings for JSON.

        Keys: the attributes (without ``residual``; ``direction`` as lists, ``exact`` as a record) and, beside them,
        those of :class:`Smallness`.  Numbers that are infinite become null and their keys are listed under ``infinite``
        (under ``minus_infinite`` if negative); other nulls mean "not known".
        """
        values: dict[str, object] = {}
        for owner in (self, self.smallness):
            for item in fields(owner):
                if item.name not in ("residual", "smallness", "apart"):
                    values.setdefault(item.name, getattr(owner, item.name))
        plain: dict[str, object] = {}
        infinite: list[str] = []
        negative: list[str] = []
        for name, value in values.items():
            if isinstance(value, StrEnum):
                value = value.value
            elif isinstance(value, tuple):
                value = list(value)
            elif isinstance(value, np.ndarray):
                value = value.tolist()
            elif name == "exact" and self.exact is not None:
                value = self.exact.record()
            elif isinstance(value, float) and not math.isfinite(value):
                if math.isinf(value):
                    (infinite if value > 0 else negative).append(name)
                value = None
            plain[name] = value
        return {**plain, "infinite": infinite, "minus_infinite": negative}


def _claims(certificate: Certificate) -> list[Claim]:
    """All that a certificate claims, in the order of its lines."""
    c, constants = certificate, certificate.smallness
    claims: list[Claim] = []

    def say(label: str, sentence: str, value: object = None, whole: bool = False, doubt: str = "") -> None:
        claims.append(Claim(label, sentence, value, doubt, whole))

    off_load = f"{_text(c.equilibrium)} in the K^-1 norm, {_text(c.equilibrium_relative)} of the load's"
    say("equilibrium", off_load, c.equilibrium_relative, whole=True)
    off_law = f"{_text(c.inclusion)} (force), {_text(c.inclusion_relative)} of the load's"
    say("inclusion", off_law, c.inclusion_relative, whole=True)
    relative = c.residual.relative
    say("residual", f"{relative:.1e} relative, tolerance {c.tolerance:.0e}", relative, whole=True)
    frozen = "mode of the glue" if c.kind is PointKind.WITHOUT_ENERGY else "friction bound"
    fixed = f", with the {frozen} held fixed" if constants.m_L > 0.0 else ""
    say("energy", f"{c.energy:.10g}{fixed}", c.energy, whole=True)
    sampled = c.unique is None and c.margin > 0.0 and constants.sampled
    known = c.uniqueness + (" (the margin is positive, but sampled)" if sampled else "")
    say("kind", f"{c.kind.value}; {known}", c.kind.value)
    if c.curvature is not None:
        say("least curvature", f"{_text(c.curvature)} (the body alone: 1)", c.curvature)
    doubt = "" if not c.error_bound_sampled else "within the reach" if constants.within else "sampled"
    bounded = math.isfinite(c.error_bound)
    parts = [f"c = {_text(constants.constant)}"]
    if constants.constant_normal and constants.constant_tangential:
        parts.append(f"normal {_text(constants.constant_normal)}")
        parts.append(f"tangential {_text(constants.constant_tangential)}")
    if constants.coupling > 0.0:
        parts.append(f"coupling {_text(constants.coupling)}")
    guessed = "" if c.proved else ", an estimate"
    margin = f"{_text(c.margin)}{guessed} ({', '.join(parts)})"
    if c.margin == -math.inf and not c.left_out:
        known = "none, and the solution is the only one all the same" if c.unique else "uniqueness is not known"
        margin = f"{known}: {_without_margin(constants)}"
    say("margin", margin, c.margin, bounded, doubt)
    say("distance", _distance(c), c.error_bound_relative, doubt=doubt)
    claims += [] if c.exact is None else [Claim(line[:_LABEL].rstrip(), line[_LABEL:]) for line in c.exact.lines()]
    if c.left_out:
        why = "not shown by many processes, or in this time" if c.apart else "the time limit was reached"
        say("left out", f"{', '.join(c.left_out)}: {why}", c.left_out, c.left_out == ("trace constant",) and c.apart)
    for warning in c.warnings:
        say("warning", warning)
    if constants.stiffness_by:
        say("body", lower_bound_words(constants.stiffness_by))
    say("certified", f"in {c.seconds:.2g} s by {c.method}", c.seconds)
    return claims + [Claim(label, sentence, whole=True) for label, sentence in _constants(constants)]


def _distance(c: Certificate) -> str:
    """The distance to the exact discrete solution, or why there is no bound of it."""
    constants = c.smallness
    if not math.isfinite(c.error_bound):
        late = "margin" in c.left_out or "error bound" in c.left_out
        why = "the margin is not shown" if c.apart else "the time limit was reached"
        if not late:
            follows = constants.stiffness_by == STRESSED
            why = "the stress follows the answer" if follows else "the margin is not positive"
        return f"no bound, because {why}"
    size = f"{c.error_bound:.2e}, relative {c.error_bound_relative:.1e},"
    if not c.error_bound_sampled:
        return f"at most {size} to the exact discrete solution"
    bounded = constants.within and not constants.sampled
    why = f"for {constants.within} only" if bounded else "from sampled constants"
    return f"about {size} to an exact discrete solution: an estimate, {why}"


def _constants(constants: Smallness) -> Iterator[tuple[str, str]]:
    """Labels and sentences of all constants."""
    softens = constants.m_alpha + constants.m_L > 0.0
    yield "alpha", f"normal {_text(constants.alpha_normal)}, tangential {_text(constants.alpha_tangential)}"
    if constants.m_L > 0.0:
        yield "m_L", f"{_text(constants.m_L)}, contraction of the outer fixed point {_text(constants.contraction)}"
    if constants.m_A is not None:
        yield "m_A", _text(constants.m_A) + (", at the points of a rule" if constants.m_A_sampled else "")
    if constants.trace_constant is not None:
        above = constants.trace_bound
        more = "" if above is None else f" on this mesh; for the continuous body at most {above:.6g}"
        yield "trace constant", f"{constants.trace_constant:.6g}{more}"
    if constants.survey_margin is not None:
        holds = {
            None: "holds on this mesh; for the continuous body it is not known", True: "holds", False: "does not hold"
        }[constants.survey_condition]  # fmt: skip
        if constants.survey_condition is not None and constants.trace_bound is None and softens:
            holds += " on this mesh"
        if constants.m_A_sampled and softens:
            holds += ", as far as samples of the material show"
        yield "survey's (H_s)", f"{holds}, margin {_text(constants.survey_margin)}"
    if constants.within:
        yield "note", f"constants are those of {constants.within}: conclusions hold there"
    if constants.alpha_sampled:
        yield "note", "alpha of a law is known from samples only: margin and distance are estimates"
    if constants.m_L_sampled:
        yield "note", "the slope of a friction bound is known from samples only: margin and distance are estimates"


def _lines(certificate: Certificate, whole: bool = False) -> list[str]:
    """The certificate in lines of text: kind, bound and margin; if ``whole``, every constant."""
    return [f"{one.label:<{_LABEL}}{one.sentence}" for one in certificate.claims() if whole or not one.whole]


def _brief(certificate: Certificate) -> str:
    """The certificate in one line for the foot of a picture: residual, kind, uniqueness, margin, distance."""
    sampled = " (sampled)" if certificate.smallness.sampled else ""
    kind = certificate.kind.value
    parts = [f"residual {certificate.residual.relative:.1e}"]
    parts.append(kind if "unique" in kind else f"{kind}, {certificate.uniqueness}")
    if math.isfinite(certificate.margin):
        parts.append(f"margin {rounded_down(certificate.margin)}{sampled}")
    if certificate.exact is not None and certificate.exact.known:
        parts.append(certificate.exact.brief())
    elif math.isfinite(certificate.error_bound_relative):
        size = rounded_up(certificate.error_bound_relative, 2)
        parts.append(f"{certificate.claim('distance').size} {size} (relative) from the exact discrete solution")
    else:
        parts.append("no bound of the distance")
    return "; ".join(parts)


def _without_margin(constants: Smallness) -> str:
    """Why there is no margin at all, in words."""
    if max(constants.alpha_normal, constants.alpha_tangential) == math.inf:
        return "a law drops discontinuously or softens without bound"
    if constants.stiffness_by == UNKNOWN:
        return "the stiffness of the body has no known lower bound at all strains"
    if constants.reach_strain < math.inf:
        return "strains may lie outside of the reach of the material"
    if math.isinf(constants.m_L):
        return "the laws have no finite constant here"
    if constants.stiffness_by == STRESSED:
        return "with the stress of its load the stiffness of the body alone is not definite"
    if constants.m_alpha + constants.m_L == 0.0 and not constants.sampled:
        return (
            "the supports alone do not constrain the body; because its laws are convex, solutions differ by rigid "
            "motions only"
        )
    return "the supports alone do not constrain the body"


def lower_bound_words(found_by: str) -> str:
    """What the norms of a body that is not linear, or under stress, are, in words."""
    if found_by == UNKNOWN:
        return "not linear: norms are those of its stiffness at rest, and bound nothing"
    if found_by == STRESSED:
        return (
            "with the stress of its load held as it is here: kind and margin are those of this stiffness, and no "
            "energy stands behind the equilibrium"
        )
    how = {
        BoundsBy.SAMPLED.value: "known from samples only: margin and distance are estimates",
        STATED: "as stated by its author",
    }.get(found_by, f"proved ({found_by})")
    return f"not linear: norms are those of the lower bound of its stiffness, {how}"


def _text(value: float | None) -> str:
    return "not known" if value is None else f"{value:.4g}"
