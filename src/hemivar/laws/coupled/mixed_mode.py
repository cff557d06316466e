"""Mixed-mode cohesive law of one fracture energy: opening and slip act through one effective opening."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.stated import stating
from hemivar.basics.types import Array, BoolArray, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.coupled.cohesion import BilinearCohesion, ExponentialCohesion, TrapezoidalCohesion
from hemivar.laws.coupled.criteria import FractureCriterion
from hemivar.laws.coupled.opening import OpeningProblem
from hemivar.laws.crossings import length_places, level_places
from hemivar.laws.glue import Glue
from hemivar.laws.named import LawKind, named
from hemivar.laws.normal import Compliance, Signorini
from hemivar.laws.parameters import COMPRESSION, evaluate, positive, read_formulas, word
from hemivar.laws.parametrised import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.scalar_graph import is_continuous, kink_within, local_minimiser, steepest
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.vector_law import Linearisation, is_curve, lengths, polar

__all__ = ["MixedMode", "stated_compression"]

#: Parts of the way from rest to the break at which the tractions are looked at.
_WAYS = np.linspace(0.0, 1.0, 201)


@dataclass(frozen=True, eq=False)
class MixedMode(Glue):
    """Glue that opens and slips: ``j(r) = Phi(rho)`` and a normal law in compression.

    The effective opening is ``rho = sqrt(<w>^2 + ratio^2 |s|^2)`` with the opening w = -r_nu and the slip s = r_tau;
    tractions follow ``Phi'(rho)``: ``Phi'/rho w`` along the normal, ``ratio^2 Phi'/rho s`` along the slip. The strength
    in shear is ``ratio`` times that in opening, and work from the bonded to any broken state is the fracture energy
    ``G_c``, whatever the mode: a superpotential that debonds has one fracture energy.

    alpha is the largest softening rate k of Phi' for the opening and ``ratio^2 k`` for the slip.  It is reversible:
    what has opened closes along the same curve.

    Parameters
    ----------
    cohesion : Superpotential
        Phi, such as :class:`BilinearCohesion`; see :func:`cohesion_table` for a curve of one's own.
    ratio : Parameter
        Strength in shear over strength in opening, > 0.
    compression : Superpotential
        Normal law in penetration, convex, without force in opening: :class:`Signorini` or :class:`Compliance`.

    Raises
    ------
    ProblemError
        Phi is not even, jumps, pushes back, or does not let go; the compression pulls or is not convex.

    Examples
    --------
    >>> import hemivar as hv
    >>> cohesion = hv.laws.BilinearCohesion(stiffness=1e4, strength=20.0, energy=0.4)
    >>> glue = hv.laws.MixedMode(cohesion, ratio=1.5)
    >>> glue.fracture_energy
    array([0.4])
    """

    cohesion: Superpotential
    ratio: Parameter = field(default=1.0, metadata=positive("shear strength over normal strength", "1", 1.5))
    compression: Superpotential = field(default_factory=Signorini)
    name: ClassVar[str] = "mixed-mode"  # type: ignore[misc]

    def __post_init__(self) -> None:
        read_formulas(self, f"law '{self.name}'")
        if isinstance(self.cohesion, FractureCriterion):
            raise ProblemError(
                f"the cohesion of law '{self.name}' is the criterion '{self.cohesion.name}', which has two fracture "
                "energies, and a superpotential that debonds has one; take ModeDependentGlue(..., criterion=...)"
            )
        for what, law in (("cohesion", self.cohesion), ("compression", self.compression)):
            if not isinstance(law, Superpotential):
                raise ProblemError(
                    f"the {what} of law '{self.name}' is {described(law)}; give a scalar law such as "
                    f"{'BilinearCohesion(...)' if what == 'cohesion' else 'Signorini()'}"
                )
        if not isinstance(self.cohesion, PiecewiseQuadratic | NamedLaw):
            raise ProblemError(
                f"the cohesion '{self.cohesion.name}' of law '{self.name}' is not piecewise linear; give "
                "BilinearCohesion(...), or a table of its curve, cohesion_table(openings, tractions)"
            )
        if not callable(self.ratio):
            self._ratio_at(None)

    def _ratio_at(self, points: Array | None) -> Array:
        what = f"ratio of law '{self.name}'"
        ratio = evaluate(self.ratio, points, what)
        if (ratio <= 0.0).any():
            raise ProblemError(f"{what} is {ratio.min():g}; it must be positive: shear strength over normal strength")
        return ratio

    @property
    def stated(self) -> Mapping[str, object] | None:
        """The law by its name and parameters, as problem files have it; None where a part has no name."""
        cohesion, (known, pushes) = self.cohesion.stated, stated_compression(self.compression)
        if cohesion is None or not known or not isinstance(self.cohesion, NamedLaw):
            return None
        parts = {key: value for key, value in cohesion.items() if key != "law"}
        shape = self.cohesion.name.partition(" ")[0]
        return {"law": self.name, "shape": shape} | parts | {"ratio": self.ratio, "compression": pushes}

    def at(self, points: Array | None) -> MixedMode:
        law = MixedMode(self.cohesion.at(points), self._ratio_at(points), self.compression.at(points))
        law._check()
        return law

    def take(self, index: IntArray) -> MixedMode:
        ratio = self._ratio_at(None)
        return replace(
            self,
            cohesion=self.cohesion.take(index),
            ratio=ratio if ratio.size == 1 else ratio[index],
            compression=self.compression.take(index),
        )

    def _check(self) -> None:
        table, name = self._table, self.cohesion.name
        knots, slopes, rise = table.breakpoints, table.slopes, self._tractions
        middle = knots.shape[1] // 2
        even = knots.shape[1] % 2 == 1 and knots.shape[1] >= 5 and np.array_equal(knots, -knots[:, ::-1])
        if not even or not np.array_equal(slopes, slopes[:, ::-1]) or knots[:, middle].any():
            raise ProblemError(
                f"the cohesion '{name}' of law '{self.name}' is not even with a knot at 0; give the "
                "same curve for both signs"
            )
        if table.jumps.any() or np.isfinite(table.lower).any() or np.isfinite(table.upper).any():
            raise ProblemError(
                f"the cohesion '{name}' of law '{self.name}' jumps or ends; give the drop a slope instead, because "
                f"tractions must be one curve"
            )
        if (rise < -1e-12 * np.abs(rise).max(axis=1, keepdims=True)).any() or (slopes[:, middle] <= 0.0).any():
            raise ProblemError(
                f"the cohesion '{name}' of law '{self.name}' has a negative traction; its traction must be at least 0"
            )
        if rise[:, -1].any() or slopes[:, -1].any():
            raise ProblemError(
                f"the cohesion '{name}' of law '{self.name}' never debonds; its traction must end at zero"
            )
        try:
            pulls = self.compression.derivative(np.array([[-1e-9], [-1.0], [-1e9]]))
        except ValueError:
            pulls = np.zeros(1)
        if np.any(pulls != 0.0) or (self.compression.weak_convexity > 0.0).any():
            raise ProblemError(
                f"the compression '{self.compression.name}' of law '{self.name}' acts in opening or is not convex; "
                "take Signorini() or Compliance(stiffness)"
            )

    # ---- the curve --------------------------------------------------------------------------------------

    @cached_property
    def _table(self) -> PiecewiseQuadratic:
        law = self.cohesion
        return law.table if isinstance(law, NamedLaw) else law  # type: ignore[return-value]

    def _table_at(self, index: IntArray) -> PiecewiseQuadratic:
        """The table at some contact points."""
        return self._table if len(self._table.breakpoints) == 1 else self._table.take(index)

    @cached_property
    def _half(self) -> tuple[Array, Array]:
        """Knots rho > 0 (m or 1, K) and slopes of the pieces from 0 on (m or 1, K + 1)."""
        middle = self._table.breakpoints.shape[1] // 2
        return self._table.breakpoints[:, middle + 1 :], self._table.slopes[:, middle + 1 :]

    @cached_property
    def _tractions(self) -> Array:
        """Phi' at the knots rho > 0, (m or 1, K)."""
        middle = self._table.breakpoints.shape[1] // 2
        return self._table.knot_slopes()[1][:, middle + 1 :]

    @cached_property
    def beta(self) -> Array:
        """The ratio, (m or 1,)."""
        return self._ratio_at(None)

    @cached_property
    def tangential(self) -> PiecewiseQuadratic:
        """``Phi(ratio s)``, the even law of the length of the slip where nothing opens."""
        beta, table = self.beta[:, None], self._table
        below, above = (side * beta for side in table.knot_slopes())
        knots, slopes, ends = table.breakpoints / beta, table.slopes * beta**2, (-np.inf, np.inf)
        return PiecewiseQuadratic.with_sides(knots, slopes, below, above, ends, self.name)

    @cached_property
    def _peak(self) -> Array:
        """rho of the largest traction, (m or 1,)."""
        return np.take_along_axis(self._half[0], np.argmax(self._tractions, axis=1)[:, None], axis=1)[:, 0]

    @property
    def opening_at_peak(self) -> Array:
        """rho at which the strength is reached, (m or 1,)."""
        return self._peak

    @property
    def opening_at_break(self) -> Array:
        """rho at which it lets go, (m or 1,)."""
        return self._half[0][:, -1]

    @property
    def strength(self) -> Array:
        """Largest traction in opening, (m or 1,); that in shear is ``ratio`` times it."""
        return np.asarray(self._tractions.max(axis=1))

    @property
    def curve_knots(self) -> Array:
        """rho > 0 at which the curve bends, (m or 1, K)."""
        return self._half[0]

    def describe(self, point: int = 0) -> str:
        """Strengths, openings and alpha at one contact point, in words."""
        single = self.take(np.array([point]))
        alpha, beta = float(single.weak_convexity[0][0]), float(single.beta[0])
        lines = (
            f"law {self.name}: {self.cohesion.name}; in penetration {self.compression.name}",
            f"strength          {single.strength.item():.6g} in opening, {beta * single.strength.item():.6g} in shear",
            f"fracture energy   {single.fracture_energy.item():.6g}, whatever the mode",
            f"softens           from the opening {single.opening_at_peak.item():.6g} (slip "
            f"{single.opening_at_peak.item() / beta:.6g}) on",
            f"lets go           at the opening {single.opening_at_break.item():.6g} (slip "
            f"{single.opening_at_break.item() / beta:.6g})",
            f"alpha             {alpha:.6g} for the opening, {alpha * beta**2:.6g} for the slip (weakly convex)",
        )
        return "\n".join(lines)

    @property
    def fracture_energy(self) -> Array:
        """G_c, the work from the bonded to any broken state, (m or 1,)."""
        return self._table.value(self.opening_at_break)

    def effective(self, r: Array) -> Array:
        """rho of local displacements (m, c)."""
        opening = np.maximum(-r[:, 0], 0.0)
        return opening if r.shape[1] == 1 else np.hypot(opening, self.beta * lengths(r[:, 1:]))

    def piece_of(self, rho: Array) -> IntArray:
        """Piece of each rho, 0 from 0 on; a knot belongs to the piece before it."""
        return np.asarray((rho[:, None] > self._half[0]).sum(axis=1), dtype=np.int64)

    def curve_on(self, rho: Array, piece: IntArray) -> tuple[Array, Array]:
        """Phi'/rho and Phi'' at rho on given pieces, (m,) each."""
        knots, slopes = self._half
        zero = np.zeros((len(knots), 1))
        starts, bases = (np.concatenate([zero, part], axis=1) for part in (knots, self._tractions))
        start, base, slope = (row_entries(part, piece) for part in (starts, bases, slopes))
        traction = base + slope * (rho - start)
        secant = np.where(piece == 0, slope, traction / np.where(rho > 0.0, rho, 1.0))
        return np.where(piece == knots.shape[1], 0.0, secant), slope

    def damage(self, r: Array) -> Array:
        """How much of the initial stiffness is lost at ``r (m, c)``: 0 intact, 1 broken; (m,)."""
        rho = self.effective(r)
        return np.asarray(1.0 - self.curve_on(rho, self.piece_of(rho))[0] / self._half[1][:, 0])

    def spent(self, r: Array) -> Array:
        """Energy per area that an unloading with the secant stiffness would not give back, (m,)."""
        rho = self.effective(r)
        return np.asarray(self._table.value(rho) - 0.5 * self.curve_on(rho, self.piece_of(rho))[0] * rho**2)

    def mode_ratio(self, r: Array) -> Array:
        """Share of the slip in rho^2, (m,): 0 opening alone, 1 slip alone or compression; nan at rho = 0."""
        rho, opening = self.effective(r), np.maximum(-r[:, 0], 0.0)
        return np.where(rho > 0.0, 1.0 - (opening / np.where(rho > 0.0, rho, 1.0)) ** 2, np.nan)

    def is_function(self, components: int) -> bool:
        return is_continuous(self.compression)

    # ---- glue that remembers ----------------------------------------------------------------------------

    def damaged(self, known: Mapping[str, Array] | None, r: Array) -> dict[str, Array]:
        rho = self.effective(r)
        opening = np.minimum(rho if known is None else np.maximum(rho, known["opening"]), self.opening_at_break)
        return {"opening": opening, "stiffness": self.secant_stiffness(opening)}

    def secant_stiffness(self, opening: Array) -> Array:
        """``Phi'/rho`` at effective openings (m,); 0 from the break on."""
        secant = self.curve_on(opening, self.piece_of(opening))[0]
        return np.where(opening < self.opening_at_break, secant, 0.0)

    def unloading(self, known: Mapping[str, Array]) -> MixedMode:
        """With ``Phi' = rho Phi'(D)/D`` up to the largest effective opening D, and Phi' beyond it."""
        if (known["opening"] <= self.curve_knots[:, 0]).all():
            return self
        at, slopes, tractions = self._with_secant(known["opening"])
        zero, ends = np.zeros((len(at), 1)), (-np.inf, np.inf)
        mirrored = [np.concatenate([-part[:, ::-1], zero, part], axis=1) for part in (at, tractions)]
        slopes = np.concatenate([slopes[:, ::-1], slopes], axis=1)
        sides = (mirrored[1], mirrored[1])
        cohesion = PiecewiseQuadratic.with_sides(mirrored[0], slopes, *sides, ends, self.cohesion.name)
        return replace(self, cohesion=cohesion)

    def _with_secant(self, opening: Array) -> tuple[Array, Array, Array]:
        """Knots rho > 0 (m, K + 1) with the secant up to openings (m,), slopes (m, K + 2), and Phi' at the knots."""
        knots, slopes = self._half
        rows = max(len(opening), len(knots))
        far = np.maximum(np.broadcast_to(opening, (rows,))[:, None], knots[:, :1])  # the first piece is straight
        secant = np.broadcast_to(self.secant_stiffness(opening), (rows,))[:, None]
        knots, tractions = (np.broadcast_to(part, (rows, knots.shape[1])) for part in (knots, self._tractions))
        slopes = np.broadcast_to(slopes, (rows, slopes.shape[1]))
        same = np.abs(knots - far) <= ROUNDED * far
        own = same.any(axis=1, keepdims=True)  # a knot where there is one already would have no piece
        far = np.where(own, np.max(np.where(same, knots, 0.0), axis=1, keepdims=True), far)
        more = np.where(own, 0.5 * knots[:, :1], far)
        order = np.argsort(np.concatenate([knots, more], axis=1), axis=1)
        at, pull = (
            np.take_along_axis(np.concatenate([part, last], axis=1), order, axis=1)
            for part, last in ((knots, more), (tractions, secant * more))
        )
        middle = 0.5 * (at + np.concatenate([np.zeros((rows, 1)), at[:, :-1]], axis=1))
        piece = (middle[:, :, None] > knots[:, None, :]).sum(axis=2)
        inside = np.where(middle < far, secant, np.take_along_axis(slopes, piece, axis=1))
        return at, np.concatenate([inside, np.zeros((rows, 1))], axis=1), np.where(at < far, secant * at, pull)

    # ---- value and subdifferential ----------------------------------------------------------------------

    def value(self, r: Array) -> Array:
        pushed = np.where(r[:, 0] > 0.0, self.compression.value(np.maximum(r[:, 0], 0.0)), 0.0)
        return np.asarray(pushed + self._table.value(self.effective(r)))

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        shut = level_places(np.zeros((1, 1)), start[:, 0], end[:, 0], bend[:, 0])
        ends = [np.column_stack([r[:, 0], self.beta[:, None] * r[:, 1:]]) for r in (start, end)]
        slips = [end_point[:, 1:] for end_point in ends]
        return np.concatenate([shut, length_places(self._half[0], *ends), length_places(self._half[0], *slips)], axis=1)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        out, law = self._gradient(r), self.compression
        interval = law.subdifferential(np.clip(r[:, 0], 0.0, law.domain.upper))
        push = np.clip(lam[:, 0], interval.lower, np.maximum(interval.lower, interval.upper))
        out[:, 0] = np.where(r[:, 0] < 0.0, out[:, 0], push)
        return out

    def clamp(self, start: Array, end: Array) -> Array:
        opens, piece, out = start[:, 0] < 0.0, self.piece_of(self.effective(start)), end.copy()
        out[:, 0] = np.where(opens, np.minimum(out[:, 0], 0.0), np.clip(out[:, 0], 0.0, self.compression.domain.upper))
        knots = self._half[0]
        zero, far = np.zeros((len(knots), 1)), np.full((len(knots), 1), np.inf)
        low = row_entries(np.concatenate([zero, knots], axis=1), piece)
        rho = self.effective(out)
        cut = np.clip(rho, low, row_entries(np.concatenate([knots, far], axis=1), piece))
        scale = np.where(cut == rho, 1.0, cut / np.where(rho > 0.0, rho, 1.0))
        out[:, 0] = np.where(opens, out[:, 0] * scale, out[:, 0])
        out[:, 1:] *= scale[:, None]
        return np.where(((rho == 0.0) & (low > 0.0))[:, None], start, out)

    def _gradient(self, r: Array) -> Array:
        """Derivatives (m, c) of the parts that are smooth at ``r (m, c)``, zero at kinks."""
        rho, law = self.effective(r), self.compression
        out = self.curve_on(rho, self.piece_of(rho))[0][:, None] * r
        out[:, 1:] *= (self.beta**2)[:, None]
        inside = np.clip(r[:, 0], 0.0, law.domain.upper)
        out[:, 0] = np.where(r[:, 0] < 0.0, out[:, 0], np.where(law.at_kink(inside), 0.0, law.derivative(inside)))
        return out

    def _bend(self, r: Array, piece: IntArray) -> Array:
        """Second derivative (m, c, c) on given pieces of rho, of the penetration as on its own piece."""
        opens, rho = r[:, 0] < 0.0, self.effective(r)
        secant, slope = self.curve_on(rho, piece)
        metric = np.ones(r.shape)
        metric[:, 1:] = (self.beta**2)[:, None]
        along = np.where(rho > 0.0, 1.0 / np.where(rho > 0.0, rho, 1.0), 0.0)[:, None] * metric * r
        along[:, 0] = np.where(opens, along[:, 0], 0.0)
        hessian = (slope - secant)[:, None, None] * along[:, :, None] * along[:, None, :]
        hessian += (secant[:, None] * metric)[:, :, None] * np.eye(r.shape[1])
        pushed = self.compression.curvature(np.maximum(r[:, 0], np.finfo(float).tiny))  # shut is pressed
        hessian[:, 0, 0] = np.where(opens, hessian[:, 0, 0], pushed)
        return hessian

    def linearise(self, r: Array) -> Linearisation:
        smooth = np.ones((len(r), 2), dtype=bool)
        smooth[:, 0] = ~self._at_hook(r)
        hessian = self._bend(r, self.piece_of(self.effective(r)))
        hessian[~smooth[:, 0], 0, :] = hessian[~smooth[:, 0], :, 0] = 0.0
        return Linearisation(smooth, self._gradient(r), hessian)

    # ---- far away ---------------------------------------------------------------------------------------

    def recession(self, direction: Array) -> Array:
        return np.where(direction[:, 0] > 0.0, self.compression.recession(np.maximum(direction[:, 0], 0.0)), 0.0)

    @property
    def growth(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        c0, c1 = self.compression.growth
        return (np.maximum(self.strength, c0), c1), (self.beta * self.strength, np.zeros(1))

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        up = steepest(self.compression, rest[:, 0], 1.0, size)
        opening, rho = np.maximum(-rest[:, 0], 0.0), self.effective(rest)
        down = steepest(self._table, rho, 1.0, size)
        if rest.shape[1] == 1:
            return up, down, np.zeros(len(rest))
        # sideways what is open turns only a part of Phi' into shear; opening and slip share one strength: each counts
        # by half
        far = np.maximum(rho, self.opening_at_break)
        after = rho[:, None] + (far - rho)[:, None] * _WAYS
        pull = np.stack([self._table.derivative(end) for end in after.T], axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.sqrt(np.maximum(1.0 - (opening[:, None] / after) ** 2, 0.0))
        share = np.where(after > 0.0, share, 1.0)
        slip = self.beta * np.where(far > rho, (pull * share).max(axis=1), 0.0)
        return up, 0.5 * down, 0.5 * slip

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self.compression.asymptotic_curvature(sign) if sign > 0.0 else np.zeros(1), np.zeros(1)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        fall = np.maximum(-self._half[1], 0.0).max(axis=1)
        return fall, np.asarray(fall * self.beta**2)

    @property
    def penetrations(self) -> Interval:
        return self.compression.domain

    @property
    def penetration_knots(self) -> Array:
        return np.concatenate([-self._half[0][:, ::-1], np.zeros((len(self._half[0]), 1))], axis=1)

    # ---- the local problem ------------------------------------------------------------------------------

    def local_argmin(self, a: Array, b: Array) -> Array:
        out = self._shut(a, b, None)
        opens = np.flatnonzero(b[:, 0] < 0.0)
        if opens.size and is_curve(self, a, b.shape[1]):
            problem = self._problem(opens, a, b)
            out[opens] = self._of_opening(opens, b, problem.places(problem.only()[:, None])[:, 0])
        elif opens.size:
            places, _, energies = self._opened(opens, a, b)
            best = np.argmin(np.where(np.isnan(energies), np.inf, energies), axis=1)
            out[opens] = self._of_opening(opens, b, places[np.arange(opens.size), best])
        return out

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        out = self._shut(a, b, r)
        opens = np.flatnonzero(b[:, 0] < 0.0)
        if not opens.size:
            return out
        places, rho, energies = self._opened(opens, a, b)
        problem, start = self._problem(opens, a, b), self.effective(r)[opens]
        valid = np.isfinite(energies)
        within = np.maximum(start, 1e-16 * problem.knots[:, 0])  # at rest the whole force pulls
        pull = problem.secant(within[:, None])[:, 0] * within
        rounding = (1e-13 * start)[:, None]
        after = np.where(valid & (rho >= start[:, None] - rounding), rho, np.inf)
        before = np.where(valid & (rho <= start[:, None] + rounding), rho, -np.inf)
        rises = self._table_at(opens).derivative(start) > pull
        beyond = start > problem.rho(np.zeros((opens.size, 1)))[:, 0]
        back = (rises | beyond) & np.isfinite(before.max(axis=1))
        chosen = np.where(back, np.argmax(before, axis=1), np.argmin(after, axis=1))
        out[opens] = self._of_opening(opens, b, places[np.arange(opens.size), chosen])
        lost = ~np.where(back, np.isfinite(before.max(axis=1)), np.isfinite(after.min(axis=1)))
        out[opens[lost]] = np.nan
        return out

    def _shut(self, a: Array, b: Array, r: Array | None) -> Array:
        """The minimiser where the force does not open, (m, c): penetration and slip are laws of their own there."""
        out = np.zeros(b.shape)
        rows = np.flatnonzero(~(b[:, 0] < 0.0))
        if not rows.size:
            return out
        tangential = self.tangential if len(self.tangential.breakpoints) == 1 else self.tangential.take(rows)
        compression = self.compression if self.compression.knots.shape[0] == 1 else self.compression.take(rows)
        a, b = a[rows], b[rows]
        out[rows, 0] = np.maximum(compression.local_argmin(a[:, 0], b[:, 0]), 0.0)
        if b.shape[1] > 1:
            size, heading = polar(b[:, 1:])
            if r is None:
                length = np.abs(tangential.local_argmin(a[:, 1], size))
            else:
                length = np.abs(local_minimiser(tangential, a[:, 1], size, lengths(r[rows, 1:])))
            heading[:, 0] = np.where(size > 0.0, heading[:, 0], 1.0)
            out[rows, 1:] = length[:, None] * heading
        return out

    def _problem(self, opens: IntArray, a: Array, b: Array) -> OpeningProblem:
        beta = np.broadcast_to(self.beta, (len(b),))[opens]
        pull = lengths(b[opens, 1:]) if b.shape[1] > 1 else np.zeros(opens.size)
        knots, slopes = self._half
        tables = [part if len(part) == 1 else part[opens] for part in (knots, self._tractions, slopes)]
        return OpeningProblem(
            np.stack([a[opens, 0], a[opens, 1] / beta**2], axis=1),
            np.stack([-b[opens, 0], pull / beta], axis=1),
            *(np.broadcast_to(part, (opens.size, part.shape[1])) for part in tables),
        )

    def _opened(self, opens: IntArray, a: Array, b: Array) -> tuple[Array, Array, Array]:
        """Opening and effective slip (n, k, 2) of all local minimisers, rho and energy (n, k)."""
        problem = self._problem(opens, a, b)
        secants = problem.minimisers()
        places = problem.places(secants)
        rho = np.hypot(places[..., 0], places[..., 1])
        far = ~np.isfinite(rho)
        rows, column = np.nonzero(np.isfinite(secants) & ~far)
        stored = np.zeros(rho.shape)
        stored[rows, column] = self._table_at(opens[rows]).value(rho[rows, column])
        with np.errstate(invalid="ignore"):
            work = (0.5 * problem.stiffness[:, None, :] * places**2 - problem.force[:, None, :] * places).sum(axis=2)
        return places, rho, np.where(np.isnan(secants), np.inf, np.where(far, -np.inf, work + stored))

    def _of_opening(self, opens: IntArray, b: Array, opening: Array) -> Array:
        """Local displacements (n, c) of an opening and an effective slip (n, 2)."""
        out = np.zeros((opens.size, b.shape[1]))
        out[:, 0] = -opening[:, 0]
        if b.shape[1] > 1:
            beta = np.broadcast_to(self.beta, (len(b),))[opens]
            out[:, 1:] = (opening[:, 1] / beta)[:, None] * polar(b[opens, 1:])[1]
        return np.where(np.isfinite(out), out, np.nan)

    # ---- where a pair lies ------------------------------------------------------------------------------

    def kinks(self, r: Array) -> tuple[Array, Array]:
        shut, none = np.zeros(len(r)), np.full(r[:, 1:].shape, np.nan)
        if not self.compression.knots.any():
            return shut, none
        knot = kink_within(self.compression, r[:, 0], np.inf)
        return np.where(np.isfinite(knot), knot, shut), none

    def _at_hook(self, r: Array) -> BoolArray:
        return self.compression.at_kink(r[:, 0])

    def moves(self, r: Array, small: float) -> BoolArray:
        """Which points slip: those whose glue is past its strength."""
        return np.asarray(self.effective(r) > self._peak * (1.0 + 1e-9))

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return np.asarray(self.effective(r) > self._peak * (1.0 + 1e-9))

    def debonding(self, r: Array) -> dict[str, Array]:
        return {"damage": self.damage(r), "dissipated": self.spent(r), "mode_ratio": self.mode_ratio(r)}

    def resistance(self, r: Array, lam: Array) -> Array:
        return np.where(self.effective(r) < self.opening_at_break, self.beta * self.strength, 0.0)


def stated_compression(law: Superpotential) -> tuple[bool, object]:
    """Whether problem files can state what a law does in penetration, and its stiffness there, None of a rigid one."""
    known = law.stated if law.name in ("signorini", "compliance") else None
    return known is not None, known and known.get("stiffness")


def row_entries(table: Array, index: IntArray) -> Array:
    """One entry of each row, (m,); a table of one row is that of all."""
    if len(table) == 1:
        return np.asarray(table[0].take(index))
    return np.take_along_axis(table, index[:, None], axis=1)[:, 0]


@named(
    LawKind.NORMAL,
    "mixed-mode",
    "glue with one effective opening of opening and slip and one fracture energy; includes friction",
    "j(r) = Phi(rho), rho = sqrt(<w>^2 + ratio^2 |s|^2), with the opening w = -r and the slip s",
)
@stating(
    TrapezoidalCohesion,
    MixedMode,
    shape=word("how the traction falls", "bilinear", "exponential", "trapezoidal"),
    compression=COMPRESSION,
)
def _by_values(
    strength: Parameter,
    energy: Parameter,
    stiffness: Parameter,
    ratio: Parameter = 1.0,
    shape: str = "bilinear",
    plateau: Parameter | None = None,
    compression: Parameter | None = None,
) -> MixedMode:
    stated = (strength, energy, stiffness)
    if (plateau is not None) != (shape == "trapezoidal"):
        raise ProblemError("law 'mixed-mode': the shape 'trapezoidal' needs a plateau, and no other one has any")
    cohesion: Superpotential
    match shape:
        case "trapezoidal":
            assert plateau is not None
            cohesion = TrapezoidalCohesion(*stated, plateau)
        case "exponential":
            cohesion = ExponentialCohesion(*stated)
        case "bilinear":
            cohesion = BilinearCohesion(*stated)
        case _:
            raise ProblemError(f"law 'mixed-mode' has no shape '{shape}'; take bilinear, exponential or trapezoidal")
    return MixedMode(cohesion, ratio, Signorini() if compression is None else Compliance(compression))
