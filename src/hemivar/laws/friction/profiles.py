"""Friction profiles: even laws j_tau(|r|), which a bound makes friction laws."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray, Parameter
from hemivar.laws.compiled_law import LaidOut, lay_out
from hemivar.laws.parameters import LENGTH, parameter, positive
from hemivar.laws.parametrised import NamedLaw, ParameterLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["ABSOLUTE_VALUE", "ExponentialWeakening", "LogarithmicWeakening", "StaticKineticProfile"]

#: j(r) = |r|, the profile of Tresca's law.
ABSOLUTE_VALUE = PiecewiseQuadratic(
    np.zeros((1, 1)),
    np.zeros((1, 2)),
    np.full((1, 1), 2.0),
    start=-1.0,
    name="absolute value",
    stated=MappingProxyType({"law": "tresca"}),
)


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

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._half(_along(np.asarray(piece) > 0, r), 0)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        right = np.asarray(piece) > 0
        slope = self._half(_along(right, r), 1)
        return np.where(right, slope, -slope)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._half(_along(np.asarray(piece) > 0, r), 2)

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        right = np.asarray(piece) > 0
        slope, bend = self._half_line(_along(right, r))
        return np.where(right, slope, -slope), bend

    def _half_line(self, s: Array) -> tuple[Array, Array]:
        """First and second derivative at s = |r|."""
        return self._half(s, 1), self._half(s, 2)


def _along(right: BoolArray, r: Array) -> Array:
    """How far r lies from zero on the right or left side."""
    return np.maximum(np.where(right, r, np.negative(r)), 0.0)


@dataclass(frozen=True, eq=False)
class ExponentialWeakening(_EvenLaw):
    """j(r) = kinetic |r| + (static - kinetic)/rate (1 - exp(-rate |r|)): friction falls from static to kinetic.

    alpha = rate (static - kinetic). The survey's family 0.7 r - 0.3 exp(-r) has static 1, kinetic 0.7, rate 1.
    """

    static: Parameter = field(metadata=parameter("factor of the bound at rest", "1", least=0.0))
    kinetic: Parameter = field(metadata=parameter("factor of the bound after much slip", "1", least=0.0))
    rate: Parameter = field(metadata=positive("how fast it falls", "1/length"))
    name: ClassVar[str] = "slip-weakening"  # type: ignore[misc]

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

    @cached_property
    def laid_out(self) -> LaidOut | None:  # type: ignore[override]
        """As the compiled kernels read it, see there."""
        static, kinetic, rate = self._resolved
        return lay_out(self, (2, columns(static - kinetic, kinetic, rate)))

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

    scale: Parameter = field(metadata=positive("slip at which it has fallen to one half", LENGTH))
    name: ClassVar[str] = "logarithmic"  # type: ignore[misc]

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

    def _half_line(self, s: Array) -> tuple[Array, Array]:
        whole = self._resolved + s
        return np.asarray(1.0 / whole), np.asarray(-1.0 / (whole * whole))

    @cached_property
    def laid_out(self) -> LaidOut | None:  # type: ignore[override]
        """As the compiled kernels read it, see there."""
        return lay_out(self, (1, columns(self._resolved)))

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

    slip: Parameter = field(metadata=positive("at which the friction drops", LENGTH, 0.1))
    static: Parameter = field(metadata=parameter("factor of the bound up to this slip", "1", least=0.0))
    kinetic: Parameter = field(metadata=parameter("factor of the bound beyond it", "1", least=0.0))
    name: ClassVar[str] = "static-kinetic"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        slip, static, kinetic = values["slip"], values["static"], values["kinetic"]
        change = kinetic - static
        return PiecewiseQuadratic(
            columns(-slip, 0.0 * slip, slip),
            np.zeros((1, 4)),
            columns(change, 2.0 * static, change),
            start=np.broadcast_arrays(-kinetic, change, slip)[0].copy(),
            name=self.name,
        )
