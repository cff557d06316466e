"""The conformance kit of materials notices faults that are planted, and names the strain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest

from hemivar.basics.types import Array, BoolArray
from hemivar.mechanics import InvariantEnergy, Invariants, IsotropicBounds, Material, check_material
from hemivar.mechanics.material_check import MaterialError
from hemivar.mechanics.material_words import PlaneState

Regions = Mapping[str, BoolArray] | None


@dataclass(frozen=True, eq=False)
class Soft(InvariantEnergy):
    """A material as a user may write it, with one fault: ``W = p^2 + w(s)``, whose shear falls from 2 to 1."""

    fault: str = ""
    plane: PlaneState = PlaneState.STRAIN

    @property
    def kind(self) -> str:
        return "soft"

    @property
    def formula(self) -> str:
        return "W = tr^2 + dev2 + sqrt(1 + dev2) - 1"

    def stated(self) -> Mapping[str, object]:
        return {}

    @property
    def homogeneous(self) -> bool:
        return True

    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        root = np.sqrt(1.0 + 40.0 * s)
        slope, bend = 1.0 + 20.0 / root, -400.0 / root**3
        zero, two = np.zeros(p.shape), np.full(p.shape, 2.0)
        value = p**2 + s + root - 1.0
        match self.fault:
            case "energy":
                value = value + 0.1 * s * (p > 0.05)
            case "offset":
                value = value + 3.0
            case "slope":
                slope = 1.05 * slope
            case "bend":
                bend = 0.5 * bend
            case "cross":
                zero = zero + 0.5
            case "nan":
                value = np.where(s > 0.01, np.nan, value)
            case "shape":
                value = value[:, None]
        return Invariants(value, 2.0 * p, slope, two, zero, bend)

    def bounds(self, points: Array) -> IsotropicBounds:
        one = np.ones(len(points))
        low, up = {"low": (1.5, 21.0), "up": (1.0, 15.0), "crossed": (30.0, 21.0)}.get(self.fault, (1.0, 21.0))
        return IsotropicBounds(2.0 * one, low * one, 2.0 * one, up * one)

    def tangent(self, points: Array, strain: Array, regions: Regions = None) -> Array:
        tangent = super().tangent(points, strain)
        if self.fault == "unsymmetric":
            tangent = tangent + 0.01 * np.triu(np.ones(tangent.shape[1:]), 1) * np.abs(strain[:, :1, None])
        return tangent

    def stress(self, points: Array, strain: Array, regions: Regions = None) -> Array:
        stress = super().stress(points, strain)
        if self.fault == "mixed up":
            stress = stress * np.linspace(1.0, 1.0 + 1e-6 * (len(stress) > 1), len(stress))[:, None]
        return stress + (0.1 if self.fault == "prestress" else 0.0)


def test_it_is_in_order_without_a_fault() -> None:
    report = check_material(Soft())
    assert report.passed
    assert str(report) == "material 'soft': 18 checks passed"


@pytest.mark.parametrize(
    ("fault", "check", "strain"),
    [
        ("energy", "the stress is the derivative of the energy", True),
        ("offset", "energy and stress are zero at zero strain", False),
        ("prestress", "energy and stress are zero at zero strain", False),
        ("slope", "the stress is the derivative of the energy", True),
        ("bend", "the tangent is the derivative of the stress", True),
        ("cross", "the tangent is the derivative of the stress", True),
        ("unsymmetric", "the tangent is symmetric", True),
        ("low", "the stress is strongly monotone with the lower tensor", True),
        ("up", "the stress grows no faster than with the upper tensor", True),
        ("crossed", "the lower tensor is below the upper one", False),
        ("mixed up", "many points at once give what each gives alone", True),
        ("nan", "the material answers with finite numbers", True),
        ("shape", "the material answers with finite numbers", False),
    ],
)
def test_a_planted_fault_is_found(fault: str, check: str, strain: bool) -> None:
    report = check_material(Soft(fault=fault), raises=False)
    found = [failure for failure in report.failures if failure.startswith(check)]
    assert len(found) == 2, report  # in the plane and in space
    assert ("at the strain e" in found[0]) == strain, found
    with pytest.raises(MaterialError, match="fails"):
        check_material(Soft(fault=fault))


def test_the_region_is_named() -> None:
    mixed = Material.by_region({"good": Soft(), "bad": Soft(fault="bend")})
    report = check_material(mixed, raises=False)
    assert len(report.checks) == 36
    assert report.failures
    assert all(failure.startswith("region 'bad': ") for failure in report.failures)


def test_a_wrong_deviator_in_plane_strain_is_found() -> None:
    """The deviator of the plane in place of that of space: consistent with itself, but not what space does."""
    flat = Material.potential("tr^2 + dev2", reach=1.0)
    strain = np.array([[0.1, 0.0, 0.0]])
    space = np.array([[0.1, 0.0, 0.0, 0.0, 0.0, 0.0]])
    plane, whole = flat.stress(np.zeros((1, 2)), strain)[0], flat.stress(np.zeros((1, 3)), space)[0]
    np.testing.assert_allclose(plane, whole[[0, 1, 5]], rtol=1e-14)
    np.testing.assert_allclose(plane[:2], [0.2 + 2 * 0.2 / 3, 0.2 - 0.2 / 3], rtol=1e-14)


def test_the_reach_in_plane_stress_is_that_of_the_strain_in_space() -> None:
    """Counted in the plane alone, strains with equal stretches would lie beyond the bounds."""
    material = Material.potential("30*tr^2 + 4*dev2 - 10*dev2^2", reach=0.2, plane="stress")
    assert check_material(material).passed
    points, scale = np.zeros((2, 2)), np.diag([1.0, 1.0, np.sqrt(2.0)])
    equal = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])

    def least(size: float) -> float:
        rest = material.tangent(points, size * equal) - material.lower_tensor(points)
        return float(np.linalg.eigvalsh(scale @ rest @ scale).min())

    assert least(0.2 / np.sqrt(6.0)) >= 0.0  # stretches e and e, with at most 2 e across
    assert least(0.19 / np.sqrt(2.0)) < 0.0
