"""Nonmonotone normal laws: foundations that soften, break, give way in layers or stick.

Penetration r is positive where the body goes into the foundation; opening is negative penetration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import number, quoted
from hemivar.basics.arrays import real_array
from hemivar.basics.stated import stating
from hemivar.basics.types import Array, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import COMPRESSION, LENGTH, LINE, PRESSURE, RATE, evaluate, numbers, parameter, positive
from hemivar.laws.parametrised import NamedLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["Adhesive", "Capped", "Layered", "SawTooth", "Softening"]


@named(
    LawKind.NORMAL,
    "softening",
    "springs that push up to the penetration limit, then soften gradually to zero",
    "j'(r) = stiffness r up to limit, then stiffness limit - softening (r - limit) down to 0",
)
@dataclass(frozen=True, eq=False)
class Softening(NamedLaw):
    """Springs that push up to a penetration, then give way gradually.

    Pressure ``stiffness r`` for 0 <= r <= ``limit``, then ``stiffness limit - softening (r - limit)`` down to zero,
    and none beyond. Weakly convex with alpha = ``softening``.

    Parameters
    ----------
    stiffness : Parameter
        > 0 (force per area and length).
    limit : Parameter
        Penetration of the largest pressure, > 0.
    softening : Parameter
        Rate at which the pressure falls, >= 0 (force per area and length); with 0 it stays.

    Examples
    --------
    >>> import hemivar as hv
    >>> law = hv.Softening(stiffness=2.0, limit=0.1, softening=0.9)
    >>> law.derivative([0.05, 0.1, 0.2])
    array([0.1 , 0.2 , 0.11])
    >>> law.weak_convexity
    array([0.9])
    """

    stiffness: Parameter = field(metadata=positive("of the springs", RATE, 2.0))
    limit: Parameter = field(metadata=positive("penetration of the largest pressure", LENGTH, 0.1))
    softening: Parameter = field(metadata=parameter("rate at which the pressure falls", RATE, 0.5, least=0.0))
    name: ClassVar[str] = "softening"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit, alpha = values["stiffness"], values["limit"], values["softening"]
        length = np.where(alpha > 0.0, limit * k / np.where(alpha > 0.0, alpha, 1.0), limit)
        zero = np.zeros(1)
        return PiecewiseQuadratic(
            columns(zero, limit, limit + length), columns(zero, k, -alpha, zero), np.zeros((1, 3)), name=self.name
        )


@named(
    LawKind.NORMAL,
    "capped",
    "springs that push up to the penetration limit and break there (residual 0) or yield (residual 1)",
    "j'(r) = stiffness r for 0 <= r <= limit, residual stiffness limit beyond",
)
@dataclass(frozen=True, eq=False)
class Capped(NamedLaw):
    """Springs that push up to a penetration and break there.

    Pressure ``stiffness r`` for 0 <= r <= ``limit``, then ``residual stiffness limit``: with residual 0 it falls to
    zero at once (alpha is infinite), with residual 1 it stays.  Jureczka and Ochal 2019: stiffness 20, limit 0.1.

    Parameters
    ----------
    stiffness : Parameter
        > 0 (force per area and length).
    limit : Parameter
        Penetration at which the springs break, > 0.
    residual : Parameter
        Share of the largest pressure that is left, >= 0.
    """

    stiffness: Parameter = field(metadata=positive("of the springs", RATE, 20.0))
    limit: Parameter = field(metadata=positive("penetration at which they break", LENGTH, 0.1))
    residual: Parameter = field(
        default=0.0, metadata=parameter("share of the largest pressure that is left", "1", least=0.0)
    )
    name: ClassVar[str] = "capped"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit, residual = values["stiffness"], values["limit"], values["residual"]
        zero = np.zeros(1)
        return PiecewiseQuadratic(
            columns(zero, limit), columns(zero, k, zero), columns(zero, (residual - 1.0) * k * limit), name=self.name
        )


@named(
    LawKind.NORMAL,
    "adhesive",
    "glue: tension stiffness w at the opening w = -r up to strength; then it breaks at once or, with "
    "softening, gradually",
    "j'(r) = stiffness r for -strength/stiffness < r < 0; compression r, or rigid, for r > 0",
)
@dataclass(frozen=True, eq=False)
class Adhesive(NamedLaw):
    """Glue with a finite tensile strength.

    Opening w = -r >= 0 is resisted by the tension ``stiffness w`` up to ``strength``; then the glue breaks at once
    (no ``softening``: alpha is infinite) or its tension falls by ``softening`` per length, which may be stated by the
    fracture ``energy``. Penetration is resisted by springs of stiffness ``compression``, or not possible at all.

    Parameters
    ----------
    stiffness : Parameter
        Of the glue, > 0 (force per area and length).
    strength : Parameter
        Largest tension, > 0 (force per area).
    softening : Parameter, optional
        > 0 (force per area and length); left out: brittle.
    compression : Parameter, optional
        Stiffness in penetration, >= 0; left out: rigid.
    energy : Parameter, optional
        Instead of ``softening``: the fracture energy G_c, the area under the tension (force per length), larger than
        what is stored at the strength, ``strength^2 / (2 stiffness)``.

    Raises
    ------
    ProblemError
        Softening and energy are both given; the energy is too small.

    Examples
    --------
    >>> import hemivar as hv
    >>> glue = hv.Adhesive(stiffness=100.0, strength=2.0, energy=0.1)
    >>> glue.derivative([-0.01, -0.02, -0.2]).round(3) + 0.0  # minus the tension at these openings
    array([-1., -2.,  0.])
    """

    stiffness: Parameter = field(metadata=positive("of the glue", RATE, 5.0))
    strength: Parameter = field(metadata=positive("largest tension", PRESSURE, 0.5))
    softening: Parameter | None = field(
        default=None, metadata=positive("rate at which the tension falls; left out: at once", RATE)
    )
    compression: Parameter | None = field(default=None, metadata=COMPRESSION)
    energy: Parameter | None = field(default=None, metadata=positive("fracture energy, instead of softening", LINE))
    name: ClassVar[str] = "adhesive"  # type: ignore[misc]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.softening is not None and self.energy is not None:
            raise ProblemError(
                f"law '{self.name}' has a softening and a fracture energy; give one of the two, for each follows from "
                "the other"
            )

    @property
    def is_glue(self) -> bool:
        return True

    def debonding(self, r: Array) -> dict[str, Array]:
        opening = np.maximum(-np.asarray(r, dtype=float), 0.0)
        tension = np.where(opening > 0.0, -self.derivative(-opening), 0.0)
        stiffness = evaluate(self.stiffness, None, f"stiffness of law '{self.name}'")
        linear = stiffness * np.where(opening > 0.0, opening, 1.0)
        return {
            "damage": np.where(opening > 0.0, np.maximum(1.0 - tension / linear, 0.0), 0.0),
            "dissipated": np.maximum(self.value(-opening) - 0.5 * tension * opening, 0.0),
        }

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, strength = values["stiffness"], values["strength"]
        push = values.get("compression")
        last = np.zeros(1) if push is None else push
        opening, zero = strength / k, np.zeros(1)
        if "energy" in values:
            length = 2.0 * values["energy"] / strength - opening
            if np.any(length <= 0.0):
                raise ProblemError(
                    f"energy of law '{self.name}' is {values['energy'].min():g}, not more than what is stored when the "
                    f"strength is reached, strength^2/(2 stiffness) = {np.max(0.5 * strength * opening):g}; leave it "
                    "out for glue that breaks at once"
                )
            values = values | {"softening": strength / length}
        if "softening" not in values:
            knots, slopes, jumps = columns(-opening, zero), columns(zero, k, last), columns(-strength, zero)
        else:
            fall = values["softening"]
            knots = columns(-opening - strength / fall, -opening, zero)
            slopes, jumps = columns(zero, -fall, k, last), np.zeros((1, 3))
        return PiecewiseQuadratic(knots, slopes, jumps, upper=0.0 if push is None else np.inf, name=self.name)


def _numbers(values: Sequence[float] | Array, what: str) -> Array:
    numbers = np.atleast_1d(real_array(values, what, finite=False))
    if numbers.ndim != 1 or numbers.size == 0 or not np.isfinite(numbers).all():
        raise ProblemError(f"{what} must be a list of finite numbers, not {quoted(values)}")
    return numbers


def _same_length(what: str, numbers: Array, count: int, reason: str) -> Array:
    if numbers.size != count:
        raise ProblemError(f"{what} has {numbers.size} numbers; it needs {count}, {reason}")
    return numbers


@named(
    LawKind.NORMAL,
    "layered",
    "layers that yield one after the other, each with its own stiffness, and lose pressure at their lower end",
    "j'' = stiffnesses[i] within layer i; j' falls by drops[i] at its lower end",
)
@stating(
    thicknesses=numbers("of the layers, from the surface down", LENGTH, (0.05, 0.1)),
    stiffnesses=numbers("of the layers", RATE, (10.0, 4.0)),
    drops=numbers("pressure lost at the lower end of each layer", PRESSURE, (0.3, 0.2)),
    base=parameter("stiffness of the ground below; left out: rigid", RATE, 2.0),
)
def Layered(  # noqa: N802 - a law, named as the others are
    thicknesses: Sequence[float],
    stiffnesses: Sequence[float],
    drops: Sequence[float] | None = None,
    base: float | None = None,
) -> PiecewiseQuadratic:
    """A foundation of layers that yield one after the other.

    Within layer i the pressure rises by ``stiffnesses[i]`` per length of penetration; when the layer is used up, it
    falls at once by ``drops[i]`` (the layer breaks).

    Parameters
    ----------
    thicknesses : sequence of float
        Of the layers, from the surface down, > 0.
    stiffnesses : sequence of float
        Of the layers (force per area and length); negative ones soften.
    drops : sequence of float, optional
        Pressure lost at the lower end of each layer, >= 0; none if left out.
    base : float, optional
        Stiffness of the ground below all layers; left out: rigid.

    Returns
    -------
    PiecewiseQuadratic

    Raises
    ------
    ProblemError
        Lists of different lengths, a thickness that is not positive, a negative drop.
    """
    thick = _numbers(thicknesses, "thicknesses of law 'layered'")
    reason = "one for each layer"
    stiff = _same_length(
        "stiffnesses of law 'layered'", _numbers(stiffnesses, "stiffnesses of law 'layered'"), thick.size, reason
    )
    lost = np.zeros(thick.size) if drops is None else _numbers(drops, "drops of law 'layered'")
    lost = _same_length("drops of law 'layered'", lost, thick.size, reason)
    if (thick <= 0.0).any():
        raise ProblemError(f"thicknesses of law 'layered' hold {thick.min():g}; every layer needs a positive thickness")
    if (lost < 0.0).any():
        raise ProblemError(
            f"drops of law 'layered' hold {lost.min():g}; a drop is the pressure lost: it must be at least 0"
        )
    knots = np.concatenate([[0.0], np.cumsum(thick)])
    slopes = np.concatenate([[0.0], stiff, [0.0 if base is None else number(base, "base of law 'layered'")]])
    upper = np.inf if base is not None else knots[-1]
    stated = {"law": "layered", "thicknesses": thick, "stiffnesses": stiff, "drops": lost, "base": base}
    jumps = np.concatenate([[0.0], -lost])
    return PiecewiseQuadratic(knots, slopes, jumps, upper=upper, name="layered", stated=MappingProxyType(stated))


@named(
    LawKind.NORMAL,
    "saw-tooth",
    "delamination in steps: a tension against the opening w = -r that falls at once at each of the openings",
    "j'(-w) = -(slopes[i] w + offsets[i]) up to openings[i], 0 beyond the last",
)
@stating(
    openings=numbers("at which the tension falls, increasing", LENGTH, (1.0, 2.0)),
    slopes=numbers("of the tension on each tooth", RATE, (3.0, 1.0)),
    offsets=numbers("of the tension on each tooth", PRESSURE),
    compression=COMPRESSION,
)
def SawTooth(  # noqa: N802 - a law, named as the others are
    openings: Sequence[float],
    slopes: Sequence[float],
    offsets: Sequence[float] | None = None,
    compression: float | None = None,
) -> PiecewiseQuadratic:
    """Delamination in steps: a tension against the opening w = -r that jumps down at each of ``openings``.

    Tension ``slopes[i] w + offsets[i]`` for ``openings[i - 1] < w < openings[i]`` (from w = 0 on), none beyond the
    last.  Makela et al. 1998: openings 0.5e-3, 1e-3, 2e-3; slopes 60e6, 20e6, 10e6; offsets 0, 10e3, 5e3.

    Parameters
    ----------
    openings : sequence of float
        Increasing, > 0 (length).
    slopes : sequence of float
        Of the tension on each tooth (force per area and length).
    offsets : sequence of float, optional
        Of the tension on each tooth (force per area); zero if left out.
    compression : float, optional
        Stiffness in penetration, >= 0; left out: rigid.

    Returns
    -------
    PiecewiseQuadratic

    Raises
    ------
    ProblemError
        Lists of different lengths, openings that do not increase from zero.
    """
    ends = _numbers(openings, "openings of law 'saw-tooth'")
    if (np.diff(np.concatenate([[0.0], ends])) <= 0.0).any():
        raise ProblemError(f"openings of law 'saw-tooth' are {ends.tolist()}; they must increase, from above 0")
    reason = "one for each tooth"
    rates = _same_length("slopes of law 'saw-tooth'", _numbers(slopes, "slopes of law 'saw-tooth'"), ends.size, reason)
    shift = np.zeros(ends.size) if offsets is None else _numbers(offsets, "offsets of law 'saw-tooth'")
    shift = _same_length("offsets of law 'saw-tooth'", shift, ends.size, reason)
    if compression is not None and not number(compression, "compression of law 'saw-tooth'") >= 0.0:
        raise ProblemError(f"compression of law 'saw-tooth' is {compression:g}; it must be at least 0")
    # from the far opening to zero: r = -w, j'(r) = -tension(-r)
    starts = np.concatenate([[0.0], ends[:-1]])
    at_start, at_end = rates * starts + shift, rates * ends + shift
    outer = np.concatenate([at_start[1:], [0.0]])  # tension just beyond each end
    jumps = np.concatenate([(outer - at_end)[::-1], [at_start[0]]])
    knots = np.concatenate([-ends[::-1], [0.0]])
    table = np.concatenate([[0.0], rates[::-1], [0.0 if compression is None else compression]])
    upper = 0.0 if compression is None else np.inf
    stated = {"law": "saw-tooth", "openings": ends, "slopes": rates, "offsets": shift, "compression": compression}
    return PiecewiseQuadratic(knots, table, jumps, upper=upper, name="saw-tooth", stated=MappingProxyType(stated))
