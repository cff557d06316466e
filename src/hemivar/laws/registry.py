"""The laws by name: one table for problem files, for the list of laws, and for whoever adds a law."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from hemivar._typing import Parameter
from hemivar.errors import ProblemError
from hemivar.laws.base import Superpotential
from hemivar.laws.friction import Friction, NoFriction, Tresca
from hemivar.laws.named import Bilateral, Compliance, NoContact, Signorini, SurveyLaw

__all__ = [
    "FRICTION_LAWS",
    "NORMAL_LAWS",
    "LawEntry",
    "LawKind",
    "LawParameter",
    "friction_law",
    "normal_law",
]


class LawKind(StrEnum):
    """Which part of the contact law an entry describes."""

    NORMAL = "normal"
    FRICTION = "friction"


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a law: a number, or a function of x.

    Attributes
    ----------
    name : str
    meaning : str
        In words, without the name.
    unit : str
        In terms of force and length.
    default : float or None
        Value if it is left out; ``None`` means that it must be given.
    minimum : float
        Smallest value allowed.
    """

    name: str
    meaning: str
    unit: str
    default: float | None = None
    minimum: float = -math.inf

    @property
    def required(self) -> bool:
        """Whether the parameter must be given."""
        return self.default is None


@dataclass(frozen=True)
class LawEntry:
    """A law as it is known by name.

    Attributes
    ----------
    name : str
    kind : LawKind
    build : callable
        Makes the law from its parameters, given by keyword.
    summary : str
        What the foundation does, in words.
    formula : str
        The superpotential j.
    parameters : tuple of LawParameter
    """

    name: str
    kind: LawKind
    build: Callable[..., Any]
    summary: str
    formula: str
    parameters: tuple[LawParameter, ...] = ()

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the parameters that must be given."""
        return tuple(p.name for p in self.parameters if p.required)

    def make(self, **values: Parameter) -> Any:
        """The law with these parameters.

        Raises
        ------
        ProblemError
            If a parameter is missing or unknown.
        """
        known = {p.name for p in self.parameters}
        for name in values:
            if name not in known:
                listed = ", ".join(p.name for p in self.parameters) or "none"
                raise ProblemError(f"law '{self.name}' has no parameter '{name}' (parameters: {listed})")
        for name in self.required:
            if name not in values:
                raise ProblemError(f"law '{self.name}' needs the parameter {name}")
        return self.build(**values)


_PRESSURE = "force/area"

_NORMAL = (
    LawEntry(
        "survey",
        LawKind.NORMAL,
        SurveyLaw,
        "rigid up to the pressure q_max, beyond it linearly compliant with stiffness p_const",
        "j(r) = 0 for r < 0, q_max r + p_const r^2/2 for r >= 0",
        (
            LawParameter("q_max", "threshold pressure", _PRESSURE, minimum=0.0),
            LawParameter("p_const", "stiffness beyond it", "force/area/length", default=0.0, minimum=0.0),
        ),
    ),
    LawEntry(
        "signorini",
        LawKind.NORMAL,
        Signorini,
        "rigid foundation: no penetration, no tension",
        "j(r) = 0 for r <= 0, +inf for r > 0",
    ),
    LawEntry(
        "compliance",
        LawKind.NORMAL,
        Compliance,
        "springs that push only: pressure stiffness * r^exponent for penetration r > 0",
        "j(r) = stiffness/(exponent + 1) max(r, 0)^(exponent + 1)",
        (
            LawParameter("stiffness", "pressure at unit penetration", "force/area/length^exponent", minimum=0.0),
            LawParameter("exponent", "power of the penetration", "1", default=1.0, minimum=1.0),
        ),
    ),
    LawEntry(
        "bilateral",
        LawKind.NORMAL,
        Bilateral,
        "neither separation nor penetration, with any pressure or tension",
        "j(r) = 0 for r = 0, +inf otherwise",
    ),
    LawEntry(
        "none",
        LawKind.NORMAL,
        NoContact,
        "no foundation in the normal direction",
        "j(r) = 0",
    ),
)

_FRICTION = (
    LawEntry(
        "tresca",
        LawKind.FRICTION,
        Tresca,
        "friction of at most bound; where the body slips it has this size and opposes the slip",
        "j(s) = bound |s|",
        (LawParameter("bound", "friction bound h_tau", _PRESSURE, minimum=0.0),),
    ),
    LawEntry(
        "none",
        LawKind.FRICTION,
        NoFriction,
        "no friction",
        "j(s) = 0",
    ),
)

#: Normal laws by name.
NORMAL_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _NORMAL})

#: Friction laws by name.
FRICTION_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _FRICTION})


def normal_law(name: str, **values: Parameter) -> Superpotential:
    """The normal law of this name, such as ``normal_law("survey", q_max=0.3, p_const=2.0)``."""
    law: Superpotential = _entry(NORMAL_LAWS, name).make(**values)
    return law


def friction_law(name: str, **values: Parameter) -> Friction:
    """The friction law of this name, such as ``friction_law("tresca", bound=0.5)``."""
    law: Friction = _entry(FRICTION_LAWS, name).make(**values)
    return law


def _entry(laws: Mapping[str, LawEntry], name: str) -> LawEntry:
    if name not in laws:
        raise ProblemError(f"law '{name}' is not known; the laws are {', '.join(laws)}")
    return laws[name]
