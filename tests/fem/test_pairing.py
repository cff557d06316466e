"""What facets of two boundaries touch: the first along the normal, however far or deep, and what is lost is told."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array, IntArray
from hemivar.fem.pairing import Pairing, paired
from hemivar.mesh.boundary_rule import BoundaryRule

MATERIAL = hv.Material.young(1000.0, 0.0)
LARGEST_UNSEEN = -0.2  # cosine of two normals above which facets do not face each other


# ---- rays, one after another ----------------------------------------------------------------------------------------


def rotation(rng: np.random.Generator, dim: int) -> Array:
    turn, _ = np.linalg.qr(rng.normal(size=(dim, dim)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    return np.asarray(turn)


def scattered_blocks(dim: int, seed: int) -> tuple[hv.Mesh, IntArray, IntArray, np.random.Generator]:
    """A block among smaller ones that are turned, apart from each other; its boundary, and some of theirs."""
    rng, make = np.random.default_rng(seed), hv.rectangle if dim == 2 else hv.box
    size = np.array([1.0] * (dim - 1) + [0.5])
    parts = {"s": make(tuple(size), (4,) * (dim - 1) + (2,)).moved(np.eye(dim), -0.5 * size)}
    placed: list[tuple[Array, float]] = []
    while len(placed) < 5:
        other, place = rng.uniform(0.15, 0.7, dim), np.append(rng.uniform(-0.6, 0.6, dim - 1), rng.uniform(-2.5, 1.5))
        radius = 0.5 * float(np.linalg.norm(other))
        if all(np.linalg.norm(place - at) > radius + far for at, far in placed) and (
            np.linalg.norm(np.maximum(np.abs(place) - 0.5 * size, 0.0)) > radius
        ):
            block, turn = make(tuple(other), tuple(rng.integers(1, 4, dim))), rotation(rng, dim)
            parts[f"m{len(placed)}"] = block.moved(turn, place - turn @ (0.5 * other))
            placed.append((place, radius))
    mesh = hv.Mesh.assembled(parts)
    named = mesh.boundaries
    master = np.concatenate([facets for name, facets in named.items() if name[0] == "m" and rng.random() < 0.7])
    return mesh, np.concatenate([facets for name, facets in named.items() if name[0] == "s"]), master, rng


def first_along_the_normal(mesh: hv.Mesh, place: Array, normal: Array, master: IntArray) -> int:
    """The facet of the master that the ray from a place meets before any other part of the mesh, or -1."""
    corner = mesh.points[mesh.boundary_facets]
    along = mesh.facet_normals(mesh.boundary_facets)[0] @ normal
    seen = np.flatnonzero(np.abs(along) > 1e-9)
    edges = corner[seen, 1:] - corner[seen, :1]
    frame = np.concatenate([edges, np.broadcast_to(-normal, (len(seen), 1, mesh.dim))], axis=1)
    at = np.linalg.solve(frame.transpose(0, 2, 1), (place - corner[seen, 0])[:, :, None])[:, :, 0]
    inner, depth = at[:, :-1], at[:, -1]
    ahead = np.flatnonzero((inner >= 0.0).all(axis=1) & (inner.sum(axis=1) <= 1.0) & (depth > 1e-9))
    if not len(ahead):
        return -1
    nearest = seen[ahead[np.argmin(depth[ahead])]]
    number = np.flatnonzero((np.sort(master, axis=1) == np.sort(mesh.boundary_facets[nearest])).all(axis=1))
    return int(number[0]) if len(number) and along[nearest] < LARGEST_UNSEEN else -1


def faced(mesh: hv.Mesh, slave: IntArray, master: IntArray, names: str) -> Pairing:
    return paired(mesh, (BoundaryRule.of(mesh, slave), BoundaryRule.of(mesh, master)), names)


def paired_with(pieces: Pairing, facet: int, place: Array) -> list[int]:
    """The facets of the master that a place, in barycentric coordinates of a facet of the slave, is paired with."""
    own = np.flatnonzero(pieces.slave == facet)
    return [int(pieces.master[k]) for k in own if (np.linalg.solve(pieces.on_slave[k].T, place) >= 0.0).all()]


@pytest.mark.parametrize(("dim", "seed"), [(2, 0), (2, 1), (2, 2), (3, 4), (3, 21), (3, 37)])
def test_each_place_has_the_first_facet_that_a_ray_along_its_normal_meets(dim: int, seed: int) -> None:
    mesh, slave, master, rng = scattered_blocks(dim, seed)
    pieces, normal = faced(mesh, slave, master, "blocks"), mesh.facet_normals(slave)[0]
    found = 0
    for facet in rng.integers(0, len(slave), 60):
        place = rng.dirichlet(np.ones(dim))
        expected = first_along_the_normal(mesh, place @ mesh.points[slave[facet]], normal[facet], master)
        assert paired_with(pieces, int(facet), place) == ([] if expected < 0 else [expected])
        found += expected >= 0
    assert found > 3
    assert pieces.covered.max() < 1.0 + 1e-9


# ---- overlap --------------------------------------------------------------------------------------------------------


def stacked(dim: int, overlap: float) -> hv.Mesh:
    make, cells = (hv.rectangle, ((7, 4), (5, 3))) if dim == 2 else (hv.box, ((3, 4, 3), (4, 3, 2)))
    ones = (1.0,) * dim
    raised = make(ones, cells[0], origin=(0.0,) * (dim - 1) + (1.0 - overlap,))
    return hv.Mesh.assembled({"u": raised, "l": make(ones, cells[1])})


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
@pytest.mark.parametrize("depth", [0.02, 0.4, 0.9])
def test_an_overlap_of_any_depth_is_the_same_as_a_negative_gap(dim: int, slave: str, depth: float) -> None:
    """Two unit blocks between rollers, without strain across: the pressure is E depth/2."""
    sides = ["left", "front"][: dim - 1]
    held = {f"{part}:{side}": hv.Roller() for part, more in (("u", "top"), ("l", "bottom")) for side in (more, *sides)}
    for overlap, gap in ((depth, 0.0), (0.0, -depth)):
        contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top", gap=gap, slave=slave)}
        solution = hv.solve(hv.ContactProblem(stacked(dim, overlap), MATERIAL, contact, held))
        np.testing.assert_allclose(solution.pressure, 500.0 * depth, rtol=1e-10)


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
def test_overlaps_are_judged_by_the_mesh_wherever_it_is(shift: float) -> None:
    mesh = stacked(2, 1e-7).moved(np.eye(2), shift)
    held = {name: hv.Roller() for name in ("u:top", "u:left", "l:bottom", "l:left")}
    contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top")}
    solution = hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held))
    assert solution.normal_force == pytest.approx(500.0 * 1e-7, rel=1e-15 * shift / 1e-7 + 1e-6)


def test_a_bulge_deeper_than_its_facets_loses_nothing() -> None:
    force = []
    for n in (20, 80):
        lower, upper = hv.rectangle((2.0, 1.0), (n, 6)), hv.rectangle((2.0, 1.0), (n + 1, 6), origin=(0.0, 1.0))
        points = upper.points - np.outer(
            0.1 * np.sin(0.5 * np.pi * upper.points[:, 0]) * (2 - upper.points[:, 1]), [0, 1]
        )
        bulged = hv.Mesh(points, upper.cells, upper.boundaries)
        contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top")}
        held = {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()}
        mesh = hv.Mesh.assembled({"l": lower, "u": bulged})
        force.append(hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held)).normal_force)
    assert force[1] == pytest.approx(force[0], rel=0.01)


# ---- what is in between ---------------------------------------------------------------------------------------------


def ring(inner: float, outer: float, n: int, centre: float = 0.0) -> hv.Mesh:
    flat = hv.rectangle((2.0 * np.pi, outer - inner), (n, 2))
    angle, radius = flat.points[:, 0], inner + flat.points[:, 1]
    places = np.column_stack([centre + radius * np.cos(angle), radius * np.sin(angle)])
    _, first, number = np.unique(places.round(9) + 0.0, axis=0, return_index=True, return_inverse=True)
    mesh, middle = hv.Mesh.oriented(places[first], number.ravel()[flat.cells]), 0.5 * (inner + outer)

    def within(x: Array) -> Array:
        return np.hypot(x[:, 0] - centre, x[:, 1]) < middle

    return mesh.with_boundaries({"in": within, "out": lambda x: ~within(x)})


def skin(mesh: hv.Mesh, part: str) -> IntArray:
    return np.concatenate([facets for name, facets in mesh.boundaries.items() if name.startswith(f"{part}:")])


@pytest.mark.parametrize("clearance", [0.02, -0.02, -0.15])
def test_rings_by_their_skins_touch_where_they_face_each_other_alone(clearance: float) -> None:
    mesh = hv.Mesh.assembled({"a": ring(1.0, 1.2, 40), "b": ring(1.2 + clearance, 1.6, 48)})
    for slave, master, touching in (("a", "b", "a:out"), ("b", "a", "b:in")):
        pieces = faced(mesh, skin(mesh, slave), skin(mesh, master), "rings")
        on = np.isin(skin(mesh, slave), mesh.boundaries[touching]).all(axis=1)
        np.testing.assert_allclose(pieces.covered, on, atol=1e-9)
        assert not len(pieces.lost)


def test_the_inside_of_a_ring_finds_no_ring_through_its_own_hole() -> None:
    mesh = hv.Mesh.assembled({"a": ring(1.0, 1.2, 40), "b": ring(1.0, 1.2, 40, centre=2.5)})
    pieces = faced(mesh, skin(mesh, "a"), skin(mesh, "b"), "rings")
    assert not pieces.covered[: len(mesh.boundaries["a:in"])].any()
    assert pieces.covered.any()
    assert not len(pieces.lost)
    with pytest.raises(hv.errors.ProblemError, match="no facet of the one faces the other"):
        faced(mesh, mesh.boundaries["a:in"], skin(mesh, "b"), "rings")


def test_of_two_layers_the_nearer_hides_the_farther() -> None:
    near = hv.box((0.5, 0.7, 0.1), (2, 3, 1), origin=(0.3, 0.2, 0.4))
    parts = {"s": hv.box((1.0, 1.0, 0.5), (5, 4, 2), origin=(0.0, 0.0, 1.0)), "near": near}
    mesh = hv.Mesh.assembled({**parts, "far": hv.box((1.0, 1.0, 0.2), (3, 3, 1))})
    master = np.concatenate([mesh.boundaries["near:top"], mesh.boundaries["far:top"]])
    pieces = faced(mesh, mesh.boundaries["s:bottom"], master, "layers")
    area = mesh.facet_normals(mesh.boundaries["s:bottom"])[1][pieces.slave] * pieces.share
    upper = pieces.master < len(mesh.boundaries["near:top"])
    assert area[upper].sum() == pytest.approx(0.35, rel=1e-9)
    assert area[~upper].sum() == pytest.approx(0.65, rel=1e-9)


@pytest.mark.parametrize(("overlap", "height"), [(-0.3, 1.1), (0.0, 1.1), (0.05, 1.1), (0.15, 1.0)])
def test_of_plates_in_a_stack_the_nearest_counts(overlap: float, height: float) -> None:
    """All of their faces are named; a plate begins where the one above ends."""
    plates = {f"p{k}": hv.rectangle((1.0, 0.1), (3 + k, 1), origin=(0.0, 1.0 - 0.1 * k)) for k in range(3)}
    mesh = hv.Mesh.assembled({**plates, "s": hv.rectangle((1.0, 0.5), (7, 3), origin=(0.0, 1.1 - overlap))})
    master = np.concatenate([skin(mesh, name) for name in plates])
    pieces = faced(mesh, mesh.boundaries["s:bottom"], master, "stack")
    np.testing.assert_allclose(pieces.covered, 1.0, rtol=1e-9)
    np.testing.assert_allclose(mesh.points[master[pieces.master], 1], height)


def warnings(mesh: hv.Mesh) -> tuple[str, ...]:
    contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top", slave="u:bottom")}
    held = {name: hv.Clamped() for name in mesh.boundaries if name in ("u:top", "l:bottom", "m:bottom")}
    return hv.discretize(hv.ContactProblem(mesh, MATERIAL, contact, held)).warnings


def test_a_facet_that_loses_what_its_normal_meets_is_told() -> None:
    two = {"u": hv.rectangle((1.0, 0.5), (8, 4), origin=(0.0, 1.0)), "l": hv.rectangle((1.0, 0.5), (7, 4))}
    assert not warnings(hv.Mesh.assembled(two))
    between = hv.rectangle((0.5, 0.2), (3, 2), origin=(0.5, 0.6))
    assert any(
        "4 of them, the first at x = (0.5625, 1)" in one for one in warnings(hv.Mesh.assembled({**two, "m": between}))
    )
    thin = hv.rectangle((1.0, 0.05), (8, 1), origin=(0.0, 0.4))
    tilted = thin.moved([[1.0, 0.0], [-0.1, 1.0]])
    deep = hv.Mesh.assembled({"u": tilted, "l": hv.rectangle((1.0, 0.4), (7, 4))})
    assert any("the overlap is deeper than the body" in one for one in warnings(deep))


def test_a_floor_far_beside_a_near_wall_is_found() -> None:
    """A block in a channel, wall .005 and floor .2 away: pressed down it has the pressure of a block on the floor."""
    floor, block = hv.rectangle((1.01, 0.4), (40, 8)), hv.rectangle((1.0, 0.6), (40, 16), origin=(0.005, 0.6))
    parts = {"floor": floor, "block": block, "wall": hv.rectangle((0.3, 1.0), (4, 20), origin=(-0.3, 0.4))}
    mesh = hv.Mesh.assembled(parts)
    mesh = mesh.named(
        {**mesh.boundaries, "all": np.concatenate([mesh.boundaries["wall:right"], mesh.boundaries["floor:top"]])},
        mesh.regions,
    )
    held = {"floor:bottom": hv.Clamped(), "wall:left": hv.Clamped(), "block:top": hv.Prescribed((0.0, -0.202))}
    found = []
    for against in ("floor:top", "all"):
        contact = {"block:bottom": hv.Contact(hv.Signorini(), against=against, slave="block:bottom")}
        found.append(hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held)).pressure)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


# ---- skins ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [4, 16])
@pytest.mark.parametrize("height", [0.1, 0.5])
@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_thin_bodies_that_touch_by_their_skins_have_a_uniform_pressure(n: int, height: float, degrees: float) -> None:
    mesh = hv.Mesh.assembled(
        {"l": hv.rectangle((4.0, height), (n, 1)), "u": hv.rectangle((4.0, height), (n + 1, 1), origin=(0.0, height))}
    )
    mesh = mesh.rotated(np.radians(degrees))
    mesh = mesh.named({**mesh.boundaries, "l:skin": skin(mesh, "l"), "u:skin": skin(mesh, "u")}, mesh.regions)
    contact = {"u:skin": hv.Contact(hv.Signorini(), hv.Tresca(0.3), against="l:skin")}
    down = tuple(-mesh.facet_normals(mesh.boundaries["u:top"])[0][0])
    problem = hv.ContactProblem(
        mesh, MATERIAL, contact, {"l:bottom": hv.Roller(), "l:left": hv.Roller()}, tractions={"u:top": down}
    )
    solution = hv.solve(problem)
    np.testing.assert_allclose(solution.pressure, 1.0, rtol=1e-9)
    assert solution.normal_force == pytest.approx(4.0, rel=1e-9)
    assert not solution.warnings


def test_a_facet_whose_corners_all_belong_to_nearer_sides_is_told() -> None:
    """The end of a strip that is one facet thick, beside a wall."""
    parts = {"u": hv.rectangle((2.0, 0.1), (6, 1), origin=(0.0, 0.5)), "l": hv.rectangle((3.0, 0.5), (7, 2))}
    mesh = hv.Mesh.assembled(
        {
            **parts,
            "w": hv.rectangle((0.5, 1.0), (2, 3), origin=(3.0, 0.0)),
            "top": hv.rectangle((2.0, 0.5), (5, 2), origin=(0.0, 0.6)),
        }
    )
    master = np.concatenate([mesh.boundaries["l:top"], mesh.boundaries["w:left"], mesh.boundaries["top:bottom"]])
    mesh = mesh.named({**mesh.boundaries, "u:skin": skin(mesh, "u"), "rest": master}, mesh.regions)
    held = {name: hv.Clamped() for name in ("l:bottom", "w:right", "top:top")}
    contact = {"u:skin": hv.Contact(hv.Signorini(), hv.Tresca(0.1), against="rest", slave="u:skin")}
    said = hv.discretize(hv.ContactProblem(mesh, MATERIAL, contact, held), check_coercivity=False).warnings
    assert any("1 of them, the first at x = (2, 0.55)" in one for one in said)


@pytest.mark.parametrize("clearance", [1e-3, 1.0])
def test_the_corner_of_a_skin_belongs_to_the_nearer_side(clearance: float) -> None:
    """Walls beside a block that do not touch change nothing of the pressure below it."""
    channel = {"l": hv.rectangle((2.0 + 2.0 * clearance, 0.5), (9, 2), origin=(-clearance, 0.0))}
    channel |= {"w": hv.rectangle((0.5, 1.5), (2, 8), origin=(-clearance - 0.5, 0.0))}
    channel |= {"e": hv.rectangle((0.5, 1.5), (2, 8), origin=(2.0 + clearance, 0.0))}
    mesh = hv.Mesh.assembled({**channel, "b": hv.rectangle((2.0, 0.8), (8, 4), origin=(0.0, 0.5))})
    own = mesh.boundaries
    walls = np.concatenate([own["l:top"], own["w:right"], own["e:left"]])
    below = np.concatenate([own["b:bottom"], own["b:left"], own["b:right"]])
    mesh = mesh.named({**own, "channel": walls, "b:skin": below}, mesh.regions)
    held = {"l:bottom": hv.Clamped(), "w:left": hv.Clamped(), "e:right": hv.Clamped()}
    pressure = []
    for slave in ("b:bottom", "b:skin"):
        contact = {slave: hv.Contact(hv.Signorini(), hv.Coulomb(0.3), against="channel", slave=slave)}
        solution = hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held, tractions={"b:top": (0.0, -1.0)}))
        points = solution.problem.contact.points
        assert points is not None
        pressure.append(solution.pressure[points[:, 1] == 0.5])
    np.testing.assert_allclose(pressure[1], pressure[0], rtol=1e-8)


# ---- interfaces -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [5, 8, 12])
def test_an_interface_in_zigzag_that_is_glued_is_no_interface(seed: int) -> None:
    """Its sides coincide facet by facet, and fold so much that other facets stand in front of some of them."""
    rng = np.random.default_rng(seed)
    mesh = hv.rectangle((8.0, 6.0), (8, 6), "cross" if seed % 2 else "right")
    middle = mesh.points[mesh.cells].mean(axis=1)
    if seed < 8:
        height = np.clip(3 + np.cumsum(rng.integers(-1, 2, 8)), 1, 5)
        upper = middle[:, 1] > height[np.floor(middle[:, 0]).astype(int)]
    else:
        upper = middle[:, 1] > 3.0 + rng.uniform(-0.5, 0.5) * (middle[:, 0] - 4.0)
    mesh = mesh.named(mesh.boundaries, {"u": np.flatnonzero(upper), "l": np.flatnonzero(~upper)})
    opened = mesh.opened("cut", between=("u", "l"))
    turned = opened.rotated(0.3)
    pieces = faced(turned, turned.boundaries["cut:u"], turned.boundaries["cut:l"], "sides")
    np.testing.assert_array_equal(np.sort(pieces.slave), np.arange(len(opened.boundaries["cut:u"])))
    np.testing.assert_array_equal(np.sort(pieces.on_master, axis=2), [[[0.0, 1.0]] * 2] * len(pieces.slave))
    glue = hv.laws.MixedMode(hv.laws.BilinearCohesion(1e6, 1e8, 1e6), 1.0, hv.Compliance(1e6))
    contact = {"cut:u": hv.Contact(glue, against="cut:l"), "left": hv.Contact(hv.Compliance(1.0), gap=50.0)}
    held = {"bottom": hv.Clamped(), "top": hv.Prescribed((0.1, -0.1))}
    material = hv.Material.young(10.0, 0.3)
    found = hv.solve(hv.ContactProblem(opened, material, contact, held)).displacement
    whole = hv.solve(hv.ContactProblem(mesh, material, {"left": contact["left"]}, held)).displacement
    at = np.array([np.flatnonzero((mesh.points == place).all(axis=1))[0] for place in opened.points])
    assert np.abs(found - whole[at]).max() < 1e-4 * 0.1


@pytest.mark.parametrize("more", [0, 1])
@pytest.mark.parametrize("beside", [("u:left",), ("l:left",), ("u:left", "l:left")])
@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
def test_a_foundation_that_is_not_reached_takes_nothing_of_the_glue_beside_it(
    slave: str, beside: tuple[str, ...], more: int
) -> None:
    parts = {"u": hv.rectangle((4.0, 1.0), (6, 3), origin=(0.0, 1.0)), "l": hv.rectangle((4.0, 1.0), (6 + more, 3))}
    mesh = hv.Mesh.assembled(parts)
    glue = hv.laws.MixedMode(hv.laws.BilinearCohesion(1e3, 1e5, 1e3), 1.0, hv.Compliance(1e3))
    pair = {"u:bottom": hv.Contact(glue, against="l:top", slave=slave)}
    held, found = {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((0.1, -0.05))}, []
    for walls in ((), beside):
        contact = pair | {side: hv.Contact(hv.Compliance(1.0), gap=50.0) for side in walls}
        found.append(hv.solve(hv.ContactProblem(mesh, MATERIAL, contact, held)))
    np.testing.assert_allclose(found[1].displacement, found[0].displacement, atol=1e-12)
    assert not found[1].warnings


def test_nor_does_one_in_space_or_one_that_is_reached_later() -> None:
    glue = hv.laws.MixedMode(hv.laws.BilinearCohesion(1e3, 1e5, 1e3), 1.0, hv.Compliance(1e3))
    upper, lower = hv.box((2.0, 2.0, 1.0), (4, 3, 1), origin=(0.0, 0.0, 1.0)), hv.box((2.0, 2.0, 1.0), (3, 4, 1))
    mesh, pair = hv.Mesh.assembled({"u": upper, "l": lower}), {"u:bottom": hv.Contact(glue, against="l:top")}
    held = {"l:bottom": hv.Clamped(), "u:top": hv.Prescribed((0.1, 0.0, -0.05))}
    walls = {side: hv.Contact(hv.Compliance(1.0), gap=50.0) for side in ("u:left", "l:left")}
    found = [hv.solve(hv.ContactProblem(mesh, MATERIAL, pair | more, held)).displacement for more in ({}, walls)]
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
    plane = stacked(2, 0.0)
    walls = {side: hv.Contact(hv.Compliance(1.0), gap=lambda x, t: 0.1 - t + 0.0 * x[:, 0]) for side in walls}
    problem = hv.ContactProblem(plane, MATERIAL, pair | walls, {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()})
    assert hv.march(hv.Evolution(problem), until=0.2, step=0.1).finished
