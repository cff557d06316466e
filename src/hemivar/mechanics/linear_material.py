"""Linear materials: isotropic ones, and those of any elasticity matrix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, DataField
from hemivar.mechanics.instants import refuse_time
from hemivar.mechanics.material_words import PlaneState, plane_state
from hemivar.mechanics.moduli import Number, isotropic_matrices
from hemivar.mechanics.per_volume import plain_constant
from hemivar.mechanics.single_material import SingleMaterial

__all__ = ["Anisotropic", "Isotropic"]

#: The largest lam / mu that leaves digits for mu.
_STIFF = 1e13


@known_fields
@dataclass(frozen=True, eq=False)
class Isotropic(SingleMaterial):
    """What :meth:`Material.lame` and :meth:`Material.young` make.

    Attributes
    ----------
    first, second : float or callable
        Lame's constants, or Young's modulus and Poisson's ratio if ``technical``.
    plane : PlaneState
    technical : bool
    """

    first: Number
    second: Number
    plane: PlaneState
    technical: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "plane", plane_state(self.plane))
        for name, field in zip(self.names, ("first", "second"), strict=True):
            object.__setattr__(self, field, plain_constant(getattr(self, field), f"material constant {name}"))
        if self.homogeneous:
            self._parameters(np.zeros((1, 2)), "")
        super().__post_init__()
        if self.axisymmetric and (self.viscosity is not None or self.branches):
            raise ProblemError(
                "plane = 'axisymmetric' has no viscosity and no branches that relax; leave them out, or take a quarter "
                "of the body in space"
            )

    @property
    def _in_plane_stress(self) -> bool:
        return self.plane is PlaneState.STRESS

    @property
    def axisymmetric(self) -> bool:
        return self.plane is PlaneState.AXISYMMETRIC

    @property
    def homogeneous(self) -> bool:
        return not callable(self.first) and not callable(self.second)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two constants."""
        return ("E", "nu") if self.technical else ("lam", "mu")

    @property
    def kind(self) -> str:
        return "young" if self.technical else "lame"

    @property
    def formula(self) -> str:
        return (
            "sigma = E/(1 + nu) (eps + nu/(1 - 2 nu) tr(eps) I)"
            if self.technical
            else "sigma = lam tr(eps) I + 2 mu eps"
        )

    def stated(self) -> Mapping[str, object]:
        plane = None if self.plane is PlaneState.STRAIN else self.plane.value
        return {**dict(zip(self.names, (self.first, self.second), strict=True)), "plane": plane}

    def _parameters(self, points: Array, where: str | None = None) -> tuple[Array, Array]:
        """Lame's constants at points, checked for what holds in every dimension."""
        names = self.names
        first = DataField(self.first, f"material constant {names[0]}").at(points)
        second = DataField(self.second, f"material constant {names[1]}").at(points)
        scale = first if self.technical else second
        if self.technical:
            _require(first > 0, points, first, "E", "must be positive", where)
            _require((second > -1) & (second < 0.5), points, second, "nu", "must lie between -1 and 0.5", where)
        else:
            _require(second > 0, points, second, "mu", "must be positive", where)
        in_range = (scale < LARGEST) & (scale > 1.0 / LARGEST) & (np.abs(first) < LARGEST)
        units = f"must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}: take another unit of force"
        _require(in_range | (np.abs(first) >= LARGEST), points, scale, names[0 if self.technical else 1], units, where)
        _require(in_range, points, first, names[0], units, where)
        if self.technical:
            mu = first / (2 * (1 + second))
            lam, name, shown = 2 * mu * second / (1 - 2 * second), "nu", second
            _require(lam < _STIFF * mu, points, shown, name, "is so near to 0.5 that rounding loses the shear", where)
            _require(1 + second > 1.0 / _STIFF, points, shown, name, "is so near to -1 that rounding loses it", where)
            return lam, mu
        _require(first + second > 0, points, first, "lam", "must exceed -mu", where)
        _require(first < _STIFF * second, points, second, "mu", "is so small beside lam that rounding loses it", where)
        return first, second

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        dim = points.shape[1]
        constant = self.homogeneous and len(points) > 0
        at = points[:1] if constant else points
        lam, mu = self._parameters(at, "" if constant else None)
        if dim == 3 or self.plane is not PlaneState.STRAIN:
            _require(3 * lam + 2 * mu > 0, at, lam, "lam", "must exceed -2 mu / 3", "" if constant else None)
        if self.plane is PlaneState.STRESS:
            if dim == 3:
                raise ProblemError("plane stress is a model for 2D meshes; leave 'plane' out for a 3D body")
            lam = 2 * lam * mu / (lam + 2 * mu)
        matrix = isotropic_matrices(lam, mu, dim)
        return np.broadcast_to(matrix[0], (len(points), *matrix.shape[1:])) if constant else matrix

    def hoop_row(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        lam, mu = self._parameters(points)
        return np.column_stack([lam, lam, 0.0 * lam, lam + 2.0 * mu])

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self.plane is PlaneState.STRESS:
            return np.zeros(len(points))
        lam, _ = self._parameters(points)
        return np.asarray(lam * (strain[:, 0, 0] + strain[:, 1, 1]))


@known_fields
@dataclass(frozen=True, eq=False)
class Anisotropic(SingleMaterial):
    """What :meth:`Material.tensor` makes.

    Attributes
    ----------
    matrix : array (v, v) or callable
        The elasticity matrix.
    out_of_plane : array (3,) or None
        Row of the stress across the plane.
    """

    matrix: Array | Callable[[Array], object]
    out_of_plane: Array | None

    def __post_init__(self) -> None:
        refuse_time(self.matrix, "the elasticity matrix")
        if not callable(self.matrix):
            matrix = np.array(real_array(self.matrix, "the elasticity matrix", finite=False))
            if matrix.shape not in ((3, 3), (6, 6)):
                raise ProblemError(
                    f"the elasticity matrix has shape {matrix.shape}; it must be (3, 3) in 2D or (6, 6) in 3D"
                )
            _check_matrices(matrix[None], np.zeros((1, 2)), "")
            matrix.setflags(write=False)
            object.__setattr__(self, "matrix", matrix)
        if self.out_of_plane is not None:
            row = np.array(real_array(self.out_of_plane, "out_of_plane", finite=False))
            if row.shape != (3,) or not np.all(np.isfinite(row)):
                raise ProblemError(f"out_of_plane = {self.out_of_plane!r}; it must be three finite numbers")
            row.setflags(write=False)
            object.__setattr__(self, "out_of_plane", row)
        super().__post_init__()

    @property
    def kind(self) -> str:
        return "tensor"

    @property
    def formula(self) -> str:
        return "sigma = C eps"

    def stated(self) -> Mapping[str, object]:
        return {}

    @property
    def _natural_dim(self) -> int:
        return 2 if isinstance(self.matrix, np.ndarray) and len(self.matrix) == 3 else 3

    @property
    def homogeneous(self) -> bool:
        return not callable(self.matrix)

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        size = points.shape[1] * (points.shape[1] + 1) // 2
        value = self.matrix(points) if callable(self.matrix) else self.matrix
        matrix = real_array(value, "the elasticity matrix", finite=False)
        if matrix.shape not in ((size, size), (len(points), size, size)):
            raise ProblemError(
                f"the elasticity matrix has shape {matrix.shape}; a {points.shape[1]}D mesh needs ({size}, {size})"
            )
        if matrix.ndim == 2:
            if callable(self.matrix):
                _check_matrices(matrix[None], points, "")
            return np.broadcast_to(matrix, (len(points), size, size))
        _check_matrices(matrix, points, None)
        return matrix

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self.out_of_plane is None:
            return np.zeros(len(points))
        row = self.out_of_plane
        return np.asarray(row[0] * strain[:, 0, 0] + row[1] * strain[:, 1, 1] + 2 * row[2] * strain[:, 0, 1])


def _require(ok: BoolArray, points: Array, value: Array, name: str, what: str, where: str | None) -> None:
    if not np.all(ok):
        bad = int(np.flatnonzero(~np.asarray(ok))[0])
        place = f" at x = {points[bad].tolist()}" if where is None else where
        raise ProblemError(f"material constant {name} = {value[bad]:g}{place}; it {what}")


def _check_matrices(matrices: Array, points: Array, where: str | None) -> None:
    def place(mask: BoolArray | np.bool_) -> str:
        return f" at x = {points[int(np.flatnonzero(mask)[0])].tolist()}" if where is None else where

    bad = ~np.isfinite(matrices).all(axis=(1, 2))
    if bad.any():
        raise ProblemError(f"the elasticity matrix is not finite{place(bad)}; give finite numbers")
    scale = np.abs(matrices).max(axis=(1, 2))
    bad = ~((scale < LARGEST) & (scale > 1.0 / LARGEST))
    if bad.any():
        raise ProblemError(
            f"the largest entry of the elasticity matrix is {scale[bad][0]:g}{place(bad)}; it must lie between "
            f"{1.0 / LARGEST:.0e} and {LARGEST:.0e}: take another unit of force"
        )
    bad = np.abs(matrices - matrices.transpose(0, 2, 1)).max(axis=(1, 2)) > 1e-12 * scale
    if bad.any():
        raise ProblemError(f"the elasticity matrix is not symmetric{place(bad)}; pass (C + C') / 2")
    lowest = np.linalg.eigvalsh(matrices)[:, 0]
    bad = ~(lowest > 1e-14 * scale)
    if bad.any():
        raise ProblemError(
            f"the elasticity matrix is not positive definite{place(bad)} (lowest eigenvalue {lowest[bad][0]:g}); "
            "check its signs"
        )
