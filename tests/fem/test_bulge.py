"""Two bodies whose curved sides are polygons of one curve: their distance is that of the arcs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.fem.bulge import bulge

YOUNG, STEEL = 196e3, hv.Material.young(196e3, 0.3, plane="stress")
QUARTER = 0.5 * np.pi


def angles(count: int, uneven: float = 0.0) -> Array:
    """Angles of nodes of a quarter ring, whose steps differ by this part."""
    steps = 1.0 + uneven * np.random.default_rng(count).uniform(-1.0, 1.0, count)
    return np.asarray(QUARTER * np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum())


def ring(inner: float, outer: float, at: Array, across: int = 3, height: float = 0.0, layers: int = 1) -> hv.Mesh:
    """A quarter of a ring with nodes at some angles, in space where it has a height: sides left and right are round."""
    size, cells = (outer - inner, len(at) - 1.0), (across, len(at) - 1)
    flat = hv.box((*size, height), (*cells, layers)) if height else hv.rectangle(size, cells)
    r, t = inner + flat.points[:, 0], np.interp(flat.points[:, 1], np.arange(len(at)), at)
    round_ = np.column_stack([r * np.cos(t), r * np.sin(t), flat.points[:, 2:]])
    return hv.Mesh(round_, flat.cells, flat.boundaries, flat.regions)


def fit(
    inside: hv.Mesh, outside: hv.Mesh, law: hv.laws.Superpotential | None = None, gap: float = 0.0
) -> hv.ContactProblem:
    """The one in the other, held by symmetry."""
    mesh = hv.Mesh.assembled({"in": inside, "out": outside})
    ends = {2: ("bottom", "top"), 3: ("front", "back", "bottom")}[mesh.dim]
    held = {f"{part}:{end}": hv.Roller() for part in ("in", "out") for end in ends}
    contact = {"in:right": hv.Contact(hv.Signorini() if law is None else law, against="out:left", gap=gap)}
    return hv.ContactProblem(mesh, STEEL if mesh.dim == 2 else hv.Material.young(YOUNG, 0.3), contact, held)


def lame(interference: float, a: float, b: float, c: float) -> float:
    """Pressure of rings a < b < c of one material in plane stress (Lame)."""
    return interference * YOUNG / b / ((c**2 + b**2) / (c**2 - b**2) + (b**2 + a**2) / (b**2 - a**2))


@pytest.mark.parametrize("gap", [0.0005, 0.015, -0.0005, -0.015])
@pytest.mark.parametrize("uneven", [0.0, 0.25])
@pytest.mark.parametrize("order", [1, 2])
def test_the_distance_is_that_of_the_radii(gap: float, uneven: float, order: int) -> None:
    """Clearance and interference a fifth and several times as large as what the polygons are off; ends included."""
    sides = ring(10.0, 20.0, angles(63, uneven)), ring(20.0 + gap, 30.0, angles(48, uneven))
    problem = replace(fit(*sides), order=order)
    np.testing.assert_allclose(hv.discretize(problem).offset[:, 0], gap, rtol=0.0, atol=2e-6)
    polygons = hv.discretize(replace(problem, geometry="as-meshed")).offset[:, 0]  # type: ignore[arg-type]
    assert np.abs(polygons - gap).max() > 1e-3


@pytest.mark.parametrize("ratio", [1.0, 1.3, 1.7])
@pytest.mark.parametrize("slave", ["in:right", "out:left"])
def test_a_press_fit_on_rings_whose_nodes_do_not_match_is_lames(ratio: float, slave: str) -> None:
    n = 62
    sides = ring(10.0, 20.0, angles(n, 0.1), 20), ring(20.0, 30.0, angles(round(n / ratio), 0.1), 20)
    problem = fit(*sides, gap=-0.015)
    contact = {"in:right": replace(problem.contact["in:right"], slave=slave)}
    solution, right = hv.solve(replace(problem, contact=contact)), lame(0.015, 10.0, 20.0, 30.0)
    assert right == pytest.approx(6.0 * 5.7421875)
    assert solution.normal_force == pytest.approx(right * 10.0 * np.pi, rel=0.01)
    np.testing.assert_allclose(solution.pressure, right, rtol=0.05)


def test_an_interference_a_fifth_of_what_the_polygons_are_off_is_lames() -> None:
    """On the polygons the pressure is 0 to five times as large; where nodes match it is off by up to 4 %."""
    solution, right = (
        hv.solve(fit(ring(10.0, 20.0, angles(32), 10), ring(20.0, 30.0, angles(47), 10), gap=-0.0025)),
        5.7421875,
    )
    assert solution.normal_force == pytest.approx(right * 10.0 * np.pi, rel=2e-3)
    np.testing.assert_allclose(solution.pressure, right, rtol=0.04)


def in_space(around: tuple[int, int], layers: tuple[int, int], across: int, height: float) -> hv.Solution:
    """Its top is free, so that the stress is plane."""
    sides = [
        ring(a, a + 10.0, angles(n), across, height, k) for a, n, k in zip((10.0, 20.0), around, layers, strict=True)
    ]
    solution = hv.solve(fit(sides[0], sides[1], gap=-0.015))
    right = lame(0.015, 10.0, 20.0, 30.0) * 10.0 * np.pi * height
    assert solution.normal_force == pytest.approx(right, rel=0.01)
    return solution


def test_a_press_fit_in_space_is_lames() -> None:
    """Nearly as even as where the nodes match, which are 3 % off on average; on the polyhedra it is 350 %."""
    pressure = in_space((31, 24), (2, 2), 6, 2.0).pressure / lame(0.015, 10.0, 20.0, 30.0)
    assert np.sqrt(np.mean((pressure - 1.0) ** 2)) < 0.05
    assert pressure.min() > 0.9


@pytest.mark.slow
def test_a_press_fit_in_space_is_even_on_a_finer_mesh() -> None:
    """One layer of facets against two."""
    found = in_space((62, 48), (2, 1), 15, 1.0)
    assert found.problem.contact.points is not None
    inside = found.problem.contact.points[:, :2].min(axis=1) > 0.1  # polygons that match are 6 % off at the ends
    np.testing.assert_allclose(found.pressure[inside], lame(0.015, 10.0, 20.0, 30.0), rtol=0.05)


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_what_the_bulge_is_and_what_facets_leave_is_told(size: float) -> None:
    """The largest bulge h^2/8R; the ripple of the pressure within a factor of two, whatever the unit of length."""
    sides = [ring(size * a, size * b, angles(n), 6) for a, b, n in ((10.0, 20.0, 42), (20.0, 30.0, 32))]
    problem = fit(sides[0], sides[1], hv.laws.Bilateral(), -0.0025 * size)
    (said,) = hv.solve(problem).warnings
    assert f"up to {20.0 * size * (1.0 - np.cos(QUARTER / 64)):.3g}" in said
    meshed = hv.solve(replace(problem, geometry="as-meshed"))  # type: ignore[arg-type]
    said = meshed.warnings[-1]
    ripple = 0.5 * np.ptp(meshed.pressure)
    assert 0.5 * ripple < float(said.split()[-1]) < 2.0 * ripple


def test_nothing_is_told_where_nodes_match_and_nothing_changes() -> None:
    problem = fit(ring(10.0, 20.0, angles(32, 0.2)), ring(20.0, 30.0, angles(32, 0.2)), gap=-0.0025)
    assert not hv.solve(problem).warnings
    np.testing.assert_allclose(hv.discretize(problem).offset[:, 0], -0.0025, rtol=1e-12)


def test_a_disc_that_touches_a_plane_overlaps_nowhere() -> None:
    """Means of the gap over the parts of facets are negative there, and are no overlap."""
    disc = ring(9.0, 10.0, angles(30))
    turned = hv.Mesh(disc.points @ np.array([[0.0, -1.0], [1.0, 0.0]]), disc.cells, disc.boundaries, disc.regions)
    lower = hv.rectangle((12.0, 1.0), (40, 2), origin=(0.0, -11.0))
    contact = {"d:right": hv.Contact(hv.Signorini(), against="l:top", slave="d:right")}
    problem = hv.ContactProblem(
        hv.Mesh.assembled({"d": turned, "l": lower}), STEEL, contact, {"l:bottom": hv.Clamped()}
    )
    said = hv.discretize(problem, check_coercivity=False).notes
    assert any("arcs" in one for one in said)
    assert not any("overlap" in one for one in said)


def test_a_refined_mesh_keeps_the_arcs_of_its_coarsest_one() -> None:
    """Refined all over or in places, facets lie on chords of the arcs; whoever forgets that is told of the ripple."""
    problem = fit(ring(10.0, 20.0, angles(16)), ring(20.0, 30.0, angles(12)), gap=-0.0025)
    fine = problem.mesh.refined()
    fine = fine.refined_where(np.flatnonzero(fine.points[fine.cells].mean(axis=1)[:, 0] > 10.0))
    kept = hv.discretize(replace(problem, mesh=fine))
    np.testing.assert_allclose(kept.offset[:, 0], -0.0025, atol=2e-4)
    assert 20.0 * (1.0 - np.cos(QUARTER / 24)) > 0.04
    lost = hv.discretize(replace(problem, mesh=hv.Mesh(fine.points, fine.cells, fine.boundaries, fine.regions)))
    assert any("their nodes lie on no arcs" in one for one in lost.notes)


# ---- the bulge itself ----------------------------------------------------------------------------------------------


def shaped(height: Callable[[Array], Array], cells: tuple[int, ...] = (12, 1), shake: float = 0.0) -> hv.Mesh:
    """A block of length 3 whose top follows a height (k,) of the place, in space too; its nodes are shaken."""
    mesh = hv.rectangle((3.0, 1.0), cells) if len(cells) == 2 else hv.box((3.0, 2.0, 1.0), cells)  # type: ignore[arg-type]
    points, top = mesh.points.copy(), mesh.points[:, -1] == 1.0
    inside = top & ((points[:, :-1] > 0.0) & (points[:, :-1] < np.array([3.0, 2.0])[: mesh.dim - 1])).all(axis=1)
    points[inside, :-1] += np.random.default_rng(0).uniform(-shake, shake, (inside.sum(), mesh.dim - 1))
    points[top, -1] = 1.0 + height(points[top])
    return hv.Mesh(points, mesh.cells, mesh.boundaries)


def off(mesh: hv.Mesh, height: Callable[[Array], Array]) -> tuple[float, float]:
    """How far middles of edges of the top are from the surface at most, facets and arcs."""
    facets = mesh.boundaries["top"]
    flat = mesh.nodes(2)[mesh.facet_nodes(facets, 2)]
    found = [np.abs(at[..., -1] - 1.0 - height(at)).max() for at in (flat, flat + bulge(mesh, "top").arcs)]
    return float(found[0]), float(found[1])


def crowned(x: Array) -> Array:
    return np.asarray(-0.05 * (x[..., 0] - 1.0) ** 2)


def saddle(x: Array) -> Array:
    return np.asarray(-0.05 * (x[..., 0] - 1.0) ** 2 + 0.03 * x[..., 0] * x[..., 1] + 0.04 * (x[..., 1] - 1.0) ** 2)


@pytest.mark.parametrize(
    ("height", "cells", "shake"),
    [(crowned, (12, 1), 0.08), (crowned, (3, 1), 0.0), (saddle, (12, 8, 1), 0.06), (crowned, (9, 1, 1), 0.0)],
)
def test_arcs_lie_on_the_surface_up_to_its_ends(
    height: Callable[[Array], Array], cells: tuple[int, ...], shake: float
) -> None:
    """Saddles too, uneven facets, three of them, and strips of which all nodes are at an end."""
    facets, arcs = off(shaped(height, cells, shake), height)
    assert arcs < 0.03 * facets


def kinked(x: Array) -> Array:
    """A flat top with a bevel of 15 degrees at each end: three directions."""
    beside = np.maximum(1.0 - x[..., 0], 0.0) + np.maximum(x[..., 0] - 2.0, 0.0)
    return np.asarray(-np.tan(np.radians(15.0)) * beside)


def bevelled(x: Array) -> Array:
    """A bevel of one facet at each end."""
    beside = np.maximum(0.25 - x[..., 0], 0.0) + np.maximum(x[..., 0] - 2.75, 0.0)
    return np.asarray(-np.tan(np.radians(15.0)) * beside)


def roof(x: Array) -> Array:
    return np.asarray(-0.2 * np.abs(x[..., 0] - 1.5))


def stairs(x: Array) -> Array:
    """It turns to and fro at every node."""
    return np.asarray(0.02 * np.cos(4.0 * np.pi * x[..., 0]))


@pytest.mark.parametrize(
    ("height", "cells"),
    [
        (kinked, (12, 1)),
        (kinked, (3, 1)),
        (bevelled, (12, 1)),
        (roof, (4, 1)),
        (roof, (2, 1)),
        (stairs, (12, 1)),
        (roof, (4, 3, 1)),
    ],
)
def test_kinks_between_straight_parts_and_turns_to_and_fro_stay(
    height: Callable[[Array], Array], cells: tuple[int, ...]
) -> None:
    mesh = shaped(height, cells)
    found = bulge(mesh.rotated(0.3) if mesh.dim == 2 else mesh, "top").arcs  # so that zeros are rounding
    if cells == (3, 1):  # one facet each: an arc as good as any, and bounded by what the ends turn
        assert np.abs(found).max() < np.radians(15.0) / 8.0 * 1.1
    else:
        assert np.abs(found).max() < 1e-14


def test_nothing_bulges_across_turns_above_30_degrees() -> None:
    octagon = ring(1.0, 2.0, np.linspace(0.0, np.pi, 5))
    assert not bulge(octagon, "right").arcs.any()
    assert bulge(ring(1.0, 2.0, np.linspace(0.0, np.pi, 7)), "right").arcs.any()


def test_a_side_that_meets_itself_at_a_sharp_node_ends_there() -> None:
    """A drop: one smooth side around it, whose ends meet at the tip."""
    count = 60
    at = 2.0 * np.pi * np.arange(count) / count
    radius = 1.0 + 2.0 * (1.0 - np.sin(0.5 * at))
    rim = np.column_stack([radius * np.cos(at), radius * np.sin(at)])
    facets = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])
    cells = np.column_stack([facets, np.full(count, count)])
    drop = hv.Mesh(np.vstack([rim, np.zeros(2)]), cells, {"rim": facets})
    bulged = np.linalg.norm(bulge(drop, "rim").arcs, axis=2).max(axis=1)
    at_tip = (drop.boundaries["rim"] == 0).any(axis=1)
    assert (bulged[at_tip] == 0.0).all()
    assert (bulged[~at_tip] > 0.0).all()
