"""Contact of two bodies: the mortar projection, patch tests on meshes that do not match, forces on both sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array, BoolArray
from hemivar.fem.mortar import Mortar, mortar
from hemivar.fem.pairing import paired
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule

PRESSURE, MATERIAL = 0.03, hv.Material.young(10.0, 0.3)


def turned(mesh: hv.Mesh, degrees: float) -> hv.Mesh:
    """The mesh turned about the origin, about all axes in space."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    if mesh.dim == 3:
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return hv.Mesh(mesh.points @ turn.T, mesh.cells, mesh.boundaries, mesh.regions)


def blocks(upper: tuple[int, ...], lower: tuple[int, ...], degrees: float = 0.0) -> hv.Mesh:
    """Two unit blocks, one on the other."""
    make = hv.rectangle if len(upper) == 2 else hv.box
    shift, size = (0.0,) * (len(upper) - 1) + (1.0,), (1.0,) * len(upper)
    return turned(hv.Mesh.assembled({"u": make(size, upper, origin=shift), "l": make(size, lower)}), degrees)


def pressed_pair(mesh: hv.Mesh, contact: hv.Contact, order: int = 1) -> hv.ContactProblem:
    """Pressed from above, with rollers on three sides: the stress is uniform."""
    sides = ["left", "front"][: mesh.dim - 1]
    held = {"l:bottom": hv.Roller()} | {f"{part}:{side}": hv.Roller() for part in "ul" for side in sides}
    load = {"u:top": hv.Pressure(PRESSURE)}
    return hv.ContactProblem(mesh, MATERIAL, {"u:bottom": contact}, held, tractions=load, order=order)


def resultants(solution: hv.Solution) -> tuple[Array, Array]:
    """Contact forces on the upper and on the lower body, from the nodal forces of the trace."""
    problem = solution.problem
    field = problem.field
    assert field is not None
    forces = (field.lift.T @ problem.contact.force(solution.multiplier)).reshape(-1, field.mesh.dim)
    upper = np.zeros(len(forces), dtype=bool)
    upper[np.unique(field.mesh.cell_nodes(field.order)[field.mesh.regions["u"]])] = True
    return forces[upper].sum(axis=0), forces[~upper].sum(axis=0)


PLANE, SPACE = ((7, 3), (5, 4)), ((3, 4, 2), (4, 3, 2))


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
@pytest.mark.parametrize("friction", [hv.laws.NoFriction(), hv.Coulomb(0.3)], ids=["frictionless", "coulomb"])
@pytest.mark.parametrize(
    ("sizes", "order"),
    [(PLANE, 1), (PLANE, 2), (SPACE, 1), (((2, 3, 1), (3, 2, 1)), 2)],
    ids=["plane", "quadratic", "space", "tetra10"],
)
def test_uniform_pressure_goes_through_meshes_that_do_not_match(
    sizes: tuple[tuple[int, ...], tuple[int, ...]], order: int, friction: hv.laws.Friction, slave: str, degrees: float
) -> None:
    contact = hv.Contact(hv.Signorini(), friction, against="l:top", slave=slave)
    solution = hv.solve(pressed_pair(blocks(*sizes, degrees), contact, order))
    assert solution.status is hv.Status.CONVERGED
    # a residual of 1e-12 of the load, over the weight of a point
    rounding = 1e-12 * PRESSURE / solution.problem.contact.weights
    assert (np.abs(solution.pressure - PRESSURE) < rounding).all()
    assert (np.linalg.norm(solution.multiplier[:, 1:], axis=1) < rounding).all()
    assert solution.problem.contact.weights.sum() == pytest.approx(1.0, rel=1e-13)
    assert not solution.warnings


def test_glue_between_meshes_that_do_not_match_carries_a_linear_field() -> None:
    """Rigid glue makes one of two blocks, whose uniform strain is exact; supports hold the ends of the slave."""
    strain = np.array([[0.01, 0.004], [0.004, -0.02]])
    law = hv.Contact(hv.laws.Bilateral(), hv.Tresca(1e3), against="l:top")
    held = {name: hv.Prescribed(lambda x: x @ strain.T) for name in ("u:left", "u:right", "u:top")}
    held |= {name: hv.Prescribed(lambda x: x @ strain.T) for name in ("l:left", "l:right", "l:bottom")}
    mesh = blocks((7, 3), (5, 4))
    solution = hv.solve(hv.ContactProblem(mesh, MATERIAL, {"u:bottom": law}, held))
    np.testing.assert_allclose(solution.displacement, mesh.points @ strain.T, atol=1e-14)


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("held", [("left",), ("left", "right")])
@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
def test_shear_goes_through_where_supports_hold_ends_tangentially(
    slave: str, held: tuple[str, ...], order: int, degrees: float
) -> None:
    """Rollers at the sides hold the ends along the contact; the master has nodes between those of the slave."""
    shear, down = 0.02, 0.03
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    stress = turn @ np.array([[0.0, 5.0 * shear], [5.0 * shear, -10.0 * down]]) @ turn.T

    def field(x: Array) -> Array:
        own = x @ turn
        return np.asarray(np.column_stack([np.zeros(len(x)), shear * own[:, 0] - down * own[:, 1]]) @ turn.T)

    ways = {"left": (-1.0, 0.0), "right": (1.0, 0.0)}
    pull = {f"{part}:{side}": tuple(stress @ turn @ way) for part in "ul" for side, way in ways.items()}
    problem = hv.ContactProblem(
        blocks((6, 2), (4, 2), degrees), hv.Material.young(10.0, 0.0),
        {"u:bottom": hv.Contact(hv.Signorini(), hv.Tresca(50.0), against="l:top", slave=slave)},
        {"l:bottom": hv.Prescribed(field)} | {f"{part}:{side}": hv.Roller() for part in "ul" for side in held},
        tractions=pull | {"u:top": tuple(stress @ turn @ (0.0, 1.0))}, order=order,  # type: ignore[arg-type]
    )  # fmt: skip
    solution = hv.solve(problem)
    off = np.abs(solution.displacement - field(problem.mesh.nodes(order))).max() / shear
    assert off < 1e-13


@pytest.mark.parametrize("held", [("left",), ("left", "right"), ("left", "front")])
@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
@pytest.mark.parametrize(("sizes", "order"), [(((6, 6, 2), (4, 4, 2)), 1), (((3, 3, 1), (2, 2, 1)), 2)])
def test_shear_goes_through_where_supports_hold_edges_tangentially(
    sizes: tuple[tuple[int, ...], tuple[int, ...]], order: int, slave: str, held: tuple[str, ...]
) -> None:
    shear, down = 0.02, 0.03
    stress = np.array([[0.0, 0.0, 5.0 * shear], [0.0, 0.0, 0.0], [5.0 * shear, 0.0, -10.0 * down]])

    def field(x: Array) -> Array:
        return np.column_stack([np.zeros((len(x), 2)), shear * x[:, 0] - down * x[:, 2]])

    ways = {"left": (-1.0, 0.0, 0.0), "right": (1.0, 0.0, 0.0), "front": (0.0, -1.0, 0.0), "back": (0.0, 1.0, 0.0)}
    pull = {f"{part}:{side}": tuple(stress @ way) for part in "ul" for side, way in ways.items()}
    problem = hv.ContactProblem(
        blocks(*sizes), hv.Material.young(10.0, 0.0),
        {"u:bottom": hv.Contact(hv.Signorini(), hv.Tresca(50.0), against="l:top", slave=slave)},
        {"l:bottom": hv.Prescribed(field)} | {f"{part}:{side}": hv.Roller() for part in "ul" for side in held},
        tractions=pull | {"u:top": tuple(stress[2])}, order=order,
    )  # fmt: skip
    assert np.abs(hv.solve(problem).displacement - field(problem.mesh.nodes(order))).max() < 1e-13 * shear


@pytest.mark.parametrize("sizes", [((1, 2), (2, 2)), ((3, 4, 2), (4, 3, 2))], ids=["plane", "space"])
def test_held_ends_that_see_the_same_nodes_of_the_master_do_not_depend_on_one_another(
    sizes: tuple[tuple[int, ...], tuple[int, ...]],
) -> None:
    held = {f"{part}:{side}": hv.Roller() for part in "ul" for side in ("left", "right")}
    held |= {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((0.0,) * (len(sizes[0]) - 1) + (-0.02,))}
    contact = hv.Contact(hv.Signorini(), hv.Tresca(50.0), against="l:top", slave="u:bottom")
    solution = hv.solve(hv.ContactProblem(blocks(*sizes), hv.Material.young(10.0, 0.0), {"u:bottom": contact}, held))
    assert solution.status is hv.Status.CONVERGED
    np.testing.assert_allclose(solution.displacement[:, :-1], 0.0, atol=1e-14)


@pytest.mark.parametrize(("sizes", "slave"), [(((6, 2), (4, 2)), "l:top"), (((6, 2), (6, 2)), "u:bottom")])
def test_friction_acts_up_to_an_end_that_a_support_holds(sizes: tuple[tuple[int, int], ...], slave: str) -> None:
    """One body is dragged over the other, whose ends are held along the contact: the whole side rubs."""
    still, moved = ("l", "u") if slave == "l:top" else ("u", "l")
    ends = {f"{still}:{side}": hv.Fixed(x=0.0) for side in ("left", "right")}
    far = {"u": "u:top", "l": "l:bottom"}
    held = ends | {far[still]: hv.Clamped(), far[moved]: hv.Prescribed((0.1, 0.02 if moved == "l" else -0.02))}
    contact = hv.Contact(hv.Compliance(50.0), hv.Tresca(0.02), against="l:top", slave=slave)
    solution = hv.solve(hv.ContactProblem(blocks(*sizes), MATERIAL, {"u:bottom": contact}, held))
    assert abs(solution.contact_forces["u:bottom"][0]) == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize("sizes", [PLANE, SPACE], ids=["plane", "space"])
@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
def test_forces_on_the_two_bodies_are_opposite_to_rounding(
    sizes: tuple[tuple[int, ...], tuple[int, ...]], slave: str
) -> None:
    """A load that is not uniform, with friction, on a pair that is not flat."""
    mesh = blocks(*sizes)
    bulge: Callable[[Array], Array] = lambda p: p + 0.05 * np.sin(np.pi * p[:, :1]) * np.eye(mesh.dim)[-1]  # noqa: E731
    mesh = hv.Mesh(bulge(mesh.points), mesh.cells, mesh.boundaries, mesh.regions)
    contact = hv.Contact(hv.Signorini(), hv.Coulomb(0.2), against="l:top", slave=slave)
    push = (0.004,) + (0.0,) * (mesh.dim - 2) + (-0.02,)
    problem = hv.ContactProblem(
        mesh, MATERIAL, {"u:bottom": contact}, {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed(push)}
    )
    solution = hv.solve(problem)
    assert solution.status is hv.Status.CONVERGED
    upper, lower = resultants(solution)
    assert np.linalg.norm(upper) > 1e-3
    np.testing.assert_allclose(upper, -lower, atol=1e-14 * np.linalg.norm(upper))


def test_both_choices_of_the_slave_agree_as_the_mesh_allows() -> None:
    found = []
    for n in (8, 16, 32):
        mesh = blocks((n, n), (n + n // 3, n))
        total = []
        for slave in ("u:bottom", "l:top"):
            contact = hv.Contact(hv.Compliance(20.0), hv.Tresca(0.02), against="l:top", slave=slave)
            held = {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((0.01, -0.05))}
            total.append(resultants(hv.solve(hv.ContactProblem(mesh, MATERIAL, {"u:bottom": contact}, held)))[0])
        found.append(np.linalg.norm(total[0] - total[1]) / np.linalg.norm(total[0]))
    assert found[2] < 1e-3
    assert found[2] < 0.5 * found[0]


def energy_error(upper: int, lower: int, reference: float) -> float:
    mesh = blocks((upper, upper), (lower, lower))
    contact = hv.Contact(hv.Compliance(20.0), hv.Tresca(0.02), against="l:top")
    held = {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((0.01, -0.05))}
    return hv.solve(hv.ContactProblem(mesh, MATERIAL, {"u:bottom": contact}, held)).energy - reference


def test_no_order_is_lost_against_meshes_that_match() -> None:
    """Energies have one limit: the error of n on 3 n / 4 cells lies between those of 3 n / 4 and n that match."""
    fine = energy_error(96, 96, 0.0)
    for n in (8, 16):
        coarse, mixed, good = (energy_error(a, b, fine) for a, b in ((3 * n // 4,) * 2, (n, 3 * n // 4), (n, n)))
        assert good < coarse
        assert 0.9 * good < mixed < 1.1 * coarse


def sides_of(mesh: hv.Mesh) -> tuple[BoundaryRule, BoundaryRule]:
    return boundary_rule(mesh, "u:bottom"), boundary_rule(mesh, "l:top")


def joined(mesh: hv.Mesh, sides: tuple[BoundaryRule, BoundaryRule], without: BoolArray) -> Mortar:
    return mortar(mesh, paired(mesh, sides, "pair"), without, BodyKinematics.of(MATERIAL, mesh.dim))


@pytest.mark.parametrize("sizes", [PLANE, SPACE], ids=["plane", "space"])
def test_the_mean_jump_of_a_linear_field_is_none_and_weights_keep_the_area(
    sizes: tuple[tuple[int, ...], tuple[int, ...]],
) -> None:
    mesh = blocks(*sizes)
    without = np.zeros(mesh.number_of_nodes, dtype=bool)
    sides = sides_of(mesh)
    upper = sides[0].nodes
    found = joined(mesh, sides, without[upper])
    assert np.abs(found.jump @ mesh.points).max() < 1e-14
    without[np.flatnonzero(mesh.points[:, 0] < 1e-9)] = True  # held with the left side
    held = joined(mesh, sides, without[upper])
    assert held.weights.sum() == pytest.approx(1.0, rel=1e-13)
    assert not without[held.nodes].any()
    assert np.abs(held.jump @ mesh.points).max() < 1e-14


def test_weights_where_both_ends_are_held() -> None:
    """In closed form: psi = 1 on the end facets (Wohlmuth 2000)."""
    mesh = blocks((5, 1), (4, 1))
    without = np.isin(mesh.points[:, 0], (0.0, 1.0))
    found = joined(mesh, sides_of(mesh), without[mesh.boundaries["u:bottom"]])
    order = np.argsort(mesh.points[found.nodes, 0])
    np.testing.assert_allclose(found.weights[order], [0.3, 0.2, 0.2, 0.3], rtol=1e-13)


def test_meshes_that_match_are_joined_node_by_node() -> None:
    mesh = blocks((4, 2), (4, 3))
    found = joined(mesh, sides_of(mesh), np.zeros((4, 2), dtype=bool))
    assert (np.diff(found.jump.indptr) == 2).all()
    np.testing.assert_allclose(np.sort(found.jump.data), np.repeat([-1.0, 1.0], 5), atol=1e-13)


@pytest.mark.parametrize("cut", [0.35, 0.5, 0.77])
def test_of_a_body_that_hangs_over_only_what_faces_the_other_counts(cut: float) -> None:
    mesh = hv.Mesh.assembled(
        {"u": hv.rectangle((1.0, 1.0), (7, 2), origin=(cut, 1.0)), "l": hv.rectangle((1.0, 1.0), (5, 2))}
    )
    for sides in (sides_of(mesh), sides_of(mesh)[::-1]):
        found = joined(mesh, sides, np.zeros(sides[0].nodes.shape, dtype=bool))
        assert found.weights.sum() == pytest.approx(1.0 - cut, rel=1e-12)
        assert (found.weights > 0.0).all()
        assert np.abs(found.jump @ mesh.points).max() < 1e-13


def test_the_gap_of_the_geometry_is_added_to_the_stated_one() -> None:
    mesh = hv.Mesh.assembled(
        {"u": hv.rectangle((1.0, 1.0), (7, 2), origin=(0.0, 1.01)), "l": hv.rectangle((1.0, 1.0), (5, 2))}
    )
    discrete = hv.discretize(pressed_pair(mesh, hv.Contact(hv.Signorini(), gap=0.02, against="l:top")))
    np.testing.assert_allclose(discrete.offset[:, 0], 0.03, rtol=1e-12)


def test_an_overlap_is_an_interference_and_its_size_is_told() -> None:
    mesh = hv.Mesh.assembled(
        {"u": hv.rectangle((1.0, 1.0), (7, 2), origin=(0.0, 0.99)), "l": hv.rectangle((1.0, 1.0), (5, 2))}
    )
    held = {"l:bottom": hv.Roller(), "u:top": hv.Roller(), "l:left": hv.Roller(), "u:left": hv.Roller()}
    contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top")}
    solution = hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held))
    assert any("overlap by up to 0.01" in sentence for sentence in solution.warnings)
    stiffness = 10.0 / (1.0 - 0.3**2)  # of plane strain, without stress across
    np.testing.assert_allclose(solution.pressure, 0.01 * stiffness / 2.0, rtol=1e-12)


def test_sliding_by_more_than_an_element_is_told() -> None:
    mesh = blocks((7, 2), (5, 2))
    contact = {"u:bottom": hv.Contact(hv.Compliance(20.0), against="l:top")}
    warned = []
    for slip in (0.05, 0.4):
        held = {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((slip, -0.01))}
        warned.append(
            any(
                "slide on each other" in one
                for one in hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held)).warnings
            )
        )
    assert warned == [False, True]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("revolved", [False, True])
def test_slip_is_counted_in_facets_whatever_the_share_of_a_point(order: int, revolved: bool) -> None:
    """The end of the slave has a small share of the contact, corners of quadratic facets one of a sixth, rings a large
    one."""
    r = 100.0 if revolved else 0.0
    upper = hv.rectangle((1.0, 1.0), (5, 2), origin=(r + 0.999, 1.0))
    mesh = hv.Mesh.assembled({"u": upper, "l": hv.rectangle((1.0, 1.0), (5, 2), origin=(r, 0.0))})
    material = hv.Material.young(10.0, 0.3, plane="axisymmetric" if revolved else "strain")
    contact = {"u:bottom": hv.Contact(hv.Compliance(20.0), against="l:top", slave="u:bottom")}
    for slip, told in ((0.15, False), (0.3, True)):
        held = {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((slip, 0.0)), "u:bottom": hv.Fixed(x=slip)}
        said = hv.solve(hv.ContactProblem(mesh, material, contact, held, order=order)).warnings
        found = [one for one in said if "slide on each other" in one]
        assert bool(found) is told
        assert not told or f"up to {slip / 0.2:.3g} elements" in found[0]


def test_a_much_softer_body_has_the_contact_points_then_the_finer_one_then_the_one_that_is_held_less() -> None:
    against = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top")}
    assert pressed_pair(blocks((7, 3), (5, 4)), against["u:bottom"]).pair("u:bottom") == ("u:bottom", "l:top")
    assert pressed_pair(blocks((5, 3), (7, 4)), against["u:bottom"]).pair("u:bottom") == ("l:top", "u:bottom")
    alike = hv.ContactProblem(
        blocks((5, 3), (5, 4)),
        MATERIAL,
        against,
        {"l:bottom": hv.Clamped(), "u:left": hv.Clamped(), "u:top": hv.Roller()},
    )
    assert alike.pair("u:bottom") == ("l:top", "u:bottom")
    for ratio, slave in ((3.0, "u:bottom"), (5.0, "l:top")):
        material = hv.Material.by_region({"u": hv.Material.young(ratio, 0.3), "l": hv.Material.young(1.0, 0.3)})
        stiffer = replace(pressed_pair(blocks((7, 3), (5, 4)), against["u:bottom"]), material=material)
        assert stiffer.pair("u:bottom")[0] == slave


def test_three_blocks_on_each_other_and_two_on_one() -> None:
    """A chain, and two slaves on one master."""
    mesh = hv.Mesh.assembled(
        {
            "a": hv.rectangle((1.0, 1.0), (4, 3)),
            "b": hv.rectangle((1.0, 1.0), (5, 3), origin=(0.0, 1.0)),
            "c": hv.rectangle((0.5, 1.0), (3, 3), origin=(0.0, 2.0)),
            "d": hv.rectangle((0.5, 1.0), (4, 3), origin=(0.5, 2.0)),
        }
    )
    touch = {"b:bottom": "a:top", "c:bottom": "b:top", "d:bottom": "b:top"}
    contact = {name: hv.Contact(hv.Signorini(), hv.Coulomb(0.2), against=other) for name, other in touch.items()}
    held = (
        {"a:bottom": hv.Roller()}
        | {f"{part}:left": hv.Roller() for part in "abc"}
        | {"d:right": hv.Roller(), "b:right": hv.Roller(), "a:right": hv.Roller()}
    )
    tractions = {"c:top": hv.Pressure(PRESSURE), "d:top": hv.Pressure(PRESSURE)}
    # c and d are not held sideways where they face each other, so that both touch along x too
    contact["d:left"] = hv.Contact(hv.Signorini(), against="c:right")
    solution = hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held, tractions=tractions))
    assert solution.status is hv.Status.CONVERGED
    side = 0.3 / 0.7 * PRESSURE  # no strain across
    for name, expected in (("b:bottom", PRESSURE), ("c:bottom", PRESSURE), ("d:bottom", PRESSURE), ("d:left", side)):
        np.testing.assert_allclose(solution.on(name).pressure, expected, rtol=1e-8)  # the solver's tolerance


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"against": "nowhere"}, "nowhere"),
        ({"against": "u:bottom"}, "self-contact"),
        ({"against": 3}, "name of a boundary"),
        ({"against": "l:top", "slave": "u:top"}, "give 'u:bottom' or 'l:top'"),
        ({"slave": "u:bottom"}, "goes with against"),
        ({"against": "l:top", "belt": (1.0, 0.0)}, "move the other body"),
        ({"against": "l:top", "obstacle": hv.mechanics.Plane((0.0, 0.0), (0.0, 1.0))}, "leave one out"),
        ({"against": "u:top"}, "no facet of the one faces the other"),
        ({"against": "l:left"}, "no facet of the one faces the other"),
        ({"against": "l:top", "gap": np.nan}, "gap"),
        ({"against": "l:tpo"}, "l:top"),
    ],
)
def test_what_is_wrong_with_a_pair_is_told(change: dict[str, object], words: str) -> None:
    def stated() -> hv.DiscreteProblem:
        return hv.discretize(pressed_pair(blocks((7, 3), (5, 4)), hv.Contact(hv.Signorini(), **change)))  # type: ignore[arg-type]

    with pytest.raises(hv.errors.ProblemError, match=words):
        stated()


def test_a_slave_that_supports_hold_is_told() -> None:
    contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top", slave="l:top")}
    held = {"l:bottom": hv.Clamped(), "l:top": hv.Clamped(), "u:top": hv.Clamped()}
    with pytest.raises(hv.errors.ProblemError, match="give slave = 'u:bottom'"):
        hv.discretize(hv.ContactProblem(blocks((7, 3), (5, 4)), MATERIAL, contact, held))


def test_the_exact_bound_and_other_quadrature_refuse_a_pair() -> None:
    contact = hv.Contact(hv.Signorini(), against="l:top")
    with pytest.raises(hv.errors.ProblemError, match="midpoints"):
        hv.ContactProblem(
            blocks((7, 3), (5, 4)), MATERIAL, {"u:bottom": contact}, {"l:bottom": hv.Clamped()},
            quadrature=hv.mechanics.Quadrature.MIDPOINT,
        )  # fmt: skip
