"""Whether a displacement is one of small strains, which linear elasticity assumes: largest strain and rotation, and
what the stress of the load adds to the stiffness."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.elements import scaled_gradients
from hemivar.fem.fields import FieldSource, _mesh_and_order, gradients_at
from hemivar.fem.rings import hoop_strain
from hemivar.fem.stress_stiffness import stiffened_by
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.mesh import Mesh

__all__ = ["SMALL", "Deformation", "deformation", "deformation_of", "slid_beyond"]

#: Strain and rotation (radians) from which they are called large, and the share of the work of the stress.
SMALL, _STIFFENS = 0.1, 0.05
_CELLS_AT_A_TIME = 1 << 16


@dataclass(frozen=True)
class Deformation:
    """Largest strain and rotation of a body.

    Attributes
    ----------
    strain : float
        Largest principal value of ``(grad u + grad u')/2``, by size.
    rotation : float
        Largest angle of ``(grad u - grad u')/2``, in radians.
    volume : float
        Of the cells in which one of them is :data:`SMALL` at least (an area in the plane).
    whole : float
        Volume of the body.
    stiffening : float
        ``|u'K_s u| / u'K u``, K_s the geometric stiffness of the stress of u itself, with the rotation alone in the
        first: how much that stiffens or softens the body. Zero where it is counted, or not known.
    """

    strain: float
    rotation: float
    volume: float
    whole: float
    stiffening: float = 0.0

    @property
    def large(self) -> bool:
        """Whether strain or rotation are beyond what linear elasticity is for."""
        largest = max(self.strain, self.rotation)
        return math.isfinite(largest) and largest >= SMALL

    @property
    def sizes(self) -> str:
        """Both numbers in words."""
        least = 1e-12 * max(self.strain, self.rotation)  # which is rounding
        strain, rotation = (0.0 if size < least else size for size in (self.strain, self.rotation))
        return f"strain {100.0 * strain:.3g} %, rotation {rotation:.3g} rad"

    @property
    def warning(self) -> str | None:
        """A sentence where strain, rotation or the work of the stress are large; None elsewhere."""
        if not self.large and self.stiffening > _STIFFENS:
            return (
                "the stress of the load stiffens or softens the body, which is left out here: its geometric stiffness "
                f"does {self.stiffening:.2g} times the work that the body stores; state stiffening = true, "
                "ContactProblem(stiffening=True), which counts it"
            )
        if not self.large:
            return None
        share = 100.0 * self.volume / self.whole if self.whole > 0.0 else 100.0
        return (
            f"beyond small strains: largest {self.sizes}, above {100.0 * SMALL:g} % in {share:.3g} % of the body; "
            "linear elasticity is inaccurate there: check loads and units, or take a code with finite strains"
        )


def deformation_of(problem: DiscreteProblem, unknowns: Array) -> Deformation | None:
    """Largest strain and rotation of unknowns (n,); None without a mesh, and for scalar problems."""
    if problem.field is None or problem.origin is None or problem.origin.kind:
        return None
    moved, vectors = problem.field.full(unknowns), problem.vectors
    own, stiffened = deformation(problem.origin, moved), stiffened_by(problem, moved)
    if vectors.alone:
        return replace(own, stiffening=stiffened)
    strain, rotation = vectors.largest(own.strain, own.rotation).tolist()
    volume, whole = vectors.total(own.volume, own.whole).tolist()
    return Deformation(strain, rotation, volume, whole, stiffened)


def slid_beyond(problem: DiscreteProblem, unknowns: Array) -> str | None:
    """A sentence where two bodies slide on each other by more than an element, for they are projected at the start."""
    field, contact = problem.field, problem.contact
    if field is None or contact.components == 1 or not contact.pairs:
        return None
    mesh, slip, worst = field.mesh, np.linalg.norm(problem.local(unknowns)[:, 1:], axis=1), 0.0
    for name, (slave, _) in contact.pairs.items():
        rule, on = boundary_rule(mesh, slave, field.order), contact.on(name)
        nodes, sizes = rule.nodes.ravel(), np.repeat(rule.widths, rule.nodes.shape[1])
        around = np.bincount(nodes, sizes) / np.maximum(np.bincount(nodes), 1)
        worst = max(worst, float((slip[on] / around[contact.node[on]]).max(initial=0.0)))
    if not worst > 1.0:
        return None
    return (
        f"two bodies slide on each other by up to {worst:.3g} elements, but each point keeps the facet that it faced "
        "at the start: begin from a mesh in which one of them has been moved"
    )


def deformation(source: FieldSource | Mesh, displacement: Array) -> Deformation:
    """Largest strain and rotation of a displacement, exact for linear and quadratic elements.

    In quadratic elements both are linear, so that the corners of a cell have the largest.

    Parameters
    ----------
    source : Field, ContactProblem or Mesh
    displacement : array, shape (nodes, d)

    Returns
    -------
    Deformation
        Its numbers are nan where the displacement is not finite.
    """
    mesh, order = _mesh_and_order(source, displacement)
    if not np.isfinite(displacement).all():
        return Deformation(math.nan, math.nan, math.nan, float(mesh.volumes.sum()))
    nodes, corners = mesh.cell_nodes(order), np.eye(mesh.dim + 1) if order == 2 else np.eye(mesh.dim + 1)[:1]
    strain = rotation = volume = 0.0
    for start in range(0, mesh.number_of_cells, _CELLS_AT_A_TIME):
        cells = slice(start, start + _CELLS_AT_A_TIME)
        slopes = scaled_gradients(mesh, cells, mesh.volumes[cells])
        beyond: BoolArray = np.zeros(slopes.shape[2], dtype=bool)
        for corner in corners:
            gradient = gradients_at(slopes, nodes[cells], displacement, order, corner)
            stretched, turned = _principal(gradient), _angle(gradient)
            strain, rotation = max(strain, float(stretched.max())), max(rotation, float(turned.max()))
            beyond |= (stretched >= SMALL) | (turned >= SMALL)
        volume += float(mesh.volumes[cells][beyond].sum())
    if isinstance(source, ContactProblem) and source.kinematics.ring:
        strain = max(strain, float(np.abs(hoop_strain(mesh, order, displacement)).max()))
    return Deformation(strain, rotation, volume, float(mesh.volumes.sum()))


def _angle(gradient: Array) -> Array:
    """Angle of the small rotation of each gradient (d, d, k), (k,)."""
    pairs = [(0, 1)] if len(gradient) == 2 else [(0, 1), (0, 2), (1, 2)]
    return np.asarray(np.sqrt(sum((0.5 * (gradient[i, j] - gradient[j, i])) ** 2 for i, j in pairs)))


def _principal(gradient: Array) -> Array:
    """Largest principal strain by size of each gradient (d, d, k); in space a bound from below where it is far smaller
    than the largest of all and than :data:`SMALL`, (k,)."""
    strain = 0.5 * (gradient + gradient.transpose(1, 0, 2))
    if len(strain) == 2:
        mean = 0.5 * (strain[0, 0] + strain[1, 1])
        return np.asarray(np.abs(mean) + np.hypot(0.5 * (strain[0, 0] - strain[1, 1]), strain[0, 1]))
    square = (strain**2).sum(axis=(0, 1))
    largest = np.sqrt(square / 3.0)  # at most the largest, and at least it over sqrt(3)
    close = np.flatnonzero(math.sqrt(3.0) * largest >= min(SMALL, float(largest.max(initial=0.0))))
    largest[close] = np.abs(np.linalg.eigvalsh(strain[:, :, close].transpose(2, 0, 1))).max(axis=1)
    return np.asarray(largest)
