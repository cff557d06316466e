"""Springs and dashpots that push only: a damper that cannot pull the body back when it leaves."""

from __future__ import annotations

import numpy as np

from hemivar.errors import ProblemError
from hemivar.laws.stacked import StackedLaw
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed.exact_table import count_knots, merged, table_of
from hemivar.laws.transformed.law_graph import Term, beside, law_graph
from hemivar.laws.transformed.sums import plus
from hemivar.laws.transformed.transformed_law import by_parts

__all__ = ["pushing"]


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
    if isinstance(law, StackedLaw):
        made = by_parts(
            law, lambda part, index: pushing(part, damping.take(index) if len(damping.knots) > 1 else damping)
        )
        assert made is not None
        return made
    for one in (law, damping):
        if not one.convex:
            raise ProblemError(
                f"law '{one.name}' is not monotone (alpha = {one.weak_convexity.max():.4g}); damping that cannot pull "
                f"needs a monotone law, take it as damping without that"
            )
    if (law.domain.upper <= 0.0).any():
        raise ProblemError(
            f"law '{law.name}' allows no penetration, so that there is nothing to damp; take springs such as Compliance"
        )
    base, total = table_of(law) or law, plus(law, damping)
    rows = max(base.knots.shape[0], total.knots.shape[0])
    zero = np.zeros(rows)
    passed = count_knots(total.knots, zero[:, None], including=True)[:, 0]
    found = total.local_argmin(zero, zero)
    found = np.where(np.isnan(found), np.inf, np.maximum(found, 0.0))
    pushes = np.where(total.piece_derivative(passed, zero) >= 0.0, 0.0, found)  # the place r >= 0 from which on it does
    first, begins = pushes[:, None], np.where(np.isfinite(pushes), pushes, 0.0)
    own, both = (np.broadcast_to(one.knots, (rows, one.knots.shape[-1])) for one in (base, total))
    places = [np.where(own < 0.0, own, np.inf), zero[:, None], first, np.where(both > first, both, np.inf)]
    knots = merged(np.concatenate(places, axis=-1))
    start, at = np.concatenate([np.full((rows, 1), -np.inf), knots], axis=-1), np.where(np.isfinite(knots), knots, 0.0)
    of_law = np.where(np.isneginf(start), 0, count_knots(base.knots, start, including=True))
    of_sum = np.where(np.isfinite(start), count_knots(total.knots, start, including=True), total.knots.shape[-1])
    parts = [
        Term(base, np.where(start < 0.0, of_law, -1), np.zeros((1, 1))),
        Term(total, np.where((start >= 0.0) & (start >= first), of_sum, -1), begins[:, None]),
    ]
    (low, high), (under, over) = (
        beside(one, at, *(count_knots(one.knots, at, including=side) for side in (False, True)))
        for one in (base, total)
    )
    smooth = (first > 0.0) & ~total.at_kink(begins)[:, None]
    over = np.where(knots == first, np.where(smooth, 0.0, np.where(first > 0.0, np.maximum(over, 0.0), over)), over)
    below = np.where(knots <= 0.0, low, np.where(knots <= first, 0.0, under))
    above = np.where(knots < 0.0, high, np.where(knots < first, 0.0, over))
    return law_graph(knots, parts, (below, above), total.domain, total.name)
