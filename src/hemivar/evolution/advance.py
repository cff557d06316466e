"""A step: a pure function from one moment to the next."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.deadline import check_time
from hemivar.basics.relaxation import squares_of_relaxation
from hemivar.basics.types import Array, IntArray
from hemivar.branches import find_solutions
from hemivar.certify.smallness import Smallness, smallness
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import MethodError
from hemivar.evolution.balance import allowed_work, rounding_of
from hemivar.evolution.descent import TIGHT, downhill, slowed
from hemivar.evolution.discrete import Acting, Bodies, DiscreteEvolution
from hemivar.evolution.expectation import expected_contact
from hemivar.evolution.jump_paths import JumpPaths
from hemivar.evolution.jumps import Jump, Leap
from hemivar.evolution.ledger import Ledger
from hemivar.evolution.moment import Moment, Motion
from hemivar.evolution.operators import Operator
from hemivar.evolution.products import Products
from hemivar.evolution.schemes import ImplicitEuler, Rule, Scheme
from hemivar.evolution.stage import (
    Force,
    Ground,
    Stage,
    apply,
    body_factors,
    decay,
    expected_multiplier,
    gain,
    ground_of,
    left_over,
    posed_stage,
    reached_forces,
    stretching,
)
from hemivar.evolution.step_laws import BlockLaw, Foundations, StepLaw, stage_law
from hemivar.laws import ContactLaw
from hemivar.laws.memory import LocalStep
from hemivar.solvers import (
    Controls,
    NonsmoothMultigrid,
    NonsmoothNewton,
    SemismoothNewton,
    Solution,
    Solver,
    Status,
    solve,
)
from hemivar.solvers.choice import choose
from hemivar.solvers.nearby import OutOfBalance, Pieces, nearby_solution
from hemivar.solvers.solve import suited
from hemivar.systems.body_on_levels import set_up
from hemivar.systems.workspace import Workspace

__all__ = ["Advance", "Taken"]

#: Rounds of a law that depends on the solution of its own step, and when it stands.
_ROUNDS = 60
_STANDS = 1e-10
#: Part of the tolerance of a step that cycles of multigrid leave.
_SHARE = 0.9
#: Part of the size of what is added up by which rounding may be taken for half of a tolerance.
_ROUNDING = 16.0 * float(np.finfo(float).eps)
#: Ends that a tolerance below what the arithmetic allows may have.
_UNSETTLED = (Status.INACCURATE, Status.MAX_STEPS, Status.STALLED, Status.CYCLING)
#: Part of load and contact forces to which the forces of a short step must be known.
_KNOWN = 1e-5
#: Steps of a method after which it is clear that rounding keeps it from its tolerance.
_FEW = 30
#: Contact components up to which small matrices are dense ones.
_DENSE = 4000
#: Bodies and laws whose constants are kept.
_BODIES = 8
#: Times whose loads are kept.
_TIMES = 8


@dataclass(frozen=True, eq=False)
class Taken:
    """A step that was taken.

    Attributes
    ----------
    before, moment : Moment
    step : float
    solutions : tuple of Solution
        Of its stages.
    stages : tuple of Stage
    leaps : tuple of Leap
        Jumps on the way, where the path of equilibria was followed.
    heat : Taken or None
        The step of heat that belongs to it.
    advice : str
        Where the status says too little: what happened, and what to try.
    """

    before: Moment
    moment: Moment
    step: float
    solutions: tuple[Solution, ...]
    stages: tuple[Stage, ...]
    leaps: tuple[Leap, ...] = ()
    heat: Taken | None = None
    advice: str = ""

    @property
    def remedy(self) -> str:
        """What happened in words, and what to try."""
        return self.advice or self.status.remedy

    @property
    def status(self) -> Status:
        """The first status that is not convergence, if there is one."""
        return next((s.status for s in self.solutions if s.status is not Status.CONVERGED), Status.CONVERGED)

    @property
    def residual(self) -> float:
        """Largest relative residual of the stages, and of heat."""
        own = max(solution.residual.relative for solution in self.solutions)
        return own if self.heat is None else max(own, self.heat.residual)


@dataclass(frozen=True, eq=False)
class _Reached:
    """Where unknowns (n,) of a stage lead."""

    stage: Stage
    unknowns: Array
    way: Array  # x* - x, from the beginning of the stage
    motion: Motion  # x*, v*, w*
    forces: dict[str, Force]


@dataclass(frozen=True, eq=False)
class _Solved:
    stage: Stage
    solution: Solution
    reached: _Reached
    local: Motion  # r*, the slip whole
    own: Array  # the multiplier without the laws of the rate of the penetration
    resistance: float  # in units of the stiffness
    leaps: tuple[Leap, ...] = ()

    @property
    def rate(self) -> Motion:
        """x*, v*, w*."""
        return self.reached.motion


class Advance:
    """Takes steps of an evolution.  What it keeps between them only saves work.

    Parameters
    ----------
    discrete : DiscreteEvolution
    scheme : Scheme
    solver : Solver or None
        Of all steps; by default what suits the elastic body, so that it is the same in a march that is resumed.
    controls : Controls
    workspace : Workspace, optional
    """

    def __init__(
        self,
        discrete: DiscreteEvolution,
        scheme: Scheme,
        solver: Solver | None,
        controls: Controls,
        workspace: Workspace | None = None,
    ) -> None:
        self.discrete = discrete
        self.scheme = scheme
        self.solver = _method(discrete) if solver is None else solver
        self.controls = controls
        self.bodies = Bodies(discrete)
        self.workspace = Workspace.given(workspace)
        #: Whether viscosity or a mass chooses among several solutions; branches, which yield at once, do not.
        self.resists = discrete.mass is not None or discrete.viscosity is not None
        #: What takes the steps of heat.
        self.beside: Advance | None = None
        self._smallness: OrderedDict[tuple[object, ...], tuple[object, Smallness]] = OrderedDict()
        self._constants: OrderedDict[tuple[object, ...], tuple[object, float]] = OrderedDict()
        self._acting: OrderedDict[float, Acting] = OrderedDict()
        self._steady = not discrete.evolution.problem.time_dependent
        #: Times at which what acts may jump, and how near to them it is looked at; see :meth:`acting_before`.
        self.stops: Mapping[float, float] = {}
        self._sides: dict[float, tuple[float, float]] = {}
        self._law: tuple[ContactLaw, float, StepLaw] | None = None
        self._grounds: OrderedDict[float, tuple[Ground, ...]] = OrderedDict()
        self._asked: tuple[object, object, float] = None, None, 0.0
        self._pieces: OrderedDict[int, tuple[object, Pieces]] = OrderedDict()
        self._foundations = Foundations(discrete)
        self._reached: _Reached | None = None
        self.products = Products(discrete)
        self.paths = JumpPaths(discrete, self.bodies, self.workspace)

    def acting(self, time: float) -> Acting:
        """What acts at a time."""
        key = self.discrete.evolution.start if self._steady else time
        found = self._acting.get(key)
        if found is None:
            found = self._acting[key] = self.discrete.acting(key)
            while len(self._acting) > _TIMES:
                self._acting.popitem(last=False)
        return found

    def acting_before(self, time: float) -> Acting:
        """What acts just before a time: another than just after it at those of :attr:`stops` at which it jumps."""
        return self.acting(self._sides_of(time)[0])

    def acting_after(self, time: float) -> Acting:
        """What acts just after a time."""
        return self.acting(self._sides_of(time)[1])

    def acting_on(self, moment: Moment) -> Acting:
        """What acts on the body just after a moment, whatever step was taken before."""
        return self.acting_after(moment.time)

    def jumps_at(self, time: float) -> bool:
        """Whether what acts jumps at one of the :attr:`stops`."""
        before, after = self._sides_of(time)
        return before != after

    def _sides_of(self, time: float) -> tuple[float, float]:
        """Times at which what acts just before and just after a time is looked at: both the time itself but at jumps.

        Loads, supports and gaps are looked at, laws are not.
        """
        near = self.stops.get(time)
        if near is None or self._steady:
            return time, time
        found = self._sides.get(time)
        if found is None:
            first = time <= self.discrete.evolution.start  # nothing acts before it
            times = [time if first else time - part * near for part in (2.0, 1.0)]
            times += [time + part * near for part in (1.0, 2.0)]
            far, left, right, away = (self.acting(one) for one in times)
            jumps = _jumps(self.discrete, far, left, right, away)
            found = self._sides[time] = (times[1], times[2]) if jumps else (time, time)
        return found

    def take(self, before: Moment, step: float, end_time: float | None = None, jump: Jump = Jump.LOCAL) -> Taken:
        """One step; the moment before it stays as it is.

        Parameters
        ----------
        before : Moment
        step : float
        end_time : float, optional
            Where it ends, if rounding of ``before.time + step`` matters.
        jump : Jump
            Which solution is taken where there may be several.
        """
        reached = before.time + step if end_time is None else end_time
        start, end = self.acting_before(before.time), self.acting_before(reached)
        solved: list[_Solved] = []
        base = before
        grounds = self._grounds_of(step)
        if grounds[0].rule.restitution is not None and end.offset is not start.offset:
            base = self._along(before, (end.offset - start.offset) / step)
        for ground in grounds:
            at = end if ground.rule.at == 1.0 else self.acting(before.time + ground.rule.at * step)
            solved.append(self._stage(base, ground, at, end, start, jump))
            if solved[-1].solution.status is not Status.CONVERGED:
                break
            if len(grounds) > 1:
                base = replace(
                    before,
                    body=replace(before.body, velocity=solved[-1].rate.velocity),
                    local=replace(before.local, velocity=solved[-1].local.velocity),
                )
        moment = self._end(before, solved, step, reached, start, end)
        leaps = tuple(leap for s in solved for leap in s.leaps)
        taken = Taken(before, moment, step, tuple(s.solution for s in solved), tuple(s.stage for s in solved), leaps)
        return self._balanced(taken, solved)

    def _balanced(self, taken: Taken, solved: list[_Solved]) -> Taken:
        """A step, not solved if its balance of energy does not close to what the residual allows."""
        before, moment = taken.before, taken.moment
        gap, work = (abs(getattr(moment.ledger, name) - getattr(before.ledger, name)) for name in ("gap", "work"))
        least = max(rounding_of(moment.ledger), self.controls.rtol * work)  # no more than what is allowed
        if gap <= least or taken.status is not Status.CONVERGED or not self.discrete.vectors.alone:
            return taken
        allowed = 0.0
        for part in solved:
            rule = part.stage.rule
            way = rule.share * taken.step * part.rate.velocity
            if len(solved) == 1:
                way = moment.body.place - before.body.place
            allowed += allowed_work(
                self.discrete, self.products, part.stage, part.rate, part.reached.forces, part.solution.multiplier,
                way, self.controls.rtol,
            )  # fmt: skip
        if gap <= allowed:
            return taken
        off = replace(taken.solutions[-1], status=Status.INACCURATE)
        advice = (
            f"the balance of energy does not close: {gap:.3g} is left where the residual allows {allowed:.3g}; forces "
            "cancel that are far larger than those that act, as where a part of the body has next to no mass"
        )
        if self.discrete.mass is not None:
            advice += "; take implicit-euler, or give it a mass like that of the other parts"
        return replace(taken, solutions=(*taken.solutions[:-1], off), advice=advice)

    def _along(self, before: Moment, rate: Array) -> Moment:
        """A moment at which gaps begin to change at the rate (m, c) that they have in the whole step."""
        traced = self.discrete.problem.contact.traced(before.body.velocity[: self.discrete.unknowns])
        return replace(before, local=replace(before.local, velocity=traced - rate))

    def at_once(self, before: Moment, span: float, start: Acting, now: Acting, jump: Jump = Jump.LOCAL) -> Taken:
        """A short step of implicit Euler, after which the time is what it was.

        Parameters
        ----------
        before : Moment
        span : float
            Its length.
        start, now : Acting
            What acts at its beginning and at its end.
        jump : Jump
            Which solution is taken where there may be several.
        """
        (rule,) = ImplicitEuler().rules(span)
        kept = self.workspace
        if self.resists or self.discrete.branches:
            self.workspace = Workspace()  # its factors are given back
        try:
            ground = ground_of(self.discrete, self.bodies, rule, span)
            solved = self._stage(before, ground, now, now, start, jump)
        finally:
            self.workspace = kept
        moment = self._end(before, [solved], span, before.time, start, now)
        return Taken(before, moment, span, (solved.solution,), (solved.stage,), solved.leaps)

    def _rules(self, step: float) -> tuple[Rule, ...]:
        scheme = self.scheme
        return scheme.massless_rules(step) if self.discrete.mass is None else scheme.rules(step)

    def _grounds_of(self, step: float) -> tuple[Ground, ...]:
        """What the stages of a step of this length share, whatever the moment."""
        found = self._grounds.get(step)
        if found is None:
            rules = self._rules(step)
            found = self._grounds[step] = tuple(ground_of(self.discrete, self.bodies, rule, step) for rule in rules)
            while len(self._grounds) > _BODIES:
                self._grounds.popitem(last=False)
        self._grounds.move_to_end(step)
        return found

    def started(self, moment: Moment) -> Moment:
        """The moment at the beginning with all else that it holds beside the motion."""
        return moment

    def told(self, moment: Moment) -> dict[str, float]:
        """What a row of the table says beside forces, probes and the ledger, by names of columns."""
        return {}

    def excess(self, problem: DiscreteProblem) -> float:
        """``c - 1`` of a problem: how much stiffer the body must be to leave one solution; negative if it is.

        Bounds that depend on the solution are taken as they are before the step.
        """
        if not problem.contact_points:
            return -1.0
        if problem.law.state_dependent:
            law = problem.law.frozen_at(-problem.offset)
            if not any(np.any(alpha) for alpha in law.weak_convexity):
                return -1.0
            problem = problem.with_(law=law)
        return self.constant(problem) - 1.0

    def constant(self, problem: DiscreteProblem) -> float:
        """The constant c of a problem whose law depends on no state, ``1 - c`` being its margin.

        Of a body that is condensed anyway it is the largest eigenvalue of a small matrix; else that of
        :meth:`smallness`.
        """
        stiffness, law = problem.stiffness, problem.law
        if self._asked[0] is stiffness and self._asked[1] is law:
            return self._asked[2]
        found = self._constant(problem)
        self._asked = stiffness, law, found
        return found

    def _constant(self, problem: DiscreteProblem) -> float:
        alphas = problem.law.weak_convexity
        if not any(alpha.any() for alpha in alphas):
            return 0.0
        if not self._condenses(problem):
            return self.smallness(problem).constant
        key = (id(problem.stiffness), *(np.asarray(alpha).tobytes() for alpha in alphas))
        known = self._constants.get(key)
        if known is None:
            body = self.workspace.condensed(problem, many=True).body
            known = self._constants[key] = problem.stiffness, body.softening(*alphas)
        self._constants.move_to_end(key)
        while len(self._constants) > _BODIES:
            self._constants.popitem(last=False)
        return known[1]

    def _condenses(self, problem: DiscreteProblem) -> bool:
        """Whether steps are solved on the body condensed onto its contact points, by the default method."""
        return (
            isinstance(self.solver, SemismoothNewton if problem.law.state_dependent else NonsmoothNewton)
            and problem.contact_points > 0
            and problem.offset.size <= _DENSE
        )

    def _condense(self, problem: DiscreteProblem) -> None:
        """Condense a body as steps with one solution do: answers must not depend on which steps were taken before."""
        if self._condenses(problem):
            self.workspace.condensed(problem, many=True)

    def smallness(self, problem: DiscreteProblem) -> Smallness:
        """The constants of a problem whose law depends on no state: those of stiffness and weak convexity alone."""
        stiffness = problem.stiffness
        key = (id(stiffness), *(np.asarray(alpha).tobytes() for alpha in problem.law.weak_convexity))
        if key not in self._smallness:
            found = smallness(problem, trace_constant=False, workspace=self.workspace)
            self._smallness[key] = stiffness, found  # the matrix is held, so that its identity stays its own
        self._smallness.move_to_end(key)
        while len(self._smallness) > _BODIES:
            self._smallness.popitem(last=False)
        return self._smallness[key][1]

    def tried(self, before: Moment, step: float) -> list[tuple[tuple[float, ...], ContactLaw]]:
        """For each stage of a step, not solved: what makes its body, see :meth:`Bodies.body`, and its law.

        The state of ``before`` stands for what the stages would find.
        """
        found = []
        guess = np.zeros(before.local.place.shape)
        guess[:, 0] = before.local.place[:, 0]
        for rule in self._rules(step):
            timed = "law" in self.discrete.evolution.problem.time_dependent
            acting = self.acting(before.time + (rule.at * step if timed else 0.0))
            law = stage_law(self.discrete, acting, before, rule, step, guess, before.multiplier)
            found.append((body_factors(self.discrete, rule, step), law.law))
        return found

    def _stage(self, base: Moment, ground: Ground, at: Acting, end: Acting, start: Acting, jump: Jump) -> _Solved:
        guess, multiplier = np.zeros(base.local.place.shape), base.multiplier
        guess[:, 0] = base.local.place[:, 0]
        initial: Solution | None = None
        vectors = self.discrete.vectors
        for _ in range(_ROUNDS):
            check_time()
            law = self._stage_law(at, base, ground.rule, ground.step, guess, multiplier)
            stage = posed_stage(self.discrete, self.bodies, base, ground, at, end, start, law, self.products)
            leaps: tuple[Leap, ...] = ()
            if jump.follows and not self.resists and (excess := self.excess(stage.problem)) >= 0.0:
                _refuse_without_energy(stage.problem, jump)
                self._condense(stage.problem)
                followed = self.paths.follow(stage, excess, jump, self.solver, self._controls(stage))
                solution, resistance, leaps = followed.solution, 0.0, followed.leaps
            else:
                solution, resistance = self._solution(stage, initial, jump)
            local = stage.local(solution)
            point = stage.motion(local, base.local)
            own = _undamped(law, point, solution.multiplier)
            again = law.iterates and solution.status is Status.CONVERGED
            if not (again if vectors.alone else vectors.largest(float(again))[0]):
                break
            found = local.copy()
            found[:, 1:] -= base.local.place[:, 1:]
            change, size, pressed, level = vectors.largest(
                float(np.abs(found - guess).max(initial=0.0)),
                float(np.abs(local).max(initial=0.0)),
                float(np.abs(own - multiplier).max(initial=0.0)),
                float(np.abs(own).max(initial=0.0)),
            ).tolist()
            if change <= _STANDS * size and pressed <= _STANDS * level:
                break
            guess, multiplier, initial = found, own, solution
        else:
            solution = replace(solution, status=Status.NOT_CONTRACTING)
        off = solution.residual  # it is told against all that the tolerance was held against
        solution = replace(solution, residual=replace(off, scale=off.scale + self._size(stage)))
        reached = self._reached_by(stage, solution.unknowns)
        return _Solved(stage, solution, reached, point, own, resistance, leaps)

    def _reached_by(self, stage: Stage, unknowns: Array) -> _Reached:
        """Motion and forces of unknowns (n,) of a stage; the last are known again."""
        known = self._reached
        if known is None or known.stage is not stage or known.unknowns is not unknowns:
            place, before = stage.displacement(unknowns), stage.before.body
            way = place - before.place
            motion = stage.moved(place, way, before)
            forces = reached_forces(self.discrete, stage, motion, self.products)
            known = self._reached = _Reached(stage, unknowns, way, motion, forces)
        return known

    def _stage_law(self, at: Acting, base: Moment, rule: Rule, step: float, guess: Array, multiplier: Array) -> StepLaw:
        """The law of a stage; where points remember nothing it is that of the stage before while the step stays."""
        known, rate = self._law, rule.rate.difference
        if known is not None and known[0] is at.law and known[1] == rate:
            return known[2]
        law = stage_law(self.discrete, at, base, rule, step, guess, multiplier, self._foundations)
        if not law.blocks and rule.restitution is None and not rule.conserving:
            self._law = at.law, rate, law
        return law

    def _solution(self, stage: Stage, initial: Solution | None, jump: Jump) -> tuple[Solution, float]:
        """The solution of a stage, and the resistance that it was found against, in units of the stiffness."""
        controls = self._controls(stage)
        found = self._sought(stage, initial, jump, controls)
        if found[0].status in _UNSETTLED and controls.rtol > 0.0:
            # In so short a step forces may not be known to the tolerance, for displacements are not; flows of heat that
            # the rounding of temperatures hides change none.
            known = _rounding(stage)
            if _hides(known, controls) or (self.discrete.stores and known > controls.atol):
                found = self._sought(stage, initial, jump, controls.within(known))
            elif controls.atol == 0.0:  # nothing acts yet that they could be held against, as before a jump
                again = self._sought(stage, initial, jump, controls.within(known / TIGHT))
                found = again if again[0].residual.relative <= _KNOWN else found
        return found

    def _sought(self, stage: Stage, initial: Solution | None, jump: Jump, controls: Controls) -> tuple[Solution, float]:
        """The same to a tolerance."""
        problem = stage.problem
        excess = self.excess(problem)
        if excess < 0.0:
            near = _at_rest(problem) if self.discrete.vectors.alone else None
            if near is None:
                near = self._nearby(stage, initial, controls)
            if near is not None:
                return near, 0.0
            if _hides(_rounding(stage), controls):  # it is looked for again, to what is known
                controls = replace(controls, max_steps=min(controls.max_steps or _FEW, _FEW))
        start = np.zeros(problem.unknowns) if initial is None else initial.unknowns
        if excess < 0.0:
            method = _as_accurate(self.solver, controls)
            if initial is None:
                start, method = self._foreseen(stage, start, method)
            return solve(problem, method, controls, initial=start, workspace=self.workspace), 0.0
        self._condense(problem)
        if jump is Jump.GLOBAL and not self.resists:
            _refuse_without_energy(problem, jump)
            found = find_solutions(problem, workspace=self.workspace)
            if found.solutions:
                return min(found.solutions, key=lambda solution: solution.energy), 0.0
        slow = slowed(self.bodies, problem, excess)
        if jump is Jump.VISCOUS and not self.resists:
            if slow.contact is not None:
                raise MethodError(
                    "jump = 'viscous' takes a viscosity of the body, and the supports alone do not hold this one; take "
                    "jump = 'local' or 'arc-length'"
                )
            return solve(slow.problem, self.solver, controls, initial=start, workspace=self.workspace), slow.resistance
        return downhill(problem, slow, start, self.solver, controls, self.workspace), 0.0

    def _foreseen(self, stage: Stage, start: Array, method: Solver | None) -> tuple[Array, Solver | None]:
        """Where a method starts from, and how: multigrid with the contact points where they are expected."""
        inert = self.discrete.mass is not None
        if not inert or not isinstance(method, NonsmoothMultigrid) or method.refuse(stage.problem) is not None:
            return start, method
        expected = expected_contact(stage, set_up(stage.problem, self.workspace))
        return (start, method) if expected is None else (expected, replace(method, settled=True))

    def _nearby(self, stage: Stage, initial: Solution | None, controls: Controls) -> Solution | None:
        """The one solution of a stage, if a few of Newton's equations lead to it from what is expected."""
        problem, base = stage.problem, stage.before
        if not self._condenses(problem):
            return None
        system = self.workspace.condensed(problem, many=True)
        if initial is None:
            span = stage.rule.at * stage.step
            r = base.local.place + span * base.local.velocity - stage.origin
            lam = expected_multiplier(base, span)
        else:
            r, lam = initial.local, initial.multiplier

        enough = controls.atol / _ROUNDING

        def left(unknowns: Array) -> OutOfBalance:
            reached = self._reached_by(stage, unknowns)
            return left_over(self.discrete, stage, reached.motion, reached.forces, self.products, enough)

        known = left if stage.held else None
        return nearby_solution(system, r, lam, controls, self._pieces_of(problem), known)

    def _pieces_of(self, problem: DiscreteProblem) -> Pieces:
        """What is kept of Newton's equations of a body."""
        stiffness = problem.stiffness
        found = self._pieces.get(id(stiffness))
        if found is None:
            found = self._pieces[id(stiffness)] = stiffness, Pieces()
            while len(self._pieces) > _BODIES:
                self._pieces.popitem(last=False)
        return found[1]

    def _controls(self, stage: Stage) -> Controls:
        """Tolerances: a load that is left where all balances already is no measure."""
        return self.controls.within(self.controls.rtol * self._size(stage))

    def _size(self, stage: Stage) -> float:
        """Size of the forces that act on a stage: its load, and the contact forces before it."""
        contact, n, lam = self.discrete.problem.contact, stage.problem.unknowns, stage.before.multiplier
        if self.discrete.vectors.alone:
            load = self.products.norm(stage.load) if stage.held else norm(stage.load[:n])
            return load + norm(contact.pressed(contact.weights[:, None] * lam))
        return float(self.discrete.vectors.norms(stage.load[:n], contact.force(lam)).sum())

    def _end(
        self, before: Moment, solved: list[_Solved], step: float, time: float, start: Acting, end: Acting
    ) -> Moment:
        """The moment at the end of a step, with the ledger."""
        last = solved[-1]
        rule, base = last.stage.rule, last.stage.before
        n, stretched = self.discrete.unknowns, None
        if rule.ends and base is before and last.stage.held:  # the stage is the end
            body, point = last.rate, last.local
            if self.discrete.mass is not None and self.discrete.vectors.alone:
                stretched = stretching(last.stage, body, last.solution.multiplier, self.products)
            difference = last.reached.way
        else:
            difference = rule.reach * (last.rate.place - before.body.place)
            place = last.rate.place.copy() if rule.reach == 1.0 else before.body.place + difference
            place[n:] = end.prescribed
            slid = rule.reach * (last.local.place - before.local.place)
            local = before.local.place + slid
            body, point = (
                Motion(place, apply(rule.new_velocity, way, motion), apply(rule.new_acceleration, way, motion))
                for place, way, motion in ((place, difference, base.body), (local, slid, base.local))
            )
        branches = tuple(
            decay(period, step) * h + gain(period, step, 1.0 / step) * difference
            for h, (period, _) in zip(before.branches, self.discrete.branches, strict=True)
        )
        memory = dict(before.memory)
        for block in last.stage.law.blocks:
            if block.name in memory:
                memory[block.name] = block.memory.advance(
                    block.given,
                    before.memory[block.name],
                    _whole(block, rule, step),
                    _since(point.place, before, block.index),
                    last.own[block.index],
                )
        moment = Moment(
            time, before.index + 1, body, point, last.solution.multiplier, branches, memory, before.ledger, before.heat
        )
        whole = difference if body is last.rate else body.place - before.body.place
        ledger = self._booked(before, moment, whole, solved, step)
        return Moment(
            time, moment.index, body, point, moment.multiplier, branches, memory, ledger, before.heat, stretched
        )

    # ---- the ledger ------------------------------------------------------------------------------------------

    def energies(self, moment: Moment, law: StepLaw) -> dict[str, float]:
        """Energies of a moment by name."""
        discrete, x, v = self.discrete, moment.body.place, moment.body.velocity
        weights = discrete.problem.contact.weights
        contact = 0.0
        if weights.size:
            normal = moment.local.place[:, 0]
            if law.blocks:
                for block in law.blocks:
                    w, r = weights[block.index], moment.local.place[block.index]
                    ends, state = block.base.normal.domain, moment.memory.get(block.name, {})
                    seen = block.memory.seen(state, r)[:, 0]
                    beyond = seen - np.clip(seen, ends.lower, ends.upper)
                    r = np.column_stack([r[:, 0] - beyond, r[:, 1:]])
                    contact += float(w @ block.memory.stored(block.base, state, r))
            else:
                stored = law.stored.normal
                ends = stored.domain
                inside = np.minimum(np.maximum(normal, ends.lower), ends.upper)
                value = stored.piece_value(stored.piece_of(inside), inside)
                contact = float(weights @ (value if value.shape == weights.shape else np.full(weights.shape, value)))
        own = {
            "elastic": 0.5 * float(x @ self.products.stiffness(x)),
            "kinetic": 0.0 if discrete.mass is None else 0.5 * float(v @ self.products.mass(v)),
            "branches": sum(part.energy(h) for h, (_, part) in zip(moment.branches, discrete.branches, strict=True)),
            "contact": contact,
        }
        return dict(zip(own, discrete.vectors.total(*own.values()).tolist(), strict=True))

    def _booked(self, before: Moment, moment: Moment, whole: Array, solved: list[_Solved], step: float) -> Ledger:
        """The ledger at the end of a step that moves the body by ``whole`` (n + k,)."""
        discrete, n = self.discrete, self.discrete.unknowns
        weights = discrete.problem.contact.weights[:, None]
        old, single = before.ledger, len(solved) == 1
        slid = moment.local.place - before.local.place
        work = moved = viscous = friction = damping = jumps = 0.0
        internal = inertial = relaxing = normal = 0.0
        for part in solved:
            stage = part.stage
            du = whole if single else stage.rule.share * step * part.rate.velocity
            dr = slid if single else stage.rule.share * step * part.local.velocity
            acts = part.reached.forces
            done = {name: force.on(du) for name, force in acts.items()}
            internal += done["internal"]
            viscous += done.get("viscous", 0.0)
            inertial += done.get("inertial", 0.0)
            relaxing += done.get("relaxing", 0.0)
            if part.resistance:  # the force that resisted
                held_back = stage.problem.stiffness @ part.solution.unknowns
                jumps += part.resistance * float(du[:n] @ held_back)
            work += float(stage.load @ du)
            lam = part.solution.multiplier
            pressed = weights * lam
            if du.size > n:
                moved += sum(force.factor * float(force.vector[n:] @ du[n:]) for force in acts.values())
                moved -= float(stage.load[n:] @ du[n:])
            if lam.size and not stage.still:
                shifted = discrete.problem.contact.traced(du[:n]) - dr
                moved -= float((pressed * shifted).sum())
            normal += float(pressed[:, 0] @ dr[:, 0])
            friction += float((pressed * dr)[:, 1:].sum())
            if part.own is not lam:
                damping += float(weights[:, 0] @ ((lam - part.own) * dr)[:, 0])
        law = solved[-1].stage.law
        now = self.energies(moment, law)
        lost = sum(
            _branch_loss(branch, h, whole / step, period, step)
            for h, (period, branch) in zip(before.branches, discrete.branches, strict=True)
        )
        memory = 0.0
        for block in law.blocks:
            if block.name in before.memory:
                here = _since(moment.local.place, before, block.index)
                pressed = solved[-1].own[block.index]
                old_state, new_state = before.memory[block.name], moment.memory[block.name]
                local = _whole(block, solved[-1].stage.rule, step)
                memory += float(
                    weights[block.index, 0]
                    @ block.memory.dissipated(block.given, old_state, new_state, local, here, pressed)
                )
        work, moved, viscous, friction, damping, internal, inertial, relaxing, normal, lost, memory = (
            discrete.vectors.total(
                work, moved, viscous, friction, damping, internal, inertial, relaxing, normal, lost, memory
            ).tolist()
        )
        numerical = (
            internal
            - (now["elastic"] - old.elastic)
            + inertial
            - (now["kinetic"] - old.kinetic)
            + relaxing
            - (now["branches"] - old.branches)
            - lost
            + normal
            - (now["contact"] - old.contact)
            - damping
            - memory
        )
        lost_at_once = sum(leap.lost for part in solved for leap in part.leaps)
        return Ledger(
            work=old.work + work,
            moved=old.moved + moved,
            start=old.start,
            viscous=old.viscous + viscous,
            branch_loss=old.branch_loss + lost,
            friction=old.friction + friction,
            damping=old.damping + damping,
            memory=old.memory + memory,
            numerical=old.numerical + numerical - lost_at_once,
            jumps=old.jumps + jumps + lost_at_once,
            thermal=old.thermal,
            **now,
        ).closed()


def _method(discrete: DiscreteEvolution) -> Solver | None:
    """What suits the elastic body; None over ranks, whose engine has one."""
    return suited(choose(discrete.problem)[0], discrete.problem) if discrete.vectors.alone else None


def _jumps(discrete: DiscreteEvolution, far: Acting, left: Acting, right: Acting, away: Acting) -> bool:
    """Whether loads or places change between the two times in the middle by more than three times as much as beside
    them, rounding aside."""

    def change(one: Acting, other: Acting) -> Array:
        pairs = (one.load - other.load, one.prescribed - other.prescribed, one.offset - other.offset)
        return discrete.vectors.largest(*(float(np.abs(pair).max(initial=0.0)) for pair in pairs))

    sizes = (np.maximum(np.abs(a), np.abs(b)) for a, b in (
        (left.load, right.load), (left.prescribed, right.prescribed), (left.offset, right.offset)
    ))  # fmt: skip
    rounding = _ROUNDING * discrete.vectors.largest(*(float(size.max(initial=0.0)) for size in sizes))
    beside = change(far, left) + change(right, away)
    return bool((change(left, right) > 3.0 * beside + rounding).any())


def _refuse_without_energy(problem: DiscreteProblem, jump: Jump) -> None:
    """Refuse choices among equilibria by their energy, or along paths of its minimisers, where there is none.

    Raises
    ------
    MethodError
    """
    if problem.law.state_dependent:
        raise MethodError(
            f"jump = '{jump}' asks for an energy, which a body has not whose friction has a bound that depends on the "
            "solution, such as Coulomb's; take jump = 'local', 'viscous' or 'stop'"
        )


def _at_rest(problem: DiscreteProblem) -> Solution | None:
    """The solution of a problem with one solution, if that is nought: nothing acts, and the foundation does not push.

    No iteration would find so: it has nothing to hold a residual against.
    """
    if problem.load.any():
        return None
    r = -problem.offset
    zero = np.zeros_like(r)
    if r.size and problem.law.frozen(r, zero).distance(r, zero).any():
        return None
    unknowns, residual = np.zeros(problem.unknowns), Residual(0.0, 0.0, 0.0, 0.0)
    return Solution(problem, unknowns, zero, Status.CONVERGED, residual, method="rest")


def _rounding(stage: Stage) -> float:
    """Forces that displacements make which are known to half a unit in their last place."""
    sums, n = stage.problem.linear.row_sums, stage.problem.unknowns
    size = norm(sums * stage.place[:n]) + float(sums.max(initial=0.0)) * norm(stage.offset)
    return 0.5 * float(np.finfo(float).eps) * size


def _hides(known: float, controls: Controls) -> bool:
    """Whether forces are not known to the tolerance, and yet to enough of load and contact forces."""
    return controls.rtol > 0.0 and controls.atol < known <= _KNOWN * controls.atol / controls.rtol


def _as_accurate(solver: Solver | None, controls: Controls) -> Solver | None:
    """Multigrid whose cycles end where the tolerance of the step does, and not that of what is left of its load."""
    if not isinstance(solver, NonsmoothMultigrid) or solver.tolerance is not None:
        return solver
    return replace(solver, tolerance=_SHARE * controls.rtol, absolute=_SHARE * controls.atol)


def _since(place: Array, before: Moment, index: IntArray) -> Array:
    """Penetration at the end of a step, and slip since its beginning, of some contact points."""
    here = place[index].copy()
    here[:, 1:] -= before.local.place[index, 1:]
    return here


def _whole(block: BlockLaw, rule: Rule, step: float) -> LocalStep:
    """The whole step as contact points see it whose law holds at a stage within it, along a straight line."""
    if rule.at == 1.0:
        return block.local
    return LocalStep(step, 1.0 / step, block.local.before, at=1.0 / rule.reach)


def _undamped(law: StepLaw, point: Motion, multiplier: Array) -> Array:
    """The multiplier (m, c) without what laws of the rate of the penetration exert: that of laws and memories.

    Of the splits of the pressure between both the one nearest to the slope of the law of the rate.
    """
    own = multiplier
    for block in law.blocks:
        if block.damping is None:
            continue
        own = multiplier.copy() if own is multiplier else own
        rate, lam = point.velocity[block.index, 0], multiplier[block.index, 0]
        stored, felt = (
            block.undamped.normal.subdifferential(point.place[block.index, 0]),
            block.damping.subdifferential(rate),
        )
        slope = np.clip(block.damping.derivative(rate), felt.lower, felt.upper)
        own[block.index, 0] -= np.clip(slope, lam - stored.upper, lam - stored.lower)
    return own


def _branch_loss(branch: Operator, h: Array, rate: Array, period: float, step: float) -> float:
    """``int h'Kh / T`` over a step in which the displacement changes at a constant rate, exactly."""
    kept, mixed, gone = squares_of_relaxation(step / period)
    pull, push = branch.times(h), branch.times(rate)
    return float(
        kept * float(h @ pull) + 2.0 * mixed * period * float(h @ push) + gone * period**2 * float(rate @ push)
    )
