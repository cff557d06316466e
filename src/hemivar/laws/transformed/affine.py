"""The law of an affine argument: of a rate, of a place half a step ahead, behind a moving gap or a worn surface."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.rescaled import RescaledLaw, moved_ends, separated
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed.envelopes import EnvelopeLaw
from hemivar.laws.transformed.exact_table import MANY, table_of
from hemivar.laws.transformed.transformed_law import by_parts, check_law, numbers, row

__all__ = ["affine"]


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
    c = numbers(c, f"the shift of the argument of law '{law.name}'")
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
    if isinstance(law, RescaledLaw):
        return RescaledLaw(law.base, law.factor, law.theta * theta, law.theta * c + law.c)
    return RescaledLaw(law, np.ones(1), theta, c)
