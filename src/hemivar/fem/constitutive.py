"""Constitutive laws: how stresses follow from strains, of one component the flux from the gradient."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.quadrature import at_quadrature_points
from hemivar.fem.rings import Hoop
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh

__all__ = ["ConstitutiveLaw", "EnergyDensity", "EnergyLaw", "constitutive_law", "elastic", "relaxing", "viscous"]


class EnergyDensity(Protocol):
    """A stored energy per volume of strains (k, v) at points (k, d): a :class:`hemivar.Material`."""

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """W, shape (k,)."""

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Its derivative, shape (k, v)."""

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Its second derivative, shape (k, v, v)."""

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices (k, v, v) below all of them; zero where none is known."""

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices (k, v, v) above all of them."""


@dataclass(frozen=True, eq=False)
class EnergyLaw:
    """A stored energy of the strains of fields of c components, which need not be quadratic."""

    strains: IntArray  # (c, d): as in :class:`BodyKinematics`
    density: EnergyDensity
    homogeneous: bool  # whether W is the same everywhere
    uniform: bool  # whether W is the same all over each cell

    @staticmethod
    def of(material: Material, dim: int) -> EnergyLaw:
        """That of a material in d dimensions."""
        return EnergyLaw(BodyKinematics.of(material, dim).rows, material, material.homogeneous, material.uniform)


@dataclass(frozen=True, eq=False)
class ConstitutiveLaw:
    """A linear law between strains and stresses of fields of c components, of a body of revolution of whole rings."""

    strains: IntArray  # (c, d): as in :class:`BodyKinematics`
    matrices: Callable[[Array, Mapping[str, BoolArray] | None], Array]
    homogeneous: bool  # whether the matrices are the same everywhere
    hoop: Hoop | None = field(default=None, kw_only=True)

    def on(
        self, mesh: Mesh, degree: int, cells: slice | IntArray = slice(None), vertices: IntArray | None = None
    ) -> tuple[Array, Array]:
        """Matrices at the quadrature points of cells, (k, q, v, v), and weights (q,): see :func:`at_quadrature_points`.

        A homogeneous law gives a single matrix, (1, 1, v, v), and one weight.
        """
        if self.homogeneous:
            return self.matrices(mesh.points[:1], None)[None], np.ones(1)
        return at_quadrature_points(mesh, degree, self.matrices, cells, vertices)


def elastic(material: Material, dim: int) -> ConstitutiveLaw:
    """The elasticity of a material in d dimensions."""
    own = BodyKinematics.of(material, dim)
    hoop = own.over(material.hoop_row) if own.ring else None
    homogeneous = material.homogeneous and not own.ring
    return ConstitutiveLaw(own.rows, own.over(material.stiffness_tensor), homogeneous, hoop=hoop)


def constitutive_law(problem: ContactProblem) -> ConstitutiveLaw:
    """The elasticity of a body, or the coefficients of a scalar problem."""
    return elastic(problem.material, problem.mesh.dim)


def viscous(material: Material, dim: int) -> ConstitutiveLaw:
    """The viscosity of a material in d dimensions."""
    rows = BodyKinematics.of(material, dim).rows
    return ConstitutiveLaw(rows, material.viscosity_tensor, material.homogeneous_in(True))


def relaxing(material: Material, number: int, dim: int) -> ConstitutiveLaw:
    """The springs of the branches of one of the relaxation times of a material in d dimensions."""
    rows, matrices = BodyKinematics.of(material, dim).rows, partial(material.branch_tensor, number)
    return ConstitutiveLaw(rows, matrices, material.homogeneous_in(False, (number,)))
