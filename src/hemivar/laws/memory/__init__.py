"""What contact points remember from one time step to the next, and the laws of a step that come of it.

:class:`Memory` is the interface, :class:`MemoryChain` puts several one after the other, and :func:`law_of_step` makes
the contact law of a step of the law stated, its memory and its damping.
"""

from hemivar.laws.memory.beside import Bonding, DampedContact, PenetrationMemory
from hemivar.laws.memory.contact_memory import LocalStep, Memory, MemoryState
from hemivar.laws.memory.damage import Secant, SlipSum
from hemivar.laws.memory.in_series import ViscousFoundation, Wear
from hemivar.laws.memory.plastic_bond import PlasticBond
from hemivar.laws.memory.rate_and_state import RateAndState
from hemivar.laws.memory.step_law import MemoryChain, law_of_step

__all__ = [
    "Bonding",
    "DampedContact",
    "LocalStep",
    "Memory",
    "MemoryChain",
    "MemoryState",
    "PenetrationMemory",
    "PlasticBond",
    "RateAndState",
    "Secant",
    "SlipSum",
    "ViscousFoundation",
    "Wear",
    "law_of_step",
]
