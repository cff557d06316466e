"""The geometric stiffness of a stress: its matrix, its work, and what is said where it is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.fem.hierarchy import coarser
from hemivar.fem.stress_stiffness import Stressed, stressed_problem, works_of_stress


def bar(dim: int = 2, order: int = 1, **changed: object) -> hv.ContactProblem:
    """A bar without lateral contraction, held at its left end."""
    mesh = hv.rectangle((4.0, 1.0), (4, 2)) if dim == 2 else hv.box((4.0, 1.0, 1.0), (4, 2, 2))
    stated = {"mesh": mesh, "material": hv.Material.young(100.0, 0.0), "supports": {"left": hv.Clamped()}}
    return hv.ContactProblem(**(stated | {"order": order} | changed))  # type: ignore[arg-type]


def nodal(problem: hv.ContactProblem, gradient: Array) -> Array:
    """The displacement of a gradient that is the same everywhere, (nodes, d)."""
    return np.asarray(problem.places(0.0)[0] @ gradient.T)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
def test_works_of_a_homogeneous_stress_are_those_by_hand(dim: int, order: int) -> None:
    """``int sigma_kl u_i,k u_i,l`` and ``int sigma : eps`` of a gradient G are ``V tr(G S G')`` and ``V S : G``."""
    problem = bar(dim, order, material=hv.Material.young(100.0, 0.3))
    gradient = np.random.default_rng(3).normal(size=(dim, dim))
    strain, lame = 0.5 * (gradient + gradient.T), (0.3 * 100.0 / 1.3 / 0.4, 100.0 / 2.6)
    stress = lame[0] * np.trace(strain) * np.eye(dim) + 2.0 * lame[1] * strain
    by_hand = 4.0 * np.trace(gradient @ stress @ gradient.T), 4.0 * np.vdot(stress, strain)
    assert works_of_stress(problem, nodal(problem, gradient)) == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_the_matrix_does_the_work_of_a_stress_along_other_displacements(order: int) -> None:
    """Of a bar under the tension p, ``v'K_s v = p int |v_,x|^2``, whatever v; a bent one is taken."""
    problem = bar(order=order, tractions={"right": (3.0, 0.0)})
    solution = hv.solve(problem)
    stressed = stressed_problem(solution.problem, solution.unknowns)
    x = problem.places(0.0)[0][:, 0]
    v = solution.problem.field.restrict(np.column_stack([0.0 * x, x**order]))
    own = v @ (stressed.stiffness - solution.problem.stiffness) @ v
    assert own == pytest.approx(3.0 * (4.0 if order == 1 else 4.0 / 3.0 * 4.0**3), rel=1e-12)
    assert abs(stressed.stiffness - stressed.stiffness.T).max() == 0.0


def test_prescribed_displacements_stress_the_body_as_the_load_of_the_same_does() -> None:
    """A bar drawn out by its support: the stiffness is that under the reaction, and load and energy follow."""
    drawn = bar(supports={"left": hv.Roller(), "right": hv.Fixed(x=0.04), "bottom": hv.Roller()}, stiffening=True)
    pulled = bar(
        supports={"left": hv.Roller(), "bottom": hv.Roller()}, tractions={"right": (1.0, 0.0)}, stiffening=True
    )
    one, two = hv.solve(drawn), hv.solve(pulled)
    force = one.reactions["right"][0]
    assert one.displacement == pytest.approx(two.displacement * 0.04 / two.displacement[:, 0].max(), abs=1e-9)
    # K + K_s of a homogeneous bar under the stress s = E e: the force is E e (1 + e)
    assert force == pytest.approx(100.0 * 0.01 * 1.01, rel=1e-9)
    assert one.energy == pytest.approx(0.5 * 4.0 * 100.0 * 0.01**2 * 1.01, rel=1e-9)


def test_a_coarser_mesh_has_the_stress_of_the_same_displacement() -> None:
    """Below a body under stress multigrid finds one under the same stress."""
    problem = bar(mesh=hv.rectangle((4.0, 1.0), (4, 2)).refined(), tractions={"right": (3.0, 0.0)})
    solution = hv.solve(problem)
    step = coarser(stressed_problem(solution.problem, solution.unknowns))
    assert step is not None
    assert isinstance(step.problem.model.parts, Stressed)
    x = step.problem.field.mesh.points[:, 0]
    v = step.problem.field.restrict(np.column_stack([0.0 * x, x]))
    plain = coarser(solution.problem).problem.stiffness
    assert v @ (step.problem.stiffness - plain) @ v == pytest.approx(3.0 * 4.0, rel=1e-12)


@pytest.mark.parametrize("force", [1.0, 1e6])
def test_units_do_not_matter(force: float) -> None:
    """N and mm, or MN and mm: the same displacement."""
    problem = bar(material=hv.Material.young(100.0 * force, 0.3), tractions={"right": (0.5 * force, 0.1 * force)})
    found = hv.solve(replace(problem, stiffening=True)).displacement
    same = hv.solve(bar(material=hv.Material.young(100.0, 0.3), tractions={"right": (0.5, 0.1)}, stiffening=True))
    assert found == pytest.approx(same.displacement, rel=1e-9, abs=1e-12)


def test_a_note_says_where_the_stress_matters_and_is_left_out() -> None:
    """A cantilever under a tension of several times its load of Euler, pulled aside: a note, and none with stiffening.

    A block under its load has none.
    """
    slender = {"mesh": hv.rectangle((20.0, 1.0), (20, 2)), "order": 2, "tractions": {"right": (0.2, 2e-3)}}
    without, counted = hv.solve(bar(**slender)), hv.solve(bar(**slender, stiffening=True))
    assert without.deformation.stiffening > 0.3
    assert any("stiffening = true" in said for said in without.warnings)
    assert not counted.warnings
    block = hv.solve(bar(tractions={"right": (0.2, 2e-3)}))
    assert block.deformation.stiffening < 5e-3
    assert not block.warnings
    pressed = hv.solve(bar(tractions={"right": (-7.0, 0.0)}))  # strain, which stress stiffening is not for
    assert pressed.deformation.strain > 0.06
    assert pressed.deformation.stiffening < 5e-3
    assert not pressed.warnings


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"stiffening": 1}, "stiffening is 1"),
        ({"material": hv.Material.young(100.0, 0.3, plane="axisymmetric")}, "a body of revolution"),
        ({"material": hv.Material.hencky(100.0, 50.0, 0.5, 0.1)}, "not linear"),
    ],
)
def test_what_cannot_be_stiffened_is_refused(changed: dict[str, object], said: str) -> None:
    """No truth value, bodies of revolution and materials that are not linear."""
    with pytest.raises(ProblemError, match=said):
        bar(**({"stiffening": True} | changed))


def test_time_is_refused() -> None:
    """A step in time has no stress stiffening, and says so."""
    with pytest.raises(ProblemError, match="an evolution is not available with stress stiffening"):
        hv.discretize(bar(stiffening=True), evolving=True)
