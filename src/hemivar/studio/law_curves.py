"""Contact laws as curves, as far as the contact points of a solution reach."""

from __future__ import annotations

import itertools
import math

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws import ContactLaw, Superpotential

__all__ = ["LawCurve", "curves_of"]

#: Places on each piece of a law.
_PLACES = 60

#: What a page draws of one law, as JSON.
LawCurve = dict[str, object]


def curves_of(problem: DiscreteProblem, local: Array, multiplier: Array) -> list[LawCurve]:
    """The laws of the contact boundaries: traction against penetration, friction against slip.

    Each has ``boundary``, ``side`` ("normal" or "friction"), ``name``, ``lines`` (constants in words), ``pieces``
    (lists of r and traction), ``jumps`` (place, from, to), ``reach`` (largest |r| shown) and ``note``.  A law whose
    parameters vary is that of the point with the largest pressure, where a friction bound that depends on the state is
    taken as well.

    Parameters
    ----------
    problem : DiscreteProblem
    local, multiplier : arrays (m, c)
        Of an equilibrium.
    """
    contact, law = problem.contact, problem.law
    found: list[LawCurve] = []
    for name in contact.names:
        index = contact.on(name)
        if not index.size:
            continue
        if not isinstance(law, ContactLaw):
            found.append(_without_curve(name, law.name))
            continue
        r, traction = local[index], multiplier[index]
        chosen = int(np.argmax(np.abs(traction[:, 0])))
        one = law.frozen(local, multiplier).take(index[[chosen]])
        where = "" if contact.points is None else f"at x = {_place(contact.points[index[chosen]])}"
        parts = one.scalar_laws(contact.components)
        for side, part, column in zip(("normal", "friction"), parts, range(contact.components), strict=False):
            if side == "friction" and not one.rubs.any():
                continue
            named = law.normal.name if side == "normal" else law.friction.name
            curve = _curve(part, float(np.abs(r[:, column:]).max()))
            found.append(
                {"boundary": name, "side": side, "note": where if _varies(law, side) else "", **curve, "name": named}
            )
    return found


def _varies(law: ContactLaw, side: str) -> bool:
    """Whether the law is another one at other points, as far as its knots tell, or by the state."""
    if side == "friction" and law.state_dependent:
        return True
    knots = (
        law.normal.knots if side == "normal" else law.tangential.knots if not law.state_dependent else np.zeros((1, 0))
    )
    return bool(len(knots) > 1 and np.ptp(np.where(np.isfinite(knots), knots, 0.0), axis=0).max(initial=0.0) > 0.0)


def _without_curve(boundary: str, name: str) -> LawCurve:
    note = f"the law {name} couples opening and slip and has no curve of its own"
    return {
        "boundary": boundary, "side": "normal", "name": name, "lines": [], "pieces": [], "jumps": [], "note": note,
        "reach": 1.0,
    }  # fmt: skip


def _curve(law: Superpotential, largest: float) -> LawCurve:
    told = law.describe()
    knots = [knot for knot in told.knots if math.isfinite(knot)]
    reach = max([1.6 * abs(knot) for knot in knots] + [1.2 * largest]) or 1.0
    low, high = max(-reach, told.domain[0]), min(reach, told.domain[1])
    ends = [low, *[knot for knot in knots if low < knot < high], high]
    pieces = []
    for start, end in itertools.pairwise(ends):
        if end > start:
            hair = 1e-9 * (end - start)
            places = np.linspace(start + hair, end - hair, _PLACES)
            pieces.append([places.tolist(), law.derivative(places).tolist()])
    jumps = [[kink.place, kink.left, kink.right] for kink in told.kinks if low <= kink.place <= high]
    return {
        "name": told.name, "lines": list(told.lines), "pieces": pieces, "jumps": jumps, "reach": reach,
    }  # fmt: skip


def _place(point: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
