"""Volumetric locking: bodies that hardly change their volume, for which linear elements are too stiff."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.fem.quadrature import region_masks
from hemivar.mechanics.statement import ContactProblem

__all__ = ["LOCKING", "largest_poisson_ratio", "locking_warning"]

#: Poisson's ratio from which linear triangles and tetrahedra are warned of.
LOCKING = 0.49


def largest_poisson_ratio(problem: ContactProblem) -> float:
    """Largest Poisson's ratio of the body, taken at the centres of its elements.

    Of an anisotropic material, that of the isotropic one with the same volumetric and mean shear stiffness.  Plane
    stress leaves the thickness free: there it is at most 1/3, whatever the material.
    """
    mesh = problem.mesh
    if problem.material.homogeneous:
        tensor = problem.material.stiffness_tensor(mesh.points[:1])
    else:
        tensor = problem.material.stiffness_tensor(mesh.points[mesh.cells].mean(axis=1), region_masks(mesh))
    return float(_poisson_ratio(tensor, mesh.dim).max())


def _poisson_ratio(tensor: Array, dim: int) -> Array:
    """Of elasticity matrices (k, v, v), v = d (d + 1) / 2; exact for isotropic ones."""
    size = tensor.shape[-1]
    volumetric = tensor[:, :dim, :dim].sum(axis=(1, 2)) / dim  # d lam + 2 mu
    diagonal = np.einsum("kii->ki", tensor)
    whole = diagonal[:, :dim].sum(axis=1) + 2.0 * diagonal[:, dim:].sum(axis=1)  # the trace in Mandel's form
    shear = (whole - volumetric) / (size - 1)  # 2 mu
    lam = (volumetric - shear) / dim
    return np.asarray(lam / (2.0 * lam + shear))


def locking_warning(problem: ContactProblem) -> str | None:
    """What to know and to do where linear elements meet a nearly incompressible material; None elsewhere."""
    if problem.order > 1 or problem.components == 1:
        return None
    ratio = largest_poisson_ratio(problem)
    if ratio < LOCKING:
        return None
    return (
        f"Poisson's ratio is {ratio:.6g}: linear elements lock there and make the body too stiff. Residual and "
        f"certificate refer to the discrete problem and do not show it; use order = 2"
    )
