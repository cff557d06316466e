"""Whether contact holds a body along every motion that deforms nothing: a small programme over these motions.

Along a motion ``s = S z`` without deformation, z in R^a, the energy grows in the end like

    growth(z) = -f's + sum_j w_j j_j^inf(B_j s),      j^inf(r) = lim j(t r)/t,      t -> inf.

``growth`` is positively homogeneous.  The body is held exactly if it is positive for all z != 0: then the energy grows
along each motion, and has a minimiser.  Whether it is does not depend on the basis S, so neither on the frame of the
body.  Rates of growth that are infinite (a rigid foundation) are linear conditions on z; the others are a sum of
hinges ``up v_+ + down v_-`` of a row v of B S z and, in space, of lengths ``c |V z|`` of slips.  Where
``up + down >= 0`` all of it is convex.  Friction that the pressure bounds takes part as :class:`FrictionCones`.

It is decided on the faces ``z_i = +1`` and ``z_i = -1`` of the unit box, on each of which the minimum is sought by
cutting planes (Kelley 1960), which for a homogeneous function hold on all faces: a linear programme in a variables.
A round cone of friction is cut by planes that touch it where the motion points, so that it is met as exactly as rows.
From its multipliers follows a lower bound of the minimum on the face, exact but for rounding; so "held" is shown by
these bounds, and "not held" by a motion.  Hinges with ``up + down < 0`` are bounded by their chords, and split by sign
where that does not decide.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray
from hemivar.laws import VectorLaw

__all__ = [
    "Coercivity",
    "CoercivityProof",
    "CoercivityResult",
    "FrictionCones",
    "RecessionFunction",
    "decide",
    "growth_along",
    "hinges",
    "rests",
]

#: Growth this small, against what cancels in it, is none.
_BALANCE = 1e-9
#: Growth that a lower bound must exceed to be there, against the load and against all rates.
_SHOWN = (1e-11, 1e-14)
#: A rigid foundation gives way by this much of a motion, or more where the coordinates are rounded more.
SLACK = 1e-11
#: Feasibility of the linear programmes.
_FEASIBLE = 1e-10
#: A displacement this small, of a motion of size one, is none.
_AT_REST = 1e-13
#: Rates of the laws are cut off at this multiple of the load where they are bounded from below.
_CUT_OFF = 1e3
#: What it costs to break a condition, against the largest cut, where all faces are looked at together.
_PENALTY = 1e3
#: Cuts of a face, and faces that are looked at one by one, at most: what is not decided by then stays so.
_CUTS, _BRANCHES = 400, 100


class Coercivity(Enum):
    """What is known about a body along its motions without deformation."""

    HELD = "held"
    """The energy grows along each of them."""
    BALANCED = "in balance"
    """Along one of them it neither grows nor falls, as far as rounding lets one see."""
    FALLS = "falls"
    """Along one of them it falls without end."""
    UNDECIDED = "undecided"
    """The laws are not convex far away, and neither was shown."""


@dataclass(frozen=True, eq=False)
class CoercivityResult:
    """The answer, with the motion that it rests on where the body is not held."""

    verdict: Coercivity
    direction: Array | None = None  # (a,): coefficients of length one
    growth: float = 0.0  # growth of the energy along it


@dataclass(frozen=True, eq=False)
class CoercivityProof:
    """What was shown of how a body is held, so that it need not be decided again.

    It is known by what it was decided of, the very objects: whatever replaces one of them is decided again.
    """

    of: tuple[object, ...]  # model, load and law of a discrete problem
    limit: str | None = None  # the sentence for a body that its foundation holds at rest only
    idle: str | None = None  # the sentence for a body on which nothing acts, so that it rests in one of many equilibria
    balanced: bool | None = None

    def covers(self, of: tuple[object, ...]) -> bool:
        """Whether it was decided of these."""
        return len(of) == len(self.of) and all(one is other for one, other in zip(of, self.of, strict=True))


@dataclass(frozen=True, eq=False)
class FrictionCones:
    """Contact points at which the pressure bounds the friction, ``|lam_t| <= mu lam_n`` with ``0 <= lam_n <= F``.

    Along a motion v the forces of the cone, cut off at F, do the work ``F (v_n + mu |v_t|)_+`` at most.  Where F is
    infinite they do none along ``v_n + mu |v_t| <= 0``, and any along others.  A point that opens pulls by D instead,
    without friction.
    """

    normal: Array  # (p, a): ``v_n = normal @ z``
    slips: Array  # (p, t, a): ``mu v_t = slips @ z``
    capacity: Array  # (p,)
    pull: Array  # (p,)

    @classmethod
    def none(cls, motions: int) -> FrictionCones:
        """No such points."""
        return cls(np.zeros((0, motions)), np.zeros((0, 1, motions)), np.zeros(0), np.zeros(0))

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.pull.size)

    def widened(self, part: float) -> FrictionCones:
        """Cones of a friction that is larger by a part."""
        return replace(self, slips=(1.0 + part) * self.slips)

    @property
    def sizes(self) -> Array:
        """Largest entries of what moves at each point, (p,)."""
        reach = np.abs(self.slips).max(axis=(1, 2), initial=0.0)
        return np.asarray(np.abs(self.normal).max(axis=1, initial=0.0) + reach)

    def along(self, z: Array) -> tuple[Array, Array, Array]:
        """``v_n`` (p,), ``v_n + mu |v_t|`` (p,), and the plane (p, a) that touches the latter at z."""
        slip = self.slips @ z
        size = np.sqrt((slip**2).sum(axis=1))
        direction = slip / np.where(size > 0.0, size, 1.0)[:, None]
        lift = self.normal @ z
        return lift, lift + size, self.normal + np.einsum("pt,pta->pa", direction, self.slips)


@dataclass(frozen=True, eq=False)
class RecessionFunction:
    """Growth of the energy along the motions ``S z``."""

    work: Array  # (a,): ``S'f``
    load: float  # the size of what cancels in it
    rows: Array  # (q, a): scalar rows ``v = rows @ z``
    up: Array  # (q,)
    down: Array  # (q,)
    cones: Array  # (p, t, a): slips of t = 2 components, ``cones @ z``
    rates: Array  # (p,): rates of growth of their lengths
    slack: float = SLACK  # displacements up to which a condition counts as kept, of a motion of size one
    friction: FrictionCones = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.friction is None:
            object.__setattr__(self, "friction", FrictionCones.none(self.work.size))

    @property
    def resisted(self) -> RecessionFunction:
        """Where something resists, whichever way and however weakly: growth at the rate one both ways, without load."""
        rows = np.concatenate([self.rows[(self.up > 0.0) | (self.down > 0.0)], self.friction.normal])
        slips = self.cones[self.rates > 0.0]
        one, other = np.ones(len(rows)), np.ones(len(slips))
        return RecessionFunction(np.zeros_like(self.work), 0.0, rows, one, one, slips, other, self.slack)

    def __call__(self, z: Array) -> tuple[float, float]:
        """Growth along z, and the size of what cancels in it; +inf (-inf) where a law is infinite and none falls."""
        v, largest = self.rows @ z, float(np.abs(z).max())
        v[np.abs(v) < _AT_REST * largest] = 0.0
        kept = np.isposinf(np.where(v > 0.0, self.up, self.down)) & (np.abs(v) <= 4.0 * (self.slack + _FEASIBLE))
        v[kept] = 0.0
        terms = np.zeros_like(v)
        np.multiply(self.up, v, out=terms, where=v > 0.0)
        np.multiply(self.down, -v, out=terms, where=v < 0.0)
        lengths = np.sqrt(((self.cones @ z) ** 2).sum(axis=1))
        lengths[lengths < _AT_REST * largest] = 0.0
        more = np.zeros_like(lengths)
        np.multiply(self.rates, lengths, out=more, where=lengths > 0.0)
        every = np.concatenate([terms, more, self._rubbed(z, _AT_REST * largest)])
        size = self.load * largest + float(np.abs(every[np.isfinite(every)]).sum())
        if np.isposinf(every).any():
            return np.inf, size
        return float(every.sum()) - float(self.work @ z), size

    def _rubbed(self, z: Array, rest: float) -> Array:
        """What the cones take up along z, (p,); what moves by ``rest`` or less does not."""
        cones = self.friction
        lift, reach, _ = cones.along(z)
        kept = np.where(np.isposinf(cones.capacity), 4.0 * (self.slack + _FEASIBLE), rest)
        pressed = np.zeros_like(reach)
        np.multiply(cones.capacity, reach, out=pressed, where=reach > kept)
        return np.maximum(pressed, cones.pull * np.maximum(-lift, 0.0))


def growth_along(
    law: VectorLaw,
    local: Array,
    weights: Array,
    work: Array,
    load: float,
    slack: float = SLACK,
    friction: bool = False,
) -> RecessionFunction:
    """Growth of the energy along motions.

    Shapes: ``local`` (m, d, a), ``weights`` (m,), ``work`` (a,).
    """
    up, down, slip = (weights * rate for rate in law.rates)
    rubbed = law.rubbed(local[:, 1:]) if friction else None
    return hinges(local, up, down, slip, work, load, slack, rubbed)


def hinges(
    local: Array,
    up: Array,
    down: Array,
    slip: Array | None,
    work: Array,
    load: float,
    slack: float = SLACK,
    rubbed: Array | None = None,
) -> RecessionFunction:
    """A growth made of rates.

    Shapes: ``local`` (m, d, a), ``up`` (m,), ``down`` (m,), ``slip`` (m,), ``rubbed`` (m, d - 1, a).
    """
    d, a = local.shape[1:]
    rows, cones, rates, friction = local[:, 0], np.zeros((0, 2, a)), np.zeros(0), FrictionCones.none(a)
    if rubbed is not None:
        firm = np.isposinf(up)
        rubs = np.flatnonzero(rubbed.any(axis=(1, 2)) & (firm | ((up > 0.0) & (down >= 0.0) & np.isfinite(down))))
        pull = np.where(firm, 0.0, down)
        friction = FrictionCones(rows[rubs], rubbed[rubs], up[rubs], pull[rubs])
        taken = rubs[~firm[rubs]]
        up, down = up.copy(), down.copy()
        up[taken] = down[taken] = 0.0
    if slip is not None:
        hinge = np.flatnonzero((d == 2) | ~np.isfinite(slip))
        for c in range(1, d):
            rows = np.concatenate([rows, local[hinge, c]])
            up, down = np.concatenate([up, slip[hinge]]), np.concatenate([down, slip[hinge]])
        cone = np.flatnonzero((slip != 0.0) & (d == 3) & np.isfinite(slip))
        cones, rates = local[cone, 1:], slip[cone]
    counts = (np.abs(rows).max(axis=1, initial=0.0) > _AT_REST) & ((up != 0.0) | (down != 0.0))
    return RecessionFunction(work, load, rows[counts], up[counts], down[counts], cones, rates, slack, friction)


def decide(growth: RecessionFunction) -> CoercivityResult:
    """Whether the energy grows along every motion."""
    a = growth.work.size
    if a == 0:
        return CoercivityResult(Coercivity.HELD)
    worst = min((_rated(growth, z) for z in _plain(a)), key=lambda rated: rated[0])
    if worst[0] < -_BALANCE:
        return CoercivityResult(Coercivity.FALLS, worst[1], growth(worst[1])[0])
    if a == 1:
        return (
            CoercivityResult(Coercivity.HELD)
            if worst[0] > _BALANCE
            else CoercivityResult(Coercivity.BALANCED, worst[1], growth(worst[1])[0])
        )
    hold = _by_programme(_cut_off(growth), growth)
    if hold.verdict is Coercivity.UNDECIDED:
        hold = _by_programme(growth, growth)
    if hold.verdict is Coercivity.BALANCED and worst[0] <= _BALANCE:
        return CoercivityResult(
            Coercivity.BALANCED, worst[1], growth(worst[1])[0]
        )  # a plain motion makes the better message
    return hold


def rests(growth: RecessionFunction) -> bool:
    """Whether no load acts along the motions, and contact resists each of them one way at least.

    The body is in balance wherever it touches nothing then, and a load that presses it onto its foundation holds it.
    """
    return growth.load == 0.0 and decide(growth.resisted).verdict is Coercivity.HELD


def _rated(growth: RecessionFunction, z: Array) -> tuple[float, Array]:
    """Growth along z, of what cancels in it."""
    z = z / np.linalg.norm(z)
    value, size = growth(z)
    return (value / size if size > 0.0 and np.isfinite(value) else value), z


def _plain(a: int) -> Iterator[Array]:
    yield from np.eye(a)
    yield from -np.eye(a)


def _cut_off(growth: RecessionFunction) -> RecessionFunction:
    """Smaller rates where the load is far below them, so that the one does not vanish in the rounding of the other.

    What is held by these is held by the true ones; a motion that is not is looked at again.
    """
    sizes = np.abs(growth.rows).max(axis=1, initial=0.0), np.abs(growth.cones).max(axis=(1, 2), initial=0.0)
    if growth.load <= 0.0:
        return growth
    limits = [_CUT_OFF * growth.load / np.where(size > 0.0, size, 1.0) for size in sizes]
    up, down = growth.up.copy(), growth.down.copy()
    for mine, other in ((up, growth.down), (down, growth.up)):
        cut = np.isfinite(mine) & np.isfinite(other) & (mine > limits[0])
        mine[cut] = np.maximum(np.minimum(mine, limits[0]), np.minimum(-other, mine))[cut]
    cones, size = growth.friction, growth.friction.sizes
    most = _CUT_OFF * growth.load / np.where(size > 0.0, size, 1.0)
    capacity = np.where(np.isposinf(cones.capacity), np.inf, np.minimum(cones.capacity, most))
    friction = replace(cones, capacity=capacity, pull=np.minimum(cones.pull, most))
    return replace(growth, up=up, down=down, rates=np.minimum(growth.rates, limits[1]), friction=friction)


@dataclass(eq=False)
class _Programme:
    """Cutting planes of the convex part of a growth, shared by the faces of the box."""

    growth: RecessionFunction
    scale: float
    linear: Array  # of what is linear: load, hinges with a sign, chords
    constant: float
    convex: BoolArray  # rows that are convex hinges
    cuts: list[Array] = field(default_factory=list)
    hard: list[Array] = field(default_factory=list)
    taken: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        a = self.linear.size
        starts = list(_plain(a))
        if a <= 6:
            starts += [np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=a)]
        self.cuts = [self.slope(z) for z in starts]
        for z in starts:
            self.violated(z)

    def convex_value(self, z: Array) -> float:
        """The convex part of the growth, without what is infinite."""
        return float(self.slope(z) @ z)

    def slope(self, z: Array) -> Array:
        """An element of the subdifferential of the convex part at z; it is a cut everywhere."""
        g = self.growth
        v = g.rows @ z
        up, down = (np.where(self.convex & np.isfinite(rate), rate, 0.0) for rate in (g.up, g.down))
        at_rest = np.clip(0.0, -down, up)
        out = np.asarray(self.linear + g.rows.T @ np.where(v > 0.0, up, np.where(v < 0.0, -down, at_rest)))
        if g.rates.size:
            slip = g.cones @ z
            lengths = np.sqrt((slip**2).sum(axis=1))
            push = np.divide(g.rates, lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
            out = out + np.einsum("pta,pt,p->a", g.cones, slip, push * (g.rates > 0.0))
        if g.friction.count:
            out = out + self._rubbed(z)
        return out

    def _rubbed(self, z: Array) -> Array:
        """The part of :meth:`slope` by cones that are cut off."""
        cones = self.growth.friction
        lift, reach, planes = cones.along(z)
        capacity = np.where(np.isposinf(cones.capacity), 0.0, cones.capacity)
        pressed = (reach > 0.0) & (capacity * reach >= -cones.pull * lift)
        pulls = np.where(~pressed & (lift < 0.0), cones.pull, 0.0)
        return np.asarray(planes.T @ np.where(pressed, capacity, 0.0) - cones.normal.T @ pulls)

    def violated(self, z: Array) -> bool:
        """Take up the conditions that z violates most; whether there are any."""
        g = self.growth
        v = g.rows @ z
        over = np.where(np.isposinf(g.up), v, -np.inf), np.where(np.isposinf(g.down), -v, -np.inf)
        new = False
        for sign, excess in zip((1.0, -1.0), over, strict=True):
            if not excess.size:
                continue
            for j in np.argsort(excess)[: -2 * z.size - 1 : -1]:
                key = int(j) if sign > 0.0 else -1 - int(j)
                if excess[j] > 2.0 * (g.slack + _FEASIBLE) and key not in self.taken:
                    self.taken.add(key)
                    self.hard.append(sign * g.rows[j])
                    new = True
        if g.friction.count:
            _, reach, planes = g.friction.along(z)
            reach = np.where(np.isposinf(g.friction.capacity), reach, -np.inf)
            for j in np.argsort(reach)[: -2 * z.size - 1 : -1]:
                if reach[j] > 2.0 * (g.slack + _FEASIBLE):
                    self.hard.append(planes[j])
                    new = True
        return new

    def all_positive(self, enough: float) -> bool:
        """Whether the first cuts show the growth to be positive on all faces: one programme instead of many."""
        faces = list(itertools.product(range(self.linear.size), (1.0, -1.0)))
        minima = self._solve(faces, _PENALTY)
        return minima is not None and all(self.scale * bound + self.constant > enough for bound, _ in minima)

    def lowest(self, face: int, sign: float, enough: float) -> tuple[float, Array | None]:
        """A lower bound on a face, and where it is attained in the end; +inf and None if the face is forbidden."""
        bound, z = -np.inf, None
        for _ in range(_CUTS):
            minima = self._solve([(face, sign)])
            if minima is None:
                return np.inf, None
            bound, z = max(bound, minima[0][0]), minima[0][1]
            if z is None:
                break
            if self.scale * bound + self.constant > enough:
                break
            if self.violated(z):
                continue
            value = self.convex_value(z)
            if value + self.constant < -enough or value / self.scale - bound <= 0.01 * _BALANCE:
                break
            self.cuts.append(self.slope(z))
        return self.scale * bound + self.constant, z

    def _solve(
        self, faces: list[tuple[int, float]], penalty: float = np.inf
    ) -> list[tuple[float, Array | None]] | None:
        """Bounds and minimisers of the cuts on faces, together; None if a face is forbidden.

        With a penalty conditions may be broken for it, which leaves the bounds true, and no face forbidden.
        """
        with IMPORTS:
            from scipy.optimize import linprog  # only here: SciPy takes long to load it

        a, count = self.linear.size, len(faces)
        cuts, hard = np.array(self.cuts) / self.scale, np.array(self.hard).reshape(-1, a)
        height = len(cuts) + len(hard)
        block = np.zeros((height, a + 2))
        block[: len(cuts), :a], block[: len(cuts), a] = cuts, -1.0
        block[len(cuts) :, :a], block[len(cuts) :, a + 1] = hard, -1.0
        left = sp.block_diag([block] * count, "csr")
        right = np.tile(np.concatenate([np.zeros(len(cuts)), np.full(len(hard), self.growth.slack)]), count)
        broken = [0.0, np.inf if np.isfinite(penalty) else 0.0]
        box = np.tile(np.array([[-1.0, 1.0]] * a + [[-np.inf, np.inf], broken]), (count, 1)).reshape(count, a + 2, 2)
        for k, (face, sign) in enumerate(faces):
            box[k, face] = sign
        price = penalty * max(float(np.abs(cuts).max()), 1.0) if np.isfinite(penalty) else 0.0
        cost = np.tile([0.0] * a + [1.0, price], count)
        optimum = linprog(
            cost,
            left,
            right,
            bounds=box.reshape(-1, 2),
            method="highs",
            options={"primal_feasibility_tolerance": _FEASIBLE, "dual_feasibility_tolerance": _FEASIBLE},
        )
        if optimum.status == 2:
            return None
        if optimum.status != 0:
            return [(-np.inf, None)] * count
        answers: list[tuple[float, Array | None]] = []
        duals = np.maximum(-optimum.ineqlin.marginals, 0.0).reshape(count, height)
        for k, (face, sign) in enumerate(faces):
            z = np.clip(optimum.x.reshape(count, a + 2)[k, :a], -1.0, 1.0)
            z[face] = sign
            bound = self._certified(duals[k, : len(cuts)], duals[k, len(cuts) :], cuts, hard, face, sign)
            answers.append((bound, z))
        return answers

    def _certified(self, share: Array, force: Array, cuts: Array, hard: Array, face: int, sign: float) -> float:
        """The bound that multipliers give: the minimum of a linear function over the face."""
        if not share.sum() > 0.0:
            return -np.inf
        share, force = share / share.sum(), force / share.sum()
        c = share @ cuts + (force @ hard if len(hard) else 0.0)
        others = np.abs(c).sum() - abs(c[face])
        return float(sign * c[face] - others - self.growth.slack * force.sum())


def _by_programme(cut: RecessionFunction, growth: RecessionFunction) -> CoercivityResult:
    """The programme with the rates cut off; what it finds is checked with the true ones."""
    finite = np.isfinite(cut.up) & np.isfinite(cut.down)
    endless = np.isneginf(cut.up) | np.isneginf(cut.down)
    concave = np.flatnonzero(finite & (cut.up + cut.down < 0.0)).tolist()
    reach = np.abs(cut.rows).sum(axis=1)
    sizes = np.where(finite, np.abs(np.where(finite, cut.up, 0.0)) + np.abs(np.where(finite, cut.down, 0.0)), 0.0)
    every = float(sizes @ np.abs(cut.rows).max(axis=1, initial=0.0))
    every += float(np.abs(cut.rates) @ np.abs(cut.cones).max(axis=(1, 2), initial=0.0))
    bounded = np.where(np.isposinf(cut.friction.capacity), 0.0, cut.friction.capacity)
    every += float((bounded + cut.friction.pull) @ cut.friction.sizes)
    scale = cut.load if cut.load > 0.0 else every if every > 0.0 else 1.0
    enough = _SHOWN[0] * scale + _SHOWN[1] * every
    if endless.any():
        return CoercivityResult(Coercivity.UNDECIDED)
    shrinking = cut.rates < 0.0
    lost = float(-cut.rates[shrinking] @ np.linalg.norm(np.abs(cut.cones[shrinking]).sum(axis=2), axis=1))
    waiting: list[dict[int, float]] = [{}]
    doubt: CoercivityResult | None = None
    for _ in range(_BRANCHES):
        if not waiting:
            return doubt or CoercivityResult(Coercivity.HELD)
        signs = waiting.pop()
        linear, constant = -cut.work, -lost
        hard = []
        for j in concave:
            if j in signs:
                linear = linear + (cut.up[j] if signs[j] > 0.0 else -cut.down[j]) * cut.rows[j]
                hard.append(-signs[j] * cut.rows[j])
            else:
                linear = linear + 0.5 * (cut.up[j] - cut.down[j]) * cut.rows[j]
                constant += 0.5 * (cut.up[j] + cut.down[j]) * reach[j]
        programme = _Programme(cut, scale, linear, constant, cut.up + cut.down >= 0.0, hard=hard)
        if programme.all_positive(enough):
            continue
        for face, sign in itertools.product(range(cut.work.size), (1.0, -1.0)):
            bound, z = programme.lowest(face, sign, enough)
            if bound > enough:
                continue
            if z is None:
                return CoercivityResult(Coercivity.UNDECIDED)
            relative, z = _rated(growth, z)
            if relative < -_BALANCE:
                return CoercivityResult(Coercivity.FALLS, z, growth(z)[0])
            open_ones = [j for j in concave if j not in signs]
            if open_ones:
                gaps = [-(cut.up[j] + cut.down[j]) * (reach[j] - abs(float(cut.rows[j] @ z))) for j in open_ones]
                split = open_ones[int(np.argmax(gaps))]
                waiting += [{**signs, split: 1.0}, {**signs, split: -1.0}]
                break
            if relative <= _BALANCE:
                doubt = CoercivityResult(Coercivity.BALANCED, z, growth(z)[0])
            elif doubt is None:
                doubt = CoercivityResult(Coercivity.UNDECIDED)
    return CoercivityResult(Coercivity.UNDECIDED)
