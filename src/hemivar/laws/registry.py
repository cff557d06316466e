"""The laws by name: one table for problem files, for the list of laws, and for whoever adds a law.

The parameters of a law are those that its class or function states; see :mod:`hemivar.basics.stated`.  Beside the
library's own names stand classes of the user's, see :mod:`hemivar.basics.user_code`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import StrEnum
from functools import cache, partial
from inspect import Parameter as Taken
from inspect import Signature, cleandoc, isabstract, signature
from pathlib import Path
from types import MappingProxyType
from typing import cast

from hemivar.basics.arguments import shortened
from hemivar.basics.stated import Argument, Form, Stated, arguments_of, stated, stating
from hemivar.basics.types import Parameter
from hemivar.basics.user_code import class_named, name_of_class, of_user
from hemivar.errors import HemivarError, ProblemError
from hemivar.laws.coupled import (
    BenzeggaghKenane,
    BilinearCohesion,
    CoupledFormulaLaw,
    ExponentialCohesion,
    MixedMode,
    ModeDependentGlue,
    OwnCoupledLaw,
    PowerCriterion,
    TrapezoidalCohesion,
)
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
from hemivar.laws.own.formula_law import FORMULA
from hemivar.laws.own.table_law import EXTEND, TABLE
from hemivar.laws.parameters import COMPRESSION, FRICTION, LENGTH, LINE, PRESSURE, numbers, parameter, positive, word
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "COUPLED_LAWS", "FRICTION_LAWS", "NORMAL_LAWS", "LawEntry", "LawKind", "entry_named", "entry_of", "friction_law",
    "normal_law",
]  # fmt: skip


class LawKind(StrEnum):
    """Which part of the contact law an entry describes, or that it is a material."""

    NORMAL = "normal"
    FRICTION = "friction"
    MEMORY = "memory"
    MATERIAL = "material"


@dataclass(frozen=True)
class LawEntry:
    """A law or a material as it is known by name."""

    kind: LawKind
    name: str
    build: Callable[..., object]  # makes it from its parameters, which it states
    summary: str  # what the foundation or the material does
    formula: str  # j; of a material the stress or the stored energy

    @property
    def parameters(self) -> tuple[Argument, ...]:
        """What it is made from."""
        return arguments_of(self.build)

    @property
    def noun(self) -> str:
        """What messages call it."""
        return "material" if self.kind is LawKind.MATERIAL else "law"

    @property
    def key(self) -> str:
        """The key of its name in files."""
        return "kind" if self.kind is LawKind.MEMORY else "law"

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the parameters that must be given."""
        return tuple(p.key for p in self.parameters if p.required)

    def make(self, **values: object) -> object:
        """The law or the material with these parameters, by their names in files."""
        known = {p.key: p.name for p in self.parameters}
        for key in values:
            if key not in known and not (key == "where" and "potential" in known):
                listed = ", ".join(known) or "none"
                raise ProblemError(f"{self.noun} '{self.name}' has no parameter '{key}' (parameters: {listed})")
        for key in self.required:
            if key not in values:
                raise ProblemError(f"{self.noun} '{self.name}' needs the parameter {key}")
        return self.build(**{known.get(key, key): value for key, value in values.items()})


# ---- classes of the user's ----------------------------------------------------------------------------------

#: What a field is that says nothing of itself.
_NUMBER = stated(Form.NUMBER, "a number")


def entry_named(name: str, kind: LawKind, bases: tuple[type, ...], code: Sequence[str] = ()) -> LawEntry | None:
    """The law of the user's that a file names, which must be a class with one of these bases; None if it names none.

    ``code`` are the modules and files that the user allows; see :func:`hemivar.basics.user_code.class_named`.
    """
    found = class_named(name, code)
    if found is None:
        return None
    if not set(bases) & set(found.__mro__):
        wanted = " or ".join(base.__name__ for base in bases)
        raise ProblemError(f"'{name}' is not a class of a {kind} law; give one derived from {wanted}")
    if isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))  # type: ignore[attr-defined]
        raise ProblemError(f"'{name}' is abstract and cannot be made; supply {missing}, or name a class that does")
    return _entry(found, kind, name)


def entry_of(kind: type, of: LawKind) -> LawEntry | None:
    """The entry of a class of the user's, under the name that files give it; None if they have no name for it."""
    name = name_of_class(kind) if of_user(kind) else None
    return None if name is None else _entry(kind, of, name)


@cache
def _entry(kind: type, of: LawKind, name: str) -> LawEntry:
    summary = cleandoc(kind.__doc__ or "").partition("\n")[0]
    profile = of is LawKind.FRICTION and issubclass(kind, Superpotential)
    return LawEntry(of, name, _maker(kind, name, profile), summary, "")


def _maker(kind: type, name: str, profile: bool) -> Callable[..., object]:
    """What makes a law of a class of the user's; of a profile it makes the friction, with the bound.

    Fields without metadata are numbers, but for those of the library's classes from which it is derived.
    """
    inherited = {one.name for base in kind.__mro__ if is_dataclass(base) and not of_user(base) for one in fields(base)}
    says: dict[str, Mapping[str, Stated]] = {}
    if is_dataclass(kind):
        says = {one.name: one.metadata for one in fields(kind) if "stated" in one.metadata}
    if issubclass(kind, Friction):
        says |= FRICTION
    several = (Taken.VAR_POSITIONAL, Taken.VAR_KEYWORD)
    given = [one for one in signature(kind).parameters.values() if one.kind not in several]
    said = {one.name: says.get(one.name, {} if one.name in inherited else _NUMBER) for one in given}
    taken = [one.replace(kind=Taken.KEYWORD_ONLY) for one in given]
    if profile:
        twice = [key for key in FRICTION if key in said]
        if twice:
            raise ProblemError(f"law '{name}': its parameter '{twice[0]}' is one that every friction has; rename it")
        beside = [Taken("bound", Taken.KEYWORD_ONLY, default=1.0), Taken("of", Taken.KEYWORD_ONLY, default=None)]
        said |= FRICTION
        taken += beside

    def make(**values: object) -> object:
        own = {key: value for key, value in values.items() if not profile or key not in FRICTION}
        try:
            made = kind(**own)
        except HemivarError:
            raise
        except Exception as error:
            why = f"{type(error).__name__}: {shortened(error)}"
            raise ProblemError(f"'{name}' cannot be made of its values ({why}); correct them, or the class") from error
        if not profile:
            return made
        assert isinstance(made, Superpotential)
        return Friction(values.get("bound", 1.0), made, of=values.get("of"))  # type: ignore[arg-type]

    make.__stated__, make.__signature__ = said, Signature(taken)  # type: ignore[attr-defined]
    return make


# ---- normal laws --------------------------------------------------------------------------------------------


@stating(
    penetrations=numbers("not falling; negative ones are openings", LENGTH, (0.0, 0.1)),
    pressures=numbers("pressures there; negative ones are tension", PRESSURE, (0.0, 1.0)),
    extend=EXTEND,
)
def _pressure_table(
    penetrations: Sequence[float], pressures: Sequence[float], extend: str = "constant"
) -> Superpotential:
    law = table_law(penetrations, pressures, extend=extend, name="pressure-table", where="pressure-table")
    stated = {"penetrations": tuple(penetrations), "pressures": tuple(pressures), "extend": extend}
    return replace(law, stated=MappingProxyType({"law": "pressure-table", **stated}))


_normal = partial(LawEntry, LawKind.NORMAL)
_NORMAL = (
    _normal(
        "survey",
        ThresholdCompliance,
        "rigid up to the pressure q_max, beyond it linearly compliant with stiffness p_const",
        "j(r) = 0 for r < 0, q_max r + p_const r^2/2 for r >= 0",
    ),
    _normal(
        "signorini",
        Signorini,
        "rigid foundation: no penetration, no tension",
        "j(r) = 0 for r <= 0, +inf for r > 0",
    ),
    _normal(
        "compliance",
        Compliance,
        "springs that push only: pressure stiffness * r^exponent for penetration r > 0",
        "j(r) = stiffness/(exponent + 1) max(r, 0)^(exponent + 1)",
    ),
    _normal(
        "bilateral",
        Bilateral,
        "neither separation nor penetration, with any pressure or tension",
        "j(r) = 0 for r = 0, +inf otherwise",
    ),
    _normal(
        "softening",
        Softening,
        "springs that push up to the penetration limit, then soften gradually to zero",
        "j'(r) = stiffness r up to limit, then stiffness limit - softening (r - limit) down to 0",
    ),
    _normal(
        "capped",
        Capped,
        "springs that push up to the penetration limit and break there (residual 0) or yield (residual 1)",
        "j'(r) = stiffness r for 0 <= r <= limit, residual stiffness limit beyond",
    ),
    _normal(
        "finite-penetration",
        FinitePenetration,
        "springs that push, and turn rigid at the penetration limit",
        "j(r) = stiffness/2 max(r, 0)^2 for r <= limit, +inf beyond",
    ),
    _normal(
        "adhesive",
        Adhesive,
        "glue: tension stiffness w at the opening w = -r up to strength; then it breaks at once or, with softening, "
        "gradually",
        "j'(r) = stiffness r for -strength/stiffness < r < 0; compression r, or rigid, for r > 0",
    ),
    _normal(
        "layered",
        Layered,
        "layers that yield one after the other, each with its own stiffness, and lose pressure at their lower end",
        "j'' = stiffnesses[i] within layer i; j' falls by drops[i] at its lower end",
    ),
    _normal(
        "saw-tooth",
        SawTooth,
        "delamination in steps: a tension against the opening w = -r that falls at once at each of the openings",
        "j'(-w) = -(slopes[i] w + offsets[i]) up to openings[i], 0 beyond the last",
    ),
    _normal(
        "table",
        read_law_table,
        "any graph: j' is linear between the points of a CSV file with the columns r and derivative; a repeated r is "
        "a jump",
        "j' from a table",
    ),
    _normal(
        "pressure-table",
        _pressure_table,
        "any graph: the pressure is linear between the points of two lists; a repeated penetration is a jump",
        "j' from a table",
    ),
    _normal(
        "formula",
        FormulaLaw,
        "any potential or pressure, as a formula of r with piecewise((value, condition), ...), abs, min and max",
        "j(r) = potential, or j'(r) = derivative",
    ),
    _normal("none", NoContact, "no foundation in the normal direction", "j(r) = 0"),
)

#: Normal laws by name.
NORMAL_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _NORMAL})


# ---- laws that couple opening and slip ----------------------------------------------------------------------


@stating(
    TrapezoidalCohesion,
    MixedMode,
    shape=word("how the traction falls", "bilinear", "exponential", "trapezoidal"),
    compression=COMPRESSION,
)
def _mixed_mode(
    strength: Parameter,
    energy: Parameter,
    stiffness: Parameter,
    ratio: Parameter = 1.0,
    shape: str = "bilinear",
    plateau: Parameter | None = None,
    compression: Parameter | None = None,
) -> MixedMode:
    stated = (strength, energy, stiffness)
    if (plateau is not None) != (shape == "trapezoidal"):
        raise ProblemError("law 'mixed-mode': the shape 'trapezoidal' needs a plateau, and no other one has any")
    cohesion: Superpotential
    match shape:
        case "trapezoidal":
            assert plateau is not None
            cohesion = TrapezoidalCohesion(*stated, plateau)
        case "exponential":
            cohesion = ExponentialCohesion(*stated)
        case "bilinear":
            cohesion = BilinearCohesion(*stated)
        case _:
            raise ProblemError(f"law 'mixed-mode' has no shape '{shape}'; take bilinear, exponential or trapezoidal")
    return MixedMode(cohesion, ratio, Signorini() if compression is None else Compliance(compression))


@stating(
    ModeDependentGlue,
    energy=positive("fracture energy in opening, G_Ic", LINE, 0.969),
    shear_energy=positive("fracture energy in shear, G_IIc", LINE, 1.719),
    exponent=positive("eta or p of the criterion", "1", 2.284),
    criterion=word("how modes mix", BenzeggaghKenane.name, PowerCriterion.name),
    compression=COMPRESSION,
)
def _mode_dependent(
    strength: Parameter,
    shear_strength: Parameter,
    energy: Parameter,
    shear_energy: Parameter,
    stiffness: Parameter,
    exponent: Parameter,
    criterion: str = "benzeggagh-kenane",
    shear_stiffness: Parameter | None = None,
    compression: Parameter | None = None,
) -> ModeDependentGlue:
    of = PowerCriterion if criterion == PowerCriterion.name else BenzeggaghKenane
    shut = Signorini() if compression is None else Compliance(compression)
    return ModeDependentGlue(
        strength, shear_strength, stiffness, of(energy, shear_energy, exponent), shear_stiffness, shut
    )


@stating(
    potential=stated(
        Form.TEXT,
        "formula of the penetration r and the slip s",
        unit=LINE,
        example="0.5*(1 - exp(-(min(r, 0)^2 + 4*s^2)/2e-4)) + 5e3*max(r, 0)^2",
    ),
    reach=parameter("length up to which constants and minimisers are computed", LENGTH, 0.1),
    penetration=word("what resists penetration: the formula, or a rigid foundation", "formula", "rigid"),
)
def _coupled_formula(potential: str, reach: float, penetration: str = "formula", where: str = "") -> OwnCoupledLaw:
    return CoupledFormulaLaw(potential, reach=reach, rigid=penetration == "rigid", where=where)


_COUPLED = (
    _normal(
        "mixed-mode",
        _mixed_mode,
        "glue with one effective opening of opening and slip and one fracture energy; includes friction",
        "j(r) = Phi(rho), rho = sqrt(<w>^2 + ratio^2 |s|^2), with the opening w = -r and the slip s",
    ),
    _normal(
        "mode-dependent",
        _mode_dependent,
        "bilinear glue with separate fracture energies in opening and shear, by the mode of the solution (no "
        "potential: solved by fixed point); includes friction",
        "J(w, v) = Phi_B(w)(rho(v)), with the mode B of the state w",
    ),
    _normal(
        "coupled-formula",
        _coupled_formula,
        "any potential of penetration and slip, as a formula of r (negative: opening) and the length s of the "
        "slip; includes friction",
        "j(r, s) = potential",
    ),
)

#: Laws that couple opening and slip by name; they stand where a normal law does, and for friction, too.
COUPLED_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _COUPLED})


# ---- friction laws ------------------------------------------------------------------------------------------


@stating(
    bound=FRICTION["bound"],
    ratio=positive("bound across the axis over that along it", "1", 0.5),
    axis=numbers("a direction; its projection on the surface is the axis", "1", (1.0, 0.0, 0.0)),
)
def _orthotropic(bound: Parameter | StateBound, ratio: Parameter, axis: Sequence[float]) -> Friction:
    return OrthotropicFriction(bound, ratio=ratio, axis=axis)


@stating(file=TABLE, extend=EXTEND, **FRICTION)
def _table_friction(
    file: str | Path, bound: Parameter | StateBound = 1.0, extend: str = "constant", of: str | None = None
) -> Friction:
    return Friction(bound, read_law_table(file, extend=extend, friction=True), of=of)


@stating(
    potential=stated(Form.TEXT, "formula of the slip r >= 0", unit=LENGTH, example="log(1 + r)"),
    derivative=stated(
        Form.TEXT, "formula of the friction over the bound, in place of potential", unit="1", instead="potential"
    ),
    **FORMULA,
    **FRICTION,
)
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


_friction = partial(LawEntry, LawKind.FRICTION)
_FRICTION = (
    _friction(
        "tresca",
        Tresca,
        "friction of at most bound; where the body slips it has this size and opposes the slip",
        "j(s) = bound |s|",
    ),
    _friction(
        "coulomb",
        Coulomb,
        "friction of at most coefficient times the pressure (quasi-variational: the bound is iterated)",
        "j(s) = coefficient pressure |s|",
    ),
    _friction(
        "orthotropic",
        _orthotropic,
        "friction of at most bound along an axis of the surface and ratio bound across it, in 3D",
        "j(s) = bound sqrt(s1^2 + ratio^2 s2^2)",
    ),
    _friction(
        "slip-weakening",
        SlipWeakening,
        "friction that falls with the slip from bound static to bound kinetic, exponentially",
        "j(s) = bound (kinetic |s| - (static - kinetic)/rate (exp(-rate |s|) - 1))",
    ),
    _friction(
        "logarithmic",
        Logarithmic,
        "friction bound/(scale + slip), which falls to zero with the slip",
        "j(s) = bound ln(1 + |s|/scale)",
    ),
    _friction(
        "static-kinetic",
        StaticKinetic,
        "friction bound static up to a slip, from there at once bound kinetic",
        "j'(s) = bound static for 0 < s < slip, bound kinetic beyond",
    ),
    _friction(
        "slip-table",
        SlipTable,
        "friction bound times a table of the slip, linear between its points and constant beyond; a repeated slip is "
        "a jump",
        "j'(s) = bound values(s)",
    ),
    _friction(
        "table",
        _table_friction,
        "friction bound times a CSV file with the columns r (slip >= 0) and derivative; the same in both directions",
        "j' from a table",
    ),
    _friction(
        "formula",
        _formula_friction,
        "friction from any potential or its derivative, as a formula of the slip r >= 0; the same in both directions",
        "j(s) = bound potential(|s|)",
    ),
    _friction("none", NoFriction, "no friction", "j(s) = 0"),
)

#: Friction laws by name.
FRICTION_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _FRICTION})


def normal_law(name: str, **values: object) -> Superpotential:
    """The normal law of this name, such as ``normal_law("survey", q_max=0.3, p_const=2.0)``."""
    return cast(Superpotential, _known(NORMAL_LAWS, name).make(**values))


def friction_law(name: str, **values: object) -> Friction:
    """The friction law of this name, such as ``friction_law("tresca", bound=0.5)``."""
    return cast(Friction, _known(FRICTION_LAWS, name).make(**values))


def _known(laws: Mapping[str, LawEntry], name: str) -> LawEntry:
    if name not in laws:
        raise ProblemError(f"law '{name}' is not known; the laws are {', '.join(laws)}")
    return laws[name]
