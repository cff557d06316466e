"""Damage and wear as internal variables: the largest opening of glue, the sum of the slip."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.coupled.friction_beside import FrictionBeside
from hemivar.laws.friction import Friction
from hemivar.laws.glue import glue_of
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept, slide
from hemivar.laws.named import LawKind, named
from hemivar.laws.normal_and_friction import NormalAndFriction
from hemivar.laws.parameters import parameter
from hemivar.laws.transformed import slipped
from hemivar.laws.transformed.transformed_law import as_examined
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Secant", "SlipSum"]


@named(
    LawKind.MEMORY,
    "secant",
    "glue that unloads along the secant to its largest opening; the damaged share may rub",
    "j(r) = slope r^2/2 up to the largest opening, the law beyond it",
)
@dataclass(frozen=True, eq=False)
class Secant(Memory):
    """Irreversible glue: it remembers the largest opening, and unloads along the secant to it.

    The normal law of a step is :func:`hemivar.laws.secant` of the law.  Stored is the triangle beneath the secant; what
    the law has taken up beyond it when the largest opening grows is lost.  The state is that opening, ``opening``, and
    the slope of the secant, ``stiffness``; of glue in which opening and slip act together the effective opening.

    With ``friction`` the share D of the glue that is damaged rubs where it is pressed, after Alfano and Sacco (2006):
    beside the traction of the glue acts Coulomb friction of at most ``friction`` D p, which sees the slip rate, with D
    of the beginning of the step.  Intact glue does not rub; broken glue obeys Coulomb's law.

    Parameters
    ----------
    friction : Parameter
        Friction coefficient of the damaged share, >= 0.
    """

    friction: Parameter = field(
        default=0.0, metadata=parameter("friction coefficient of the damaged share", "1", least=0.0)
    )
    name: ClassVar[str] = "secant"

    @property
    def rubs(self) -> bool:
        """Whether there is friction on the damaged share."""
        return callable(self.friction) or bool(np.any(self.friction))

    @property
    def iterates(self) -> bool:  # type: ignore[override]
        """Friction does: its bound is that of the pressure of the step."""
        return self.rubs

    @property
    def of_state(self) -> bool:  # type: ignore[override]
        """Friction depends on the pressure as well."""
        return not self.rubs

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        glue = glue_of(law)
        state = kept(**glue.damaged(None, r))
        if self.rubs:
            self._refuse(law)
            glue.lost_by(state)
        return state

    def _refuse(self, law: VectorLaw) -> None:
        if isinstance(law, NormalAndFriction) and law.friction.acts:
            raise ProblemError(
                f"the memory '{self.name}' has friction on the damaged share, and the friction '{law.friction.name}' "
                "acts on the same boundary; leave one of the two out"
            )
        if law.depends_on_whole_state:
            raise ProblemError(
                f"friction on the damaged share of '{law.name}' is not known, for its mode is that of the solution; "
                "take MixedMode(...), or leave the friction out"
            )

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        made = glue_of(law).unloading(state)
        if not self.rubs:
            return made
        bound = self._coefficient(law, state) * np.maximum(step.pressing, 0.0)
        if isinstance(made, NormalAndFriction):
            return made.with_parts(friction=Friction(bound))
        return FrictionBeside(made, bound, step.before[:, 1:])

    def _coefficient(self, law: VectorLaw, state: MemoryState) -> Array:
        """Friction over pressure with the damage of a state, (m,)."""
        return np.asarray(self.values()["friction"] * glue_of(law).lost_by(state))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(**glue_of(law).damaged(state, r))

    def past_peak(self, law: VectorLaw, state: MemoryState) -> BoolArray:
        return glue_of(law).softened(state)

    def damage(self, law: VectorLaw, state: MemoryState) -> Array | None:
        own = law.debonding(np.zeros((len(state["opening"]), 2))).get("damage")
        return None if own is None or np.isnan(own).any() else glue_of(law).lost_by(state)

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        return glue_of(law).unloading_energy(state, r, energy_of(law, inner))

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """What the law takes up between the old and the new opening, less what the triangle beneath the secant grows;
        and friction of the whole slip, which is not counted elsewhere."""
        glue = glue_of(law)
        lost = glue.spent_by(new) - glue.spent_by(old)
        if not self.rubs or not law.follows_slip:
            return lost
        rubbed = self._coefficient(law, old) * np.maximum(lam[:, 0], 0.0)
        return np.asarray(lost + rubbed * slide(r[:, 1:] - step.before[:, 1:]))


@named(
    LawKind.MEMORY,
    "slip-sum",
    "friction that weakens with the accumulated slip",
    "the friction of the law at the sum of the slip increments",
)
@dataclass(frozen=True, eq=False)
class SlipSum(Memory):
    """Friction that weakens, or strengthens, with the sum s of all slips, and does not recover when slip turns round.

    The friction law is read as a law of the slip sum, h(s) = h_tau j_tau'(s): in a step its profile is
    :func:`hemivar.laws.slipped`, ``H(s_n + |d|) - H(s_n)``.  The state is ``slip``, s.
    """

    name: ClassVar[str] = "slip-sum"
    of_slip: ClassVar[bool] = True  # type: ignore[misc]

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(slip=np.zeros(len(r)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        profile = slipped(parts.friction.profile, state["slip"])
        if profile is parts.friction.profile:
            return law
        return parts.with_parts(friction=Friction(parts.friction.bound, as_examined(profile)))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(slip=state["slip"] + slide(r[:, 1:]))
