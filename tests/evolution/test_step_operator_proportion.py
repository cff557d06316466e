"""A viscosity that is a multiple of the stiffness: it is seen, only where it is one, and changes no answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.discrete import operators
from hemivar.discrete.operators import Operator
from hemivar.evolution import Evolution, History, march
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.save import Save
from hemivar.evolution.schemes import Scheme

NONE = Save(every=1e9)


def of_material(material: hv.Material, *, inertia: bool = True, dim: int = 2) -> Evolution:
    """The survey's body, of another material."""
    made = gallery.survey("5.1", 6, "right") if dim == 2 else gallery.survey_cube("5.1", 3)
    return Evolution(replace(made, material=material), inertia=inertia)


def two_halves(left: tuple[float, float], right: tuple[float, float], viscous: Array) -> Evolution:
    """A body of two halves, the constants of Lame of each and of its viscosity (2, 2)."""

    def halves(k: int, pairs: Array) -> object:
        return lambda x: np.where(x[:, 0] < 0.5, pairs[0][k], pairs[1][k])

    pairs = np.array([left, right])
    material = hv.Material.lame(
        halves(0, pairs), halves(1, pairs), density=1.0, viscosity=(halves(0, viscous), halves(1, viscous))
    )
    return of_material(material)


def damping_time(evolution: Evolution) -> float | None:
    return discretize_evolution(evolution).damping_time


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e9])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_multiple_is_seen_in_all_units(unit: float, dim: int) -> None:
    body = of_material(
        hv.Material.lame(3.0 * unit, 7.0 * unit, density=1.0, viscosity=(0.6 * unit, 1.4 * unit)), dim=dim
    )
    assert damping_time(body) == pytest.approx(0.2, rel=1e-13)


def test_a_multiple_is_seen_with_halves_of_very_different_stiffness() -> None:
    soft, hard = (2.0, 3.0), (2e8, 3e8)
    assert damping_time(two_halves(soft, hard, 0.1 * np.array([soft, hard]))) == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize("off", [1e-12, 1e-6, 0.5])
@pytest.mark.parametrize("which", [0, 1])
def test_what_is_nearly_a_multiple_is_none(off: float, which: int) -> None:
    """Also where it fails in the softer half alone, whose entries are as small as the rounding of the others."""
    soft, hard = (2.0, 3.0), (2e13, 3e13)
    viscous = 0.1 * np.array([soft, hard])
    viscous[which] *= 1.0 + off
    assert damping_time(two_halves(soft, hard, viscous)) is None


def test_every_entry_is_looked_at_in_portions_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operators, "PORTION", 7)
    discrete = discretize_evolution(of_material(hv.Material.lame(4.0, 4.0, density=1.0, viscosity=(0.4, 0.4))))
    stiffness, viscosity = discrete.stiffness, discrete.viscosity
    assert viscosity is not None
    plain = Operator(viscosity.inner, viscosity.coupling, viscosity.held)
    assert plain.multiple_of(stiffness) == pytest.approx(0.1, rel=1e-13)
    assert discrete.mass is not None
    assert discrete.mass.multiple_of(stiffness) is None
    matrix = viscosity.inner
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    apart = np.flatnonzero((rows != matrix.indices) & (np.abs(matrix.data) > 1e-3))
    for place in apart[:: max(apart.size // 40, 1)]:
        bent = matrix.copy()
        bent.data[place] *= 1.0 + 1e-10
        assert replace(plain, inner=bent).multiple_of(stiffness) is None


@pytest.mark.parametrize("viscosity", [(0.3, 0.5), (0.0, 0.4), None])
def test_other_viscosities_are_none(viscosity: tuple[float, float] | None) -> None:
    assert damping_time(of_material(hv.Material.lame(4.0, 4.0, density=1.0, viscosity=viscosity))) is None


@pytest.mark.parametrize(
    ("scheme", "inertia"),
    [
        (hv.evolution.ImplicitEuler(), True),
        (hv.evolution.ImplicitEuler(), False),
        (hv.evolution.Midpoint(), True),
        (hv.evolution.Newmark(), True),
        (hv.evolution.SDIRK2(), False),
    ],
)
def test_steps_are_those_with_a_product_of_its_own(
    scheme: Scheme, inertia: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    material = hv.Material.lame(4.0, 4.0, density=1.0, viscosity=(0.4, 0.4))

    def marched() -> History:
        return march(of_material(material, inertia=inertia), 0.3, step=0.01, scheme=scheme, save=NONE)

    known = marched()
    monkeypatch.setattr(DiscreteEvolution, "damping_time", None)
    alone = marched()
    for name in ("displacement", "velocity"):
        one, other = getattr(known.state.body, name), getattr(alone.state.body, name)
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())
    for name in ("viscous", "elastic", "numerical"):
        np.testing.assert_allclose(known[name], alone[name], atol=1e-9 * np.abs(alone["elastic"]).max())
    assert known["residual"].max() <= 1e-9
    assert np.abs(known["gap"]).max() <= 1e-9 * np.abs(known["work"]).max()
