"""Friction that has slipped before: what is left of a law of the slip when its sum is s already."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import count_knots, merged, table_of
from hemivar.laws.transformed.law_graph import Term, beside, law_graph
from hemivar.laws.transformed.transformed_law import by_parts, numbers, row

__all__ = ["homogeneous", "slipped"]


def homogeneous(profile: Superpotential) -> bool:
    """Whether a friction profile is a multiple of the size of the slip, so that it sees no rate and no sum."""
    found = table_of(profile)
    if found is None:
        return False
    free = np.isneginf(found.lower).all() and np.isposinf(found.upper).all()
    return bool(free and not found.slopes.any() and not ((found.jumps != 0.0) & (found.knots != 0.0)).any())


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
    known = numbers(total, f"the slip sum of friction law '{profile.name}'", least=0.0)
    stacked = by_parts(profile, lambda part, index: slipped(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all() or homogeneous(profile):
        return profile
    total = np.minimum(known, profile.domain.upper)
    law = table_of(profile) or profile
    ahead = _ahead(law.knots, total)
    rows = len(ahead)
    behind = np.where(np.isfinite(ahead), -ahead, np.inf)
    knots = merged(np.concatenate([behind, np.zeros((rows, 1)), ahead], axis=-1))
    start = np.concatenate([np.full((rows, 1), -np.inf), knots], axis=-1)
    end = np.concatenate([knots, np.full((rows, 1), np.inf)], axis=-1)
    backwards = end <= 0.0
    near = np.where(backwards, -end, start)  # the end that has slipped less
    passed = count_knots(law.knots, np.broadcast_to(total[:, None], (rows, 1)), including=True)
    number = passed + count_knots(ahead, np.where(np.isfinite(near), near, 0.0), including=True)
    count = law.knots.shape[-1]
    piece = np.minimum(np.where(np.isfinite(near), number, count), count)
    outwards = knots > 0.0
    inner, outer = np.where(outwards, piece[:, :-1], piece[:, 1:]), np.where(outwards, piece[:, 1:], piece[:, :-1])
    low, high = beside(law, total[:, None] + np.where(np.isfinite(knots), np.abs(knots), 0.0), inner, outer)
    sides = np.where(outwards, low, -high), np.where(knots < 0.0, -low, high)
    part = Term(law, piece, total[:, None], sign=np.where(backwards, -1.0, 1.0), start=total)
    upper = np.broadcast_to(law.domain.upper - total, (rows,))
    return law_graph(knots, [part], sides, Interval(-upper, upper), profile.name)


def _ahead(knots: Array, total: Array) -> Array:
    """The knots beyond the sum, counted from it: (m, n), +inf where unused."""
    rows = max(knots.shape[0], total.size)
    knots = np.broadcast_to(knots, (rows, knots.shape[-1]))
    gap = knots - total[:, None]
    return merged(np.where((knots > total[:, None]) & (gap > 0.0), gap, np.inf))
