"""Named nonmonotone laws: foundations that soften, break, end or stick, and friction that weakens with slip.

Penetration r is positive where the body goes into the foundation; opening is negative penetration.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.base import Interval
from hemivar.laws.bounds import StateBound
from hemivar.laws.friction import Friction
from hemivar.laws.named import NamedLaw, ParameterLaw
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.scaled import ScaledLaw
from hemivar.laws.tables import check_points, even_table

__all__ = [
    "Adhesive",
    "Capped",
    "ExponentialWeakening",
    "FinitePenetration",
    "Layered",
    "Logarithmic",
    "LogarithmicWeakening",
    "SawTooth",
    "SlipTable",
    "SlipWeakening",
    "Softening",
    "StaticKinetic",
    "StaticKineticProfile",
]


def _columns(*values: Array | float) -> Array:
    """Values for each contact point side by side, shape (m or 1, K)."""
    return np.stack(np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, dtype=float)) for v in values)), axis=-1)


# ---- normal laws -----------------------------------------------------------------------------------------


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
    """

    stiffness: Parameter
    limit: Parameter
    softening: Parameter
    name: ClassVar[str] = "softening"  # type: ignore[misc]
    minimum: ClassVar[dict[str, float]] = {"softening": 0.0}
    positive: ClassVar[tuple[str, ...]] = ("stiffness", "limit")

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit, alpha = values["stiffness"], values["limit"], values["softening"]
        length = np.where(alpha > 0.0, limit * k / np.where(alpha > 0.0, alpha, 1.0), limit)
        zero = np.zeros(1)
        return PiecewiseQuadratic(
            _columns(zero, limit, limit + length), _columns(zero, k, -alpha, zero), np.zeros((1, 3)), name=self.name
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

    stiffness: Parameter
    limit: Parameter
    residual: Parameter = 0.0
    name: ClassVar[str] = "capped"  # type: ignore[misc]
    minimum: ClassVar[dict[str, float]] = {"residual": 0.0}
    positive: ClassVar[tuple[str, ...]] = ("stiffness", "limit")

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit, residual = values["stiffness"], values["limit"], values["residual"]
        zero = np.zeros(1)
        return PiecewiseQuadratic(
            _columns(zero, limit), _columns(zero, k, zero), _columns(zero, (residual - 1.0) * k * limit), name=self.name
        )


@dataclass(frozen=True, eq=False)
class FinitePenetration(NamedLaw):
    """Springs that turn rigid: pressure ``stiffness r`` for 0 <= r < ``limit``, any larger one at r = ``limit``.

    Parameters
    ----------
    stiffness : Parameter
        >= 0 (force per area and length).
    limit : Parameter
        Largest penetration, > 0.
    """

    stiffness: Parameter
    limit: Parameter
    name: ClassVar[str] = "finite-penetration"  # type: ignore[misc]
    minimum: ClassVar[dict[str, float]] = {"stiffness": 0.0}
    positive: ClassVar[tuple[str, ...]] = ("limit",)

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit = np.broadcast_arrays(values["stiffness"], values["limit"])
        zero = np.zeros(1)
        return PiecewiseQuadratic(
            _columns(zero, limit), _columns(zero, k, zero), np.zeros((1, 2)), upper=limit, name=self.name
        )


@dataclass(frozen=True, eq=False)
class Adhesive(NamedLaw):
    """Glue with a finite tensile strength.

    Opening w = -r >= 0 is resisted by the tension ``stiffness w`` up to ``strength``; then the glue breaks at once
    (no ``softening``: alpha is infinite) or its tension falls by ``softening`` per length. Penetration is resisted
    by springs of stiffness ``compression``, or not possible at all.

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
    """

    stiffness: Parameter
    strength: Parameter
    softening: Parameter | None = None
    compression: Parameter | None = None
    name: ClassVar[str] = "adhesive"  # type: ignore[misc]
    minimum: ClassVar[dict[str, float]] = {"compression": 0.0}
    positive: ClassVar[tuple[str, ...]] = ("stiffness", "strength", "softening")

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, strength = values["stiffness"], values["strength"]
        push = values.get("compression")
        last = np.zeros(1) if push is None else push
        opening, zero = strength / k, np.zeros(1)
        if "softening" not in values:
            knots, slopes, jumps = _columns(-opening, zero), _columns(zero, k, last), _columns(-strength, zero)
        else:
            fall = values["softening"]
            knots = _columns(-opening - strength / fall, -opening, zero)
            slopes, jumps = _columns(zero, -fall, k, last), np.zeros((1, 3))
        return PiecewiseQuadratic(knots, slopes, jumps, upper=0.0 if push is None else np.inf, name=self.name)


def _numbers(values: Sequence[float] | Array, what: str) -> Array:
    if np.iscomplexobj(values):
        raise ProblemError(f"{what} are complex; give real numbers")
    try:
        numbers = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        raise ProblemError(f"{what} must be a list of numbers, not {values!r}") from None
    if numbers.ndim != 1 or numbers.size == 0 or not np.isfinite(numbers).all():
        raise ProblemError(f"{what} must be a list of finite numbers, not {values!r}")
    return numbers


def _same_length(what: str, numbers: Array, count: int, reason: str) -> Array:
    if numbers.size != count:
        raise ProblemError(f"{what} has {numbers.size} numbers; it needs {count}, {reason}")
    return numbers


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
        raise ProblemError(f"drops of law 'layered' hold {lost.min():g}; a drop is the pressure lost, at least 0")
    knots = np.concatenate([[0.0], np.cumsum(thick)])
    slopes = np.concatenate([[0.0], stiff, [0.0 if base is None else float(base)]])
    upper = np.inf if base is not None else knots[-1]
    stated = {"law": "layered", "thicknesses": thick, "stiffnesses": stiff, "drops": lost, "base": base}
    jumps = np.concatenate([[0.0], -lost])
    return PiecewiseQuadratic(knots, slopes, jumps, upper=upper, name="layered", stated=MappingProxyType(stated))


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
    if compression is not None and not compression >= 0.0:
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


# ---- friction profiles: even laws j_tau(|r|) ---------------------------------------------------------------


class _EvenLaw(ParameterLaw):
    """An even law that is smooth for r > 0, given by its formulas there."""

    @abstractmethod
    def _half(self, s: Array, order: int) -> Array:
        """Value (order 0), first or second derivative at s = |r|."""

    @property
    @abstractmethod
    def _rows(self) -> int: ...

    @property
    def knots(self) -> Array:
        return np.zeros((self._rows, 1))

    @property
    def domain(self) -> Interval:
        return Interval(np.array([-np.inf]), np.array([np.inf]))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._half(np.where(np.asarray(piece) > 0, np.maximum(r, 0.0), np.maximum(np.negative(r), 0.0)), 0)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        right = np.asarray(piece) > 0
        s = np.where(right, np.maximum(r, 0.0), np.maximum(np.negative(r), 0.0))
        return np.where(right, 1.0, -1.0) * self._half(s, 1)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._half(np.where(np.asarray(piece) > 0, np.maximum(r, 0.0), np.maximum(np.negative(r), 0.0)), 2)

    def scaled(self, factor: Array | float) -> ScaledLaw:
        return ScaledLaw(self, np.atleast_1d(real_array(factor, f"the factor of law '{self.name}'", finite=False)))


@dataclass(frozen=True, eq=False)
class ExponentialWeakening(_EvenLaw):
    """j(r) = kinetic |r| + (static - kinetic)/rate (1 - exp(-rate |r|)): friction falls from static to kinetic.

    alpha = rate (static - kinetic). The survey's family 0.7 r - 0.3 exp(-r) has static 1, kinetic 0.7, rate 1.
    """

    static: Parameter = 1.0
    kinetic: Parameter = 0.7
    rate: Parameter = 1.0
    name: ClassVar[str] = "slip-weakening"  # type: ignore[misc]
    minimum: ClassVar[dict[str, float]] = {"static": 0.0, "kinetic": 0.0}
    positive: ClassVar[tuple[str, ...]] = ("rate",)

    @cached_property
    def _resolved(self) -> tuple[Array, Array, Array]:
        v = self._values(None)
        static, kinetic, rate = np.broadcast_arrays(v["static"], v["kinetic"], v["rate"])
        return static, kinetic, rate

    @property
    def _rows(self) -> int:
        return self._resolved[0].size

    def _half(self, s: Array, order: int) -> Array:
        static, kinetic, rate = self._resolved
        gain = static - kinetic
        if order == 0:
            return np.asarray(kinetic * s - gain / rate * np.expm1(-rate * s))
        if order == 1:
            return np.asarray(kinetic + gain * np.exp(-rate * s))
        return np.asarray(-rate * gain * np.exp(-rate * s))

    @property
    def weak_convexity(self) -> Array:
        static, kinetic, rate = self._resolved
        return np.maximum(rate * (static - kinetic), 0.0)

    @property
    def growth(self) -> tuple[Array, Array]:
        static, kinetic, _ = self._resolved
        return np.maximum(static, kinetic), np.zeros(static.shape)

    def recession(self, sign: Array) -> Array:
        return np.asarray(self._resolved[1] * np.abs(sign))

    def piece_formula(self, piece: int) -> str:
        static, kinetic, rate = (float(x[0]) for x in self._resolved)
        sign, argument = ("", "-") if piece else ("-", "")
        return f"{sign}({kinetic:.6g} + {static - kinetic:.6g} exp({argument}{rate:.6g} r))"


@dataclass(frozen=True, eq=False)
class LogarithmicWeakening(_EvenLaw):
    """j(r) = ln(1 + |r|/scale): friction 1/(scale + |r|) falls to nothing with the slip; alpha = 1/scale^2."""

    scale: Parameter = 1.0
    name: ClassVar[str] = "logarithmic"  # type: ignore[misc]
    positive: ClassVar[tuple[str, ...]] = ("scale",)

    @cached_property
    def _resolved(self) -> Array:
        return self._values(None)["scale"]

    @property
    def _rows(self) -> int:
        return self._resolved.size

    def _half(self, s: Array, order: int) -> Array:
        scale = self._resolved
        if order == 0:
            return np.asarray(np.log1p(s / scale))
        return np.asarray(1.0 / (scale + s) if order == 1 else -1.0 / (scale + s) ** 2)

    @property
    def weak_convexity(self) -> Array:
        return self._resolved**-2.0

    @property
    def growth(self) -> tuple[Array, Array]:
        return 1.0 / self._resolved, np.zeros(self._resolved.shape)

    def recession(self, sign: Array) -> Array:
        return np.zeros(np.broadcast_shapes(self._resolved.shape, np.shape(sign)))

    def piece_formula(self, piece: int) -> str:
        scale = float(self._resolved[0])
        return f"1/({scale:.6g} + r)" if piece else f"-1/({scale:.6g} - r)"


@dataclass(frozen=True, eq=False)
class StaticKineticProfile(NamedLaw):
    """j'(r) = static for 0 < r < slip, kinetic beyond: friction drops at once; alpha is infinite if it drops."""

    slip: Parameter
    static: Parameter = 1.0
    kinetic: Parameter = 0.7
    name: ClassVar[str] = "static-kinetic"  # type: ignore[misc]
    minimum: ClassVar[dict[str, float]] = {"static": 0.0, "kinetic": 0.0}
    positive: ClassVar[tuple[str, ...]] = ("slip",)

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        slip, static, kinetic = values["slip"], values["static"], values["kinetic"]
        change = kinetic - static
        return PiecewiseQuadratic(
            _columns(-slip, 0.0 * slip, slip),
            np.zeros((1, 4)),
            _columns(change, 2.0 * static, change),
            start=np.broadcast_arrays(-kinetic, change, slip)[0].copy(),
            name=self.name,
        )


# ---- friction laws ---------------------------------------------------------------------------------------


def SlipWeakening(  # noqa: N802 - a law, named as the others are
    bound: Parameter | StateBound, static: Parameter = 1.0, kinetic: Parameter = 0.7, rate: Parameter = 1.0
) -> Friction:
    """Friction that falls with the slip from ``bound static`` to ``bound kinetic`` like exp(-rate |slip|).

    The defaults are the survey's j_tau(r) = 0.7 r - 0.3 exp(-r).
    """
    return Friction(bound, ExponentialWeakening(static, kinetic, rate))


def Logarithmic(bound: Parameter | StateBound, scale: Parameter = 1.0) -> Friction:  # noqa: N802
    """Friction ``bound/(scale + |slip|)``, j_tau(r) = ln(1 + |r|/scale)."""
    return Friction(bound, LogarithmicWeakening(scale))


def StaticKinetic(  # noqa: N802
    bound: Parameter | StateBound, slip: Parameter, static: Parameter = 1.0, kinetic: Parameter = 0.7
) -> Friction:
    """Friction ``bound static`` up to the slip ``slip`` > 0, then at once ``bound kinetic``."""
    return Friction(bound, StaticKineticProfile(slip, static, kinetic))


def SlipTable(  # noqa: N802
    bound: Parameter | StateBound, slips: Sequence[float], values: Sequence[float]
) -> Friction:
    """Friction ``bound`` times a table of the slip, linear between its points and constant beyond them.

    Parameters
    ----------
    bound : Parameter or StateBound
    slips : sequence of float
        >= 0, not falling; a repeated one is a jump.
    values : sequence of float
        j_tau' at the slips.
    """
    r, d = check_points(slips, values, "slips of law 'slip-table'", friction=True)
    stated = MappingProxyType({"law": "slip-table", "slips": r, "values": d})
    return Friction(bound, even_table(r, d, name="slip-table", stated=stated))
