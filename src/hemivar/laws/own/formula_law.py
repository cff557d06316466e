"""Laws whose potential, or its derivative, is a formula."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arguments import described, one_line
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.stated import Form, stated, stating
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.formula.formula import ScalarFormula
from hemivar.formula.poles import NARROW, NARROWEST, Pole, pole_of_pieces
from hemivar.formula.primitive import Primitive
from hemivar.formula.smooth import WIDE, SmoothFormula, Supremum, graded, supremum_of_pieces
from hemivar.laws.named import LawKind, named
from hemivar.laws.own.own_law import LawPiece, OwnLaw, check_joined, middle_of
from hemivar.laws.parameters import LENGTH, LINE, checked_reach, numbers, parameter
from hemivar.laws.proof import SAMPLED, Constant, Evidence, Proof
from hemivar.laws.superpotential import Superpotential

__all__ = ["FORMULA", "FormulaLaw"]

#: Kinks and turns of the curvature that a formula may have, as docs/laws.md says.
_MOST_KNOTS = 1000
#: Turns nearer to zero than this part of the reach are distinguished as if they were as far; any value from
#: 1e-8 to 1e-4 finds the same in tests/laws.
_FINEST = 1e-6
#: Turns in a decade beyond the reach up to which they are taken, and work on it: 0.05 s of an AMD EPYC.
_FEW_FAR, _FAR_WORK = 20, 2e6
#: How much farther than the reach a potential is integrated to rounding, beyond over parts that double; with 10 the
#: potentials in tests/laws are the same.
_FAR_INTEGRAL = 1e3
_EVERYWHERE = " for every r (use piecewise, max(r, 0) or abs(r))"


@dataclass(frozen=True, eq=False)
class _FormulaLaw(OwnLaw):
    """The law that :func:`FormulaLaw` makes; the formula is the potential, or the derivative of it by ``order`` = 1."""

    text: str
    kinks_at: Sequence[float] = ()
    reach: float = 10.0
    even: bool = False
    name: str = "formula"
    where: str = ""
    order: int = 0
    _formula: ScalarFormula = field(init=False, repr=False)

    def __post_init__(self) -> None:
        checked_reach(self.reach, f"law '{self.name}'")
        object.__setattr__(self, "_formula", ScalarFormula(self.text, "r", self.where))
        _ = self._own

    @property
    def stated(self) -> Mapping[str, object]:
        return {
            "law": "formula",
            "derivative" if self.order else "potential": self.text,
            "kinks": self.kinks_at,
            "reach": self.reach,
        }

    @property
    def _bend(self) -> str:
        """What j'' is of the formula, in words."""
        return "the slope of" if self.order else "the curvature of"

    @property
    def _start(self) -> float:
        return 0.0 if self.even else -np.inf

    @cached_property
    def _branches(self) -> tuple[Array, list[SmoothFormula], bool]:
        """Places where one branch gives way to another, the branches, and whether no place is missing."""
        formula = self._formula
        switches, sure = formula.switches(self.reach)
        if self.even:
            switches = switches[switches > 1e-12 * self.reach]
        ends = np.concatenate([[self._start], switches, [np.inf]])
        branches = formula.branches(np.array([middle_of(low, high) for low, high in itertools.pairwise(ends)]))
        keep = [i for i in range(len(switches)) if branches[i].node != branches[i + 1].node]
        return switches[keep], [branches[0], *(branches[i + 1] for i in keep)], sure

    def _pieces(self) -> tuple[Array, tuple[LawPiece, ...]]:
        shown = self._formula.shown
        switches, branches, _ = self._branches
        ends = np.concatenate([[self._start], switches, [np.inf]])
        count = int(np.clip(40_000 // len(branches), 60, 1000))
        knots = [switches, np.array([k for k in map(float, self.kinks_at) if k > 0.0 or not self.even])]
        plain: dict[int, LawPiece] = {}
        sure, seen = True, 0.0
        for node in dict.fromkeys(branch.node for branch in branches):
            here = [i for i, branch in enumerate(branches) if branch.node == node]
            smooth = branches[here[0]]
            slope = smooth if self.order else smooth.derivative()
            bend = slope.derivative()
            plain[node] = LawPiece(smooth, slope, bend, str(slope))
            low, high = ends[here], ends[np.array(here) + 1]
            inside = [self._inside(a, b, count) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
            places = np.concatenate(inside)
            corners = np.concatenate([low[np.isfinite(low)], high[np.isfinite(high)]])
            own = ("the derivative of ", slope, np.append(places, corners))
            for what, part, at in (("", *own[1:]),) if self.order else (("", smooth, places), own):
                bad = ~np.isfinite(part(at))
                if bad.any():
                    raise ProblemError(
                        f"{what}{shown} is not finite at r = {at[np.argmax(bad)]:.4g}; give a formula"
                        + (" that is finite for every r >= 0" if self.even else _EVERYWHERE)
                    )
            turns, complete = self._turns(bend.derivative(), low, high)
            sure &= complete
            bends = np.abs(bend(np.concatenate([places, turns])))
            seen = max(seen, float(bends[np.isfinite(bends)].max(initial=0.0)))
            knots.append(turns)
        self._refuse_pole()
        if not self.order:
            check_joined(shown, switches, [plain[branch.node] for branch in branches], self.reach)
        table = np.unique(np.concatenate(knots))
        if table.size > _MOST_KNOTS:
            raise ProblemError(
                f"{shown} has {table.size} kinks and turns of its curvature up to the reach {self.reach:g}; at most "
                f"{_MOST_KNOTS} are allowed: take a smaller reach, or give a table"
            )
        self._check_slopes()
        if not sure:
            self._check_width(seen)
        low = np.concatenate([[self._start], table])
        high = np.concatenate([table, [np.inf]])
        middle = [middle_of(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
        which = np.searchsorted(switches, middle).tolist()
        if self.order:
            joined = self._integrated(table)
            return table, tuple(joined[i] for i in which)
        return table, tuple(plain[branches[i].node] for i in which)

    def _integrated(self, table: Array) -> list[LawPiece]:
        """The pieces between switches of a law given by its derivative: integrals, each continuing the one before.

        The turns of the curvature are ends of the parts: between them it is monotone, so that no narrow part is missed.
        """
        switches, branches, _ = self._branches
        far = _FAR_INTEGRAL * self._middle
        ends = np.concatenate([[0.0 if self.even else -far], switches, [far]])
        near = np.array([-self._middle, 0.0, self._middle])
        values: list[Primitive] = []
        for i, slope in enumerate(branches):
            inside = np.union1d(table, near)
            inside = inside[(inside > ends[i]) & (inside < ends[i + 1])]
            values.append(Primitive.over(slope, np.concatenate([ends[i : i + 1], inside, ends[i + 1 : i + 2]])))
        first = int(np.searchsorted(switches, 0.0))
        for i in range(first + 1, len(values)):
            values[i] = values[i].through(ends[i], float(values[i - 1](ends[i : i + 1])[0]))
        for i in range(first - 1, -1, -1):
            values[i] = values[i].through(ends[i + 1], float(values[i + 1](ends[i + 1 : i + 2])[0]))
        pieces = [LawPiece(value, value.slope, value.slope.derivative(), str(value.slope)) for value in values]
        return pieces

    def _turns(self, third: SmoothFormula, low: Array, high: Array) -> tuple[Array, bool]:
        """Where a curvature turns round in the intervals ``[low, high]``: the zeros of its derivative; whether all.

        Beyond the reach they are found as far as there are few.
        """
        if third.constant:
            return np.zeros(0), True
        ends = np.concatenate([low, high])
        reach = 1.5 * max(self.reach, 2.0 * float(np.abs(ends[np.isfinite(ends)]).max(initial=0.0)))
        inside = graded(np.clip(low, -reach, reach), np.clip(high, -reach, reach))
        third.graph.work = 0.0
        inner, rest = third.isolated(*inside, _FINEST * reach)
        sides = [sign for sign, far in ((-1.0, low), (1.0, high)) if np.isinf(far).any()]
        taken = [inner, third.sign_changes(*rest), *_beyond(third, reach, sides)]
        turns = np.concatenate(taken)
        near = NARROW * np.abs(turns)
        turns = turns[third.without_pole(turns - near, turns + near)]  # a sign that changes through a pole is no turn
        return np.where(np.abs(turns) > NARROWEST * reach, turns, 0.0), not rest[0].size

    def _pieces_within(self, within: float) -> tuple[Array, list[SmoothFormula]]:
        """Ends of the pieces between switches up to |r| = ``within``, and the functions on them."""
        switches, branches, _ = self._branches
        ends = np.clip(np.concatenate([[self._start], switches, [np.inf]]), -within, within)
        used = np.flatnonzero(ends[:-1] < ends[1:])
        return ends[used[0] : used[-1] + 2], [branches[i] for i in used]

    def _supremum(self, order: int, sign: float, within: float = np.inf, slack: float = 0.0) -> Supremum:
        """Enclosed supremum of ``sign`` times a derivative over all pieces, up to |r| = ``within``."""
        ends, branches = self._pieces_within(within)
        return supremum_of_pieces(branches, ends, self.reach, order=order - self.order, sign=sign, slack=slack)

    @property
    def _middle(self) -> float:
        """The reach, or twice as far as branches change."""
        return max(self.reach, 2.0 * float(np.abs(self._branches[0]).max(initial=0.0)))

    def _check_width(self, seen: float) -> None:
        """Refuse a curvature that is much larger at some place than at its turns and all places that were looked at."""
        for sign in (1.0, -1.0):
            supremum = self._supremum(2, sign, self._middle, slack=seen)
            if supremum.seen > 2.0 * seen:
                raise ProblemError(
                    f"{self._bend} {self._formula.shown} turns at r = {supremum.place:.6g} within too short a length "
                    f"for the reach {self.reach:g}; take a smaller reach, or a kink in place of the turn"
                )

    def _pole(self, within: float) -> Pole | None:
        """A place up to |r| = ``within`` where the derivative is not shown to be continuous, but for ends of pieces."""
        ends, branches = self._pieces_within(within)
        slopes = branches if self.order else [branch.derivative() for branch in branches]
        return pole_of_pieces(slopes, ends, self.reach)

    def _refuse_pole(self) -> None:
        """Refuse a derivative that has a pole, or no value, within the reach."""
        pole = self._pole(self.reach)
        if pole is not None and pole.sure:
            what = "" if self.order else "the derivative of "
            raise ProblemError(f"{what}{self._formula.shown} {pole.words('r')}")

    def _check_slopes(self) -> None:
        """Refuse a derivative that grows without bound at some place within the reach."""
        for sign in (1.0, -1.0):
            supremum = self._supremum(1, sign, self._middle)
            if np.isfinite(supremum.bound):
                continue
            _, branches, _ = self._branches
            what = "" if self.order else "the derivative of "
            slopes = {branch.node: branch if self.order else branch.derivative() for branch in branches}
            for smooth in slopes.values():
                for side in (1.0, -1.0):
                    size = np.abs(smooth(supremum.place + side * self.reach * np.array([1e-6, 1e-9, 1e-12])))
                    if np.isfinite(size).all() and size[2] > 1.2 * size[1] > 1.2 * 1.2 * size[0]:
                        raise ProblemError(
                            f"{what}{self._formula.shown} grows without bound at r = {supremum.place:.4g}; a "
                            f"law needs a finite slope everywhere (but at jumps of its derivative)"
                        )

    def proof(self, constant: Constant) -> Proof:
        (_, reach), by_intervals = self._alpha_and_reach, Evidence.BY_INTERVALS
        if constant != "alpha":
            return SAMPLED if self._growth_and_doubt[1] else Proof(by_intervals)
        evidence = by_intervals if reach else Evidence.SAMPLED
        return Proof(evidence, (reach,), (self._alpha_up_to,))

    @cached_property
    def _alpha_and_reach(self) -> tuple[float, float]:
        """alpha and up to which |r| it is proved: everywhere, within the reach, or nowhere, if it is sampled only."""
        sampled = float(OwnLaw._alpha.func(self))  # type: ignore[attr-defined]
        if np.isinf(sampled):
            return sampled, np.inf
        for within in (np.inf, self.reach):
            bound = self._alpha_within(within)
            if np.isfinite(bound):
                return bound, within
        return max(sampled, self._supremum(2, -1.0, self.reach).seen), 0.0

    def _alpha_within(self, within: float) -> float:
        """Enclosed bound of -j'' up to |r| = ``within``; inf if none is found that values come near to."""
        knots = self.knots[0]
        left, right = self.knot_slopes()
        if np.any((right < left)[0] & (np.abs(knots) <= within)) or not self._branches[2]:
            return np.inf
        r = self._samples[0] if within == np.inf else np.linspace(-within, within, 129)
        piece = self._samples[1] if within == np.inf else self.piece_of(r)
        bend = self._evaluate(piece, r, 2)
        bend = bend[np.isfinite(bend)]
        scale = float(np.max(np.abs(bend), initial=0.0))
        supremum = self._supremum(2, -1.0, within, slack=1e-12 * scale)
        seen = max(float(-np.min(bend, initial=0.0)), supremum.seen)
        close = seen <= supremum.bound <= 1.01 * seen + 1e-6 * scale
        return supremum.bound if close and self._pole(within) is None else np.inf

    def _alpha_up_to(self, reach: float) -> Array:
        alpha, limit = self._alpha_and_reach
        return np.array([alpha if reach in (limit, np.inf) else self._alpha_within(reach)])

    @property
    def _alpha(self) -> float:  # type: ignore[override]
        return self._alpha_and_reach[0]

    @cached_property
    def _growth_and_doubt(self) -> tuple[tuple[float, float], bool]:
        """c0 and c1, and whether they are sampled: else c0 bounds |j'| over the whole line."""
        sampled: tuple[float, float] = OwnLaw._growth.func(self)  # type: ignore[attr-defined]
        if np.isinf(sampled[0]):
            return sampled, False
        suprema = [self._supremum(1, sign) for sign in (1.0, -1.0)]
        proved, seen = max(supremum.bound for supremum in suprema), max(supremum.seen for supremum in suprema)
        if self._branches[2] and proved <= 1.01 * seen:
            return (proved, 0.0), False
        pole = self._pole(np.inf) if proved == np.inf else None
        if pole is not None and pole.sure:
            return (np.inf, np.inf), False
        return sampled, True

    @property
    def _growth(self) -> tuple[float, float]:  # type: ignore[override]
        return self._growth_and_doubt[0]


def _beyond(third: SmoothFormula, reach: float, sides: Sequence[float]) -> list[Array]:
    """Zeros beyond the reach, to the left (-1) or to the right (1): decade by decade, as far as they are few."""
    if not sides:
        return []
    outer = reach * 10.0 ** np.arange(np.log10(WIDE) + 1.0)
    first = np.concatenate([sign * outer[:-1] for sign in sides])
    last = np.concatenate([sign * outer[1:] for sign in sides])
    third.graph.work = 0.0
    zeros, rest = third.isolated(np.minimum(first, last), np.maximum(first, last), reach, _FAR_WORK)
    taken = []
    for sign in sides:
        for start, end in itertools.pairwise(outer.tolist()):
            here = zeros[(sign * zeros > start) & (sign * zeros <= end)]
            open_ = (np.abs(rest[0] + rest[1]) < 2.0 * end) & (sign * (rest[0] + rest[1]) > 2.0 * start)
            if here.size > _FEW_FAR or open_.any():
                break
            taken.append(here)
    return taken


#: What a problem file says of any formula.
FORMULA = {
    "kinks": numbers("further places where a derivative jumps", LENGTH),
    "reach": parameter("length up to which kinks and constants are computed", LENGTH),
}


@named(
    LawKind.NORMAL,
    "formula",
    "any potential or pressure, as a formula of r with piecewise((value, condition), ...), abs, min and max",
    "j(r) = potential, or j'(r) = derivative",
)
@stating(
    potential=stated(
        Form.TEXT,
        "formula of the penetration r",
        unit=LINE,
        example="piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))",
    ),
    derivative=stated(
        Form.TEXT, "formula of the pressure, in place of potential", unit="force/length^2", instead="potential"
    ),
    **FORMULA,
)
@known_keywords
def FormulaLaw(  # noqa: N802 - a law, named as the others are
    potential: str | None = None,
    *,
    derivative: str | None = None,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    even: bool = False,
    name: str = "formula",
    where: str = "",
) -> Superpotential:
    """A law by a formula of r: its potential j(r), or its derivative j'(r), the pressure or the friction.

    >>> import hemivar as hv
    >>> law = hv.FormulaLaw(derivative="piecewise((0, r < 0), (r*exp(-r), True))", reach=5.0)
    >>> law.derivative([-1.0, 1.0]).round(4)
    array([0.    , 0.3679])
    >>> float(law.weak_convexity[0].round(4))  # exp(-2): where it falls the most
    0.1353

    * Numbers, ``r``, ``pi``, ``+ - * / ( )`` and powers, ``**`` or ``^``.
    * ``sin cos tan tanh exp log sqrt abs`` of one argument, ``min`` and ``max`` of two or more.
    * ``piecewise((value, condition), ..., last)``: the first condition that holds counts, ``last`` everywhere else.
    * A condition compares: ``r < 0.1``, ``r >= 0``, ``0 <= r < 1``, or ``True``.
    * A derivative may jump and fall; a potential must be continuous, and is shifted to j(0) = 0.

    Kinks are found, derivatives are symbolic.  Alpha and the growth constants are enclosed, or sampled over
    ``[-reach, reach]`` and some places beyond.  The potential of a derivative is integrated by Gauss's rule, exactly
    but for rounding up to a thousand times the reach.

    Parameters
    ----------
    potential, derivative : str
        One of them.
    kinks : sequence of float
        Further knots.
    reach : float
        Length up to which kinks and constants are looked for: larger than any displacement that matters.
    even : bool
        The formula holds for r >= 0 and j(-r) = j(r): for friction.
    name : str
        What the law is called in messages.
    where : str
        What stands before messages about the formula.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        If none or both are given, the text is not a formula (with the character), is not finite somewhere, not
        continuous, or turns too often or within too short a length for its reach.
    """
    one_line(name, "the name of a law"), one_line(where, "where")
    places = np.atleast_1d(real_array(kinks, f"kinks of law '{name}'")).ravel()
    if (potential is None) == (derivative is None):
        raise ProblemError(f"law '{name}': give either potential='...' or derivative='...', a formula of r")
    text, order = (potential, 0) if potential is not None else (derivative, 1)
    if not isinstance(text, str):
        raise ProblemError(f"law '{name}': the formula is {described(text)}; give a text such as 'max(r, 0)^2'")
    return _FormulaLaw(text, tuple(places.tolist()), reach, even, name, where, order)
