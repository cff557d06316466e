"""Elasticity tensors in Voigt form: of elasticity, of viscosity, and of Maxwell branches that relax."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypedDict, cast

import numpy as np

from hemivar.basics.arguments import described, quoted
from hemivar.basics.arrays import LARGEST, ROUNDED, real_array
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import DataField, place_of, plain_data, require
from hemivar.mechanics.instants import refuse_time

__all__ = [
    "Branch",
    "InTime",
    "Moduli",
    "Number",
    "Viscosity",
    "isotropic_matrices",
    "lame_of",
    "matrices_at",
    "moduli",
    "plain_matrix",
]

Number = float | Callable[[Array], object]

#: Two constants of Lame's, a matrix (v, v), or a function of points that returns matrices.
Viscosity = Sequence[Number] | Sequence[Sequence[float]] | Array | Callable[[Array], object]


def lame_of(young: Array, poisson: Array) -> tuple[Array, Array]:
    """Lame's constants by Young's modulus and Poisson's ratio."""
    mu = young / (2 * (1 + poisson))
    return 2 * mu * poisson / (1 - 2 * poisson), mu


def plain_matrix(value: object, name: str) -> Array:
    """A matrix between strain and stress that does not change with the array it came from."""
    matrix = np.array(real_array(value, name, finite=False))
    if matrix.shape not in ((3, 3), (6, 6)):
        raise ProblemError(f"{name} has shape {matrix.shape}; it must be (3, 3) in 2D or (6, 6) in 3D")
    matrix.setflags(write=False)
    return matrix


def matrices_at(value: object, name: str, points: Array) -> Array:
    """A matrix, or what a function returns at points (k, d), shape (1, v, v) or (k, v, v)."""
    size = points.shape[1] * (points.shape[1] + 1) // 2
    matrix = real_array(value(points) if callable(value) else value, name, finite=False)
    if matrix.shape not in ((size, size), (len(points), size, size)):
        raise ProblemError(f"{name} has shape {matrix.shape}; a {points.shape[1]}D mesh needs ({size}, {size})")
    return matrix[None] if matrix.ndim == 2 else matrix


def isotropic_matrices(lam: Array, mu: Array, dim: int) -> Array:
    """Matrices ``lam tr(eps) I + 2 mu eps`` of constants (k,), shape (k, v, v), v = d (d + 1) / 2."""
    size = dim * (dim + 1) // 2
    matrix = np.zeros((len(lam), size, size))
    matrix[:, :dim, :dim] = lam[:, None, None]
    for k in range(size):
        matrix[:, k, k] += 2 * mu if k < dim else mu
    return matrix


@dataclass(frozen=True, eq=False)
class Moduli(PickleMixin):
    """A positive semidefinite matrix between strain, or its rate, and stress."""

    constants: tuple[Number, Number] | None  # lame's constants, or Young's modulus and Poisson's ratio if ``technical``
    matrix: Sequence[Sequence[float]] | Sequence[Number] | Array | Callable[[Array], object] | None  # (v, v)
    technical: bool
    name: str  # what it is, for messages

    def __post_init__(self) -> None:
        for value in (self.matrix, *(self.constants or ())):
            refuse_time(value, f"{self.name} of a material")
        if self.constants is None and not callable(self.matrix):
            object.__setattr__(self, "matrix", plain_matrix(self.matrix, f"the {self.name} matrix"))
        if self.homogeneous:
            if self.constants is None:
                assert isinstance(self.matrix, np.ndarray)
                self._refuse_indefinite(self.matrix[None], np.zeros((1, 2)), "")
            else:
                self._lame(np.zeros((1, 2)), 2, "")

    @property
    def homogeneous(self) -> bool:
        """Whether it is the same everywhere."""
        parts = (self.matrix,) if self.constants is None else self.constants
        return not any(callable(part) for part in parts)

    def at(self, points: Array, plane_stress: bool = False) -> Array:
        """The matrices at points (k, d), shape (k, v, v); a broadcast view if they are the same everywhere.

        In plane stress two constants give the matrix that leaves no stress out of the plane.
        """
        dim = points.shape[1]
        size = dim * (dim + 1) // 2
        constant = self.homogeneous
        if self.constants is None:
            matrix = matrices_at(self.matrix, f"the {self.name} matrix", points)
            if not constant:
                self._refuse_indefinite(matrix, points, "" if len(matrix) == 1 else None)
        else:
            at = points[:1] if constant else points
            lam, mu = self._lame(at, 3 if plane_stress else dim, "" if constant else None)
            if plane_stress:
                whole = lam + 2 * mu
                lam = 2 * lam * mu / np.where(whole > 0.0, whole, 1.0)
            matrix = isotropic_matrices(lam, mu, dim)
        return np.broadcast_to(matrix[0], (len(points), size, size)) if len(matrix) < len(points) else matrix

    def _lame(self, points: Array, dim: int, where: str | None) -> tuple[Array, Array]:
        """Lame's constants at points, positive semidefinite in so many dimensions up to rounding."""
        assert self.constants is not None
        names = ("young", "poisson") if self.technical else ("lam", "mu")
        first, second = (
            DataField(value, f"{self.name}, {name}").at(points)
            for value, name in zip(self.constants, names, strict=True)
        )
        one, two = (f"{self.name}: {name}" for name in names)
        in_range = (np.abs(first) < LARGEST) & (np.abs(second) < LARGEST)
        require(in_range, points, first, one, f"must be smaller than {LARGEST:.0e}: take another unit of force", where)
        if self.technical:
            require(first >= 0.0, points, first, one, "must not be negative", where)
            inside = (second > -1.0) & (second < 0.5)
            require(inside, points, second, two, "must lie between -1 and 0.5", where)
            return lame_of(first, second)
        require(second >= 0.0, points, second, two, "must not be negative", where)
        bulk = dim * first + 2 * second
        least = "-mu" if dim == 2 else "-2 mu / 3"
        allowed = bulk >= -ROUNDED * (np.abs(first) + second)
        require(allowed, points, first, one, f"must be at least {least}", where)
        return first, second

    def _refuse_indefinite(self, matrices: Array, points: Array, where: str | None) -> None:
        at = partial(place_of, points=points, where=where)
        scale = np.abs(matrices).max(axis=(1, 2))
        bad = ~(scale < LARGEST)
        if bad.any():
            raise ProblemError(
                f"the {self.name} matrix has entries{at(bad)} that are not finite, or beyond {LARGEST:.0e}; give "
                "finite numbers, or take another unit of force"
            )
        bad = np.abs(matrices - matrices.transpose(0, 2, 1)).max(axis=(1, 2)) > ROUNDED * scale
        if bad.any():
            raise ProblemError(f"the {self.name} matrix is not symmetric{at(bad)}; pass (C + C') / 2")
        lowest = np.linalg.eigvalsh(matrices)[:, 0]
        bad = lowest < -ROUNDED * scale
        if bad.any():
            raise ProblemError(
                f"the {self.name} matrix is not positive semidefinite{at(bad)} (lowest eigenvalue "
                f"{lowest[bad][0]:g}): it would create energy; give one without negative eigenvalues"
            )


def moduli(value: Moduli | Viscosity, name: str) -> Moduli:
    """Two constants of Lame's, or a matrix or a callable that returns matrices."""
    if isinstance(value, Moduli):
        return value
    pair = isinstance(value, Sequence) and len(value) == 2 and not any(isinstance(v, Sequence) for v in value)
    if pair or (isinstance(value, np.ndarray) and value.shape == (2,)):
        return Moduli(_pair(cast(Sequence[Number], value), name, ("lam", "mu")), None, False, name)
    if not callable(value) and real_array(value, name).ndim != 2:
        raise ProblemError(
            f"{name} = {quoted(value)}; give two constants of Lame's, ({name}=(lam, mu)), or a matrix: zero is (0, 0)"
        )
    return Moduli(None, value, False, name)


def _pair(values: Sequence[object], name: str, names: tuple[str, str]) -> tuple[Number, Number]:
    made = [plain_data(value, f"{name}, {which}", 1) for value, which in zip(values, names, strict=True)]
    return cast(Number, made[0]), cast(Number, made[1])


@dataclass(frozen=True, eq=False, kw_only=True)
class Branch(PickleMixin):
    """A spring and a dashpot in series beside the elastic body: a term of a Prony series.

    Its stress ``h`` follows ``h' + h / time = A_i eps'``, A_i the elasticity of its spring, so that it answers a
    sudden strain by ``A_i eps`` and forgets it with the relaxation time.

    Attributes
    ----------
    lame : pair of float or callable, or None
        Lame's constants of the spring; (-2/3 m, m) relaxes shear only.
    young, poisson : float, callable or None
        Young's modulus and Poisson's ratio in place of Lame's constants.
    tensor : array, shape (v, v), callable or None
        An elasticity matrix in place of the constants, as in :meth:`Material.tensor`.
    time : float
        The relaxation time.

    Raises
    ------
    ProblemError
        Not one of the ways is given, the spring is not positive semidefinite, or the time is not positive.
    """

    lame: tuple[Number, Number] | None = field(default=None, metadata=stated(Form.PAIR))
    young: Number | None = field(default=None, metadata=stated(Form.QUANTITY))
    poisson: Number | None = field(default=None, metadata=stated(Form.QUANTITY))
    tensor: Array | Callable[[Array], object] | None = field(default=None, metadata=stated(Form.MATRIX, "elasticity"))
    time: float = field(metadata=stated(Form.NUMBER, "the relaxation time", above=0.0))

    def __post_init__(self) -> None:
        keys = [key for key in ("lame", "young", "tensor") if getattr(self, key) is not None]
        if len(keys) != 1 or (self.poisson is None) != (self.young is None):
            given = " and ".join([*keys, *(["poisson"] if self.poisson is not None else [])]) or "nothing"
            raise ProblemError(f"a branch is given by {given}; give lame, or young and poisson, or tensor")
        time = self.time
        if isinstance(time, bool) or not isinstance(time, int | float | np.number) or not 0.0 < time < np.inf:
            raise ProblemError(f"the relaxation time of a branch is {quoted(time)}; it must be a positive number")
        if not 1.0 / LARGEST <= time <= LARGEST:
            raise ProblemError(
                f"the relaxation time of a branch is {described(time)}; it must lie between {1.0 / LARGEST:g} and "
                f"{LARGEST:g}: take another unit of time"
            )
        object.__setattr__(self, "time", float(time))
        spring = self.moduli
        if self.tensor is not None:
            object.__setattr__(self, "tensor", spring.matrix)
        elif self.lame is not None:
            object.__setattr__(self, "lame", spring.constants)

    @property
    def moduli(self) -> Moduli:
        """The elasticity of the spring."""
        name = "branch"
        if self.tensor is not None:
            return Moduli(None, self.tensor, False, name)
        if self.young is not None:
            return Moduli(_pair((self.young, self.poisson), name, ("young", "poisson")), None, True, name)
        if (
            not isinstance(self.lame, Sequence | np.ndarray)
            or getattr(self.lame, "ndim", 1) != 1
            or len(self.lame) != 2
        ):
            raise ProblemError(f"a branch has lame = {quoted(self.lame)}; give two constants, (lam, mu)")
        return Moduli(_pair(self.lame, name, ("lam", "mu")), None, False, name)


class InTime(TypedDict, total=False):
    """What materials have beside their elasticity, see :class:`Material`."""

    density: Number | None
    viscosity: Moduli | Viscosity | None
    branches: Sequence[Branch]
