"""Error norms of a discrete field against a known one: energy norm and L2 norm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.fem.elements import barycentric_gradients, shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.formula import Formula
from hemivar.formula.reader import TIME
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem

__all__ = ["ErrorNorms", "KnownField", "energy_density", "error_norms"]


@dataclass(frozen=True)
class KnownField:
    """A displacement, or the unknown of a scalar problem, given by formulas of the place."""

    formulas: Sequence[Formula | str]
    timed: bool = False

    def __post_init__(self) -> None:
        given = [self.formulas] if isinstance(self.formulas, str) else list(self.formulas)
        made = tuple(
            formula if isinstance(formula, Formula) else Formula(formula, "exact solution") for formula in given
        )
        if not made:
            raise ProblemError("the exact solution has no components; give a formula for each")
        for formula in made:
            if TIME in formula.variables and not self.timed:
                raise ProblemError(f"exact solution: formula '{formula.text}' uses t; give the solution at rest")
        object.__setattr__(self, "formulas", made)

    def check(self, components: int) -> None:
        """Refuse another number of formulas than there are components."""
        if len(self.formulas) != components:
            what = "displacement" if components > 1 else "unknown"
            raise ProblemError(
                f"the exact solution has {len(self.formulas)} components and the {what} {components}; give a formula "
                "for each component"
            )

    def values(self, points: Array, t: float | None = None) -> Array:
        """Values at points (k, d), shape (k, components)."""
        return np.column_stack([formula(points, t) for formula in self._made])

    def gradients(self, points: Array) -> Array:
        """Derivatives at points (k, d), shape (k, components, d)."""
        return np.stack([formula.gradient(points) for formula in self._made], axis=1)

    @property
    def _made(self) -> list[Formula]:
        return [formula for formula in self.formulas if isinstance(formula, Formula)]


@dataclass(frozen=True)
class ErrorNorms:
    """Two norms of a field e."""

    #: ``sqrt(int eps(e) : C eps(e))`` or ``sqrt(int A grad e . grad e)``, without bedding.  Of a material that is not
    #: linear C is its lower tensor, in whose norm errors are bounded; where none is known the stiffness at rest.
    energy: float
    mean_square: float  # ``sqrt(int |e|^2)``


def error_norms(problem: ContactProblem, values: Array, known: KnownField | None = None) -> ErrorNorms:
    """Norms of ``u - known``, or of u (nodes, c); exact without formulas and with a homogeneous material."""
    mesh, order = problem.mesh, problem.order
    if known is not None:
        known.check(values.shape[1])
    slopes, corners, masks = barycentric_gradients(mesh), mesh.points[mesh.cells], region_masks(mesh)
    nodal = values[mesh.cell_nodes(order)]
    energy = square = 0.0
    rule = quadrature_rule(mesh.dim, 2 * order + (0 if known is None else 4))
    for point, weight in zip(*rule, strict=True):
        places = np.einsum("k,mkd->md", point, corners)
        gradient = np.einsum("mlc,la,mad->mcd", nodal, shape_derivatives(order, point), slopes, optimize=True)
        off = np.einsum("l,mlc->mc", shape_values(order, point), nodal)
        if known is not None:
            gradient = gradient - known.gradients(places)
            off = off - known.values(places)
        density = energy_density(problem, places, gradient, masks)
        volumes = weight * mesh.volumes * problem.kinematics.measure(places)
        if problem.kinematics.ring:
            density = density + _around(problem, places, gradient, off, masks)
        energy += float(volumes @ density)
        square += float(volumes @ np.einsum("mc,mc->m", off, off))
    return ErrorNorms(math.sqrt(max(energy, 0.0)), math.sqrt(square))


def energy_density(problem: ContactProblem, places: Array, gradient: Array, masks: Mapping[str, BoolArray]) -> Array:
    """``eps : C eps`` or ``A g . g`` of gradients (k, components, d) at places (k, d), shape (k,); see
    :class:`ErrorNorms` for C of a material that is not linear."""
    strain = problem.kinematics.strain(gradient)
    return np.asarray(np.einsum("mi,mij,mj->m", strain, _tensor(problem.material, places, masks), strain))


def _around(
    problem: ContactProblem, places: Array, gradient: Array, off: Array, masks: Mapping[str, BoolArray]
) -> Array:
    """What the strain around the axis of a body of revolution adds to ``eps : C eps``, shape (k,)."""
    row, hoop = problem.material.hoop_row(places, masks), problem.kinematics.hoop_strain(places, off, gradient)
    plane = np.einsum("mi,mi->m", row[:, :-1], problem.kinematics.strain(gradient))
    return np.asarray(hoop * (2.0 * plane + row[:, -1] * hoop))


def _tensor(material: Material, places: Array, masks: Mapping[str, BoolArray]) -> Array:
    """C or A at places (k, d), shape (k, v, v)."""
    if not material.linear:
        lower = material.lower_tensor(places, masks)
        if (np.einsum("kii->ki", lower) > 0.0).all():
            return lower
    return material.stiffness_tensor(places, masks)
