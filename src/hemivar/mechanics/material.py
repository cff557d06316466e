"""Materials: elastic, with density, viscosity and branches that relax where time matters."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray
from hemivar.mechanics.material_words import BoundsBy, PlaneState, ScalarKind, StrainMeasure
from hemivar.mechanics.moduli import InTime, Number

if TYPE_CHECKING:
    from hemivar.mechanics.gradient_energy import Coefficient
    from hemivar.mechanics.material_description import MaterialDescription
    from hemivar.mechanics.per_volume import Regional

__all__ = ["Material", "no_matrices"]


def _made(what: str, *constants: object, **named: object) -> Material:
    """What a class or a function of a module of this room makes."""
    module, _, name = what.partition(".")
    with IMPORTS:
        maker: Callable[..., Material] = getattr(importlib.import_module(f"hemivar.mechanics.{module}"), name)
    return maker(*constants, **named)


@dataclass(frozen=True, eq=False)
class Material(PickleMixin):
    """An elastic material of small strains, made by one of its constructors.

    >>> import hemivar as hv
    >>> steel = hv.Material.young(210e3, 0.3, plane="stress")
    >>> soil = hv.Material.hencky(bulk=20.0, shear=4.0, softened=0.25, strain=0.05)
    >>> steel.linear, soil.linear
    (True, False)

    * linear: :meth:`young` (E, nu), :meth:`lame` (lam, mu), :meth:`tensor`; of one component :meth:`gradient`;
    * with a stored energy: :meth:`hencky`, :meth:`ramberg_osgood`, :meth:`locking`, :meth:`potential`;
    * different in named regions: :meth:`by_region`.

    :meth:`describe` shows its constants.

    In matrices the order is xx, yy, xy in 2D and xx, yy, zz, yz, xz, xy in 3D, with the engineering shear strain
    ``gamma_xy = 2 eps_xy``.

    In time the stress is ``sigma = A eps + V eps' + sum_i h_i``, with a viscosity V (Kelvin and Voigt) and branches
    ``h_i' + h_i / T_i = A_i eps'`` (Maxwell, Prony).  Statics ignores them.  Each constructor takes by keyword:

    density : float or callable, optional
        Mass per volume, positive; needed where inertia counts.
    viscosity : pair of float or callable, or array (v, v) or callable, optional
        V by two constants of Lame's kind, or as a matrix; it may be semidefinite or zero.
    branches : sequence of Branch
        In plane stress V and the springs of branches given by constants are taken each in its own plane form, which is
        exact where they are proportional to the elasticity.
    """

    @staticmethod
    def lame(
        lam: Number,
        mu: Number,
        plane: PlaneState | str = PlaneState.STRAIN,
        **in_time: Unpack[InTime],
    ) -> Material:
        """Isotropic material ``sigma = lam tr(eps) I + 2 mu eps``.

        Parameters
        ----------
        lam, mu : float or callable
            Lame's constants; a callable gets points, shape (k, d), and returns shape (k,).
        plane : PlaneState or str
            For 2D: ``"strain"`` (default), ``"stress"`` or ``"axisymmetric"``, see :class:`PlaneState`.
        **in_time
            Density, viscosity and branches, see :class:`Material`.
        """
        return _made("linear_material.Lame", lam, mu, plane, **in_time)

    @staticmethod
    def young(
        E: Number,
        nu: Number,
        plane: PlaneState | str = PlaneState.STRAIN,
        **in_time: Unpack[InTime],
    ) -> Material:
        """Isotropic material by Young's modulus ``E > 0`` and Poisson's ratio ``-1 < nu < 0.5``.

        Parameters
        ----------
        E, nu : float or callable
            A callable gets points, shape (k, d), and returns shape (k,).
        plane : PlaneState or str
            For 2D: ``"strain"`` (default), ``"stress"`` or ``"axisymmetric"``, see :class:`PlaneState`; plane strain is
            what 3D bodies long in z do.
        **in_time
            Density, viscosity and branches, see :class:`Material`; the viscosity is given by two constants of Lame's
            kind here too.
        """
        return _made("linear_material.Young", E, nu, plane, **in_time)

    @staticmethod
    def tensor(
        C: ArrayLike | Callable[[Array], object],
        out_of_plane: ArrayLike | None = None,
        **in_time: Unpack[InTime],
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
        **in_time
            Density, viscosity and branches, see :class:`Material`.
        """
        return _made("linear_material.Anisotropic", C, out_of_plane, **in_time)

    @staticmethod
    def gradient(
        coefficient: Coefficient | Mapping[str, Coefficient],
        kind: ScalarKind | str = ScalarKind.MEMBRANE,
        *,
        density: Regional | None = None,
        viscosity: Regional | None = None,
        capacity: Regional | None = None,
    ) -> Material:
        """The material of one component u: a membrane, antiplane shear or heat, with the flux ``A grad u``.

        Parameters
        ----------
        coefficient : float, array (d, d), callable, GradientEnergy, or mapping of region name to one of these
            A: tension, shear modulus or conductivity, positive.  A tensor is symmetric and positive definite; a
            callable gets points, shape (k, d), and returns shape (k,) or (k, d, d).  The regions of a mapping must
            cover the mesh without overlap.
        kind : ScalarKind or str
            ``"membrane"`` (default), ``"antiplane"`` or ``"heat"``: what things are called.
        density : float, callable, mapping of region name to one of these, or None
            Factor of u'': mass per area of a membrane, or per volume in antiplane shear.
        viscosity : likewise
            Factor of grad u', beside ``A grad u``.
        capacity : likewise
            Of heat: heat per volume and degree, the factor of u'.

        Raises
        ------
        ProblemError
            A number is not what it must be, or heat has a density or a viscosity, something else a capacity.
        """
        return _made("gradient_material.GradientMaterial", coefficient, kind, density, viscosity, capacity)

    @staticmethod
    def by_region(materials: Mapping[str, Material]) -> Material:
        """Different materials in the named regions of the mesh, which must cover it without overlap.

        Each brings its own density, viscosity and branches: a density all of them or none, the others as it comes.
        """
        return _made("composed_material.ByRegion", materials)

    @staticmethod
    def hencky(
        bulk: Number,
        shear: Number,
        softened: Number,
        strain: Number,
        plane: PlaneState | str = PlaneState.STRAIN,
        **in_time: Unpack[InTime],
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
        **in_time
            Density, viscosity and branches, see :class:`Material`.
        """
        return _made("named_energies.Hencky", bulk, shear, softened, strain, plane, **in_time)

    @staticmethod
    def ramberg_osgood(
        E: Number,
        nu: Number,
        yield_stress: Number,
        exponent: Number,
        offset: Number = 3.0 / 7.0,
        linear_from: Number | None = None,
        plane: PlaneState | str = PlaneState.STRAIN,
        **in_time: Unpack[InTime],
    ) -> Material:
        """Material of Ramberg and Osgood, in the deformation theory of plasticity with von Mises' stress.

        A bar under the stress sigma stretches by ``sigma/E + offset (sigma/E) (sigma/yield_stress)^(exponent - 1)``.

        Parameters
        ----------
        E, nu : float or callable
            Young's modulus and Poisson's ratio at small strain; a callable gets points, shape (k, d), and returns
            shape (k,).
        yield_stress : float or callable
            Positive.
        exponent : float or callable
            At least 1; 5 to 20 for metals.
        offset : float or callable
            Plastic over elastic strain at the yield stress, positive.
        linear_from : float, callable or None
            The size of the deviator ``|dev eps|`` from which on the stress grows linearly, with the slope that it has
            there. Without it the slope falls to zero: then no solution is known to be the only one, and no error is
            bounded.
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``.
        **in_time
            Density, viscosity and branches, see :class:`Material`.
        """
        return _made(
            "named_energies.RambergOsgood", E, nu, yield_stress, exponent, offset, linear_from, plane, **in_time
        )

    @staticmethod
    def locking(
        bulk: Number,
        shear: Number,
        stiffening: Number,
        strain: Number,
        measure: StrainMeasure | str = StrainMeasure.DEVIATOR,
        plane: PlaneState | str = PlaneState.STRAIN,
        **in_time: Unpack[InTime],
    ) -> Material:
        """Elastic material with projection on a convex set of strains, beyond which it stiffens.

        ``sigma = C eps + beta (eps - P_K eps)``, K the strains with ``|dev eps| <= strain``. A large beta makes a
        locking material.

        Parameters
        ----------
        bulk, shear : float or callable
            Bulk and shear modulus within the set, positive; a callable gets points, shape (k, d), and returns shape
            (k,).
        stiffening : float or callable
            beta, a stress, positive.
        strain : float or callable
            The size of the set, positive.
        measure : StrainMeasure or str
            What is limited: ``"deviator"`` (default), the size of the deviator, or ``"strain"``, that of the strain.
        plane : PlaneState or str
            For 2D: ``"strain"`` (default) or ``"stress"``.
        **in_time
            Density, viscosity and branches, see :class:`Material`.
        """
        return _made("named_energies.Locking", bulk, shear, stiffening, strain, measure, plane, **in_time)

    @staticmethod
    def potential(
        energy: str | Callable[[Array], object],
        stress: Callable[[Array], object] | None = None,
        tangent: Callable[[Array], object] | None = None,
        *,
        reach: float,
        plane: PlaneState | str = PlaneState.STRAIN,
        **in_time: Unpack[InTime],
    ) -> Material:
        """Material by a stored energy of your own, as a formula or as Python functions.

        Parameters
        ----------
        energy : str or callable
            A formula of ``tr`` and ``dev2``, the trace of the strain and the square of the size of its deviator, both
            those of space; or of the components ``exx, eyy, ezz, eyz, exz, exy``. Its derivatives are found in
            symbols. Or a function of strains, shape (k, v) in the order of the matrices, that returns shape (k,).
        stress, tangent : callable
            For a function only: its first and second derivatives, shapes (k, v) and (k, v, v).
        reach : float
            Strains up to this size ``|eps|`` are examined for the bounds of the tangent: those of space, so that in
            plane stress the strain across the plane counts. Bounds of a formula are proved by intervals where they
            can; those of functions are sampled, and called so.
        plane : PlaneState or str
            For 2D and formulas of ``tr`` and ``dev2``: ``"strain"`` (default) or ``"stress"``.
        **in_time
            Density, viscosity and branches, see :class:`Material`.

        Raises
        ------
        ProblemError
            The energy is not convex, or zero strain has an energy or a stress; the message names the strain.
        """
        return _made("own_energies.own_energy", energy, stress, tangent, reach=reach, plane=plane, **in_time)

    @property
    def scalar(self) -> ScalarKind | None:
        """What the field is where it has one component; None of a displacement."""
        return None

    @property
    def axisymmetric(self) -> bool:
        """Whether plane meshes are half sections of bodies of revolution: x is the radius and y the axis."""
        return False

    def hoop_row(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Stress around the axis for strains rr, zz, rz (doubled) and around the axis, of axial symmetry; (k, 4)."""
        raise NotImplementedError

    @property
    def capacity(self) -> Regional | None:
        """What stores the field, the factor of its rate: that of heat."""
        return None

    def check_on(self, dim: int, regions: Sequence[str]) -> None:
        """Refuse what does not go with a mesh of so many directions and of these regions."""

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

    def stiffness_across(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """``sigma_zz`` of a plane model for a unit strain across the plane alone, shape (k,); nan if not known."""
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

    @property
    def reach(self) -> float:
        """The size ``|eps|`` of the strain in space up to which the bounds hold; inf where they hold at every strain.

        In plane stress the strain across the plane counts.
        """
        return np.inf

    def describe(self, point: Sequence[float] | None = None) -> MaterialDescription:
        """Its law, its constants, and the bounds of its tangent, with how they were found; ``print`` shows them.

        Parameters
        ----------
        point : sequence of float, optional
            Where constants that vary are evaluated.
        """
        raise NotImplementedError

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


def no_matrices(points: Array) -> Array:
    """Matrices that are zero, at points (k, d), shape (k, v, v)."""
    size = points.shape[1] * (points.shape[1] + 1) // 2
    return np.broadcast_to(np.zeros((size, size)), (len(points), size, size))
