"""Energy-conserving mean law (discrete gradient): of a law over the step from one penetration to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.normal import Compliance
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import pick
from hemivar.laws.superpotential import Superpotential, row
from hemivar.laws.transformed.law_graph import Region, between
from hemivar.laws.transformed.transformed_law import LawOfOne, by_parts, lines, merged, numbers, table_of

__all__ = ["AveragedLaw", "averaged"]


def averaged(law: Superpotential, before: Array | float) -> Superpotential:
    """The law whose derivative is ``(j(r) - j(r_n))/(r - r_n)``, the mean of j' between r_n = ``before`` and r.

    A foundation that pushes with it over a step from r_n to r does the work ``j(r) - j(r_n)``, neither more nor less
    (energy-conserving contact).  Its alpha is half that of the law where j' is continuous.

    Parameters
    ----------
    law : Superpotential
        Piecewise quadratic, without an end; with resolved parameters.
    before : number or array (m,)

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        The law is not piecewise quadratic, or ends somewhere.
    """
    known = numbers(before, f"the penetration from which law '{law.name}' is averaged", state=True)
    common_rows(f"law '{law.name}'", law.rows, known.size)
    stacked = by_parts(law, lambda part, index: averaged(part, row(known, index)))
    if stacked is not None:
        return stacked
    base = table_of(law) or _spring(law)
    if base is None:
        raise ProblemError(
            f"law '{law.name}' is not piecewise quadratic, and only such laws are averaged to keep energy; give a "
            "table (table_law), or take a scheme that does not average"
        )
    if np.isfinite(base.domain.lower).any() or np.isfinite(base.domain.upper).any():
        raise ProblemError(
            f"law '{law.name}' ends at some penetration, so that its energy jumps to infinity there and cannot be "
            "averaged; give a compliant foundation, or take MoreauJean() for a rigid one"
        )
    return AveragedLaw(base, known)


def _spring(law: Superpotential) -> PiecewiseQuadratic | None:
    """A power law of exponent one as a table."""
    if not isinstance(law, Compliance) or np.any(np.asarray(law.exponent) != 1.0):
        return None
    rows = law.knots.shape[0]
    zero = np.zeros((rows, 1))
    stiff = np.broadcast_to(law.piece_curvature(np.ones(rows, dtype=np.int64), np.ones(rows)), (rows,))[:, None]
    slopes, ends = np.concatenate([zero, stiff], axis=-1), (-np.inf, np.inf)
    return PiecewiseQuadratic.with_sides(zero, slopes, zero, zero, ends, law.name)


@dataclass(frozen=True, eq=False)
class AveragedLaw(LawOfOne):
    """See :func:`averaged`.

    With ``s = r - r_n`` the derivative on a piece is ``a/s + b + c s/2``: b and c belong to the straight line that j'
    is there, and a is what the pieces between differ from it.
    """

    base: PiecewiseQuadratic
    before: Array

    @cached_property
    def _numbers(self) -> tuple[Array, Array, Array, Array, Array, IntArray]:
        """Knots (m, K); a, b, c and the constant of the value (m, K + 1); the knot that is r_n (m,)."""
        rows = common_rows(f"law '{self.name}'", self.base.rows, self.before.size)
        start = np.broadcast_to(self.before, (rows,))
        own = np.broadcast_to(self.base.knots, (rows, self.base.knots.shape[-1]))
        knots = merged(np.concatenate([own, start[:, None]], axis=-1))
        count = knots.shape[-1]
        finite = np.isfinite(knots)
        last_knot = np.argmax(knots == start[:, None], axis=-1)
        s = np.where(finite, knots - start[:, None], 0.0)
        piece = between(*Region(self.base).passed(knots))
        zero = np.zeros((rows, 1))
        # A piece begins at its knot that is nearer to r_n: on the right of it the left one.
        behind = np.arange(count + 1) <= last_knot[:, None]
        edges = np.concatenate([s, zero], axis=-1), np.concatenate([zero, s], axis=-1)
        near = np.where(behind, *edges)
        far = np.where(behind, *edges[::-1])
        used = np.concatenate([np.ones((rows, 1), dtype=bool), finite], axis=-1)
        slope, c = lines(self.base, piece, start[:, None] + near)
        b = slope - c * near
        # What is stored on the way from r_n to where a piece begins, added up outwards.
        width = far - near
        work = np.where(used, width * (slope + 0.5 * c * width), 0.0)
        out = self._outwards(work, behind)
        a = np.where(near == 0.0, 0.0, out - near * (b + 0.5 * c * near))
        rise = np.where(used, self._primitive(a, b, c, far) - self._primitive(a, b, c, near), 0.0)
        rise[:, 0] = rise[:, -1] = 0.0
        constant = self._outwards(rise, behind) - self._primitive(a, b, c, near)
        return knots, a, b, c, constant, last_knot

    @staticmethod
    def _outwards(parts: Array, behind: Array) -> Array:
        """Sums of what lies between r_n and each piece, without it."""
        ahead, back = np.where(behind, 0.0, parts), np.where(behind, parts, 0.0)
        right = np.cumsum(ahead, axis=-1) - ahead
        left = np.cumsum(back[:, ::-1], axis=-1)[:, ::-1] - back
        return np.where(behind, left, right)

    @staticmethod
    def _primitive(a: Array, b: Array, c: Array, s: Array) -> Array:
        size = np.where(a == 0.0, 1.0, np.abs(s))
        return np.asarray(a * np.log(np.where(size > 0.0, size, 1.0)) + s * (b + 0.25 * c * s))

    def _at(self, piece: IntArray, r: Array) -> tuple[Array, Array, Array, Array, Array]:
        _, a, b, c, constant, _ = self._numbers
        piece = np.asarray(piece)
        s = np.asarray(r, dtype=float) - self.before
        a = pick(a, piece)
        return a, pick(b, piece), pick(c, piece), pick(constant, piece), np.where((a != 0.0) & (s == 0.0), np.nan, s)

    @property
    def knots(self) -> Array:
        return self._numbers[0]

    def _raw(self, piece: IntArray, r: Array) -> Array:
        a, b, c, constant, s = self._at(piece, r)
        return np.asarray(self._primitive(a, b, c, s) + constant)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        a, b, c, _, s = self._at(piece, r)
        return np.asarray(np.where(a == 0.0, 0.0, a / np.where(a == 0.0, 1.0, s)) + b + 0.5 * c * s)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        a, _, c, _, s = self._at(piece, r)
        return np.asarray(0.5 * c - np.where(a == 0.0, 0.0, a / np.where(a == 0.0, 1.0, s) ** 2))

    def _knot_sides(self) -> tuple[Array, Array]:
        left, right = super()._knot_sides()
        here = np.arange(self.knots.shape[-1]) == self._numbers[5][:, None]
        smooth = here & ~self.base.at_kink(np.broadcast_to(self.before, (len(self.knots),)))[:, None]
        return left, np.where(here & ~smooth, right, left)  # the mean is continuous elsewhere

    def piece_formula(self, piece: int) -> str:
        _, a, b, c, _, _ = self._numbers
        s = f"(r {-float(self.before[0]):+.6g})"
        line = f"{float(b[0, piece]):.6g} + {0.5 * float(c[0, piece]):.6g} {s}"
        return line if a[0, piece] == 0.0 else f"{line} {float(a[0, piece]):+.6g}/{s}"

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        knots, a, _, c, _, _ = self._numbers
        left, right = self._slopes
        ends = np.where(np.isfinite(knots), knots - self.before[:, None], np.inf)
        endless = np.full((len(knots), 1), np.inf)
        worst = np.zeros(len(knots))
        for s in (np.concatenate([endless, ends], axis=-1), np.concatenate([ends, endless], axis=-1)):
            bent = 0.5 * c - np.where(a == 0.0, 0.0, a / np.where(s == 0.0, 1.0, s) ** 2)
            worst = np.maximum(worst, np.max(-bent, axis=-1))
        return np.where(np.any(right < left, axis=-1), np.inf, worst)

    @property
    def growth(self) -> tuple[Array, Array]:
        c0, c1 = self.base.growth
        return np.asarray(c0 + c1 * np.abs(self.before)), np.asarray(c1 + 0.0 * self.before)

    def recession(self, sign: Array) -> Array:
        return np.asarray(self.base.recession(sign) + 0.0 * self.before)

    def asymptotic_curvature(self, sign: float) -> Array:
        return 0.5 * self.base.asymptotic_curvature(sign) + 0.0 * self.before
