"""Contact of bodies of forms on curved and oblique boundaries, at planes of symmetry and corners; what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from skfem.helpers import ddot, div, sym_grad, trace

import hemivar as hv
from hemivar.errors import SupportError
from hemivar.fem import FormBody, FormProblem

LAM, MU = 4.0, 4.0
STEEL = hv.Material.lame(LAM, MU)
RIGID = hv.Contact(hv.Signorini())
RUBS = hv.Contact(hv.Compliance(50.0), hv.Tresca(0.1))


@skfem.BilinearForm
def elastic(u: Any, v: Any, w: Any) -> Any:
    strain = sym_grad(u)
    return LAM * trace(strain) * div(v) + 2.0 * MU * ddot(strain, sym_grad(v))


def of_library(mesh: hv.Mesh) -> Any:
    """The same mesh, with its names, in scikit-fem."""
    kind = skfem.MeshTri if mesh.dim == 2 else skfem.MeshTet
    found = kind(mesh.points.T.copy(), mesh.cells.T.copy())
    rank = {tuple(sorted(facet)): k for k, facet in enumerate(found.facets.T)}
    named = {
        name: np.array([rank[tuple(sorted(one))] for one in facets.tolist()])
        for name, facets in mesh.boundaries.items()
    }
    return replace(found, _boundaries=named)


def bent(mesh: hv.Mesh) -> hv.Mesh:
    """Its bottom is curved, and its left side stays a plane."""
    points = mesh.points.copy()
    points[:, -1] += 0.2 * np.sin(points[:, 0] + 0.4) * (1.0 - points[:, -1])
    if mesh.dim == 3:
        points[:, -1] += 0.1 * np.sin(points[:, 1] + 0.3) * (1.0 - points[:, -1])
    return hv.Mesh(points, mesh.cells, mesh.boundaries)


PLANE, SOLID = bent(hv.rectangle((2.0, 1.0), (8, 4))), bent(hv.box((2.0, 1.0, 1.0), (4, 2, 2)))


def along_axes(solution: hv.Solution) -> Any:
    """The resultant of all contact forces (d,)."""
    contact = solution.contact
    return np.einsum("k,kc,kcd->d", contact.weights, solution.multiplier, contact.frames)


@pytest.mark.parametrize("contact", [RIGID, RUBS], ids=["rigid", "rubs"])
@pytest.mark.parametrize(
    ("mesh", "element", "order", "sides"),
    [
        (PLANE, skfem.ElementTriP1, 1, {"left": 0}),
        (PLANE, skfem.ElementTriP2, 2, {"left": 0}),
        (SOLID, skfem.ElementTetP1, 1, {"left": 0}),
        (SOLID, skfem.ElementTetP1, 1, {"left": 0, "front": 1}),
    ],
    ids=["P1", "P2", "one plane", "two planes"],
)
def test_curved_contact_ends_on_planes_of_symmetry(
    mesh: hv.Mesh, element: Any, order: int, sides: dict[str, int], contact: hv.Contact
) -> None:
    """At nodes of a plane of symmetry the normal is oblique to what the support holds, as in a ContactProblem."""
    basis = skfem.Basis(of_library(mesh), skfem.ElementVector(element()))
    down = (0.0,) * (mesh.dim - 1) + (-0.05,)
    top = {f"u^{k + 1}": value for k, value in enumerate(down)}
    held = {"top": top} | {name: {f"u^{k + 1}": 0.0} for name, k in sides.items()}
    problem = hv.DiscreteProblem.of_forms(basis, elastic, supports=held, contact={"bottom": contact})
    supports = {"top": hv.Prescribed(down)} | {name: hv.Roller() for name in sides}
    own = hv.discretize(hv.ContactProblem(mesh, STEEL, {"bottom": contact}, supports, order=order))
    assert problem.contact.count == own.contact.count
    rough = problem.contact.points[problem.contact.without_friction]
    np.testing.assert_allclose(
        np.unique(rough.round(9), axis=0), np.unique(own.contact.points[own.contact.without_friction].round(9), axis=0)
    )
    assert len(problem.warnings) == len(own.warnings) == (contact is RUBS)
    found, other = hv.solve(problem), hv.solve(own)
    assert found.status is other.status is hv.Status.CONVERGED
    assert found.energy == pytest.approx(other.energy, rel=1e-9)
    assert found.normal_force == pytest.approx(other.normal_force, rel=1e-7)
    np.testing.assert_allclose(along_axes(found), along_axes(other), rtol=1e-6, atol=1e-9)


def curved_disc(times: int) -> Any:
    """A quarter of the unit disc with curved triangles, of a triangle whose longest side becomes the arc."""
    mesh = skfem.MeshTri2.from_mesh(skfem.MeshTri.init_refdom().refined(times))
    far = mesh.doflocs.sum(axis=0)
    size = np.linalg.norm(mesh.doflocs, axis=0)
    places = mesh.doflocs * (1.0 - far + far**2 / np.where(size > 0.0, size, 1.0))
    arc = np.flatnonzero((np.abs(mesh.p[:, mesh.facets].sum(axis=0) - 1.0) < 1e-9).all(axis=0))
    sides = {"left": lambda x: np.abs(x[0]) < 1e-9, "bottom": lambda x: np.abs(x[1]) < 1e-9}
    return replace(mesh.with_boundaries(sides | {"arc": arc}), doflocs=places)


def test_a_disc_of_curved_triangles_in_a_tight_ring() -> None:
    """Springs k with an interference d around it: u = -a x and p = 2 (lam + mu) a = k (d - a) everywhere."""
    tight, k = hv.Contact(hv.Compliance(30.0), gap=-0.01), 30.0
    exact = 0.01 * k * 2.0 * (LAM + MU) / (k + 2.0 * (LAM + MU))
    errors = []
    for times in (1, 2, 3):
        basis = skfem.Basis(curved_disc(times), skfem.ElementVector(skfem.ElementTriP2()))
        held = {"left": {"u^1": 0.0}, "bottom": {"u^2": 0.0}}
        problem = FormBody(basis, elastic, supports=held).problem({"arc": tight})
        found = hv.solve(problem)
        assert found.contact.count == 2 * 2**times + 1
        errors.append(float(np.abs(found.pressure / exact - 1.0).max()))
    assert errors[-1] < 1e-4
    assert errors[0] / errors[-1] > 4**2.5


@pytest.mark.parametrize("contact", [RIGID, RUBS], ids=["rigid", "rubs"])
@pytest.mark.parametrize("smooth", [True, False])
def test_two_contacts_that_share_a_node_are_those_of_a_contact_problem(smooth: bool, contact: hv.Contact) -> None:
    """Met smoothly the first one has the node; at a sharp corner both press and neither rubs."""
    mesh = hv.rectangle((2.0, 1.0), (8, 4))
    middle = mesh.points[mesh.boundaries["bottom"]].mean(axis=1)[:, 0] < 1.0
    parts = {"one": mesh.boundaries["bottom"][middle], "two": mesh.boundaries["bottom"][~middle]}
    names = parts if smooth else {"one": mesh.boundaries["bottom"], "two": mesh.boundaries["right"]}
    mesh = hv.Mesh(mesh.points, mesh.cells, {"top": mesh.boundaries["top"]} | names)
    basis = skfem.Basis(of_library(mesh), skfem.ElementVector(skfem.ElementTriP1()))
    stated = {"one": contact, "two": hv.Contact(hv.Compliance(30.0), contact.friction)}
    held = {"top": {"u^1": 0.01, "u^2": -0.05}}
    problem = hv.DiscreteProblem.of_forms(basis, elastic, supports=held, contact=stated)
    own = hv.discretize(hv.ContactProblem(mesh, STEEL, stated, {"top": hv.Prescribed((0.01, -0.05))}))
    np.testing.assert_allclose(problem.contact.weights, own.contact.weights)
    assert problem.warnings == own.warnings
    found, other = hv.solve(problem), hv.solve(own)
    assert found.energy == pytest.approx(other.energy, rel=1e-9)
    np.testing.assert_allclose(along_axes(found), along_axes(other), rtol=1e-6, atol=1e-9)


# ---- what is refused ------------------------------------------------------------------------------------------------

MESH = of_library(hv.rectangle((2.0, 1.0), (4, 2)))
BASIS = skfem.Basis(MESH, skfem.ElementVector(skfem.ElementTriP1()))
HELD = {"top": {"u^1": 0.0, "u^2": -0.05}}
SOFT = {"bottom": hv.Contact(hv.Compliance(10.0))}


def solved(**more: Any) -> hv.Solution:
    return hv.solve(hv.DiscreteProblem.of_forms(BASIS, elastic, **({"supports": HELD, "contact": SOFT} | more)))


@pytest.mark.parametrize(
    "form",
    [
        lambda u: -(u[1] ** 2), lambda u: -(u[1] ** 3), lambda u: -abs(u[1]), lambda u: -np.sin(u[1]) / np.sin(1.0),
        lambda u: 1.0 - u[1], lambda u: np.minimum(-u[1], 0.5), lambda u: np.maximum(-u[1], 0.0),
        lambda u: -np.stack([u[0], u[1] * abs(u[0])]), lambda u: np.exp(-u[1]), lambda u: u.grad[1, 1] * u[1],
        lambda u: -u[1] - 1e-6, lambda u: np.sign(u[1]),
    ],
)  # fmt: skip
def test_a_trace_is_linear_or_refused(form: Callable[[Any], Any]) -> None:
    with pytest.raises(hv.errors.ProblemError, match="trace is not linear in the fields"):
        solved(trace=form)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
def test_traces_in_any_units_are_linear(scale: float) -> None:
    """Springs k s^2 under s u are those under u."""
    soft = {"bottom": hv.Contact(hv.Compliance(10.0 / scale**2))}
    found = solved(trace=lambda u: -scale * u[1], contact=soft)
    assert found.energy == pytest.approx(solved(trace=lambda u: -u[1]).energy, rel=1e-9)
    assert solved(trace=lambda u: scale * (u.grad[1, 1] - u[0]), at=1, contact=soft).status is hv.Status.CONVERGED


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"supports": HELD | {"left": {"u^1": 1.0}}}, "supports['{}']['u^1'] and supports['{}']['u^1'] prescribe"),
        ({"supports": HELD, "fixed": BASIS.get_dofs("top").all()[-1:]}, "and fixed prescribe different values"),
    ],
)
def test_contradicting_supports_are_refused_in_any_order(more: dict[str, Any], words: str, turned: bool) -> None:
    supports = dict(reversed(more["supports"].items())) if turned else more["supports"]
    with pytest.raises(SupportError) as error:
        solved(**(more | {"supports": supports}))
    assert words.format(*supports) in str(error.value)
    assert "make them agree there or free one of them" in str(error.value)


def test_supports_that_agree_hold_the_same_unknowns() -> None:
    fixed = BASIS.get_dofs("top").all(["u^1"])
    found = solved(supports=HELD | {"left": {"u^2": lambda x: -0.05 * x[1]}}, fixed=fixed)
    assert found.status is hv.Status.CONVERGED


def test_supports_in_time_contradict_one_another_when_they_do() -> None:
    held = {"top": {"u^1": 0.0, "u^2": lambda x, t: -0.1 * t + 0.0 * x[0]}, "left": {"u^1": 0.0, "u^2": 0.0}}
    stated = FormProblem(FormBody(BASIS, elastic, supports=held), SOFT)
    assert stated.starting(0.0).contact.count
    with pytest.raises(SupportError, match="make them agree"):
        stated.starting(0.5)


def test_contact_points_that_supports_hold_are_those_of_a_contact_problem() -> None:
    """Their energy counts, and a law that forbids them is a contradiction."""
    mesh, down = hv.rectangle((2.0, 1.0), (4, 2)), {"u^1": 0.0, "u^2": -0.05}
    own = hv.ContactProblem(mesh, STEEL, SOFT, {"left": hv.Prescribed((0.0, -0.05))})
    assert solved(supports={"left": down}).energy == pytest.approx(hv.solve(own).energy, rel=1e-9)
    for forbidden in (
        lambda: solved(supports={"left": down}, contact={"bottom": RIGID}),
        lambda: hv.solve(replace(own, contact={"bottom": RIGID})),
    ):
        with pytest.raises(SupportError, match="which its law forbids"):
            forbidden()


PLAIN = BASIS.zeros()
BODY = FormBody(BASIS, elastic, supports=HELD)
DISCRETE = BODY.problem(SOFT)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: solved(load=PLAIN + 1j), "load is complex"),
        (lambda: solved(load=np.ma.masked_array(PLAIN, mask=True)), "load is a masked array"),
        (lambda: solved(load=sp.csr_array(PLAIN[None])), "load is a sparse matrix"),
        (lambda: solved(load="abc"), "load is not an array of numbers: it is text"),
        (lambda: solved(load=lambda v, w: -v[1]), "load is a function; give a skfem.LinearForm"),
        (lambda: solved(load=elastic), "load is a BilinearForm"),
        (lambda: solved(supports={"top": {"u^2": lambda x: 1j * x[0]}}), "is complex"),
        (lambda: solved(supports={"top": {"u^2": "down"}}), "it is text"),
        (lambda: solved(supports={"top": {"u^2": lambda: 0.0}}), "cannot be evaluated"),
        (lambda: solved(supports={"top": {"u^2": lambda x: x}}), "for 5 unknowns"),
        (lambda: solved(supports={"top": np.ma.masked_array([0.0], mask=True)}), "masked array"),
        (lambda: solved(fixed=[[1, 2], [3]]), "fixed is not an array of numbers"),
        (lambda: solved(fixed=["a"]), "fixed is not an array of numbers: it is text"),
        (lambda: solved(fixed=3), "it must have 1 axis"),
        (lambda: solved(fixed=PLAIN > 0.0), "truth values"),
        (lambda: solved(trace=lambda u: u * np.nan), "every number must be finite"),
        (lambda: solved(trace=lambda u: u * 1j), "trace is complex"),
        (lambda: solved(trace=lambda u: "u"), "it is text"),
        (lambda: solved(trace=lambda u: u[7]), "trace cannot be evaluated"),
        (lambda: solved(at=10**9), "0 to 30"),
        (lambda: solved(at=[1]), "at is a list"),
        (lambda: FormBody(skfem.Basis(MESH, BASIS.elem, elements=[0, 1]), elastic), "has 2 of the 16 cells"),
        (lambda: FormBody(skfem.Basis(MESH, BASIS.elem, disable_doflocs=True), elastic), "disable_doflocs"),
        (lambda: FormBody(BASIS, sp.eye_array(BASIS.N, dtype=complex)), "form is complex"),
        (lambda: FormBody(BASIS, np.full((BASIS.N, BASIS.N), "a")), "form is not an array of numbers"),
        (lambda: FormBody(BASIS, elastic, mass=lambda u, v, w: u[0] * v[0]), "mass is a function"),
        (lambda: FormBody(skfem.Basis(MESH.with_boundaries({"no": []}), BASIS.elem), elastic, supports={"no": 0.0}),
         "has no facets"),
        (lambda: BODY.full(None, PLAIN), "problem is None"),
        (lambda: BODY.full(DISCRETE, None), "unknowns is not an array of numbers"),
        (lambda: BODY.full(DISCRETE, 1.0), "unknowns has shape ()"),
        (lambda: BODY.full(DISCRETE, []), "give solution.unknowns"),
        (lambda: FormBody(BASIS, elastic, supports={"left": 0.0}).full(DISCRETE, PLAIN), "this body"),
        (lambda: FormProblem(BODY, SOFT, factor=2.0), "factor is 2.0; give a function of the time"),
        (lambda: FormProblem(BODY, SOFT, factor=lambda t: np.nan).force(0.5), "factor at t = 0.5 is nan"),
        (lambda: FormProblem(BODY, SOFT, units="mm"), "units is 'mm'"),
        (lambda: FormProblem(BODY, SOFT, title=3), "title is 3"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused_at_the_door(call: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError) as error:
        call()
    assert words in str(error.value)
    assert "\n" not in str(error.value)
