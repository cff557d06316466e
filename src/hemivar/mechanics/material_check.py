"""A conformance kit: is a material, one of your own too, consistent with itself?

from hemivar.mechanics import check_material
check_material(Material.potential(...))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.conformance import ConformanceError, ConformanceReport, Step, change_and_integral, failures_of
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.composed_material import ByRegion
from hemivar.mechanics.energy_bounds import once, strain_text, tried_strains
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_words import PlaneState

__all__ = ["MaterialError", "MaterialReport", "check_material"]

#: Strains that are tried, the largest if the material names none, and the length of steps relative to them.
_COUNT, _LARGEST, _STEP = 300, 1.0, 0.02
#: What counts as equal: integrals along steps, and eigenvalues, relative to the stiffness.
_INTEGRAL, _EIGENVALUE = 1e-4, 1e-8
#: Part of the largest answer that rounding may take anywhere: of formulas such as sqrt(1 + dev2) - 1.
_ROUNDING = 1e-15


class MaterialError(ConformanceError):
    """A material contradicts itself; the message lists how, with the strain at which it does."""


@dataclass(frozen=True)
class MaterialReport(ConformanceReport):
    """What the kit tried and found about a material."""

    subject: ClassVar[str] = "material"
    error: ClassVar[type[ConformanceError]] = MaterialError


@expecting(material=Material, reach=positive, seed=int, raises=bool)
def check_material(
    material: Material, *, reach: float | None = None, seed: int = 0, raises: bool = True
) -> MaterialReport:
    """Check stress, tangent and bounds of a material against its energy, at many strains in the plane and in space.

    Of materials by region every one is checked. A material of the plane alone, such as one in plane stress, is checked
    there, and one of space alone in space.

    Parameters
    ----------
    material : Material
    reach : float, optional
        Strains of space up to this size ``|eps|`` are tried; the reach of the material, 1 at most, by default. In plane
        stress the strain across the plane counts.
    seed : int
        Of the random strains and places.
    raises : bool
        Raise if something is wrong; with False the report says so.

    Returns
    -------
    MaterialReport

    Raises
    ------
    MaterialError
        With the list of failures, each with the strain at which it was found.
    """
    if isinstance(material, ByRegion):
        reports = [
            (name, check_material(part, reach=reach, seed=seed, raises=False)) for name, part in material.parts.items()
        ]
        report = MaterialReport(
            material.describe().name,
            tuple(f"region '{name}': {check}" for name, one in reports for check in one.checks),
            tuple(f"region '{name}': {failure}" for name, one in reports for failure in one.failures),
        )
    else:
        size = min(material.reach, _LARGEST) if reach is None else reach
        results = [failures_of(_Checker(material, dim, size, seed).steps()) for dim in _dims(material)]
        checks, failures = (tuple(one for part in parts for one in part) for parts in zip(*results, strict=True))
        report = MaterialReport(getattr(material, "kind", type(material).__name__), checks, failures)
    return report.or_raised(raises)


def _dims(material: Material) -> Sequence[int]:
    """The dimensions in which a material answers; both if it answers in none, so that the kit says why."""
    dims = []
    for dim in (2, 3):
        try:
            at = np.full((1, dim), 0.5)
            material.lower_tensor(at), material.tangent(at, np.zeros((1, dim * (dim + 1) // 2)))
        except (ProblemError, ValueError, IndexError):
            continue
        dims.append(dim)
    return dims or (2, 3)


def _shorter_by_across(strain: Array) -> Array:
    """Strains of the plane (k, 3), made so much smaller that with those across it they are no larger than they were.

    In plane stress these are at most the trace where the secant moduli are positive.
    """
    square, trace = np.sum((strain / np.diag(once(2))) ** 2, axis=1), strain[:, :2].sum(axis=1)
    return np.asarray(strain * np.sqrt(square / (square + trace**2))[:, None])


class _Checker:
    """Strains at which a material is tried in one dimension, and the questions about its answers."""

    def __init__(self, material: Material, dim: int, reach: float, seed: int) -> None:
        self.material, self.dim = material, dim
        strain = tried_strains(dim, reach, _COUNT, seed)
        if getattr(material, "plane", None) is PlaneState.STRESS:
            strain = _shorter_by_across(strain)
        random = np.random.default_rng(seed)
        self.points = random.uniform(0.0, 1.0, (len(strain), dim))
        direction = random.normal(size=strain.shape) @ once(dim)
        sizes = np.linalg.norm(strain, axis=1) / np.linalg.norm(direction, axis=1)
        self.strain, self.step = 0.98 * strain, _STEP * sizes[:, None] * direction

    def steps(self) -> list[Step]:
        where = "in the plane" if self.dim == 2 else "in space"
        return [
            (f"the material answers with finite numbers of the right shape {where}", self.shapes),
            (f"energy and stress are zero at zero strain {where}", self.zero),
            (f"the stress is the derivative of the energy {where}", self.stress),
            (f"the tangent is the derivative of the stress {where}", self.tangent),
            (f"the tangent is symmetric {where}", self.symmetric),
            (f"the lower tensor is below the upper one, and not negative {where}", self.tensors),
            (f"the stress is strongly monotone with the lower tensor {where}", self.monotone),
            (f"the stress grows no faster than with the upper tensor {where}", self.growth),
            (f"many points at once give what each gives alone {where}", self.together),
        ]

    def _named(self, row: int, strain: Array | None = None) -> str:
        at = (self.strain if strain is None else strain)[row]
        return f"at the strain {strain_text(at / np.diag(once(self.dim)), self.dim)}"

    def shapes(self) -> str | None:
        k, v = self.strain.shape
        answers = (
            ("energy", self.material.energy(self.points, self.strain), (k,)),
            ("stress", self.material.stress(self.points, self.strain), (k, v)),
            ("tangent", self.material.tangent(self.points, self.strain), (k, v, v)),
            ("lower tensor", self.material.lower_tensor(self.points), (k, v, v)),
            ("upper tensor", self.material.upper_tensor(self.points), (k, v, v)),
        )
        for name, answer, shape in answers:
            if np.shape(answer) != shape:
                return f"the {name} has shape {np.shape(answer)} for strains of shape {(k, v)}, not {shape}"
            bad = ~np.isfinite(answer).reshape(k, -1).all(axis=1)
            if bad.any():
                return f"the {name} is not finite {self._named(int(np.argmax(bad)))}"
        return None

    def zero(self) -> str | None:
        none = np.zeros_like(self.strain)
        energy, stress = self.material.energy(self.points, none), self.material.stress(self.points, none)
        unit = np.abs(self.material.upper_tensor(self.points)).max()
        largest = np.abs(self.strain).max()
        if np.abs(energy).max() > 1e-12 * unit * largest**2:
            return f"the energy is {energy[np.argmax(np.abs(energy))]:.6g}"
        if np.abs(stress).max() > 1e-12 * unit * largest:
            return f"the stress has the component {stress.ravel()[np.argmax(np.abs(stress))]:.6g}"
        return None

    def _along(self, of: Callable[[Array], Array], rate: Callable[[Array, Array], Array]) -> str | None:
        """Whether the change of an answer along steps is the integral of its rate, but for single kinks."""
        upper = self.material.upper_tensor(self.points)
        expected = np.einsum("kij,kj->ki", upper, self.step)

        unit = np.abs(expected).max(axis=1)
        wrongs = []
        for part in range(4):
            start = self.strain + 0.25 * part * self.step
            change, integral = change_and_integral(of, rate, start, 0.25 * self.step)
            size = unit * np.linalg.norm(self.strain, axis=1) if change.ndim == 1 else unit
            error = np.abs(change - integral).reshape(len(unit), -1).max(axis=1)
            answer = np.abs(of(start)).reshape(len(unit), -1).max(axis=1)
            bad = ~(error <= _INTEGRAL * size + 1e-13 * answer + _ROUNDING * answer.max())
            wrongs.append((bad, change.reshape(len(unit), -1), integral.reshape(len(unit), -1)))
        often = np.sum([bad for bad, *_ in wrongs], axis=0) >= 2  # a kink is in one part
        if not often.any():
            return None
        row = int(np.argmax(often))
        _, change, integral = next(one for one in wrongs if one[0][row])
        column = int(np.argmax(np.abs(change - integral)[row]))
        return (
            f"{self._named(row)} a step changes it by {change[row, column]:.6g}, but its derivative says "
            f"{integral[row, column]:.6g}"
        )

    def _energy(self, strain: Array) -> Array:
        return self.material.energy(self.points, strain)

    def _stress(self, strain: Array) -> Array:
        return self.material.stress(self.points, strain)

    def stress(self) -> str | None:
        return self._along(self._energy, lambda strain, step: np.einsum("ki,ki->k", self._stress(strain), step))

    def tangent(self) -> str | None:
        def rate(strain: Array, step: Array) -> Array:
            return np.asarray(np.einsum("kij,kj->ki", self.material.tangent(self.points, strain), step))

        return self._along(self._stress, rate)

    def symmetric(self) -> str | None:
        tangent = self.material.tangent(self.points, self.strain)
        off = np.abs(tangent - tangent.transpose(0, 2, 1)).max(axis=(1, 2)) / np.abs(tangent).max(axis=(1, 2))
        row = int(np.argmax(off))
        return f"{self._named(row)} entries differ by {off[row]:.2g} of the largest" if off[row] > 1e-9 else None

    def _lowest(self, matrices: Array) -> Array:
        scaled = once(self.dim) @ matrices @ once(self.dim)
        return np.asarray(np.linalg.eigvalsh(0.5 * (scaled + scaled.transpose(0, 2, 1)))[:, 0])

    def tensors(self) -> str | None:
        low, up = self.material.lower_tensor(self.points), self.material.upper_tensor(self.points)
        allowed = _EIGENVALUE * np.abs(up).max(axis=(1, 2))
        for what, matrices in (("the lower tensor", low), ("the upper less the lower tensor", up - low)):
            least = self._lowest(matrices)
            if (least < -allowed).any():
                return f"{what} has the eigenvalue {least.min():.6g}"
        return None

    def _between(self, bound: Array, sign: float, what: str) -> str | None:
        """Whether the tangent, and the differences of stresses far from each other, are beyond a bound or below it."""
        upper = self.material.upper_tensor(self.points)
        least = self._lowest(sign * (self.material.tangent(self.points, self.strain) - bound))
        allowed = _EIGENVALUE * np.abs(upper).max(axis=(1, 2))
        row = int(np.argmin(least + allowed))
        if least[row] < -allowed[row]:
            return f"{self._named(row)} {what} has the eigenvalue {least[row]:.6g}"
        strain, stress = self.strain, self._stress(self.strain)
        strain, stress = strain - np.roll(strain, 1, axis=0), stress - np.roll(stress, 1, axis=0)
        work = np.einsum("ki,ki->k", stress, strain)
        own, most = (np.einsum("ki,kij,kj->k", strain, tensor, strain) for tensor in (bound, upper))
        bad = sign * (work - own) < -1e-9 * most
        if not bad.any():
            return None
        size = "little" if sign > 0.0 else "much"
        return f"{self._named(int(np.argmax(bad)))} and another one the stresses differ by too {size}"

    def monotone(self) -> str | None:
        return self._between(self.material.lower_tensor(self.points), 1.0, "the tangent less the lower tensor")

    def growth(self) -> str | None:
        return self._between(self.material.upper_tensor(self.points), -1.0, "the upper tensor less the tangent")

    def together(self) -> str | None:
        stress = self._stress(self.strain)
        for row in range(0, len(stress), max(1, len(stress) // 12)):
            alone = self.material.stress(self.points[row : row + 1], self.strain[row : row + 1])[0]
            if np.abs(alone - stress[row]).max() > 1e-9 * np.abs(stress[row]).max():
                return f"{self._named(row)} the stress differs"
        return None
