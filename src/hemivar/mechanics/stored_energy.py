"""Materials that are not linear: a stored energy W of the strain, whose derivative is the stress.

Strains are small, and W is strongly convex: its second derivative lies between two tensors ``C_low`` and ``C_up`` at
every strain.  With ``C_low`` the margin of a contact problem is tested, and from it the error of an answer is bounded.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import one_of
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_words import PlaneState
from hemivar.mechanics.moduli import isotropic_matrices
from hemivar.mechanics.single_material import SingleMaterial

__all__ = ["InvariantEnergy", "Invariants", "IsotropicBounds", "StoredEnergy", "refuse_nonlinear"]

#: Where the components xx, yy and xy of the plane stand among those of space, and zz.
_PLANE, _ACROSS = (0, 1, 5), 2
#: Steps to eliminate the strain across the plane, and the part of stress or strain that counts as zero.
_STEPS, _ZERO = 100, 1e-14


@dataclass(frozen=True, eq=False)
class StoredEnergy(SingleMaterial):
    """A material by a stored energy W(x, eps); derive from it and supply what is abstract.

    ``energy``, ``stress``, ``tangent``, ``lower_tensor`` and ``upper_tensor`` are described in :class:`Material`;
    ``bounds_by`` tells how the last two were found.
    """

    @property
    def linear(self) -> bool:
        return False

    @property
    @abstractmethod
    def kind(self) -> str: ...

    @property
    @abstractmethod
    def formula(self) -> str: ...

    @abstractmethod
    def stated(self) -> Mapping[str, object]: ...

    @abstractmethod
    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array: ...

    @abstractmethod
    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array: ...

    @abstractmethod
    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array: ...

    @abstractmethod
    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array: ...

    @abstractmethod
    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array: ...

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        size = points.shape[1] * (points.shape[1] + 1) // 2
        at = points[:1] if self.homogeneous else points
        tangent = self.tangent(at, np.zeros((len(at), size)))
        return np.broadcast_to(tangent[0], (len(points), size, size)) if len(at) < len(points) else tangent


@dataclass(frozen=True, eq=False)
class Invariants:
    """W and its derivatives by two invariants of the strain: p = tr eps and s = |dev eps|^2, arrays (k,).

    Attributes
    ----------
    value : W
    p, s : first derivatives
    pp, ps, ss : second derivatives
    """

    value: Array
    p: Array
    s: Array
    pp: Array
    ps: Array
    ss: Array


@dataclass(frozen=True, eq=False)
class IsotropicBounds:
    """Isotropic tensors ``k tr(eps) I + 2 mu dev eps`` below and above the tangent at every strain.

    Attributes
    ----------
    bulk, shear : arrays (k,)
        Moduli k and mu of the tensor below, in units of stress.
    largest_bulk, largest_shear : arrays (k,)
        Those of the tensor above.
    """

    bulk: Array
    shear: Array
    largest_bulk: Array
    largest_shear: Array


@dataclass(frozen=True, eq=False)
class InvariantEnergy(StoredEnergy):
    """An isotropic stored energy, ``W = F(p, s)`` with p = tr eps and s = |dev eps|^2 of the strain in space.

    ``sigma = F_p I + 2 F_s dev eps``. In plane strain the strain across the plane is zero, its deviator ``-p / 3`` is
    not. In plane stress the strain across the plane is eliminated at every point by a Newton method that a bracket
    guards; bounds of the eliminated energy are the tensors of plane stress of the bounds in space, since a Schur
    complement grows with its matrix.

    Attributes
    ----------
    plane : PlaneState
    """

    def __post_init__(self) -> None:
        object.__setattr__(self, "plane", one_of(self.plane, "plane", PlaneState))
        if self.plane is PlaneState.AXISYMMETRIC:
            raise ProblemError("plane = 'axisymmetric' is for linear materials; take Material.young or Material.lame")
        super().__post_init__()

    @property
    @abstractmethod
    def plane(self) -> PlaneState:
        """What a plane model assumes about the third direction."""

    @abstractmethod
    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        """W and its derivatives at points (k, d) and invariants (k,)."""

    @abstractmethod
    def bounds(self, points: Array) -> IsotropicBounds:
        """Bounds of the tangent at points (k, d)."""

    @property
    def _in_plane_stress(self) -> bool:
        return self.plane is PlaneState.STRESS

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._at(points, self._in_space(points, strain))[0].value

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        whole = self._in_space(points, strain)
        stress = _stress(*self._at(points, whole), _dim(whole))
        return stress[:, _PLANE] if whole.shape != strain.shape else stress

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        whole = self._in_space(points, strain)
        tangent = _tangent(*self._at(points, whole), _dim(whole))
        return _without_across(tangent) if whole.shape != strain.shape else tangent

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        at = points[:1] if self.homogeneous else points
        bounds = self.bounds(at)
        return self._isotropic(points, bounds.bulk, bounds.shear)

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        at = points[:1] if self.homogeneous else points
        bounds = self.bounds(at)
        return self._isotropic(points, bounds.largest_bulk, bounds.largest_shear)

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self._in_plane_stress:
            return np.zeros(len(points))
        voigt = np.column_stack([strain[:, 0, 0], strain[:, 1, 1], 2.0 * strain[:, 0, 1]])
        return _stress(*self._at(points, _raised(voigt)), 3)[:, _ACROSS]

    def _isotropic(self, points: Array, bulk: Array, shear: Array) -> Array:
        """Matrices of moduli of space, (k, v, v)."""
        lam = bulk - 2.0 * shear / 3.0
        if self._in_plane_stress:
            whole = lam + 2.0 * shear
            lam = 2.0 * lam * shear / np.where(whole > 0.0, whole, 1.0)
        matrices = isotropic_matrices(lam, shear, points.shape[1])
        return np.broadcast_to(matrices[0], (len(points), *matrices.shape[1:])) if self.homogeneous else matrices

    def _at(self, points: Array, strain: Array) -> tuple[Invariants, Array]:
        """W at strains of space or of plane strain, and their deviators (k, v), shear components once."""
        dim = _dim(strain)
        p = strain[:, :dim].sum(axis=1)
        deviator = np.concatenate([strain[:, :dim] - p[:, None] / 3.0, 0.5 * strain[:, dim:]], axis=1)
        s = np.einsum("ki,ki->k", deviator[:, :dim], deviator[:, :dim])
        s += 2.0 * np.einsum("ki,ki->k", deviator[:, dim:], deviator[:, dim:]) + (3 - dim) * (p / 3.0) ** 2
        return self.invariants(points, p, s), deviator

    def _in_space(self, points: Array, strain: Array) -> Array:
        """In plane stress the strains of space (k, 6) that leave no stress across the plane; else the strains."""
        if not self._in_plane_stress:
            return strain
        if points.shape[1] != 2:
            raise ProblemError("plane stress is a model for 2D meshes; leave 'plane' out for a 3D body")
        bounds = self.bounds(points)
        least = bounds.bulk + 4.0 * bounds.shear / 3.0
        if not (least > 0.0).all():
            raise ProblemError(
                f"no lower bound of the stiffness of the material ({self.kind}) is known, and plane stress needs one; "
                "take plane strain"
            )
        return self._free_across(points, _raised(strain), least)

    def _free_across(self, points: Array, strain: Array, least: Array) -> Array:
        """The strains with that across the plane chosen so that the stress there is zero; its slope is `least` or more.

        The stress across grows with the strain there, so that the sign of it tells on which side of the zero one is.
        """
        low, high = np.full(len(points), -np.inf), np.full(len(points), np.inf)
        todo = np.arange(len(points))
        for _ in range(_STEPS):
            at, places = strain[todo], points[todo]
            invariants, deviator = self._at(places, at)
            stress = _stress(invariants, deviator, 3)
            across, size = stress[:, _ACROSS], np.abs(stress).max(axis=1)
            slope = _tangent(invariants, deviator, 3)[:, _ACROSS, _ACROSS]
            here, reach = at[:, _ACROSS], np.abs(across) / least[todo]
            low[todo] = np.maximum(low[todo], np.where(across <= 0.0, here, here - reach))
            high[todo] = np.minimum(high[todo], np.where(across >= 0.0, here, here + reach))
            step = here - across / slope
            inside = (step >= low[todo]) & (step <= high[todo])
            step = np.where(inside, step, 0.5 * (low[todo] + high[todo]))
            done = (np.abs(across) <= _ZERO * size) | (np.abs(step - here) <= _ZERO * np.abs(at).max(axis=1))
            strain[todo, _ACROSS] = step
            todo = todo[~done]
            if not todo.size:
                break
        return strain


def refuse_nonlinear(material: Material) -> None:
    """Refuse a material that is not linear."""
    if not material.linear:
        raise ProblemError(
            "the material is not linear, and a stiffness matrix is asked for; give Material.lame(...), "
            "Material.young(...) or Material.tensor(...), or solve it on one process, hemivar.solve(problem)"
        )


def _dim(strain: Array) -> int:
    return 2 if strain.shape[1] == 3 else 3


def _raised(strain: Array) -> Array:
    """Strains of the plane (k, 3) among those of space (k, 6), with none across the plane."""
    whole = np.zeros((len(strain), 6))
    whole[:, _PLANE] = strain
    return whole


def _stress(invariants: Invariants, deviator: Array, dim: int) -> Array:
    stress = 2.0 * invariants.s[:, None] * deviator
    stress[:, :dim] += invariants.p[:, None]
    return stress


def _tangent(invariants: Invariants, deviator: Array, dim: int) -> Array:
    tangent = isotropic_matrices(invariants.pp - 2.0 * invariants.s / 3.0, invariants.s, dim)
    tangent += (4.0 * invariants.ss)[:, None, None] * (deviator[:, :, None] * deviator[:, None, :])
    if np.any(invariants.ps):
        mixed = (2.0 * invariants.ps)[:, None] * deviator
        tangent[:, :dim, :] += mixed[:, None, :]
        tangent[:, :, :dim] += mixed[:, :, None]
    return tangent


def _without_across(tangent: Array) -> Array:
    """Tangents (k, 6, 6) for strains of the plane, that across it eliminated: (k, 3, 3)."""
    row = tangent[:, _PLANE, _ACROSS]
    inner = tangent[:, _PLANE][:, :, _PLANE]
    return np.asarray(inner - row[:, :, None] * row[:, None, :] / tangent[:, _ACROSS, _ACROSS][:, None, None])
