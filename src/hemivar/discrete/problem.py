"""The discrete contact problem: what every solver and every certificate works on."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_array, real_matrix
from hemivar.basics.display import Displayed
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.contact import ContactPoints, components_of
from hemivar.discrete.foothold import limit_of
from hemivar.discrete.hold import Held
from hemivar.discrete.space import Field, Space
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw

if TYPE_CHECKING:
    from hemivar.mechanics.scalar import Statement

__all__ = ["DiscreteProblem", "quadratic"]

_ARRAYS = "DiscreteProblem.of_arrays(stiffness, load, trace, weights, gap, law) takes plain arrays"


@dataclass(frozen=True, eq=False)
class DiscreteProblem(Portable, Displayed):
    """Energy of a discrete contact problem.

    ``E(u) = bulk(u) + sum_j w_j j_j(r_j)``, ``r = B u - offset`` with shape (m, c): column 0 is the penetration of
    contact point j, the other columns its slip. A solution is a pair ``bulk'(u) + B'W lambda = 0``,
    ``lambda_j in dj_j(r_j)`` (Clarke subdifferential).  It is frozen: :meth:`with_` makes others of it.

    Parameters
    ----------
    bulk : Bulk
        The body under its load; :class:`Quadratic` where it is linear.
    contact : ContactPoints
        The contact points.
    law : ContactLaw
        The contact law with parameters resolved at the contact points.
    space : Space or None
        The fields that the unknowns describe.
    origin : ContactProblem, ScalarProblem or None
        What was discretised; the same on a coarser mesh serves multigrid.
    warnings : tuple of str
        Sentences on what results of this problem do not show by themselves; empty for most problems.
    shown : Held or None
        How the body was shown to be held, of which bulk, contact points and law; see :attr:`held` and :attr:`limit`.

    Raises
    ------
    ProblemError
        Bulk, contact points, law and space do not fit one another.
    """

    bulk: Bulk
    contact: ContactPoints
    law: ContactLaw
    space: Space | None = None
    origin: Statement | None = None
    warnings: tuple[str, ...] = ()
    shown: Held | None = None

    def __post_init__(self) -> None:
        expect(self.bulk, Bulk, "the bulk of a discrete problem", _ARRAYS)
        expect(self.contact, ContactPoints, "the contact of a discrete problem", _ARRAYS)
        n = _check_count(self.bulk, self.contact)
        if self.space is not None and self.space.unknowns != n:
            raise ProblemError(f"space has {self.space.unknowns} unknowns but load has {n}; they must agree")
        _check_law(self.law, self.contact)

    @classmethod
    def of_arrays(
        cls,
        stiffness: ArrayLike | sp.sparray,
        load: Array,
        trace: ArrayLike | sp.sparray,
        weights: Array,
        gap: Array,
        law: ContactLaw,
        constant: float = 0.0,
        slip_offset: Array | None = None,
        points: Array | None = None,
        frames: Array | None = None,
        field: Field | None = None,
    ) -> DiscreteProblem:
        """A problem made of the user's own arrays, which are copied.

        Parameters
        ----------
        stiffness : array or sparse array, shape (n, n)
            ``K``, symmetric with positive diagonal.
        load : array, shape (n,)
            ``f``.
        trace : array or sparse array, shape (m * c, n)
            ``B``; row ``j * c`` is the normal component of contact point j, the c - 1 rows after it its slip.
        weights, gap : arrays, shape (m,)
            Quadrature weights, and distances between body and foundation.
        law : ContactLaw
            Resolved at the contact points.
        constant : float
            Energy that does not depend on the unknowns.
        slip_offset : array, shape (m, c - 1), optional
            Subtracted from the slip, as the gap is from the penetration.
        points, frames : arrays, shape (m, d) and (m, c, d), optional
            Coordinates of the contact points, and unit vectors of their local components.
        field : Field, optional
            How to recover the displacement.

        Raises
        ------
        ProblemError
            If shapes disagree, numbers are not finite, the stiffness is unsymmetric (relative to 1e-10) or has
            a diagonal entry that is not positive, or a weight is not positive.
        """
        bulk = Quadratic(stiffness, load, constant)
        rows = real_matrix(trace, "trace", own=True)
        own = real_array(weights, "weights", 1, own=True)
        m, components = own.shape[0], components_of(rows.shape[0], own)
        gaps = real_array(gap, "gap", 1)
        if gaps.shape != (m,):
            raise ProblemError(f"gap has shape {gaps.shape}; it needs one number per contact point, ({m},)")
        found_field = None if field is None else expect(field, Field, "field", "give hemivar.discrete.Field")
        place = None if points is None else real_array(points, "points", 2, own=True)
        if not components:
            given = (place.shape[1] if place is not None else None, found_field and found_field.mesh.dim)
            components = next((d for d in given if d), 2)
        offset = np.zeros((m, components))
        offset[:, 0] = gaps
        if slip_offset is not None:
            slips = real_array(slip_offset, "slip_offset", 2)
            if m > 0 and slips.shape != (m, components - 1):
                raise ProblemError(f"slip_offset has shape {slips.shape}; it must be {(m, components - 1)}")
            if m > 0:
                offset[:, 1:] = slips
        offset.flags.writeable = False
        turned = None if frames is None else real_array(frames, "frames", 3, own=True)
        contact = ContactPoints(rows, own, offset, place, turned)
        return cls(bulk, contact, law, None if found_field is None else Space((found_field,)))

    def with_(
        self,
        *,
        load: Array | None = None,
        offset: Array | None = None,
        law: ContactLaw | None = None,
        bulk: Bulk | None = None,
    ) -> DiscreteProblem:
        """The same body and contact points with another load, offset or law, or another bulk.

        What is shared is not checked again, and a :class:`hemivar.systems.Workspace` knows it again: another load,
        offset or law costs no new factorisation.

        Parameters
        ----------
        load : array, shape (n,), optional
            Of a quadratic bulk, whose constant stays.
        offset : array, shape (m, c), optional
            Gap in column 0, slip offset in the others.
        law : ContactLaw, optional
            Resolved at the same contact points.
        bulk : Bulk, optional
            With as many unknowns; not together with ``load``.

        Raises
        ------
        ProblemError
            As when the problem was made.
        """
        if bulk is not None:
            expect(bulk, Bulk, "the bulk of a discrete problem", _ARRAYS)
        if bulk is not None and load is not None:
            raise ProblemError("a bulk brings its own load; give one of load and bulk")
        if load is not None:
            bulk = quadratic(self.bulk, "another load").under(load)
        changed = copy.copy(self)
        if bulk is not None:
            _check_count(bulk, self.contact)
            object.__setattr__(changed, "bulk", bulk)
        if offset is not None:
            object.__setattr__(changed, "contact", self.contact.with_offset(offset))
        if law is not None and law is not self.law:
            _check_law(law, changed.contact)
            object.__setattr__(changed, "law", law)
        return changed

    def __repr__(self) -> str:
        contact, names = self.contact, ", ".join(self.contact.names)
        where = f"{contact.count} contact points of {contact.components} components" + (f" on {names}" if names else "")
        return f"DiscreteProblem({self.unknowns} unknowns, {where}, law {self.law.normal.name})"

    def going_on(self, load: Array, offset: Array, law: ContactLaw) -> DiscreteProblem:
        """:meth:`with_` for a law that follows another one of the same points, which is not tried out again.

        The load is not copied: it is read-only from now on.

        Raises
        ------
        ProblemError
            A number of the load or the offset is not finite, or there are more or fewer than there were.
        """
        bulk = quadratic(self.bulk, "another load").under(load, own=False)
        changed = copy.copy(self)
        vars(changed).update(bulk=bulk, contact=self.contact.with_offset(offset), law=law)
        return changed

    @property
    def linear(self) -> Quadratic:
        """The bulk of a linear body: its stiffness, load and constant.

        Raises
        ------
        ProblemError
            The bulk is not quadratic.
        """
        return quadratic(self.bulk)

    @property
    def held(self) -> bool:
        """Whether its energy has been shown to grow along every motion that deforms nothing.

        :func:`hemivar.discretize` does so; another load, law or bulk is another question, another gap is not.
        """
        return self.shown is not None and self.shown.limit is None and self.shown.covers(self._held_by)

    @property
    def limit(self) -> str | None:
        """A sentence where the foundation holds the body at rest, but its energy need not have a minimum.

        As glue does that breaks. :func:`hemivar.discretize` finds it; it is decided anew for another load or law. None
        where the energy grows along every motion, and where nothing is known.
        """
        if self.shown is None or self.shown.limit is None or self.shown.covers(self._held_by):
            return None if self.shown is None else self.shown.limit
        if self.field is None or not isinstance(self.bulk, Quadratic):
            return None
        return limit_of(self.field, self.contact, self.law, self.bulk)

    @property
    def notes(self) -> tuple[str, ...]:
        """:attr:`warnings`, and :attr:`limit` where there is one: what results must say beside their numbers."""
        limit = self.limit
        return self.warnings if limit is None else (*self.warnings, limit)

    def known_to_be_held(self, limit: str | None = None) -> DiscreteProblem:
        """The problem, known to be :attr:`held` from now on, or up to a :attr:`limit`; for who has shown it."""
        shown = Held(self._held_by, limit)
        return DiscreteProblem(self.bulk, self.contact, self.law, self.space, self.origin, self.warnings, shown)

    @property
    def _held_by(self) -> tuple[object, ...]:
        return self.bulk, self.contact.trace, self.contact.weights, self.law, self.space

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.bulk.unknowns

    @property
    def contact_points(self) -> int:
        """Number of contact points m."""
        return self.contact.count

    @property
    def field(self) -> Field | None:
        """The first field of the space, the displacement of the body; None for a problem made of arrays."""
        return None if self.space is None else self.space.fields[0]

    def local(self, unknowns: Array) -> Array:
        """Penetration and slip at the contact points: ``r = B u - offset``.

        Parameters
        ----------
        unknowns : array, shape (n,)

        Returns
        -------
        array, shape (m, c)
            Column 0 penetration, columns 1.. slip.
        """
        return self.contact.local(self._checked(unknowns))

    def energy(self, unknowns: Array, multiplier: Array | None = None) -> float:
        """Energy ``E(u)`` of the unknowns, shape (n,), the constant included.

        A friction bound that depends on the state is taken at ``u`` itself and at the pressure of ``multiplier``,
        shape (m, c); without a multiplier, at the pressure nearest to zero that the normal law allows at ``u``.

        Where a law ends (a rigid foundation), a penetration beyond its end by rounding alone, 1e-12 of the largest
        displacement or gap, counts as being at the end; beyond that the energy is +inf.
        """
        u = self._checked(unknowns)
        energy = self.bulk.value(u)
        if self.contact_points > 0:
            contact = self.contact
            r = contact.local(u)
            domain = self.law.normal.domain
            moved = np.abs(contact.trace) @ np.abs(u)  # what may cancel in r
            rounding = 1e-12 * max(float(moved.max()), float(np.abs(contact.offset).max()))
            inside = np.clip(r[:, 0], domain.lower, domain.upper)
            r[:, 0] = np.where(np.abs(inside - r[:, 0]) <= rounding, inside, r[:, 0])
            law = self.law.frozen_at(r) if multiplier is None else self.law.frozen(r, multiplier)
            energy += float(contact.weights @ law.value(r))
        return energy

    def contact_force(self, multiplier: Array) -> Array:
        """Nodal forces ``B' W lambda`` of a multiplier.

        Parameters
        ----------
        multiplier : array, shape (m, c)
            Force per area of the body on the foundation: pressure (column 0), and minus the friction (columns 1..).

        Returns
        -------
        array, shape (n,)
        """
        lam = real_array(multiplier, "the multiplier", finite=False)
        if lam.shape != self.contact.offset.shape:
            raise ProblemError(f"the multiplier has shape {lam.shape}; this problem has {self.contact.offset.shape}")
        return self.contact.force(lam)

    def _checked(self, unknowns: Array) -> Array:
        u = real_array(unknowns, "the unknowns", finite=False)
        if u.shape != (self.unknowns,):
            raise ProblemError(f"the unknowns have shape {u.shape}; this problem has {(self.unknowns,)}")
        return u


def quadratic(bulk: Bulk, what: str = "this") -> Quadratic:
    """The bulk, if it is quadratic.

    Raises
    ------
    ProblemError
        It is not: what is asked for needs a linear body.
    """
    if not isinstance(bulk, Quadratic):
        raise ProblemError(f"{what} needs a linear body; the bulk is a {type(bulk).__name__}: give a Quadratic")
    return bulk


def _check_count(bulk: Bulk, contact: ContactPoints) -> int:
    n = bulk.unknowns
    if contact.unknowns != n:
        raise ProblemError(f"trace has {contact.unknowns} columns; it needs one per unknown, {n}")
    return n


def _check_law(law: ContactLaw, contact: ContactPoints) -> None:
    remedy = "pass ContactLaw(normal, friction), resolved at the contact points"
    expect(law, ContactLaw, "the law of a discrete problem", remedy)
    m = contact.count
    if m == 0:
        return
    start = -contact.offset
    with np.errstate(all="ignore"):
        try:
            value = np.asarray(law.frozen(start, np.zeros(start.shape)).value(start))
        except (ValueError, IndexError, TypeError) as error:
            if isinstance(error, ProblemError):
                raise
            raise ProblemError(
                f"the law cannot be evaluated at the {m} contact points ({error}); "
                f"resolve its parameters first: law.at(points)"
            ) from error
    if value.shape != (m,):
        raise ProblemError(
            f"the law returns values of shape {value.shape} at {m} contact points; "
            f"resolve its parameters at these points: law.at(points)"
        )
