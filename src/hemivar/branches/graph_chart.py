"""The graphs of contact laws in Minty's parametrisation: any law, in the plane and in space, coupled or not.

With a stiffness a above the weak convexity of the law, ``theta = r + lambda/a`` tells the pair of a contact point: the
graph is a Lipschitz map ``theta -> r, lambda``, and equilibrium is

    F(theta, t) = A r(theta) + W lambda(theta) - g(t) = 0,

smooth but for corners, where theta passes from one piece of a law to the next.  Nothing is known of the pieces but what
the law says of pairs: at a corner the derivative jumps by ``b n'``, where n is the normal of the corner in theta.
Components that a support holds are a part of it: a stiff spring pulls their r to where it is held.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg as la

from hemivar.basics.first_use import cached_property
from hemivar.basics.last_used import Recent
from hemivar.basics.types import AnyArray, Array, BoolArray, IntArray
from hemivar.errors import MethodError
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import Chart, curve_above_at, is_curve, spread
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.curves import Curves, negative_eigenvalues

__all__ = ["BESIDE", "FREE", "STRAIGHT", "Corner", "GraphChart", "chart_of"]

#: Difference of dr/dtheta, which is of size one, that is none: a piece is straight. 1e-7 and 1e-9 give the
#: same paths in tests/branches.
STRAIGHT = 1e-8
#: How much stiffer than the body the spring is that stands for a support: what it yields is next to rounding. 1e11 and
#: 1e13 give the same paths in tests/branches; from 1e16 on the body is rounding beside it.
_STIFF = 1e12
#: Distance from a corner, relative to the length, at which its sides are evaluated. It is above the distance to which a
#: corner is found, and two corners must be farther apart. 1e-6 and 1e-8 give the same paths in tests/branches.
BESIDE = 1e-7
#: How near the first corner on an increment is found, relative to the length; at 2.5 of it it is seen whether a
#: derivative jumps. Ten times more and less give the same paths in tests/branches; it must stay below BESIDE.
_NEAR = 2e-9
#: Part of the length that is rounding of theta. 1e-11 and 1e-13 give the same paths in tests/branches.
_ROUNDED = 1e-12
#: A jump of dr/dtheta that counts as a corner; a smaller one is a bend. 1e-3 and 1e-5 give the same paths in
#: tests/branches.
_JUMP = 1e-4
#: Rounding of dr/dtheta at most, however far theta goes: far below a jump. 1e-4 and 1e-6 give the same paths in
#: tests/branches.
_FAR_AWAY = 1e-5
#: Part of the stiffness that resists no motion: rounding of a dense matrix. 1e-12 and 1e-14 give the same stability of
#: all points in tests/branches.
_NEUTRAL = 1e-13
#: Part of the stiffness below which nothing but contact holds a body. 1e-8 and 1e-10 give the same paths in
#: tests/branches.
FREE = 1e-9
#: Pairs that are remembered: the halves of an increment, nine of them, and what the corrector asks for beside them.
_KEPT = 16
#: Second singular value of a jump, relative to the first one, above which two corners meet and it has no normal. 1e-2
#: and 1e-4 give the same paths in tests/branches.
_NO_NORMAL = 1e-3
#: How far a is above the weak convexity at first: above one the graph is Lipschitz in theta, and at two with the
#: constant 2; a chart that was not enough is followed by one four times as stiff.
_ABOVE = 2.0
#: How far a has to stay above the weak convexity, so that the constant is 6 at most; else the next chart is taken.
_ENOUGH = 1.2


@dataclass(frozen=True, eq=False)
class Corner:
    """Where contact points pass from one piece of their law to the next, along a straight way in theta."""

    part: float  # of the way
    point: IntArray  # (k,)
    normal: Array  # (k, c), unit vectors in theta, along the way

    @property
    def bends(self) -> bool:
        """Whether no derivative jumps there: the law is curved."""
        return self.point.size == 0


@dataclass(frozen=True, eq=False)
class GraphChart(Curves):
    """The graphs of all contact points, in one chart; a ``segment`` is a small vector (n,) into a piece."""

    system: CondensedProblem
    a: Array  # (m, 2): stiffness (force per area and length) of the chart, normal and tangential
    first: Array  # (m, c): where the path begins, in the chart of its own stiffness

    @property
    def law(self) -> VectorLaw:
        """The contact law."""
        return self.system.law

    @property
    def size(self) -> int:
        return self.system.active.size

    @cached_property
    def length(self) -> float:
        """A typical displacement under the load; gaps do not count, for points far away may never close theirs."""
        free, moved = self.system.free, self.system.displaced
        supported = self.system.matrix + np.diag(self._springs)
        u = la.solve(supported[np.ix_(free, free)], moved.load[free], assume_a="pos") if free.size else moved.load[free]
        fixed = np.where(moved.active, 0.0, self.system.fixed + self.system.problem.offset)
        size = max(float(np.abs(u).max(initial=0.0)), float(np.abs(fixed).max(initial=0.0)))
        return size if size > 0.0 else self.system.length_scale

    @cached_property
    def _springs(self) -> Array:
        """Stiffness (n,) that holds a body for the estimate of its displacement: where nothing else does, the law's."""
        free, size = self.system.free, self.system.diagonal.ravel()
        scale = np.sqrt(size[free])
        scaled = self.system.matrix[np.ix_(free, free)] / scale[:, None] / scale
        if not free.size or la.eigvalsh(scaled, subset_by_index=[0, 0])[0] > FREE:
            return 1e-3 * size
        slope = np.diagonal(self.pairs(self.first.ravel())[2], axis1=1, axis2=2).clip(0.0, 1.0)
        law = np.minimum(1.0, (1.0 - slope) / np.maximum(slope, 1e-300))
        return np.asarray(np.maximum(1e-3 * size, self._weighed * law.ravel()))

    @property
    def weights(self) -> Array:
        """Weight of each contact point, (m,)."""
        return self.system.weights

    @cached_property
    def here(self) -> Array:
        """No side is meant."""
        return np.zeros(self.size)

    @cached_property
    def stiffness(self) -> Array:
        """a for each component, (m, c)."""
        return spread(self.a, self.system.shape[1])

    @cached_property
    def matrix(self) -> Array:
        """A, with the springs of held components, which are one of the weighed law beside the other rows, (n, n)."""
        fixed = ~self.system.active.ravel()
        return np.asarray(self.system.matrix + np.diag(np.where(fixed, self._weighed, 0.0)))

    @cached_property
    def _weighed(self) -> Array:
        return (self.system.weights[:, None] * self.stiffness).ravel()

    @cached_property
    def _weight(self) -> Array:
        """Of each component, (m, c); that of held ones is next to nothing beside their springs."""
        weight = np.repeat(self.system.weights[:, None], self.system.shape[1], axis=1)
        return np.where(self.system.active, weight, weight / _STIFF)

    def load_of(self, system: CondensedProblem) -> Array:
        fixed = ~self.system.active.ravel()
        return np.where(fixed, self._weighed * system.fixed.ravel(), system.load)

    # ---- pairs ------------------------------------------------------------------------------------------

    def pairs(self, theta: Array) -> tuple[Array, Array, Array]:
        """r, lambda (m, c) and dr/dtheta (m, c, c)."""
        return self._known.once(theta.tobytes(), lambda: self._pairs_of(theta, np.arange(len(self.a))))

    def _pairs_of(self, theta: Array, index: IntArray) -> tuple[Array, Array, Array]:
        """Those of some contact points."""
        stiffness = self.stiffness[index]
        on = self._charts.once(index.tobytes(), lambda: self._chart_of(index)).at(
            stiffness * theta.reshape(stiffness.shape)
        )
        return on.r, on.multiplier, on.jacobian * stiffness[:, None, :]

    def _chart_of(self, index: IntArray) -> Chart:
        every = index.size == len(self.a) and bool((index == np.arange(index.size)).all())
        law, a, c = self.law if every else self.law.take(index), self.a[index], self.system.shape[1]
        laid_out = is_curve(law, a, c) and not law.state_dependent  # at the apex of a cone tables take another side
        return (law.chart(a, c) if laid_out else None) or Chart(law, a)

    @cached_property
    def _known(self) -> Recent[bytes, tuple[Array, Array, Array]]:
        return Recent(_KEPT)

    @cached_property
    def _charts(self) -> Recent[bytes, Chart]:
        return Recent(6)  # of all points, of the rows evaluated together, and of single ones

    def look_up(self, thetas: Array) -> None:
        """Evaluate pairs at thetas (k, n) together."""
        r, lam, slope = self._pairs_at(thetas)
        for i, theta in enumerate(thetas):
            self._known.once(theta.tobytes(), partial(tuple, (r[i], lam[i], slope[i])))

    def slopes(self, theta: Array, side: Array) -> Array:
        """dr/dtheta (m, c, c) on a side."""
        return self.pairs(theta + side)[2]

    def pair_of(self, j: int, theta: Array) -> Array:
        """dr/dtheta (k, c, c) of one contact point at thetas (k, c)."""
        index = np.full(len(theta), j)
        return self._pairs_of(theta, index)[2]

    def nearest(self, r: Array, lam: Array) -> tuple[Array, Array]:
        return (r + lam / self.stiffness).ravel(), self.here

    def local(self, theta: Array, side: Array) -> tuple[Array, Array]:
        r, lam, _ = self.pairs(theta)
        return r, lam

    def every_local(self, theta: list[Array], segments: list[AnyArray]) -> tuple[Array, Array]:
        some = 100  # whose pairs are evaluated together
        parts = [self._pairs_at(np.array(theta[i : i + some])) for i in range(0, len(theta), some)]
        return np.concatenate([r for r, _, _ in parts]), np.concatenate([lam for _, lam, _ in parts])

    def _pairs_at(self, theta: Array) -> tuple[Array, ...]:
        """r, lambda (k, m, c) and dr/dtheta (k, m, c, c) at thetas (k, n)."""
        index = np.tile(np.arange(self.system.shape[0]), len(theta))
        pairs = self._pairs_of(theta, index)
        return tuple(part.reshape(len(theta), -1, *part.shape[1:]) for part in pairs)

    def inside(self, theta: Array, side: Array, tolerance: float) -> BoolArray:
        return np.ones(theta.size, dtype=bool)

    def between(self, segment: Array) -> Array:
        return self.here

    def covers(self, theta: Array) -> bool:
        """Whether a place is on one chart: a is enough for the law there, whose bound may depend on the state."""
        if not self.law.state_dependent or self.law.depends_on_whole_state:
            return True
        r, lam = self.local(theta, self.here)
        return bool((self.a > _ENOUGH * _least(self.law, r, lam)).all())

    # ---- balance ----------------------------------------------------------------------------------------

    def balance(self, theta: Array, side: Array, force: Array) -> tuple[Array, Array]:
        return self.out_of_balance(theta, side, force), self._jacobian(self.slopes(theta, side))

    def out_of_balance(self, theta: Array, side: Array, force: Array) -> Array:
        r, lam, _ = self.pairs(theta)
        return np.asarray(self.matrix @ r.ravel() + self._weight.ravel() * lam.ravel() - force)

    def _jacobian(self, slope: Array) -> Array:
        """dF/dtheta for dr/dtheta (m, c, c)."""
        m, c = self.system.shape
        some = np.flatnonzero(slope.any(axis=(1, 2)))  # at the others nothing but the chart is left
        own = (self._weight * self.stiffness)[:, :, None] * (np.eye(c) - slope)
        transposed, every = np.zeros((m, c, m, c)), np.arange(m)
        transposed[every, :, every, :] = own.transpose(0, 2, 1)
        rows = self.matrix.reshape(m, c, -1)[some]  # which are its columns
        transposed.reshape(m, c, -1)[some] += np.matmul(slope[some].transpose(0, 2, 1), rows)
        return transposed.reshape(self.size, -1).T

    def moving(self, theta: Array, side: Array) -> BoolArray:
        return np.asarray(self.slopes(theta, side).any(axis=1).ravel())

    def forces(self, theta: Array, side: Array, force: Array) -> Array:
        r, lam, _ = self.pairs(theta)
        weighed = np.abs(self._weight * lam).ravel()
        return np.asarray(np.abs(force) + self._sizes @ np.abs(r).ravel() + weighed)

    @cached_property
    def _sizes(self) -> Array:
        return np.abs(self.matrix)

    # ---- stability --------------------------------------------------------------------------------------

    def negative(self, theta: Array, side: Array) -> int:
        slope = self.slopes(theta, side)
        if self.law.state_dependent:
            return self._falling_modes(slope)
        return negative_eigenvalues(self._hessian(slope))

    def _falling_modes(self, slope: Array) -> int:
        """Eigenvalues with a negative real part of the tangent, which is not symmetric."""
        m, c = self.system.shape
        own, every, stiff = np.zeros((m, c, m, c)), np.arange(m), self._jacobian(slope)
        own[every, :, every, :] = slope
        whole = own.reshape(self.size, -1)
        moves, felt = (np.asarray(whole.any(axis=k)) for k in (1, 0))
        if not (felt & ~moves).any() and _resists(_by_blocks(stiff.T, slope).T[np.ix_(moves, moves)]):
            return 0
        flexible = _flexibilities(stiff, self._weight.ravel()[:, None] * whole, moves)
        return int((flexible.real < -1e-10 * np.abs(flexible).max(initial=0.0)).sum())

    def _moving(self, slope: Array) -> tuple[Array, Array]:
        """Flexibilities d (m, c) of each law with its chart, held components apart, and their axes (m, c, c)."""
        flexible = slope / self.stiffness[:, None, :]
        fixed = ~self.system.active
        if fixed.any():
            masked = flexible * (fixed[:, :, None] & fixed[:, None, :])
            flexible = flexible - flexible @ np.linalg.pinv(masked, rcond=1e-12, hermitian=True) @ flexible
            flexible = np.where(fixed[:, :, None] | fixed[:, None, :], 0.0, flexible)
        d, axes = np.linalg.eigh(0.5 * (flexible + flexible.transpose(0, 2, 1)))
        return d, axes

    def _hessian(self, slope: Array) -> Array:
        """Second derivative of the energy in the directions in which the contact points move."""
        c = self.system.shape[1]
        d, axes = self._moving(slope)
        moves = d * self.stiffness.max(axis=1, keepdims=True) > 1e-11
        some = np.flatnonzero(moves.any(axis=1))
        d, axes, moving = d[some], axes[some], moves[some].ravel()
        rows = (some[:, None] * c + np.arange(c)).ravel()
        whole = self._softened[np.ix_(rows, rows)]
        half = np.matmul(axes.transpose(0, 2, 1), whole.reshape(some.size, c, rows.size)).reshape(whole.shape)
        H = _by_blocks(half, axes)[np.ix_(moving, moving)]
        weights = np.repeat(self.system.weights[some], c)[moving]
        H[np.diag_indices(len(H))] += weights / d.ravel()[moving]
        return np.asarray(H)

    @cached_property
    def _softened(self) -> Array:
        """The matrix of the body without the stiffness of the chart."""
        return np.asarray(self.system.matrix - np.diag(self._weighed))

    def falls_beside(self, theta: Array, side: Array) -> Array:
        d, axes = self._moving(self.slopes(theta, side))
        least = 1e-9 / self.stiffness.max(axis=1, keepdims=True)
        law = np.matmul(axes / np.maximum(d, least)[:, None, :], axes.transpose(0, 2, 1))
        law = law - self.stiffness[:, :, None] * np.eye(self.system.shape[1])
        body = self.system.blocks + np.where(self.system.active, 0.0, self.stiffness)[:, :, None] * np.eye(len(law[0]))
        inverse = np.linalg.inv(np.linalg.cholesky(body))
        return np.asarray(-np.linalg.eigvalsh(inverse @ law @ inverse.transpose(0, 2, 1))[:, 0])

    # ---- corners ----------------------------------------------------------------------------------------

    def angles(self, slope: Array, jump: Array) -> Array:
        """Sines (m,) of the angles by which graphs turn, in r and lambda times the compliance of the body.

        On a stiff chart dr/dtheta (m, c, c) hardly changes where a law does that is soft beside the chart.
        """
        eye, scale = np.eye(self.system.shape[1]), self._stiffer[:, :, None]
        after = slope + jump
        moved, answered = scale * (eye - after), np.matmul(slope, 1.0 / scale * eye)
        begin = np.matmul(answered, answered.transpose(0, 2, 1)) + np.matmul(
            eye - slope, (eye - slope).transpose(0, 2, 1)
        )
        end = np.matmul(after.transpose(0, 2, 1), after) + np.matmul(moved.transpose(0, 2, 1), moved)
        turned = np.matmul(np.linalg.solve(begin, jump), np.linalg.solve(end, jump.transpose(0, 2, 1)))
        return np.asarray(np.sqrt(np.trace(turned, axis1=1, axis2=2).clip(0.0)))

    @cached_property
    def _stiffer(self) -> Array:
        """How much stiffer the chart is than the body at a point, (m, c)."""
        return self.stiffness * spread(self.system.compliance, self.system.shape[1])

    def straight(self, theta: Array, side: Array, increment: Array) -> bool:
        """Whether no law is curved between ``theta`` and ``theta + increment``, nor has a corner there."""
        return not _Start.of(self, theta, side, increment, STRAIGHT).left(1.0).any()

    def leaves(self, theta: Array, side: Array, increment: Array, slack: float, parts: int = 0) -> Corner | None:
        """The first corner of a straight way, or where derivatives differ by more than the slack.

        It is looked for at the end, ``theta + increment``, and at so many halves of the way from there.
        """
        start, halves = _Start.of(self, theta, side, increment, slack), 0.5 ** np.arange(parts + 1)
        if parts:
            self.look_up(start.theta + halves[:, None] * increment)
        far = [part for part in halves if start.left(part).any()]
        if not far:
            return None
        high = float(far[-1])
        low = 0.5 * high if high > 0.5**parts else 0.0
        near = _NEAR * self.length / max(float(np.abs(increment).max()), _NEAR * self.length)
        for k in range(60):  # every third one halves the stretch, so that 1e-6 of it is left at most
            if high - low <= 2.0 * near + 1e-15 * high:
                break
            guess = start.guess(high)
            for part in (guess + 0.5 * near, guess - 0.5 * near) if k % 3 < 2 else (0.5 * (low + high),):
                if low < part < high:
                    low, high = (low, part) if start.left(part).any() else (part, high)
        return self._corner(start.theta + high * increment, increment, high, 2.5 * _NEAR)

    def _corner(self, theta: Array, increment: Array, part: float, near: float) -> Corner:
        """What jumps at a place of a way, or near it."""
        m, c = self.system.shape
        beside = near * self.length * increment / float(np.abs(increment).max())
        jump = self.pairs(theta + beside)[2] - self.pairs(theta - beside)[2]
        size = np.abs(jump).max(axis=(1, 2), initial=0.0)
        point = np.flatnonzero(size > _JUMP)
        return Corner(part, point, _normals(jump[point], increment.reshape(m, c)[point]))

    def crossing(self, j: int, theta: Array, normal: Array, reach: float) -> float | None:
        """How far along its normal a contact point at ``theta (c,)`` is from a corner; None if none is in reach.

        Corners may lie close to one another: a small part of the reach is searched first.
        """
        offsets = (self._crossing(j, theta, normal, part * reach) for part in (1e-2, 1e-1, 1.0))
        return next((offset for offset in offsets if offset is not None), None)

    def _crossing(self, j: int, theta: Array, normal: Array, reach: float) -> float | None:
        ends = self.pair_of(j, theta + np.array([-reach, reach])[:, None] * normal)
        if np.abs(ends[1] - ends[0]).max() <= _JUMP:
            return None
        low, high = -reach, reach
        while high - low > _ROUNDED * self.length + 4e-16 * float(np.abs(theta).max()):
            tried = np.linspace(low, high, 18)[1:-1]
            slopes = self.pair_of(j, theta + tried[:, None] * normal)
            over = np.abs(slopes - ends[0]).max(axis=(1, 2)) > np.abs(slopes - ends[1]).max(axis=(1, 2))
            first = int(np.argmax(over)) if over.any() else tried.size
            before, after = tried[first - 1] if first else low, tried[first] if first < tried.size else high
            if (before, after) == (low, high):
                break
            low, high = float(before), float(after)
        return 0.5 * (low + high)

    def passing(self, theta: Array, increment: Array) -> Corner:
        """All points that are at a corner of a place of the path, and pass it along the way."""
        return self._corner(theta, increment, 1.0, BESIDE)

    def side_of(self, corner: Corner, chosen: BoolArray) -> Array:
        """A small vector into the pieces beyond a corner for the chosen of its points, else before it."""
        side = np.zeros(self.system.shape)
        side[corner.point] = BESIDE * self.length * np.where(chosen, 1.0, -1.0)[:, None] * corner.normal
        return side.ravel()

    def normals_of(self, corner: Corner) -> Array:
        """The normals of a corner in all of theta, (k, n)."""
        rows = np.zeros((corner.point.size, *self.system.shape))
        rows[np.arange(corner.point.size), corner.point] = corner.normal
        return rows.reshape(corner.point.size, -1)


@dataclass(frozen=True, eq=False)
class _Start:
    """A point theta, an increment from it, and what the pairs would be if no piece were left and none were curved."""

    chart: GraphChart
    theta: Array
    increment: Array
    r: Array
    lam: Array
    slope: Array
    rate: Array
    slack: float

    @staticmethod
    def of(chart: GraphChart, theta: Array, side: Array, increment: Array, slack: float) -> _Start:
        theta = theta + side
        r, lam, slope = chart.pairs(theta)
        rate = np.matmul(slope, increment.reshape(chart.system.shape)[:, :, None])[:, :, 0]
        return _Start(chart, theta, increment, r, lam, slope, rate, slack)

    def _off(self, part: float) -> tuple[Array, Array, Array]:
        """By how much r (m, c) and the derivative (m, c, c) miss it at a part of the way; and the jump's rate."""
        r, _, slope = self.chart.pairs(self.theta + part * self.increment)
        increment = self.increment.reshape(r.shape)
        jump = slope - self.slope
        return r - self.r - part * self.rate, jump, np.matmul(jump, increment[:, :, None])[:, :, 0]

    def left(self, part: float) -> BoolArray:
        """Which points (m,) are no longer where they would be."""
        off, jump, _ = self._off(part)
        moved = part * np.abs(self.increment.reshape(off.shape)).max(axis=1)
        bent = np.abs(off).max(axis=1) > self.slack * moved + _ROUNDED * self.chart.length
        # Far away multipliers are differences of large numbers, and so is what a bound that follows them makes of them.
        size = np.abs(self.lam / self.chart.stiffness).max(axis=1)
        rounded = np.minimum(_FAR_AWAY, 1e-15 * moved / np.maximum(size, 1e-300))
        turned = np.abs(jump).max(axis=(1, 2)) if self.slack <= STRAIGHT else self.chart.angles(self.slope, jump)
        return np.asarray(bent | (turned > self.slack + rounded))

    def guess(self, part: float) -> float:
        """Where the first of them has left, if all pieces are straight."""
        off, _, rate = self._off(part)
        size = np.einsum("mc,mc->m", rate, rate)
        back = np.einsum("mc,mc->m", off, rate) / np.where(size > 0.0, size, np.inf)
        return part - float(back.max(initial=0.0))


def _normals(jump: Array, increment: Array) -> Array:
    """Unit normals (k, c) of jumps ``b n'`` (k, c, c), along the way; the way itself where a jump has none."""
    if not len(jump):
        return increment
    _, values, rows = np.linalg.svd(jump)
    along = np.einsum("kc,kc->k", rows[:, 0], increment)
    size = np.linalg.norm(increment, axis=1)
    sloped = np.abs(along) > 1e-9 * size
    plain = sloped if values.shape[1] == 1 else sloped & (values[:, 1] <= _NO_NORMAL * values[:, 0])
    heading = increment / np.where(size > 0.0, size, 1.0)[:, None]
    return np.where(plain[:, None], rows[:, 0] * np.where(along < 0.0, -1.0, 1.0)[:, None], heading)


def chart_of(system: CondensedProblem, r: Array, lam: Array, known: GraphChart | None = None) -> GraphChart:
    """The chart of a condensed problem near a state ``r, lam (m, c)``, and where a ``known`` one was enough.

    Raises :class:`MethodError` where a law falls at once, for it has no chart.
    """
    alpha = _least(system.law, r, lam)
    if not np.isfinite(alpha).all():
        raise MethodError(
            f"law '{system.law.name}' drops discontinuously, so its load path needs a linear plane body and a "
            f"separable law; give the drop a slope"
        )
    a = np.maximum((1.0 if known is None else 4.0) * _ABOVE * alpha, 1.0 / system.compliance)
    if known is not None:
        return replace(known, a=np.maximum(a, known.a))
    return GraphChart(system, a, r + lam / spread(a, r.shape[1]))


def _by_blocks(matrix: Array, blocks: Array) -> Array:
    """A matrix (k, m c) times the matrix of blocks (m, c, c)."""
    m, c = blocks.shape[:2]
    columns = matrix.reshape(len(matrix), m, c)
    out = np.zeros(columns.shape)
    for row, column in np.ndindex(c, c):
        out[:, :, column] += columns[:, :, row] * blocks[:, row, column]
    return out.reshape(len(matrix), m * c)


def _resists(work: Array) -> bool:
    """Whether a matrix does positive work on every motion: then no eigenvalue of its body has a negative real part."""
    try:
        np.linalg.cholesky(work + work.T)
    except np.linalg.LinAlgError:
        return False
    return True


def _flexibilities(stiff: Array, weighed: Array, moves: BoolArray) -> Array:
    """Eigenvalues of ``stiff^-1 weighed``, but for motions that nothing resists; rows but ``moves (n,)`` are zero."""
    try:
        eigenvalues = np.linalg.eigvals(weighed[moves] @ np.linalg.solve(stiff, np.eye(len(stiff))[:, moves]))
        if np.abs(eigenvalues).max(initial=0.0) * _NEUTRAL * np.linalg.norm(stiff) < np.linalg.norm(weighed):
            return np.asarray(eigenvalues)
    except np.linalg.LinAlgError:
        pass
    force, motion = la.eigvals(stiff, weighed, homogeneous_eigvals=True)
    felt = np.abs(force) > _NEUTRAL * np.linalg.norm(stiff)
    return np.asarray(motion[felt] / force[felt])


def _least(law: VectorLaw, r: Array, lam: Array) -> Array:
    """What a must be above, (m, 2)."""
    parts = curve_above_at(law, r, lam)
    return np.stack([np.broadcast_to(part, len(r)) for part in parts], axis=1)
