"""The laws by name: one table for problem files, for the list of laws, and for whoever adds a law."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import cast

from hemivar.basics.types import Parameter
from hemivar.errors import ProblemError
from hemivar.laws.friction import (
    Coulomb,
    Friction,
    Logarithmic,
    NoFriction,
    OrthotropicFriction,
    SlipTable,
    SlipWeakening,
    StateBound,
    StaticKinetic,
    Tresca,
)
from hemivar.laws.normal import (
    Adhesive,
    Bilateral,
    Capped,
    Compliance,
    FinitePenetration,
    Layered,
    NoContact,
    SawTooth,
    Signorini,
    Softening,
    ThresholdCompliance,
)
from hemivar.laws.own import FormulaLaw, read_law_table, table_law
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "FRICTION_LAWS",
    "NORMAL_LAWS",
    "LawEntry",
    "LawKind",
    "LawParameter",
    "ParameterForm",
    "friction_law",
    "normal_law",
]


#: A value of a parameter as it may be written: a number, a text, a list of numbers; None if there is none.
Value = float | str | tuple[float, ...] | None


class LawKind(StrEnum):
    """Which part of the contact law an entry describes, or that it is a material."""

    NORMAL = "normal"
    FRICTION = "friction"
    MATERIAL = "material"


class ParameterForm(StrEnum):
    """How a parameter is written."""

    NUMBER = "number"
    """A number, or a function of x."""
    BOUND = "bound"
    """A friction bound: a number, a function of x, or a function of penetration or pressure."""
    NUMBERS = "numbers"
    """A list of numbers."""
    FILE = "file"
    """The path of a file."""
    TEXT = "text"
    """A text, one of the choices if there are any."""


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a law.

    Attributes
    ----------
    name : str
    meaning : str
        In words, without the name.
    unit : str
        In terms of force and length.
    default : float, str or None
        Value if it is left out; ``None`` means that it must be given.
    minimum : float
        Smallest value allowed.
    form : ParameterForm
        How it is written; a number by default.
    optional : bool
        Whether it may be left out although it has no default.
    instead : str
        The parameter that it takes the place of, if there is one.
    choices : tuple of str
        Texts allowed, if not all are.
    example : object
        A value that shows what the law does; the default if there is one, else 1.
    positive : bool
        Whether the smallest value itself, zero, is not allowed.
    """

    name: str
    meaning: str
    unit: str
    default: Value = None
    minimum: float = -math.inf
    form: ParameterForm = ParameterForm.NUMBER
    optional: bool = False
    instead: str = ""
    choices: tuple[str, ...] = ()
    example: Value = None
    positive: bool = False

    @property
    def required(self) -> bool:
        """Whether the parameter must be given."""
        return self.default is None and not self.optional

    @property
    def shown(self) -> Value:
        """A value to show the law with; ``None`` to leave it out."""
        if self.example is not None:
            return self.example
        return 1.0 if self.required else self.default


@dataclass(frozen=True)
class LawEntry:
    """A law or a material as it is known by name.

    Attributes
    ----------
    name : str
    kind : LawKind
    build : callable
        Makes the law from its parameters, given by keyword.
    summary : str
        What the foundation or the material does, in words.
    formula : str
        The superpotential j; of a material the stress or the stored energy.
    parameters : tuple of LawParameter
    """

    name: str
    kind: LawKind
    build: Callable[..., object]
    summary: str
    formula: str
    parameters: tuple[LawParameter, ...] = ()

    @property
    def noun(self) -> str:
        """What messages call it."""
        return "material" if self.kind is LawKind.MATERIAL else "law"

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the parameters that must be given."""
        return tuple(p.name for p in self.parameters if p.required)

    def make(self, **values: object) -> object:
        """The law or the material with these parameters.

        Raises
        ------
        ProblemError
            If a parameter is missing or unknown.
        """
        known = {p.name for p in self.parameters}
        for name in values:
            if name not in known and not (name == "where" and "potential" in known):
                listed = ", ".join(p.name for p in self.parameters) or "none"
                raise ProblemError(f"{self.noun} '{self.name}' has no parameter '{name}' (parameters: {listed})")
        for name in self.required:
            if name not in values:
                raise ProblemError(f"{self.noun} '{self.name}' needs the parameter {name}")
        return self.build(**values)


def _table_law(file: str | Path, extend: str = "constant") -> Superpotential:
    return read_law_table(file, extend=extend)


def _pressure_table(
    penetrations: Sequence[float], pressures: Sequence[float], extend: str = "constant"
) -> Superpotential:
    law = table_law(penetrations, pressures, extend=extend, name="pressure-table", where="pressure-table")
    stated = {"penetrations": tuple(penetrations), "pressures": tuple(pressures), "extend": extend}
    return replace(law, stated=MappingProxyType({"law": "pressure-table", **stated}))


def _formula_law(
    potential: str | None = None,
    derivative: str | None = None,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    where: str = "",
) -> Superpotential:
    return FormulaLaw(potential, derivative=derivative, kinks=kinks, reach=reach, where=where)


def _table_friction(
    file: str | Path, bound: Parameter | StateBound = 1.0, extend: str = "constant", of: str | None = None
) -> Friction:
    return Friction(bound, read_law_table(file, extend=extend, friction=True), of=of)


def _formula_friction(
    potential: str | None = None,
    derivative: str | None = None,
    bound: Parameter | StateBound = 1.0,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    where: str = "",
    of: str | None = None,
) -> Friction:
    law = FormulaLaw(potential, derivative=derivative, kinks=kinks, reach=reach, even=True, where=where)
    return Friction(bound, law, of=of)


_FORMULA_KINKS = LawParameter(
    "kinks", "further places where a derivative jumps", "length", form=ParameterForm.NUMBERS, optional=True
)
_REACH = LawParameter("reach", "length up to which kinks and constants are looked for", "length", 10.0)
_EXTEND = LawParameter(
    "extend",
    "how the derivative goes on beyond the table",
    "constant or linear",
    "constant",
    form=ParameterForm.TEXT,
    choices=("constant", "linear"),
)

#: A number that must be above zero.
_positive = partial(LawParameter, minimum=0.0, positive=True)
_OF = LawParameter(
    "of",
    "what it is a law of in time",
    "slip or rate",
    form=ParameterForm.TEXT,
    optional=True,
    choices=("slip", "rate"),
)

_PRESSURE = "force/area"
_RATE = "force/area/length"
_LIST = ParameterForm.NUMBERS
_BOUND = LawParameter("bound", "friction bound h_tau", _PRESSURE, minimum=0.0, form=ParameterForm.BOUND, example=1.0)
_BOUND_OR_ONE = replace(_BOUND, default=1.0)

_NORMAL = (
    LawEntry(
        "survey",
        LawKind.NORMAL,
        ThresholdCompliance,
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
        "softening",
        LawKind.NORMAL,
        Softening,
        "springs that push up to the penetration limit, then give way gradually and are gone",
        "j'(r) = stiffness r up to limit, then stiffness limit - softening (r - limit) down to 0",
        (
            _positive("stiffness", "of the springs", _RATE, example=2.0),
            _positive("limit", "penetration of the largest pressure", "length", example=0.1),
            LawParameter("softening", "rate at which the pressure falls", _RATE, minimum=0.0, example=0.5),
        ),
    ),
    LawEntry(
        "capped",
        LawKind.NORMAL,
        Capped,
        "springs that push up to the penetration limit and break there (residual 0) or yield (residual 1)",
        "j'(r) = stiffness r for 0 <= r <= limit, residual stiffness limit beyond",
        (
            _positive("stiffness", "of the springs", _RATE, example=20.0),
            _positive("limit", "penetration at which they break", "length", example=0.1),
            LawParameter("residual", "share of the largest pressure that is left", "1", 0.0, 0.0),
        ),
    ),
    LawEntry(
        "finite-penetration",
        LawKind.NORMAL,
        FinitePenetration,
        "springs that push, and turn rigid at the penetration limit",
        "j(r) = stiffness/2 max(r, 0)^2 for r <= limit, +inf beyond",
        (
            LawParameter("stiffness", "of the springs", _RATE, minimum=0.0, example=2.0),
            _positive("limit", "largest penetration", "length", example=0.1),
        ),
    ),
    LawEntry(
        "adhesive",
        LawKind.NORMAL,
        Adhesive,
        "glue: tension stiffness w at the opening w = -r up to strength; then it breaks at once or, with softening, "
        "gradually",
        "j'(r) = stiffness r for -strength/stiffness < r < 0; compression r, or rigid, for r > 0",
        (
            _positive("stiffness", "of the glue", _RATE, example=5.0),
            _positive("strength", "largest tension", _PRESSURE, example=0.5),
            _positive("softening", "rate at which the tension falls; left out: at once", _RATE, optional=True),
            LawParameter("compression", "stiffness in penetration; left out: rigid", _RATE, minimum=0.0, optional=True),
            _positive("energy", "fracture energy, instead of softening", "force/length", optional=True),
        ),
    ),
    LawEntry(
        "layered",
        LawKind.NORMAL,
        Layered,
        "layers that yield one after the other, each with its own stiffness, and lose pressure when they are used up",
        "j'' = stiffnesses[i] within layer i; j' falls by drops[i] at its lower end",
        (
            LawParameter(
                "thicknesses", "of the layers, from the surface down", "length", form=_LIST, example=(0.05, 0.1)
            ),
            LawParameter("stiffnesses", "of the layers", _RATE, form=_LIST, example=(10.0, 4.0)),
            LawParameter(
                "drops",
                "pressure lost at the lower end of each layer",
                _PRESSURE,
                form=_LIST,
                optional=True,
                example=(0.3, 0.2),
            ),
            LawParameter("base", "stiffness of the ground below; left out: rigid", _RATE, optional=True, example=2.0),
        ),
    ),
    LawEntry(
        "saw-tooth",
        LawKind.NORMAL,
        SawTooth,
        "delamination in steps: a tension against the opening w = -r that falls at once at each of the openings",
        "j'(-w) = -(slopes[i] w + offsets[i]) up to openings[i], 0 beyond the last",
        (
            LawParameter(
                "openings", "at which the tension falls, increasing", "length", form=_LIST, example=(1.0, 2.0)
            ),
            LawParameter("slopes", "of the tension on each tooth", _RATE, form=_LIST, example=(3.0, 1.0)),
            LawParameter("offsets", "of the tension on each tooth", _PRESSURE, form=_LIST, optional=True),
            LawParameter("compression", "stiffness in penetration; left out: rigid", _RATE, minimum=0.0, optional=True),
        ),
    ),
    LawEntry(
        "table",
        LawKind.NORMAL,
        _table_law,
        "any graph: j' is linear between the points of a CSV file with the columns r and derivative; a repeated r is "
        "a jump",
        "j' from a table",
        (LawParameter("file", "the CSV file", "path", form=ParameterForm.FILE), _EXTEND),
    ),
    LawEntry(
        "pressure-table",
        LawKind.NORMAL,
        _pressure_table,
        "any graph: the pressure is linear between the points of two lists; a repeated penetration is a jump",
        "j' from a table",
        (
            LawParameter(
                "penetrations", "not falling; negative ones are openings", "length", form=_LIST, example=(0.0, 0.1)
            ),
            LawParameter(
                "pressures", "pressures there; negative ones are tension", _PRESSURE, form=_LIST, example=(0.0, 1.0)
            ),
            _EXTEND,
        ),
    ),
    LawEntry(
        "formula",
        LawKind.NORMAL,
        _formula_law,
        "any potential or pressure, as a formula of r with piecewise((value, condition), ...), abs, min and max",
        "j(r) = potential, or j'(r) = derivative",
        (
            LawParameter(
                "potential",
                "formula of the penetration r",
                "force/length",
                form=ParameterForm.TEXT,
                optional=True,
                example="piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))",
            ),
            LawParameter(
                "derivative",
                "formula of the pressure, in place of potential",
                "force/length^2",
                form=ParameterForm.TEXT,
                optional=True,
                instead="potential",
            ),
            _FORMULA_KINKS,
            _REACH,
        ),
    ),
    LawEntry(
        "none",
        LawKind.NORMAL,
        NoContact,
        "no foundation in the normal direction",
        "j(r) = 0",
    ),
)


def _orthotropic(bound: Parameter | StateBound, ratio: Parameter, axis: Sequence[float]) -> Friction:
    return OrthotropicFriction(bound, ratio=ratio, axis=axis)


_FRICTION = (
    LawEntry(
        "tresca",
        LawKind.FRICTION,
        Tresca,
        "friction of at most bound; where the body slips it has this size and opposes the slip",
        "j(s) = bound |s|",
        (_BOUND, _OF),
    ),
    LawEntry(
        "coulomb",
        LawKind.FRICTION,
        Coulomb,
        "friction of at most coefficient times the pressure (quasi-variational: the bound is iterated)",
        "j(s) = coefficient pressure |s|",
        (LawParameter("coefficient", "friction coefficient mu", "1", minimum=0.0, example=0.3), _OF),
    ),
    LawEntry(
        "orthotropic",
        LawKind.FRICTION,
        _orthotropic,
        "friction of at most bound along an axis of the surface and ratio bound across it, in space",
        "j(s) = bound sqrt(s1^2 + ratio^2 s2^2)",
        (
            _BOUND,
            _positive("ratio", "bound across the axis over that along it", "1", example=0.5),
            LawParameter(
                "axis",
                "a direction; its projection on the surface is the axis",
                "1",
                form=_LIST,
                example=(1.0, 0.0, 0.0),
            ),
        ),
    ),
    LawEntry(
        "slip-weakening",
        LawKind.FRICTION,
        SlipWeakening,
        "friction that falls with the slip from bound static to bound kinetic, exponentially",
        "j(s) = bound (kinetic |s| - (static - kinetic)/rate (exp(-rate |s|) - 1))",
        (
            _BOUND,
            LawParameter("static", "factor of the bound at rest", "1", 1.0, 0.0),
            LawParameter("kinetic", "factor of the bound after much slip", "1", 0.7, 0.0),
            LawParameter("rate", "how fast it falls", "1/length", 1.0, 0.0, positive=True),
            _OF,
        ),
    ),
    LawEntry(
        "logarithmic",
        LawKind.FRICTION,
        Logarithmic,
        "friction bound/(scale + slip), which falls to nothing with the slip",
        "j(s) = bound ln(1 + |s|/scale)",
        (
            _BOUND,
            LawParameter("scale", "slip at which it has fallen to one half", "length", 1.0, 0.0, positive=True),
            _OF,
        ),
    ),
    LawEntry(
        "static-kinetic",
        LawKind.FRICTION,
        StaticKinetic,
        "friction bound static up to a slip, from there at once bound kinetic",
        "j'(s) = bound static for 0 < s < slip, bound kinetic beyond",
        (
            _BOUND,
            _positive("slip", "at which the friction drops", "length", example=0.1),
            LawParameter("static", "factor of the bound up to this slip", "1", 1.0, 0.0),
            LawParameter("kinetic", "factor of the bound beyond it", "1", 0.7, 0.0),
            _OF,
        ),
    ),
    LawEntry(
        "slip-table",
        LawKind.FRICTION,
        SlipTable,
        "friction bound times a table of the slip, linear between its points and constant beyond; a repeated slip is "
        "a jump",
        "j'(s) = bound values(s)",
        (
            _BOUND,
            LawParameter("slips", "from 0 on, increasing", "length", form=_LIST, example=(0.0, 0.2)),
            LawParameter("values", "factors of the bound there", "1", form=_LIST, example=(1.0, 0.5)),
            _OF,
        ),
    ),
    LawEntry(
        "table",
        LawKind.FRICTION,
        _table_friction,
        "friction bound times a CSV file with the columns r (slip >= 0) and derivative; the same backwards",
        "j' from a table",
        (LawParameter("file", "the CSV file", "path", form=ParameterForm.FILE), _BOUND_OR_ONE, _EXTEND, _OF),
    ),
    LawEntry(
        "formula",
        LawKind.FRICTION,
        _formula_friction,
        "friction from any potential or its derivative, as a formula of the slip r >= 0; the same backwards",
        "j(s) = bound potential(|s|)",
        (
            LawParameter(
                "potential",
                "formula of the slip r >= 0",
                "length",
                form=ParameterForm.TEXT,
                optional=True,
                example="log(1 + r)",
            ),
            LawParameter(
                "derivative",
                "formula of the friction over the bound, in place of potential",
                "1",
                form=ParameterForm.TEXT,
                optional=True,
                instead="potential",
            ),
            _BOUND_OR_ONE,
            _FORMULA_KINKS,
            _REACH,
            _OF,
        ),
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
