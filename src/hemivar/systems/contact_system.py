"""What a method works on: a body with its foundation, condensed onto its contact points or with all unknowns.

A point ``x`` of a system is ``(m, d)``, local displacements, where the body is condensed, and ``(n,)``, all unknowns,
where it is not.  Energy, multiplier and residual of a point are the same formulas for both and stand here once.
"""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.contact_energy import contact_energy, law_forces
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import LoadScale, Residual
from hemivar.laws import VectorLaw
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.systems.newton_equation import NewtonEquation

__all__ = ["ContactSystem", "Equilibrium", "OfProblem", "OfUnknowns", "PointSystem"]


class PointSystem(Protocol):
    """A body with its foundation, as the loop sees it, linear or not; arrays are those of this process."""

    @property
    def vectors(self) -> Vectors:
        """How the parts of all processes are looked at together."""

    @property
    def law(self) -> VectorLaw:
        """The contact law."""

    @property
    def weights(self) -> Array:
        """Quadrature weights (m,)."""

    @property
    def active(self) -> BoolArray:
        """Components (m, d) that are free to move."""

    @property
    def compliance(self) -> Array:
        """Displacement for a unit pressure at a point when its surroundings are held, (m, 2)."""

    @property
    def material_compliance(self) -> Array:
        """The same when all other unknowns are held, (m, 2): by it residuals compare displacement and multiplier."""

    @property
    def load(self) -> Array:
        """Forces on the unknowns of the system, flat."""

    @property
    def constant(self) -> float:
        """Energy that does not depend on the unknowns."""

    @property
    def load_scale(self) -> LoadScale:
        """What residuals are held against."""

    @property
    def seconds(self) -> float:
        """Time spent on setting up."""

    @property
    def extent(self) -> float:
        """Largest extent of the body; infinite where it is not known."""

    def start(self, guess: Array | None = None) -> Array:
        """An admissible point near a guess, or near zero displacement."""

    def of_unknowns(self, unknowns: Array) -> Array:
        """The point of a vector of unknowns (n,)."""

    def local(self, x: Array) -> Array:
        """Local displacements (m, d) of a point."""

    def magnitude(self, x: Array) -> float:
        """Largest displacement or gap of the contact points of this process: what may cancel in :meth:`local`."""

    def out_of_balance(self, x: Array) -> Array:
        """What the body leaves of its load at a point, the foundation apart; of the shape of the point."""

    def at_contact(self, force: Array) -> Array:
        """Forces (m, d) on the contact points of a force of the shape of a point."""

    def less_contact(self, force: Array, contact: Array) -> Array:
        """What is left of a force of the shape of a point where contact points take up theirs, (m, d); flat."""

    def rounding_sizes(self, x: Array) -> Array:
        """Sizes of what is added up in ``f - K x``, flat."""

    def answer_sizes(self, x: Array) -> Array:
        """See :meth:`Equilibrium.answer_sizes`."""

    def stretch(self, change: Array) -> float:
        """Energy norm of a difference of two points."""

    def law_at(self, x: Array, lam: Array | None = None) -> VectorLaw:
        """See :meth:`Equilibrium.law_at`."""

    def energy(self, x: Array, lam: Array | None = None, force: Array | None = None) -> float:
        """See :meth:`Equilibrium.energy`."""

    def multiplier(self, x: Array, force: Array | None = None) -> Array:
        """See :meth:`Equilibrium.multiplier`."""

    def residual(self, x: Array, lam: Array, force: Array | None = None) -> Residual:
        """See :meth:`Equilibrium.residual`."""

    def recover(self, x: Array, *multipliers: Array) -> tuple[Array, list[Residual]]:
        """All unknowns (n,), with the residual of the whole problem for each multiplier; the first one is theirs."""

    def with_law(self, law: VectorLaw) -> Self:
        """The same body on another foundation."""


class ContactSystem(PointSystem, Protocol):
    """A linear body with its foundation, as Newton's method sees it."""

    @property
    def fixed(self) -> Array:
        """Values (m, d) of the components that are not free to move."""

    @property
    def diagonal(self) -> Array:
        """Stiffness of every component, positive, one number for the tangential ones of a point, (m, d)."""

    @property
    def blocks(self) -> Array:
        """Stiffness between the components of each point, (m, d, d)."""

    def couple(self, step: Array) -> Array:
        """Elastic force (m, d) that a step (m, d) of the local displacements takes away."""

    @property
    def lambda_max(self) -> float:
        """Largest eigenvalue of the contact block scaled by its diagonal."""

    def moved(self, x: Array, r: Array) -> Array:
        """The point with its contact points changed so that their local displacements are ``r (m, d)``."""

    def multiply(self, change: Array) -> Array:
        """Elastic force that a change of a point takes away, of its shape."""

    def multiply_contact(self, change: Array) -> Array:
        """The same for a change of the contact points alone, all else being held."""

    def refreshed(self, x: Array, force: Array) -> Array:
        """:meth:`out_of_balance` of a point where it is ``force`` but for rounding; computed again if that is cheap."""

    def newton_equation(self, known: NewtonEquation | None = None) -> NewtonEquation:
        """Newton's equation of the system, for one solve; ``known`` is that of the same body on another foundation."""


class Equilibrium:
    """Energy, multiplier and residual of the points of a system.

    In all of them ``force`` is :meth:`PointSystem.out_of_balance` of the point where the caller has it already.
    """

    @property
    def extent(self) -> float:
        """Largest extent of the body; infinite where it is not known."""
        return np.inf

    def answer_sizes(self: PointSystem, x: Array) -> Array:
        """Sizes of what is added up in :meth:`PointSystem.out_of_balance` of an answer, flat: motions that deform
        nothing count as far as gaps and laws ask for them."""
        return self.rounding_sizes(x)

    def law_at(self: PointSystem, x: Array, lam: Array | None = None) -> VectorLaw:
        """The law, with a bound that depends on the solution evaluated at ``x`` and the multiplier ``lam (m, d)``, by
        default what is in equilibrium with ``x``."""
        if not self.law.state_dependent:
            return self.law
        lam = _balancing(self, self.out_of_balance(x)) if lam is None else lam
        return self.law.frozen(self.local(x), lam)

    def energy(self: PointSystem, x: Array, lam: Array | None = None, force: Array | None = None) -> float:
        """E(u) of the displacement that a point stands for.

        ``x (m, d) or (n,)``; ``lam (m, d)``: multiplier at which a bound that depends on the solution is taken; by
        default what is in equilibrium; ``force`` of the shape of x.
        """
        force = self.out_of_balance(x) if force is None else force
        close = ROUNDED * float(self.vectors.largest(self.magnitude(x))[0])
        law = self.law_at(x, _balancing(self, force) if lam is None else lam)
        elastic = -0.5 * float(x.ravel() @ (self.load + force.ravel()))
        own = contact_energy(law, self.weights, self.local(x), close)
        return float(self.vectors.total(elastic + own)[0]) + self.constant

    def multiplier(self: PointSystem, x: Array, force: Array | None = None) -> Array:
        """The multiplier (m, d) in equilibrium with ``x``; on fixed components the smallest that the law allows."""
        lam = _balancing(self, self.out_of_balance(x) if force is None else force)
        if not self.active.all():
            r = self.local(x)
            reaction = self.law.frozen(r, lam).nearest_multiplier(r, np.zeros(r.shape))
            lam = np.where(self.active, lam, reaction)
        return lam

    def residual(self: PointSystem, x: Array, lam: Array, force: Array | None = None) -> Residual:
        """The residual of the pair; what is not in the point is in equilibrium.

        ``x (m, d) or (n,)``; ``lam (m, d)``; ``force`` of the shape of x.
        """
        force = self.out_of_balance(x) if force is None else force
        contact = self.weights[:, None] * lam
        sizes = self.vectors.norms(
            self.less_contact(force, contact),
            law_forces(self.law, self.weights, self.local(x), lam, self.material_compliance),
            contact[self.active],
            self.answer_sizes(x),
        ).tolist()
        return Residual.of(sizes[0], sizes[1], self.load_scale, sizes[2], sizes[3])


class OfProblem(Equilibrium):
    """Of a discrete problem in one place."""

    problem: DiscreteProblem

    @property
    def law(self) -> VectorLaw:
        """The contact law."""
        return self.problem.law

    @property
    def weights(self) -> Array:
        """Quadrature weights (m,)."""
        return self.problem.contact.weights

    @property
    def extent(self) -> float:
        return self.problem.extent

    @property
    def vectors(self) -> Vectors:
        """It is in one piece."""
        return WHOLE


class OfUnknowns(Equilibrium):
    """A system whose points are all unknowns, (n,)."""

    @property
    def material_compliance(self: PointSystem) -> Array:
        return self.compliance

    def of_unknowns(self, unknowns: Array) -> Array:
        return unknowns

    def recover(self: PointSystem, x: Array, *multipliers: Array) -> tuple[Array, list[Residual]]:
        force = self.out_of_balance(x)
        return x, [self.residual(x, lam, force) for lam in multipliers]


def _balancing(system: PointSystem, force: Array) -> Array:
    """The multiplier (m, d) that takes up a force."""
    return np.asarray(system.at_contact(force) / system.weights[:, None])
