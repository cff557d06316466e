"""A certificate in words: every claim as far as it was shown, estimates called estimates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hemivar.basics.rounding import rounded_down, rounded_up
from hemivar.certificates.linear_bodies import STATED, UNKNOWN
from hemivar.mechanics.material_words import BoundsBy

if TYPE_CHECKING:
    from hemivar.certificates.certificate import Certificate
    from hemivar.certificates.smallness import Smallness

__all__ = ["certificate_brief", "certificate_lines", "lower_bound_words"]


def certificate_lines(certificate: Certificate, whole: bool = False) -> list[str]:
    """The certificate in lines of text: kind, bound and margin; if ``whole``, every constant."""
    constants = certificate.smallness
    lines: list[str] = []

    def say(label: str, text: str) -> None:
        lines.append(f"{label:<18}{text}")

    if whole:
        balance, off_law = certificate.equilibrium_relative, certificate.inclusion_relative
        say("equilibrium", f"{_text(certificate.equilibrium)} in the K^-1 norm, {_text(balance)} of the load's")
        say("inclusion", f"{_text(certificate.inclusion)} (force), {_text(off_law)} of the load's")
        say("residual", f"{certificate.residual.relative:.1e} relative, tolerance {certificate.tolerance:.0e}")
        fixed = ", with the friction bound held fixed" if constants.m_L > 0.0 else ""
        say("energy", f"{certificate.energy:.10g}{fixed}")
    known = certificate.uniqueness
    if certificate.unique is None and certificate.margin > 0.0 and constants.sampled:
        known += " (the margin is positive, but sampled)"
    say("kind", f"{certificate.kind.value}; {known}")
    if certificate.curvature is not None:
        say("least curvature", f"{_text(certificate.curvature)} (the body alone: 1)")
    if whole or not math.isfinite(certificate.error_bound):
        parts = [f"c = {_text(constants.constant)}"]
        if constants.constant_normal and constants.constant_tangential:
            parts.append(f"normal {_text(constants.constant_normal)}")
            parts.append(f"tangential {_text(constants.constant_tangential)}")
        if constants.coupling > 0.0:
            parts.append(f"coupling {_text(constants.coupling)}")
        say("margin", f"{_text(certificate.margin)} ({', '.join(parts)})")
        if certificate.margin == -math.inf and not certificate.left_out:
            say("", _without_margin(constants))
    if math.isfinite(certificate.error_bound):
        size = f"{certificate.error_bound:.2e}, relative {certificate.error_bound_relative:.1e},"
        if certificate.error_bound_sampled:
            bounded = constants.within and not constants.sampled
            why = f"for {constants.within} only" if bounded else "from sampled constants"
            say("distance", f"about {size} to an exact discrete solution: an estimate, {why}")
        else:
            say("distance", f"at most {size} to the exact discrete solution")
    elif "margin" in certificate.left_out or "error bound" in certificate.left_out:
        say("distance", "no bound, for lack of time")
    else:
        say("distance", "no bound, for the margin is not positive")
    if certificate.exact is not None:
        lines += certificate.exact.lines()
    if certificate.left_out:
        say("left out", f"{', '.join(certificate.left_out)}: the time limit was reached")
    for warning in certificate.warnings:
        say("warning", warning)
    if constants.stiffness_by:
        say("body", lower_bound_words(constants.stiffness_by))
    say("certified", f"in {certificate.seconds:.2g} s by {certificate.method}")
    if whole:
        say("alpha", f"normal {_text(constants.alpha_normal)}, tangential {_text(constants.alpha_tangential)}")
        if constants.m_L > 0.0:
            say("m_L", f"{_text(constants.m_L)}, contraction of the outer fixed point {_text(constants.contraction)}")
        if constants.m_A is not None:
            say("m_A", _text(constants.m_A) + (", at the points of a rule" if constants.m_A_sampled else ""))
        if constants.trace_constant is not None:
            above = (
                ""
                if constants.trace_bound is None
                else f" on this mesh, of the body at most {constants.trace_bound:.6g}"
            )
            say("trace constant", f"{constants.trace_constant:.6g}{above}")
        if constants.survey_margin is not None:
            if constants.survey_condition is None:
                holds = "holds on this mesh, of the body it is not known"
            else:
                holds = "holds" if constants.survey_condition else "does not hold"
                if constants.trace_bound is None and constants.m_alpha + constants.m_L > 0.0:
                    holds += " on this mesh"
            if constants.m_A_sampled and constants.m_alpha + constants.m_L > 0.0:
                holds += ", as far as samples of the material tell"
            say("survey's (H_s)", f"{holds}, margin {_text(constants.survey_margin)}")
        if constants.within:
            say("note", f"constants are those of {constants.within}: what rests on them holds there")
        if constants.alpha_sampled:
            say("note", "a law knows its alpha from samples only: margin and distance are estimates")
        if constants.m_L_sampled:
            say("note", "a friction bound knows its slope from samples only: margin and distance are estimates")
    return lines


def certificate_brief(certificate: Certificate) -> str:
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
        size = f"{rounded_up(certificate.error_bound_relative, 2)} (relative) from the exact discrete solution"
        parts.append(f"about {size}" if certificate.error_bound_sampled else f"at most {size}")
    else:
        parts.append("no bound of the distance")
    return "; ".join(parts)


def _without_margin(constants: Smallness) -> str:
    """Why there is no margin at all, in words."""
    if max(constants.alpha_normal, constants.alpha_tangential) == math.inf:
        return "the derivative of a law jumps down, or falls without bound: no stiffness of the body makes up for that"
    if constants.stiffness_by == UNKNOWN:
        return "no lower bound of the stiffness of the body is known at all strains"
    if constants.reach_strain < math.inf:
        return "strains may lie outside of the reach of the material"
    if math.isinf(constants.m_L):
        return "the laws have no finite constant here"
    return "the supports alone do not hold the body: what rests on the foundation alone has no margin"


def lower_bound_words(found_by: str) -> str:
    """What the norms of a body that is not linear are, in words."""
    if found_by == UNKNOWN:
        return "not linear: norms are those of its stiffness at rest, and bound nothing"
    how = {
        BoundsBy.SAMPLED.value: "known from samples only: margin and distance are estimates",
        STATED: "as its maker states it",
    }.get(found_by, f"proved ({found_by})")
    return f"not linear: norms are those of the lower bound of its stiffness, {how}"


def _text(value: float | None) -> str:
    return "not known" if value is None else f"{value:.4g}"
