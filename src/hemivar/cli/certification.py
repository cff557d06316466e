"""``hemivar certify``: what is known about a solution, whoever computed it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.disk import shown
from hemivar.cli.options import Exit, MaxTime, ProblemPath, controls_of
from hemivar.cli.session import Session
from hemivar.cli.show import SolveView, print_head
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.certify import Certificate

__all__ = ["certificate_lines", "certify"]


def certify(
    problem: ProblemPath,
    solution: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Solution to certify, .json or .vtu (solve first).")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the certificate.")] = None,
    rtol: Annotated[
        float, typer.Option(metavar="X", help="Residual, relative to the load, up to which it is a solution.")
    ] = 1e-8,
    max_time: MaxTime = None,
) -> int:
    """Certify a solution: residuals, uniqueness, a guaranteed error bound, what kind of point it is.

    Exit code 0 if the residual is below the tolerance, 1 if not.
    """
    session = Session(problem, {"--json": json}, rtol=rtol, max_time=max_time, solution=_checked(solution))
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
    options = CertifyOptions(rtol, controls, session.method)
    certificate = result_of(certified(discrete, unknowns, multiplier, options), view)
    if view.solution is not None:
        print(f"solution          solved here by {view.solution.method} ({view.solution.status.value})")
    else:
        print(f"solution          {shown(str(solution))}")
        print(f"multiplier        {'recomputed from equilibrium' if multiplier is None else 'read from the file'}")
    for line in certificate_lines(certificate, whole=True):
        print(line)
    record = {
        "problem": session.stated.name,
        "solution": None if solution is None else str(solution),
        "fulfilled": certificate.stationary,
        "certificate": certificate.record(),
    }
    session.writer.write_record(json, record)
    session.writer.tell()
    return session.writer.ended(Exit.CONVERGED if certificate.stationary else Exit.NOT_CONVERGED)


def _checked(path: Path | None) -> Path | None:
    """The solution file, unless it cannot be one."""
    if path is not None and path.suffix.lower() not in (".json", ".vtu"):
        raise ProblemError(f"--solution {path}: the name must end in .json or .vtu")
    if path is not None and not path.is_file():
        raise ProblemError(f"--solution {path}: there is no such file")
    return path


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
        say("energy", f"{certificate.energy:.10g}")
    unique = {True: "the only solution", False: "there are other solutions", None: "uniqueness not known"}
    known = unique[certificate.unique]
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
    if math.isfinite(certificate.error_bound):
        size = f"{certificate.error_bound:.2e}, relative {certificate.error_bound_relative:.1e},"
        if certificate.error_bound_sampled:
            say("distance", f"about {size} to an exact discrete solution: an estimate, from sampled constants")
        else:
            say("distance", f"at most {size} to the exact discrete solution")
    elif "margin" in certificate.left_out or "error bound" in certificate.left_out:
        say("distance", "no bound, for lack of time")
    else:
        say("distance", "no bound, for the margin is not positive")
    if certificate.left_out:
        say("left out", f"{', '.join(certificate.left_out)}: the time limit was reached")
    for warning in certificate.warnings:
        say("warning", warning)
    say("certified", f"in {certificate.seconds:.2g} s by {certificate.method}")
    if whole:
        say("alpha", f"normal {_text(constants.alpha_normal)}, tangential {_text(constants.alpha_tangential)}")
        if constants.m_L > 0.0:
            say("m_L", f"{_text(constants.m_L)}, contraction of the outer fixed point {_text(constants.contraction)}")
        if constants.m_A is not None:
            say("m_A", _text(constants.m_A))
        if constants.trace_constant is not None:
            say("trace constant", f"{constants.trace_constant:.6g}")
        if constants.survey_condition is not None and constants.survey_margin is not None:
            holds = "holds" if constants.survey_condition else "does not hold"
            say("survey's (H_s)", f"{holds}, margin {_text(constants.survey_margin)}")
        if constants.alpha_sampled:
            say("note", "a law knows its alpha from samples only: margin and distance are estimates")
        if constants.m_L_sampled:
            say("note", "a friction bound knows its slope from samples only: margin and distance are estimates")
    return lines


def _text(value: float | None) -> str:
    return "not known" if value is None else f"{value:.4g}"
