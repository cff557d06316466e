"""A body by any basis and form of scikit-fem: supports, contact at nodes or quadrature points, mixed bodies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
import skfem

from hemivar.basics.arguments import described, expect, suggest
from hemivar.basics.first_use import IMPORTS, cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.basics.units import Units
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.operator_family import OperatorFamily
from hemivar.discrete.operators import Operator
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Space
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import _frames
from hemivar.fem.form_field import ScikitFem, form_field, nearest_nodes, rows_of
from hemivar.laws import ContactLaw, VectorLaw, join_laws
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.instants import at_time, depends_on_time

__all__ = ["FormBody", "FormProblem", "MixedBulk", "of_forms"]

#: Newton-Cotes rules at the nodes of order 1 and 2: places in the reference cell of scikit-fem, and weights.
_NODES = {
    ("line", 1): ([[0.0], [1.0]], [1 / 2, 1 / 2]),
    ("line", 2): ([[0.0], [1.0], [0.5]], [1 / 6, 1 / 6, 4 / 6]),
    ("tri", 1): ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [1 / 6, 1 / 6, 1 / 6]),
    ("quad", 1): ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [1 / 4, 1 / 4, 1 / 4, 1 / 4]),
    ("quad", 2): (
        [[x, y] for y in (0.0, 0.5, 1.0) for x in (0.0, 0.5, 1.0)],
        [p * q for q in (1 / 6, 4 / 6, 1 / 6) for p in (1 / 6, 4 / 6, 1 / 6)],
    ),
    ("tet", 1): ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [1 / 24] * 4),
}
#: Words of scikit-fem's reference cells.
_SHAPES = {"RefLine": "line", "RefTri": "tri", "RefQuad": "quad", "RefTet": "tet", "RefHex": "hex"}
#: The middle of each reference cell, and its measure.
_MIDDLE = {
    "line": ([[0.5]], [1.0]),
    "tri": ([[1 / 3, 1 / 3]], [1 / 2]),
    "quad": ([[0.5, 0.5]], [1.0]),
    "tet": ([[0.25, 0.25, 0.25]], [1 / 6]),
    "hex": ([[0.5, 0.5, 0.5]], [1.0]),
}
#: Share of the size of the mesh below which two places are one, and of the largest eigenvalue that counts as none.
_SAME, _DEPENDENT = 1e-9, 1e-10
#: Size of a solution, relative to the load and the matrix, from which the matrix is singular up to rounding.
_SINGULAR = 1e13
#: Rounds of scaling rows and columns, of which each takes the square root of what is left.
_SCALINGS = 8
#: Right sides solved at a time.
_COLUMNS = 64
#: Most rows of a trace whose rank is examined.
_EXAMINED = 4000

#: What is prescribed on a boundary: one value of all unknowns there, a function of places (d, k), or one of either for
#: the unknowns of each name of scikit-fem, such as ``{"u^2": 0.0}``.
Prescription = float | Callable[[Array], Array] | Mapping[str, float | Callable[[Array], Array]]
#: What touches a foundation: of the fields of a basis function, one after the other, those that are displaced.
TraceOf = Callable[..., object]


@dataclass(frozen=True, eq=False)
class MixedBulk(Quadratic):
    """A body with constraints, ``[[A, D'], [D, -S]]``, condensed to the unknowns that contact sees.

    Its energy is the least ``1/2 u'A u - f'u`` under ``D u = g``, or with the compliance S of the constraints.  What is
    left after the factorisation of the whole symmetric indefinite matrix apart from the kept unknowns is a dense
    stiffness on these, which must be positive definite: it is so where A is on the kernel of D.

    Attributes
    ----------
    kept : int array (k,)
        The unknowns of the body that are left.
    others : int array (n - k,)
    coupling : sparse array (n - k, k)
        Rows of the others, columns of the kept ones.
    load : array (n,)
        Of the whole body.
    inner : sparse array (n - k, n - k)
        Of the others.
    """

    kept: IntArray = field(kw_only=True)
    others: IntArray = field(kw_only=True)
    coupling: sp.csr_array = field(kw_only=True)
    load: Array = field(kw_only=True)
    inner: sp.csc_array = field(kw_only=True)

    @staticmethod
    def of(matrix: sp.csr_array, load: Array, kept: IntArray) -> MixedBulk:
        """Of a symmetric matrix; raises ProblemError: contact unknowns are not stiff, or the others do not follow."""
        others = np.setdiff1d(np.arange(matrix.shape[0]), kept)
        inner, coupling = sp.csc_array(matrix[others][:, others]), sp.csr_array(matrix[others][:, kept])
        factor = _factorised(inner)
        schur = matrix[kept][:, kept].toarray()
        for start in range(0, kept.size, _COLUMNS):
            part = slice(start, start + _COLUMNS)
            schur[:, part] -= coupling.T @ factor.solve(coupling[:, part].toarray())
        schur = 0.5 * (schur + schur.T)
        values = np.linalg.eigvalsh(schur)
        least = float(values.min(initial=np.inf))
        if least < -_DEPENDENT * float(values.max(initial=0.0)):
            raise ProblemError(
                f"with its constraints the body has the stiffness {least:.3g} in some direction of the contact "
                "unknowns; the first block must not be negative where the constraints hold"
            )
        found = MixedBulk(
            sp.csr_array(schur), kept=kept, others=others, coupling=coupling, load=np.asarray(load), inner=inner
        )
        vars(found)["factor"] = factor  # it is there already
        return found

    @cached_property
    def factor(self) -> _Factor:
        """The factors of the matrix of the others, with pivots by size, for it is indefinite."""
        return _factorised(self.inner)

    def reduced(self) -> tuple[Array, float]:
        """The load of the kept unknowns (k,), and the work of that of the others."""
        inner = self.load[self.others]
        alone = self.factor.solve(inner)
        return self.load[self.kept] - self.coupling.T @ alone, float(inner @ alone)

    def extend(self, kept: Array) -> Array:
        """All unknowns (n,) of the kept ones (k,), under the stated load."""
        found = np.empty(self.load.size)
        found[self.kept] = kept
        found[self.others] = self.factor.solve(self.load[self.others] - self.coupling @ kept)
        return found


@dataclass(frozen=True, eq=False)
class _Factor:
    """The factors of ``S A S``, of a symmetric matrix A and a diagonal one S, with pivots by size."""

    scales: Array  # (n,)
    inner: spla.SuperLU

    def solve(self, right: Array) -> Array:
        """``A^-1 right``, for (n,) or (n, k)."""
        scales = self.scales if right.ndim == 1 else self.scales[:, None]
        return np.asarray(scales * self.inner.solve(scales * right))


def _scales(matrix: sp.sparray) -> Array:
    """Positive numbers (n,) with which ``s_i |a_ij| s_j`` is about 1 at most in each row (Ruiz 2001).

    Unknowns of several units, such as mm and V, then have entries of one size.
    """
    found = np.ones(matrix.shape[0])
    for _ in range(_SCALINGS):
        largest = abs(_scaled(matrix, found)).max(axis=1).toarray().ravel()
        found /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return found


def _scaled(matrix: sp.sparray, scales: Array) -> sp.csr_array:
    return sp.csr_array(sp.diags_array(scales) @ matrix @ sp.diags_array(scales))


def _factorised(matrix: sp.csc_array) -> _Factor:
    """The factors of a symmetric indefinite matrix; raises ProblemError: it is singular."""
    singular = ProblemError(
        "the constraints do not determine the body apart from its contact: fix a pressure with fixed=, or add a "
        "support. Leave out a constraint that is stated twice; take elements that are stable together (P2, P1)"
    )
    scales = _scales(matrix)
    scaled = sp.csc_array(_scaled(matrix, scales))
    try:
        factor = spla.splu(scaled)
    except RuntimeError:
        raise singular from None
    probe = np.cos(np.arange(matrix.shape[0], dtype=float))
    size = float(abs(scaled).sum(axis=0).max(initial=0.0)) * float(np.abs(factor.solve(probe)).max(initial=0.0))
    if not size < _SINGULAR:
        raise singular
    return _Factor(scales, factor)


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
    _held: BoolArray = field(init=False, repr=False)
    _values: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.basis, skfem.CellBasis) or isinstance(self.basis, skfem.FacetBasis):
            raise ProblemError(f"basis is {described(self.basis)}; give a skfem.Basis(mesh, element)")
        count = int(self.basis.N)
        load = (
            np.zeros(count) if self.load is None else np.asarray(self._assembly("load", skfem.LinearForm), dtype=float)
        )
        if load.shape != (count,):
            raise ProblemError(f"load has shape {load.shape}; give a skfem.LinearForm, or an array of shape ({count},)")
        _refuse_infinite(load, "load")
        expect(self.supports, Mapping, "supports", "give what is prescribed by the name of a boundary")  # type: ignore[type-abstract]
        held, values = self._prescribed()
        object.__setattr__(self, "_matrix", self._assembled("form"))
        given = [name for name in ("mass", "viscosity") if getattr(self, name) is not None]
        object.__setattr__(self, "_in_time", {name: self._assembled(name) for name in given})
        object.__setattr__(self, "_loads", load)
        object.__setattr__(self, "_held", held)
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
        return np.flatnonzero(~self._held)

    def _assembly(self, name: str, kind: type[ScikitFem]) -> ScikitFem:
        """What a form, an array or a matrix of this name is on the basis."""
        form = getattr(self, name)
        if not isinstance(form, kind):
            return form
        try:
            return form.assemble(self.basis)
        except (ValueError, TypeError, IndexError, AttributeError) as error:
            raise ProblemError(
                f"{name} cannot be assembled on this basis ({error}); give a form of the fields of its element"
            ) from error

    def _assembled(self, name: str) -> sp.csr_array:
        matrix, count = self._assembly(name, skfem.BilinearForm), int(self.basis.N)
        shape = getattr(matrix, "shape", None)
        if shape != (count, count):
            what = described(getattr(self, name)) if shape is None else f"a matrix of shape {shape}"
            raise ProblemError(
                f"{name} is {what}; give a skfem.BilinearForm, or a matrix of shape ({count}, {count}) on this basis"
            )
        found = sp.csr_array(matrix)
        _refuse_infinite(found.data, name)
        _refuse_skew(found, name)
        return found

    def _prescribed(self, time: float | None = None) -> tuple[BoolArray, Array]:
        count = int(self.basis.N)
        held, values = np.zeros(count, dtype=bool), np.zeros(count)
        for name, parts in self.stated():
            dofs = self.basis.get_dofs(self.facets(name, "supports"))
            for part, value in parts.items():
                numbers = np.asarray(dofs.all([part]) if part else dofs.all())
                if not numbers.size:
                    raise ProblemError(f"supports['{name}']: there are no unknowns '{part}' on this boundary")
                held[numbers] = True
                if depends_on_time(value):
                    value = 0.0 if time is None else at_time(value, time)
                known = value(self.basis.doflocs[:, numbers]) if callable(value) else value
                values[numbers] = _one_each(known, numbers.size, name, part)
        further = np.asarray(self.fixed)
        if further.size and further.dtype.kind not in "iu":
            raise ProblemError(f"fixed is {described(self.fixed)}; give numbers of unknowns, such as [0, 3]")
        further = further.astype(np.int64)
        beyond = further[(further < 0) | (further >= count)]
        if beyond.size:
            raise ProblemError(f"fixed names unknown {beyond[0]}; the basis has the unknowns 0 to {count - 1}")
        held[further] = True
        return held, values

    def stated(self) -> Iterator[tuple[str, Mapping[str, object]]]:
        """What supports prescribe, by boundary and by the name of unknowns, empty for all of them."""
        for name, stated in self.supports.items():
            yield name, stated if isinstance(stated, Mapping) else {"": stated}

    def facets(self, name: str, where: str) -> IntArray:
        """Numbers of the facets of a boundary that is named somewhere."""
        known = self.basis.mesh.boundaries or {}
        if name not in known:
            near = suggest(str(name), list(known), "boundaries")
            raise ProblemError(f"{where} names boundary '{name}', which the mesh of the basis does not have{near}")
        return np.asarray(known[name], dtype=np.int64)

    def full(self, problem: DiscreteProblem, unknowns: Array) -> Array:
        """All unknowns of the basis (N,) of those of a solution of the problem that :meth:`problem` made.

        Raises
        ------
        ProblemError
            A mixed body has another load than the stated one.
        """
        values, bulk = self._values.copy(), problem.bulk
        if isinstance(bulk, MixedBulk):
            stated = bulk.reduced()[0]
            if np.abs(problem.load - stated).max(initial=0.0) > 1e-9 * np.abs(stated).max(initial=0.0):
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
    _rows: Mapping[str, tuple[_Rows, bool]] = field(init=False, repr=False)

    @property
    def material(self) -> FormBody:
        """The body, which answers what the material of a :class:`hemivar.ContactProblem` does."""
        return self.body

    def __post_init__(self) -> None:
        expect(self.body, FormBody, "the body of a problem of forms", "give a hemivar.fem.FormBody(basis, form)")
        expect(self.contact, Mapping, "contact", "give a hemivar.Contact by the name of a boundary or a region")  # type: ignore[type-abstract]
        if self.trace is not None and not callable(self.trace):
            raise ProblemError(f"trace is {described(self.trace)}; give a function of the fields, such as lambda u: u")
        if self.at != "nodes" and not (type(self.at) is int and self.at >= 0):
            raise ProblemError(f"at = {self.at!r}; choose 'nodes', or the degree of a rule of quadrature")
        rows = {name: self._seen(name, one) for name, one in self.contact.items()}
        if not rows:
            raise ProblemError("contact is empty; name a boundary or a region that touches a foundation")
        if len({seen.components for seen, _ in rows.values()}) > 1:
            raise ProblemError("the contacts have different numbers of components; state one problem for each")
        object.__setattr__(self, "_rows", rows)

    @cached_property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: of "load", "supports", "gap" and "law"."""
        prescribed = [one for _, parts in self.body.stated() for one in parts.values()]
        found = {"load"} if self.factor is not None else set()
        found |= {"supports"} if any(map(depends_on_time, prescribed)) else set()
        return frozenset(found.union(*(one.time_dependent for one in self.contact.values())))

    @cached_property
    def discrete(self) -> DiscreteProblem:
        """At rest.

        Raises
        ------
        ProblemError
            It depends on time, or the form does not fit the contact.
        """
        for name, one in self.contact.items():
            if one.memory is not None or one.damping is not None:
                raise ProblemError(
                    f"contact['{name}'] has memory or damping, which means something in time only; leave it out"
                )
        if self.time_dependent:
            raise ProblemError(f"{', '.join(sorted(self.time_dependent))} depend on time; give it to hemivar.Evolution")
        return self._posed(None)

    def starting(self, time: float) -> DiscreteProblem:
        """The elastic body at a time, for a march.

        Raises
        ------
        ProblemError
            The unknowns are no displacements of nodes.
        """
        found = self._posed(time)
        if found.field is None or found.field.partial:
            raise ProblemError(
                "a body in time needs its displacement at nodes; take Lagrange elements of order 1 or 2, without a "
                "multiplier"
            )
        return found

    def places(self, time: float) -> tuple[Array, int]:
        """The nodes (k, d) of the displacement and its components."""
        field = self.starting(time).field
        assert field is not None
        return field.nodes, field.components

    def _posed(self, time: float | None) -> DiscreteProblem:
        body, matrix, free = self.body, self.body._matrix, self.body.free
        values = body._values if time is None else body._prescribed(time)[1]
        parts, offset = self._touching(time, values)
        held = matrix @ values
        load = self.force(time)
        rows = sp.csr_array(sp.vstack([part.rows for part in parts]))
        inner, force = sp.csr_array(matrix[free][:, free]), load[free] - held[free]
        seen, constant = sp.csr_array(rows[:, free]), 0.5 * float(values @ held) - float(values @ load)
        diagonal = inner.diagonal()
        if diagonal.size and (diagonal <= 0.0).all():
            raise ProblemError("the form is nowhere positive on the diagonal; state an energy, or change its sign")
        bulk, shown = (
            Quadratic(inner) if (diagonal > 0.0).all() else None,
            form_field(body.basis, free, values),
        )
        if bulk is None:
            kept = np.unique(seen.indices).astype(np.int64)
            bulk, shown = MixedBulk.of(inner, force, kept), None
            force, work = bulk.reduced()
            constant -= 0.5 * work
            seen = sp.csr_array(seen[:, kept])
        _refuse_dependent(seen)
        where = np.concatenate([part.points for part in parts])
        points = ContactPoints(
            seen,
            np.concatenate([part.weights for part in parts]),
            where,
            None if offset.shape[1] == 1 else np.concatenate([part.frames for part in parts]),
            node=np.full(len(where), -1) if shown is None else nearest_nodes(shown, where),
            boundary=np.repeat(np.arange(len(parts)), [len(part.weights) for part in parts]),
            names=tuple(self.contact),
            components=offset.shape[1],
        )
        space = None if shown is None else Space((shown,))
        return DiscreteProblem(Model(bulk, points, space), Loading(force, offset, _joined(parts), constant))

    def force(self, time: float | None) -> Array:
        """The load at a time, on all unknowns of the basis (N,)."""
        factor = 1.0 if time is None or self.factor is None else float(self.factor(time))
        return factor * self.body._loads

    def acting(self, time: float) -> tuple[Array, Array, Array, VectorLaw, dict[str, Contact]]:
        """The load (N,), what supports prescribe (N,), offsets (m, c), law and contacts at a time."""
        values = self.body._prescribed(time)[1]
        parts, offset = self._touching(time, values)
        return self.force(time), values, offset, _joined(parts), self._contacts(time)

    def family(self, problem: DiscreteProblem, inertia: bool) -> tuple[OperatorFamily, IntArray]:
        """The matrices in time of :meth:`starting`, and the unknowns of the basis that supports move.

        Raises
        ------
        ProblemError
            A mass or viscosity is not symmetric, or negative.
        """
        body = self.body
        held = body._held
        moving = held if "supports" in self.time_dependent else held & (body._prescribed(0.0)[1] != 0.0)
        dofs = np.flatnonzero(moving)
        stated = {"form": body._matrix, **body._in_time}
        names = [name for name in stated if inertia or name != "mass"]
        matrices = _on_one_sparsity([stated[name] for name in names])
        for name, matrix in zip(names, matrices, strict=True):
            if name != "form" and (matrix.diagonal() < 0.0).any():
                raise ProblemError(f"the {name} of the body has negative numbers on its diagonal; change its sign")
        found = {
            name: Operator(*(sp.csr_array(part) for part in _parts(matrix, body.free, dofs)))
            for name, matrix in zip(names, matrices, strict=True)
        }
        assert problem.field is not None
        rows = rows_of(body.basis, problem.field)[dofs]
        return OperatorFamily(problem, found["form"], found.get("viscosity"), found.get("mass"), (), rows), dofs

    def _contacts(self, time: float | None) -> dict[str, Contact]:
        return {name: one if time is None else one.at_time(time) for name, one in self.contact.items()}

    def _touching(self, time: float | None, values: Array) -> tuple[list[_Touching], Array]:
        """Contact points of each contact at a time, and their offsets with what supports prescribe (N,)."""
        contacts = self._contacts(time)
        parts = [seen.stated(name, contacts[name], area) for name, (seen, area) in self._rows.items()]
        moved = [np.asarray(part.rows @ values).reshape(part.offset.shape) for part in parts]
        return parts, np.concatenate([part.offset - own for part, own in zip(parts, moved, strict=True)])

    def _seen(self, name: str, contact: Contact) -> tuple[_Rows, bool]:
        if not isinstance(contact, Contact):
            raise ProblemError(f"contact['{name}'] is {described(contact)}; give a hemivar.Contact")
        if contact.obstacle is not None or contact.against or callable(contact.belt) or np.any(contact.belt):
            raise ProblemError(f"contact['{name}']: a body of forms takes laws and a gap; leave the others out")
        basis, at = self.body.basis, self.at
        mesh = basis.mesh
        regions = mesh.subdomains or {}
        area = name in regions and name not in (mesh.boundaries or {})
        order = _order_of(basis.elem)
        if area:
            where: dict[str, object] = {"elements": regions[name]}
            shape, kind, middle = _shape(mesh.refdom, name), skfem.CellBasis, basis.elem.interior_dofs
        else:
            facets = self.body.facets(name, "contact")
            if (np.asarray(mesh.f2t)[1, facets] >= 0).any():
                raise ProblemError(f"contact['{name}'] has facets inside of the mesh; name facets of its boundary")
            where, middle = {"facets": facets}, basis.elem.facet_dofs
            shape, kind = _shape(mesh.brefdom, name), skfem.FacetBasis
        serendipity = shape == "quad" and order == 2 and not middle
        if at == "nodes" and (serendipity or (shape, order) not in _NODES):
            raise ProblemError(
                f"contact['{name}']: elements of order {order} have no positive weights at the nodes of a {shape}; "
                "write at=1, for one point on each"
            )
        if isinstance(at, int) and at > 1:
            where["intorder"] = at
        else:
            places, weights = _NODES[shape, order] if at == "nodes" else _MIDDLE[shape]
            where["quadrature"] = np.array(places).T, np.array(weights)
        local = kind(mesh, basis.elem, mapping=basis.mapping, **where)
        found = _rows(local, self.trace, name)
        if not (found.weights > 0.0).all():
            raise ProblemError(f"contact['{name}']: the rule of degree {at} has negative weights; take another degree")
        if at == "nodes":
            found = found.merged(_SAME * float(np.ptp(mesh.p, axis=1).max()))
        moving = found.moving(self.body.free)
        if not moving.any():
            raise ProblemError(f"contact['{name}']: supports hold all of its points; leave it out")
        return found.take(moving), area


def _joined(parts: Sequence[_Touching]) -> VectorLaw:
    return join_laws([(part.law, len(part.weights)) for part in parts])


def _one_each(known: object, count: int, name: str, part: str) -> Array:
    """Prescribed values (count,), of one number or of so many."""
    what = f"supports['{name}']" + (f"['{part}']" if part else "")
    try:
        found = np.broadcast_to(np.asarray(known, dtype=float), (count,))
    except (TypeError, ValueError):
        raise ProblemError(
            f"{what} prescribes {described(known)} for {count} unknowns; give a number, or a function of their places, "
            f"shape (d, {count})"
        ) from None
    _refuse_infinite(found, what)
    return found


def _refuse_infinite(values: Array, name: str) -> None:
    if not np.isfinite(values).all():
        raise ProblemError(f"{name} has numbers that are not finite; give finite ones")


def _refuse_skew(matrix: sp.csr_array, name: str) -> None:
    if np.abs(_scaled(matrix - matrix.T, _scales(matrix)).data).max(initial=0.0) > _DEPENDENT:
        raise ProblemError(
            f"the {name} of the body is not symmetric; give one with a(u, v) = a(v, u), as a mixed "
            "body has [[A, D'], [D, -S]]"
        )


def _on_one_sparsity(matrices: Sequence[sp.csr_array]) -> list[sp.csr_array]:
    """The same matrices, each with an entry wherever one of them has one."""
    parts = [matrix.tocoo() for matrix in matrices]
    places = tuple(np.concatenate([getattr(part, axis) for part in parts]) for axis in ("row", "col"))
    found = []
    for number, part in enumerate(parts):
        data = np.concatenate([part.data if k == number else np.zeros(one.nnz) for k, one in enumerate(parts)])
        found.append(sp.csr_array(sp.coo_array((data, places), shape=part.shape)))
        found[-1].sort_indices()
    return found


def _parts(matrix: sp.csr_array, free: IntArray, moved: IntArray) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    return matrix[free][:, free], matrix[free][:, moved], matrix[moved][:, moved]


@dataclass(frozen=True, eq=False)
class _Rows:
    """What touches at m places, component by component, before the normals are chosen."""

    rows: sp.csr_array  # (m * c, N)
    weights: Array  # (m,)
    points: Array  # (m, d)
    normals: Array | None  # (m, d)

    @property
    def components(self) -> int:
        return int(self.rows.shape[0]) // len(self.weights)

    def moving(self, free: IntArray) -> BoolArray:
        """Which points some free unknown displaces, (m,)."""
        touched = np.diff(sp.csr_array(self.rows[:, free]).indptr) > 0
        return np.asarray(touched.reshape(-1, self.components).any(axis=1))

    def take(self, chosen: BoolArray) -> _Rows:
        """Some of the points."""
        normals = None if self.normals is None else self.normals[chosen]
        rows = sp.csr_array(self.rows[np.repeat(chosen, self.components)])
        return _Rows(rows, self.weights[chosen], self.points[chosen], normals)

    def merged(self, near: float) -> _Rows:
        """Places that coincide are one; weights are added, rows and normals are means by their weights."""
        with IMPORTS:
            from scipy.spatial import cKDTree

        together = cKDTree(self.points).query_pairs(near, output_type="ndarray")
        m = len(self.weights)
        graph = sp.csr_array((np.ones(len(together)), (together[:, 0], together[:, 1])), shape=(m, m))
        _, group = sp.csgraph.connected_components(graph, directed=False)
        _, first = np.unique(group, return_index=True)
        weights: Array = np.bincount(group, self.weights).astype(float)
        share = self.weights / weights[group]
        count, size = len(first), self.rows.shape[0] // len(self.weights)
        mean = sp.csr_array((share, (group, np.arange(len(group)))), shape=(count, len(group)))
        rows = sp.csr_array(sp.kron(mean, sp.eye_array(size)) @ self.rows)
        rows.data[np.abs(rows.data) < 1e-12 * np.abs(rows.data).max(initial=0.0)] = 0.0
        rows.eliminate_zeros()
        normals = None if self.normals is None else mean @ self.normals
        return _Rows(rows, weights, self.points[first], normals)

    def stated(self, name: str, contact: Contact, area: bool) -> _Touching:
        m, dim = len(self.weights), self.points.shape[1]
        size = self.rows.shape[0] // m
        gap = DataField(contact.gap, f"gap of contact '{name}'").at(self.points)
        if size == 1:
            if contact.friction.acts:
                raise ProblemError(
                    f"contact['{name}'] has friction, and one component touches; state its law as the normal one"
                )
            sign = -1.0 if contact.side is Side.BELOW else 1.0
            normal = ContactLaw(contact.normal).at(self.points)  # type: ignore[arg-type]
            return _Touching(sp.csr_array(sign * self.rows), self.weights, self.points, gap[:, None], normal, None)
        if area or self.normals is None or size != dim:
            raise ProblemError(
                f"contact['{name}']: {size} components touch over an area, or are not displacements; give trace=, "
                f"which "
                "returns one component"
            )
        frames = _frames(self.normals / np.linalg.norm(self.normals, axis=1)[:, None])
        offset = np.zeros((m, dim))
        offset[:, 0] = gap
        law = contact.law.at(self.points).in_frames(frames)
        return _Touching(sp.csr_array(_blocks(frames) @ self.rows), self.weights, self.points, offset, law, frames)


@dataclass(frozen=True, eq=False)
class _Touching:
    """The contact points of one boundary or region."""

    rows: sp.csr_array
    weights: Array
    points: Array
    offset: Array
    law: VectorLaw
    frames: Array | None


def _blocks(frames: Array) -> sp.csr_array:
    """The block diagonal matrix of (m, d, d)."""
    m, d, _ = frames.shape
    columns = np.broadcast_to(np.arange(m * d).reshape(m, 1, d), frames.shape)
    return sp.csr_array((frames.ravel(), columns.ravel(), np.arange(0, m * d * d + 1, d)), shape=(m * d, m * d))


def _first_field(first: ScikitFem, *others: ScikitFem) -> ScikitFem:
    return first


def _rows(local: ScikitFem, trace: TraceOf | None, name: str) -> _Rows:
    """The trace of every basis function at the points of a rule on cells or facets."""
    touching: TraceOf = _first_field if trace is None else trace
    try:
        values: list[Array] = [np.asarray(touching(*function), dtype=float) for function in local.basis]
    except (TypeError, ValueError, IndexError, AttributeError) as error:
        raise ProblemError(
            f"contact['{name}']: trace cannot be evaluated ({error}); give a function of the fields of the element"
        ) from error
    points = np.asarray(local.global_coordinates())
    dim, cells, places = points.shape
    shapes = {value.shape for value in values}
    if len(shapes) > 1 or values[0].shape[-2:] != (cells, places) or values[0].ndim > 3:
        raise ProblemError(
            f"contact['{name}']: trace returns arrays of shape {values[0].shape}; give shape ([c,] {cells}, {places})"
        )
    table = np.stack(values)  # (functions, [c], cells, places)
    table = table[:, None] if table.ndim == 3 else table
    functions, size = table.shape[:2]
    row = np.arange(cells * places * size).reshape(cells, places, size)
    at = np.broadcast_to(row[None], (functions, cells, places, size))
    columns = np.broadcast_to(np.asarray(local.element_dofs)[:, :, None, None], at.shape)
    entries = table.transpose(0, 2, 3, 1)
    matrix = sp.csr_array(
        sp.coo_array((entries.ravel(), (at.ravel(), columns.ravel())), shape=(row.size, int(local.N)))
    )
    matrix.eliminate_zeros()
    normals = getattr(local, "normals", None)
    outward = None if normals is None else np.asarray(normals).reshape(dim, -1).T
    return _Rows(matrix, np.asarray(local.dx).ravel(), points.reshape(dim, -1).T, outward)


def _order_of(elem: ScikitFem) -> int:
    """1 where values stand at vertices alone, 2 where also at edges."""
    names = list(elem.dofnames)
    inner = names[elem.nodal_dofs : elem.nodal_dofs + elem.facet_dofs + elem.edge_dofs]
    return 2 if any(not part.startswith("u_n") for part in inner) else 1


def _shape(reference: ScikitFem, name: str) -> str:
    """The word of a reference cell of scikit-fem."""
    if (found := _SHAPES.get(reference.__name__)) is None:
        raise ProblemError(
            f"contact['{name}']: contact on cells or facets like {reference.__name__} of scikit-fem is not known; take "
            "triangles, quadrilaterals, tetrahedra or hexahedra"
        )
    return found


def _refuse_dependent(trace: sp.csr_array) -> None:
    """Each contact point needs a displacement of its own."""
    rows = sp.csr_array(trace[np.flatnonzero(np.diff(trace.indptr))])
    if not rows.shape[0] or rows.shape[0] > _EXAMINED:
        return
    values = np.linalg.eigvalsh((rows @ rows.T).toarray())
    missing = int(np.count_nonzero(values < _DEPENDENT * values[-1]))
    if missing:
        raise ProblemError(
            f"the displacements of the contact points depend on one another ({missing} of {len(values)} rows of the "
            "trace); write at='nodes', or a rule of lower degree, at=1"
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
    return FormBody(basis, form, load, supports or {}, fixed).problem(contact or {}, trace, at)
