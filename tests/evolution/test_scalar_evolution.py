"""Scalar problems in time: what they refuse, restarts, files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import FileError
from hemivar.evolution import Evolution, march
from hemivar.evolution.discrete import StepMatrices, discretize_evolution
from hemivar.fem.hierarchy import family_of
from hemivar.mechanics.material_words import ScalarKind

MESH = hv.rectangle((1.0, 1.0), 4)
STOP = hv.ScalarContact(hv.Signorini(), 0.1)
RUBS = hv.ScalarContact(hv.Tresca(0.1))


def membrane(**more: Any) -> hv.ContactProblem:
    return hv.ScalarProblem(**{"mesh": MESH, "coefficient": 1.0, "supports": {"left": 0.0}, "density": 1.0} | more)


HEAT = membrane(kind=ScalarKind.HEAT, density=None, capacity=1.0)


@pytest.mark.parametrize(
    ("problem", "options", "words"),
    [
        (membrane(density=None), {"inertia": True}, "the membrane has no density; give ScalarProblem"),
        (membrane(density=0.0), {"inertia": True}, "the membrane has no density"),
        (HEAT, {"inertia": True}, "heat has no inertia"),
        (HEAT, {"velocity": 1.0}, "an initial velocity is given, but the body has no inertia"),
        (membrane(), {"displacement": [1.0, 2.0]}, r"initial displacement has shape \(2,\); give a number"),
        (membrane(), {"inertia": True, "velocity": np.inf}, "initial velocity"),
        (membrane(), {"displacement": "0.1*x"}, "initial displacement"),
        (
            membrane(kind=ScalarKind.HEAT, density=None, contact={"right": RUBS}), {},
            "contact 'right' has friction, which acts on a rate",
        ),
        (membrane(area=STOP), {"inertia": True, "mass": "redistributed"}, "contact over an area has no nodes beside"),
        ("membrane", {}, "give a ContactProblem or a ScalarProblem"),
    ],
)  # fmt: skip
def test_what_scalar_evolutions_refuse(problem: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        Evolution(problem, **options)


@pytest.mark.parametrize(
    ("evolution", "options", "words"),
    [
        (Evolution(HEAT), {"scheme": hv.evolution.Newmark()}, "the scheme newmark is one for bodies with mass"),
        (Evolution(membrane(supports={}, viscosity=1.0)), {}, "free|constant|held"),
        (
            Evolution(membrane(contact={"right": RUBS}), inertia=True),
            {"scheme": hv.evolution.MoreauJean()},
            "rigid obstacles",
        ),
        (Evolution(membrane(), displacement=0.5), {}, "the initial displacement contradicts the supports"),
        (
            Evolution(membrane(contact={"right": STOP}), displacement=lambda x: x[:, 0]), {},
            "beyond what its law allows",
        ),
        (Evolution(membrane(density=lambda x: x[:, 0] - 0.5), inertia=True), {}, "density = -0.*must not be negative"),
    ],
)  # fmt: skip
def test_what_scalar_marches_refuse(evolution: Evolution, options: dict[str, Any], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        march(evolution, 1.0, step=0.5, **options)


def test_a_body_is_quenched() -> None:
    """Warm, and held cold from the start on: the series of the slab, quadratic in space and of order 2 in time."""
    slab = hv.ScalarProblem(
        hv.rectangle((1.0, 0.25), (16, 4)), 1.0, supports={"left": 0.0, "right": 0.0}, kind=ScalarKind.HEAT,
        capacity=1.0, order=2,
    )  # fmt: skip
    history = march(Evolution(slab, displacement=1.0), 0.1, step=0.1 / 64, scheme=hv.evolution.SDIRK2())
    x, odd = slab.mesh.nodes(2)[:, 0], np.arange(1, 60, 2)
    exact = (4.0 / np.pi / odd * np.exp(-((odd * np.pi) ** 2) * 0.1)) @ np.sin(np.pi * np.outer(odd, x))
    np.testing.assert_allclose(history.frames[-1].displacement[:, 0], exact, atol=2e-4)


def test_the_matrix_of_a_step_is_that_of_the_sums() -> None:
    """``1 + 0.5 2`` for the coefficient, and ``3 1`` of the mass for a bedding."""
    stated = membrane(viscosity=2.0)
    here = family_of(hv.discretize(stated), True).combined(0.5, 3.0)
    same = hv.discretize(membrane(density=None, coefficient=2.0, bedding=3.0)).stiffness
    np.testing.assert_allclose(here.toarray(), same.toarray(), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("order", [1, 2])
def test_parts_stand_on_one_sparsity(order: int) -> None:
    """Also where entries vanish, as those of right angles do."""
    from hemivar.evolution.discrete import discretize_evolution

    stated = membrane(order=order, viscosity=2.0, supports={"left": lambda x, t: t * x[:, 1]})
    discrete = discretize_evolution(Evolution(stated, inertia=True))
    parts = [discrete.stiffness, discrete.viscosity, discrete.mass]
    for part in parts:
        assert part is not None
        assert np.array_equal(part.inner.indptr, discrete.stiffness.inner.indptr)
        assert np.array_equal(part.inner.indices, discrete.stiffness.inner.indices)
    nodes, free = discrete.field.nodes, discrete.problem.unknowns
    x = np.concatenate([discrete.field.basis.T @ nodes[:, 0] ** 0, np.ones(discrete.moved.size)])
    assert discrete.mass is not None
    assert discrete.mass.energy(x) == pytest.approx(0.5, rel=1e-13)  # of speed 1
    linear = discrete.restrict(nodes[:, 1:], nodes[discrete.moved, 1])
    assert discrete.viscosity is not None
    assert discrete.viscosity.energy(linear) == pytest.approx(1.0, rel=1e-13)  # eta |grad y|^2 / 2
    assert free + discrete.moved.size == len(nodes)


def test_a_march_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    problem = membrane(
        contact={"right": hv.ScalarContact(hv.Compliance(5.0), lambda x, t: 0.1 - 0.1 * t + 0.0 * x[:, 0])},
        source=lambda x, t: np.sin(3.0 * t) + 0.0 * x[:, 0],
    )
    evolution = Evolution(problem, inertia=True)
    options: dict[str, Any] = {"step": 0.05, "scheme": hv.evolution.GeneralizedAlpha(0.7)}
    whole = march(evolution, 1.0, **options)
    file = tmp_path / "run.ckpt"
    march(evolution, 1.0, checkpoint=file, max_time=0.0, **options)
    again = march(evolution, 1.0, checkpoint=file, resume=True, **options)
    assert whole.table.tobytes() == again.table.tobytes()
    with pytest.raises(FileError, match="another evolution"):
        march(Evolution(membrane(), inertia=True), 1.0, checkpoint=file, resume=True, **options)


def test_a_capacity_leaves_no_constant_without_energy() -> None:
    """Insulated all round: the body of a step holds every temperature by what it stores; without it none is held."""
    insulated = membrane(kind=ScalarKind.HEAT, density=None, capacity=2.0, supports={}, source=1.0)
    step = StepMatrices(discretize_evolution(Evolution(insulated))).body(1.0, 4.0)
    assert step.model.free_motions.count == 0
    assert np.linalg.eigvalsh(step.stiffness.toarray())[0] > 1e-3
    still = hv.discretize(membrane(kind=ScalarKind.HEAT, density=None, supports={}), check_coercivity=False)
    assert still.model.free_motions.count == 1
    assert np.linalg.eigvalsh(still.stiffness.toarray())[0] < 1e-12


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_damped_foundation_under_a_membrane(unit: float) -> None:
    """Without supports u is uniform: k u + c u' = s."""
    k, c, s = 3.0, 2.0, 1.5 * unit
    over = hv.Contact(hv.Compliance(k), damping=hv.Compliance(c))
    problem = hv.ContactProblem(MESH, hv.Material.gradient(1.0), {"area": over}, body_force=s)
    with pytest.raises(hv.errors.ProblemError, match="contact 'area' has damping"):
        hv.solve(problem)
    history = march(Evolution(problem), until=1.0, scheme=hv.evolution.SDIRK2(), step=0.02)
    np.testing.assert_allclose(history.state.body.displacement, s / k * (1.0 - np.exp(-k / c)), rtol=3e-5)


@pytest.mark.parametrize(("memory", "force"), [(None, 0.025), ((), 0.1 * 2.0 / 3.0)])
def test_glue_at_the_end_of_a_strip(memory: tuple[()] | None, force: float) -> None:
    """Pulled to 0.2 and back to 0.1: the glue unloads along its secant from (0.15, 0.05), or along its own curve."""
    from hemivar.formula import Formula

    glue = hv.Contact(hv.Adhesive(2.0, 0.1, softening=0.5), memory=memory)
    strip = hv.ContactProblem(
        hv.rectangle((1.0, 0.25), (4, 1)), hv.Material.gradient(1.0), {"right": glue},
        supports={"left": Formula("0.2*abs(t - 1) - 0.2")},
    )  # fmt: skip
    history = march(Evolution(strip), until=1.5, step=0.05)
    assert history["normal_force"][-1] == pytest.approx(-0.25 * force, rel=1e-6)
    assert history["normal_force"][20] == pytest.approx(-0.25 * 0.05, rel=1e-6)
