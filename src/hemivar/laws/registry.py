"""The laws by name: what problem files, the list of laws and whoever adds a law find in the packages of laws.

Laws say of themselves what stands here; see :func:`hemivar.laws.named.named`.  Their parameters are those that a class
or function states; see :mod:`hemivar.basics.stated`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from hemivar.errors import ProblemError
from hemivar.laws import coupled, friction, normal, own
from hemivar.laws.friction import Friction
from hemivar.laws.named import LawEntry, LawKind, named_in
from hemivar.laws.superpotential import Superpotential

__all__ = ["COUPLED_LAWS", "FRICTION_LAWS", "NORMAL_LAWS", "LawEntry", "LawKind", "friction_law", "normal_law"]

#: Normal laws by name.
NORMAL_LAWS = named_in(LawKind.NORMAL, normal, own)
#: Laws that couple opening and slip by name; they stand where a normal law does, and for friction, too.
COUPLED_LAWS = named_in(LawKind.NORMAL, coupled)
#: Friction laws by name.
FRICTION_LAWS = named_in(LawKind.FRICTION, friction)


def normal_law(name: str, **values: object) -> Superpotential:
    """The normal law of this name, such as ``normal_law("survey", q_max=0.3, p_const=2.0)``."""
    return cast(Superpotential, _entry(NORMAL_LAWS, name).make(**values))


def friction_law(name: str, **values: object) -> Friction:
    """The friction law of this name, such as ``friction_law("tresca", bound=0.5)``."""
    return cast(Friction, _entry(FRICTION_LAWS, name).make(**values))


def _entry(laws: Mapping[str, LawEntry], name: str) -> LawEntry:
    if name not in laws:
        raise ProblemError(f"law '{name}' is not known; the laws are {', '.join(laws)}")
    return laws[name]
