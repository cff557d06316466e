"""Contact laws as curves, as far as the contact points of a solution reach."""

from __future__ import annotations

import itertools
import math

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws import ContactLaw, CoulombBound, Friction, Superpotential

__all__ = ["LawCurve", "curves_of"]

#: What a page draws of one law, as JSON.
LawCurve = dict[str, object]


def curves_of(
    problem: DiscreteProblem,
    local: Array,
    multiplier: Array,
    rate: Array | None = None,
    of_rate: BoolArray | None = None,
) -> list[LawCurve]:
    """The laws of the contact boundaries: traction against penetration, friction against slip or its rate.

    Each has ``boundary``, ``side`` ("normal" or "friction"), ``name``, ``lines`` (constants in words), ``pieces``
    (lists of r and traction), ``jumps`` (place, from, to), ``reach`` (largest |r| shown), ``note``, and ``points``: r
    and traction of the contact points, which lie on the curve.  ``by`` is "rate" where r is that of the slip.

    A law whose parameters vary is that of the point with the largest pressure, and has the points of the same law.
    Where the bound of friction varies, or depends on the state, tractions are divided by the bound of their point, and
    ``bounded`` is true.

    Shapes: ``local`` (m, c), ``multiplier`` (m, c), ``rate`` (m, c), ``of_rate`` (m,).
    """
    contact, law = problem.contact, problem.law
    curves: list[LawCurve] = []
    for name in contact.names:
        index = contact.on(name)
        if not index.size:
            continue
        if not isinstance(law, ContactLaw):
            curves.append(_without_curve(name, law.name))
            continue
        traction = multiplier[index]
        chosen = int(np.argmax(np.abs(traction[:, 0])))
        own = law.frozen(local, multiplier).take(index)
        where = "" if contact.points is None else f"at x = {_coordinates(contact.points[index[chosen]])}"
        head = {"boundary": name, "note": ""}
        same = _same(own.normal, chosen)
        curve = _curve(own.normal.take(np.array([chosen])), local[index, 0], traction[:, 0], same)
        curves.append({**head, "side": "normal", **curve, "name": law.normal.name, "note": "" if same.all() else where})
        if contact.components > 1 and own.rubs.any():
            rated = rate is not None and of_rate is not None and bool(of_rate[index].all())
            r = (rate if rated and rate is not None else local)[index, 1:]
            curves.append(
                {
                    **head,
                    "side": "friction",
                    **_friction(own, chosen, r, traction[:, 1:], where),
                    "name": _friction_name(law.friction),
                    "by": "rate" if rated else "slip",
                }
            )
    return curves


def _friction_name(friction: Friction) -> str:
    """Where the bound follows the pressure the law is Coulomb's, and Tresca's only the profile."""
    if not isinstance(friction.bound, CoulombBound):
        return friction.name
    return "coulomb" if friction.name == "tresca" else f"coulomb, {friction.name}"


def _friction(law: ContactLaw, chosen: int, r: Array, traction: Array, where: str) -> LawCurve:
    """Friction against slip, or its rate; by the bound of each point where this varies."""
    slip, force = (part[:, 0] if part.shape[1] == 1 else np.linalg.norm(part, axis=1) for part in (r, traction))
    bound = np.broadcast_to(law.friction.bounds, force.shape)
    bounded, same = bool(np.ptp(bound) > 0.0), _same(law.friction.profile, chosen)
    at = np.array([chosen])
    if bounded:
        force = np.divide(force, bound, out=np.zeros_like(force), where=bound > 0.0)
        curve = _curve(law.friction.profile.take(at), slip, force, same & (bound > 0.0))
        curve["lines"] = list(law.take(at).tangential.describe().lines)
    else:
        curve = _curve(law.take(at).tangential, slip, force, same)
    return {**curve, "note": where if bounded or not same.all() else "", "bounded": bounded}


def _same(law: Superpotential, chosen: int) -> BoolArray:
    """Where the law is that of a chosen point, as far as its knots tell; one entry if it is so everywhere."""
    knots = np.nan_to_num(law.knots)
    return np.asarray((knots == knots[min(chosen, len(knots) - 1)]).all(axis=1))


def _without_curve(boundary: str, name: str) -> LawCurve:
    note = f"the law {name} couples opening and slip and has no curve of its own"
    return {
        "boundary": boundary, "side": "normal", "name": name, "lines": [], "pieces": [], "jumps": [], "note": note,
        "reach": 1.0, "points": [[], []],
    }  # fmt: skip


def _curve(law: Superpotential, r: Array, traction: Array, same: BoolArray) -> LawCurve:
    largest = float(np.abs(r).max())
    shown = np.flatnonzero(np.broadcast_to(same, r.shape))
    shown = shown[:: max(1, -(-len(shown) // 200))]
    description = law.describe()
    knots = [knot for knot in description.knots if math.isfinite(knot)]
    reach = max([1.6 * abs(knot) for knot in knots] + [1.2 * largest]) or 1.0
    low, high = max(-reach, description.domain[0]), min(reach, description.domain[1])
    ends = [low, *[knot for knot in knots if low < knot < high], high]
    pieces = []
    for start, end in itertools.pairwise(ends):
        if end > start:
            hair = 1e-9 * (end - start)
            places = np.linspace(start + hair, end - hair, 60)
            pieces.append([places.tolist(), law.derivative(places).tolist()])
    jumps = [[kink.place, kink.left, kink.right] for kink in description.kinks if low <= kink.place <= high]
    return {
        "name": description.name, "lines": list(description.lines), "pieces": pieces, "jumps": jumps, "reach": reach,
        "points": [r[shown].tolist(), traction[shown].tolist()],
    }  # fmt: skip


def _coordinates(point: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
