"""Friction laws h_tau j_tau(|u_tau|), radial in the slip vector: Tresca, Coulomb and slip-dependent ones."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Self
from weakref import WeakSet

import numpy as np

from hemivar.basics.arguments import described, quoted
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.laws.consistency import check_own
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.friction.profiles import ABSOLUTE_VALUE
from hemivar.laws.parameters import evaluate
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import PiecewiseLaw
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed.algebra import affine, homogeneous
from hemivar.laws.transformed.transformed_law import as_examined

__all__ = ["Friction", "OrthotropicFriction", "SlipMeasure", "friction_in_increments"]

#: Knots of a profile next to which it is tried out, evenly chosen among more: they take 1 ms of an AMD EPYC.
_MOST_KNOTS = 2000
#: Contact points at which a profile that differs from one to the next is tried out.
_MOST_ROWS = 20


class SlipMeasure(StrEnum):
    """What friction is a law of in time."""

    SLIP = "slip"
    """The slip itself, as in statics: at each time the static law, which dissipates nothing by itself."""
    RATE = "rate"
    """Its rate."""


@dataclass(frozen=True, eq=False)
class Friction(PickleMixin):
    """Friction h_tau j_tau(|u_tau|).

    Parameters
    ----------
    bound : Parameter or StateBound
        Friction bound h_tau >= 0 (force per area), or one that depends on penetration or pressure.
    profile : Superpotential
        Even scalar law j_tau, extended to the whole line by j_tau(-r) = j_tau(r); j_tau' >= 0 for r > 0.
    of : "slip" or "rate", optional
        What it is a law of in time; statics knows the slip only. Friction that sees no length, such as Tresca's and
        Coulomb's, is one of the rate by default; any other has no default there.

    Raises
    ------
    ProblemError
        If ``of`` is neither, or the profile is not even, or negative somewhere (as far as samples at and between its
        knots tell).
    """

    bound: Parameter | StateBound
    profile: Superpotential = ABSOLUTE_VALUE
    of: SlipMeasure | str | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if isinstance(self.bound, str):
            object.__setattr__(self, "bound", Formula(self.bound, f"bound of friction law '{self.name}'"))
        if not isinstance(self.profile, Superpotential):
            raise ProblemError(f"the profile of a friction law must be a superpotential, not {quoted(self.profile)}")
        if self.of is not None:
            if not isinstance(self.of, str) or self.of not in tuple(SlipMeasure):
                raise ProblemError(f"of = {described(self.of)} of friction law '{self.name}'; give 'slip' or 'rate'")
            object.__setattr__(self, "of", SlipMeasure(self.of))
        check_own(self.profile)
        _check_profile(self.profile)

    def _stated(self) -> dict[str, object]:
        state = super()._stated()
        if self.profile is ABSOLUTE_VALUE:  # the same object wherever the law arrives
            state.pop("profile", None)  # a kind with this profile alone has no attribute of that name
        return state

    def __setstate__(self, state: dict[str, object]) -> None:
        super().__setstate__({"profile": ABSOLUTE_VALUE, "of": None} | state)

    @property
    def name(self) -> str:
        """Name used in messages and tables."""
        return "tresca" if self.profile is ABSOLUTE_VALUE else self.profile.name

    def at(self, points: Array | None) -> Self:
        """The law with bound and profile evaluated at ``points (m, d)``."""
        bound: Array | StateBound
        if isinstance(self.bound, StateBound):
            bound = self.bound.at(points)
        else:
            bound = evaluate(self.bound, points, f"bound of friction law '{self.name}'", 0.0)
        return replace(self, bound=bound, profile=self.profile.at(points))

    @property
    def acts(self) -> bool:
        """Whether there is friction: a bound that is not the number zero, or zeros alone."""
        return not isinstance(self.bound, int | float | np.ndarray) or bool(np.any(self.bound))

    @cached_property
    def state_dependent(self) -> bool:
        """Whether the bound depends on penetration or pressure."""
        return isinstance(self.bound, StateBound)

    @property
    def straight_bound(self) -> bool:
        """Whether the bound is linear in the penetration between its kinks."""
        return not isinstance(self.bound, StateBound) or self.bound.straight

    def frozen(self, penetration: Array, pressure: Array) -> Self:
        """The law with the bound it has in a state, arrays (m,)."""
        if not isinstance(self.bound, StateBound):
            return self
        return replace(self, bound=self.bound.value(penetration, pressure))

    def take(self, index: IntArray) -> Self:
        """The law, with resolved parameters, at some of the contact points."""
        bound: Array | StateBound
        if isinstance(self.bound, StateBound):
            bound = self.bound.take(index)
        else:
            bound = self.bounds if self.bounds.size == 1 else self.bounds[index]
        return replace(self, bound=bound, profile=self.profile.take(index))

    @cached_property
    def bounds(self) -> Array:
        """Values of the friction bound, shape (1,) or (m,), for resolved parameters.

        Raises
        ------
        ProblemError
            If the bound depends on the state.
        """
        if isinstance(self.bound, StateBound):
            raise ProblemError(
                f"the bound of friction law '{self.name}' depends on penetration or pressure: evaluate the law at a "
                f"state first, law.frozen(r, lam)"
            )
        return evaluate(self.bound, None, f"bound of friction law '{self.name}'", 0.0)

    @cached_property
    def radial(self) -> Superpotential:
        """The even scalar law h_tau j_tau, for resolved parameters."""
        return self.profile.scaled(self.bounds)


def friction_in_increments(friction: Friction, rate: float) -> Friction:
    """Friction that is a law of the slip rate, as a law of the slip increment d of a step: ``h j_tau(a |d|)/a``.

    A profile that is a multiple of the size of the slip, as Tresca's and Coulomb's, sees no rate and stays what it is;
    else alpha is ``rate`` times that of the law.

    Parameters
    ----------
    friction : Friction
        With resolved parameters; its bound may depend on the state. A law of the slip stays what it is.
    rate : float
        a > 0, the factor of the increment in the slip rate: 1/tau for implicit Euler.

    Returns
    -------
    Friction
    """
    if friction.of is SlipMeasure.SLIP or homogeneous(friction.profile):
        return friction
    return replace(friction, profile=as_examined(affine(friction.profile, rate)))


#: Profiles that have been looked at; most calls build a law anew from one of them.
_CHECKED: WeakSet[Superpotential] = WeakSet()


def _check_profile(profile: Superpotential) -> None:
    """Refuse a profile that is not even, or is friction in the direction of the slip, at some sample."""
    try:
        if profile is ABSOLUTE_VALUE or profile.examined or profile in _CHECKED:
            return
    except TypeError:  # a class of the user's that cannot be hashed is looked at again
        pass
    if isinstance(profile, PiecewiseLaw) and profile.apart:
        for part, _ in profile.parts:
            _check_profile(part)
        return
    try:
        rows = profile.knots.shape[0]
    except ProblemError:  # its parameters are functions of the place: looked at when they are evaluated
        return
    for row in range(min(rows, _MOST_ROWS)):
        _check_one(profile.take(np.array([row])) if rows > 1 else profile)
    with contextlib.suppress(TypeError):
        _CHECKED.add(profile)


def _check_one(profile: Superpotential) -> None:
    """The same for the profile of one contact point."""
    law, knots = profile, profile.knots[0]
    largest = float(np.abs(knots[np.isfinite(knots)]).max(initial=0.0))
    size = 2.0 * largest if largest > 0.0 else 1.0
    positive = knots[(knots > 0.0) & np.isfinite(knots)]
    if positive.size > _MOST_KNOTS:
        positive = positive[np.linspace(0, positive.size - 1, _MOST_KNOTS).astype(np.int64)]
    ends = np.concatenate([[0.0], positive, [size, 10.0 * size, 1e3 * size]])
    step = 1e-9 * size
    s = np.concatenate([ends[1:] - step, ends[:-1] + step, 0.5 * (ends[1:] + ends[:-1])])
    s = s[s > 0.0]
    with np.errstate(all="ignore"):
        forward, backward = law.derivative(s), law.derivative(-s)
        inside = (s <= law.domain.upper) & (-s >= law.domain.lower)
    if float(law.domain.upper.ravel()[0]) != -float(law.domain.lower.ravel()[0]):
        raise ProblemError(f"law '{profile.name}' ends on one side; a friction law must be even")
    scale = float(np.abs(forward[inside & np.isfinite(forward)]).max(initial=0.0))
    uneven = inside & ~(np.abs(forward + backward) <= 1e-6 * (np.abs(forward) + 1e-3 * scale))
    if uneven.any():
        i = int(np.argmax(uneven))
        raise ProblemError(
            f"law '{profile.name}' is not even: its derivative is {forward[i]:.6g} at r = {s[i]:.6g} and "
            f"{backward[i]:.6g} at r = {-s[i]:.6g}; give the friction for r >= 0, with even=True"
        )
    if isinstance(profile, PiecewiseQuadratic):  # tables are looked at where they are read; others are meant so
        return
    negative = inside & (forward < -1e-9 * scale)
    if negative.any():
        i = int(np.argmax(np.where(negative, -s, -np.inf)))
        raise ProblemError(
            f"law '{profile.name}' is negative friction, {forward[i]:.6g} at the slip r = {s[i]:.6g}; it must be "
            f"at least 0 to oppose the slip"
        )


@dataclass(frozen=True, eq=False)
class OrthotropicFriction(Friction):
    """Friction at most ``bound`` along an axis of the surface and ``ratio * bound`` across it, in space.

    ``j_tau(s) = bound sqrt(s_1^2 + ratio^2 s_2^2)`` with the slip s_1 along the axis and s_2 across it: the friction
    lies in an ellipse, and slip is normal to it (associated).

    Parameters
    ----------
    bound : Parameter or StateBound
        Friction bound along the axis, >= 0 (force per area); ``CoulombBound(mu)`` for Coulomb's law.
    ratio : Parameter
        Bound across the axis over that along it, > 0.
    axis : sequence of float, shape (3,)
        A direction; its projection on the surface is the axis.

    Raises
    ------
    ProblemError
        The axis is no direction, or the ratio is not positive.
    """

    profile: Superpotential = field(default=ABSOLUTE_VALUE, init=False)
    ratio: Parameter = 1.0
    axis: Sequence[float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        axis = real_array(self.axis, "axis of the orthotropic friction", 1)
        if axis.shape != (3,) or not np.abs(axis).max() > 0.0:
            raise ProblemError(
                f"axis of the orthotropic friction is {axis.tolist()}; give a direction in 3D, such as (1, 0, 0)"
            )
        object.__setattr__(self, "axis", tuple(axis.tolist()))
        if not callable(self.ratio):
            self._ratio_at(None)

    def _ratio_at(self, points: Array | None) -> Array:
        ratio = evaluate(self.ratio, points, "ratio of the orthotropic friction")
        if (ratio <= 0.0).any():
            raise ProblemError(
                f"ratio of the orthotropic friction is {ratio.min():g}; it must be positive: the bound across the axis "
                "over that along it"
            )
        return ratio

    @property
    def name(self) -> str:
        return "orthotropic"

    @property
    def stated(self) -> Mapping[str, object]:
        """The law by its name and parameters, the bound apart, as problem files have it."""
        return {"law": self.name, "ratio": self.ratio, "axis": self.axis}

    @property
    def ratios(self) -> Array:
        """Values of the ratio, (m or 1,), for resolved parameters."""
        return self._ratio_at(None)

    def at(self, points: Array | None) -> Self:
        return replace(self, bound=Friction(self.bound).at(points).bound, ratio=self._ratio_at(points))

    def take(self, index: IntArray) -> Self:
        ratio = self.ratios
        bound = Friction(self.bound).take(index).bound
        return replace(self, bound=bound, ratio=ratio if ratio.size == 1 else ratio[index])
