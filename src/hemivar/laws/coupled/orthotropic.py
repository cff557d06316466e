"""A normal law with orthotropic friction, by the direction of the slip: an ellipse in place of a disc.

With D symmetric, ``j_tau(s) = |D s|``, whose subdifferential at 0 is the ellipse ``E = {D z: |z| <= 1}``.  A local
problem ``min a/2 |s|^2 - b.s + |D s|`` has the solution ``s = (b - P_E(b))/a`` with the projection on E: in the axes of
the ellipse ``P_E(b)_i = b_i f_i^2/(f_i^2 + theta)`` with ``theta > 0`` so that ``sum (b_i f_i/(f_i^2 + theta))^2 = 1``,
by Newton's method on the inverse of the root of that sum, which is concave: its iterates from 0 rise to the zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hemivar.basics.arrays import COUNTS
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.contact_law import ContactLaw, separable
from hemivar.laws.crossings import length_places
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.friction.friction_law import Friction, OrthotropicFriction
from hemivar.laws.friction.profiles import ABSOLUTE_VALUE
from hemivar.laws.normal_and_friction import NormalAndFriction
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_law import Linearisation, Sides, VectorLaw, lengths

__all__ = ["OrthotropicLaw", "bounded"]

#: The first tangential component.
_FIRST = np.array([[1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class OrthotropicLaw(NormalAndFriction):
    """``j(r) = j_nu(r_nu) + h sqrt(s_1^2 + ratio^2 s_2^2)`` in space: slip s_1 along an axis and s_2 across it.

    Parameters
    ----------
    normal : Superpotential
    friction : OrthotropicFriction
    heading : array (m or 1, 2)
        The axis in the tangential components of the contact points, a unit vector; by default the first one.
        Problems of bodies set it by the axis of the friction.
    """

    normal: Superpotential
    friction: OrthotropicFriction
    heading: Array | None = None

    def __post_init__(self) -> None:
        _ = self._plain

    @property
    def tangential_name(self) -> str:
        return self.friction.name

    @property
    def not_separable(self) -> str:
        return "orthotropic friction depends on the direction of the slip"

    @cached_property
    def _plain(self) -> ContactLaw:
        """The normal law alone."""
        return ContactLaw(self.normal)

    def in_frames(self, frames: Array) -> OrthotropicLaw:
        along = np.einsum("mtd,d->mt", frames[:, 1:], self.friction.axis) if frames.shape[2] == 3 else np.zeros((1, 2))
        if frames.shape[2] != 3:
            raise ProblemError("orthotropic friction needs a surface, and the mesh is plane; take Tresca or Coulomb")
        size = lengths(along)
        if (size <= COUNTS * float(np.linalg.norm(self.friction.axis))).any():
            raise ProblemError(
                f"the axis {list(self.friction.axis)} of the orthotropic friction is normal to the surface at a "
                "contact point; give a direction along it"
            )
        return replace(self, heading=along / size[:, None])

    def take(self, index: IntArray) -> Self:
        heading = self.heading if self.heading is None or len(self.heading) == 1 else self.heading[index]
        return replace(super().take(index), heading=heading)

    @staticmethod
    def concatenate(laws: Sequence[tuple[VectorLaw, int]]) -> OrthotropicLaw | None:
        """One law for consecutive blocks of contact points; None where some law is of another kind.

        A disc is an ellipse: friction that has no direction may stand beside one that has, if its bound does not depend
        on the slip.
        """
        parts = [(law, count) for law, count in laws if isinstance(law, ContactLaw | OrthotropicLaw)]
        if len(parts) < len(laws) or any(law.friction.profile is not ABSOLUTE_VALUE for law, _ in parts):
            return None
        plain = ContactLaw.concatenate([(ContactLaw(law.normal, Friction(law.friction.bound)), n) for law, n in parts])
        directed = [
            (law.friction.ratios, law._heading) if isinstance(law, OrthotropicLaw) else None for law, _ in parts
        ]
        ratios, headings = zip(*(pair or (np.ones(1), _FIRST) for pair in directed), strict=True)
        counts = [count for _, count in parts]
        stacked = [
            np.concatenate([np.broadcast_to(v, (n, *v.shape[1:])) for v, n in zip(values, counts, strict=True)])
            for values in (ratios, headings)
        ]
        return OrthotropicLaw(plain.normal, OrthotropicFriction(plain.friction.bound, ratio=stacked[0]), stacked[1])

    # ---- the bound ---------------------------------------------------------------------------------------

    @property
    def lipschitz(self) -> Array:
        """Of the larger of both bounds."""
        return super().lipschitz * np.maximum(self.friction.ratios, 1.0)

    # ---- the ellipse -------------------------------------------------------------------------------------

    @cached_property
    def _axes(self) -> Array:
        """Half axes of the ellipse, (m or 1, 2)."""
        return np.stack(np.broadcast_arrays(self.friction.bounds, self.friction.bounds * self.friction.ratios), axis=1)

    @property
    def _heading(self) -> Array:
        return _FIRST if self.heading is None else self.heading

    @cached_property
    def _frame(self) -> Array:
        """Unit vectors (m or 1, 2, 2) along and across the axis."""
        along = self._heading
        return np.stack([along, np.stack([-along[:, 1], along[:, 0]], axis=1)], axis=1)

    @cached_property
    def _square(self) -> Array:
        """D^2, (m or 1, 2, 2) in tangential components."""
        return np.asarray(np.einsum("mki,mk,mkj->mij", self._frame, self._axes**2, self._frame))

    def _size(self, s: Array) -> Array:
        """|D s|, (m,)."""
        return lengths(self._axes * _turned(self._frame, s))

    def project(self, z: Array) -> Array:
        """The nearest friction (m, 2) in the ellipse."""
        own, half = _turned(self._frame, z), np.broadcast_to(self._axes, z.shape)
        largest = half.max(axis=1, keepdims=True)
        scale = np.where(largest > 0.0, largest, 1.0)
        x, f = own / scale, half / scale  # half axes of order 1
        theta = np.zeros((len(z), 1))
        outside = (largest[:, 0] > 0.0) & (lengths(x / np.where(f > 0.0, f, 1.0)) > 1.0)
        for _ in range(60):
            part = x * f / np.where(outside[:, None], f**2 + theta, 1.0)
            size = np.maximum(lengths(part), np.finfo(float).tiny)[:, None]
            slope = ((part / size) ** 2 / np.where(outside[:, None], f**2 + theta, 1.0)).sum(
                axis=1, keepdims=True
            ) / size
            step = np.where(
                outside[:, None], np.maximum(1.0 - 1.0 / size, 0.0) / np.where(slope > 0.0, slope, 1.0), 0.0
            )
            theta = theta + step
            if (step <= 4.0 * np.finfo(float).eps * theta).all():
                break
        moved = np.where(outside[:, None], x * f**2 / np.where(outside[:, None], f**2 + theta, 1.0), x)
        return _turned(self._frame.swapaxes(1, 2), np.where(largest > 0.0, moved * scale, 0.0))

    def slide(self, s: Array) -> Array:
        """Friction law's derivative ``D^2 s/|D s|`` (m, 2); zero where nothing slips or rubs."""
        size = self._size(s)
        force = np.einsum("mij,mj->mi", np.broadcast_to(self._square, (len(s), 2, 2)), s)
        return np.asarray(force / np.where(size > 0.0, size, 1.0)[:, None])

    # ---- value and subdifferential -----------------------------------------------------------------------

    def value(self, r: Array) -> Array:
        if r.shape[1] != 3:
            raise ProblemError(
                f"orthotropic friction needs two tangential components, and there are {r.shape[1] - 1}; give a "
                f"body in 3D"
            )
        return self._plain.value(r[:, :1]) + self._size(r[:, 1:])

    def _rest_distance(self, lam: Array) -> Array:
        return lengths(lam[:, 1:] - self.project(lam[:, 1:]))

    def _tangential_distance(self, r: Array, lam: Array) -> Array:
        moving = lengths(lam[:, 1:] - self.slide(r[:, 1:]))
        return np.where(r[:, 1:].any(axis=1), moving, self._rest_distance(lam))

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        normal = self._plain.graph_distance(r[:, :1], lam[:, :1], tau)
        resting = np.hypot(lengths(r[:, 1:]) / tau[:, 1], self._rest_distance(lam))
        return np.hypot(normal, np.minimum(self._tangential_distance(r, lam), resting))

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        normal = super().kinks_along(start, end, bend)
        return np.concatenate([normal, length_places(np.zeros((1, 1)), start[:, 1:], end[:, 1:])], axis=1)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        moves, normal = r[:, 1:].any(axis=1, keepdims=True), self._plain.nearest_multiplier(r[:, :1], lam[:, :1])
        along = np.where(moves, self.slide(r[:, 1:]), self.project(lam[:, 1:]))
        return np.concatenate([normal, along], axis=1)

    def clamp(self, start: Array, end: Array) -> Array:
        backwards = np.einsum("mi,mi->m", start[:, 1:], end[:, 1:]) <= 0.0  # and where nothing slips
        normal = self._plain.clamp(start[:, :1], end[:, :1])
        return np.concatenate([normal, np.where(backwards[:, None], 0.0, end[:, 1:])], axis=1)

    def linearise(self, r: Array) -> Linearisation:
        line = self._plain.linearise(r[:, :1])
        moves = np.asarray(r[:, 1:].any(axis=1))
        gradient, hessian = np.zeros(r.shape), np.zeros((*r.shape, 3))
        gradient[:, 0], hessian[:, 0, 0] = line.gradient[:, 0], line.hessian[:, 0, 0]
        force, size = self.slide(r[:, 1:]), self._size(r[:, 1:])
        gradient[:, 1:] = force
        bend = (self._square - force[:, :, None] * force[:, None, :]) / np.where(size > 0.0, size, 1.0)[:, None, None]
        hessian[:, 1:, 1:] = np.where((size > 0.0)[:, None, None], bend, 0.0)
        return Linearisation(np.stack([line.smooth[:, 0], moves], axis=1), gradient, hessian)

    def local_argmin(self, a: Array, b: Array) -> Array:
        out = np.empty(b.shape)
        out[:, 0] = self.normal.local_argmin(a[:, 0], b[:, 0])
        out[:, 1:] = self._slip(a, b)
        return out

    def _slip(self, a: Array, b: Array) -> Array:
        left = b[:, 1:] - self.project(b[:, 1:])
        left[np.abs(left).max(axis=1) <= 4.0 * np.finfo(float).eps * np.abs(b[:, 1:]).max(axis=1)] = 0.0
        return np.asarray(left / a[:, 1:2])

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        out = np.empty(b.shape)
        out[:, :1] = self._plain.local_minimiser(a, b[:, :1], r[:, :1])
        out[:, 1:] = self._slip(a, b)
        return out

    # ---- far away ----------------------------------------------------------------------------------------

    def recession(self, direction: Array) -> Array:
        rate = self._plain.recession(direction[:, :1])
        return rate if self.state_dependent else rate + self._size(direction[:, 1:])

    @cached_property
    def _most(self) -> Array:
        return np.zeros(1) if self.state_dependent else np.asarray(self._axes.max(axis=1))

    @property
    def growth(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        return self.normal.growth, (np.asarray(self._axes.max(axis=1)), np.zeros(1))

    @property
    def rates(self) -> tuple[Array, Array, Array]:
        up, down, _ = self._plain.rates
        return up, down, self._most

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        up, down, _ = self._plain.strongest(rest[:, :1], size)
        return up, down, np.broadcast_to(self._most, up.shape)

    def rubbed(self, slips: Array, size: float = np.inf) -> Array:
        bound = self.friction.bound
        if not isinstance(bound, StateBound):
            return np.zeros_like(slips)
        axes = np.stack(np.broadcast_arrays(bound.per_pressure, bound.per_pressure * self.friction.ratios), axis=1)
        turned = np.broadcast_to(self._frame, (len(slips), 2, 2)) @ slips
        return np.asarray(axes[:, :, None] * turned)

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self._plain.asymptotic_curvature(sign)[0], np.zeros(1)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return self.normal.weak_convexity, np.zeros(1)

    # ---- where a pair lies -------------------------------------------------------------------------------

    def fitted(self, r: Array, lam: Array, tau: Array) -> Array:
        out = r.copy()
        out[:, :1] = self._plain.fitted(r[:, :1], lam[:, :1], tau)
        resting = np.hypot(lengths(r[:, 1:]) / tau[:, 1], self._rest_distance(lam))
        out[resting <= self._tangential_distance(r, lam), 1:] = 0.0
        return out

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        """At rest by the share of the friction that is used: multipliers fill an ellipse there."""
        resting = active & ~r[:, 1:].any(axis=1, keepdims=True)
        resting[:, 0] = False
        most = np.broadcast_to(self._axes.max(axis=1), (len(r),))
        own = _turned(self._frame, np.where(active[:, 1:], lam[:, 1:], 0.0))
        used = lengths(own / np.where(self._axes > 0.0, self._axes, 1.0)) * most
        rest, column = np.nonzero(resting[:, 1:])
        none = np.zeros(rest.size)
        still = Sides(rest, np.eye(3)[1:][column], used[rest], -most[rest], most[rest], none, none)
        return [*super().sides(r, lam, active & ~resting, tau, slack), still]


def bounded(law: VectorLaw) -> ContactLaw:
    """A law whose friction has a bound that may depend on the state, as one with that bound in all directions.

    Raises
    ------
    MethodError
        It is of another kind.
    """
    if isinstance(law, OrthotropicLaw):
        return ContactLaw(law.normal, Friction(law.friction.bound))
    return separable(law, "a bound that depends on the state")


def _turned(frame: Array, s: Array) -> Array:
    """Components (m, 2) along the rows of a frame (m or 1, 2, 2)."""
    return np.asarray(np.einsum("mki,mi->mk", np.broadcast_to(frame, (len(s), 2, 2)), s))
