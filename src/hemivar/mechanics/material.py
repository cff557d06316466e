"""Linearly elastic materials."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.arrays import real_array
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, evaluate_scalar

__all__ = ["Anisotropic", "ByRegion", "Isotropic", "Material", "PlaneState"]

#: The largest lam / mu that leaves digits for mu.
_STIFF = 1e13

Number = float | Callable[[Array], Any]


class PlaneState(StrEnum):
    """What a plane model assumes about the third direction."""

    STRAIN = "strain"
    STRESS = "stress"


@dataclass(frozen=True, eq=False)
class Material(Portable):
    """A linearly elastic material.

    Make one by :meth:`lame`, :meth:`young`, :meth:`tensor` or :meth:`by_region`.

    Stresses and strains in matrices are ordered xx, yy, xy in 2D and xx, yy, zz, yz, xz, xy in 3D, shear
    strains are engineering ones, ``gamma_xy = 2 eps_xy``.
    """

    @staticmethod
    def lame(lam: Number, mu: Number, plane: PlaneState | str = PlaneState.STRAIN) -> Material:
        """Isotropic material ``sigma = lam tr(eps) I + 2 mu eps``.

        Parameters
        ----------
        lam, mu : float or callable
            Lame's constants; a callable gets points, shape (k, d), and returns shape (k,).
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``.
        """
        return Isotropic(lam, mu, plane, technical=False)  # type: ignore[arg-type]

    @staticmethod
    def young(E: Number, nu: Number, plane: PlaneState | str = PlaneState.STRAIN) -> Material:
        """Isotropic material by Young's modulus ``E > 0`` and Poisson's ratio ``-1 < nu < 0.5``.

        Parameters
        ----------
        E, nu : float or callable
            A callable gets points, shape (k, d), and returns shape (k,).
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``; plane strain is what 3D bodies long in z do.
        """
        return Isotropic(E, nu, plane, technical=True)  # type: ignore[arg-type]

    @staticmethod
    def tensor(C: Any, out_of_plane: Any = None) -> Material:
        """General (anisotropic) material ``sigma = C eps``.

        Parameters
        ----------
        C : array, shape (3, 3) in 2D or (6, 6) in 3D, or callable
            Symmetric positive definite; a callable gets points, shape (k, d), and returns (k, v, v) or (v,
            v).
        out_of_plane : array, shape (3,), or None
            In 2D the row ``c`` of ``sigma_zz = c . (eps_xx, eps_yy, gamma_xy)``. ``None`` means
            ``sigma_zz = 0`` (plane stress); it matters for von Mises stresses only.
        """
        return Anisotropic(C, out_of_plane)

    @staticmethod
    def by_region(materials: Mapping[str, Material]) -> Material:
        """Different materials in the named regions of the mesh, which must cover it without overlap."""
        return ByRegion(materials)

    @property
    def homogeneous(self) -> bool:
        """Whether the material is the same everywhere."""
        return False

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Elasticity matrices at points.

        Parameters
        ----------
        points : array, shape (k, d)
        regions : mapping of name to bool array, shape (k,)
            Which points lie in which region; needed by :meth:`by_region` only.

        Returns
        -------
        array, shape (k, v, v), v = d (d + 1) / 2
            A broadcast view (first stride zero) if the material is homogeneous.

        Raises
        ------
        ProblemError
            If the material is not positive definite at some point, which the message names.
        """
        raise NotImplementedError

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        """The stress ``sigma_zz`` of a plane model, shape (k,), at points with strains of shape (k, 2, 2)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Isotropic(Material):
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
        try:
            object.__setattr__(self, "plane", PlaneState(self.plane))
        except ValueError as error:
            raise ProblemError(f"plane = {self.plane!r}; choose 'strain' or 'stress'") from error
        if self.homogeneous:
            self._parameters(np.zeros((1, 2)), "")

    @property
    def homogeneous(self) -> bool:
        return not callable(self.first) and not callable(self.second)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two constants."""
        return ("E", "nu") if self.technical else ("lam", "mu")

    def _parameters(self, points: Array, where: str | None = None) -> tuple[Array, Array]:
        """Lame's constants at points, checked for what holds in every dimension."""
        names = self.names
        first = evaluate_scalar(self.first, points, f"material constant {names[0]}")
        second = evaluate_scalar(self.second, points, f"material constant {names[1]}")
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
        constant = self.homogeneous
        at = points[:1] if constant else points
        lam, mu = self._parameters(at, "" if constant else None)
        if dim == 3 or self.plane is PlaneState.STRESS:
            _require(3 * lam + 2 * mu > 0, at, lam, "lam", "must exceed -2 mu / 3", "" if constant else None)
        if self.plane is PlaneState.STRESS:
            if dim == 3:
                raise ProblemError("plane stress is a model for 2D meshes; leave 'plane' out for a 3D body")
            lam = 2 * lam * mu / (lam + 2 * mu)
        size = dim * (dim + 1) // 2
        matrix = np.zeros((len(at), size, size))
        matrix[:, :dim, :dim] = lam[:, None, None]
        for k in range(size):
            matrix[:, k, k] += 2 * mu if k < dim else mu
        return np.broadcast_to(matrix[0], (len(points), size, size)) if constant else matrix

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self.plane is PlaneState.STRESS:
            return np.zeros(len(points))
        lam, _ = self._parameters(points)
        return np.asarray(lam * (strain[:, 0, 0] + strain[:, 1, 1]))


@dataclass(frozen=True, eq=False)
class Anisotropic(Material):
    """What :meth:`Material.tensor` makes.

    Attributes
    ----------
    matrix : array (v, v) or callable
        The elasticity matrix.
    out_of_plane : array (3,) or None
        Row of the stress across the plane.
    """

    matrix: Any
    out_of_plane: Any

    def __post_init__(self) -> None:
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


@dataclass(frozen=True, eq=False)
class ByRegion(Material):
    """What :meth:`Material.by_region` makes.

    Attributes
    ----------
    parts : mapping of region to Material
    """

    parts: Mapping[str, Material]

    def __post_init__(self) -> None:
        if not isinstance(self.parts, Mapping):
            raise ProblemError(f"by_region takes a mapping of region names to materials, not {described(self.parts)}")
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))
        if not self.parts:
            raise ProblemError("Material.by_region needs at least one region")
        for name, part in self.parts.items():
            if not isinstance(part, Material):
                raise ProblemError(f"region '{name}': {part!r} is not a Material; use Material.lame(...) or the like")

    def _masks(self, points: Array, regions: Mapping[str, BoolArray] | None) -> dict[str, BoolArray]:
        available = dict(regions or {})
        for name in self.parts:
            if name not in available:
                raise ProblemError(
                    f"the material names region '{name}', which the mesh does not have; it has: "
                    f"{', '.join(sorted(available)) or 'none'}"
                )
        covered = np.zeros(len(points), dtype=int)
        for name in self.parts:
            covered += available[name]
        if np.any(covered != 1):
            bad = int(np.flatnonzero(covered != 1)[0])
            what = "no region" if covered[bad] == 0 else "more than one region"
            raise ProblemError(
                f"the point {points[bad].tolist()} lies in {what} that the material names; the regions "
                f"must cover the body without overlap"
            )
        return {name: np.asarray(available[name], dtype=bool) for name in self.parts}

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        size = points.shape[1] * (points.shape[1] + 1) // 2
        result = np.empty((len(points), size, size))
        for name, mask in self._masks(points, regions).items():
            if mask.any():
                inner = {key: value[mask] for key, value in (regions or {}).items()}
                result[mask] = self.parts[name].stiffness_tensor(points[mask], inner)
        return result

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        result = np.empty(len(points))
        for name, mask in self._masks(points, regions).items():
            inner = {key: value[mask] for key, value in (regions or {}).items()}
            result[mask] = self.parts[name].out_of_plane_stress(points[mask], strain[mask], inner)
        return result


def _require(ok: Any, points: Array, value: Array, name: str, what: str, where: str | None) -> None:
    if not np.all(ok):
        bad = int(np.flatnonzero(~np.asarray(ok))[0])
        place = f" at x = {points[bad].tolist()}" if where is None else where
        raise ProblemError(f"material constant {name} = {value[bad]:g}{place}; it {what}")


def _check_matrices(matrices: Array, points: Array, where: str | None) -> None:
    def place(mask: Any) -> str:
        return f" at x = {points[int(np.flatnonzero(mask)[0])].tolist()}" if where is None else where

    bad = ~np.isfinite(matrices).all(axis=(1, 2))
    if bad.any():
        raise ProblemError(f"the elasticity matrix is not finite{place(bad)}")
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
            f"the elasticity matrix is not positive definite{place(bad)} (lowest eigenvalue {lowest[bad][0]:g})"
        )
