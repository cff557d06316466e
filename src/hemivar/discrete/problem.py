"""The discrete contact problem: what every solver and every certificate works on."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import LARGEST, real_array, real_matrix
from hemivar.basics.defined_above import above
from hemivar.basics.display import ReprMixin
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.contact import ContactPoints, components_of
from hemivar.discrete.contact_energy import contact_energy
from hemivar.discrete.held_at_rest import limit_of
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.own_mesh import Location, located, numbered_field
from hemivar.discrete.recession import CoercivityProof
from hemivar.discrete.space import Field, Space
from hemivar.errors import ProblemError
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import frozen_at, polar, softens
from hemivar.linear.vectors import Vectors
from hemivar.mesh.mesh import Mesh

if TYPE_CHECKING:
    from hemivar.mechanics.statement import ContactProblem

__all__ = ["DiscreteProblem", "pushes"]

#: Part of the largest coordinate or gap below which a gap is rounding.
_ROUNDED = 64.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class DiscreteProblem(PickleMixin, ReprMixin):
    """What is solved: an elastic body, its load, and a contact law at each of its contact points.

    >>> import hemivar as hv
    >>> law = hv.laws.ContactLaw(hv.Signorini()).at(None)
    >>> spring = hv.DiscreteProblem.of_arrays([[2.0]], [1.0], [[1.0]], [1.0], [0.2], law)
    >>> solution = hv.solve(spring)  # 2 u + lambda = 1, u <= 0.2
    >>> solution.unknowns.round(12), solution.pressure.round(12)
    (array([0.2]), array([0.6]))

    :func:`hemivar.discretize` makes one of a stated problem, :meth:`of_arrays` of your own matrices, and
    :meth:`of_forms` of forms of scikit-fem.  :meth:`with_` gives another load, gap or law; nothing is changed in place.

    A solution is a pair u, lambda: ``K u + B'W lambda = f``, ``lambda_j in dj_j(r_j)`` (Clarke), ``r = B u - offset``.
    K is :attr:`stiffness`, f :attr:`load`, and the :attr:`contact` points have the trace B and the weights W.  r has
    shape (m, c): column 0 is the penetration of contact point j, the others are its slip.  Such pairs are the
    stationary points of the :meth:`energy`.  In a nonlinear body the gradient of the :attr:`bulk` replaces K u.

    Parameters
    ----------
    model : Model
        What stays: the body and its contact points.
    loading : Loading
        What changes: load, offsets and law.
    warnings : tuple of str
        Sentences on what results of this problem do not show by themselves; empty for most problems.

    Raises
    ------
    ProblemError
        Model and loading do not fit one another, or the work of the load is beyond the range of numbers.
    """

    model: Model
    loading: Loading
    warnings: tuple[str, ...] = ()
    #: How the body was shown to be held, of which model, load and law; see :attr:`held` and :attr:`limit`.
    _shown: CoercivityProof | None = None
    #: Whether law and load follow those of another problem: neither the law nor the size of the load is tried out.
    _known: InitVar[bool] = False

    def __post_init__(self, _known: bool) -> None:
        model = expect(self.model, Model, "the model of a discrete problem", "give hemivar.discrete.Model")
        loading = expect(self.loading, Loading, "the loading of a discrete problem", "give hemivar.discrete.Loading")
        if loading.load.shape != (model.unknowns,):
            raise ProblemError(
                f"the body has {model.unknowns} unknowns but load has {loading.load.size} entries; "
                "give a load with one number for each unknown"
            )
        if loading.offset.shape != model.contact.shape:
            raise ProblemError(
                f"offset has shape {loading.offset.shape}; it needs a row for each contact point with one number for "
                f"each of its local components, {model.contact.shape}"
            )
        self._check_work(stated=not _known)
        if not _known:
            _check_law(loading.law, loading.offset)

    def _check_work(self, *, stated: bool) -> None:
        """Refuse a load whose energy overflows; of a stated one also an energy that underflows."""
        if isinstance(self.bulk, Quadratic):
            self.bulk.check_work(self.loading.load, self.loading.load_size, stated=stated)

    @classmethod
    def of_arrays(
        cls,
        stiffness: ArrayLike | sp.sparray,
        load: Array,
        trace: ArrayLike | sp.sparray,
        weights: Array,
        gap: Array,
        law: VectorLaw,
        constant: float = 0.0,
        slip_offset: Array | None = None,
        points: Array | None = None,
        frames: Array | None = None,
        field: Field | None = None,
        *,
        mesh: Mesh | None = None,
        numbering: ArrayLike | None = None,
        prescribed: ArrayLike | None = None,
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
        law : VectorLaw
            Resolved at the contact points.
        constant : float
            Energy that does not depend on the unknowns.
        slip_offset : array, shape (m, c - 1), optional
            Subtracted from the slip, as the gap is from the penetration.
        points, frames : arrays, shape (m, d) and (m, c, d), optional
            Coordinates of the contact points, and unit vectors of their local components.
        field : Field, optional
            How to recover the displacement.
        mesh : Mesh, optional
            The body, for pictures, VTU and displacements of nodes: vertices, or vertices and the middles of edges, are
            its N nodes. Its named boundaries hold the contact points. In place of ``field``.
        numbering : int array, shape (N, d), optional
            With a mesh: the unknown that is component c of node i, and -1 where the displacement is prescribed.
        prescribed : array, shape (N, d), optional
            With a mesh: the prescribed displacements, where the numbering is -1; zero by default.

        Raises
        ------
        ProblemError
            If shapes disagree, numbers are not finite, the stiffness is unsymmetric (relative to 1e-10) or has
            a diagonal entry that is not positive, or a weight is not positive.
        """
        bulk = Quadratic(stiffness)
        rows = real_matrix(trace, "trace", own=True)
        if not np.abs(rows.data).max(initial=0.0) < LARGEST:
            raise ProblemError(f"trace has entries above {LARGEST:g}, whose squares overflow; give it in other units")
        own = real_array(weights, "weights", 1, own=True)
        m, components = own.shape[0], components_of(rows.shape[0], own)
        gaps = real_array(gap, "gap", 1)
        if gaps.shape != (m,):
            raise ProblemError(f"gap has shape {gaps.shape}; it needs one number per contact point, ({m},)")
        found_field = None if field is None else expect(field, Field, "field", "give hemivar.discrete.Field")
        if mesh is not None:
            if field is not None:
                raise ProblemError("field and mesh are both given; leave the field out")
            found_field = numbered_field(mesh, numbering, prescribed, bulk.unknowns)
        elif numbering is not None or prescribed is not None:
            raise ProblemError("numbering and prescribed go with a mesh; give mesh=, or leave them out")
        coordinates = None if points is None else real_array(points, "points", 2, own=True)
        if not components:
            given = (coordinates.shape[1] if coordinates is not None else None, found_field and found_field.mesh.dim)
            components = next((d for d in given if d), 2)
        offset = np.zeros((m, components))
        offset[:, 0] = gaps
        if slip_offset is not None:
            slips = real_array(slip_offset, "slip_offset", 2)
            if m > 0 and slips.shape != (m, components - 1):
                raise ProblemError(f"slip_offset has shape {slips.shape}; it must be {(m, components - 1)}")
            if m > 0:
                offset[:, 1:] = slips
        turned = None if frames is None else real_array(frames, "frames", 3, own=True)
        where: Location = {"points": coordinates, "frames": turned}
        if mesh is not None and found_field is not None:
            where = located(found_field, rows, coordinates, turned, m)
        contact = ContactPoints(rows, own, components=components, **where)
        model = Model(bulk, contact, None if found_field is None else Space((found_field,)))
        return cls(model, Loading(load, offset, law, constant))

    @classmethod
    def of_forms(cls, basis: object, form: object, **options: object) -> DiscreteProblem:
        """A problem by any basis and form of scikit-fem.

        Parameters
        ----------
        basis : skfem.CellBasis
        form : skfem.BilinearForm, or its matrix
        **options
            ``load``, ``supports`` and ``fixed`` of :class:`hemivar.fem.FormBody`; ``contact``, ``trace`` and ``at`` of
            its method ``problem``.

        Raises
        ------
        ProblemError
            Something is of the wrong kind or shape, or a name is unknown.
        """
        problem: DiscreteProblem = above("DiscreteProblem.of_forms")(basis, form, **options)
        return problem

    def with_(
        self,
        *,
        load: Array | None = None,
        offset: Array | None = None,
        law: VectorLaw | None = None,
        constant: float | None = None,
        bulk: Bulk | None = None,
    ) -> DiscreteProblem:
        """The same body and contact points with another load, offset or law, or another bulk.

        The model is shared, unless the bulk is another one: a :class:`hemivar.systems.Workspace` knows it again, and
        another load, offset or law costs no new factorisation.

        Parameters
        ----------
        load : array, shape (n,), optional
        offset : array, shape (m, c), optional
            Gap in column 0, slip offset in the others.
        law : VectorLaw, optional
            Resolved at the same contact points.
        constant : float, optional
            Energy that does not depend on the unknowns.
        bulk : Bulk, optional
            With as many unknowns.

        Raises
        ------
        ProblemError
            As when the problem was made.
        """
        changed = self.under(load, offset=offset, law=law, constant=constant, bulk=bulk)
        if load is not None or bulk is not None:
            changed._check_work(stated=True)
        return changed

    def under(
        self,
        load: Array | None,
        *,
        offset: Array | None = None,
        law: VectorLaw | None = None,
        constant: float | None = None,
        bulk: Bulk | None = None,
    ) -> DiscreteProblem:
        """As :meth:`with_`, for what a method computes on its way: a load that is zero but for rounding is taken."""
        known = self.loading
        loading = Loading(
            known.load if load is None else load,
            known.offset if offset is None else offset,
            known.law if law is None else law,
            known.constant if constant is None else constant,
        )
        model = self.model if bulk is None else replace(self.model, bulk=bulk)
        changed = self.fitted(model, loading)
        if loading.law is not known.law:
            _check_law(loading.law, loading.offset)
        return changed

    def fitted(
        self, model: Model | None = None, loading: Loading | None = None, warnings: tuple[str, ...] | None = None
    ) -> DiscreteProblem:
        """With another model, loading or warnings that are known to fit: neither law nor size of the load is tried."""
        noted = self.warnings if warnings is None else warnings
        model, loading = self.model if model is None else model, self.loading if loading is None else loading
        return DiscreteProblem(model, loading, noted, self._shown, True)

    def on_the_same(self, model: Model) -> DiscreteProblem:
        """The problem with a model of the same body that was made before: what was shown of the one holds of it."""
        other, shown = self.fitted(model), self._shown
        if shown is None or not shown.covers(self._held_by):
            return other
        return replace(other, _shown=replace(shown, of=other._held_by), _known=True)

    def __repr__(self) -> str:
        contact, names = self.contact, ", ".join(self.contact.names)
        where = f"{contact.count} contact points of {contact.components} components" + (f" on {names}" if names else "")
        return f"DiscreteProblem({self.unknowns} unknowns, {where}, law {self.law.name})"

    @property
    def bulk(self) -> Bulk:
        """Stored energy of the body."""
        return self.model.bulk

    @property
    def linear(self) -> Quadratic:
        """The bulk of a linear body.

        Raises
        ------
        ProblemError
            The bulk is not quadratic.
        """
        return self.model.linear

    @property
    def stiffness(self) -> sp.csr_array:
        """``K`` of a linear body, shape (n, n).

        Raises
        ------
        ProblemError
            The bulk is not quadratic.
        """
        return self.model.linear.stiffness

    @property
    def contact(self) -> ContactPoints:
        """The contact points."""
        return self.model.contact

    @property
    def vectors(self) -> Vectors:
        """How the parts of all processes are looked at together, where the arrays are those of one."""
        return self.model.contact.vectors

    @property
    def space(self) -> Space | None:
        """The fields that the unknowns describe."""
        return self.model.space

    @property
    def origin(self) -> ContactProblem | None:
        """What was discretised."""
        return self.model.origin

    @property
    def load(self) -> Array:
        """Forces ``f`` on the unknowns, shape (n,)."""
        return self.loading.load

    @property
    def offset(self) -> Array:
        """What is subtracted from ``B u``, shape (m, c): the gap, and a slip that is there already."""
        return self.loading.offset

    @property
    def gap(self) -> Array:
        """Distance between body and foundation along the normal, shape (m,)."""
        return np.asarray(self.loading.offset[:, 0])

    @property
    def law(self) -> VectorLaw:
        """The contact law at the contact points."""
        return self.loading.law

    @property
    def constant(self) -> float:
        """Energy that does not depend on the unknowns."""
        return self.loading.constant

    @property
    def extent(self) -> float:
        """Largest extent of the body along an axis; infinite without a mesh, or where displacements are no lengths."""
        field = self.field
        return np.inf if field is None or field.components == 1 else float(np.ptp(field.nodes, axis=0).max())

    @property
    def held(self) -> bool:
        """Whether its energy has been shown to grow along every motion that deforms nothing.

        :func:`hemivar.discretize` does so; another load, law or bulk is another question, another gap is not.
        """
        shown = self._shown
        if shown is None or (shown.limit, shown.idle, shown.balanced) != (None, None, None):
            return False
        return shown.covers(self._held_by)

    @property
    def limit(self) -> str | None:
        """A sentence where the foundation holds the body at rest, but its energy need not have a minimum.

        As glue does that breaks. :func:`hemivar.discretize` finds it; it is decided again for another load or law. None
        where the energy grows along every motion, and where nothing is known.
        """
        shown = self._shown
        if shown is None or shown.covers(self._held_by):
            return None if shown is None else shown.limit
        perhaps = shown.limit is not None or (shown.idle is not None and softens(self.law))
        if not perhaps or self.field is None or not isinstance(self.bulk, Quadratic):
            return None
        return limit_of(self.field, self.contact, self.loading, self.model.free_motions)

    @property
    def unmoved(self) -> bool:
        """Whether the body is in balance as it is: nothing acts, and the foundation need not push where it stands.

        Gaps below the rounding of the places of the contact points are none.
        """
        points = self.contact.points
        lengths = (self.offset, 0.0 if points is None else points)
        far = max(float(np.abs(length).max(initial=0.0)) for length in lengths)
        return not self.load.any() and not pushes(self.law, self.offset, far)

    @property
    def idle(self) -> str | None:
        """A sentence where nothing acts on a body that contact alone would hold, so that it rests in one of many
        equilibria; :func:`hemivar.discretize` finds it."""
        return self._shown.idle if self._shown is not None and self._shown.covers(self._held_by) else None

    @property
    def notes(self) -> tuple[str, ...]:
        """:attr:`warnings`, :attr:`limit` and :attr:`idle`: what results must say beside their numbers."""
        return (*self.warnings, *(note for note in (self.limit, self.idle) if note is not None))

    @property
    def balanced_by_friction(self) -> bool:
        """Whether only friction holds it that the pressure bounds, whose cones balance the load.

        :func:`hemivar.discretize` finds it.
        """
        return self._shown is not None and self._shown.balanced is True

    def known_to_be_held(
        self, limit: str | None = None, idle: str | None = None, balanced: bool | None = None
    ) -> DiscreteProblem:
        """The problem, known to be :attr:`held` from now on, up to a :attr:`limit`, by friction, or to be :attr:`idle`;
        for who has shown it."""
        shown = CoercivityProof(self._held_by, limit, idle, balanced)
        return DiscreteProblem(self.model, self.loading, self.warnings, shown, True)

    @property
    def _held_by(self) -> tuple[object, ...]:
        return self.model, self.load, self.law

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.model.unknowns

    @property
    def contact_points(self) -> int:
        """Number of contact points m."""
        return self.contact.count

    @property
    def field(self) -> Field | None:
        """The first field of the space, the displacement of the body; None for a problem made of arrays."""
        return self.model.field

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
        return self.contact.trace_of(self._checked(unknowns)) - self.offset

    def out_of_balance(self, unknowns: Array) -> Array:
        """What the body leaves of its load, the foundation apart: ``f - bulk'(u)``, shape (n,), of unknowns (n,).

        Rigid motions of what supports do not hold leave nothing.
        """
        return np.asarray(self.load - self.bulk.gradient(self.strained(unknowns)[0]))

    def strained(self, unknowns: Array) -> tuple[Array, Array]:
        """Unknowns (n,) without their rigid part, and the sizes (n,) of what is left in an answer.

        See ``RigidPart.without`` of ``hemivar.discrete.rigid_part``.
        """
        rigid, u = self.model.rigid_part, self._checked(unknowns)
        return rigid.without(u, self.kept_apart(self.local(u)) if rigid.count else 0.0)

    def kept_apart(self, r: Array) -> float:
        """The largest displacement that gaps or laws ask for at local displacements r (m, c).

        That is an offset, or a displacement by which a law changes its force: not that of a body which slides against
        friction, or has flown off.
        """
        r = real_array(r, "local displacements", 2, finite=False)
        line = frozen_at(self.law, r).linearise(r)
        bends = line.hessian[:, 0, 0] != 0.0
        far = np.abs(self.offset).max(initial=0.0), np.abs(r[bends | ~line.smooth[:, 0], 0]).max(initial=0.0)
        size, direction = polar(r[:, 1:])
        along = np.abs(np.einsum("mi,mij,mj->m", direction, line.hessian[:, 1:, 1:], direction))
        bends = along > _ROUNDED * np.abs(line.hessian[:, 1:, 1:]).max(axis=(1, 2), initial=0.0)
        return float(max(*far, size[bends | ~line.smooth[:, 1]].max(initial=0.0)))

    def energy(self, unknowns: Array, multiplier: Array | None = None) -> float:
        """Energy ``E(u)`` of the unknowns, shape (n,), the constant included.

        A friction bound that depends on the state is taken at ``u`` itself and at the pressure of ``multiplier``,
        shape (m, c); without a multiplier, at the pressure nearest to zero that the normal law allows at ``u``.

        Where a law ends (a rigid foundation), a penetration beyond its end by rounding alone, 1e-12 of the largest
        displacement or gap, counts as being at the end; beyond that the energy is +inf.
        """
        u = self._checked(unknowns)
        vectors = self.vectors
        energy = self.bulk.value(u) - float(vectors.total(float(self.load @ u))[0]) + self.constant
        if self.contact_points > 0 or not vectors.alone:
            contact = self.contact
            r = contact.trace_of(u) - self.offset
            moved = contact.sizes @ np.abs(u)  # what may cancel in r
            sizes = vectors.largest(float(moved.max(initial=0.0)), float(np.abs(self.offset).max(initial=0.0)))
            law = frozen_at(self.law, r) if multiplier is None else self.law.frozen(r, multiplier)
            own = contact_energy(law, contact.weights, r, 1e-12 * float(sizes.max()))
            energy += float(vectors.total(own)[0])
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
        if lam.shape != self.contact.shape:
            raise ProblemError(f"the multiplier has shape {lam.shape}; this problem has {self.contact.shape}")
        return self.contact.force(lam)

    def _checked(self, unknowns: Array) -> Array:
        u = real_array(unknowns, "the unknowns", finite=False)
        if u.shape != (self.unknowns,):
            raise ProblemError(f"the unknowns have shape {u.shape}; this problem has {(self.unknowns,)}")
        return u


def pushes(law: VectorLaw, offset: Array, far: float) -> bool:
    """Whether a foundation must push a body that has not moved.

    Shapes: ``offset`` (m, c).
    """
    r = np.where(np.abs(offset) <= _ROUNDED * far, 0.0, -offset)
    zero = np.zeros_like(r)
    return bool(r.size and law.frozen(r, zero).distance(r, zero).any())


def _check_law(law: VectorLaw, offset: Array) -> None:
    """Refuse a law that cannot be evaluated at its contact points, those of an offset (m, c)."""
    m = len(offset)
    if m == 0:
        return
    start = -offset
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
