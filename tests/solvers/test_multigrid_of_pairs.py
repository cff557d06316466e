"""Multigrid where bodies touch each other: the cycles of one body, the solution of the condensed body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.discrete.contact import selects
from hemivar.fem import hierarchy
from hemivar.solvers import choice
from hemivar.systems import body_on_levels
from tests.samples import slow

SOFT = hv.Material.lame(4.0, 4.0)
#: Cycles of a pair over those of one body: where the two touch or are glued, and where they part somewhere.
TOGETHER, APART = 1.25, 1.5


def unit_blocks(upper: int, lower: int, dim: int = 2, shift: float = 0.0) -> hv.Mesh:
    """Two unit blocks, one on the other."""
    make = hv.rectangle if dim == 2 else hv.box
    up, down = (shift,) + (0.0,) * (dim - 1), (0.0,) * (dim - 1) + (-1.0,)
    return hv.Mesh.assembled({"u": make(cells=upper, origin=up), "l": make(cells=lower, origin=down)})


def stiff(upper: float, lower: float) -> hv.Material:
    """A material that is so many times as stiff above and below."""
    return hv.Material.by_region({name: hv.Material.lame(4.0 * k, 4.0 * k) for name, k in (("u", upper), ("l", lower))})


def pressed(
    mesh: hv.Mesh, contact: hv.Contact, material: hv.Material = SOFT, push: tuple[float, ...] = (0.0, -0.05)
) -> hv.ContactProblem:
    held: Mapping[str, hv.Support] = {"u:top": hv.Prescribed(push), "l:bottom": hv.Clamped()}
    return hv.ContactProblem(mesh, material, {"u:bottom": contact}, held)


def one_body(cells: int, law: hv.Contact, dim: int = 2) -> hv.ContactProblem:
    """A block on a foundation."""
    make = hv.rectangle if dim == 2 else hv.box
    held = {"top": hv.Prescribed((0.0,) * (dim - 1) + (-0.05,))}
    return hv.ContactProblem(make(cells=cells), SOFT, {"bottom": law}, held)


def cycles(problem: hv.ContactProblem) -> int:
    """Those of contact by multigrid, whose solution is that of the condensed body."""
    discrete = hv.discretize(problem)
    assert selects(discrete.contact.trace)
    found, reference = (hv.solve(discrete, method=one) for one in ("multigrid", "newton"))
    assert found.status is reference.status is hv.Status.CONVERGED
    size = np.abs(reference.displacement).max()
    np.testing.assert_allclose(found.displacement, reference.displacement, atol=1e-8 * size)
    return found.evaluations


TOUCHING = hv.Contact(hv.Signorini(), against="l:top")
RUBBING = hv.Contact(hv.Signorini(), hv.Tresca(0.02), against="l:top")
CURVED = hv.Contact(hv.Signorini(), hv.Tresca(0.02), against="l:top", gap=lambda x: 0.2 * (x[:, 0] - 0.5) ** 2)


@pytest.mark.parametrize(
    ("contact", "material", "shift", "limit"),
    [
        (TOUCHING, SOFT, 0.0, TOGETHER),
        (TOUCHING, stiff(1.0, 1000.0), 0.0, TOGETHER),
        (TOUCHING, stiff(1000.0, 1.0), 0.0, TOGETHER),
        (RUBBING, SOFT, 0.0, TOGETHER),
        (hv.Contact(hv.laws.Bilateral(), hv.Tresca(1e3), against="l:top"), SOFT, 0.0, TOGETHER),
        (hv.Contact(hv.Compliance(1e3), against="l:top"), SOFT, 0.0, TOGETHER),
        (CURVED, SOFT, 0.0, APART),
        (CURVED, stiff(1.0, 1000.0), 0.0, APART),
        (RUBBING, SOFT, 0.25, APART),
    ],
    ids=["alike", "stiff lower", "stiff upper", "friction", "glue", "springs", "half", "half, stiff", "hanging over"],
)
@pytest.mark.parametrize("sizes", [(24, 16), slow((48, 32))], ids=["3 levels", "4 levels"])
def test_a_pair_takes_the_cycles_of_one_body(
    sizes: tuple[int, int], contact: hv.Contact, material: hv.Material, shift: float, limit: float
) -> None:
    """One body has as many unknowns, on a foundation with the law of the pair."""
    one = cycles(one_body(sizes[0] * 4 // 3, hv.Contact(contact.normal, contact.friction, gap=contact.gap)))
    assert cycles(pressed(unit_blocks(*sizes, shift=shift), contact, material)) <= limit * one


@pytest.mark.parametrize("contact", [TOUCHING, RUBBING, CURVED], ids=["alike", "friction", "half"])
def test_a_pair_without_a_coarser_mesh_takes_no_more(contact: hv.Contact, monkeypatch: pytest.MonkeyPatch) -> None:
    """Odd numbers of cells: what is prescribed must be carried into the bodies as on the nodes that are left."""
    good = cycles(pressed(unit_blocks(25, 17), contact))
    assert good <= cycles(pressed(unit_blocks(24, 16), contact)) + 2
    monkeypatch.setattr(body_on_levels.BodyProblem, "carried", None)
    assert cycles(pressed(unit_blocks(25, 17), contact)) > good


def test_interpolation_of_each_body_by_itself_takes_more_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jumps must be interpolated as jumps, and what the bodies do together must make none."""
    problem = pressed(unit_blocks(48, 32), TOUCHING)
    good = cycles(problem)

    def by_itself(fine: hv.DiscreteProblem) -> hierarchy.Coarser | None:
        step = coarser(fine)
        if step is None:
            return None
        assert step.field.mesh.parent is not None
        assert step.problem.field is not None
        nodal = sp.kron(step.field.mesh.parent.interpolation, np.eye(2))
        plain = step.field.own.T @ nodal @ step.problem.field.own
        return replace(step, prolongation=sp.csr_array(plain))

    coarser = hierarchy.coarser
    monkeypatch.setattr(body_on_levels, "coarser", by_itself)
    assert cycles(problem) > 1.5 * good


@pytest.mark.parametrize("friction", [hv.laws.NoFriction(), hv.Coulomb(0.3)], ids=["frictionless", "coulomb"])
@pytest.mark.parametrize("sizes", [(16, 24, 32), (32, 24, 16), (24, 32, 16), (24, 16, 32)])
def test_chains_of_bodies(sizes: tuple[int, ...], friction: hv.laws.Friction) -> None:
    """A node may be the slave of one pair and the master of another, or each side of a body the slave of one."""
    parts = {
        name: hv.rectangle(cells=n, origin=(0.0, float(k)))
        for k, (name, n) in enumerate(zip("abc", sizes, strict=True))
    }
    touch = {f"{one}:bottom": hv.Contact(hv.Signorini(), friction, against=f"{two}:top") for one, two in ("ba", "cb")}
    held = {"a:bottom": hv.Clamped(), "b:left": hv.Roller(), "c:left": hv.Roller()}
    push = {"c:top": hv.Pressure(0.2)}
    assert cycles(hv.ContactProblem(hv.Mesh.assembled(parts), SOFT, touch, held, tractions=push)) <= 24


@pytest.mark.parametrize("base", [16, 32], ids=["two slaves on one master", "one slave under two masters"])
def test_bodies_that_contact_alone_holds_beside_foundations_and_at_corners(base: int) -> None:
    """Two blocks on one, and a wall at their left ends; the two touch each other as well where they are the slaves."""
    parts = {"a": hv.rectangle((2.0, 1.0), cells=(2 * base, base))}
    parts |= {name: hv.rectangle(cells=24, origin=(x, 1.0)) for name, x in (("b", 0.0), ("c", 1.0))}
    rubs = {"normal": hv.Signorini(), "friction": hv.Tresca(0.02)}
    touch = {f"{name}:bottom": hv.Contact(**rubs, against="a:top") for name in "bc"}
    if base == 16:
        touch["b:right"] = hv.Contact(**rubs, against="c:left")
    touch |= {
        "a:bottom": hv.Contact(**rubs),
        "b:left": hv.Contact(hv.Compliance(10.0)),
        "a:left": hv.Contact(hv.Compliance(10.0)),
    }
    push = {"b:top": hv.Pressure(0.2), "c:top": hv.Pressure(0.1)}
    assert cycles(hv.ContactProblem(hv.Mesh.assembled(parts), SOFT, touch, {}, tractions=push)) <= 30


def test_held_slave_ends_and_turned_bodies() -> None:
    """Rollers hold one component at the ends of the slave; all of it stands in no axis."""
    contact = {"u:bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3), against="l:top")}
    held = {"l:bottom": hv.Clamped(), "u:left": hv.Roller(), "l:right": hv.Clamped()}
    for mesh in (unit_blocks(24, 16), unit_blocks(24, 16).rotated(30.0)):
        assert cycles(hv.ContactProblem(mesh, SOFT, contact, held, tractions={"u:top": hv.Pressure(0.2)})) <= 30


def test_space() -> None:
    one = cycles(one_body(10, hv.Contact(hv.Signorini(), hv.Tresca(0.02)), dim=3))
    contact = hv.Contact(hv.Signorini(), hv.Tresca(0.02), against="l:top")
    assert cycles(pressed(unit_blocks(8, 6, dim=3), contact, push=(0.0, 0.0, -0.05))) <= APART * one


def test_the_default_method_is_multigrid_where_it_is_for_one_body() -> None:
    one = hv.discretize(one_body(216, hv.Contact(hv.Signorini())))
    two = hv.discretize(pressed(unit_blocks(180, 120), TOUCHING))
    assert abs(one.unknowns / two.unknowns - 1.0) < 0.02
    assert choice.choose(one)[0].name == choice.choose(two)[0].name == "multigrid"


@pytest.mark.parametrize(
    ("contact", "material", "limit"),
    [(TOUCHING, SOFT, TOGETHER), (TOUCHING, stiff(1.0, 1000.0), TOGETHER), (CURVED, SOFT, 2.0)],
    ids=["alike", "stiff lower", "half"],
)
def test_without_coarser_meshes(contact: hv.Contact, material: hv.Material, limit: float) -> None:
    """Aggregates know that each body may move alone, and that both move as one where they touch."""
    found = []
    for stated in (one_body(64, replace(contact, against=None)), pressed(unit_blocks(48, 32), contact, material)):
        mesh = stated.mesh
        plain = replace(stated, mesh=hv.Mesh(mesh.points, mesh.cells, mesh.boundaries, mesh.regions))
        discrete = hv.discretize(plain)
        levels = body_on_levels.ElasticMultigrid.of(discrete)
        assert not levels.steps
        found.append((levels.solve(discrete.load, nested=False)[1], cycles(plain)))
    assert found[1][0] <= TOGETHER * found[0][0]
    assert found[1][1] <= limit * found[0][1]


def test_where_one_body_has_no_coarser_mesh_levels_go_on_without() -> None:
    problem = pressed(unit_blocks(64, 50), TOUCHING)
    assert cycles(problem) <= APART * cycles(one_body(80, hv.Contact(hv.Signorini())))
    hierarchy = body_on_levels.ElasticMultigrid.of(hv.discretize(problem))
    assert len(hierarchy.steps) == 1


@pytest.mark.parametrize(("upper", "lower"), [(8, 8), (12, 8)])
@pytest.mark.parametrize("friction", [hv.laws.NoFriction(), hv.Tresca(0.02)], ids=["frictionless", "tresca"])
def test_quadratic_elements_of_a_pair_take_little_more_than_those_of_one_body(
    friction: hv.laws.Friction, upper: int, lower: int
) -> None:
    """Both by aggregation: there is no hierarchy of quadratic elements."""
    pair = replace(pressed(unit_blocks(upper, lower), replace(TOUCHING, friction=friction)), order=2)
    alone = replace(one_body(upper, hv.Contact(hv.Signorini(), friction)), order=2)
    assert cycles(pair) <= 2.0 * cycles(alone)
