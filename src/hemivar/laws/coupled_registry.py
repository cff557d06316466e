"""The laws that couple opening and slip by name, for problem files and for the list of laws."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType

from hemivar.basics.types import Parameter
from hemivar.errors import ProblemError
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
from hemivar.laws.normal import Compliance, Signorini
from hemivar.laws.registry import LawEntry, LawKind, LawParameter, ParameterForm
from hemivar.laws.superpotential import Superpotential

__all__ = ["COUPLED_LAWS"]

#: A number that must be above zero.
_positive = partial(LawParameter, minimum=0.0, positive=True)
_PRESSURE, _RATE = "force/area", "force/area/length"


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


def _formula(potential: str, reach: float, penetration: str = "formula", where: str = "") -> OwnCoupledLaw:
    return CoupledFormulaLaw(potential, reach=reach, rigid=penetration == "rigid", where=where)


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


_COUPLED = (
    LawEntry(
        "mixed-mode",
        LawKind.NORMAL,
        _mixed_mode,
        "glue that opens and slips through one effective opening and lets go with one fracture energy; stands for "
        "friction, too",
        "j(r) = Phi(rho), rho = sqrt(<w>^2 + ratio^2 |s|^2), with the opening w = -r and the slip s",
        (
            _positive("strength", "largest traction in opening", _PRESSURE, example=30.0),
            _positive("energy", "fracture energy G_c", "force/length", example=0.5),
            _positive("stiffness", "initial stiffness", _RATE, example=1e4),
            _positive("ratio", "shear strength over normal strength", "1", 1.0, example=1.5),
            LawParameter(
                "shape", "how the traction falls", "bilinear, exponential or trapezoidal", "bilinear",
                form=ParameterForm.TEXT, choices=("bilinear", "exponential", "trapezoidal"),
            ),
            LawParameter("plateau", "length of the plateau of a trapezoid", "length", minimum=0.0, optional=True),
            LawParameter("compression", "stiffness in penetration; left out: rigid", _RATE, minimum=0.0, optional=True),
        ),
    ),
    LawEntry(
        "mode-dependent",
        LawKind.NORMAL,
        _mode_dependent,
        "bilinear glue with one fracture energy for opening and another for shear, by the mode of the solution (no "
        "potential: solved by fixed point); stands for friction, too",
        "J(w, v) = Phi_B(w)(rho(v)), with the mode B of the state w",
        (
            _positive("strength", "largest traction in opening", _PRESSURE, example=80.0),
            _positive("shear_strength", "largest traction in shear", _PRESSURE, example=100.0),
            _positive("energy", "fracture energy in opening, G_Ic", "force/length", example=0.969),
            _positive("shear_energy", "fracture energy in shear, G_IIc", "force/length", example=1.719),
            _positive("stiffness", "initial stiffness in opening", _RATE, example=1e6),
            _positive("exponent", "eta or p of the criterion", "1", example=2.284),
            LawParameter(
                "criterion", "how modes mix", "benzeggagh-kenane or power", "benzeggagh-kenane",
                form=ParameterForm.TEXT, choices=("benzeggagh-kenane", "power"),
            ),
            _positive("shear_stiffness", "initial stiffness in shear; left out: as Turon et al.", _RATE, optional=True),
            LawParameter("compression", "stiffness in penetration; left out: rigid", _RATE, minimum=0.0, optional=True),
        ),
    ),
    LawEntry(
        "coupled-formula",
        LawKind.NORMAL,
        _formula,
        "any potential of penetration and slip, as a formula of r (negative: opening) and the length s of the slip; "
        "stands for friction, too",
        "j(r, s) = potential",
        (
            LawParameter(
                "potential", "formula of the penetration r and the slip s", "force/length", form=ParameterForm.TEXT,
                example="0.5*(1 - exp(-(min(r, 0)^2 + 4*s^2)/2e-4)) + 5e3*max(r, 0)^2",
            ),
            LawParameter("reach", "length up to which constants and minimisers are looked for", "length", example=0.1),
            LawParameter(
                "penetration", "what stops it: the formula, or nothing penetrates", "formula or rigid", "formula",
                form=ParameterForm.TEXT, choices=("formula", "rigid"),
            ),
        ),
    ),
)  # fmt: skip

#: Laws that couple opening and slip by name; they stand where a normal law does, and for friction, too.
COUPLED_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _COUPLED})
