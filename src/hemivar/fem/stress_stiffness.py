"""Stress stiffening: what the stress of the load itself adds to the stiffness of a body.

The geometric stiffness of a stress sigma is ``v'K_s u = int sigma_kl du_i/dx_k dv_i/dx_l``, the initial stress matrix
(Zienkiewicz and Taylor, The Finite Element Method, volume 2). It takes each component by itself, and all alike.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.model import MadeOf
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.assembly import portions, stiffness_blocks
from hemivar.fem.constitutive import ConstitutiveLaw, EnergyLaw
from hemivar.fem.energy_integral import NodalEnergy, _not_by_points
from hemivar.fem.fields import gradients_by
from hemivar.mechanics.statement import ContactProblem, beyond_stiffening
from hemivar.mesh.mesh import Mesh

__all__ = [
    "Stressed",
    "geometric_stiffness",
    "nodal_stiffness",
    "refuse_stiffening",
    "stiffened_by",
    "stiffens",
    "stressed_problem",
    "under_own_stress",
    "works_of_stress",
]


@dataclass(frozen=True, eq=False)
class Stressed(MadeOf):
    """What the stiffness of a body under stress is made of: the body without it, and the place that has the stress."""

    problem: DiscreteProblem
    unknowns: Array  # (n,): the place

    semidefinite: ClassVar[bool] = False


@dataclass(frozen=True, eq=False)
class _StressLaw(ConstitutiveLaw):
    """The stress of a field (nodes, d) in the place of the coefficients of one component."""

    energy: NodalEnergy
    field: Array

    def on(
        self, mesh: Mesh, degree: int, cells: slice | IntArray = slice(None), vertices: IntArray | None = None
    ) -> tuple[Array, Array]:
        return _stress(self.energy, self.energy.strains(self.field, cells)[0], cells)


def _stored(problem: ContactProblem) -> NodalEnergy:
    return NodalEnergy(problem.mesh, problem.order, EnergyLaw.of(problem.material, problem.mesh.dim))


def _stress(energy: NodalEnergy, strain: Array, cells: slice | IntArray) -> tuple[Array, Array]:
    """Stresses (k, q, d, d) at the points of some cells, and the weights (q,) of these."""
    stress, weights = energy.at(energy.law.density.stress, strain, cells)
    return stress[..., energy.law.strains], weights


def stiffens(problem: DiscreteProblem) -> bool:
    """Whether the stress of the load is to be counted, and is not held already."""
    stated = problem.origin
    return stated is not None and stated.stiffening and not isinstance(problem.model.parts, Stressed)


def stressed_problem(problem: DiscreteProblem, unknowns: Array) -> DiscreteProblem:
    """The problem whose stiffness has the geometric stiffness of its stress at unknowns (n,): ``K + K_s``.

    Raises
    ------
    ProblemError
        A diagonal entry of it is not positive.
    """
    field, whole = problem.field, _of_all_nodes(problem, unknowns)
    assert field is not None
    bulk = Quadratic(sp.csr_array(problem.stiffness + _of_unknowns(problem, whole)), assembled=True)
    stressed = problem.on_the_same(replace(problem.model, bulk=bulk, parts=Stressed(problem, unknowns)))
    if not field.prescribed.any():
        return stressed
    pulled = whole @ field.prescribed
    constant = problem.constant + 0.5 * float(field.prescribed @ pulled)
    return stressed.under(problem.load - field.basis.T @ pulled, constant=constant)


def under_own_stress(problem: DiscreteProblem, unknowns: Array) -> DiscreteProblem:
    """The problem with its stress at unknowns (n,), where that is to be counted; elsewhere the problem itself."""
    return stressed_problem(problem, unknowns) if stiffens(problem) else problem


def geometric_stiffness(problem: DiscreteProblem, unknowns: Array) -> sp.csr_array:
    """``K_s`` (n, n) of the stress of a problem at unknowns (n,)."""
    return _of_unknowns(problem, _of_all_nodes(problem, unknowns))


def nodal_stiffness(problem: ContactProblem, displacement: Array) -> sp.csr_array:
    """``K_s`` (nodes, nodes) of one component, of the stress of a displacement (nodes, d)."""
    energy, strains = _stored(problem), np.arange(problem.mesh.dim)[None]
    law = _StressLaw(strains, _not_by_points, False, energy, displacement)
    return stiffness_blocks(problem.mesh, law, energy.graph).matrix()


def _of_all_nodes(problem: DiscreteProblem, unknowns: Array) -> sp.csr_array:
    field, stated = problem.field, problem.origin
    assert field is not None
    assert stated is not None
    nodal = nodal_stiffness(stated, field.full(unknowns))
    return sp.csr_array(sp.kron(nodal, sp.eye_array(field.components), format="csr"))


def _of_unknowns(problem: DiscreteProblem, whole: sp.csr_array) -> sp.csr_array:
    assert problem.field is not None
    own = sp.csr_array(problem.field.basis.T @ whole @ problem.field.basis)
    return sp.csr_array(0.5 * (own + own.T))


def works_of_stress(problem: ContactProblem, displacement: Array, *, turned: bool = False) -> tuple[float, float]:
    """``u'K_s u`` of a displacement (nodes, d), K_s that of its own stress, and ``u'K u``; no matrix is formed.

    ``turned`` takes the rotation alone in the first of them.
    """
    energy, works = _stored(problem), np.zeros(2)
    for part in portions(problem.mesh, problem.order):
        works += sum(_works_at_points(energy, displacement, part, turned))
    return float(works[0]), float(works[1])


def _works_at_points(energy: NodalEnergy, displacement: Array, cells: slice, turned: bool) -> Iterator[Array]:
    """Both works at each point of the rule in turn, of some cells together."""
    (strain, shapes), strains = energy.strains(displacement, cells), energy.law.strains
    stress, weights = energy.at(energy.law.density.stress, strain, cells)
    nodes, volumes = energy.mesh.cell_nodes(energy.order)[cells], energy.mesh.volumes[cells]
    stretched = strain.reshape(stress.shape)
    for q, (weight, shape) in enumerate(zip(weights, shapes, strict=True)):
        slope, pulls = gradients_by(shape, nodes, displacement), stress[:, q].T
        moved = 0.5 * (slope - slope.transpose(1, 0, 2)) if turned else slope
        along = sum(
            (1.0 if i == j else 2.0) * pulls[strains[i, j]] * (moved[:, i] * moved[:, j]).sum(axis=0)
            for i, j in itertools.combinations_with_replacement(range(len(strains)), 2)
        )
        stored = sum(pull * own for pull, own in zip(pulls, stretched[:, q].T, strict=True))
        yield weight * np.array([volumes @ along, volumes @ stored])


def stiffened_by(problem: DiscreteProblem, displacement: Array) -> float:
    """``|u'K_s u| / u'K u`` of a displacement (nodes, d): how much the stress of the load matters that K leaves out.

    In ``u'K_s u`` u is the rotation: what its strain adds is beyond stress stiffening. Zero where it is counted
    already, where nothing resists, and of bodies that it is not for: in time, not linear, of revolution, of one
    component.
    """
    stated = problem.origin
    if stated is None or stated.stiffening or problem.model.parts is not None or beyond_stiffening(stated):
        return 0.0
    geometric, stored = problem.vectors.total(*works_of_stress(stated, displacement, turned=True)).tolist()
    return abs(geometric) / stored if stored > 0.0 and np.isfinite(geometric) else 0.0


def refuse_stiffening(problem: object, what: str) -> None:
    """Refuse stress stiffening where it is not available."""
    counted = stiffens(problem) if isinstance(problem, DiscreteProblem) else False
    if counted or (isinstance(problem, ContactProblem) and problem.stiffening):
        raise ProblemError(
            f"{what} is not available with stress stiffening, which is for single loads at rest; leave stiffening out, "
            "or solve for the load that matters"
        )
