"""Algebra of scalar laws: affine arguments, sums, secants, sums of slips, and dampers that cannot pull.

Each is made of the pieces of what it is given: :mod:`hemivar.laws.transformed.law_graph` joins them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws.minimisers import MANY
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import PiecewiseLaw, Term, count_knots, moved, moved_ends, separated
from hemivar.laws.superpotential import Interval, Superpotential, row, taken
from hemivar.laws.transformed.envelopes import EnvelopeLaw
from hemivar.laws.transformed.law_graph import Region, between, law_graph, spliced
from hemivar.laws.transformed.transformed_law import by_parts, check_law, merged, numbers, table_of
from hemivar.laws.turns import turns

__all__ = ["affine", "homogeneous", "plus", "pushing", "secant", "secant_stiffness", "slipped"]


def affine(law: Superpotential, theta: Array | float, c: Array | float = 0.0) -> Superpotential:
    """The law ``j(theta r + c)/theta``, whose derivative is ``j'(theta r + c)``.

    With a rate ``v = a r + c`` it makes of a law of v one of r: ``affine(law, a, -a r_n)``.  Its alpha is theta times
    that of the law.  The constant is chosen so that it is zero at r = 0, as for every law.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters.
    theta : number or array (m,)
        > 0.
    c : number or array (m,)
        Any.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        theta is not positive, or a number is not finite.
    """
    check_law(law)
    theta = numbers(theta, f"the factor of the argument of law '{law.name}'", above=0.0)
    c = numbers(c, f"the shift of the argument of law '{law.name}'", state=True)
    common_rows(f"law '{law.name}'", law.rows, theta.size, c.size)
    return _affine(law, theta, c)


def _affine(law: Superpotential, theta: Array, c: Array) -> Superpotential:
    if (theta == 1.0).all() and (c == 0.0).all():
        return law
    stacked = by_parts(law, lambda part, index: _affine(part, row(theta, index), row(c, index)))
    if stacked is not None:
        return stacked
    base = table_of(law)
    if base is not None and (base.knots.shape[-1] <= MANY or max(theta.size, c.size) == 1):
        knots = separated((base.knots - c[:, None]) / theta[:, None])
        ends, slopes = moved_ends(base, knots), theta[:, None] * base.slopes
        return PiecewiseQuadratic.with_sides(knots, slopes, base._left, base._right, (ends.lower, ends.upper), law.name)
    if isinstance(law, EnvelopeLaw):  # the place of the law is sought once, on the law itself
        return EnvelopeLaw(_affine(law.base, theta, c), law.compliance / theta)
    return moved(law, theta, c)


def plus(law: Superpotential, *others: Superpotential) -> Superpotential:
    """The sum of laws at the same contact points; with resolved parameters.

    The knots are those of all terms.  Its alpha is found piece by piece: it is at most the sum of theirs, less where
    one term is convex enough where another one falls, and finite where an upward jump outweighs a downward one.

    Parameters
    ----------
    law : Superpotential
    *others : Superpotential

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        There is no r that all terms allow, or they are given for different numbers of contact points.
    """
    for summand in (law, *others):
        check_law(summand)
    terms = [term for summand in (law, *others) for term in _terms(summand)]
    stacked = next((term for term in terms if isinstance(term, PiecewiseLaw) and term.apart), None)
    if stacked is not None:
        made = by_parts(
            stacked, lambda part, index: plus(*(part if term is stacked else taken(term, index) for term in terms))
        )
        assert made is not None
        return made
    tables = [table for table in map(table_of, terms) if table is not None]
    smooth = [term for term in terms if table_of(term) is None]
    _check_common(terms)
    if len(tables) > 1 or (tables and smooth):
        tables = [table for table in tables if not _idle(table)] or tables[:1]
    if smooth:
        tables = [table for table in tables if not _idle(table)]
    if tables:
        rows = max(table.rows for table in tables)
        if rows > 1 and max(table.knots.shape[-1] for table in tables) > MANY:
            smooth, tables = [*tables, *smooth], []
        else:
            smooth = [_summed(tables), *smooth]
    return _summed(smooth)


def _terms(law: Superpotential) -> tuple[Superpotential, ...]:
    return tuple(term.law for term in law.terms) if isinstance(law, PiecewiseLaw) and law.plain else (law,)


def _idle(law: PiecewiseQuadratic) -> bool:
    """Whether a table is zero everywhere."""
    free = np.isneginf(law.lower).all() and np.isposinf(law.upper).all()
    return bool(free and not law.slopes.any() and not law._left.any() and not law._right.any())


def _check_common(terms: Sequence[Superpotential]) -> None:
    common_rows("a sum of laws", *(term.rows for term in terms))
    lower, upper = _ends(terms)
    if (lower > upper).any():
        names = " and ".join(f"'{term.name}'" for term in terms)
        raise ProblemError(f"no displacement is allowed by all of the laws {names}, which are summed; leave one out")


def _ends(terms: Sequence[Superpotential]) -> tuple[Array, Array]:
    lower, upper = np.full(1, -np.inf), np.full(1, np.inf)
    for term in terms:
        lower, upper = np.maximum(lower, term.domain.lower), np.minimum(upper, term.domain.upper)
    return lower, upper


def _joined(laws: Sequence[Superpotential]) -> Array:
    """The knots of all laws that lie in the domain of the sum."""
    lower, upper = _ends(laws)
    rows = common_rows("a sum of laws", lower.size, upper.size, *(law.rows for law in laws))
    knots = np.concatenate([np.broadcast_to(law.knots, (rows, law.knots.shape[-1])) for law in laws], axis=-1)
    inside = (knots >= lower[:, None]) & (knots <= upper[:, None])
    inside[~inside.any(axis=-1)] = True  # one knot at least, even if the law ends before it
    return merged(np.where(inside, knots, np.inf))


def _summed(terms: Sequence[Superpotential]) -> Superpotential:
    if len(terms) == 1:
        return terms[0]
    ends, regions = Interval(*_ends(terms)), [Region(term) for term in terms]
    knots = _joined(terms)
    passed = [region.passed(knots) for region in regions]
    extra = turns(terms, knots, [between(*counts) for counts in passed], ends)
    if extra is not None:
        knots = merged(np.concatenate([np.broadcast_to(knots, (len(extra), knots.shape[-1])), extra], axis=-1))
        passed = [region.passed(knots) for region in regions]
    below, above, size = np.zeros((3, *knots.shape))
    for region, counts in zip(regions, passed, strict=True):
        before, after = region.sides(knots, *counts)
        with np.errstate(invalid="ignore"):
            below, above = below + before, above + after
        size = np.maximum(size, np.maximum(np.abs(before), np.abs(after)))
    with np.errstate(invalid="ignore"):
        same = np.isfinite(size) & (np.abs(above - below) <= 4.0 * np.finfo(float).eps * size)
    sides, name = (below, np.where(same, below, above)), " + ".join(dict.fromkeys(term.name for term in terms))
    return law_graph(
        knots, [Term(term, between(*counts)) for term, counts in zip(terms, passed, strict=True)], sides, ends, name
    )


def homogeneous(profile: Superpotential) -> bool:
    """Whether a friction profile is a multiple of the size of the slip, so that it sees no rate and no sum."""
    table = table_of(profile)
    if table is None:
        return False
    free = np.isneginf(table.lower).all() and np.isposinf(table.upper).all()
    return bool(free and not table.slopes.any() and not ((table.jumps != 0.0) & (table.knots != 0.0)).any())


def slipped(profile: Superpotential, total: Array | float) -> Superpotential:
    """The profile ``H(s + |d|) - H(s)`` of the next slip d, after slips that sum up to s = ``total``.

    H is the profile; where it weakens, it does so with the slip sum, and does not recover when the slip turns round.
    Its alpha is the largest fall of h = H' beyond s.

    Parameters
    ----------
    profile : Superpotential
        Even, as friction profiles are; with resolved parameters.
    total : number or array (m,)
        s >= 0.

    Returns
    -------
    Superpotential
    """
    known = numbers(total, f"the slip sum of friction law '{profile.name}'", least=0.0, state=True)
    common_rows(f"friction law '{profile.name}'", profile.rows, known.size)
    stacked = by_parts(profile, lambda part, index: slipped(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all() or homogeneous(profile):
        return profile
    total = np.minimum(known, profile.domain.upper)
    law = table_of(profile) or profile
    upper = law.domain.upper - total
    regions = Region(law, -total), Region(law, total)  # the law is even: backwards it is met at r - s
    return spliced(regions, [np.zeros(1)], Interval(-upper, upper), profile.name)


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
    known = numbers(opening, f"the largest opening of law '{law.name}'", least=0.0, state=True)
    common_rows(f"law '{law.name}'", law.rows, known.size)
    stacked = by_parts(law, lambda part, index: secant(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all():
        return law
    opening = np.minimum(known, -law.domain.lower)
    stiffness = secant_stiffness(law, opening)
    base, wide, force = table_of(law) or law, opening[:, None], (stiffness * opening)[:, None]

    def mended(knots: Array, below: Array, above: Array) -> tuple[Array, Array]:
        """Where the secant ends, and at zero, there is no kink by rounding."""
        size = np.where(knots == 0.0, _largest(base, wide, force), np.where(knots == -wide, np.abs(above), 0.0))
        return below, np.where(np.abs(above - below) <= 8.0 * np.finfo(float).eps * size, below, above)

    own, unloading = Region(base), Region(spring=stiffness)
    return spliced([own, unloading, own], [-opening, np.zeros(1)], law.domain, law.name, mended)


def secant_stiffness(law: Superpotential, opening: Array) -> Array:
    """g(D)/D at every contact point, 0 where D = 0; see :func:`secant`."""
    bound = law.domain
    if (bound.lower > 0.0).any() or (bound.upper < 0.0).any():
        raise ProblemError(f"law '{law.name}' does not allow r = 0, where secant unloading ends; leave the memory out")
    rows = common_rows(f"law '{law.name}'", opening.size, law.rows)
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


def _largest(law: Superpotential, wide: Array, force: Array) -> Array:
    """The largest of ``force (m, 1)`` and those of a law up to the opening ``wide``, and of what they are sums of."""
    opened = (law.knots <= 0.0) & (law.knots >= -wide)
    sides = [np.where(np.isfinite(side), np.abs(side), 0.0) for side in law.knot_slopes()]
    if isinstance(law, PiecewiseQuadratic):  # its derivative is summed up from slopes times widths
        sides += [np.abs(slope * law.breakpoints) for slope in (law.slopes[:, :-1], law.slopes[:, 1:])]
    largest: Array = np.max(np.where(opened, np.maximum.reduce(sides), 0.0), axis=-1, keepdims=True)
    return np.maximum(largest, force)


def pushing(law: Superpotential, damping: Superpotential) -> Superpotential:
    """The law with damping in contact that cannot pull: ``max(0, j'(r) + psi'(r))`` for r > 0, and j' for r < 0.

    Parameters
    ----------
    law, damping : Superpotential
        Convex, with resolved parameters; of a rate, ``damping`` is first given its affine argument.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        One of them is not convex, or the law does not allow r > 0: a rigid foundation has no damper.
    """
    stacked = by_parts(law, lambda part, index: pushing(part, taken(damping, index)))
    if stacked is not None:
        return stacked
    for term in (law, damping):
        if not term.convex:
            raise ProblemError(
                f"law '{term.name}' is not monotone (alpha = {term.weak_convexity.max():.4g}); damping that cannot "
                f"pull needs a monotone law; use plain damping"
            )
    if (law.domain.upper <= 0.0).any():
        raise ProblemError(
            f"law '{law.name}' allows no penetration, so there is nothing to damp; use springs such as Compliance"
        )
    base, total = table_of(law) or law, plus(law, damping)
    zero = np.zeros(total.rows)
    passed = count_knots(total.knots, zero[:, None], including=True)[:, 0]
    least = total.local_argmin(zero, zero)
    least = np.where(np.isnan(least), np.inf, np.maximum(least, 0.0))
    pushes = np.where(total.piece_derivative(passed, zero) >= 0.0, 0.0, least)  # the place r >= 0 from which on it does
    kink = total.at_kink(np.where(np.isfinite(pushes), pushes, 0.0))[:, None]

    def mended(knots: Array, below: Array, above: Array) -> tuple[Array, Array]:
        begins = (knots == pushes[:, None]) & (knots > 0.0)
        return below, np.where(begins, np.where(kink, np.maximum(above, 0.0), 0.0), above)

    return spliced([Region(base), Region(), Region(total)], [zero, pushes], total.domain, total.name, mended)
