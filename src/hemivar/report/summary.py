"""What the command prints about a solution, as a value."""

from __future__ import annotations

import contextlib
import html
import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.disk import shown
from hemivar.basics.rows import Claim
from hemivar.basics.types import Array
from hemivar.basics.units import UNITS_REMEDY, Units
from hemivar.certificates import Certificate
from hemivar.discrete import Field
from hemivar.errors import ProblemError
from hemivar.fem.stress_stiffness import stiffens
from hemivar.solvers import NormalState, Solution, Status, TangentialState
from hemivar.solvers.contact_states import state_words

__all__ = ["Summary", "contact_rows", "extreme_rows", "seen_local", "summary_of"]

#: Claims of one label that are shown, so that they stay on one screen.
_SHOWN = 12
#: Supports whose forces are shown.
_SUPPORTS = 6
#: Part of all forces on a body up to which a force is rounding, and shown as zero.
_ROUNDING = 1e-10
#: Part of the largest displacement up to which a penetration or slip is rounding of it.
_STILL = 1e-13

Row = tuple[str, str]


@dataclass(frozen=True, repr=False)
class Summary:
    """Names and values, one below the other; text at a prompt, a table in a notebook.

    A row without a name continues the one above.
    """

    rows: tuple[Row, ...]

    @classmethod
    def of(cls, claims: Iterable[Claim]) -> Summary:
        """Labels and sentences, of one label as many as a screen shows."""
        rows: list[Row] = []
        for label, labelled in itertools.groupby((claim for claim in claims if not claim.whole), lambda one: one.label):
            sentences = [shown(claim.sentence) for claim in labelled]
            rows += [(label, sentence) for sentence in sentences[:_SHOWN]]
            if len(sentences) > _SHOWN:
                rows.append(("", f"(of {len(sentences)} {label}s; --json FILE holds all)"))
        return cls(tuple(rows))

    def __str__(self) -> str:
        return "\n".join(self.lines())

    __repr__ = __str__

    def lines(self) -> Iterator[str]:
        """The lines as the command prints them."""
        return (f"{name:<18}{value}" for name, value in self.rows)

    def _repr_html_(self) -> str:
        rows = (f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in self.rows)
        return f"<table><tbody>{''.join(rows)}</tbody></table>"


def summary_of(solution: Solution, certificate: Certificate | None = None, units: Units | None = None) -> Summary:
    """Status, energy, warnings, what a certificate says, and forces and states on the contact boundary."""
    if certificate is not None:
        expect(certificate, Certificate, "certificate", "give what solution.certify() returned")
    if units is not None:
        expect(units, Units, "units", UNITS_REMEDY)
    if units is None:
        units = Units() if solution.problem.origin is None else solution.problem.origin.units
    rows = list(_solve_rows(solution, certificate is not None, units))
    if certificate is not None:
        rows += Summary.of(certificate.claims()).rows
    if solution.problem.vectors.total(solution.problem.contact_points)[0]:
        rows += _contact_part(solution, units)
    rows += _body_part(solution, units)
    return Summary(tuple(rows))


def _solve_rows(solution: Solution, certified: bool, units: Units) -> Iterator[Row]:
    others = f" and {solution.fallbacks} fallbacks" if solution.fallbacks else ""
    ended = f"{solution.status.value} after {solution.steps} steps{others}"
    yield "status", f"{ended}, relative residual {solution.residual.relative:.1e}"
    for remark in solution.remarks:
        yield "warning", remark
    if solution.timings:
        yield "time", ", ".join(f"{stage} {seconds:.3g} s" for stage, seconds in solution.timings.items())
    law = solution.problem.law
    bound, whole = solution.problem.vectors.largest(float(law.state_dependent), float(law.depends_on_whole_state))
    kept = "mode of the glue" if whole else "friction bound" if bound else ""
    fixed = f", with the {kept} held fixed" if kept else ""
    fixed += ", with the stress of the load held fixed" if stiffens(solution.problem) else ""
    yield "energy", _with(f"{solution.energy:.10g}", units.energy) + fixed
    if solution.deformation is not None:
        yield "largest", solution.deformation.sizes
        if not certified and solution.deformation.warning is not None:  # else it is among the lines of the certificate
            yield "warning", solution.deformation.warning
    if solution.error_bound is not None:
        yield "error bound", f"{solution.error_bound:.3g} (energy norm)"
    if solution.status is not Status.CONVERGED:
        yield "what to do", solution.remedy


def _contact_part(solution: Solution, units: Units) -> Iterator[Row]:
    contact, vectors, size = solution.contact, solution.problem.vectors, _force_size(solution)
    along = np.diff(contact.trace.indptr)[:: contact.components].any()
    presses = bool(vectors.largest(float(along))[0])  # in antiplane shear nothing does
    if presses:
        yield "normal force", _with(f"{_beyond_rounding(solution.normal_force, size):.6g}", units.force)
    friction = solution.friction_force
    if friction.size == 1:
        yield "friction force", _with(f"{_beyond_rounding(float(friction[0]), size):.6g}", units.force)
    elif friction.size:
        vector = vectors.total(*(contact.weights @ solution.friction_vectors).tolist())
        yield "friction force", _vector(vector, units.force, size)
    if contact.pairs:
        between = {side for sides in contact.pairs.values() for side in sides}
        for number, side in enumerate(name for name in solution.contact_forces if name in between):
            force = _vector(solution.contact_forces[side], units.force, size)
            yield "" if number else "contact forces", f"{shown(side)} {force}"
    whole = float(vectors.total(contact.weights.sum())[0])
    yield from contact_rows(solution.measured, solution.contact_length, whole, _counts(solution), units)
    if solution.debonding:
        damage, lost = solution.debonding["damage"], solution.debonding["dissipated"]
        glued = np.isfinite(damage)  # on other boundaries there is nothing to break
        opening, worst = vectors.largest(_most(-solution.penetration[glued]), _most(damage[glued])).tolist()
        energy = float(vectors.total(float(contact.weights[glued] @ lost[glued]))[0])
        yield "max opening", _with(f"{max(opening, 0.0):.6g}", units.length)
        yield "damage", f"at most {worst:.3g}"
        yield "dissipated", _with(f"{energy:.6g}", units.energy)
    if presses:
        glued = np.isfinite(solution.debonding.get("damage", np.full(len(solution.pressure), np.nan)))
        deepest, pressure, peel = vectors.largest(
            _most(seen_local(solution)[:, 0]), _most(solution.pressure), _most(-solution.pressure[glued])
        ).tolist()
        yield from extreme_rows(deepest, pressure, units, peel)


def _counts(solution: Solution) -> tuple[dict[NormalState, int], dict[TangentialState, int]]:
    """How many points of all processes are in each normal and in each tangential state."""
    normal, tangential = solution.states.counts
    counts = [int(count) for count in solution.problem.vectors.total(*normal.values(), *tangential.values())]
    return dict(zip(normal, counts, strict=False)), dict(zip(tangential, counts[len(normal) :], strict=True))


def _most(values: Array) -> float:
    return float(values.max(initial=-np.inf))


def _body_part(solution: Solution, units: Units) -> Iterator[Row]:
    """Forces of the supports and the largest stress, of a body whose material and supports are known."""
    if solution.problem.origin is None or solution.problem.origin.kind:
        return
    size = _force_size(solution)
    with contextlib.suppress(ProblemError):  # under another load than the stated one reactions are not known
        for number, (name, force) in enumerate(solution.reactions.items()):
            if number == _SUPPORTS:
                yield "", f"(and {len(solution.reactions) - number} more; --json holds all)"
                break
            yield "" if number else "support forces", f"{shown(name)} {_vector(force, units.force, size)}"
        for name, plate in solution.plates.items():
            yield "plate", f"{shown(name)} moves by {_motions(plate, solution.displacement, solution.problem.field)}"
    largest = float(solution.problem.vectors.largest(_most(solution.von_mises()))[0])
    yield "max von Mises", _with(f"{largest:.6g}", units.stress)


def _motions(plate: Mapping[str, float], displacement: Array, field: Field | None) -> str:
    """The motions of a rigid plate, those of rounding as zeros."""
    assert field is not None
    largest, extent = float(np.abs(displacement).max()), float(np.ptp(field.mesh.points, axis=0).max())
    moves = {name: value for name, value in plate.items() if name in "xyz" or name.startswith("turn")}
    sizes = {name: largest / extent if name.startswith("turn") else largest for name in moves}
    return ", ".join(f"{name} {_beyond_rounding(value, sizes[name]):.6g}" for name, value in moves.items())


def _force_size(solution: Solution) -> float:
    """The sum of the sizes of all loads and contact forces: what a force of rounding is measured by."""
    problem, weights = solution.problem, solution.problem.contact.weights
    own = float(np.abs(problem.load).sum() + weights @ np.abs(solution.multiplier).sum(axis=1))
    return float(problem.vectors.total(own)[0])


def seen_local(solution: Solution) -> Array:
    """Penetration and slip (m, c), zero where they are rounding of the displacements of two bodies that touch."""
    size = float(np.abs(solution.unknowns).max(initial=0.0)) if solution.contact.pairs else 0.0
    local = np.column_stack([solution.penetration, solution.slip])
    return np.where(np.abs(local) <= _STILL * size, 0.0, local)


def _beyond_rounding(force: float, size: float) -> float:
    return 0.0 if abs(force) <= _ROUNDING * size else force


def _vector(components: Array, unit: str, size: float) -> str:
    """A vector of forces; what is rounding beside all forces on the body is zero."""
    zero = max(size, float(np.abs(components).max(initial=0.0)))
    return _with(f"({', '.join(f'{_beyond_rounding(c, zero):.6g}' for c in components.tolist())})", unit)


def contact_rows(
    what: str,
    closed: float,
    whole: float,
    counts: tuple[Mapping[NormalState, int], Mapping[TangentialState, int]],
    units: Units,
) -> Iterator[Row]:
    """How much of the contact boundary is closed, and how many points are in each state."""
    power = {"length": "", "area": "^2", "volume": "^3"}[what]
    yield f"contact {what}", _with(f"{closed:.6g} of {whole:.6g}", units.length and units.length + power)
    yield "contact points", state_words(*counts)


def extreme_rows(deepest: float, pressure: float, units: Units, peel: float = -np.inf) -> Iterator[Row]:
    """The largest penetration, or the least opening where nothing penetrates, the largest pressure and the largest pull
    of glue."""
    if deepest < 0.0:
        yield "least opening", f"{_with(f'{-deepest:.6g}', units.length)} (no point penetrates)"
    else:
        yield "max penetration", _with(f"{deepest:.6g}", units.length)
    if pressure >= 0.0 or not peel > 0.0:
        yield "max pressure", _with(f"{pressure:.6g}", units.stress)
    if peel > 0.0:
        yield "max peel", _with(f"{peel:.6g}", units.stress)


def _with(number: str, unit: str) -> str:
    return f"{number} {unit}" if unit else number
