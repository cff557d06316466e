"""Linear materials: isotropic ones, and those of any elasticity matrix."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.arrays import LARGEST, real_array
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.stated import Form, kept, stated
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import place_of, require
from hemivar.mechanics.instants import refuse_time
from hemivar.mechanics.material_words import PLANE, PlaneState
from hemivar.mechanics.moduli import Number, isotropic_matrices, lame_of, matrices_at, plain_matrix
from hemivar.mechanics.per_volume import constant
from hemivar.mechanics.single_material import MaterialOfConstants, SingleMaterial

__all__ = ["Anisotropic", "Isotropic", "Lame", "Young"]

#: The largest lam / mu that leaves digits for mu.
_STIFF = 1e13


class Isotropic(MaterialOfConstants):
    """``sigma = lam tr(eps) I + 2 mu eps``, by Lame's constants or by what they follow from."""

    units = "take another unit of force"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.axisymmetric and (self.viscosity is not None or self.branches):
            raise ProblemError(
                "plane = 'axisymmetric' has no viscosity and no branches that relax; leave them out, or model a "
                "quarter of the body in 3D"
            )

    @property
    @abstractmethod
    def plane(self) -> PlaneState:
        """What a plane model assumes about the third direction."""

    @property
    def axisymmetric(self) -> bool:
        return self.plane is PlaneState.AXISYMMETRIC

    @abstractmethod
    def lame_constants(self, points: Array, where: str | None = None) -> tuple[Array, Array]:
        """Lame's constants at points, checked for what holds in every dimension."""

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        dim = points.shape[1]
        constant = self.homogeneous and len(points) > 0
        at, where = (points[:1], "") if constant else (points, None)
        lam, mu = self.lame_constants(at, where)
        if dim == 3 or self.plane is not PlaneState.STRAIN:
            require(3 * lam + 2 * mu > 0, at, lam, "material constant lam", "must exceed -2 mu / 3", where)
        if self._in_plane_stress:
            if dim == 3:
                raise ProblemError("plane stress is a model for 2D meshes; leave 'plane' out for a 3D body")
            lam = 2 * lam * mu / (lam + 2 * mu)
        matrix = isotropic_matrices(lam, mu, dim)
        return np.broadcast_to(matrix[0], (len(points), *matrix.shape[1:])) if constant else matrix

    def hoop_row(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        lam, mu = self.lame_constants(points)
        return np.column_stack([lam, lam, 0.0 * lam, lam + 2.0 * mu])

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self._in_plane_stress:
            return np.zeros(len(points))
        return np.asarray(self.lame_constants(points)[0] * (strain[:, 0, 0] + strain[:, 1, 1]))

    def stiffness_across(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        lam, mu = self.lame_constants(points)
        return np.asarray(0.0 * lam if self._in_plane_stress else lam + 2.0 * mu)


@known_fields
@dataclass(frozen=True, eq=False)
class Lame(Isotropic):
    """What :meth:`Material.lame` makes."""

    lam: Number = field(metadata=constant(least=-np.inf, table="lame"))
    mu: Number = field(metadata=constant(table="lame"))
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE)

    kind = "lame"
    formula = "sigma = lam tr(eps) I + 2 mu eps"

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        lam, mu = super().at(points, where)
        what = "material constant "
        units = f"must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}: take another unit of force"
        require(np.abs(lam) < LARGEST, points, lam, what + "lam", units, where)
        require(lam + mu > 0, points, lam, what + "lam", "must exceed -mu", where)
        lost = "is so small beside lam that rounding loses it"
        require(lam < _STIFF * mu, points, mu, what + "mu", lost, where)
        return lam, mu

    def lame_constants(self, points: Array, where: str | None = None) -> tuple[Array, Array]:
        lam, mu = self.at(points, where)
        return lam, mu


@known_fields
@dataclass(frozen=True, eq=False)
class Young(Isotropic):
    """What :meth:`Material.young` makes."""

    E: Number = field(metadata=constant(key="young", above=0.0))
    nu: Number = field(metadata=constant(key="poisson", unit="1", above=-1.0, below=0.5))
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE)

    kind = "young"
    formula = "sigma = E/(1 + nu) (eps + nu/(1 - 2 nu) tr(eps) I)"

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        young, nu = super().at(points, where)
        lam, mu = lame_of(young, nu)
        near = "is so near to 0.5 that rounding loses the shear"
        require(lam < _STIFF * mu, points, nu, "material constant nu", near, where)
        near = "is so near to -1 that rounding loses it"
        require(1 + nu > 1.0 / _STIFF, points, nu, "material constant nu", near, where)
        return young, nu

    def lame_constants(self, points: Array, where: str | None = None) -> tuple[Array, Array]:
        return lame_of(*self.at(points, where))


def _matrix(value: object, name: str) -> Array | Callable[[Array], object]:
    refuse_time(value, "the elasticity matrix")
    if callable(value):
        return value
    matrix = plain_matrix(value, "the elasticity matrix")
    _check_matrices(matrix[None], np.zeros((1, 2)), "")
    return matrix


def _row(value: object, name: str) -> Array:
    row = np.array(real_array(value, name, finite=False))
    if row.shape != (3,) or not np.all(np.isfinite(row)):
        raise ProblemError(f"{name} = {quoted(value)}; it must be three finite numbers")
    row.setflags(write=False)
    return row


@known_fields
@dataclass(frozen=True, eq=False)
class Anisotropic(SingleMaterial):
    """What :meth:`Material.tensor` makes."""

    matrix: Array | Callable[[Array], object] = field(
        metadata=stated(Form.MATRIX, "elasticity", key="tensor") | kept(_matrix)
    )
    out_of_plane: Array | None = field(default=None, metadata=stated(Form.OWN) | kept(_row))

    kind = "tensor"
    formula = "sigma = C eps"

    def stated(self) -> Mapping[str, object]:
        return {}

    @property
    def _natural_dim(self) -> int:
        return 2 if isinstance(self.matrix, np.ndarray) and len(self.matrix) == 3 else 3

    @property
    def homogeneous(self) -> bool:
        return not callable(self.matrix)

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        matrix = matrices_at(self.matrix, "the elasticity matrix", points)
        if not self.homogeneous:
            _check_matrices(matrix, points, "" if len(matrix) == 1 else None)
        return np.broadcast_to(matrix, (len(points), *matrix.shape[1:]))

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self.out_of_plane is None:
            return np.zeros(len(points))
        row = self.out_of_plane
        return np.asarray(row[0] * strain[:, 0, 0] + row[1] * strain[:, 1, 1] + 2 * row[2] * strain[:, 0, 1])

    def stiffness_across(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return np.full(len(points), 0.0 if self.out_of_plane is None else np.nan)


def _check_matrices(matrices: Array, points: Array, where: str | None) -> None:
    at = partial(place_of, points=points, where=where)
    bad: BoolArray = np.asarray(~np.isfinite(matrices).all(axis=(1, 2)))
    if bad.any():
        raise ProblemError(f"the elasticity matrix is not finite{at(bad)}; give finite numbers")
    scale = np.abs(matrices).max(axis=(1, 2))
    bad = (scale >= LARGEST) | (scale <= 1.0 / LARGEST)
    if bad.any():
        raise ProblemError(
            f"the largest entry of the elasticity matrix is {scale[bad][0]:g}{at(bad)}; it must lie between "
            f"{1.0 / LARGEST:.0e} and {LARGEST:.0e}: take another unit of force"
        )
    bad = np.abs(matrices - matrices.transpose(0, 2, 1)).max(axis=(1, 2)) > 1e-12 * scale
    if bad.any():
        raise ProblemError(f"the elasticity matrix is not symmetric{at(bad)}; pass (C + C') / 2")
    lowest = np.linalg.eigvalsh(matrices)[:, 0]
    bad = ~(lowest > 1e-14 * scale)
    if bad.any():
        raise ProblemError(
            f"the elasticity matrix is not positive definite{at(bad)} (lowest eigenvalue {lowest[bad][0]:g}); "
            "check its signs"
        )
