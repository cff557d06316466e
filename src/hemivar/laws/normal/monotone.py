"""Monotone normal laws: springs and power laws (normal compliance), and the rigid foundation (Signorini)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray, Parameter
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LENGTH, PRESSURE, RATE, parameter, positive
from hemivar.laws.parametrised import NamedLaw, ParameterLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["Bilateral", "Compliance", "FinitePenetration", "NoContact", "Signorini", "ThresholdCompliance", "Tie"]

#: One knot at zero without a jump, and two pieces without a slope.
_ZERO = np.zeros((1, 1))
_FLAT = np.zeros((1, 2))


@named(
    LawKind.NORMAL,
    "survey",
    "rigid up to the pressure q_max, beyond it linearly compliant with stiffness p_const",
    "j(r) = 0 for r < 0, q_max r + p_const r^2/2 for r >= 0",
)
@dataclass(frozen=True, eq=False)
class ThresholdCompliance(NamedLaw):
    """The survey's normal law: j(r) = 0 for r < 0, p_const/2 r^2 + q_max r for r >= 0 (section 5.1).

    Rigid up to the pressure ``q_max``, beyond it linearly compliant with stiffness ``p_const``.

    Parameters
    ----------
    q_max : Parameter
        Threshold pressure, >= 0 (force per area).
    p_const : Parameter
        Stiffness beyond it, >= 0 (force per area and length).

    Examples
    --------
    >>> import hemivar as hv
    >>> law = hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0)
    >>> law.subdifferential(0.0)
    Interval(lower=array([0.]), upper=array([0.3]))
    """

    q_max: Parameter = field(metadata=parameter("threshold pressure", PRESSURE, least=0.0))
    p_const: Parameter = field(default=0.0, metadata=parameter("stiffness beyond it", RATE, least=0.0))
    name: ClassVar[str] = "survey"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        q, p = np.broadcast_arrays(values["q_max"], values["p_const"])
        return PiecewiseQuadratic(
            np.zeros((1, 1)), np.stack([np.zeros_like(p), p], axis=-1), q[:, None].copy(), name=self.name
        )


@named(
    LawKind.NORMAL,
    "signorini",
    "rigid foundation: no penetration, no tension",
    "j(r) = 0 for r <= 0, +inf for r > 0",
)
@dataclass(frozen=True, eq=False)
class Signorini(NamedLaw):
    """Rigid foundation: j(r) = 0 for r <= 0, +inf for r > 0 (unilateral contact, no penalty).

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.Signorini().subdifferential(0.0)
    Interval(lower=array([0.]), upper=array([inf]))
    """

    name: ClassVar[str] = "signorini"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        return PiecewiseQuadratic(_ZERO, _FLAT, _ZERO, upper=0.0, name=self.name)


@named(
    LawKind.NORMAL,
    "bilateral",
    "neither separation nor penetration, with any pressure or tension",
    "j(r) = 0 for r = 0, +inf otherwise",
)
@dataclass(frozen=True, eq=False)
class Bilateral(NamedLaw):
    """No separation and no penetration: r = 0, with any pressure."""

    name: ClassVar[str] = "bilateral"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        return PiecewiseQuadratic(_ZERO, _FLAT, _ZERO, lower=0.0, upper=0.0, name=self.name)


@dataclass(frozen=True, eq=False)
class Tie(Bilateral):
    """Two bodies are joined for good: no jump between them in any direction, whatever gap their meshes leave.

    It is no law of contact points: the displacement of one side follows that of the other one.

    >>> import hemivar as hv
    >>> joint = hv.Contact(hv.laws.Tie(), against="lower:top")
    """

    name: ClassVar[str] = "tie"  # type: ignore[misc]


@named(
    LawKind.NORMAL,
    "none",
    "no foundation in the normal direction",
    "j(r) = 0",
)
@dataclass(frozen=True, eq=False)
class NoContact(NamedLaw):
    """No foundation at all: j = 0."""

    name: ClassVar[str] = "none"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        return PiecewiseQuadratic(_ZERO, _FLAT, _ZERO, name=self.name)


@named(
    LawKind.NORMAL,
    "compliance",
    "springs that push only: pressure stiffness * r^exponent for penetration r > 0",
    "j(r) = stiffness/(exponent + 1) max(r, 0)^(exponent + 1)",
)
@dataclass(frozen=True, eq=False)
class Compliance(ParameterLaw):
    """Normal compliance: pressure ``stiffness * r^exponent`` for penetration r > 0, none for r <= 0.

    Parameters
    ----------
    stiffness : Parameter
        Factor >= 0 (force per area and length^exponent).
    exponent : Parameter
        Exponent >= 1; 1 is the linear spring foundation.

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.Compliance(20.0, 2.0).derivative([-0.1, 0.1])
    array([0. , 0.2])
    """

    stiffness: Parameter = field(
        metadata=parameter("pressure at unit penetration", "force/area/length^exponent", least=0.0)
    )
    exponent: Parameter = field(default=1.0, metadata=parameter("power of the penetration", "1", least=1.0))
    name: ClassVar[str] = "compliance"  # type: ignore[misc]

    @cached_property
    def _resolved(self) -> tuple[Array, Array]:
        values = self._values(None)
        c, p = np.broadcast_arrays(values["stiffness"], values["exponent"])
        return c, p

    @property
    def knots(self) -> Array:
        return np.zeros((self._resolved[0].size, 1))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        c, p = self._resolved
        return np.where(piece > 0, c / (p + 1.0) * np.maximum(r, 0.0) ** (p + 1.0), 0.0)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        c, p = self._resolved
        return np.where(piece > 0, c * np.maximum(r, 0.0) ** p, 0.0)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        c, p = self._resolved
        return np.where(piece > 0, c * p * np.maximum(r, 0.0) ** (p - 1.0), 0.0)

    @cached_property
    def straight(self) -> bool:  # type: ignore[override]
        """Whether it is a spring."""
        return bool((self._resolved[1] == 1.0).all())

    @property
    def weak_convexity(self) -> Array:
        return np.zeros(self._resolved[0].shape)

    @property
    def growth(self) -> tuple[Array, Array]:
        c, p = self._resolved
        linear = (p == 1.0) | (c == 0.0)
        return np.where(linear, 0.0, np.inf), np.where(linear, c, np.inf)

    def recession(self, sign: Array) -> Array:
        c, _ = self._resolved
        return np.where((np.asarray(sign) > 0) & (c > 0.0), np.inf, 0.0)

    def asymptotic_curvature(self, sign: float) -> Array:
        c, p = self._resolved
        if sign < 0.0:
            return np.zeros(c.shape)
        return np.where(c == 0.0, 0.0, np.where(p > 1.0, np.inf, c))

    def piece_formula(self, piece: int) -> str:
        c, p = (float(x[0]) for x in self._resolved)
        return "0" if piece == 0 else f"{c:.6g} r" + (f"^{p:.6g}" if p != 1.0 else "")

    def scaled(self, factor: Array | float) -> Compliance:
        c, p = self._resolved
        return Compliance(np.atleast_1d(factor) * c, p)


@named(
    LawKind.NORMAL,
    "finite-penetration",
    "springs that push, and turn rigid at the penetration limit",
    "j(r) = stiffness/2 max(r, 0)^2 for r <= limit, +inf beyond",
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

    stiffness: Parameter = field(metadata=parameter("of the springs", RATE, 2.0, least=0.0))
    limit: Parameter = field(metadata=positive("largest penetration", LENGTH, 0.1))
    name: ClassVar[str] = "finite-penetration"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit = np.broadcast_arrays(values["stiffness"], values["limit"])
        zero = np.zeros(1)
        return PiecewiseQuadratic(
            columns(zero, limit), columns(zero, k, zero), np.zeros((1, 2)), upper=limit, name=self.name
        )
