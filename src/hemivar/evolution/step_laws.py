"""The law of a stage: stored energies, friction in increments, rates along the normal, memory of contact points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.schemes import Scheme, StageRule
from hemivar.evolution.state import TimeState
from hemivar.laws import NoContact, Signorini, SlipMeasure, Superpotential, VectorLaw
from hemivar.laws.coupled import join_laws
from hemivar.laws.memory import LocalStep, Memory, MemoryChain, law_of_step
from hemivar.laws.normal_and_friction import NormalAndFriction, with_friction
from hemivar.laws.piecewise_law import stacked
from hemivar.laws.transformed import affine, averaged
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.instants import error_context

__all__ = ["BoundaryLaw", "StageLaws", "StepLaw", "places", "seen_displacement", "stage_law"]

#: Who asks for laws whose force is averaged over a step.
_CONSERVES = "the midpoint rule that conserves energy"

States = Mapping[str, Mapping[str, Array]]


@dataclass(frozen=True, eq=False)
class BoundaryLaw:
    """What the contact points of one boundary obey in a stage."""

    name: str
    index: IntArray  # (p,)
    #: The law as it was stated, at these points.
    base: VectorLaw
    #: What they remember, maybe nothing.
    memory: Memory
    #: The law that the memory is given.
    given: VectorLaw
    #: Law of the normal rate, at these points.
    damping: Superpotential | None
    local: LocalStep
    #: Of the stage, with and without the damping.
    law: VectorLaw
    undamped: VectorLaw


@dataclass(frozen=True, eq=False)
class StepLaw:
    """The law of a stage, of all contact points."""

    law: VectorLaw
    #: Boundaries with memory or damping, all boundaries if there is one; empty where the law is as stated.
    blocks: tuple[BoundaryLaw, ...] = field(default_factory=tuple)
    #: The law whose energy is stored, where the law of the stage is another one.
    storing: VectorLaw | None = None

    @property
    def stored(self) -> VectorLaw:
        """The law whose energy is stored where there are no blocks."""
        return self.law if self.storing is None else self.storing

    @property
    def iterates(self) -> bool:
        """Whether the law depends on the solution of the stage, beyond what the law itself does."""
        return any(block.memory.iterates for block in self.blocks)


@dataclass(frozen=True, eq=False)
class _Foundation:
    """What a boundary is given at its contact points, whatever they remember; see :class:`BoundaryLaw`."""

    stated: VectorLaw
    damped: Superpotential | None
    rate: float
    memory: Memory
    damping: Superpotential | None
    base: VectorLaw
    given: VectorLaw


class StageLaws:
    """Laws, memories and dampings at the contact points of each boundary, of stages of one kind and length.

    The last ones are known again, which changes no answer.
    """

    def __init__(self, discrete: DiscreteEvolution) -> None:
        self._discrete = discrete
        self._known: dict[str, _Foundation] = {}
        self._made: dict[str, tuple[_Foundation, float, Mapping[str, Array], VectorLaw]] = {}
        self._joined: tuple[list[tuple[VectorLaw, int]], VectorLaw] | None = None
        self._plain: tuple[VectorLaw, StepLaw] | None = None

    def plain(self, stated: VectorLaw, rate: float) -> StepLaw:
        """The law of a stage where points remember nothing."""
        if self._plain is None or self._plain[0] is not stated:
            self._plain = stated, StepLaw(stated.in_increments(rate))
        return self._plain[1]

    def of(self, name: str, index: IntArray, acting: ExternalData, rate: float) -> _Foundation:
        """Those of a boundary under the laws that act and a factor of the displacement in the rate."""
        known, stated, damping = self._known.get(name), acting.law, acting.damping.get(name)
        if known is None or known.stated is not stated or known.damped is not damping or known.rate != rate:
            memory = _memory(self._discrete, name, index)
            base = stated.take(index)
            if _follows_slip(self._discrete.contacts[name]):
                base = _of_slip(base)
            given = base if memory.of_slip else base.in_increments(rate)
            with error_context(f"damping of contact '{name}'", damping):
                damper = None if damping is None else damping.at(places(self._discrete, index))
            known = self._known[name] = _Foundation(stated, damping, rate, memory, damper, base, given)
        return known

    def law(self, name: str, foundation: _Foundation, state: Mapping[str, Array], local: LocalStep) -> VectorLaw:
        """The law of a boundary in a step, without damping; that of the step before where it cannot be another one."""
        known = self._made.get(name)
        same = known is not None and foundation.memory.of_state and known[0] is foundation and known[1] == local.tau
        if same and known is not None and all(np.array_equal(known[2][key], state[key]) for key in state):
            return known[3]
        made = law_of_step(foundation.base, foundation.memory, state, local)
        self._made[name] = foundation, local.tau, state, made
        return made

    def joined(self, laws: list[tuple[VectorLaw, int]]) -> VectorLaw:
        """One law from those of all boundaries; the one of the step before where they are the same."""
        if self._joined is None or [law for law, _ in self._joined[0]] != [law for law, _ in laws]:
            self._joined = laws, join_laws(laws)
        return self._joined[1]


def stage_law(
    discrete: DiscreteEvolution,
    acting: ExternalData,
    before: TimeState,
    rule: StageRule,
    step: float,
    guess: Array,
    guess_multiplier: Array,
    known: StageLaws | None = None,
) -> StepLaw:
    """The law of a stage.

    ``guess`` is (m, c); ``guess_multiplier`` is (m, c).
    """
    rate, stated = rule.rate.difference, acting.law
    contact = discrete.contacts
    plain = all(
        not contact[name].remembers and contact[name].damping is None and not _follows_slip(contact[name])
        for name, _ in discrete.blocks
    )
    if rule.restitution is not None:
        return StepLaw(_impact(stated, before, step, rate))
    foundations = StageLaws(discrete) if known is None else known
    if plain and rule.conserving:
        start, parts = before.local.displacement[:, 0], with_friction(stated.in_increments(rate), _CONSERVES)
        normal = affine(averaged(parts.normal, start), rule.reach, (1.0 - rule.reach) * start)
        return StepLaw(parts.with_parts(normal), storing=stated)
    if plain:
        return foundations.plain(stated, rate)
    blocks, carried = [], rule.rate.carried(before.local, before.rates[1])
    for name, index in discrete.blocks:
        if not index.size:
            continue
        foundation = foundations.of(name, index, acting, rate)
        memory, damping, base, motion = foundation.memory, foundation.damping, foundation.base, before.local
        local = LocalStep(
            rule.at * step, rate, motion.displacement[index], guess[index], guess_multiplier[index], carried[index]
        )
        state = before.memory.get(name, {})
        undamped = foundations.law(name, foundation, state, local)
        law = undamped if damping is None else law_of_step(base, memory, state, local, damping)
        blocks.append(BoundaryLaw(name, index, base, memory, foundation.given, damping, local, law, undamped))
    if not blocks:  # no contact points of this process
        return StepLaw(stated)
    return StepLaw(foundations.joined([(block.law, block.index.size) for block in blocks]), tuple(blocks))


def refuse_compliant(discrete: DiscreteEvolution, scheme: Scheme) -> None:
    """Refuse foundations that a law of impact cannot stand for."""
    for name, contact in discrete.contacts.items():
        if _follows_slip(contact):
            raise ProblemError(
                f"the scheme {scheme.name} has friction of the slip rate, and that of contact '{name}' is a law of the "
                "slip; take another scheme"
            )
        if not isinstance(contact.normal, Signorini) or contact.remembers or contact.damping is not None:
            raise ProblemError(
                f"the scheme {scheme.name} is one for rigid obstacles, but contact '{name}' has the law "
                f"'{contact.normal.name}'; take Signorini() without damping and memory, or the scheme generalized-alpha"
            )


def refuse_unaveraged(discrete: DiscreteEvolution, scheme: Scheme) -> None:
    """Refuse foundations whose energy a scheme that averages them cannot keep."""
    for name, contact in discrete.contacts.items():
        if contact.remembers or contact.damping is not None or _follows_slip(contact):
            raise ProblemError(
                f"the scheme {scheme.name} is to conserve energy, but contact '{name}' has a memory, a damping or "
                "friction of the slip, which do not; leave conserving out"
            )
    averaged(with_friction(discrete.problem.law, _CONSERVES).normal, 0.0)


def _of_slip(law: VectorLaw) -> NormalAndFriction:
    """The law with friction of the slip, which several laws in one do not know any more."""
    parts = with_friction(law, "friction of the slip")
    return parts.with_parts(friction=replace(parts.friction, of=SlipMeasure.SLIP))


def _follows_slip(contact: Contact) -> bool:
    return contact.friction.of is SlipMeasure.SLIP


def _impact(stated: VectorLaw, before: TimeState, step: float, rate: float) -> VectorLaw:
    """Rigid where the gap is closed, as it is predicted for the middle of the step; nothing elsewhere."""
    local, parts = before.local, with_friction(stated.in_increments(rate), "a law of impact")
    ahead = 0.5 * step * local.velocity[:, 0]
    # What rests on the obstacle is as deep as the rounding of its place and its velocity says, and yet in contact.
    sizes = np.abs(before.body.displacement).max(initial=0.0), np.abs(ahead).max(initial=0.0)
    shut = local.displacement[:, 0] + ahead >= -ROUNDED * (
        sum(sizes) + np.abs(local.displacement[:, 0]).max(initial=0.0)
    )
    pieces: list[tuple[Superpotential, IntArray]] = [
        (law.at(None), np.flatnonzero(points))
        for law, points in ((Signorini(), shut), (NoContact(), ~shut))
        if points.any()
    ]
    normal = pieces[0][0] if pieces else parts.normal
    if len(pieces) > 1:
        normal = stacked(pieces, "impact")
    return parts.with_parts(normal)


def initial_memory(discrete: DiscreteEvolution, law: VectorLaw, local: Array) -> States:
    """States of all memories at the start, local displacements (m, c) being what they are."""
    states = {}
    for name, index in discrete.blocks:
        if index.size and discrete.contacts[name].remembers:
            states[name] = _memory(discrete, name, index).start(law.take(index), local[index])
    return states


def seen_displacement(discrete: DiscreteEvolution, state: TimeState) -> Array:
    """Local displacements (m, c) that laws see: less what has been worn off, or what a foundation has crept."""
    r = state.local.displacement
    for name, index in discrete.blocks:
        if name in state.memory:
            r = r.copy() if r is state.local.displacement else r
            r[index] = MemoryChain(discrete.contacts[name].remembers).seen(state.memory[name], r[index])
    return r


def _memory(discrete: DiscreteEvolution, name: str, index: IntArray) -> Memory:
    """What a boundary remembers, at its contact points."""
    return MemoryChain(discrete.contacts[name].remembers).at(places(discrete, index))


def places(discrete: DiscreteEvolution, index: IntArray) -> Array | None:
    """Contact points (p, d), where they lie somewhere."""
    points = discrete.problem.contact.points
    return None if points is None else points[index]
