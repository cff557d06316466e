"""Bodies by any basis and bilinear form of scikit-fem: supports, contact at nodes or quadrature points, mixed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
import skfem

from hemivar.basics.arguments import UNFIT, answer, described, expect, number, quoted, shortened, suggest
from hemivar.basics.arrays import NULL, SAME, real_array, real_matrix
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.basics.units import UNITS_REMEDY, Units
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.operator_family import OperatorFamily
from hemivar.discrete.operators import Operator
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Space
from hemivar.errors import ProblemError, SupportError
from hemivar.fem.contact_points import join
from hemivar.fem.discretize import friction_warning
from hemivar.fem.form_contact import Touching, TraceOf, TraceRows, nearness, rows_on, share_nodes
from hemivar.fem.form_field import ScikitFem, form_field, nearest_nodes, rows_of
from hemivar.fem.mixed_bulk import MixedBulk, refuse_skew
from hemivar.fem.supports import in_words
from hemivar.laws import VectorLaw
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.instants import at_time, depends_on_time

__all__ = ["FormBody", "FormProblem", "of_forms"]

#: Highest degree of a rule of quadrature.
_DEGREE = 30
#: Most rows of a trace whose rank is examined.
_EXAMINED = 4000

#: What is prescribed on a boundary: one value of all unknowns there, a function of places (d, k), or one of either for
#: the unknowns of each name of scikit-fem, such as ``{"u^2": 0.0}``.
Prescription = float | Callable[[Array], Array] | Mapping[str, float | Callable[[Array], Array]]


@dataclass(frozen=True, eq=False)
class FormBody:
    """A body stated by a basis and forms of scikit-fem.

    Attributes
    ----------
    basis : skfem.CellBasis
        Of any element, composite ones included.
    form : skfem.BilinearForm, or matrix (N, N)
        Symmetric.  A matrix with zeros or negative numbers on its diagonal is that of a mixed body.
    load : skfem.LinearForm, array (N,) or None
    supports : mapping
        Of names of boundaries of the mesh of the basis to what is prescribed there.
    fixed : int array, optional
        Further unknowns that are zero, by their numbers.
    mass, viscosity : skfem.BilinearForm, or matrix (N, N), optional
        Symmetric; what resists acceleration and velocity in time.

    Raises
    ------
    ProblemError
        Something is of the wrong kind or shape, or a name is unknown.
    """

    basis: ScikitFem
    form: ScikitFem
    load: ScikitFem = None
    supports: Mapping[str, Prescription] = field(default_factory=dict)
    fixed: Sequence[int] | IntArray = ()
    mass: ScikitFem = None
    viscosity: ScikitFem = None
    #: Answers of a material that forms have, too.
    linear: ClassVar[bool] = True
    capacity: ClassVar[None] = None
    _matrix: sp.csr_array = field(init=False, repr=False)
    _in_time: Mapping[str, sp.csr_array] = field(init=False, repr=False)
    _loads: Array = field(init=False, repr=False)
    _fixed: BoolArray = field(init=False, repr=False)
    _values: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _check_basis(self.basis)
        count = int(self.basis.N)
        load = np.zeros(count) if self.load is None else self._assembly("load", skfem.LinearForm)
        if callable(load):
            raise ProblemError(f"load is {described(load)}; give a skfem.LinearForm, or an array of shape ({count},)")
        load = real_array(load, "load")
        if load.shape != (count,):
            raise ProblemError(f"load has shape {load.shape}; give a skfem.LinearForm, or an array of shape ({count},)")
        expect(self.supports, Mapping, "supports", "give what is prescribed by the name of a boundary")  # type: ignore[type-abstract]
        fixed, values = self._prescribed()
        object.__setattr__(self, "_matrix", self._assembled("form"))
        given = [name for name in ("mass", "viscosity") if getattr(self, name) is not None]
        object.__setattr__(self, "_in_time", {name: self._assembled(name) for name in given})
        object.__setattr__(self, "_loads", load)
        object.__setattr__(self, "_fixed", fixed)
        object.__setattr__(self, "_values", values)

    @property
    def inert(self) -> bool:
        """Whether it has mass."""
        return self.mass is not None

    @property
    def viscous(self) -> bool:
        """Whether it has viscosity."""
        return self.viscosity is not None

    @property
    def free(self) -> IntArray:
        """Numbers of the unknowns that no support holds."""
        return np.flatnonzero(~self._fixed)

    def _assembly(self, name: str, kind: type[ScikitFem]) -> ScikitFem:
        """What a form, an array or a matrix of this name is on the basis."""
        form = getattr(self, name)
        if not isinstance(form, kind):
            return form
        try:
            return form.assemble(self.basis)
        except UNFIT as error:
            raise ProblemError(
                f"{name} cannot be assembled on this basis ({shortened(error)}); give a form of the fields of its "
                "element"
            ) from error

    def _assembled(self, name: str) -> sp.csr_array:
        matrix, count = self._assembly(name, skfem.BilinearForm), int(self.basis.N)
        shape = getattr(matrix, "shape", None)
        if shape != (count, count):
            what = described(getattr(self, name)) if shape is None else f"a matrix of shape {shape}"
            raise ProblemError(
                f"{name} is {what}; give a skfem.BilinearForm, or a matrix of shape ({count}, {count}) on this basis"
            )
        real = real_matrix(matrix, name)
        refuse_skew(real, name)
        return real

    def _prescribed(self, time: float | None = None) -> tuple[BoolArray, Array]:
        """Which unknowns supports hold, and at what values; what depends on time counts as 0 without one."""
        fixed = _FixedUnknowns(self.basis)
        for name, parts in self.stated():
            dofs = self.basis.get_dofs(self.facets(name, "supports"))
            for part, value in parts.items():
                numbers = _unknowns(dofs, name, part)
                what = f"supports['{name}']" + (f"['{part}']" if part else "")
                known = value if time is None else at_time(value, time)
                if depends_on_time(known):
                    fixed.fix(numbers, what, np.full(numbers.size, np.nan))
                    continue
                if callable(known):
                    places = self.basis.doflocs[:, numbers]
                    known = answer(known, (places,), what, f"give a function of places, shape {places.shape}")
                fixed.fix(numbers, what, _one_each(known, numbers.size, what))
        further = _numbers(self.fixed, int(self.basis.N))
        fixed.fix(further, "fixed", np.zeros(further.size))
        return fixed.fixed, np.nan_to_num(fixed.values)

    def stated(self) -> Iterator[tuple[str, Mapping[str, object]]]:
        """What supports prescribe, by boundary and by the name of unknowns, empty for all of them."""
        for name, stated in self.supports.items():
            yield name, stated if isinstance(stated, Mapping) else {"": stated}

    def facets(self, name: str, where: str) -> IntArray:
        """Numbers of the facets of a boundary that is named somewhere."""
        known = self.basis.mesh.boundaries or {}
        if not isinstance(name, str) or name not in known:
            near = suggest(name, list(known), "boundaries")
            message = f"{shortened(where)} names boundary {quoted(name)}"
            raise ProblemError(f"{message}, which the mesh of the basis does not have{near}")
        facets = np.unique(np.asarray(known[name], dtype=np.int64))
        if not facets.size:
            raise ProblemError(f"{where} names boundary '{name}', which has no facets; name another one")
        return facets

    def full(self, problem: DiscreteProblem, unknowns: Array) -> Array:
        """All unknowns of the basis (N,) of those of a solution of the problem that :meth:`problem` made.

        Raises
        ------
        ProblemError
            The problem is not one of this body, the unknowns are not one of its solutions, or a mixed body has another
            load than the stated one.
        """
        expect(problem, DiscreteProblem, "problem", "give what problem() of this body returned")
        values, bulk = self._values.copy(), problem.bulk
        of_body = bulk.load.size if isinstance(bulk, MixedBulk) else problem.load.size
        if of_body != self.free.size:
            raise ProblemError(
                f"problem has {of_body} unknowns, and this body {self.free.size}; give what problem() of it returned"
            )
        unknowns = real_array(unknowns, "unknowns", 1)
        if unknowns.size != problem.load.size:
            raise ProblemError(f"unknowns has shape {unknowns.shape}; give solution.unknowns, ({problem.load.size},)")
        if isinstance(bulk, MixedBulk):
            stated = bulk.reduced()[0]
            if np.abs(problem.load - stated).max(initial=0.0) > SAME * np.abs(stated).max(initial=0.0):
                raise ProblemError(
                    "the other unknowns of a mixed body are known under its stated load, and this problem has another "
                    "one; state that load in the form"
                )
            unknowns = bulk.extend(unknowns)
        values[self.free] = unknowns
        return values

    def problem(
        self, contact: Mapping[str, Contact], trace: TraceOf | None = None, at: str | int = "nodes"
    ) -> DiscreteProblem:
        """The discrete problem with contact on boundaries or regions: :attr:`FormProblem.discrete` of these."""
        return FormProblem(self, contact, trace, at).discrete


@dataclass(frozen=True, eq=False)
class FormProblem(PickleMixin):
    """A body of forms with its contact on boundaries or regions of the mesh of the basis.

    In time, ``hemivar.Evolution(FormProblem(...), inertia=True)``, supports, gaps and laws may depend on time as
    functions ``f(x, t)``; supports get places (d, k), as scikit-fem has them.

    Attributes
    ----------
    body : FormBody
    contact : mapping of name to Contact
        With its laws and its gap, in time with memory and damping; a boundary, or a region for contact over an area.
    trace : callable, optional
        Of the fields of a basis function, one argument each (``skfem.DiscreteField``): what touches, a vector or
        one component.  The first field by default.  One component is the penetration itself; a vector touches
        along the normal of its boundary.
    at : str or int
        ``"nodes"``: contact points are nodes with positive weights; a number: the points of the rule of quadrature
        of that degree on the boundary or region, whose displacements must be independent of one another.
    factor : callable, optional
        What the load is multiplied by at a time.
    title : str
    units : Units
        For labels; no number is converted.

    Raises
    ------
    ProblemError
        Something is of the wrong kind, or a name is unknown.
    """

    body: FormBody
    contact: Mapping[str, Contact]
    trace: TraceOf | None = None
    at: str | int = "nodes"
    factor: Callable[[float], float] | None = None
    title: str = ""
    units: Units = field(default_factory=Units)
    kind: ClassVar[None] = None
    without_mass: ClassVar[str] = "the body has no mass; give FormBody(..., mass=form)"
    _touching: Mapping[str, Touching] = field(init=False, repr=False)

    @property
    def material(self) -> FormBody:
        """The body, which answers what the material of a :class:`hemivar.ContactProblem` does."""
        return self.body

    def __post_init__(self) -> None:
        expect(self.body, FormBody, "the body of a problem of forms", "give a hemivar.fem.FormBody(basis, form)")
        expect(self.contact, Mapping, "contact", "give a hemivar.Contact by the name of a boundary or a region")  # type: ignore[type-abstract]
        if self.trace is not None and not callable(self.trace):
            raise ProblemError(f"trace is {described(self.trace)}; give a function of the fields, such as lambda u: u")
        if self.factor is not None and not callable(self.factor):
            raise ProblemError(f"factor is {described(self.factor)}; give a function of the time, such as lambda t: t")
        expect(self.title, str, "title", "give a text")
        expect(self.units, Units, "units", UNITS_REMEDY)
        if not (type(self.at) is int and 0 <= self.at <= _DEGREE) and not (
            isinstance(self.at, str) and self.at == "nodes"
        ):
            raise ProblemError(
                f"at is {described(self.at)}; choose 'nodes', or the degree of a rule of quadrature, 0 to {_DEGREE}"
            )
        rows = {name: self._seen(name, contact) for name, contact in self.contact.items()}
        if not rows:
            raise ProblemError("contact is empty; name a boundary or a region that touches a foundation")
        if len({seen.components for seen in rows.values()}) > 1:
            raise ProblemError("the contacts have different numbers of components; state one problem for each")
        if self.at == "nodes":
            share_nodes(rows, nearness(self.body.basis.mesh))
        places = {
            name: seen.touching(name, self.contact[name], self.body.free, (number, tuple(rows)))
            for number, (name, seen) in enumerate(rows.items())
        }
        object.__setattr__(self, "_touching", places)

    @cached_property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: of "load", "supports", "gap" and "law"."""
        prescribed = [one for _, parts in self.body.stated() for one in parts.values()]
        depends = {"load"} if self.factor is not None else set()
        depends |= {"supports"} if any(map(depends_on_time, prescribed)) else set()
        return frozenset(depends.union(*(one.time_dependent for one in self.contact.values())))

    @cached_property
    def discrete(self) -> DiscreteProblem:
        """At rest.

        Raises
        ------
        ProblemError
            It depends on time, or the form does not fit the contact.
        """
        for name, contact in self.contact.items():
            if contact.memory is not None or contact.damping is not None:
                raise ProblemError(
                    f"contact['{name}'] has memory or damping, which means something in time only; leave it out"
                )
        if self.time_dependent:
            raise ProblemError(f"{', '.join(sorted(self.time_dependent))} depend on time; give it to hemivar.Evolution")
        return self._discrete(None)

    def starting(self, time: float) -> DiscreteProblem:
        """The elastic body at a time, for a march.

        Raises
        ------
        ProblemError
            The unknowns are no displacements of nodes.
        """
        discrete = self._discrete(time)
        if discrete.field is None or discrete.field.partial:
            raise ProblemError(
                "a body in time needs its displacement at nodes; take Lagrange elements of order 1 or 2, without a "
                "multiplier"
            )
        return discrete

    def places(self, time: float) -> tuple[Array, int]:
        """The nodes (k, d) of the displacement and its components."""
        field = self.starting(time).field
        assert field is not None
        return field.nodes, field.components

    def _discrete(self, time: float | None) -> DiscreteProblem:
        body, matrix, free = self.body, self.body._matrix, self.body.free
        values = body._values if time is None else body._prescribed(time)[1]
        contact, offset, law, energy = self._contact_at(time, values)
        reaction = matrix @ values
        load = self.force(time)
        inner, force = sp.csr_array(matrix[free][:, free]), load[free] - reaction[free]
        constant = 0.5 * float(values @ reaction) - float(values @ load) + energy
        diagonal = inner.diagonal()
        if diagonal.size and (diagonal <= 0.0).all():
            raise ProblemError("the form is nowhere positive on the diagonal; state an energy, or change its sign")
        shown = form_field(body.basis, free, values) if (diagonal > 0.0).all() else None
        bulk: Quadratic
        if (diagonal > 0.0).all():
            bulk = Quadratic(inner)
        else:
            kept = contact.seen
            bulk = MixedBulk.of(inner, force, kept)
            force, work = bulk.reduced()
            constant -= 0.5 * work
            contact = replace(contact, trace=sp.csr_array(contact.trace[:, kept]))
        _refuse_dependent(contact.trace, self.at)
        where = np.asarray(contact.points)
        if shown is not None:
            contact = replace(contact, node=nearest_nodes(shown, where))
        warning = friction_warning(where[contact.without_friction])
        space = None if shown is None else Space((shown,))
        model, loading = Model(bulk, contact, space), Loading(force, offset, law, constant)
        return DiscreteProblem(model, loading, () if warning is None else (warning,))

    def force(self, time: float | None) -> Array:
        """The load at a time, on all unknowns of the basis (N,)."""
        if time is None or self.factor is None:
            return self.body._loads
        return _finite(self.factor(time), f"factor at t = {time:g}") * self.body._loads

    def acting(self, time: float) -> tuple[Array, Array, Array, VectorLaw, dict[str, Contact]]:
        """The load (N,), what supports prescribe (N,), offsets (m, c), law and contacts at a time."""
        values = self.body._prescribed(time)[1]
        _, offset, law, _ = self._contact_at(time, values)
        return self.force(time), values, offset, law, self._contacts(time)

    def family(self, problem: DiscreteProblem, inertia: bool) -> tuple[OperatorFamily, IntArray]:
        """The matrices in time of :meth:`starting`, and the unknowns of the basis that supports move.

        Raises
        ------
        ProblemError
            A mass or viscosity is not symmetric, or negative.
        """
        body = self.body
        fixed = body._fixed
        moving = fixed if "supports" in self.time_dependent else fixed & (body._prescribed(0.0)[1] != 0.0)
        dofs = np.flatnonzero(moving)
        stated = {"form": body._matrix, **body._in_time}
        names = [name for name in stated if inertia or name != "mass"]
        matrices = _on_one_sparsity([stated[name] for name in names])
        for name, matrix in zip(names, matrices, strict=True):
            if name != "form" and (matrix.diagonal() < 0.0).any():
                raise ProblemError(f"the {name} of the body has negative numbers on its diagonal; change its sign")
        operators = {
            name: Operator(*(sp.csr_array(part) for part in _parts(matrix, body.free, dofs)))
            for name, matrix in zip(names, matrices, strict=True)
        }
        assert problem.field is not None
        rows = rows_of(body.basis, problem.field)[dofs]
        return OperatorFamily(
            problem, operators["form"], operators.get("viscosity"), operators.get("mass"), (), rows
        ), dofs

    def _contacts(self, time: float | None) -> dict[str, Contact]:
        return {name: contact if time is None else contact.at_time(time) for name, contact in self.contact.items()}

    def _contact_at(self, time: float | None, values: Array) -> tuple[ContactPoints, Array, VectorLaw, float]:
        """What :func:`join` makes of the contacts at a time, where supports prescribe values (N,)."""
        contacts, free = self._contacts(time), self.body.free
        chosen = sp.csr_array((np.ones(free.size), (free, np.arange(free.size))), shape=(values.size, free.size))
        groups = [seen.at(name, contacts[name]) for name, seen in self._touching.items()]
        return join(groups, chosen, values)

    def _seen(self, name: str, contact: Contact) -> TraceRows:
        if not isinstance(contact, Contact):
            raise ProblemError(f"contact['{name}'] is {described(contact)}; give a hemivar.Contact")
        if contact.obstacle is not None or contact.against or callable(contact.belt) or np.any(contact.belt):
            raise ProblemError(f"contact['{name}']: a body of forms takes laws and a gap; leave the others out")
        basis = self.body.basis
        mesh, facets = basis.mesh, None
        if name not in (mesh.subdomains or {}) or name in (mesh.boundaries or {}):
            facets = self.body.facets(name, "contact")
            if (np.asarray(mesh.f2t)[1, facets] >= 0).any():
                raise ProblemError(f"contact['{name}'] has facets inside of the mesh; name facets of its boundary")
        elif not len(mesh.subdomains[name]):
            raise ProblemError(f"contact names region '{name}', which has no cells; name another one")
        rows = rows_on(basis, name, facets, self.trace, self.at)
        if not sp.csr_array(rows.rows[:, self.body.free]).count_nonzero():
            raise ProblemError(f"contact['{name}']: supports hold all of its points; leave it out")
        return rows


def _check_basis(basis: ScikitFem) -> None:
    if not isinstance(basis, skfem.CellBasis) or isinstance(basis, skfem.FacetBasis):
        raise ProblemError(f"basis is {described(basis)}; give a skfem.Basis(mesh, element)")
    if basis.nelems != basis.mesh.nelements:
        raise ProblemError(
            f"basis has {basis.nelems} of the {basis.mesh.nelements} cells of its mesh; give one of all its cells: "
            "skfem.Basis(mesh.restrict(cells), element)"
        )
    if getattr(basis, "doflocs", None) is None:
        raise ProblemError("basis does not know the places of its unknowns; make it without disable_doflocs=True")


class _FixedUnknowns:
    """Unknowns of a basis that are held, accumulated support by support; nan is a value that is not known yet."""

    def __init__(self, basis: ScikitFem) -> None:
        self.basis = basis
        self.fixed, self.values = np.zeros(int(basis.N), dtype=bool), np.zeros(int(basis.N))
        self.owner, self.names = np.zeros(int(basis.N), dtype=np.int64), [""]

    def fix(self, numbers: IntArray, name: str, values: Array) -> None:
        """Hold unknowns (k,) at values (k,); refuse other ones than those of a support before."""
        apart = np.where(self.fixed[numbers], np.abs(values - self.values[numbers]), 0.0)
        largest = max(float(np.nanmax(np.abs(part), initial=0.0)) for part in (values, self.values))
        conflict = np.flatnonzero(apart > SAME * largest)
        if conflict.size:
            first = int(numbers[conflict[0]])
            raise SupportError(
                f"{self.names[self.owner[first]]} and {name} prescribe different values of unknown {first}, x = "
                f"{in_words(self.basis.doflocs[:, first])}: they differ by {apart[conflict[0]]:.3g}; make them agree "
                "there or free one of them"
            )
        self.owner[numbers] = len(self.names)
        self.names.append(name)
        self.fixed[numbers], self.values[numbers] = True, values


def _unknowns(dofs: ScikitFem, name: str, part: str) -> IntArray:
    """The numbers of unknowns of a name on a boundary."""
    numbers = np.asarray(dofs.all([part]) if part else dofs.all())
    if not numbers.size:
        raise ProblemError(f"supports['{name}']: there are no unknowns '{part}' on this boundary")
    return numbers.astype(np.int64)


def _numbers(fixed: object, count: int) -> IntArray:
    """Numbers of unknowns that a user gave."""
    if np.size(np.asarray(fixed, dtype=object)) == 0:
        return np.zeros(0, dtype=np.int64)
    given = real_array(fixed, "fixed", 1)
    if (given != np.floor(given)).any():
        raise ProblemError(f"fixed holds {given[given != np.floor(given)][0]:g}; give numbers of unknowns: [0, 3]")
    beyond = given[(given < 0) | (given >= count)]
    if beyond.size:
        raise ProblemError(f"fixed names unknown {beyond[0]:.0f}; the basis has the unknowns 0 to {count - 1}")
    return np.unique(given.astype(np.int64))


def _one_each(known: object, count: int, what: str) -> Array:
    """Prescribed values (count,), of one number or of so many."""
    values = real_array(known, what)
    if values.shape not in ((), (1,), (count,)):
        raise ProblemError(
            f"{what} prescribes an array of shape {values.shape} for {count} unknowns; give a number, or a function of "
            f"their places, shape (d, {count})"
        )
    return np.broadcast_to(values, (count,))


def _finite(value: object, name: str) -> float:
    finite = number(value, name)
    if not np.isfinite(finite):
        raise ProblemError(f"{name} is {finite}; it must be finite")
    return finite


def _on_one_sparsity(matrices: Sequence[sp.csr_array]) -> list[sp.csr_array]:
    """The same matrices, each with an entry wherever one of them has one."""
    parts = [matrix.tocoo() for matrix in matrices]
    places = tuple(np.concatenate([getattr(part, axis) for part in parts]) for axis in ("row", "col"))
    alike = []
    for own, part in enumerate(parts):
        data = np.concatenate([part.data if k == own else np.zeros(other.nnz) for k, other in enumerate(parts)])
        alike.append(sp.csr_array(sp.coo_array((data, places), shape=part.shape)))
        alike[-1].sort_indices()
    return alike


def _parts(matrix: sp.csr_array, free: IntArray, moved: IntArray) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    return matrix[free][:, free], matrix[free][:, moved], matrix[moved][:, moved]


def _refuse_dependent(trace: sp.csr_array, at: str | int) -> None:
    """Each contact point needs a displacement of its own."""
    rows = sp.csr_array(trace[np.flatnonzero(np.diff(trace.indptr))])
    if not rows.shape[0] or rows.shape[0] > _EXAMINED:
        return
    values = np.linalg.eigvalsh((rows @ rows.T).toarray())
    missing = int(np.count_nonzero(values < NULL * values[-1]))
    if missing:
        remedy = (
            "separate boundaries and regions that share nodes"
            if at == "nodes"
            else "write at='nodes', or a rule of lower degree, at=1"
        )
        raise ProblemError(
            f"the displacements of the contact points depend on one another ({missing} of {len(values)} rows of the "
            f"trace); {remedy}"
        )


def of_forms(
    basis: ScikitFem,
    form: ScikitFem,
    *,
    load: ScikitFem = None,
    supports: Mapping[str, Prescription] | None = None,
    fixed: Sequence[int] | IntArray = (),
    contact: Mapping[str, Contact] | None = None,
    trace: TraceOf | None = None,
    at: str | int = "nodes",
) -> DiscreteProblem:
    """:meth:`FormBody.problem` in one call."""
    return FormBody(basis, form, load, {} if supports is None else supports, fixed).problem(
        {} if contact is None else contact, trace, at
    )
