"""Materials: elastic, with density, viscosity and branches that relax where time matters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import described
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, check_finite, evaluate_scalar
from hemivar.mechanics.instants import refuse_time
from hemivar.mechanics.moduli import Branch, Moduli, Number, Viscosity, isotropic_matrices, moduli

__all__ = ["Anisotropic", "BoundsBy", "Isotropic", "Material", "PlaneState", "SingleMaterial", "no_matrices"]

#: The largest lam / mu that leaves digits for mu.
_STIFF = 1e13


class PlaneState(StrEnum):
    """What a plane model assumes about the third direction."""

    STRAIN = "strain"
    STRESS = "stress"


class BoundsBy(StrEnum):
    """How the bounds of the tangent of a material were found."""

    CLOSED_FORM = "closed form"
    INTERVALS = "intervals"
    SAMPLED = "sampled"

    @property
    def proved(self) -> bool:
        """Whether they hold at every strain, and not only at those that were tried."""
        return self is not BoundsBy.SAMPLED


@dataclass(frozen=True, eq=False)
class Material(Portable):
    """An elastic material of small strains, linear or with a stored energy.

    Make one by :meth:`lame`, :meth:`young`, :meth:`tensor` or :meth:`by_region`, and one that is not linear by
    :meth:`hencky`.

    Stresses and strains in matrices are ordered xx, yy, xy in 2D and xx, yy, zz, yz, xz, xy in 3D, shear
    strains are engineering ones, ``gamma_xy = 2 eps_xy``.

    A body that moves in time has a stress ``sigma = A eps + V eps' + sum_i h_i`` with a viscosity V (Kelvin and Voigt)
    and branches ``h_i' + h_i / T_i = A_i eps'`` (Maxwell, Prony), and a mass. Each of the makers takes them by keyword:

    density : float or callable, optional
        Mass per volume, positive; needed where inertia counts.
    viscosity : pair of float or callable, or array (v, v) or callable, optional
        V by two constants of Lame's kind, or as a matrix; it may be semidefinite or zero.
    branches : sequence of Branch
        In plane stress V and the springs of branches given by constants are taken each in its own plane form, which is
        exact where they are proportional to the elasticity.

    What does not depend on time takes no notice of them.
    """

    @staticmethod
    def lame(
        lam: Number,
        mu: Number,
        plane: PlaneState | str = PlaneState.STRAIN,
        *,
        density: Number | None = None,
        viscosity: Moduli | Viscosity | None = None,
        branches: Sequence[Branch] = (),
    ) -> Material:
        """Isotropic material ``sigma = lam tr(eps) I + 2 mu eps``.

        Parameters
        ----------
        lam, mu : float or callable
            Lame's constants; a callable gets points, shape (k, d), and returns shape (k,).
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``.
        density, viscosity, branches
            See :class:`Material`.
        """
        more = {"density": density, "viscosity": viscosity, "branches": branches}
        return Isotropic(lam, mu, plane, technical=False, **more)  # type: ignore[arg-type]

    @staticmethod
    def young(
        E: Number,
        nu: Number,
        plane: PlaneState | str = PlaneState.STRAIN,
        *,
        density: Number | None = None,
        viscosity: Moduli | Viscosity | None = None,
        branches: Sequence[Branch] = (),
    ) -> Material:
        """Isotropic material by Young's modulus ``E > 0`` and Poisson's ratio ``-1 < nu < 0.5``.

        Parameters
        ----------
        E, nu : float or callable
            A callable gets points, shape (k, d), and returns shape (k,).
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``; plane strain is what 3D bodies long in z do.
        density, viscosity, branches
            See :class:`Material`; the viscosity is given by two constants of Lame's kind here too.
        """
        more = {"density": density, "viscosity": viscosity, "branches": branches}
        return Isotropic(E, nu, plane, technical=True, **more)  # type: ignore[arg-type]

    @staticmethod
    def tensor(
        C: ArrayLike | Callable[[Array], object],
        out_of_plane: ArrayLike | None = None,
        *,
        density: Number | None = None,
        viscosity: Moduli | Viscosity | None = None,
        branches: Sequence[Branch] = (),
    ) -> Material:
        """General (anisotropic) material ``sigma = C eps``.

        Parameters
        ----------
        C : array, shape (3, 3) in 2D or (6, 6) in 3D, or callable
            Symmetric positive definite; a callable gets points, shape (k, d), and returns (k, v, v) or (v,
            v).
        out_of_plane : array, shape (3,), or None
            In 2D the row ``c`` of ``sigma_zz = c . (eps_xx, eps_yy, gamma_xy)``. ``None`` means
            ``sigma_zz = 0`` (plane stress); it matters for von Mises stresses only.
        density, viscosity, branches
            See :class:`Material`.
        """
        more = {"density": density, "viscosity": viscosity, "branches": branches}
        return Anisotropic(C, out_of_plane, **more)  # type: ignore[arg-type]

    @staticmethod
    def by_region(materials: Mapping[str, Material]) -> Material:
        """Different materials in the named regions of the mesh, which must cover it without overlap.

        Each brings its own density, viscosity and branches: a density all of them or none, the others as it comes.
        """
        with IMPORTS:
            from hemivar.mechanics.composed_material import ByRegion

        return ByRegion(materials)

    @staticmethod
    def hencky(
        bulk: Number,
        shear: Number,
        softened: Number,
        strain: Number,
        plane: PlaneState | str = PlaneState.STRAIN,
        *,
        density: Number | None = None,
        viscosity: Moduli | Viscosity | None = None,
        branches: Sequence[Branch] = (),
    ) -> Material:
        """Material of Hencky's kind, whose shear softens as the strain changes shape (deformation theory).

        ``sigma = k tr(eps) I + 2 mu0 (q + (1 - q) / sqrt(1 + |dev eps|^2 / e0^2)) dev eps``.

        Parameters
        ----------
        bulk, shear : float or callable
            The bulk modulus k and the shear modulus mu0 at small strain, positive; a callable gets points, shape
            (k, d), and returns shape (k,).
        softened : float or callable
            The part q of the shear modulus that is left at large strain, ``0 < q <= 1``.
        strain : float or callable
            The size e0 of the deviator at which it softens, positive.
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``. In plane strain the deviator is that of space.
        density, viscosity, branches
            See :class:`Material`.
        """
        with IMPORTS:
            from hemivar.mechanics.named_energies import Hencky

        more = {"density": density, "viscosity": viscosity, "branches": branches}
        return Hencky(bulk, shear, softened, strain, plane, **more)  # type: ignore[arg-type]

    @property
    def homogeneous(self) -> bool:
        """Whether the material is the same everywhere."""
        return False

    @property
    def uniform(self) -> bool:
        """Whether the elasticity of every region is stated by numbers, which hold everywhere in it."""
        return self.homogeneous

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Elasticity matrices at points; of a material that is not linear, those at zero strain.

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

    # ---- the stored energy ----------------------------------------------------------------------------------

    @property
    def linear(self) -> bool:
        """Whether the stress is linear in the strain, everywhere in the body."""
        return True

    @property
    def bounds_by(self) -> BoundsBy:
        """How :meth:`lower_tensor` and :meth:`upper_tensor` were found; of several the least certain way."""
        return BoundsBy.CLOSED_FORM

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """The stored energy W per volume.

        Parameters
        ----------
        points : array, shape (k, d)
        strain : array, shape (k, v)
            In the order of the matrices, with engineering shear strains; zero strain has energy zero.
        regions : mapping of name to bool array, shape (k,)
            Which points lie in which region; needed by :meth:`by_region` only.

        Returns
        -------
        array, shape (k,)
        """
        return np.asarray(0.5 * np.einsum("ki,kij,kj->k", strain, self.stiffness_tensor(points, regions), strain))

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """The stress, the derivative of :meth:`energy` by the strain, shape (k, v)."""
        return np.asarray(np.einsum("kij,kj->ki", self.stiffness_tensor(points, regions), strain))

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """The derivative of :meth:`stress` by the strain, shape (k, v, v), symmetric."""
        return self.stiffness_tensor(points, regions)

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices C_low, shape (k, v, v), such that :meth:`tangent` minus C_low is semidefinite at every strain.

        Zero matrices: none is known.
        """
        return self.stiffness_tensor(points, regions)

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices C_up, shape (k, v, v), such that C_up minus :meth:`tangent` is semidefinite at every strain."""
        return self.stiffness_tensor(points, regions)

    # ---- what matters in time -------------------------------------------------------------------------------

    @property
    def inert(self) -> bool:
        """Whether it has a density."""
        return False

    @property
    def viscous(self) -> bool:
        """Whether it has a viscosity, be it in a part of the body only."""
        return False

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        """The different relaxation times of the branches, shortest first; branches of the same time are one."""
        return ()

    def density_at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array | None:
        """Mass per volume at points, shape (k,); None if there is none.

        Raises
        ------
        ProblemError
            If it is not positive at some point.
        """
        return None

    def viscosity_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices V of the viscosity at points, shape (k, v, v); zero where there is none.

        Raises
        ------
        ProblemError
            If V is not positive semidefinite at some point.
        """
        return no_matrices(points)

    def branch_tensor(self, number: int, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices of the branches of one of the :attr:`relaxation_times` at points, shape (k, v, v).

        Raises
        ------
        ProblemError
            If one is not positive semidefinite at some point.
        """
        raise IndexError(number)

    def homogeneous_in(self, viscous: bool, numbers: Sequence[int] = ()) -> bool:
        """Whether the viscosity, if asked for, and the branches of some numbers are the same everywhere."""
        return True

    def effective(self, viscous: float = 0.0, branches: Sequence[float] = ()) -> Material:
        """The elastic material ``A + viscous V + sum_i branches_i A_i``, which a step in time is made of.

        Parameters
        ----------
        viscous : float
            Not negative.
        branches : sequence of float
            One for each of the :attr:`relaxation_times`, not negative; none leaves them all out.
        """
        with IMPORTS:
            from hemivar.mechanics.composed_material import Combination

        if not branches:
            branches = (0.0,) * len(self.relaxation_times)
        return Combination(self, 1.0, viscous, tuple(branches)) if viscous or any(branches) else self


def no_matrices(points: Array) -> Array:
    """Matrices that are zero, at points (k, d), shape (k, v, v)."""
    size = points.shape[1] * (points.shape[1] + 1) // 2
    return np.broadcast_to(np.zeros((size, size)), (len(points), size, size))


@dataclass(frozen=True, eq=False)
class SingleMaterial(Material):
    """A material of one kind: what it has of density, viscosity and branches.

    Attributes
    ----------
    density : float, callable or None
    viscosity : Moduli or None
    branches : tuple of Branch
    """

    density: Number | None = field(default=None, kw_only=True)
    viscosity: Moduli | None = field(default=None, kw_only=True)
    branches: tuple[Branch, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        refuse_time(self.density, "density")
        if self.density is not None and not callable(self.density):
            given = check_finite(self.density, "density")
            if given.ndim != 0:
                raise ProblemError(f"density has shape {given.shape}; it must be one number or a callable")
            object.__setattr__(self, "density", float(given))
            _check_density(np.atleast_1d(given), np.zeros((1, 2)), "")
        if self.viscosity is not None:
            object.__setattr__(self, "viscosity", moduli(self.viscosity, "viscosity"))
        branches = (self.branches,) if isinstance(self.branches, Branch) else self.branches
        if not isinstance(branches, Sequence) or not all(isinstance(branch, Branch) for branch in branches):
            raise ProblemError(
                f"branches is {described(self.branches)}; give a list of Branch(lame=(lam, mu), time=T) or the like"
            )
        object.__setattr__(self, "branches", tuple(branches))

    @property
    def _in_plane_stress(self) -> bool:
        return False

    @property
    def inert(self) -> bool:
        return self.density is not None

    @property
    def viscous(self) -> bool:
        return self.viscosity is not None

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        return tuple(sorted({branch.time for branch in self.branches}))

    def _springs(self, number: int) -> list[Moduli]:
        time = self.relaxation_times[number]
        return [branch.moduli for branch in self.branches if branch.time == time]

    def density_at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array | None:
        if self.density is None:
            return None
        density = evaluate_scalar(self.density, points, "density")
        _check_density(density, points, None)
        return density

    def viscosity_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return no_matrices(points) if self.viscosity is None else self.viscosity.at(points, self._in_plane_stress)

    def branch_tensor(self, number: int, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        springs = [spring.at(points, self._in_plane_stress) for spring in self._springs(number)]
        return springs[0] if len(springs) == 1 else np.sum(springs, axis=0)

    def homogeneous_in(self, viscous: bool, numbers: Sequence[int] = ()) -> bool:
        parts = [spring for number in numbers for spring in self._springs(number)]
        parts += [self.viscosity] if viscous and self.viscosity is not None else []
        return all(part.homogeneous for part in parts)


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
        try:
            object.__setattr__(self, "plane", PlaneState(self.plane))
        except ValueError as error:
            raise ProblemError(f"plane = {self.plane!r}; choose 'strain' or 'stress'") from error
        for name, value in zip(self.names, (self.first, self.second), strict=True):
            refuse_time(value, f"material constant {name}")
        if self.homogeneous:
            self._parameters(np.zeros((1, 2)), "")
        super().__post_init__()

    @property
    def _in_plane_stress(self) -> bool:
        return self.plane is PlaneState.STRESS

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
        matrix = isotropic_matrices(lam, mu, dim)
        return np.broadcast_to(matrix[0], (len(points), *matrix.shape[1:])) if constant else matrix

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        if self.plane is PlaneState.STRESS:
            return np.zeros(len(points))
        lam, _ = self._parameters(points)
        return np.asarray(lam * (strain[:, 0, 0] + strain[:, 1, 1]))


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


def _check_density(density: Array, points: Array, where: str | None) -> None:
    if not (density > 0.0).all():
        bad = int(np.flatnonzero(~(density > 0.0))[0])
        place = f" at x = {points[bad].tolist()}" if where is None else where
        raise ProblemError(f"density = {density[bad]:g}{place}; it must be positive")
    if not ((density < LARGEST) & (density > 1.0 / LARGEST)).all():
        bad = int(np.argmax(np.abs(np.log(density))))
        raise ProblemError(
            f"density = {density[bad]:g}; it must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}: take other units"
        )


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
