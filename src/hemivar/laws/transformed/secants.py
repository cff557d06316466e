"""Unloading along the secant: glue that has been opened once is softer from then on, and does not heal."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed.exact_table import count_knots, merged, table_of
from hemivar.laws.transformed.law_graph import Term, beside, law_graph
from hemivar.laws.transformed.transformed_law import by_parts, check_law, numbers, row

__all__ = ["secant", "secant_stiffness"]


def secant(law: Superpotential, opening: Array | float) -> Superpotential:
    """The law after the opening w = -r has once been as large as ``opening``, D.

    Up to D the tension is ``g(D)/D w``, g(w) = -j'(-w) the tension of the law; beyond D, and in penetration, it is
    that of the law.  Where g jumps at D, it is taken from the side of the smaller openings: a point that has come as
    far as its strength, and not farther, holds.  Alpha is at most that of the law: the secant does not fall.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters; zero must be in its domain.
    opening : number or array (m,)
        D >= 0; more than the law allows counts as the end of its domain.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        A negative opening, or a law that pushes at D.
    """
    check_law(law)
    known = numbers(opening, f"the largest opening of law '{law.name}'", least=0.0)
    stacked = by_parts(law, lambda part, index: secant(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all():
        return law
    opening = np.minimum(known, -law.domain.lower)
    stiffness = secant_stiffness(law, opening)
    base = table_of(law) or law
    knots, wide, steep = _places(base.knots, opening), opening[:, None], stiffness[:, None]
    at = np.where(np.isfinite(knots), knots, 0.0)
    before, after = (count_knots(base.knots, at, including=side) for side in (False, True))
    below, above = beside(base, at, before, after)
    # Where the secant ends, and at zero, there is no kink by rounding.
    above = np.where((knots == -wide) & (after == before), below, above)
    below = np.where((knots > -wide) & (knots <= 0.0), steep * at, below)
    above = np.where((knots == 0.0) & _rounding(base, above - below, wide, steep * wide), below, above)
    start = np.concatenate([np.full((len(knots), 1), -np.inf), knots], axis=-1)
    own = np.concatenate([np.zeros((len(knots), 1), dtype=np.int64), after], axis=-1)
    own = np.where(np.isposinf(start), base.knots.shape[-1], own)
    beyond, held = start < -wide, (start >= -wide) & (start < 0.0)
    level = np.where(beyond, 0.5 * steep * wide**2, 0.0)
    part = Term(base, np.where(held, -1, own), np.where(beyond, -wide, 0.0), level)
    return law_graph(knots, [part], (below, above), law.domain, law.name, np.where(held, steep, 0.0))


def secant_stiffness(law: Superpotential, opening: Array) -> Array:
    """g(D)/D at every contact point, 0 where D = 0; see :func:`secant`."""
    bound = law.domain
    if (bound.lower > 0.0).any() or (bound.upper < 0.0).any():
        raise ProblemError(f"law '{law.name}' does not allow r = 0, where secant unloading ends; leave the memory out")
    rows = max(opening.size, law.knots.shape[0])
    wide = np.broadcast_to(opening, (rows,))
    after = count_knots(law.knots, -wide[:, None], including=True)[:, 0]
    pull = -law.piece_derivative(after, -wide)
    pushing = (wide > 0.0) & (pull < 0.0)
    if pushing.any():
        i = int(np.argmax(pushing))
        raise ProblemError(
            f"law '{law.name}' pushes with {-pull[i]:g} at the opening {wide[i]:g}; secant unloading needs a law that "
            f"pulls or is free in opening, such as Adhesive"
        )
    return np.where(wide > 0.0, pull / np.where(wide > 0.0, wide, 1.0), 0.0)


def _places(knots: Array, opening: Array) -> Array:
    """The knots of the law that the secant leaves, and its ends (m, n)."""
    rows = max(knots.shape[0], opening.size)
    knots = np.broadcast_to(knots, (rows, knots.shape[-1]))
    wide = np.broadcast_to(opening, (rows,))[:, None]
    outside = np.where((knots > -wide) & (knots < 0.0), np.inf, knots)
    return merged(np.concatenate([outside, -wide, np.zeros((rows, 1))], axis=-1))


def _rounding(law: Superpotential, jump: Array, wide: Array, force: Array) -> BoolArray:
    """Whether jumps (m, n) of j' at zero are what rounding makes of the forces of the law up to the opening ``wide``.

    ``force (m, 1)`` is another one that is rounded.
    """
    opened = (law.knots <= 0.0) & (law.knots >= -wide)
    sides = [np.where(np.isfinite(side), np.abs(side), 0.0) for side in law.knot_slopes()]
    if isinstance(law, PiecewiseQuadratic):  # its derivative is summed up from slopes times widths
        sides += [np.abs(slope * law.breakpoints) for slope in (law.slopes[:, :-1], law.slopes[:, 1:])]
    size = np.max(np.where(opened, np.maximum.reduce(sides), 0.0), axis=-1, keepdims=True)
    return np.asarray(np.abs(jump) <= 8.0 * np.finfo(float).eps * np.maximum(size, force))
