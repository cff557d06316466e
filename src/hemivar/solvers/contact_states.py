"""Contact states: open or closed along the normal, stick or slip along the foundation; both are decided here alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from hemivar.basics.arrays import SOLVED
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import pulls

__all__ = [
    "KINDS",
    "ContactStates",
    "Kind",
    "NormalState",
    "TangentialState",
    "contact_states",
    "state_words",
]


class NormalState(IntEnum):
    """What a contact point does along the normal; the numbers are those of VTU files."""

    OPEN = 0
    """It has lifted and bears nothing; the foundation has not pulled at any smaller opening."""
    BONDED = 3
    """The foundation pulls it, with as much as at any smaller opening: intact glue in tension."""
    SOFTENING = 4
    """The foundation pulls it, but has passed the peak of its pull."""
    DEBONDED = 5
    """It has lifted and bears nothing, but the foundation pulls at smaller openings: broken glue."""
    CONTACT = 6
    """It rests on the foundation, or is pressed by it."""

    @property
    def label(self) -> str:
        """Name in files and legends."""
        return self.name.lower()


class TangentialState(IntEnum):
    """What a contact point does along the foundation, pressed or pulled; the numbers are those of VTU files."""

    FREE = 0
    """It is open or debonded, no friction law acts, or its bound is zero there.

    A bound that does not depend on the pressure, such as Tresca's, rubs on open points too: they have friction, and are
    free all the same.
    """
    STICK = 1
    """It has not moved sideways."""
    SLIP = 2
    """It has moved sideways; in time, it moves."""

    @property
    def label(self) -> str:
        """Name in files and legends."""
        return self.name.lower()


class Kind(NamedTuple):
    """Both states of a contact point."""

    normal: NormalState
    tangential: TangentialState

    @property
    def label(self) -> str:
        """Both names; ``free`` is left out."""
        free = self.tangential is TangentialState.FREE
        return self.normal.label if free else f"{self.normal.label}, {self.tangential.label}"


_N, _T = NormalState, TangentialState
_OPEN, _BONDED, _SOFTENING, _DEBONDED, _CONTACT = (int(state) for state in _N)  # enumerations are slow to look up
_FREE, _STICK, _SLIP = (int(state) for state in _T)

#: All pairs of states that there are, in the order of legends.
KINDS: tuple[Kind, ...] = (
    Kind(_N.OPEN, _T.FREE),
    *(Kind(_N.CONTACT, tangential) for tangential in (_T.STICK, _T.SLIP, _T.FREE)),
    *(Kind(normal, tangential) for normal in (_N.BONDED, _N.SOFTENING) for tangential in _T),
    Kind(_N.DEBONDED, _T.FREE),
)

_NUMBER = np.zeros((len(_N) + 2, len(_T)), dtype=np.int64)
_NUMBER[_N.DEBONDED] = len(KINDS) - 1
for _number, _kind in enumerate(KINDS):
    _NUMBER[_kind] = _number


@dataclass(frozen=True, eq=False, repr=False)
class ContactStates(PickleMixin):
    """The states of m contact points.

    Attributes
    ----------
    normal : int array (m,)
        A :class:`NormalState` each.
    tangential : int array (m,)
        A :class:`TangentialState` each.
    """

    normal: IntArray
    tangential: IntArray

    @classmethod
    def of_codes(cls, codes: IntArray, tangential: IntArray | None = None) -> ContactStates:
        """From the numbers :attr:`codes` of a file; one without ``tangential`` does not know it of bonded points."""
        moving = (codes == _STICK) | (codes == _SLIP)
        own = np.where(moving, codes, _FREE) if tangential is None else tangential
        return cls(np.where(moving, _CONTACT, codes).astype(np.int64), np.asarray(own, dtype=np.int64))

    @property
    def codes(self) -> IntArray:
        """``state`` in VTU files, (m,): the normal state; 1 in contact that sticks, 2 in contact that slips."""
        rubs = (self.normal == _CONTACT) & (self.tangential != _FREE)
        return np.asarray(np.where(rubs, self.tangential, self.normal), dtype=np.int64)

    @property
    def closed(self) -> BoolArray:
        """Which points are neither open nor debonded, (m,)."""
        return np.asarray((self.normal != _OPEN) & (self.normal != _DEBONDED))

    @cached_property
    def numbers(self) -> IntArray:
        """The place of each point's pair of states in :data:`KINDS`, (m,)."""
        return np.asarray(_NUMBER[self.normal, self.tangential])

    @property
    def present(self) -> dict[Kind, BoolArray]:
        """Which points are of each kind, (m,), for the kinds that there are, in the order of legends."""
        return {KINDS[number]: np.asarray(self.numbers == number) for number in np.unique(self.numbers).tolist()}

    @property
    def names(self) -> tuple[list[str], list[str]]:
        """The normal and the tangential state of each point as words."""
        return [_N(n).label for n in self.normal.tolist()], [_T(n).label for n in self.tangential.tolist()]

    @property
    def counts(self) -> tuple[dict[NormalState, int], dict[TangentialState, int]]:
        """How many points are in each normal and in each tangential state."""
        return (
            {kind: int(np.count_nonzero(self.normal == kind)) for kind in _N},
            {kind: int(np.count_nonzero(self.tangential == kind)) for kind in _T},
        )

    def take(self, index: IntArray) -> ContactStates:
        """Those of some points."""
        return ContactStates(self.normal[index], self.tangential[index])

    def __repr__(self) -> str:
        return f"ContactStates({state_words(*self.counts)})"


def state_words(normal: Mapping[NormalState, int], tangential: Mapping[TangentialState, int]) -> str:
    """Both counts in words, ``2 open, 5 bonded; 2 free, 5 slip``, without the states that no point is in."""
    answers = [f"{count} {kind.label}" for kind, count in normal.items() if count]
    return "; ".join(
        ", ".join(words) for words in (answers, [f"{n} {kind.label}" for kind, n in tangential.items() if n]) if words
    )


def contact_states(
    law: VectorLaw,
    local: Array,
    multiplier: Array,
    sizes: tuple[float, float] | None = None,
    *,
    moves: BoolArray | None = None,
    past_peak: BoolArray | None = None,
    without_friction: BoolArray | None = None,
) -> ContactStates:
    """The states of contact points under a law; what is less than a billionth of the largest is rounding.

    ``law``: with resolved parameters; ``local, multiplier (m, c)``: penetration and slip, and force per area of the
    body on the foundation; ``sizes``: largest displacement and multiplier of all points, where these are not all;
    ``moves (m,)``: which points move sideways; by default those with a slip; ``past_peak (m,)``: where the pull is past
    its peak; by default as the law says of this pair, see :func:`hemivar.laws.scalar_graph.past_peak`;
    ``without_friction (m,)``: where the friction of the law is left out.
    """
    if sizes is None:
        sizes = float(np.abs(local).max(initial=0.0)), float(np.abs(multiplier).max(initial=0.0))
    small, weak = SOLVED * sizes[0], SOLVED * sizes[1]
    penetration, pressure = local[:, 0], multiplier[:, 0]
    lifted, pulled = penetration < -small, pressure < -weak
    normal = np.full(len(local), _CONTACT, dtype=np.int64)
    opened = lifted & (np.abs(pressure) <= weak)
    bonded = pulled & lifted
    if (pulled & ~lifted).any():  # by a law that pulls where it touches, and not by what a solver leaves
        bonded = pulled & pulls(law, local) | bonded
    if (opened | bonded).any():
        if past_peak is None:
            past_peak = law.past_peak(local, -pressure, small, weak)
        normal = np.where(bonded, np.where(past_peak, _SOFTENING, _BONDED), normal)
        normal = np.where(opened, np.where(past_peak, _DEBONDED, _OPEN), normal)
    tangential = np.zeros(len(local), dtype=np.int64)
    if local.shape[1] > 1:
        if moves is None:
            moves = law.moves(local, small)
        bound = law.resistance(local, multiplier)
        rubs = (bound > (weak if law.state_dependent else 0.0)) & ~opened
        if without_friction is not None and local.shape[1] == 2:  # in space one direction of two may be left
            rubs &= ~without_friction
        tangential = np.where(rubs, np.where(moves, _SLIP, _STICK), tangential)
    return ContactStates(normal, np.asarray(tangential))
