"""Whether a march is right: each of its steps is set up anew and solved by trying all pieces of its laws.

The table comes from the JSON file and the displacements from the frames; the problem file is read again.  The mass, the
stiffness, the viscosity, the loads, the schemes, the friction in rates and the memory of glue are code of this folder.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.robustness.elasticity import Body
from tests.robustness.expression import UnknownError
from tests.robustness.motion import Motion, Stage, State, combined, stages
from tests.robustness.physics import Verdict, read_vtu
from tests.robustness.pieces import Found, Points, alpha_of, damped

__all__ = ["examine_march"]

#: Part of a size by which an accepted step may be off: what its tolerance leaves, times what bodies amplify.
_OFF = 1e-5
#: Part of the displacement by which two solutions of a step are two.
_APART = 1e-4


@dataclass
class _Step:
    """The static problem of a stage, condensed to its contact points."""

    motion: Motion
    stage: Stage
    before: State
    tau: float

    def __post_init__(self) -> None:
        motion, before, tau = self.motion, self.before, self.tau
        self.time = before.time + self.stage.at * tau
        a, b = self.stage.rate, self.stage.acceleration
        p = a[1] * before.v + a[2] * before.w
        q = b[1] * before.v + b[2] * before.w
        self.K = motion.K + a[0] * motion.C + b[0] * motion.M
        self.f = motion.load(self.time) + motion.C @ (a[0] * before.u - p) + motion.M @ (b[0] * before.u - q)
        for (K, span), h in zip(motion.branches, before.branches, strict=True):
            way = self.stage.at * tau
            fade = math.exp(-way / span)
            grows = (1.0 - fade) * span / way
            self.K = self.K + grows * K
            self.f = self.f - K @ (fade * h - grows * before.u)
        self.external = np.linalg.norm(motion.load(self.time)[motion.free])
        self.fixed, free = motion.prescribed(self.time), motion.free
        self.f = self.f - self.K @ self.fixed
        inner = self.K[np.ix_(free, free)]
        np.linalg.cholesky(inner)
        B = motion.B[:, free]
        self.inverse = np.linalg.inv(inner)
        weights = np.repeat(motion.weights, 2)
        self.S = (B @ self.inverse @ B.T) * weights
        gap = motion.gap(self.time)
        self.still = motion.B @ (before.u - p / a[0])  # s - still is the rate over a
        self.start = motion.B @ before.u - motion.gap(before.time)
        self.offset = gap + np.where(np.arange(gap.size) % 2 == 1, self.still, 0.0)
        self.r0 = B @ (self.inverse @ self.f[free]) + motion.B @ self.fixed - self.offset
        drift = motion.B @ p / a[0]
        normal = []
        for k in range(len(motion.nodes)):
            lines = motion.glue(k, float(before.opening[k]))
            normal.append(damped(lines, motion.damping * a[0], float(self.start[2 * k] - drift[2 * k])))
        friction = [motion.friction(k, a[0]) for k in range(len(motion.nodes))]
        self.normal, self.rubbing = normal, friction
        self.points = Points(self.S, normal, friction)

    def place(self, lam: np.ndarray) -> np.ndarray:
        """Displacement (n,) under contact forces per area (2 m,)."""
        motion, free = self.motion, self.motion.free
        u = self.fixed.copy()
        weighted = np.repeat(motion.weights, 2) * lam
        u[free] = self.inverse @ (self.f - motion.B.T @ weighted)[free]
        return u

    def forces(self, u: np.ndarray) -> tuple[np.ndarray, float]:
        """Contact forces per area (2 m,) that balance a displacement, and what is left over at other nodes."""
        motion = self.motion
        rest = self.f + self.K @ self.fixed - self.K @ u
        lam = (motion.B @ rest) / np.repeat(motion.weights, 2)
        lam[1::2][~motion.slides] = 0.0
        rest = rest - motion.B.T @ (np.repeat(motion.weights, 2) * lam)
        return lam, float(np.linalg.norm(rest[motion.free]))

    def local(self, u: np.ndarray) -> np.ndarray:
        """Penetrations, and slips in the step but for those that go on, (2 m,)."""
        return self.motion.B @ u - self.offset

    def units(self, u: np.ndarray | None = None) -> tuple[float, float]:
        """A length and a force per area."""
        parts = [self.r0, self.r0 + self.offset] if u is None else [self.local(u), self.r0, self.r0 + self.offset]
        length = max(float(np.abs(part).max()) for part in parts) or 1.0
        return length, length / float(np.diagonal(self.S).max())

    def allowed(self, u: np.ndarray, lam: np.ndarray) -> float:
        """What tolerance and rounding may leave of the forces."""
        pushed = float(np.linalg.norm(np.repeat(self.motion.weights, 2) * lam))
        return _OFF * (self.external + pushed) + 1e-13 * float(np.linalg.norm(np.abs(self.K) @ np.abs(u)))

    def missed(self, u: np.ndarray) -> float:
        """By how much a displacement misses balance and laws."""
        lam, left = self.forces(u)
        off = self.points.allows(self.local(u), lam, *self.units(u))
        return float(off.max(initial=0.0)) + left / (self.allowed(u, lam) or 1.0) * _OFF

    def solved(self, u: np.ndarray | None = None) -> Found:
        """All solutions."""
        return self.points.solutions(self.r0, *self.units(u))

    def margin(self) -> float | None:
        """``1 - c``, c the softening of the laws against the stiffness; None where friction depends on the state."""
        alphas = []
        for lines, friction in zip(self.normal, self.rubbing, strict=True):
            if friction is not None and friction.lines is None:
                return None
            alphas += [alpha_of(lines), 0.0 if friction is None else alpha_of(friction.lines or [])]
        alpha = np.array(alphas)
        if not np.isfinite(alpha).all():
            return -math.inf
        root = np.sqrt(alpha * np.repeat(self.motion.weights, 2))
        S = self.S / np.repeat(self.motion.weights, 2)
        return 1.0 - float(np.linalg.eigvalsh(root[:, None] * S * root)[-1])


def examine_march(folder: Path, problem: str, answer: str, fields: str, verdict: Verdict) -> None:
    """Examine the answer of ``hemivar march``, with a frame for every step.

    Parameters
    ----------
    folder : Path
        Of the case.
    problem, answer, fields : str
        Names of the problem file, of the JSON file and of the PVD file.
    verdict : Verdict
    """
    try:
        record = json.loads((folder / answer).read_text(encoding="utf-8"))
        data = tomllib.loads((folder / problem).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        verdict.wrong.append(f"a file cannot be read: {error}")
        return
    try:
        _examine(folder, data, record, fields, verdict)
    except UnknownError as error:
        verdict.left_out.append(str(error))


def _frames(folder: Path, fields: str) -> tuple[Body, list[float], list[np.ndarray]]:
    text = (folder / fields).read_text(encoding="utf-8")
    entries = re.findall(r'timestep="([^"]+)"[^>]*file="([^"]+)"', text)
    read = [read_vtu(folder / name) for _, name in entries]
    moved = [u.ravel() for _, u in read if u is not None]
    return read[0][0], [float(time) for time, _ in entries], moved


def _examine(folder: Path, data: Mapping[str, Any], record: Mapping[str, Any], fields: str, verdict: Verdict) -> None:
    body, times, places = _frames(folder, fields)
    table = record["table"]
    if times != table["time"]:
        raise UnknownError("frames are not those of all steps")
    motion = Motion(folder, data, body)
    scheme = data["time"].get("scheme", "implicit-euler")
    scheme = {"name": scheme} if isinstance(scheme, str) else scheme
    state, stated = _initial(motion, places[0]), float(data["time"]["step"])
    books = _Books(motion, scheme["name"], verdict)
    for number in range(1, len(times)):
        row = {name: column[number] for name, column in table.items()}
        tau = float(row["step"])
        where = f"step {number} ({scheme['name']}, t = {times[number]:.4g})"
        verdict.demand(
            abs(times[number] - times[number - 1] - tau) <= 1e-9 * times[number], f"{where} is not {tau} long"
        )
        if tau < 0.75 * stated and (number == 1 or float(table["step"][number - 1]) > 0.75 * stated):
            verdict.examined.append("a step that was divided")
            _divided(motion, scheme, state, stated, where, verdict)
        judge = _Judge(motion, scheme, state, tau, row["margin"], where, verdict)
        new = judge.accepted(places[number], times[number])
        books.add(state, new, judge.forces, row, where)
        state = new
    verdict.examined += ["laws", f"{len(times) - 1} steps"]


class _Judge:
    """The examination of one step."""

    def __init__(
        self, motion: Motion, scheme: Mapping[str, Any], before: State, tau: float, margin: float | None, where: str,
        verdict: Verdict,
    ) -> None:  # fmt: skip
        self.motion, self.before, self.tau, self.where, self.verdict = motion, before, tau, where, verdict
        self.margin = -math.inf if margin is None else float(margin)
        self.stages = stages(scheme, tau, motion.inert)
        self.forces = np.zeros(2 * len(motion.nodes))

    def accepted(self, u: np.ndarray, time: float) -> State:
        """The state after a step that ends at a displacement, which is held against all solutions of the step."""
        motion, before, tau, last = self.motion, self.before, self.tau, self.stages[-1]
        start = before
        if len(self.stages) > 1:  # what the first stage found is nowhere told: one of its solutions leads here
            first = _Step(motion, self.stages[0], before, tau)
            found = first.solved()
            rate = self.stages[0].rate[0]
            starts = [replace(before, v=rate * (first.place(lam) - before.u)) for lam in found.forces]
            tried = [_Step(motion, last, one, tau).missed(u) for one in starts]
            self.verdict.demand(tried, f"{self.where}: its first stage has no solution")
            if not tried:
                return replace(before, time=time, u=u)
            start = starts[int(np.argmin(tried))]
            self._unique(first, found)
        step = _Step(motion, last, start, tau)
        self._stage(step, start.u + (u - start.u) / last.reach)
        way = u - start.u
        h = []
        for (_, span), old in zip(motion.branches, before.branches, strict=True):
            fade = math.exp(-tau / span)
            h.append(fade * old + (1.0 - fade) * span / tau * way)
        opening = np.maximum(before.opening, -(motion.B @ u - motion.gap(time))[::2])
        v, w = (combined(factors, way, start.v, start.w) for factors in (last.velocity, last.last))
        return State(time, u, v, w, tuple(h), opening)

    def _stage(self, step: _Step, u: np.ndarray) -> None:
        demand, where = self.verdict.demand, self.where
        self.forces, left = step.forces(u)
        demand(left <= step.allowed(u, self.forces), f"{where}: {left:.2g} of the load is not balanced")
        r, (length, force) = step.local(u), step.units(u)
        off = float(step.points.allows(r, self.forces, length, force).max(initial=0.0))
        demand(off <= _OFF, f"{where}: places and forces miss the laws by {off:.2g}")
        found = step.solved(u)
        near = min((float(np.abs(one - r).max()) / length for one in found.places), default=math.inf)
        if found.doubt:
            self.verdict.left_out.append(f"{where}: pieces with a continuum of solutions")
        else:
            count = len(found.places)
            demand(near <= 10.0 * _OFF, f"{where}: {count} solutions by enumeration, the nearest {near:.2g} away")
        self._unique(step, found)
        own = step.margin()
        if own is not None and self.margin > 0.0:
            more = self.margin - own
            demand(more <= 1e-6 * max(1.0, abs(own)), f"{where}: the margin is {self.margin:.6g}, and not {own:.6g}")

    def _unique(self, step: _Step, found: Found) -> None:
        """Where one solution is claimed there is no other."""
        apart = found.apart(step.units()[0])
        claim = f"{self.where}: margin {self.margin:.3g}, but solutions that are {apart:.2g} apart"
        self.verdict.demand(not self.margin > 0.0 or apart <= _APART, claim)


def _divided(
    motion: Motion, scheme: Mapping[str, Any], before: State, tau: float, where: str, verdict: Verdict
) -> None:
    """A step that has one solution is not divided."""
    parts = stages(scheme, tau, motion.inert)
    step = _Step(motion, parts[0], before, tau)
    found = step.solved()
    alone = len(parts) == 1 and len(found.places) and not found.doubt and found.apart(step.units()[0]) <= _APART
    verdict.demand(not alone, f"{where}: a step of {tau:g} has one solution, and was divided")


class _Books:
    """The energies of a march, booked anew."""

    def __init__(self, motion: Motion, scheme: str, verdict: Verdict) -> None:
        self.motion, self.verdict = motion, verdict
        self.euler = scheme == "implicit-euler" and all(given == 0.0 for given in motion.held.values())
        self.sums = {"work": 0.0, "viscous": 0.0, "friction": 0.0}
        self.start: float | None = None

    def add(self, old: State, new: State, lam: np.ndarray, row: Mapping[str, float], where: str) -> None:
        motion, way = self.motion, new.u - old.u
        known = {"elastic": 0.5 * new.u @ motion.K @ new.u, "kinetic": 0.5 * new.v @ motion.M @ new.v}
        known["branches"] = sum((0.5 * h @ K @ h for (K, _), h in zip(motion.branches, new.branches, strict=True)), 0.0)
        if self.euler:
            tau = new.time - old.time
            self.sums["work"] += motion.load(new.time) @ way
            self.sums["viscous"] += way @ motion.C @ way / tau
            force = np.repeat(motion.weights, 2) * lam
            self.sums["friction"] += force[1::2] @ (motion.B @ way)[1::2]
            known |= self.sums
        lost = ("viscous", "branch_loss", "friction", "damping", "memory", "numerical", "jumps")
        stored = ("elastic", "branches", "contact", "kinetic")
        size = max(abs(row[name]) for name in ("work", "moved", *stored, *lost))
        for name, number in known.items():
            off = abs(row[name] - number)
            self.verdict.demand(off <= _OFF * size, f"{where}: {name} is {row[name]:.6g}, and not {number:.6g}")
        self.verdict.demand(abs(row["gap"]) <= _OFF * size, f"{where}: {row['gap']:.2g} of {size:.2g} is not booked")


def _initial(motion: Motion, u: np.ndarray) -> State:
    """The start, with the acceleration of what acts there; cases touch nothing and rub nothing then."""
    speed = motion.time.get("initial", {}).get("velocity", [0.0, 0.0])
    v = np.tile([motion.number(part, 0.0) for part in speed], len(motion.body.nodes))
    v[list(motion.held)] = 0.0
    w = np.zeros(u.size)
    if motion.inert:
        free = motion.free
        force = motion.load(0.0) - motion.K @ u - motion.C @ v
        w[free] = np.linalg.solve(motion.M[np.ix_(free, free)], force[free])
    # a body that yields at once was at rest before, where its gaps were open
    opening = np.maximum(-(motion.B @ u - motion.gap(0.0))[::2], np.maximum(motion.gap(0.0)[::2], 0.0))
    stretched = u if motion.yields_at_once else np.zeros(u.size)
    return State(0.0, u, v, w, tuple(stretched for _ in motion.branches), opening)
