"""Laws of one's own that couple opening and slip: a potential of the penetration and of the length of the slip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.arrays import CACHED
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.coupled.local_search import descend
from hemivar.laws.coupled.plane_bounds import (
    best_ratio,
    check_plane_potential,
    least_eigenvalues,
    proved_alpha,
    sample_places,
    tiny,
)
from hemivar.laws.coupled.plane_potential import FormulaPotential, PlanePotential
from hemivar.laws.crossings import length_places
from hemivar.laws.parameters import checked_reach
from hemivar.laws.proof import SAMPLED, Constant, Evidence, Proof, beside, of_alpha
from hemivar.laws.superpotential import Interval
from hemivar.laws.vector_law import Linearisation, VectorLaw, polar

__all__ = ["OwnCoupledLaw"]

#: Part of the forces of a law that is none: what stands for zero, 1e-60 of the reach, makes no larger ones.
_NOTHING = 1e-40
#: Lines of the grid on which the minimisers of a local problem are looked for, to either side, and starts taken of it:
#: valleys narrower than a seventieth of the reach may be missed, as CoupledFormulaLaw says. With half as many of either
#: tests/laws/coupled find all.
_GRID, _STARTS = 70, 8
#: Lengths, as parts of the reach, at which growth far away is looked at: a slope that doubles from one to the next
#: grows without bound.
_FAR = (1e4, 1e6, 1e8)


@dataclass(frozen=True, eq=False)
class OwnCoupledLaw(VectorLaw):
    """``j(r) = f(r_nu, |r_tau|) - f(0, 0)``, the same at all contact points; see :func:`CoupledFormulaLaw`.

    Attributes
    ----------
    plane : PlanePotential
        f.
    reach : float
        Length up to which constants and minimisers are looked for.
    rigid : bool
        Whether nothing penetrates.
    name : str
    kinked : bool
        Whether the derivative by r jumps at r = 0.
    resting : bool
        Whether something resists the first slip.
    size : float
        Largest slope that was seen.
    stated : mapping or None
    """

    plane: PlanePotential
    reach: float
    rigid: bool
    name: str
    kinked: bool
    resting: bool
    size: float
    stated: Mapping[str, object] | None = None  # type: ignore[assignment]

    @classmethod
    def of(
        cls, plane: PlanePotential, reach: object, rigid: object, name: str, stated: Mapping[str, object] | None = None
    ) -> OwnCoupledLaw:
        """The law of a potential, which is checked first."""
        far = checked_reach(reach, f"law '{name}'")
        if not isinstance(rigid, bool | np.bool_):
            raise ProblemError(f"rigid of law '{name}' is {described(rigid)}; give True or False")
        if isinstance(plane, FormulaPotential):
            plane.refuse_pole(far, bool(rigid))
        return cls(plane, far, bool(rigid), name, *check_plane_potential(plane, far, bool(rigid)), stated)

    def at(self, points: Array | None) -> OwnCoupledLaw:
        return self

    def take(self, index: IntArray) -> OwnCoupledLaw:
        return self

    def describe(self, point: int = 0) -> str:
        """Kinks and constants, in words."""
        normal, tangential = (float(alpha[0]) for alpha in self.weak_convexity)
        how = f"shown by intervals up to r, s = {self.reach:g}" if self._alpha[2] else "sampled"
        shut = "rigid" if self.rigid else "as the potential gives"
        kinks = [text for text, there in (("r = 0", self.hooked), ("s = 0", self.resting)) if there]
        return "\n".join(
            (
                f"law {self.name}: j(r, s) = {self.plane.shown}",
                f"in penetration    {shut}",
                f"kinks             {' and '.join(kinks) or 'none'}",
                f"alpha             {normal:.6g} for r, {tangential:.6g} for s ({how})",
                f"reach             {self.reach:g}",
            )
        )

    # ---- the potential -----------------------------------------------------------------------------------

    def _nonzero(self, r: Array, s: Array, side: Array | float) -> tuple[Array, Array]:
        least = tiny(self.reach)
        return np.where(np.abs(r) < least, side * least, r), np.maximum(s, least)

    @cached_property
    def _at_zero(self) -> float:
        near = np.full(1, tiny(self.reach))
        return float(self.plane.value(-near, near)[0])

    def potential_at(self, r: Array, s: Array) -> Array:
        """j at penetrations and lengths of the slip; +inf outside the domain."""
        left, s = self._nonzero(r, s, -1.0)
        value = self.plane.value(np.minimum(left, 0.0) if self.rigid else left, s) - self._at_zero
        value = np.where(np.isnan(value), np.inf, value)
        return np.where(r > 0.0, np.inf, value) if self.rigid else value

    def slopes_at(self, r: Array, s: Array, side: Array | float) -> tuple[Array, Array]:
        """f_r and f_s, at r = 0 those of a side; what stands for zero there makes no force."""
        slopes = self.plane.gradient(*self._nonzero(r, s, -1.0 if self.rigid else side))
        by_r, by_s = (np.where(np.abs(slope) <= _NOTHING * self.size, 0.0, slope) for slope in slopes)
        return by_r, by_s

    def bends_at(self, r: Array, s: Array, side: Array | float) -> tuple[Array, Array, Array]:
        """f_rr, f_rs and f_ss, at r = 0 those of a side."""
        return self.plane.hessian(*self._nonzero(r, s, -1.0 if self.rigid else side))

    @property
    def hooked(self) -> bool:
        """Whether r = 0 is a kink."""
        return self.kinked or self.rigid

    @cached_property
    def _samples(self) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        places = sample_places(self.reach, self.rigid, 121)
        return places, self.plane.hessian(*places)

    @cached_property
    def _alpha(self) -> tuple[float, float, bool]:
        """alpha of r and of s, and whether they are proved up to the reach."""
        hessian = self._samples[1]
        ratio = best_ratio(hessian)
        seen = max(0.0, -float(least_eigenvalues(hessian, ratio).min()))
        if seen <= 1e-12 * max(float(np.abs(part).max()) for part in (hessian[0], hessian[2] / ratio**2)):
            seen = 0.0
        if isinstance(self.plane, FormulaPotential):
            bound = proved_alpha(self.plane, self.reach, self.rigid, ratio, seen)
            if bound < np.inf:
                return bound, ratio**2 * bound, True
        return seen, ratio**2 * seen, False

    # ---- value and subdifferential -----------------------------------------------------------------------

    @staticmethod
    def split(r: Array) -> tuple[Array, Array, Array]:
        """Penetration, length of the slip and its direction."""
        if r.shape[1] == 1:
            return r[:, 0], np.zeros(len(r)), np.zeros((len(r), 0))
        size, heading = polar(r[:, 1:])
        return r[:, 0], size, heading

    def value(self, r: Array) -> Array:
        return self.potential_at(*self.split(r)[:2])

    def clamp(self, start: Array, end: Array) -> Array:
        out = end.copy()
        if self.hooked:  # r = 0 counts as penetration: there is contact
            out[:, 0] = np.where(start[:, 0] >= 0.0, np.maximum(out[:, 0], 0.0), np.minimum(out[:, 0], 0.0))
        if self.rigid:
            out[:, 0] = np.minimum(out[:, 0], 0.0)
        if self.resting:
            out[np.einsum("mi,mi->m", start[:, 1:], end[:, 1:]) <= 0.0, 1:] = 0.0
        return out

    def _gradient(self, r: Array) -> Array:
        """Derivatives (m, c) of the parts that are smooth at ``r (m, c)``, zero at kinks."""
        normal, size, heading = self.split(self.admissible(r))
        side = np.where((normal > 0.0) | (self.hooked & (normal == 0.0)), 1.0, -1.0)
        by_r, by_s = self.slopes_at(normal, size, side)
        kink = (normal == 0.0) & self.hooked
        return np.concatenate([np.where(kink, 0.0, by_r)[:, None], by_s[:, None] * heading], axis=1)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        inside = self.admissible(r)
        normal, size, heading = self.split(inside)
        by_r, by_s = self.slopes_at(normal, size, np.where(normal > 0.0, 1.0, -1.0))
        out = np.concatenate([by_r[:, None], by_s[:, None] * heading], axis=1)
        hook = self._at_hook(inside)
        if hook.any():
            above = np.inf if self.rigid else self.slopes_at(normal, size, np.ones(len(normal)))[0]
            out[:, 0] = np.where(hook, np.clip(lam[:, 0], by_r, np.maximum(by_r, above)), by_r)
        if lam.shape[1] > 1:
            pull, along = polar(lam[:, 1:])
            rest = np.minimum(pull, np.maximum(by_s, 0.0))[:, None] * along
            out[:, 1:] = np.where(self._at_rest(r)[:, None], rest, out[:, 1:])
        return out

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        shut = super().kinks_along(start, end, bend)
        return np.concatenate([shut, length_places(np.zeros((1, 1)), start[:, 1:], end[:, 1:])], axis=1)

    def kinks(self, r: Array) -> tuple[Array, Array]:
        none = np.full(r.shape, np.nan)
        return (none if not self.hooked else 0.0 * r)[:, 0], (none if not self.resting else 0.0 * r)[:, 1:]

    def graph_distance_bracket(self, r: Array, lam: Array, tau: Array) -> tuple[Array, Array]:
        """Between what the distance to the graph lies, (m,) each, for displacements within the reach.

        The gradient changes by no more than H per length (H from samples of the second derivative), so that no pair is
        nearer than ``graph_distance / (1 + H tau)``.
        """
        rr, rs, ss = self._samples[1]
        steep = float(np.max(0.5 * np.abs(rr + ss) + np.hypot(0.5 * (rr - ss), rs)))
        high = self.graph_distance(r, lam, tau)
        return high / (1.0 + steep * tau.max(axis=1)), high

    def linearise(self, r: Array) -> Linearisation:
        c = r.shape[1]
        smooth = np.ones((len(r), 2), dtype=bool)
        smooth[:, 0] = ~self._at_hook(r)
        smooth[:, 1] = ~self._at_rest(r)
        keep = smooth[:, [0, *[1] * (c - 1)]]
        hessian = self.hessian(r) * (keep[:, :, None] & keep[:, None, :])
        return Linearisation(smooth, self._gradient(r), hessian)

    def hessian(self, r: Array, side: Array | None = None) -> Array:
        """Second derivative (m, c, c); at r = 0 that of a side, by default the one of opening."""
        normal, size, heading = self.split(r)
        side = np.where(normal > 0.0, 1.0, -1.0) if side is None else side
        rr, rs, ss = self.bends_at(normal, size, side)
        out = np.zeros((*r.shape, r.shape[1]))
        out[:, 0, 0] = rr
        if r.shape[1] > 1:
            slope = self.slopes_at(normal, size, side)[1]
            across = np.where(size > 0.0, slope / np.where(size > 0.0, size, 1.0), ss)
            out[:, 0, 1:] = out[:, 1:, 0] = np.where(size > 0.0, rs, 0.0)[:, None] * heading
            out[:, 1:, 1:] = (ss - across)[:, None, None] * heading[:, :, None] * heading[:, None, :]
            out[:, 1:, 1:] += across[:, None, None] * np.eye(r.shape[1] - 1)
        return out

    def _at_rest(self, r: Array) -> BoolArray:
        return np.asarray(~r[:, 1:].any(axis=1) & self.resting)

    # ---- the local problem -------------------------------------------------------------------------------

    @cached_property
    def _grid(self) -> tuple[Array, Array, Array]:
        """Penetrations (k,), slips (n,) and j (k, n) there."""
        half = np.unique(np.concatenate([np.linspace(0.0, 1.0, _GRID // 2), np.geomspace(1e-4, 1.0, _GRID // 2)]))
        slip = self.reach * half
        r = -slip[::-1] if self.rigid else np.concatenate([-slip[:0:-1], slip])
        at = np.meshgrid(r, slip, indexing="ij")
        return r, slip, self.potential_at(*(part.ravel() for part in at)).reshape(at[0].shape)

    def local_argmin(self, a: Array, b: Array) -> Array:
        flat, force, heading = self._plane_problem(a, b)
        free = force / flat
        if self.rigid:
            free[:, 0] = np.minimum(free[:, 0], 0.0)
        normal, tangential, _ = self._alpha
        x = descend(self, flat, force, free)
        sure = (flat > 1.000001 * np.array([normal, tangential])).all(axis=1)
        sure &= (np.abs(x) <= self.reach).all(axis=1)  # elsewhere nothing is known of the convexity
        rows = np.flatnonzero(~sure)
        together = max(1, CACHED // self._grid[2].size)
        for start in range(0, rows.size, together):
            some = rows[start : start + together]
            x[some] = self._searched(flat[some], force[some], x[some])
        return self._vector(x, heading)

    def _searched(self, a: Array, b: Array, x: Array) -> Array:
        """The lowest of the minimisers that the lowest valleys of a grid lead to, and of the one that is known."""
        r, s, stored = self._grid
        energy = stored[None] + (0.5 * a[:, 0, None] * r**2 - b[:, 0, None] * r)[:, :, None]
        energy = energy + (0.5 * a[:, 1, None] * s**2 - b[:, 1, None] * s)[:, None, :]
        padded = np.pad(energy, ((0, 0), (1, 1), (1, 1)), constant_values=np.inf)
        low = np.isfinite(energy)
        for i, k in ((0, 1), (2, 1), (1, 0), (1, 2)):
            low &= energy <= padded[:, i : i + r.size, k : k + s.size]
        valley = np.where(low, energy, np.inf).reshape(len(a), -1)
        best = np.argsort(valley, axis=1)[:, :_STARTS]
        used = np.isfinite(np.take_along_axis(valley, best, axis=1))
        row, column = np.nonzero(used)
        node = best[row, column]
        starts = np.concatenate([np.column_stack([r[node // s.size], s[node % s.size]]), x, np.zeros(x.shape)])
        owner = np.concatenate([row, np.arange(len(a)), np.arange(len(a))])
        ends = descend(self, a[owner], b[owner], starts)
        energies = (0.5 * a[owner] * ends**2 - b[owner] * ends).sum(axis=1) + self.potential_at(ends[:, 0], ends[:, 1])
        order = np.lexsort((np.where(np.isnan(energies), np.inf, energies), owner))
        _, first = np.unique(owner[order], return_index=True)
        return ends[order[first]]

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        flat, force, heading = self._plane_problem(a, b)
        normal, size, own = self.split(self.admissible(r))
        if r.shape[1] > 1:
            still = ~heading.any(axis=1)
            heading[still] = own[still]
        return self._vector(descend(self, flat, force, np.column_stack([normal, size])), heading)

    @staticmethod
    def _plane_problem(a: Array, b: Array) -> tuple[Array, Array, Array]:
        """Stiffness (m, 2), force (m, 2) and the direction of the slip (m, c - 1), along the force."""
        if b.shape[1] == 1:
            return np.column_stack([a[:, 0], np.ones(len(a))]), np.column_stack([b[:, 0], np.zeros(len(b))]), b[:, 1:]
        pull, heading = polar(b[:, 1:])
        return np.array(a[:, :2], dtype=float), np.column_stack([b[:, 0], pull]), heading

    @staticmethod
    def _vector(x: Array, heading: Array) -> Array:
        if heading.shape[1] and (still := (x[:, 1] > 0.0) & ~heading.any(axis=1)).any():
            heading = heading.copy()
            heading[still, 0] = 1.0
        return np.concatenate([x[:, :1], x[:, 1:] * heading], axis=1)

    # ---- far away ----------------------------------------------------------------------------------------

    def _growth(self, r: float, s: float) -> float:
        """Growth per length along a direction, from slopes far away."""
        far = self.reach * np.array(_FAR)
        with np.errstate(all="ignore"):
            by_r, by_s = self.slopes_at(r * far, s * far, 1.0 if r > 0.0 else -1.0)
            slope = r * by_r + s * by_s
        if not np.isfinite(slope).all():
            return np.inf if self.potential_at(far[-1:] * r, far[-1:] * s)[0] > 0.0 else -np.inf
        near, last = float(slope[1]), float(slope[2])
        if abs(last) <= 1e-3 * self.size and abs(last) <= abs(near):
            return 0.0
        return last if abs(last - near) <= 0.5 * abs(near) else float(np.copysign(np.inf, last))

    def recession(self, direction: Array) -> Array:
        normal, size, _ = self.split(direction)
        directions, back = np.unique(np.column_stack([normal, size]), axis=0, return_inverse=True)
        grown = [np.inf if self.rigid and r > 0.0 else self._growth(r, s) for r, s in directions.tolist()]
        return np.array(grown)[back.ravel()]

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        far = self.reach * np.array(_FAR[:2])
        zero = np.zeros(far.size)
        with np.errstate(all="ignore"):
            normal = self.bends_at(sign * far, zero, sign)[0] if not (self.rigid and sign > 0.0) else zero
            tangential = self.bends_at(zero, far, -1.0)[2]
        return tuple(np.array([float(np.nan_to_num(part).min())]) for part in (normal, tangential))  # type: ignore[return-value]

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        return super().strongest(self.admissible(rest), max(size, self.reach))

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return np.array([self._alpha[0]]), np.array([self._alpha[1]])

    def proof(self, constant: Constant) -> Proof:
        if constant != "alpha":
            return super().proof(constant)
        known = Proof(Evidence.BY_INTERVALS, (self.reach,)) if self._alpha[2] else SAMPLED
        return of_alpha(beside(known, known), lambda part: self.weak_convexity[part])

    @property
    def penetrations(self) -> Interval:
        return Interval(np.array([-np.inf]), np.array([0.0 if self.rigid else np.inf]))

    @cached_property
    def rubs(self) -> BoolArray:
        """Whether the slip meets any force, (1,)."""
        r, s = self._samples[0]
        return np.array([bool((np.abs(self.plane.gradient(r, s)[1]) > 1e-12 * self.size).any())])

    # ---- where a pair lies -------------------------------------------------------------------------------

    def _at_hook(self, r: Array) -> BoolArray:
        return np.asarray((r[:, 0] == 0.0) & self.hooked)

    def resistance(self, r: Array, lam: Array) -> Array:
        normal, _, _ = self.split(self.admissible(r))
        slip = self._grid[1]
        at = np.broadcast_arrays(normal[:, None], slip[None, :])
        slope = self.slopes_at(at[0].ravel(), at[1].ravel(), -1.0)[1].reshape(at[0].shape).max(axis=1)
        return np.where(slope > 1e-9 * self.size, slope, 0.0)
