"""Bodies by forms of scikit-fem in time: against the library's own elements, and bars in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import skfem
from scipy.spatial import cKDTree
from skfem.helpers import ddot, div, dot, sym_grad, trace

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, History, Midpoint, Newmark, march
from hemivar.evolution.evolution_problem import Mass
from hemivar.fem import FormBody, FormProblem
from hemivar.laws import NoContact
from tests.fem.test_forms import LAM, MU, elastic, grid, incompressible, taylor_hood

DENSITY, VISCOUS = 1.5, (0.3, 0.2)


@skfem.BilinearForm
def mass(u: Any, v: Any, w: Any) -> Any:
    return DENSITY * dot(u, v)


@skfem.BilinearForm
def viscosity(u: Any, v: Any, w: Any) -> Any:
    strain = sym_grad(u)
    return VISCOUS[0] * trace(strain) * div(v) + 2.0 * VISCOUS[1] * ddot(strain, sym_grad(v))


@skfem.LinearForm
def weight(v: Any, w: Any) -> Any:
    return 0.1 * v[0] - 0.3 * v[1]


def form_block(**more: Any) -> FormBody:
    basis = skfem.Basis(grid(skfem.MeshTri, 4), skfem.ElementVector(skfem.ElementTriP1()))
    stated = {"load": weight, "supports": {"top": {"u^1": 0.0, "u^2": -0.02}}, "mass": mass, "viscosity": viscosity}
    return FormBody(basis, elastic, **(stated | more))


def own_block(contact: hv.Contact, top: Any, load: Any = (0.1, -0.3), viscous: bool = True) -> hv.ContactProblem:
    material = hv.Material.lame(LAM, MU, density=DENSITY, viscosity=VISCOUS if viscous else None)
    return hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 4), material, {"bottom": contact}, {"top": hv.Prescribed(top)}, body_force=load
    )


def alike(found: History, own: History) -> None:
    """The same displacements, forces and energies to 1e-10."""
    assert (found.ended, own.ended) == ("finished", "finished"), (found.messages, own.messages)
    node = cKDTree(found.discrete.field.nodes).query(own.discrete.field.nodes)[1]
    for one, other in zip(found.frames, own.frames, strict=True):
        size = np.abs(other.displacement).max()
        assert np.abs(one.displacement[node] - other.displacement).max() <= 1e-10 * size
    for name in ("elastic", "kinetic", "contact", "work", "viscous", "normal_force", "friction_force", "moved"):
        assert np.abs(found[name] - own[name]).max() <= 1e-10 * max(np.abs(own[name]).max(), 1e-6), name
    assert np.abs(found["gap"]).max() <= 1e-12


GLUE = hv.Contact(hv.Adhesive(20.0, 0.1, 2.0, compression=50.0))
RUBS = hv.Contact(hv.Compliance(20.0), hv.Coulomb(0.3))


@pytest.mark.parametrize("contact", [RUBS, GLUE], ids=["friction", "glue"])
@pytest.mark.parametrize("inertia", [True, False])
def test_linear_triangles_march_as_those_of_the_library(contact: hv.Contact, inertia: bool) -> None:
    start = (0.0, -0.02) if inertia else None
    found = march(Evolution(FormProblem(form_block(), {"bottom": contact}), inertia, start), 0.4, step=0.05)
    own = march(Evolution(own_block(contact, (0.0, -0.02)), inertia, start), 0.4, step=0.05)
    alike(found, own)
    assert found.uniqueness == own.uniqueness


@pytest.mark.parametrize("inertia", [True, False])
def test_loads_supports_gaps_and_laws_follow_the_time(inertia: bool) -> None:
    def down(x: Array, t: float) -> Array:
        return -0.1 * t * (1.0 + x[0])

    def own_down(x: Array, t: float) -> Array:
        return np.column_stack([np.zeros(len(x)), -0.1 * t * (1.0 + x[:, 0])])

    def rises(x: Array, t: float) -> Array:
        return 0.02 - 0.05 * t + 0.0 * x[:, 0]

    def pull(x: Array, t: float) -> Array:
        return (1.0 + t) * np.broadcast_to([0.1, -0.3], x.shape)

    contact = hv.Contact(hv.Compliance(lambda x, t: 20.0 + 10.0 * t + 0.0 * x[:, 0]), hv.Tresca(0.01), gap=rises)
    body = form_block(supports={"top": {"u^1": 0.0, "u^2": down}})
    stated = FormProblem(body, {"bottom": contact}, factor=lambda t: 1.0 + t)
    assert stated.time_dependent == {"load", "supports", "gap", "law"}
    found = march(Evolution(stated, inertia), 0.4, step=0.05)
    alike(found, march(Evolution(own_block(contact, own_down, pull), inertia), 0.4, step=0.05))
    with pytest.raises(hv.errors.ProblemError, match="depend on time; give it"):
        _ = stated.discrete


def test_an_elastic_body_marches_without_mass_and_viscosity() -> None:
    body = form_block(mass=None, viscosity=None)
    found = march(Evolution(FormProblem(body, {"bottom": RUBS}, factor=lambda t: t)), 1.0, step=0.25)

    def pull(x: Array, t: float) -> Array:
        return t * np.broadcast_to([0.1, -0.3], x.shape)

    alike(found, march(Evolution(own_block(RUBS, (0.0, -0.02), pull, False)), 1.0, step=0.25))


@pytest.mark.parametrize("viscous", [True, False])
def test_a_body_of_forms_says_whether_it_is_linear_and_resists(viscous: bool) -> None:
    forms = FormProblem(form_block() if viscous else form_block(viscosity=None), {"bottom": RUBS})
    own = own_block(RUBS, (0.0, 0.0), viscous=viscous)
    for inertia in (False, True):
        one, other = (Evolution(stated, inertia) for stated in (forms, own))
        assert (one.linear, one.resists) == (other.linear, other.resists) == (True, viscous or inertia)


# ---- bars in closed form --------------------------------------------------------------------------------------------


def wave_bar(n: int, element: Any = skfem.ElementQuad1) -> FormBody:
    """Of length 1 and waves of speed 1, that shortens and lengthens alone; ``left`` is free or held by its contact."""
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 0.1, 2))
    mesh = mesh.with_boundaries(
        {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 1.0 - 1e-9, "all": lambda x: x[0] > -1.0}
    )
    basis = skfem.Basis(mesh, skfem.ElementVector(element()))
    stiff = skfem.BilinearForm(lambda u, v, w: ddot(sym_grad(u), sym_grad(v)))
    inert = skfem.BilinearForm(lambda u, v, w: dot(u, v))
    flat = skfem.Basis(mesh, basis.elem).get_dofs().all(["u^2"])
    return FormBody(basis, stiff, mass=inert, fixed=np.asarray(flat))


@pytest.mark.parametrize(("element", "n", "order"), [(skfem.ElementQuad1, 8, 2), (skfem.ElementQuad2, 4, 4)])
def test_the_frequency_of_a_bar_held_at_one_end(element: Any, n: int, order: int) -> None:
    """sin(pi x / 2) has the period 4; three quarters of it on it passes zero."""
    errors = []
    for cells in (n, 2 * n):
        whole = wave_bar(cells, element)
        body = FormBody(
            whole.basis, whole.form, supports={"left": {"u^1": 0.0}}, fixed=whole.fixed, mass=whole.mass
        )  # fmt: skip
        stated = FormProblem(body, {"right": hv.Contact(NoContact())})
        steps = 24 if order == 2 else 600
        history = march(
            Evolution(stated, True, lambda x: np.column_stack([np.sin(0.5 * np.pi * x[:, 0]), 0.0 * x[:, 0]])),
            3.0,
            step=3.0 / (steps * cells // n),
            scheme=Newmark(),
        )
        assert history.ended == "finished"
        errors.append(float(np.abs(history.frames[-1].displacement[:, 0]).max()))
        assert np.abs(history["gap"]).max() < 1e-11
    assert errors[1] < 0.01
    assert errors[1] < 0.3 * errors[0]


def test_a_bar_that_hits_a_foundation_leaves_it_after_two_passages_of_the_wave() -> None:
    """Speed 0.1 on a stiff foundation: pressure 0.1, contact for a time of 2, back with the same speed."""
    stated = FormProblem(wave_bar(60), {"left": hv.Contact(hv.Compliance(200.0))})
    evolution = Evolution(stated, True, velocity=(-0.1, 0.0))
    history = march(evolution, 2.5, step=1.0 / 120.0, scheme=Midpoint(conserving=True))
    assert history.ended == "finished"
    force, time = history["normal_force"] / 0.1, history["time"]
    np.testing.assert_allclose(force[(time > 0.3) & (time < 1.7)].mean(), 0.1, rtol=0.01)
    assert force[time > 2.2].max() == pytest.approx(0.0, abs=1e-12)
    speed = history.frames[-1].velocity[:, 0].mean()
    assert speed == pytest.approx(0.1, rel=0.02)
    energy = history["elastic"] + history["kinetic"] + history["contact"]
    np.testing.assert_allclose(energy, 0.5 * 0.1 * 0.1**2, rtol=1e-9)


# ---- what is wrong is told ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "evolution", "words"),
    [
        ({"mass": None}, {"inertia": True}, "the body has no mass"),
        ({"mass": 3}, {}, "mass is 3"),
        ({"mass": np.eye(3)}, {"inertia": True}, "mass is "),
        ({"viscosity": np.eye(3)}, {}, "viscosity is "),
        ({}, {"inertia": True, "mass": Mass.REDISTRIBUTED}, "redistributed mass needs"),
        ({}, {"heat": hv.mechanics.Heat(1.0, 1.0)}, "heat needs"),
        ({}, {"velocity": (0.0, 1.0)}, "initial velocity"),
        ({}, {"displacement": (0.0, 1.0, 2.0)}, "initial displacement has shape"),
        ({}, {"displacement": (0.0, 1.0)}, "contradicts the supports"),
    ],
)
def test_bad_bodies_in_time_are_told(body: dict[str, Any], evolution: dict[str, Any], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        march(Evolution(FormProblem(form_block(**body), {"bottom": RUBS}), **evolution), 0.1, step=0.1)


def test_masses_that_are_not_symmetric_or_negative_are_told() -> None:
    skew = skfem.BilinearForm(lambda u, v, w: u[0] * v[1])
    negative = skfem.BilinearForm(lambda u, v, w: -dot(u, v))
    for form, words in ((skew, "mass of the body is not symmetric"), (negative, "negative numbers")):
        with pytest.raises(hv.errors.ProblemError, match=words):
            march(Evolution(FormProblem(form_block(mass=form), {"bottom": RUBS}), True), 0.1, step=0.1)


def test_bodies_with_multipliers_and_memory_at_rest_are_told() -> None:
    body = FormBody(taylor_hood(2), incompressible, supports={"top": {"u^1^1": 0.0, "u^2^1": -0.1}})
    with pytest.raises(hv.errors.ProblemError, match="displacement at nodes"):
        march(Evolution(FormProblem(body, {"bottom": hv.Contact(hv.Compliance(1.0))})), 0.1, step=0.1)
    remembers = hv.Contact(hv.Compliance(1.0), damping=hv.Compliance(1.0))
    with pytest.raises(hv.errors.ProblemError, match="means something in time only"):
        form_block().problem({"bottom": remembers})
    history = march(Evolution(FormProblem(form_block(), {"bottom": remembers})), 0.2, step=0.1)
    assert history.ended == "finished"


@pytest.mark.parametrize("inertia", [True, False])
def test_supports_that_move_contact_points(inertia: bool) -> None:
    """The corner of the foundation is held, and moves along and into it."""

    def moves(x: Array, t: float) -> Array:
        return np.tile([0.03 * t, -0.05 * t], (len(x), 1))

    body = form_block(supports={"left": {"u^1": lambda x, t: 0.03 * t, "u^2": lambda x, t: -0.05 * t}})
    found = march(Evolution(FormProblem(body, {"bottom": RUBS}), inertia), 0.4, step=0.05)
    stated = replace(own_block(RUBS, (0.0, 0.0)), supports={"left": hv.Prescribed(moves)})
    alike(found, march(Evolution(stated, inertia), 0.4, step=0.05))
