"""The discrete contact problem: what every solver and every certificate works on."""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_array, real_matrix
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw

if TYPE_CHECKING:
    from hemivar.mechanics.material import Material
    from hemivar.mechanics.statement import ContactProblem
    from hemivar.mesh.mesh import Mesh

__all__ = ["DiscreteProblem", "FieldMap", "friction_warning"]

_SYMMETRY_TOLERANCE = 1e-10
#: Contact points named in a warning.
_SHOWN = 8
#: Least work of a load against the diagonal stiffness, and the inverse of the largest one.
_LEAST_WORK = 1e-270


@dataclass(frozen=True, eq=False)
class FieldMap(Portable):
    """How the unknowns of a discrete problem become a displacement field.

    The full vector of nodal displacements is ``U = P u + u0``: the columns of ``P`` are orthonormal and span
    the free directions, ``u0`` holds the prescribed displacements. Entry ``node * d + component`` of ``U``
    belongs to one node and one Cartesian component. Nodes of a quadratic field (``order == 2``) are the
    vertices of the mesh followed by its edge midpoints, in the order of :attr:`Mesh.edges`.

    Attributes
    ----------
    mesh : Mesh
        The mesh the field lives on.
    order : int
        Polynomial degree of the elements, 1 or 2.
    basis : sparse array, shape (nodes * d, n)
        ``P``.
    prescribed : array, shape (nodes * d,)
        ``u0``, orthogonal to the columns of ``P``.
    material : Material or None
        The material, needed for stresses only.
    """

    mesh: Mesh
    order: int
    basis: sp.csr_array
    prescribed: Array
    material: Material | None = None

    def __post_init__(self) -> None:
        basis = real_matrix(self.basis, "the basis of the field map")
        prescribed = real_array(self.prescribed, "the prescribed displacements of the field map", 1)
        if basis.shape[0] != prescribed.size:
            raise ProblemError(
                f"the basis of the field map has {basis.shape[0]} rows; it needs one for each of the "
                f"{prescribed.size} prescribed displacements"
            )
        object.__setattr__(self, "basis", basis)
        object.__setattr__(self, "prescribed", prescribed)

    @property
    def dim(self) -> int:
        """Space dimension d."""
        return self.mesh.dim

    @property
    def number_of_nodes(self) -> int:
        """Number of displacement nodes (vertices, and edge midpoints if ``order == 2``)."""
        return len(self.prescribed) // self.mesh.dim

    @property
    def nodes(self) -> Array:
        """Coordinates of the displacement nodes, shape (nodes, d)."""
        return self.mesh.nodes(self.order)

    def displacement(self, unknowns: Array) -> Array:
        """Nodal displacement field of a vector of unknowns.

        Parameters
        ----------
        unknowns : array, shape (n,)

        Returns
        -------
        array, shape (nodes, d)
        """
        vector = real_array(unknowns, "the unknowns", finite=False)
        if vector.shape != (self.basis.shape[1],):
            raise ProblemError(
                f"the unknowns have shape {vector.shape}; this field map expects ({self.basis.shape[1]},)"
            )
        return np.asarray(self.basis @ vector + self.prescribed).reshape(-1, self.mesh.dim)

    def restrict(self, displacement: Array) -> Array:
        """Unknowns of a nodal displacement field: ``P' (U - u0)``.

        The result reproduces the field if it fulfils the supports, and is its orthogonal projection
        otherwise.

        Parameters
        ----------
        displacement : array, shape (nodes, d)

        Returns
        -------
        array, shape (n,)
        """
        field = real_array(displacement, "the displacement", finite=False)
        if field.shape != (self.number_of_nodes, self.mesh.dim):
            raise ProblemError(
                f"the displacement has shape {field.shape}; "
                f"this field map expects ({self.number_of_nodes}, {self.mesh.dim})"
            )
        return np.asarray(self.basis.T @ (field.ravel() - self.prescribed))


@dataclass(frozen=True, eq=False)
class DiscreteProblem(Portable):
    """Energy of a discrete contact problem.

    ``E(u) = 1/2 u'K u - f'u + sum_j w_j j_j(r_j) + constant``, ``r = (B u - offset)`` reshaped to (m, d):
    column 0 is the penetration of contact point j, the other columns its slip. A solution is a pair
    ``K u + B'W lambda = f``, ``lambda_j in dj_j(r_j)`` (Clarke subdifferential).

    Attributes
    ----------
    stiffness : sparse array, shape (n, n)
        ``K``, symmetric with positive diagonal. A dense array or any scipy sparse matrix is converted.
    load : array, shape (n,)
        ``f``.
    trace : sparse array, shape (d * m, n)
        ``B``; row ``j * d`` is the normal component (penetration positive) of contact point j, rows
        ``j * d + c``, c >= 1, its tangential components. Rows may be zero where a support fixes them.
    weights : array, shape (m,)
        Quadrature weights ``w_j > 0`` (lengths in 2D, areas in 3D).
    gap : array, shape (m,)
        Distance between body and foundation along the normal (less any prescribed displacement).
    law : ContactLaw
        The contact law with parameters resolved at the contact points.
    constant : float
        Energy that does not depend on the unknowns.
    slip_offset : array, shape (m, d - 1), or None
        Subtracted from the tangential components, as the gap is from the normal one.
    points : array, shape (m, d), or None
        Coordinates of the contact points.
    frames : array, shape (m, d, d), or None
        ``frames[j, c]`` is the unit vector of local component c; ``frames[j, 0]`` is the outward normal.
    field : FieldMap or None
        How to recover the displacement field.
    statement : ContactProblem or None
        What was discretised; the same on a coarser mesh serves multigrid.
    without_friction : bool array, shape (m,), or None
        Where friction of the law is left out, in one direction at least: at sharp corners of two contact boundaries,
        and where a support fixes a direction oblique to the contact normal.

    Raises
    ------
    ProblemError
        If shapes disagree, numbers are not finite, the stiffness is unsymmetric (relative to 1e-10) or has
        a diagonal entry that is not positive, or a weight is not positive.
    """

    _rebuilt: ClassVar[tuple[str, ...]] = ("_multigrid",)

    stiffness: sp.csr_array
    load: Array
    trace: sp.csr_array
    weights: Array
    gap: Array
    law: ContactLaw
    constant: float = 0.0
    slip_offset: Array | None = None
    points: Array | None = None
    frames: Array | None = None
    field: FieldMap | None = None
    statement: ContactProblem | None = None
    without_friction: BoolArray | None = None

    def __post_init__(self) -> None:
        stiffness = real_matrix(self.stiffness, "stiffness", own=True)
        if stiffness.shape[0] != stiffness.shape[1]:
            raise ProblemError(f"stiffness has shape {stiffness.shape}; it must be square")
        _check_symmetry(stiffness)
        object.__setattr__(self, "stiffness", stiffness)
        self._check()

    @classmethod
    def _assembled(cls, stiffness: sp.csr_array, load: Array, **rest: Any) -> DiscreteProblem:
        """A problem whose stiffness is known to be finite and symmetric; the other data are checked."""
        problem = object.__new__(cls)
        for name, value in {"stiffness": stiffness, "load": load, **rest}.items():
            object.__setattr__(problem, name, value)
        problem._check(own=False)
        return problem

    def _check(self, own: bool = True) -> None:
        """Check all but the symmetry of the stiffness, and store arrays of floats, read-only ones of its ``own``."""
        load = real_array(self.load, "load", 1, own=own)
        trace = real_matrix(self.trace, "trace", own=own)
        weights = real_array(self.weights, "weights", 1, own=own)
        gap = real_array(self.gap, "gap", 1, own=own)
        constant = real_array(self.constant, "constant", 0, finite=False)
        n, m = load.shape[0], weights.shape[0]
        if self.stiffness.shape != (n, n):
            raise ProblemError(
                f"stiffness has shape {self.stiffness.shape} but load has {n} entries; "
                f"give a stiffness of shape ({n}, {n})"
            )
        _check_diagonal(self.stiffness)
        if trace.shape[1] != n:
            raise ProblemError(f"trace has {trace.shape[1]} columns; it needs one per unknown, {n}")
        if m == 0 and trace.shape[0] != 0:
            raise ProblemError(f"trace has {trace.shape[0]} rows but weights is empty; give one weight per point")
        if m > 0 and (trace.shape[0] == 0 or trace.shape[0] % m != 0 or trace.shape[0] // m > 3):
            raise ProblemError(
                f"trace has {trace.shape[0]} rows for {m} contact points (as many as weights); "
                f"it needs d = 1, 2 or 3 rows per point: one normal, d - 1 tangential"
            )
        if not np.all(weights > 0):
            bad = int(np.flatnonzero(weights <= 0)[0])
            raise ProblemError(f"weights[{bad}] = {weights[bad]:g}; every weight must be positive")
        if gap.shape != (m,):
            raise ProblemError(f"gap has shape {gap.shape}; it needs one number per contact point, ({m},)")
        if not np.isfinite(constant):
            raise ProblemError(f"constant = {self.constant}; the constant part of the energy must be finite")
        for name, value in (
            ("load", load),
            ("trace", trace),
            ("weights", weights),
            ("gap", gap),
            ("constant", float(constant)),
        ):
            object.__setattr__(self, name, value)
        _check_size(self.stiffness, load)
        d = self.dim
        for name, shape in (("slip_offset", (m, d - 1)), ("points", None), ("frames", (m, d, d))):
            value = getattr(self, name)
            if value is None:
                continue
            array = real_array(value, name, 2 if name != "frames" else 3, own=own)
            if m > 0 and ((shape is not None and array.shape != shape) or array.shape[0] != m):
                expected = shape if shape is not None else (m, d)
                raise ProblemError(f"{name} has shape {array.shape}; it must be {expected}")
            object.__setattr__(self, name, array)
        if self.field is not None and self.field.basis.shape[1] != n:
            raise ProblemError(f"field has {self.field.basis.shape[1]} unknowns but load has {n}; they must agree")
        self._check_law(self.law)

    def _check_law(self, law: ContactLaw) -> None:
        remedy = "pass ContactLaw(normal, friction), resolved at the contact points"
        expect(law, ContactLaw, "the law of a discrete problem", remedy)
        if self.contact_points == 0:
            return
        start = -self.offset.reshape(self.contact_points, self.dim)
        with np.errstate(all="ignore"):
            try:
                value = np.asarray(law.frozen(start, np.zeros(start.shape)).value(start))
            except (ValueError, IndexError, TypeError) as error:
                if isinstance(error, ProblemError):
                    raise
                raise ProblemError(
                    f"the law cannot be evaluated at the {self.contact_points} contact points ({error}); "
                    f"resolve its parameters first: law.at(points)"
                ) from error
        if value.shape != (self.contact_points,):
            raise ProblemError(
                f"the law returns values of shape {value.shape} at {self.contact_points} contact points; "
                f"resolve its parameters at these points: law.at(points)"
            )

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.load.shape[0])

    @property
    def contact_points(self) -> int:
        """Number of contact points m."""
        return int(self.weights.shape[0])

    @property
    def dim(self) -> int:
        """Number d of local components per contact point: one normal and d - 1 tangential."""
        if self.contact_points > 0:
            return int(self.trace.shape[0]) // self.contact_points
        if self.field is not None:
            return self.field.dim
        if self.points is not None and np.ndim(self.points) == 2:
            return int(self.points.shape[1])
        return 2

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal of the stiffness, shape (n,)."""
        return np.asarray(self.stiffness.diagonal())

    @cached_property
    def row_sums(self) -> Array:
        """Sums of the absolute entries of the rows of the stiffness, shape (n,)."""
        K = self.stiffness
        sums = np.zeros(K.shape[0])
        for start in range(0, K.shape[0], 1 << 16):
            bounds = K.indptr[start : start + (1 << 16) + 1]
            part = np.abs(K.data[bounds[0] : bounds[-1]])
            sums[start : start + len(bounds) - 1] = np.add.reduceat(part, bounds[:-1] - bounds[0])
        return sums

    @property
    def offset(self) -> Array:
        """Gap and slip offset in the order of the rows of the trace, shape (d * m,)."""
        offset = np.zeros((self.contact_points, self.dim))
        offset[:, 0] = self.gap
        if self.slip_offset is not None and self.contact_points > 0:
            offset[:, 1:] = self.slip_offset
        return offset.ravel()

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on what results of this problem do not show by themselves; empty for most problems."""
        from hemivar.fem.locking import locking_warning

        found = None if self.field is None else locking_warning(self.field)
        left_out = None
        if self.without_friction is not None and self.points is not None:
            left_out = friction_warning(self.points[self.without_friction])
        return tuple(sentence for sentence in (found, left_out) if sentence is not None)

    def local(self, unknowns: Array) -> Array:
        """Penetration and slip at the contact points: ``r = B u - offset``.

        Parameters
        ----------
        unknowns : array, shape (n,)

        Returns
        -------
        array, shape (m, d)
            Column 0 penetration, columns 1.. slip.
        """
        u = real_array(unknowns, "the unknowns", finite=False)
        if u.shape != self.load.shape:
            raise ProblemError(f"the unknowns have shape {u.shape}; this problem has {self.load.shape}")
        return np.asarray(self.trace @ u - self.offset).reshape(self.contact_points, self.dim)

    def energy(self, unknowns: Array, multiplier: Array | None = None) -> float:
        """Energy ``E(u)`` of the unknowns, shape (n,), the constant included.

        A friction bound that depends on the state is taken at ``u`` itself and at the pressure of ``multiplier``,
        shape (m, d); without a multiplier, at the pressure nearest to zero that the normal law allows at ``u``.

        Where a law ends (a rigid foundation), a penetration beyond its end by rounding alone, 1e-12 of the largest
        displacement or gap, counts as being at the end; beyond that the energy is +inf.
        """
        u = real_array(unknowns, "the unknowns", finite=False)
        if u.shape != self.load.shape:
            raise ProblemError(f"the unknowns have shape {u.shape}; this problem has {self.load.shape}")
        energy = 0.5 * float(u @ (self.stiffness @ u)) - float(self.load @ u) + self.constant
        if self.contact_points > 0:
            r = self.local(u)
            domain = self.law.normal.domain
            moved = np.abs(self.trace) @ np.abs(u)  # what may cancel in r
            rounding = 1e-12 * max(float(moved.max()), float(np.abs(self.offset).max()))
            inside = np.clip(r[:, 0], domain.lower, domain.upper)
            r[:, 0] = np.where(np.abs(inside - r[:, 0]) <= rounding, inside, r[:, 0])
            law = self.law.frozen_at(r) if multiplier is None else self.law.frozen(r, multiplier)
            energy += float(self.weights @ law.value(r))
        return energy

    def contact_force(self, multiplier: Array) -> Array:
        """Nodal forces ``B' W lambda`` of a multiplier.

        Parameters
        ----------
        multiplier : array, shape (m, d)
            Pressure (column 0) and friction (columns 1..) of the foundation on the body.

        Returns
        -------
        array, shape (n,)
        """
        lam = real_array(multiplier, "the multiplier", finite=False)
        if lam.shape != (self.contact_points, self.dim):
            raise ProblemError(
                f"the multiplier has shape {lam.shape}; this problem has ({self.contact_points}, {self.dim})"
            )
        scaled = self.weights[:, None] * lam
        return np.asarray(self.trace.T @ scaled.ravel())

    def with_law(self, law: ContactLaw) -> DiscreteProblem:
        """The same problem with another law; matrices are shared and not checked again.

        Parameters
        ----------
        law : ContactLaw
            Resolved at the same contact points.
        """
        self._check_law(law)
        other = copy.copy(self)
        object.__setattr__(other, "law", law)
        return other

    def _with_data(self, load: Array, gap: Array, slip_offset: Array | None, law: ContactLaw) -> DiscreteProblem:
        """The same body under another load, gap and law; matrices are shared, their symmetry is not checked again."""
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        parts |= {"load": load, "gap": gap, "slip_offset": slip_offset, "law": law}
        return DiscreteProblem._assembled(**parts)


def friction_warning(where: Array) -> str | None:
    """That friction is left out at points (k, d), in words; None if there are none."""
    if not len(where):
        return None
    places = ", ".join("(" + ", ".join(f"{x + 0.0:.6g}" for x in point) + ")" for point in where[:_SHOWN])
    more = f" and {len(where) - _SHOWN} more" if len(where) > _SHOWN else ""
    return (
        f"friction is left out, in one direction at least, at {len(where)} contact point"
        f"{'s' if len(where) > 1 else ''}, x = {places}{more}: two contact boundaries meet there at more than 45 "
        "degrees, or a support fixes a direction oblique to the contact normal"
    )


def _check_diagonal(stiffness: sp.csr_array) -> None:
    diagonal = stiffness.diagonal()
    if not np.all(diagonal > 0):
        bad = int(np.flatnonzero(~(diagonal > 0))[0])
        raise ProblemError(
            f"stiffness[{bad}, {bad}] = {diagonal[bad]:g}; a stiffness matrix needs a positive diagonal: "
            f"remove unknowns that no element carries"
        )


def _check_size(stiffness: sp.csr_array, load: Array) -> None:
    """Refuse a load whose work over- or underflows: no energy could be compared with another."""
    with np.errstate(over="ignore", under="ignore"):
        work = float(np.sum(np.abs(load) * (np.abs(load) / stiffness.diagonal())))
    if load.any() and not _LEAST_WORK < work < 1.0 / _LEAST_WORK:
        raise ProblemError(
            f"the largest entry of the load is {np.abs(load).max():.3g} with a stiffness of "
            f"{np.max(stiffness.diagonal()):.3g}: energies of that size {'over' if work > 1.0 else 'under'}flow; "
            "state the problem in units that fit it"
        )


def _check_symmetry(stiffness: sp.csr_array) -> None:
    if stiffness.nnz == 0:
        return
    skew = stiffness - stiffness.T
    largest = float(np.max(np.abs(skew.data), initial=0.0))
    if largest > _SYMMETRY_TOLERANCE * float(np.max(np.abs(stiffness.data))):
        raise ProblemError(
            f"stiffness is not symmetric: max |K - K'| = {largest:.3g}; pass (K + K') / 2 if this is round-off"
        )
