"""A proximal bundle method that certifies its end point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from hemivar.basics.arguments import check_numbers
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, Friction, Interval, Superpotential, separable
from hemivar.laws.vector_law import splits
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.newton_on_graph import FEW_ROUNDS, NewtonCache, active_set_newton
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem

__all__ = ["CuttingPlanes", "ProximalBundle"]


@dataclass(frozen=True)
class ProximalBundle(Solver):
    """Proximal bundle method with one bundle for each contact point (disaggregated cutting planes).

    The elastic energy is kept exactly; of the laws it uses only values and one subgradient at the points visited.
    Each law is replaced by the largest of its cutting planes, a lower bound, and the model is minimised with a
    proximal term around the best point so far, whose weight fades with every serious step.

    Once the proximal term is gone, the method certifies its points.  With the model M <= E, a subgradient ``rho`` of M
    at r and both energies K-strongly convex, ``E(u*) >= M(r) - |rho| x + x^2/2`` and ``E(r) >= E(u*) + x^2/2`` for the
    error ``x = |u - u*|_K``, so that ``x <= (|rho| + sqrt(|rho|^2 + 4 (E(r) - M(r))))/2``, with ``|rho|`` in the K^-1
    norm.  It ends when this bound, relative to the size of u, is below ``tolerance``, and returns it as
    ``Solution.error_bound``.  Where only the foundation holds the body there is no such bound.

    Parameters
    ----------
    tolerance : float
        Relative bound of the error in the energy norm at which it ends.
    weight : float
        First proximal weight, in units of the diagonal stiffness.
    fading : float
        Factor of the weight after a serious step.
    descent : float
        Share of the predicted decrease that makes a step serious.
    planes : int
        Most cutting planes kept for each component of a contact point.
    """

    tolerance: float = 1e-8
    weight: float = 0.1
    fading: float = 0.1
    descent: float = 0.1
    planes: int = 40
    name: ClassVar[str] = "bundle"
    default_steps: ClassVar[int] = 200

    def __post_init__(self) -> None:
        check_numbers(self)
        if not (self.tolerance > 0.0 and self.weight >= 0.0 and 0.0 <= self.fading < 1.0 and 0.0 < self.descent < 1.0):
            raise ProblemError(
                "ProximalBundle needs tolerance > 0, weight >= 0, fading in [0, 1) and descent in (0, 1)"
            )
        if self.planes < 4:
            raise ProblemError(f"ProximalBundle needs at least 4 planes for each component, not {self.planes}")

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if problem.contact_points and any((alpha > 0.0).any() for alpha in problem.law.weak_convexity):
            return "the law is not convex, and cutting planes of a nonconvex law are not lower bounds; use newton"
        if not splits(problem.law):
            return f"{problem.law.not_separable}, which the model does not know; use newton"
        return None

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        m, d = system.shape
        reach = 10.0 * system.length_scale
        law = separable(system.law, self.name)
        normal = CuttingPlanes.around(law.normal, m, reach)
        tangential = CuttingPlanes.around(law.tangential, m, reach) if d > 1 else None
        memory = _Memory(normal, tangential, self.weight, start.r, system.energy(start.r))
        return replace(start, evaluations=1, memory=memory)

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        memory: _Memory = state.memory
        law = separable(system.law, self.name)
        normal = memory.normal.cut(law.normal, state.r[:, 0]).nearest(state.r[:, 0], self.planes)
        tangential = memory.tangential
        if tangential is not None:
            size = np.linalg.norm(state.r[:, 1:], axis=1)
            tangential = tangential.cut(law.tangential, size).cut(law.tangential, -size)
            tangential = tangential.nearest(size, self.planes)
        profile = Friction(1.0, tangential) if tangential is not None else Friction(0.0)
        model = ContactLaw(normal, profile)
        r, inner = _minimise_model(system, model, memory.weight, memory.centre, budget)
        above = normal.gap(law.normal, r[:, 0])
        if tangential is not None:
            above = above + tangential.gap(law.tangential, np.linalg.norm(r[:, 1:], axis=1))
        gap = float(system.weights @ above)
        energy = system.energy(r)
        # The model at r is the energy less the gap: predicted against true decrease from the centre.
        serious = memory.energy - energy >= self.descent * (memory.energy - energy + gap)
        weight = memory.weight
        bound, ended = None, None
        if weight == 0.0:
            bound = _error_bound(system, model, r, gap)
            certified = bound is not None and bound <= self.tolerance * system.energy_norm(r)
            ended = Status.CONVERGED if certified else None
        elif serious:
            weight = self.fading * weight if self.fading * weight > 1e-3 * self.weight else 0.0
        centre, best = (r, energy) if energy <= memory.energy else (memory.centre, memory.energy)
        return State(
            r,
            system.multiplier(r),
            state.evaluations + 1 + inner,
            ended,
            error_bound=bound,
            memory=_Memory(normal, tangential, weight, centre, best),
        )


@dataclass(frozen=True, eq=False)
class _Memory:
    normal: CuttingPlanes
    tangential: CuttingPlanes | None
    weight: float
    centre: Array
    energy: float


@dataclass(frozen=True, eq=False)
class CuttingPlanes(Superpotential):
    """The largest of some tangents of convex scalar laws, on the domain of these laws."""

    points: Array  # (m, count): tangents ``value + slope (r - point)``, ordered by their points
    values: Array  # (m, count)
    slopes: Array  # (m, count)
    ends: Interval  # domain, (m,)
    name: str = "cutting planes"
    examined = True

    @staticmethod
    def around(law: Superpotential, m: int, reach: float) -> CuttingPlanes:
        """Two tangents of each law, ``reach`` away from rest or at the end of its domain."""
        ends = Interval(np.broadcast_to(law.domain.lower, (m,)), np.broadcast_to(law.domain.upper, (m,)))
        rest = np.clip(np.zeros(m), ends.lower, ends.upper)
        none = np.empty((m, 0))
        planes = CuttingPlanes(none, none, none, ends)
        for side in (-reach, reach):
            planes = planes.cut(law, np.clip(rest + side, ends.lower, ends.upper))
        return planes

    def cut(self, law: Superpotential, r: Array) -> CuttingPlanes:
        """One more tangent for each law, at ``r (m,)``."""
        interval = law.subdifferential(r)
        # The middle, the finite end, or zero where any slope is a subgradient.
        bounded = np.isfinite(interval.lower) & np.isfinite(interval.upper)
        nearest = np.clip(0.0, interval.lower, interval.upper)
        slope = np.where(bounded, 0.5 * np.where(bounded, interval.lower + interval.upper, 0.0), nearest)
        new = (r, law.value(r), slope)
        old = (self.points, self.values, self.slopes)
        points, values, slopes = (np.concatenate([x, y[:, None]], axis=1) for x, y in zip(old, new, strict=True))
        return CuttingPlanes(points, values, slopes, self.ends)._pick(np.argsort(points, axis=1, kind="stable"))

    def gap(self, law: Superpotential, r: Array) -> Array:
        """Bound of how far the law lies above its tangents at ``r``, free of cancellation.

        A tangent at x with slope s lies at most ``(xi - s) (r - x)`` below the law at r, for any subgradient xi at r.
        """
        interval = law.subdifferential(r)
        plain = law.value(r) - self.value(r) + 4.0 * np.finfo(float).eps * np.abs(law.value(r))
        best = np.maximum(plain, 0.0)
        count = self.points.shape[1]
        ahead = np.sum(self.points < r[:, None], axis=1)
        rows = np.arange(len(r))
        for index in (np.maximum(ahead - 1, 0), np.minimum(ahead, count - 1)):
            away = r - self.points[rows, index]
            subgradient = np.where(away > 0.0, interval.lower, interval.upper)
            usable = np.isfinite(subgradient)
            bound = np.where(usable, subgradient - self.slopes[rows, index], np.inf) * np.where(usable, away, 1.0)
            best = np.minimum(best, np.maximum(bound, 0.0))
        return best

    def nearest(self, r: Array, limit: int) -> CuttingPlanes:
        """The ``limit`` tangents nearest to ``r``, and the two outermost."""
        if self.points.shape[1] <= limit:
            return self
        away = np.abs(self.points - r[:, None])
        away[:, [0, -1]] = -1.0
        keep = np.sort(np.argsort(away, axis=1, kind="stable")[:, :limit], axis=1)
        return self._pick(keep)

    def _pick(self, index: IntArray) -> CuttingPlanes:
        points, values, slopes = (np.take_along_axis(x, index, axis=1) for x in (self.points, self.values, self.slopes))
        return CuttingPlanes(points, values, slopes, self.ends)

    @cached_property
    def _pieces(self) -> tuple[Array, IntArray]:
        """Knots, where neighbouring tangents meet and at the ends of the domain; the tangent of each piece."""
        x, v, s = self.points, self.values, self.slopes
        bend = np.diff(s, axis=1)
        height = v - s * x
        real = bend > 1e-14 * np.abs(s).max(axis=1, initial=0.0)[:, None]
        meet = np.where(real, -np.diff(height, axis=1) / np.where(real, bend, 1.0), 0.5 * (x[:, 1:] + x[:, :-1]))
        meet = np.clip(meet, x[:, :-1], x[:, 1:])
        ends = np.stack([self.ends.lower, self.ends.upper], axis=1)
        knots = np.concatenate([meet, np.where(np.isfinite(ends), ends, np.inf)], axis=1)
        is_meet = np.concatenate([np.ones(meet.shape, dtype=np.int64), np.zeros(ends.shape, dtype=np.int64)], axis=1)
        order = np.argsort(knots, axis=1, kind="stable")
        passed = np.cumsum(np.take_along_axis(is_meet, order, axis=1), axis=1)
        first = np.zeros((len(x), 1), dtype=np.int64)
        return np.take_along_axis(knots, order, axis=1), np.concatenate([first, passed], axis=1)

    @cached_property
    def _tangents(self) -> tuple[Array, Array, Array]:
        """Points, values and slopes of the tangents that hold on each piece, (m, pieces) each."""
        of_piece = self._pieces[1]
        points, values, slopes = (
            np.take_along_axis(x, of_piece, axis=1) for x in (self.points, self.values, self.slopes)
        )
        return points, values, slopes

    def _on(self, piece: IntArray, table: Array) -> Array:
        if np.ndim(piece) == 0:
            column: Array = table[:, int(piece)]
            return column
        chosen: Array = table[np.arange(len(table)), np.broadcast_to(piece, (len(table),))]
        return chosen

    @property
    def knots(self) -> Array:
        return self._pieces[0]

    @cached_property
    def _knot_slopes(self) -> tuple[Array, Array]:
        knots, slopes = self.knots, self._tangents[2]
        finite = np.isfinite(knots)
        left = np.where(knots <= self.ends.lower[:, None], -np.inf, slopes[:, :-1])
        right = np.where(knots >= self.ends.upper[:, None], np.inf, slopes[:, 1:])
        return np.where(finite, left, 0.0), np.where(finite, right, 0.0)

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._knot_slopes

    @property
    def domain(self) -> Interval:
        return self.ends

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        points, values, slopes = self._tangents
        return self._on(piece, values) + self._on(piece, slopes) * (r - self._on(piece, points))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._on(piece, self._tangents[2])

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return np.zeros(len(self.points))

    @property
    def weak_convexity(self) -> Array:
        return np.zeros(1)

    @property
    def growth(self) -> tuple[Array, Array]:
        return np.abs(self.slopes).max(axis=1), np.zeros(len(self.points))

    def recession(self, sign: Array) -> Array:
        limited = np.where(sign > 0, np.isfinite(self.ends.upper), np.isfinite(self.ends.lower))
        rate = np.where(sign > 0, self.slopes[:, -1] * sign, np.where(sign < 0, self.slopes[:, 0] * sign, 0.0))
        return np.where(limited & (sign != 0), np.inf, rate)

    def at(self, points: Array | None) -> CuttingPlanes:
        return self

    def scaled(self, factor: Array | float) -> CuttingPlanes:
        column = np.reshape(np.atleast_1d(factor), (-1, 1))
        return CuttingPlanes(self.points, column * self.values, column * self.slopes, self.ends)

    def take(self, index: IntArray) -> CuttingPlanes:
        ends = Interval(self.ends.lower[index], self.ends.upper[index])
        return CuttingPlanes(self.points[index], self.values[index], self.slopes[index], ends)


def _error_bound(system: CondensedProblem, model: ContactLaw, r: Array, gap: float) -> float | None:
    """Bound of the energy-norm error at ``r``; None where only the foundation holds the body."""
    if len(system.rigid_modes):
        return None
    force = system.out_of_balance(r)
    lam = model.nearest_multiplier(r, force / system.weights[:, None])
    rest = (force - system.weights[:, None] * lam).ravel()[system.free]
    A = system.matrix[np.ix_(system.free, system.free)]
    square = float(rest @ la.solve(A, rest, assume_a="pos")) if rest.any() else 0.0
    return 0.5 * (float(np.sqrt(square)) + float(np.sqrt(square + 4.0 * gap)))


def _minimise_model(
    system: CondensedProblem, law: ContactLaw, weight: float, centre: Array, budget: Budget
) -> tuple[Array, int]:
    """Minimiser of the elastic energy, the cutting planes and the proximal term."""
    stiffness = weight * system.diagonal.ravel()
    stiffness[~system.active.ravel()] = 0.0
    model = replace(
        system,
        problem=system.problem.with_(law=law),
        matrix=system.matrix + np.diag(stiffness),
        load=system.load + stiffness * centre.ravel(),
    )
    inner = NonsmoothNewton()
    start = model.start(centre)
    state = inner.begin(model, State(start, model.multiplier(start)), budget)
    idle = 0
    for _ in range(60):
        budget.check()
        before = state.energy
        state = inner.step(model, state, budget)
        idle = idle + 1 if state.energy == before else 0
        if idle == 2 or model.residual(state.r, state.lam).below(0.0, 1e-15):
            break
    if weight == 0.0:  # energies tell points apart up to the root of rounding; from there on slopes do, up to rounding
        controls = Controls(atol=0.0, rtol=1e-13)
        exact = active_set_newton(model, state.r, state.lam, controls, NewtonCache(), rounds=FEW_ROUNDS)
        if exact is not None:
            return exact.local, state.evaluations + exact.evaluations
    return state.r, state.evaluations
