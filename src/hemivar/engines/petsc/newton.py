"""Truncated nonsmooth Newton over ranks: PETSc's matrices and multigrid, contact on the ranks that have it."""

from __future__ import annotations

import copy
import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.residual import Residual
from hemivar.engines.petsc.alarm import CALLED, Alarm
from hemivar.engines.petsc.assembly import BodyOnRanks
from hemivar.engines.petsc.preconditioner import Multigrid
from hemivar.laws import ContactLaw
from hemivar.laws.vector_law import Linearisation
from hemivar.solvers import Controls, Progress, Status
from hemivar.solvers.newton import room
from hemivar.solvers.solution import contact_state

__all__ = ["Block", "DistributedNewton", "End", "Iterate", "Method", "states"]

_NESTED = 1e-3  # relative residual up to which coarser meshes are solved
_PATIENCE = 0.3
_STUCK = 12


@dataclass(frozen=True, eq=False)
class Iterate:
    """Where the method is; arrays and vectors are the part of this rank.

    Attributes
    ----------
    x : petsc4py Vec
        Displacement, in the unknowns of :class:`BodyOnRanks`.
    force : petsc4py Vec
        ``f - K x``.
    energy : float
    stiffening : float
        How much stiffer than its diagonal the body is made for diagonal minimisations.
    built_at : petsc4py Vec or None
        Where the preconditioner was set up; it is a function of this place.
    step : int
    """

    x: Any
    force: Any
    energy: float
    stiffening: float
    built_at: Any = None
    step: int = 0


@dataclass(frozen=True)
class DistributedNewton:
    """Truncated nonsmooth Newton (Graeser, Sack, Sander 2009) over ranks, with the multigrid of PETSc.

    A step is that of :class:`hemivar.NonsmoothMultigrid`: the contact points minimise their own energies, the rest of
    the body being held; then Newton's equation is solved for all unknowns but those at a kink; the step is cut back to
    the pieces it started on, or halved, until the energy does not rise.  Contact points are worked on by the ranks that
    own their nodes.  On refined and built-in meshes it starts from the solution on the next coarser mesh.

    Parameters
    ----------
    sweeps : int
        Diagonal minimisations of the contact points before each Newton step.
    iterations : int
        Most iterations of conjugate gradients in one step.
    halvings : int
        How often a step may be halved.
    nested : bool
        Start from the solution on the next coarser mesh.
    stale : float
        Part of the contact unknowns that may change between kink and smooth before the preconditioner is set up anew.
    """

    sweeps: int = 3
    iterations: int = 300
    halvings: int = 20
    nested: bool = True
    stale: float = 0.0
    name: ClassVar[str] = "petsc"
    default_steps: ClassVar[int] = 100

    def first_guess(self, bodies: Sequence[BodyOnRanks], alarm: Alarm) -> tuple[Any, int]:
        """Start on the finest mesh, by the solutions on the coarser ones; and the cycles that these took."""
        x, cycles = bodies[0].restrict(np.zeros(bodies[0].piece.mesh.points.shape)), 0
        for coarse, fine in itertools.pairwise(bodies):
            if not coarse.ranks.largest(alarm.due())[0]:
                method = Method(self, coarse, Controls(rtol=_NESTED, max_steps=15), alarm)
                x = method.run(method.begin(x)).iterate.x
                cycles += method.cycles
                method.destroy()
            ends = fine.piece.ends
            assert ends is not None
            x = fine.restrict(coarse.displacement(x)[ends].mean(axis=1))
        return x, cycles


@dataclass(frozen=True, eq=False)
class End:
    """How an iteration ended."""

    iterate: Iterate
    multiplier: Array
    residual: Residual
    status: Status
    history: tuple[Progress, ...]


class Block:
    """The contact points of all ranks alone, every other unknown being held; arrays are of this rank."""

    def __init__(self, body: BodyOnRanks) -> None:
        from petsc4py import PETSc

        start = body.K.getOwnershipRange()[0]
        chosen = PETSc.IS().createGeneral((start + body.unknown).astype(PETSc.IntType), comm=body.ranks.comm)
        self.body = body
        self.matrix = body.K.createSubMatrix(chosen, chosen)
        self.inner, self.outer = self.matrix.createVecs()
        d = body.dim
        diagonal = body.spread(np.ones(body.unknown.size)) ** 2
        diagonal[body.active] = self.matrix.getDiagonal().array_r
        if d > 1 and body.points:
            diagonal[:, 1:] = diagonal[:, 1:].max(axis=1, keepdims=True)
        largest = float(body.ranks.largest(float(diagonal.max(initial=0.0)))[0])
        self.diagonal = np.where(diagonal > 0.0, diagonal, largest if largest > 0.0 else 1.0)

    def product(self, step: Array) -> Array:
        """Elastic force ``K_cc step``, (m, d), for steps (m, d) of the contact points."""
        self.inner.array_w[:] = self.body.gather(step)
        self.matrix.mult(self.inner, self.outer)
        return self.body.spread(self.outer.array_r)

    def stiffest(self) -> float:
        """Largest eigenvalue of the block scaled by its diagonal, with a margin."""
        body = self.body
        start = body.K.getOwnershipRange()[0]
        scale = np.where(body.active, 1.0 / np.sqrt(self.diagonal), 0.0)
        v = body.spread(np.cos(1.0 + (start + body.unknown) ** 1.3))
        size = float(np.sqrt(body.ranks.total(float((v**2).sum()))[0]))
        if size == 0.0:
            return 1.0
        for _ in range(15):
            v = scale * self.product(scale * v / size)
            size = float(np.sqrt(body.ranks.total(float((v**2).sum()))[0]))
            if size == 0.0:
                return 1.0
        return max(1.05 * size, 1.0)

    def descend(self, r: Array, pull: Array, stiffening: float) -> tuple[Array | None, Array, float, float]:
        """All points minimise their diagonal problem at once: point, pull there, gain, stiffening that sufficed.

        The point is None where the laws do not hold the body.
        """
        body, law, w = self.body, self.body.law, self.body.weights[:, None]
        value = law.value(r) if len(r) else np.zeros(0)
        for _ in range(8):
            stiffness = stiffening * self.diagonal
            new = r
            if len(r):
                pair = np.stack([stiffness[:, 0], stiffness[:, min(1, body.dim - 1)]], axis=1) / w
                new = np.where(body.active, law.local_argmin(pair, (stiffness * r + pull) / w), body.fixed)
            step = np.where(body.active, new - r, 0.0)
            finite = bool(np.isfinite(step).all())
            bent = self.product(np.where(np.isfinite(step), step, 0.0))
            gain = float((0.5 * step * bent - step * pull).sum()) if finite else 0.0
            if len(r) and finite:
                gain += float(body.weights @ (law.value(new) - value))
            total, broken = body.ranks.total(gain, 0.0 if finite else 1.0)
            if broken:
                return None, pull, 0.0, stiffening
            if total <= 0.0:
                return new, pull - bent, float(total), stiffening
            stiffening *= 1.5
        return r, pull, 0.0, stiffening


class Method:
    """The method at work on one mesh.

    Attributes
    ----------
    options : DistributedNewton
    body : BodyOnRanks
    controls : Controls
    alarm : Alarm
        When to end before it is done; the time that ``controls`` allow is not looked at.
    cycles : int
        Applications of the preconditioner so far.
    """

    def __init__(self, options: DistributedNewton, body: BodyOnRanks, controls: Controls, alarm: Alarm) -> None:
        self.options, self.body, self.controls, self.alarm = options, body, controls, alarm
        self.block = Block(body)
        self.preconditioner = Multigrid(body)
        self.cycles = 0
        self.began = time.perf_counter()

    def at(self, law: ContactLaw, controls: Controls | None = None) -> Method:
        """The method on the same body with another law; matrices and preconditioner are shared."""
        other = copy.copy(self)
        other.body = self.body.with_law(law)
        other.block = copy.copy(self.block)
        other.block.body = other.body
        other.controls = self.controls if controls is None else controls
        return other

    def destroy(self) -> None:
        """Give its memory back."""
        self.preconditioner.destroy()
        self.block.matrix.destroy()

    # ---- states ------------------------------------------------------------------------------------------

    def begin(self, x: Any, built_at: Any = None) -> Iterate:
        """The first iterate, from a guess; ``built_at`` is where the preconditioner has been set up, if it has."""
        x = self.admissible(self.body, x)
        return Iterate(x, self.force(x), self.energy(x), self.block.stiffest(), built_at)

    @staticmethod
    def admissible(body: BodyOnRanks, x: Any) -> Any:
        """The guess, with contact points in the domain of the laws."""
        x = x.copy()
        body.move(x, np.where(body.active, _admissible(body.law, body.local(x)), body.fixed))
        return x

    def size_of_change(self, now: Iterate, before: tuple[Any, Array], lam: Array) -> tuple[float, float]:
        """Energy norm of the change of displacement and multiplier, and that of both themselves."""
        body = self.body
        change = now.x.copy()
        change.axpy(-1.0, before[0])
        bent = body.f.duplicate()
        sizes = []
        for vector, dual in ((change, lam - before[1]), (now.x, lam)):
            body.K.mult(vector, bent)
            spread = np.repeat(body.weights[:, None] / self.block.diagonal[:, :1], body.dim, axis=1)
            own = float(vector.array_r @ bent.array_r)
            own += float((body.weights[:, None] * spread * np.where(body.active, dual, 0.0) ** 2).sum())
            sizes.append(own)
        squares = np.sqrt(np.maximum(body.ranks.total(*sizes), 0.0))
        return float(squares[0]), float(squares[1])

    def force(self, x: Any) -> Any:
        out = self.body.f.duplicate()
        self.body.K.mult(x, out)
        out.aypx(-1.0, self.body.f)
        return out

    def energy(self, x: Any) -> float:
        """E(u)."""
        body = self.body
        bent = body.f.duplicate()
        body.K.mult(x, bent)
        own = float(0.5 * (bent.array_r @ x.array_r) - body.f.array_r @ x.array_r)
        if body.points:
            own += float(body.weights @ body.law.value(body.local(x)))
        return float(body.ranks.total(own)[0]) + body.constant

    def multiplier(self, now: Iterate) -> Array:
        """Pressure and friction in equilibrium; on held components the smallest that the law allows."""
        body = self.body
        lam = body.spread(now.force.array_r[body.unknown]) / body.weights[:, None]
        if body.points and not body.active.all():
            r = body.local(now.x)
            lam = np.where(body.active, lam, body.law.nearest_multiplier(r, np.zeros(r.shape)))
        return lam

    def residual(self, now: Iterate, lam: Array, law: ContactLaw | None = None) -> Residual:
        """The residual of the pair, as :func:`hemivar.discrete.residual` defines it."""
        body = self.body
        contact = body.gather(body.weights[:, None] * lam)
        off = now.force.array_r.copy()
        off[body.unknown] -= contact
        inclusion = np.zeros(0)
        if body.points:
            law = body.law if law is None else law
            inclusion = body.weights * law.graph_distance(body.local(now.x), lam, body.compliance)
        moved = body.row_sums.array_r * np.abs(now.x.array_r) + np.abs(body.f.array_r)
        balance, distance, pressed, size = body.ranks.norms(off, inclusion, contact, moved)
        return Residual.of_sizes(float(balance), float(distance), body.against, float(pressed), float(size))

    # ---- the loop ----------------------------------------------------------------------------------------

    def run(
        self,
        now: Iterate,
        past: tuple[Progress, ...] = (),
        watch: Callable[[Iterate, tuple[Progress, ...]], None] | None = None,
    ) -> End:
        """Step until the residual is small, or a limit is reached; the decisions are the same on all ranks.

        Parameters
        ----------
        now : Iterate
        past : tuple of Progress
            Steps that a run before this one has done; the last is that of ``now``.
        watch : function, optional
            Called with every iterate and the history up to it.
        """
        controls, body = self.controls, self.body
        limit = self.options.default_steps if controls.max_steps is None else controls.max_steps
        history = list(past[:-1])
        lowest: list[float] = []
        best, best_lam, best_found = now, self.multiplier(now), None
        status: Status | None = None
        changed = past[-1].changed if past else 0
        if now.built_at is not None and not self.preconditioner.setups:
            self.build_at(now.built_at)
        while status is None:
            lam = self.multiplier(now)
            found = self.residual(now, lam)
            spent = float(body.ranks.largest(time.perf_counter() - self.began)[0])
            history.append(Progress(now.step, now.energy, found.relative, changed, spent))
            finite = bool(np.isfinite(found.total) and np.isfinite(found.scale))
            if finite:
                best, best_lam, best_found = now, lam, found
            stop = controls.callback is not None and bool(controls.callback(history[-1]))
            due = float(body.ranks.largest(CALLED if stop else self.alarm.due())[0])
            if watch is not None:
                watch(now, tuple(history))
            lowest.append(min(found.total if finite else np.inf, lowest[-1] if lowest else np.inf))
            stuck = len(lowest) > _STUCK + 1 and lowest[-1] > 0.999 * lowest[-1 - _STUCK]
            if not finite:
                status = Status.NONFINITE
            elif found.below(controls.atol, controls.rtol):
                better = None if due else self.settle(now)
                if better is None:
                    status = Status.CONVERGED
                else:
                    now, lowest = better, []
            elif due:
                status = Status.INTERRUPTED if due == CALLED else Status.MAX_TIME
            elif stuck:
                status = Status.STALLED
            elif now.step >= limit:
                status = Status.MAX_STEPS
            if status is not None:
                break
            before = states(body, now.x, lam)
            after = self.step(now, found)
            if after is None:
                status = Status.UNBOUNDED
                break
            now = after
            state = states(body, now.x, self.multiplier(now))
            changed = int(body.ranks.total(np.count_nonzero(state != before))[0])
        if best_found is None:
            best_found = self.residual(best, best_lam)
        return End(best, best_lam, best_found, status, tuple(history))

    def settle(self, now: Iterate) -> Iterate | None:
        """A lower place, where the laws are not convex and one contact point finds it alone; else None."""
        body = self.body
        bent = [bool((alpha != 0.0).any()) for alpha in body.law.weak_convexity] if body.points else [False]
        if not body.ranks.largest(float(any(bent)))[0]:
            return None
        r = body.local(now.x)
        pull = body.spread(now.force.array_r[body.unknown])
        gain, point, target = np.inf, -1, r
        size = float(np.abs(body.f.array_r) @ np.abs(now.x.array_r))
        if body.points:
            gain, point, target = self._best_point(r, pull)
            size += float(body.weights @ np.abs(body.law.value(r)))
        (scale,) = body.ranks.total(size)
        lowest, who = min(body.ranks.mpi.allgather((gain, body.ranks.rank)))
        if not lowest < -1e-12 * scale:
            return None
        x = now.x.copy()
        if who == body.ranks.rank:
            r[point] = target[point]
        body.move(x, r)
        return replace(now, x=x, force=self.force(x), energy=now.energy + lowest)

    def _best_point(self, r: Array, pull: Array) -> tuple[float, int, Array]:
        """The point that gains most by moving its normal or its tangential part alone, the gain, and where to."""
        body, law, w, a = self.body, self.body.law, self.body.weights, self.block.diagonal.copy()
        d = body.dim
        if d > 2:
            a[:, 1:] *= 2.0  # no less than the largest eigenvalue of a block of two
        pair = np.stack([a[:, 0], a[:, min(1, d - 1)]], axis=1) / w[:, None]
        target = law.local_argmin(pair, (a * r + pull) / w[:, None])
        target = np.where(body.active & np.isfinite(target), target, r)
        step = target - r
        quadratic = 0.5 * a * step**2 - pull * step
        gains = np.zeros((len(r), 2))
        gains[:, 0] = quadratic[:, 0] + w * (law.normal.value(target[:, 0]) - law.normal.value(r[:, 0]))
        size, old = np.linalg.norm(target[:, 1:], axis=1), np.linalg.norm(r[:, 1:], axis=1)
        gains[:, 1] = quadratic[:, 1:].sum(axis=1) + w * (law.tangential.value(size) - law.tangential.value(old))
        point, part = np.unravel_index(int(np.argmin(gains)), gains.shape)
        out = r.copy()
        columns = slice(0, 1) if part == 0 else slice(1, d)
        out[point, columns] = target[point, columns]
        return float(gains[point, part]), int(point), out

    # ---- one step ----------------------------------------------------------------------------------------

    def step(self, now: Iterate, found: Residual) -> Iterate | None:
        """Diagonal minimisations, then Newton's equation; None where the laws do not hold the body."""
        body = self.body
        r = body.local(now.x)
        pull = body.spread(now.force.array_r[body.unknown])
        energy, stiffening = now.energy, now.stiffening
        for _ in range(self.options.sweeps):
            new, pull, gain, stiffening = self.block.descend(r, pull, stiffening)
            if new is None:
                return None
            r, energy = new, energy + gain
        x = now.x.copy()
        body.move(x, r)
        force = self.force(x)
        if not np.isfinite(energy):
            energy = self.energy(x)
        x, force, gain, built_at = self.newton(x, force, r, now.built_at, found)
        return Iterate(x, force, energy + gain, stiffening, built_at, now.step + 1)

    def linearised(self, x: Any) -> tuple[Linearisation, BoolArray, Array]:
        """The laws at ``x``, the components that move smoothly, and the second derivatives with weights."""
        body = self.body
        m, d = body.active.shape
        if not m:
            return (
                Linearisation(np.zeros((0, 2), dtype=bool), np.zeros((0, d)), np.zeros((0, d, d))),
                body.active,
                (np.zeros((0, d, d))),
            )
        line = body.law.linearise(body.local(x))
        smooth = np.concatenate([line.smooth[:, :1], np.repeat(line.smooth[:, 1:], d - 1, axis=1)], axis=1)
        moving = body.active & smooth
        curvature = body.weights[:, None, None] * line.hessian * (moving[:, :, None] & moving[:, None, :])
        return line, moving, curvature

    def build_at(self, x: Any) -> None:
        """Set the preconditioner up for the kinks and curvatures at ``x``."""
        _, moving, curvature = self.linearised(x)
        self.preconditioner.build(~moving[self.body.active], _positive(curvature))

    def newton(self, x: Any, force: Any, r: Array, built_at: Any, found: Residual) -> tuple[Any, Any, float, Any]:
        """Newton's step: place, force and gain there, and where the preconditioner was set up."""
        body, law, w = self.body, self.body.law, self.body.weights
        line, moving, curvature = self.linearised(x)
        held = ~moving[body.active]
        if built_at is None or self.preconditioner.stale(held, _positive(curvature)) > self.options.stale:
            built_at = x
            self.build_at(x)
        right = force.copy()
        entries = right.array_w
        entries[body.unknown] -= body.gather(w[:, None] * line.gradient)
        entries[body.unknown[held]] = 0.0
        watch = _Watch(body, self.block, r, moving, line, body.spread(force.array_r[body.unknown]))
        tolerance = 0.1 * (self.controls.atol + self.controls.rtol * found.scale)
        direction, negative, iterations = self.conjugate_gradients(right, held, curvature, tolerance, watch)
        self.cycles += iterations
        if iterations == 0:
            return x, force, 0.0, built_at
        bent_all = body.f.duplicate()
        body.K.mult(direction, bent_all)
        along = body.spread(direction.array_r[body.unknown])
        bent = body.spread(bent_all.array_r[body.unknown])
        pull = body.spread(force.array_r[body.unknown])
        value = law.value(r) if len(r) else np.zeros(0)
        square, slope, size = body.ranks.total(
            float(direction.array_r @ bent_all.array_r),
            float(force.array_r @ direction.array_r),
            float(np.abs(force.array_r) @ np.abs(x.array_r)) + float(w @ np.abs(value)),
        )
        length = 1.0
        if negative:
            length = float(-body.ranks.largest(-room(law, r, along, moving) if along.any() else -np.inf)[0])
            length = length if np.isfinite(length) else 1.0
        rounding = 1e-14 * (abs(slope) + size)
        for halving in range(self.options.halvings):
            far = np.where(body.active, r + length * along, body.fixed)
            near = np.where(moving, law.clamp(r, far), r) if len(r) else far
            extra = np.where(body.active, near - far, 0.0)
            push = self.block.product(extra)
            base = 0.5 * length**2 * square - length * slope
            back = float((extra * (length * bent - pull)).sum()) + 0.5 * float((extra * push).sum())
            costs = [0.0, 0.0]
            if len(r):
                costs = [float(w @ (law.value(end) - value)) for end in (near, far)]
            gains = base + body.ranks.total(back + costs[0], costs[1])
            use_near = not gains[1] < gains[0]
            gain = float(gains[0] if use_near else gains[1])
            if gain < 0.0 or (halving == 0 and not negative and gain <= rounding):
                y = x.copy()
                y.axpy(length, direction)
                body.move(y, near if use_near else far)
                after = self.force(y)
                if gain < -rounding or self.closer(y, after, found):
                    return y, after, min(gain, 0.0), built_at
            length *= 0.5
        return x, force, 0.0, built_at

    def closer(self, x: Any, force: Any, before: Residual) -> bool:
        """Whether a place is closer to a solution, where the energy does not show it for rounding."""
        now = Iterate(x, force, 0.0, 1.0)
        return self.residual(now, self.multiplier(now)).total < 0.9 * before.total

    def conjugate_gradients(
        self, right: Any, held: BoolArray, curvature: Array, tolerance: float, watch: _Watch
    ) -> tuple[Any, bool, int]:
        """Newton's equation from zero: the iterate, or a direction of negative curvature, and the iterations.

        It is here and not in PETSc because the contact conditions end it early, and because of negative curvature.
        """
        body = self.body
        x = right.duplicate()
        z, p, q = right.duplicate(), right.duplicate(), right.duplicate()
        out = np.concatenate([body.unknown[held], np.flatnonzero(body.held)])
        bent = np.zeros(body.active.shape)  # K x on the contact points
        old = 1.0
        for iteration in range(1, self.options.iterations + 1):
            self.preconditioner.apply(right, z)
            z.array_w[out] = 0.0
            (now,) = body.ranks.total(float(right.array_r @ z.array_r))
            if not now > 0.0:
                return x, False, iteration - 1
            if iteration == 1:
                z.copy(p)
            else:
                p.aypx(now / old, z)
            old = now
            body.K.mult(p, q)
            elastic = body.spread(q.array_r[body.unknown])
            entries = q.array_w
            entries[body.unknown] += body.gather(
                np.einsum("mij,mj->mi", curvature, body.spread(p.array_r[body.unknown]))
            )
            entries[out] = 0.0
            stiff, pp, qq = body.ranks.total(
                float(p.array_r @ q.array_r), float(p.array_r @ p.array_r), float(q.array_r @ q.array_r)
            )
            if stiff <= 1e-14 * np.sqrt(pp * qq):
                return p, True, iteration
            length = now / stiff
            x.axpy(length, p)
            right.axpy(-length, q)
            bent += length * elastic
            wrong = watch.wrong(x, bent) if iteration > 1 else np.zeros(0)
            rest, off, due = np.sqrt(
                body.ranks.total(
                    float(right.array_r @ right.array_r), float((wrong**2).sum()), float(self.alarm.due() > 0.0)
                )
            )
            if rest <= tolerance or rest < _PATIENCE * off or due or not np.isfinite(rest):
                return x, False, iteration
        return x, False, self.options.iterations


@dataclass(frozen=True, eq=False)
class _Watch:
    """How far the contact conditions are from being fulfilled after a Newton step, as forces."""

    body: BodyOnRanks
    block: Block
    r: Array
    moving: BoolArray
    line: Linearisation
    pull: Array

    def wrong(self, step: Any, bent: Array) -> Array:
        body, law = self.body, self.body.law
        if not len(self.r):
            return np.zeros(0)
        way = body.spread(step.array_r[body.unknown])
        aim = np.where(self.moving, law.clamp(self.r, self.r + way), self.r)
        overshoot = self.block.diagonal * np.where(self.moving, self.r + way - aim, 0.0)
        lam = (self.pull - bent) / body.weights[:, None]
        off = np.where(body.active, lam - law.nearest_multiplier(self.r, lam), 0.0)
        bend = law.linearise(aim).gradient - self.line.gradient - np.einsum("mij,mj->mi", self.line.hessian, way)
        return np.asarray(np.hypot(overshoot, body.weights[:, None] * np.where(self.moving, bend, off)))


def states(body: BodyOnRanks, x: Any, lam: Array) -> IntArray:
    """Open, stick or slip at the contact points of this rank, by the sizes of all."""
    local = body.local(x)
    sizes = body.ranks.largest(np.abs(local).max(initial=0.0), np.abs(lam).max(initial=0.0))
    return contact_state(local, lam, (float(sizes[0]), float(sizes[1])))


def _positive(curvature: Array) -> Array:
    """Second derivatives (m, d, d) without what is negative, for the preconditioner."""
    if not len(curvature):
        return curvature
    values, vectors = np.linalg.eigh(curvature)
    return np.asarray(np.einsum("mic,mc,mjc->mij", vectors, np.maximum(values, 0.0), vectors))


def _admissible(law: ContactLaw, r: Array) -> Array:
    """The local displacement nearest to ``r`` in the domain of the laws."""
    out = r.copy()
    if not len(r):
        return out
    domain = law.normal.domain
    out[:, 0] = np.clip(out[:, 0], domain.lower, domain.upper)
    if out.shape[1] > 1:
        limit = np.broadcast_to(law.friction.profile.domain.upper, (len(out),))
        size = np.linalg.norm(out[:, 1:], axis=1)
        outside = size > limit
        out[outside, 1:] *= (limit[outside] / size[outside])[:, None]
    return out
