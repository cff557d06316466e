"""The gap of Fenchel's inequality inside a body with a stored energy, against closed forms of the conjugate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from hemivar.basics.types import Array
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.split_element import pairs_of
from hemivar.errors import ProblemError
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mechanics import Clamped, ContactProblem, Material
from hemivar.mesh import box, rectangle
from tests.bodies import BULK, LEFT, SHEAR, SIZE, hencky
from tests.bounds.bodies import shaken


def conjugate(stress: Array) -> float:
    """W* of Hencky's energy at a stress (3, 3) of space, by inverting ``phi(t^2) t = |dev s|``."""
    mean = np.trace(stress) / 3.0
    size = float(np.linalg.norm(stress - mean * np.eye(3)))

    def force(t: float) -> float:
        return 2.0 * SHEAR * (LEFT + (1.0 - LEFT) / np.sqrt(1.0 + (t / SIZE) ** 2)) * t

    t = brentq(lambda t: force(t) - size, 0.0, size / (2.0 * SHEAR * LEFT) + 1e-30, xtol=1e-16, rtol=1e-14)
    stored = SHEAR * LEFT * t**2 + 2.0 * SHEAR * (1.0 - LEFT) * SIZE**2 * (np.hypot(1.0, t / SIZE) - 1.0)
    return float((3.0 * mean) ** 2 / (18.0 * BULK) + size * t - stored)


def conjugate_in_plane(stress: Array) -> float:
    """The least over the stress across the plane: what plane strain makes of it."""

    def with_across(across: float) -> float:
        whole = np.zeros((3, 3))
        whole[:2, :2], whole[2, 2] = stress, across
        return conjugate(whole)

    size = 3.0 * float(np.abs(stress).max()) + 1e-30
    found = minimize_scalar(with_across, bounds=(-size, size), method="bounded", options={"xatol": 1e-9 * size})
    return float(found.fun)


def shaken_body(dim: int, material: Material, order: int = 1) -> ContactProblem:
    mesh = shaken(rectangle((1.0, 1.0), 2)) if dim == 2 else box((1.0, 1.0, 1.0), 1)
    return ContactProblem(
        mesh=mesh, material=material, supports={"left": Clamped()}, body_force=(0.3, -0.2, 0.1)[:dim], order=order
    )


def stress_of(problem: ContactProblem, size: float, seed: int = 0) -> AdmissibleStress:
    """A stress in equilibrium for a displacement that has nothing to do with it."""
    places = problem.mesh.points
    u = size * np.random.default_rng(seed).normal(size=places.shape) * places[:, :1]
    return admissible_stress(body_data(problem, u))


def exact_gap(stress: AdmissibleStress) -> Array:
    """``2 int_T W + W* - s : e`` by a rule of degree 8 on the pieces of cells."""
    data, dim = stress.data, stress.data.table.dim
    barycentric, weights = quadrature_rule(dim, 8)
    at = np.einsum("qa,mbav->mbqv", barycentric, stress.stresses)
    strain, tensor = data.strain, np.zeros((*at.shape[:3], dim, dim))
    for component, (i, j) in enumerate(pairs_of(dim)):
        tensor[..., i, j] = tensor[..., j, i] = at[..., component]
    value = data.problem.material.energy(np.zeros((1, dim)), data.engineering)
    of = conjugate_in_plane if dim == 2 else conjugate
    dual = np.array([of(one) for one in tensor.reshape(-1, dim, dim)]).reshape(at.shape[:3])
    work = np.einsum("mbqij,mij->mbq", tensor, strain)
    mean = np.einsum("mbq,q->m", dual - work, weights) / (dim + 1)
    return np.asarray(2.0 * data.table.volumes * (value + mean))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("size", [0.01, 0.1])
def test_it_is_above_that_of_the_closed_form_and_near_to_it(dim: int, size: float) -> None:
    stress = stress_of(shaken_body(dim, hencky()), size)
    exact, square = exact_gap(stress), stress.square
    assert (stress.misfit >= exact * (1.0 - 1e-9)).all()
    # of what C_low alone leaves above it at least two thirds go
    assert (stress.misfit - exact).sum() < (square - exact).sum() / 3.0


def test_without_softening_it_is_the_misfit_of_the_linear_material() -> None:
    for plane in ("strain", "stress"):
        potential = stress_of(shaken_body(2, hencky(1.0, plane=plane)), 0.1)
        linear = stress_of(shaken_body(2, Material.lame(BULK - 2.0 * SHEAR / 3.0, SHEAR, plane=plane)), 0.1)
        assert potential.misfit == pytest.approx(linear.misfit, rel=1e-12)
        assert potential.data.energy == pytest.approx(linear.data.energy, rel=1e-12)


def test_regions_take_part_each_with_its_own_material() -> None:
    mesh = rectangle((1.0, 1.0), 2)
    half = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.5
    mesh = mesh.named(dict(mesh.boundaries), {"a": np.flatnonzero(half), "b": np.flatnonzero(~half)})
    linear = Material.lame(2.0, 3.0)
    mixed = stress_of(replace(shaken_body(2, Material.by_region({"a": hencky(), "b": linear})), mesh=mesh), 0.05)
    soft, stiff = (stress_of(replace(shaken_body(2, one), mesh=mesh), 0.05) for one in (hencky(), linear))
    own = replace(mixed.data, stored=mixed.data.stored)
    assert own.stress[half] == pytest.approx(soft.data.stress[half], rel=1e-13)
    assert own.stress[~half] == pytest.approx(stiff.data.stress[~half], rel=1e-13)
    assert mixed.misfit[~half] == pytest.approx(mixed.square[~half], rel=1e-12)
    assert (mixed.misfit[half] < mixed.square[half]).all()


def test_units_do_not_matter() -> None:
    one = stress_of(shaken_body(2, hencky()), 0.05).misfit
    scaled = replace(shaken_body(2, Material.hencky(1e9 * BULK, 1e9 * SHEAR, LEFT, SIZE)), body_force=(3e8, -2e8))
    assert stress_of(scaled, 0.05).misfit == pytest.approx(1e9 * one, rel=1e-9)


def test_quadratic_elements_are_refused_in_words() -> None:
    with pytest.raises(ProblemError, match="linear elements; take order = 1"):
        body_data(shaken_body(2, hencky(), order=2), np.zeros((25, 2)))
