"""Bodies by bases and forms of scikit-fem: against the library's own elements, and mixed bodies in closed form."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import skfem
from scipy.integrate import solve_bvp
from skfem.helpers import dd, ddot, div, dot, grad, sym_grad, trace

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.fem import FormBody
from hemivar.fem.mixed_bulk import MixedBulk

LAM, MU = 1.2, 0.8


@skfem.BilinearForm
def elastic(u: Any, v: Any, w: Any) -> Any:
    strain = sym_grad(u)
    return LAM * trace(strain) * div(v) + 2.0 * MU * ddot(strain, sym_grad(v))


def with_named_sides(mesh: Any) -> Any:
    """The mesh with the names of the sides of the library's rectangles and boxes."""
    last = mesh.p.shape[0] - 1
    ends = {"left": (0, 0.0), "right": (0, 1.0), "bottom": (last, 0.0), "top": (last, 1.0)}

    def at(axis: int, value: float) -> Any:
        return lambda x: np.abs(x[axis] - value) < 1e-9

    return mesh.with_boundaries({name: at(*where) for name, where in ends.items()})


def grid(kind: Any, n: int) -> Any:
    sides = [np.linspace(0.0, 1.0, n + 1)] * (3 if kind in (skfem.MeshTet, skfem.MeshHex) else 2)
    return with_named_sides(kind.init_tensor(*sides))


def pressed_form(basis: Any) -> FormBody:
    last = basis.mesh.p.shape[0]
    held = {f"u^{k + 1}": 0.0 for k in range(last - 1)} | {f"u^{last}": -0.05}
    return FormBody(basis, elastic, supports={"top": held})


RUBBED = hv.Contact(hv.Compliance(2.0), hv.Tresca(0.02))


@pytest.mark.parametrize(("element", "order"), [(skfem.ElementTriP1, 1), (skfem.ElementTriP2, 2)])
def test_lagrange_triangles_are_those_of_the_library(element: Any, order: int) -> None:
    basis = skfem.Basis(grid(skfem.MeshTri, 8), skfem.ElementVector(element()))
    problem = hv.DiscreteProblem.of_forms(
        basis, elastic, supports=pressed_form(basis).supports, contact={"bottom": RUBBED}
    )
    found = hv.solve(problem)
    own = hv.solve(
        hv.ContactProblem(
            hv.rectangle((1.0, 1.0), 8),
            hv.Material.lame(LAM, MU),
            {"bottom": RUBBED},
            {"top": hv.Prescribed((0.0, -0.05))},
            order=order,
        )
    )
    assert found.normal_force == pytest.approx(own.normal_force, rel=1e-11)
    assert found.energy == pytest.approx(own.energy, rel=1e-11)
    assert problem.contact.weights.sum() == pytest.approx(1.0)
    ours, theirs = hv.certify(found), hv.certify(own)
    assert ours.unique is theirs.unique
    assert ours.margin == pytest.approx(theirs.margin, rel=1e-8)


@pytest.mark.parametrize(
    ("mesh", "element"),
    [
        (skfem.MeshQuad, skfem.ElementQuad1),
        (skfem.MeshQuad, skfem.ElementQuad2),
        (skfem.MeshTet, skfem.ElementTetP1),
        (skfem.MeshHex, skfem.ElementHex1),
        (skfem.MeshHex, skfem.ElementHex2),
    ],
    ids=lambda part: part.__name__,
)
def test_uniform_stress_on_other_elements(mesh: Any, element: Any) -> None:
    """Rollers at the sides: a column of stiffness lam + 2 mu on springs."""
    basis = skfem.Basis(grid(mesh, 2), skfem.ElementVector(element()))
    last = basis.mesh.p.shape[0]
    held: dict[str, Any] = {"top": {f"u^{last}": -0.1}, "left": {"u^1": 0.0}, "right": {"u^1": 0.0}}
    if last == 3:
        mesh_of = basis.mesh.with_boundaries({"front": lambda x: x[1] < 1e-9, "back": lambda x: x[1] > 1.0 - 1e-9})
        basis = skfem.Basis(mesh_of, basis.elem)
        held |= {"front": {"u^2": 0.0}, "back": {"u^2": 0.0}}
    found = hv.solve(FormBody(basis, elastic, supports=held).problem({"bottom": hv.Contact(hv.Compliance(3.0))}))
    column = LAM + 2.0 * MU
    np.testing.assert_allclose(found.pressure, 0.1 * column * 3.0 / (column + 3.0), rtol=1e-11)
    assert found.contact.weights.sum() == pytest.approx(1.0)
    assert (found.contact.weights > 0.0).all()


def test_names_of_facets_inside_of_the_mesh_hold_and_are_no_boundaries() -> None:
    held = {"top": {"u^1": 0.0, "u^2": -0.05}, "middle": {"u^1": 0.0}}
    for mesh, element in ((skfem.MeshTri, skfem.ElementTriP1), (skfem.MeshQuad, skfem.ElementQuad2)):
        inside = grid(mesh, 2).with_boundaries({"middle": lambda x: np.abs(x[1] - 0.5) < 1e-9}, boundaries_only=False)
        body = FormBody(skfem.Basis(inside, skfem.ElementVector(element())), elastic, supports=held)
        problem = body.problem({"bottom": RUBBED})
        found, field = hv.solve(problem), problem.field
        assert field is not None
        assert "middle" not in field.mesh.boundaries
        across = np.abs(field.nodes[:, 1] - 0.5) < 1e-9
        np.testing.assert_array_equal(found.displacement[across, 0], 0.0)


def test_points_of_a_rule_and_names_of_unknowns() -> None:
    basis = skfem.Basis(grid(skfem.MeshTri, 6), skfem.ElementVector(skfem.ElementTriP2()))
    body = pressed_form(basis)
    soft = hv.Contact(hv.Compliance(2.0))
    forces = [hv.solve(body.problem({"bottom": soft}, at=at)).normal_force for at in ("nodes", 1, 3)]
    assert forces == pytest.approx([forces[0]] * 3, rel=0.02)
    fixed = basis.get_dofs("top").all()
    same = FormBody(basis, elastic, load=body_force, fixed=fixed).problem({"bottom": soft})
    other = FormBody(basis, elastic, load=body_force, supports={"top": 0.0}).problem({"bottom": soft})
    np.testing.assert_allclose(hv.solve(same).unknowns, hv.solve(other).unknowns, atol=1e-14)


def test_what_supports_prescribe_at_contact_points_counts() -> None:
    """A column that is moved aside slides by the same way everywhere, at its held corners too."""
    basis = skfem.Basis(grid(skfem.MeshQuad, 4), skfem.ElementVector(skfem.ElementQuad1()))
    held = {"left": {"u^1": 0.02}, "right": {"u^1": 0.02}, "top": {"u^2": -0.1}}
    found = hv.solve(FormBody(basis, elastic, supports=held).problem({"bottom": hv.Contact(hv.Compliance(3.0))}))
    np.testing.assert_allclose(found.slip[:, 0], 0.02, rtol=1e-12)
    column = LAM + 2.0 * MU
    np.testing.assert_allclose(found.pressure, 0.1 * column * 3.0 / (column + 3.0), rtol=1e-11)


def test_points_that_supports_hold_altogether_are_left_out() -> None:
    basis = skfem.Basis(grid(skfem.MeshTri, 4), skfem.ElementVector(skfem.ElementTriP1()))
    rubs = hv.Contact(hv.Compliance(20.0), hv.Coulomb(0.3))
    body = FormBody(basis, elastic, load=body_force, supports={"left": {"u^1": 0.01, "u^2": -0.02}})
    own = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 4),
        hv.Material.lame(LAM, MU),
        {"bottom": rubs},
        {"left": hv.Prescribed((0.01, -0.02))},
        body_force=(0.0, -0.1),
    )
    found, other = hv.solve(body.problem({"bottom": rubs})), hv.solve(own)
    assert found.contact.count == other.contact.count == 4
    assert found.normal_force == pytest.approx(other.normal_force, rel=1e-10)
    assert found.friction_force == pytest.approx(other.friction_force, rel=1e-10)
    with pytest.raises(hv.errors.ProblemError, match="hold all of its points"):
        body.problem({"left": rubs})


@skfem.LinearForm
def body_force(v: Any, w: Any) -> Any:
    return -0.1 * v[1]


# ---- files and pictures ---------------------------------------------------------------------------------------------


def test_distorted_hexahedra_in_any_order_are_split_without_gaps() -> None:
    mesh = skfem.MeshHex.init_tensor(*[np.linspace(0.0, 1.0, 4)] * 3)
    random = np.random.default_rng(1)
    number = random.permutation(mesh.p.shape[1])
    places = np.empty_like(mesh.p)
    inside = (np.abs(mesh.p - 0.5) < 0.4).all(axis=0)
    places[:, number] = mesh.p + np.where(inside, random.uniform(-0.03, 0.03, mesh.p.shape), 0.0)
    # the corners of scikit-fem's cube, turned by a third about its diagonal
    turned = number[mesh.t][[0, 2, 3, 1, 6, 4, 5, 7]]
    mixed = np.where(np.arange(mesh.t.shape[1]) % 2, number[mesh.t], turned)
    basis = skfem.Basis(with_named_sides(skfem.MeshHex(places, mixed)), skfem.ElementVector(skfem.ElementHex1()))
    field = pressed_form(basis).problem({"bottom": SOFT}).field
    assert field is not None
    assert field.mesh.volumes.sum() == pytest.approx(1.0)
    assert field.mesh.facet_normals(field.mesh.boundary_facets)[1].sum() == pytest.approx(6.0)


# ---- algebraic levels -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "element", "cells", "most"),
    [
        (skfem.MeshHex, skfem.ElementHex1, (6, 12), 26),
        (skfem.MeshQuad, skfem.ElementQuad1, (32, 64), 30),
        (skfem.MeshQuad, skfem.ElementQuad2, (16, 32), 45),
        (skfem.MeshTri, skfem.ElementTriP2, (16, 32), 45),
    ],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_algebraic_levels_know_the_rigid_motions_of_a_form(mesh: Any, element: Any, cells: Any, most: int) -> None:
    rigid = hv.Contact(hv.Signorini(), hv.Tresca(0.02))
    counts = []
    for n in cells:
        basis = skfem.Basis(grid(mesh, n), skfem.ElementVector(element()))
        problem = pressed_form(basis).problem({"bottom": rigid})
        found, direct = hv.solve(problem, "multigrid"), hv.solve(problem, "newton")
        assert found.status is hv.Status.CONVERGED
        assert found.normal_force == pytest.approx(direct.normal_force, rel=1e-7)
        counts.append(found.evaluations)
    blind = replace(problem, model=replace(problem.model, space=None))  # constants in the place of rigid motions
    assert counts[-1] <= most
    assert counts[-1] <= 2.0 * counts[0]
    assert counts[-1] <= 0.7 * hv.solve(blind, "multigrid").evaluations


@pytest.mark.slow
def test_a_large_form_in_space_is_solved_by_levels_without_being_told() -> None:
    basis = skfem.Basis(grid(skfem.MeshHex, 18), skfem.ElementVector(skfem.ElementHex1()))
    found = hv.solve(pressed_form(basis).problem({"bottom": RUBBED}))
    assert found.method == "multigrid"
    assert found.evaluations <= 40


# ---- mixed bodies ---------------------------------------------------------------------------------------------------


@skfem.BilinearForm
def incompressible(u: Any, p: Any, v: Any, q: Any, w: Any) -> Any:
    return 2.0 * MU * ddot(sym_grad(u), sym_grad(v)) - div(u) * q - div(v) * p


def taylor_hood(n: int, mesh: Any = None) -> Any:
    found = grid(skfem.MeshTri, n) if mesh is None else mesh
    return skfem.Basis(found, skfem.ElementVector(skfem.ElementTriP2()) * skfem.ElementTriP1(), intorder=4)


def test_an_incompressible_block_on_springs() -> None:
    """In plane strain with nu = 1/2 a block under p shortens by p / (4 mu), whatever its mesh."""

    @skfem.LinearForm
    def load(v: Any, q: Any, w: Any) -> Any:
        return -0.3 * v[1]

    basis = taylor_hood(3)
    on_top = load.assemble(basis.boundary("top"))
    body = FormBody(basis, incompressible, load=on_top, supports={"left": {"u^1^1": 0.0}})
    problem = body.problem({"bottom": hv.Contact(hv.Compliance(5.0))})
    found = hv.solve(problem)
    np.testing.assert_allclose(found.pressure, 0.3, rtol=1e-10)
    whole = body.full(problem, found.unknowns)
    top = basis.get_dofs("top").all(["u^2^1"])
    np.testing.assert_allclose(whole[top], -(0.3 / 5.0 + 0.3 / (4.0 * MU)), rtol=1e-10)
    assert isinstance(problem.bulk, MixedBulk)
    travelled = pickle.loads(pickle.dumps(problem))
    np.testing.assert_array_equal(body.full(travelled, hv.solve(travelled).unknowns), whole)
    assert hv.certify(found).residual.relative < 1e-10
    # half of the work of the load is stored, in the body and in the springs
    assert found.energy == pytest.approx(-0.5 * float(on_top @ whole), rel=1e-10)


def test_poiseuille_flow_with_slip() -> None:
    """Wall traction G H / 2 whatever the law, flux s H + G H^3 / (12 mu)."""

    @skfem.LinearForm
    def push(v: Any, q: Any, w: Any) -> Any:
        return 0.7 * v[0]

    basis = taylor_hood(2)
    held = {side: {"u^2^1": 0.0} for side in ("top", "bottom", "left", "right")}
    body = FormBody(basis, incompressible, load=push, supports=held, fixed=[int(basis.get_dofs("top").all(["u^2"])[0])])
    walls = {"bottom": hv.Contact(hv.Compliance(4.0)), "top": hv.Contact(hv.Compliance(4.0))}
    problem = body.problem(walls, trace=lambda u, p: u[0])
    found = hv.solve(problem)
    traction, slip = 0.7 / 2.0, 0.7 / 2.0 / 4.0
    np.testing.assert_allclose(found.multiplier[:, 0], traction, rtol=1e-9)

    @skfem.LinearForm
    def flux(v: Any, q: Any, w: Any) -> Any:
        return v[0]

    whole = body.full(problem, found.unknowns)
    assert flux.assemble(basis) @ whole == pytest.approx(slip + 0.7 / (12.0 * MU), rel=1e-9)


def piezoelectric(c: float, e: float, eps: float, back: float | None = None) -> Any:
    """The form of a bar: the motion and the potential are coupled by e, and by another number the other way."""

    @skfem.BilinearForm
    def bar(u: Any, phi: Any, v: Any, psi: Any, w: Any) -> Any:
        coupled = e * dot(grad(phi), grad(v)) + (e if back is None else back) * dot(grad(psi), grad(u))
        return c * dot(grad(u), grad(v)) + coupled - eps * dot(grad(phi), grad(psi))

    return bar


#: Modulus, piezoelectric constant, permittivity and foundation; without dimension, and PZT-5H in SI units.
PIEZOELECTRIC = [(3.0, 0.5, 0.4, 2.0), (117e9, 23.3, 1.3e-8, 80e9)]


@pytest.mark.parametrize(("c", "e", "eps", "bed"), PIEZOELECTRIC)
@pytest.mark.parametrize("grounded", [True, False])
def test_a_piezoelectric_bar_on_springs(grounded: bool, c: float, e: float, eps: float, bed: float) -> None:
    """Short circuit c, open circuit c + e^2 / eps; the bar stands on an insulating foundation."""
    basis = skfem.Basis(grid(skfem.MeshTri, 3), skfem.ElementTriP1() * skfem.ElementTriP1())
    held: dict[str, Any] = {"top": {"u^1": -0.1, "u^2": 0.0}} | ({"bottom": {"u^2": 0.0}} if grounded else {})
    body = FormBody(basis, piezoelectric(c, e, eps), supports=held)
    # u is along the axis: penetration of the ground is -u
    problem = body.problem({"bottom": hv.Contact(hv.Compliance(bed))}, trace=lambda u, phi: -u)
    found = hv.solve(problem)
    modulus = c if grounded else c + e**2 / eps
    np.testing.assert_allclose(found.multiplier[:, 0], 0.1 * modulus * bed / (modulus + bed), rtol=1e-10)
    if not grounded:  # no charge anywhere: the potential rises by e/eps times the strain
        strain = -0.1 * bed / (modulus + bed)
        potential = body.full(problem, found.unknowns)[basis.get_dofs("bottom").all(["u^2"])]
        np.testing.assert_allclose(potential, -e / eps * strain, rtol=1e-10)


@pytest.mark.parametrize(("c", "e", "eps", "bed"), PIEZOELECTRIC)
def test_a_coupling_of_one_way_is_told_in_any_units(c: float, e: float, eps: float, bed: float) -> None:
    basis = skfem.Basis(grid(skfem.MeshTri, 3), skfem.ElementTriP1() * skfem.ElementTriP1())
    with pytest.raises(hv.errors.ProblemError, match="not symmetric"):
        FormBody(basis, piezoelectric(c, e, eps, 0.5 * e), supports={"top": 0.0}).problem(
            {"bottom": hv.Contact(hv.Compliance(bed))}, trace=lambda u, phi: -u
        )


def bending_plate(n: int) -> Any:
    @skfem.BilinearForm
    def bending(u: Any, v: Any, w: Any) -> Any:
        def moment(t: Any) -> Any:
            return RIGIDITY * ((1.0 - NU) * t + NU * (t[0, 0] + t[1, 1]) * np.eye(2)[:, :, None, None])

        return ddot(moment(dd(u)), dd(v))

    mesh = skfem.MeshTri.init_tensor(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 0.25, n // 4 + 1))
    mesh = mesh.with_boundaries(
        {"ends": lambda x: (x[0] < 1e-9) | (x[0] > 1 - 1e-9), "long": lambda x: (x[1] < 1e-9) | (x[1] > 0.25 - 1e-9)}
    ).with_subdomains({"plate": lambda x: x[0] > -1.0})
    return skfem.Basis(mesh, skfem.ElementTriMorley(), intorder=4), bending


RIGIDITY, NU, LOAD, BED = 0.02, 0.3, 0.5, 40.0


def test_a_plate_between_clamps_on_a_foundation_is_a_beam() -> None:
    """Morley's element, long edges without normal derivative: D w'''' + k w = q, solved by collocation."""

    @skfem.LinearForm
    def weight(v: Any, w: Any) -> Any:
        return LOAD * v

    def beam(x: Array, y: Array) -> Array:
        return np.vstack([y[1], y[2], y[3], (LOAD - BED * y[0]) / RIGIDITY])

    x = np.linspace(0.0, 1.0, 41)
    exact = solve_bvp(beam, lambda a, b: np.array([a[0], a[1], b[0], b[1]]), x, np.zeros((4, 41)), tol=1e-8)
    middle = float(exact.sol(0.5)[0])
    errors = []
    for n in (8, 16, 32):
        basis, bending = bending_plate(n)
        body = FormBody(basis, bending, load=weight, supports={"ends": 0.0, "long": {"u_n": 0.0}})
        found = hv.solve(body.problem({"plate": hv.Contact(hv.Compliance(BED))}))
        assert found.contact.weights.sum() == pytest.approx(0.25 * (1.0 - 1.0 / n))  # less what the clamps hold
        near = np.abs(found.contact.points[:, 0] - 0.5) < 1e-9
        errors.append(abs(float(found.multiplier[near, 0].mean()) / BED / middle - 1.0))
    assert errors[2] < 0.01
    assert errors[2] < 0.5 * errors[1]


# ---- bad input ------------------------------------------------------------------------------------------------------

SMALL = skfem.Basis(
    grid(skfem.MeshTri, 2).with_boundaries({"middle": lambda x: np.abs(x[1] - 0.5) < 1e-9}, boundaries_only=False),
    skfem.ElementVector(skfem.ElementTriP1()),
)
SOFT = hv.Contact(hv.Compliance(1.0))


@pytest.mark.parametrize(
    ("body", "contact", "words"),
    [
        ({"basis": 3}, {}, "give a skfem.Basis"),
        ({"form": 3}, {}, "skfem.BilinearForm"),
        ({"form": np.eye(3)}, {}, "shape"),
        ({"load": np.ones(2)}, {}, "skfem.LinearForm"),
        ({"supports": {"tpo": 0.0}}, {}, "'top'"),
        ({"supports": {"top": {"u^7": 0.0}}}, {}, "no unknowns 'u\\^7'"),
        ({"fixed": [10**6]}, {}, "unknowns 0 to"),
        ({"fixed": [3, -1]}, {}, "unknown -1"),
        ({}, {"contact": {"bottom": hv.Contact(hv.Compliance(1.0), belt=(1.0, 0.0))}}, "laws and a gap"),
        ({}, {"contact": {"bottom": RUBBED}, "trace": lambda u: u[1]}, "has friction"),
        ({}, {"contact": {}}, "contact is empty"),
        ({}, {"contact": {"botom": SOFT}}, "'bottom'"),
        ({}, {"contact": {"bottom": 3}}, "hemivar.Contact"),
        ({}, {"at": "middles"}, "choose 'nodes'"),
        ({}, {"at": 4}, "depend on one another"),
        ({}, {"trace": lambda u: np.ones(3)}, "trace returns"),
        ({}, {"contact": {"bottom": hv.Contact(hv.Compliance(1.0), against="top")}}, "laws and a gap"),
        ({"basis": SMALL.mesh}, {}, "give a skfem.Basis"),
        ({"basis": skfem.FacetBasis(SMALL.mesh, SMALL.elem)}, {}, "is a FacetBasis"),
        ({"basis": skfem.Basis(skfem.MeshTri().refined(1), SMALL.elem)}, {}, "boundaries: none"),
        ({"form": lambda u, v, w: ddot(u, v)}, {}, "form is a function"),
        ({"form": skfem.LinearForm(lambda v, w: v[0])}, {}, "form is a LinearForm"),
        ({"form": skfem.BilinearForm(lambda u, v, w: dot(grad(u), grad(v)))}, {}, "form cannot be assembled"),
        ({"form": skfem.BilinearForm(lambda u, v, w: ddot(grad(u), grad(v)) + u[0] * v[1])}, {}, "not symmetric"),
        ({"form": skfem.BilinearForm(lambda u, v, w: -ddot(grad(u), grad(v)))}, {}, "change its sign"),
        ({"form": np.full((SMALL.N, SMALL.N), np.nan)}, {}, "form\\[0, 0\\] = nan; every number must be finite"),
        ({"load": skfem.LinearForm(lambda v, w: v)}, {}, "load cannot be assembled"),
        ({"load": np.full(SMALL.N, np.inf)}, {}, "load\\[0\\] = inf; every number must be finite"),
        ({"supports": ["top"]}, {}, "supports is a list"),
        ({"supports": {"top": np.ones(7)}}, {}, "for 6 unknowns"),
        ({"supports": {"top": {"u^2": hv.Clamped()}}}, {}, "it holds a Clamped"),
        ({"supports": {"top": {"u^2": np.nan}}}, {}, "supports\\['top'\\]\\['u\\^2'\\] = nan"),
        ({"fixed": [0.5]}, {}, "numbers of unknowns"),
        ({}, {"contact": [SOFT]}, "contact is a list"),
        ({}, {"contact": {"bottom": hv.Contact(hv.Compliance(1.0), gap=lambda x: np.nan * x[:, 0])}}, "returned"),
        ({}, {"trace": 3}, "trace is 3"),
        ({}, {"trace": lambda u, p: u}, "trace cannot be evaluated"),
        ({}, {"trace": lambda u: np.stack([u[0], u[1], u[0]])}, "3 components touch"),
        ({}, {"at": True}, "at is True"),
        ({}, {"contact": {"middle": SOFT}}, "facets inside of the mesh"),
    ],
)
def test_bad_bodies_and_contacts_are_told(body: dict[str, Any], contact: dict[str, Any], words: str) -> None:
    stated: dict[str, Any] = {"basis": SMALL, "form": elastic, "supports": {"top": 0.0}} | body
    with pytest.raises(hv.errors.ProblemError, match=words):
        FormBody(**stated).problem(**({"contact": {"bottom": SOFT}} | contact))


def test_lines_of_scikit_fem_are_told() -> None:
    mesh = skfem.MeshLine().refined(2).with_boundaries({"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 0.99})
    basis = skfem.Basis(mesh, skfem.ElementLineP1())
    body = FormBody(basis, skfem.BilinearForm(lambda u, v, w: dot(grad(u), grad(v))), supports={"left": 0.0})
    with pytest.raises(hv.errors.ProblemError, match="take triangles"):
        body.problem({"right": SOFT})


def test_a_mixed_body_wants_a_symmetric_form_and_its_own_load() -> None:
    @skfem.BilinearForm
    def skew(u: Any, p: Any, v: Any, q: Any, w: Any) -> Any:
        return 2.0 * MU * ddot(sym_grad(u), sym_grad(v)) + div(u) * q - div(v) * p

    basis = taylor_hood(2)
    held = {"top": {"u^1^1": 0.0, "u^2^1": -0.1}}
    with pytest.raises(hv.errors.ProblemError, match="not symmetric"):
        FormBody(basis, skew, supports=held).problem({"bottom": SOFT})
    body = FormBody(basis, incompressible, supports=held)
    problem = body.problem({"bottom": SOFT})
    other = problem.with_(load=problem.load + 1.0)
    with pytest.raises(hv.errors.ProblemError, match="stated load"):
        body.full(other, hv.solve(other).unknowns)


@pytest.mark.parametrize(
    ("mesh", "element", "at", "words"),
    [
        (skfem.MeshTet, skfem.ElementTetP2, "nodes", "no positive weights"),
        (skfem.MeshHex, skfem.ElementHexS2, "nodes", "no positive weights"),
        (skfem.MeshTet, skfem.ElementTetP2, 3, "degree 3 has negative weights"),
    ],
)
def test_contact_points_want_positive_weights(mesh: Any, element: Any, at: str | int, words: str) -> None:
    basis = skfem.Basis(grid(mesh, 1), skfem.ElementVector(element()))
    with pytest.raises(hv.errors.ProblemError, match=words):
        FormBody(basis, elastic, supports={"top": 0.0}).problem({"bottom": SOFT}, at=at)


@pytest.mark.parametrize("pressure", [skfem.ElementTriP1, skfem.ElementTriP0])
def test_pairs_of_elements_that_lock_or_oscillate_are_told(pressure: Any) -> None:
    element = skfem.ElementVector(skfem.ElementTriP1()) * pressure()
    basis = skfem.Basis(grid(skfem.MeshTri, 3), element, intorder=4)
    body = FormBody(basis, incompressible, supports={"top": {"u^1^1": 0.0, "u^2^1": -0.1}})
    with pytest.raises(hv.errors.ProblemError, match="stable together"):
        body.problem({"bottom": SOFT})


def test_a_constraint_that_is_stated_twice_is_told() -> None:
    basis = taylor_hood(2)
    body = FormBody(basis, incompressible, supports={"top": {"u^1^1": 0.0, "u^2^1": -0.1}})
    matrix = incompressible.assemble(basis).tolil()
    first, second = basis.get_dofs("bottom").all(["u^2"])[:2]
    matrix[second, :], matrix[:, second] = matrix[first, :], matrix[:, first]
    twice = FormBody(basis, matrix.tocsr(), supports=body.supports)
    with pytest.raises(hv.errors.ProblemError, match="stated twice"):
        twice.problem({"bottom": SOFT})


def test_constraints_that_leave_a_pressure_open_are_told() -> None:
    basis = taylor_hood(2)
    held = {side: {"u^1^1": 0.0, "u^2^1": 0.0} for side in ("top", "left", "right")} | {"bottom": {"u^2^1": 0.0}}
    with pytest.raises(hv.errors.ProblemError, match="fix a pressure"):
        FormBody(basis, incompressible, supports=held).problem({"bottom": SOFT}, trace=lambda u, p: u[0])
