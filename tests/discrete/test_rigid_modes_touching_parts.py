"""Parts that contact alone holds, against foundations and one another: one by one and together, named in messages."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete.rigid_modes import rigid_basis
from tests.samples import sampled

MATERIAL = hv.Material.young(10.0, 0.3)
HALVES = hv.Mesh.assembled({
    "upper": hv.rectangle((1.0, 0.5), 4, origin=(0.0, 0.5)),
    "lower": hv.rectangle((1.0, 0.5), 6),
})  # fmt: skip


def stack(between: float, below: float, top: tuple[float, float], mesh: hv.Mesh = HALVES) -> hv.ContactProblem:
    """Two blocks on a foundation; with bounds of the friction between them and below."""
    contact = {
        "upper:bottom": hv.Contact(hv.Signorini(), hv.Tresca(between), against="lower:top"),
        "lower:bottom": hv.Contact(hv.Signorini(), hv.Tresca(below)),
    }
    return hv.ContactProblem(mesh, MATERIAL, contact, tractions={"upper:top": top})


@pytest.mark.parametrize(
    ("between", "below", "top", "words"),
    [
        (0.1, 0.1, (0.0, -0.1), None),
        (0.1, 0.1, (0.03, -0.1), None),
        (0.01, 0.1, (0.05, -0.2), r"^part 'upper' of .*\), is free to move: .*energy falls by 0\.04 "),
        (0.1, 0.01, (0.05, -0.2), r"^part 'upper' of .*together with part 'lower', .*\(1, 0\).* falls by 0\.04 "),
        (
            0.1,
            0.0,
            (0.0, -0.1),
            r"together with part 'lower', .*nothing constrains the rigid motion .*translation \(-?1, 0\)\)",
        ),
        (
            0.0,
            0.1,
            (0.0, -0.1),
            r"^part 'upper' of .*\), is free to move: nothing constrains the rigid motion .*translation \(-?1, 0\)\)",
        ),
        (0.1, 0.1, (0.0, 0.1), r"part 'upper' .*translation \(0, 1\)\) \(energy falls by 0\.1 "),
        (0.1, 0.1, (0.08, -0.1), r"'upper' .*with rotation"),
    ],
    ids=["pressed", "pushed", "slides", "slide together", "smooth below", "smooth between", "lifted", "tips over"],
)
def test_a_stack_is_held_or_a_part_of_it_is_named(
    between: float, below: float, top: tuple[float, float], words: str | None
) -> None:
    statement = stack(between, below, top)
    if words is not None:
        with pytest.raises(hv.errors.SupportError, match=words):
            hv.discretize(statement)
        return
    found = hv.solve(statement)
    assert found.status is hv.Status.CONVERGED
    for name in ("upper:bottom", "lower:bottom"):
        on = found.problem.contact.on(name)
        force = found.problem.contact.weights[on] @ found.multiplier[on]
        assert force[0] == pytest.approx(0.1, rel=1e-9)
        assert abs(force[1]) == pytest.approx(top[0], abs=1e-9)


def test_bodies_that_hold_one_another_are_free_to_move_together() -> None:
    contact = {"upper:bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1), against="lower:top")}
    squeezed = hv.ContactProblem(
        HALVES, MATERIAL, contact, tractions={"upper:top": (0.0, -0.1), "lower:bottom": (0.0, 0.1)}
    )
    with pytest.raises(hv.errors.SupportError, match=r"part '(upper|lower)' .*together with part '(lower|upper)'"):
        hv.discretize(squeezed)


def test_a_part_that_touches_nothing_stated_is_told_how_to_state_it() -> None:
    load = {"upper:top": (0.0, -0.1)}
    alone = hv.ContactProblem(HALVES, MATERIAL, {}, {"lower:bottom": hv.Clamped()}, tractions=load)
    with pytest.raises(hv.errors.SupportError, match=r"^part 'upper' .*against = \.\.\."):
        hv.discretize(alone)


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_stack_without_load_rests_where_it_is(friction: float) -> None:
    """Its gaps are zero exactly: what rounding of the places makes of them would push the parts apart."""
    mesh = HALVES.moved(np.eye(2), (0.1, 0.7))
    if not friction:
        with pytest.raises(hv.errors.SupportError, match="'upper'"):
            hv.discretize(stack(friction, friction, (0.0, 0.0), mesh))
        return
    found = hv.solve(stack(friction, friction, (0.0, 0.0), mesh))
    assert found.status is hv.Status.CONVERGED
    assert not found.displacement.any()
    assert "this equilibrium is one of many" in str(found.problem.idle)


def row(touching: list[tuple[str, str]]) -> hv.ContactProblem:
    """Four blocks side by side, of which some touch."""
    places = {"a": 0.0, "b": 1.0, "c": 2.0, "d": 3.0}
    mesh = hv.Mesh.assembled({name: hv.rectangle((1.0, 1.0), 2, origin=(x, 0.0)) for name, x in places.items()})
    law = hv.Adhesive(1e3, 0.5, softening=100.0, compression=1e4)
    contact = {f"{one}:right": hv.Contact(law, hv.Tresca(1.0), against=f"{other}:left") for one, other in touching}
    return hv.ContactProblem(mesh, MATERIAL, contact)


@pytest.mark.parametrize(
    ("touching", "parts"),
    [([], [[0], [1], [2], [3]]), ([("a", "b"), ("c", "d")], [[0, 1], [2, 3]]), ([("b", "c")], [[0], [1, 2], [3]])],
)
def test_motions_of_parts_that_touch_are_of_one_group(touching: list[tuple[str, str]], parts: list[list[int]]) -> None:
    """And they remain what the coefficients of the group say, part by part."""
    problem = hv.discretize(row(touching), check_coercivity=False)
    mesh, motions = problem.field.mesh, problem.model.free_motions  # type: ignore[union-attr]
    assert [group.parts.tolist() for group in motions.groups] == parts
    np.testing.assert_array_equal(np.concatenate([np.r_[group.columns] for group in motions.groups]), np.arange(12))
    for group in motions.groups:
        moved = motions.motions[:, group.columns].toarray().reshape(mesh.number_of_nodes, 2, -1)
        for part, coefficients in zip(group.parts, group.coefficients, strict=True):
            nodes = np.unique(mesh.cells[mesh.parts.cell == part])
            expected = rigid_basis(mesh.points[nodes])[0] @ coefficients
            np.testing.assert_allclose(moved[nodes].reshape(-1, moved.shape[2]), expected, atol=1e-14)


@pytest.mark.parametrize("count", sampled([3, 8], 1))
def test_towers_in_space_are_told_to_stand_or_fall(count: int) -> None:
    """The force sideways on the top of a tower of cubes tips it over above half of the weight over its height."""
    mesh = hv.Mesh.assembled({
        f"block {i}": hv.box((1.0, 1.0, 1.0), 1 + i % 2, origin=(0.0, 0.0, float(i))) for i in range(count)
    })  # fmt: skip
    contact = {
        f"block {i}:bottom": hv.Contact(hv.Signorini(), hv.Tresca(5.0), against=f"block {i - 1}:top" if i else None)
        for i in range(count)
    }
    top = f"block {count - 1}:top"
    for side, stands in ((0.49 / count, True), (0.51 / count, False)):
        pressed = hv.ContactProblem(mesh, MATERIAL, contact, tractions={top: (side, 0.0, -1.0)})
        if stands:
            assert hv.discretize(pressed).held
            continue
        with pytest.raises(hv.errors.SupportError, match=r"part 'block \d' .*rotation"):
            hv.discretize(pressed)


@pytest.mark.parametrize("space", [False, True])
def test_friction_that_grows_with_the_pressure_holds_within_its_cone(space: bool) -> None:
    """A flat block slides where the force sideways exceeds mu times the weight; a tower of two as well."""
    size = (4.0, 4.0, 0.5) if space else (4.0, 0.5)
    build = hv.box if space else hv.rectangle
    mesh = hv.Mesh.assembled({
        "lower": build(size, 2), "upper": build(size, 3, origin=(*(0.0,) * (len(size) - 1), 0.5)),
    })  # fmt: skip
    contact = {
        "upper:bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3), against="lower:top"),
        "lower:bottom": hv.Contact(hv.Compliance(50.0), hv.Coulomb(0.4)),
    }
    turned = np.array([np.cos(0.2), np.sin(0.2)]) if space else np.ones(1)  # not along a direction of the polygon
    for part, stands in ((0.28, True), (0.31, False)):
        load = (*(part * turned).tolist(), -1.0)
        pressed = hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, tractions={"upper:top": load})
        if not stands:
            with pytest.raises(hv.errors.SupportError, match=r"^part 'upper' .*up to what the pressure provides"):
                hv.discretize(pressed)
            continue
        found = hv.solve(pressed)
        assert found.status is hv.Status.CONVERGED
        assert any("an equilibrium is not proved" in said for said in found.warnings)
        friction = found.problem.contact.weights[:, None] * found.multiplier[:, 1:]
        on = found.problem.contact.on("upper:bottom")
        sides = 4.0 ** len(turned) * part
        assert np.linalg.norm(friction[on].sum(axis=0)) == pytest.approx(sides, rel=1e-7)


def test_a_bound_beside_coulombs_law_counts_where_it_is() -> None:
    """Friction with a bound of its own is sure, whatever holds on the other boundaries."""
    contact = {
        "upper:bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1), against="lower:top"),
        "lower:bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3)),
    }
    supports = {"lower:left": hv.Fixed(x=0.0)}
    load = {"upper:top": (0.0, -0.1)}
    held = hv.discretize(hv.ContactProblem(HALVES, MATERIAL, contact, supports, tractions=load))
    assert held.held
    assert not held.warnings
    up, down, slip = held.law.rates
    np.testing.assert_array_equal(slip, np.where(held.contact.boundary == 0, 0.1, 0.0))
    assert np.isposinf(up).all()
    assert not down.any()
