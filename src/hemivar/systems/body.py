"""The full system that multigrid works on: all unknowns of a body with the levels below, on one machine or on many."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.residual import LoadScale, resting_multiplier
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import at_normal_kink
from hemivar.linear.vectors import Vectors
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_stiffness import ContactStiffness
from hemivar.systems.contact_system import OfUnknowns
from hemivar.systems.newton_equation import NewtonEquation

__all__ = ["Body", "Truncation"]


class Truncation(Protocol):
    """Newton's matrix of a body, unknowns at kinks left out, and a cycle for it; it belongs to one solve."""

    @property
    def diagonal(self) -> Array:
        """Diagonal of the stiffness, what curvature is compared with, (n,)."""

    def change(self, x: Array, held: BoolArray, curvature: Array) -> None:
        """Become Newton's matrix at another place.

        ``x (n,)``: the place; ``held (k,)``: active components that keep their value; ``curvature (m, d, d)``: second
        derivatives of the laws, weights included; zero where held.
        """

    def __matmul__(self, vector: Array, /) -> Array:
        """The matrix times a vector (n,) that is zero where held; entries there mean nothing."""

    def cycle(self, right: Array) -> Array:
        """About the inverse times a vector that is zero where held; so is the answer."""

    def preconditioner(self) -> tuple[bool, Callable[[Array], Array]]:
        """The cycle for one run of conjugate gradients, and whether it may change a little on the way."""

    def release(self) -> None:
        """Give its memory back."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Body(OfUnknowns, ABC):
    """Energy of all unknowns, points (n,), as a :class:`ContactSystem`; arrays are those of this process."""

    vectors: Vectors  # how the parts of all processes are looked at together
    elastic: ContactStiffness  # what the body knows of its stiffness, whatever its load, gap and law
    law: VectorLaw
    weights: Array  # (m,)
    offset: Array  # (m, d): gap, and what stands beside it in the tangential components
    unknown: IntArray  # (k,): the unknown behind each active component
    sign: Array  # (k,): its sign in the local displacement
    active: BoolArray  # (m, d): components that are free to move
    load: Array  # (n,)
    row_sums: Array  # (n,): sums of the absolute entries of the rows of K
    constant: float  # energy that does not depend on the unknowns
    compliance: Array  # (m, 2): displacement for a unit pressure at a point when all else is held
    seconds: float = 0.0  # spent on setting up
    below: Self | None = None  # the same on the next coarser mesh, where a problem is posed there
    # whether what lies below is the body on some of its nodes, there being no coarser mesh
    thins: bool = False

    # ---- what an engine supplies -------------------------------------------------------------------------

    @abstractmethod
    def truncation(self) -> Truncation:
        """Newton's matrix, to be changed by one solve."""

    def coarse_system(self) -> Self | None:
        return self.below

    def untouched(self) -> Array | None:
        """About the unknowns (n,) of the body under its load alone, without contact; None where that is not cheap."""
        return None

    @property
    def carried(self) -> Array | None:
        """Unknowns (n,) of prescribed displacements carried into the body as a coarser one does; None for none."""
        return None

    def beyond(self, x: Array) -> Self:
        """The same problem for what is added to unknowns (n,)."""
        raise NotImplementedError

    def condensed(self) -> CondensedProblem | None:
        """The same problem condensed onto its contact points, where that costs less than steps on levels."""
        return None

    @abstractmethod
    def from_below(self, x: Array) -> Array:
        """Unknowns (n,) of the displacement field given by those of the next coarser mesh."""

    def refuse_direction(self, direction: Array) -> None:
        """Raise ProblemError if a direction without curvature shows that the stiffness itself is indefinite."""

    # ---- the contact points ------------------------------------------------------------------------------

    @cached_property
    def fixed(self) -> Array:
        return np.where(self.active, 0.0, -self.offset)

    @property
    def own_block(self) -> sp.csr_array:
        """See :attr:`ContactStiffness.own_block`."""
        return self.elastic.own_block

    @property
    def stiffness(self) -> Array:
        """See :attr:`ContactStiffness.stiffness`."""
        return self.elastic.stiffness

    @property
    def diagonal(self) -> Array:
        return self.elastic.diagonal

    @property
    def lambda_max(self) -> float:
        return self.elastic.lambda_max

    def multiply(self, x: Array) -> Array:
        return self.elastic.multiply(x)

    def pull(self, x: Array) -> Array:
        """``K x`` at the contact unknowns, (k,)."""
        return self.elastic.pull(x)

    def push(self, values: Array) -> Array:
        """``K x``, (n,), of a vector with these values (k,) at the contact unknowns and zeros elsewhere."""
        return self.elastic.push(values)

    def couple(self, step: Array) -> Array:
        return self.elastic.couple(step)

    def spread(self, values: Array) -> Array:
        """See :meth:`ContactStiffness.spread`."""
        return self.elastic.spread(values)

    def gather(self, values: Array) -> Array:
        """See :meth:`ContactStiffness.gather`."""
        return self.elastic.gather(values)

    @property
    def blocks(self) -> Array:
        return self.elastic.blocks

    def local(self, x: Array) -> Array:
        r = self.fixed.copy()
        r[self.active] = self.sign * x[self.unknown] - self.offset[self.active]
        return r

    def moved(self, x: Array, r: Array) -> Array:
        out = x.copy()
        out[self.unknown] = self.sign * (r + self.offset)[self.active]
        # Far from the foundation r is the gap, and has the digits of u no more: what differs by rounding stays.
        size = float(self.vectors.largest(np.abs(r + self.offset)[self.active].max(initial=0.0))[0])
        far = np.abs(self.offset) > size
        if far.any():
            now = self.local(x)
            same = far & (np.abs(r - now) <= 4.0 * np.finfo(float).eps * np.abs(self.offset))
            same[:, 0] &= ~at_normal_kink(self.law, r)
            kept = self.unknown[same[self.active]]
            out[kept] = x[kept]
        return out

    # ---- the protocol of systems -----------------------------------------------------------------------

    def start(self, guess: Array | None = None) -> Array:
        x = np.zeros(self.load.shape) if guess is None else np.array(guess, dtype=float)
        return self.moved(x, self.law.admissible(self.local(x)))

    @abstractmethod
    def newton_equation(self, known: NewtonEquation | None = None) -> NewtonEquation:
        """As of every system."""

    @abstractmethod
    def with_law(self, law: VectorLaw) -> Self:
        """The same body on another foundation, no problem being posed below."""

    def out_of_balance(self, x: Array) -> Array:
        return np.asarray(self.load - self.multiply(x))

    def at_contact(self, force: Array) -> Array:
        return self.spread(force[self.unknown])

    def multiply_contact(self, change: Array) -> Array:
        return self.push(change[self.unknown])

    def refreshed(self, x: Array, force: Array) -> Array:
        """As it is known: a product with the stiffness costs more than its last digits."""
        return force

    def less_contact(self, force: Array, contact: Array) -> Array:
        left = force.copy()
        left[self.unknown] -= self.gather(contact)
        return left

    def rounding_sizes(self, x: Array) -> Array:
        return np.asarray(self.row_sums * np.abs(x) + np.abs(self.load))

    def magnitude(self, x: Array) -> float:
        moved = np.abs(x[self.unknown]).max(initial=0.0)
        return float(max(moved, np.abs(self.offset).max(initial=0.0)))

    def stretch(self, change: Array) -> float:
        (square,) = self.vectors.total(float(change @ self.multiply(change)))
        return float(np.sqrt(max(square, 0.0)))

    @cached_property
    def load_scale(self) -> LoadScale:
        lam = resting_multiplier(self.law, self.offset, self.compliance)
        with np.errstate(all="ignore"):
            rest = np.where(self.active, self.weights[:, None] * lam, 0.0).ravel()
            load, size = self.vectors.norms(self.load, rest).tolist()
        return LoadScale(load, size if math.isfinite(size) else math.inf)
