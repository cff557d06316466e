"""Glue whose fracture energy depends on the mode, on a body with contact and foundations of other laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import BenzeggaghKenane, BilinearCohesion, MixedMode, ModeDependentGlue, OrthotropicFriction
from hemivar.mesh import Mesh
from hemivar.solvers import METHODS, FixedPoint
from tests.samples import slow

YOUNG, POISSON, ARM, HALF = 70e3, 0.3, 1.5, 25.0  # MPa, -, mm: thickness of an arm, half of the span
SIGNORINI = hv.Contact(hv.Signorini())
SHEAR_ENERGY = 0.3  # N/mm


def stiff(strength: float) -> ModeDependentGlue:
    """Glue with this strength in shear."""
    criterion = BenzeggaghKenane(0.5 * SHEAR_ENERGY, SHEAR_ENERGY, 2.0)
    return ModeDependentGlue(
        0.7 * strength, strength, 1e5, criterion, shear_stiffness=1e5, compression=hv.Compliance(1e5)
    )


STIFF = stiff(60.0)


def notched(crack: float, cells: int = 50) -> Mesh:
    """A beam of two arms that are apart up to the end of the crack, with a foot, an end and a pad in the middle."""
    mesh = hv.rectangle((2.0 * HALF, 2.0 * ARM), (cells, 2))
    cut = np.flatnonzero(np.abs(mesh.points[:, 1] - ARM) < 1e-9)
    cut = cut[np.argsort(mesh.points[cut, 0])]
    edges = np.column_stack([cut[:-1], cut[1:]])
    before = mesh.points[edges].mean(axis=1)[:, 0] < crack
    mesh = mesh.with_interfaces({"crack": edges[before], "joint": edges[~before]}).opened("crack").opened("joint")
    left, top = mesh.boundaries["left"], mesh.boundaries["top"]
    foot = left[mesh.points[left].mean(axis=1)[:, 1] < ARM]
    pad = top[np.abs(mesh.points[top].mean(axis=1)[:, 0] - HALF) < 2.1 * HALF / cells]
    return replace(mesh, boundaries={**mesh.boundaries, "foot": foot, "pad": pad})


def three_point_bending(
    crack: float,
    touching: hv.Contact = SIGNORINI,
    force: float = 1.0,
    glue: ModeDependentGlue = STIFF,
    cells: int = 50,
) -> hv.ContactProblem:
    """Three-point bending under a force for one mm of width."""
    mesh = notched(crack, cells)
    width = float(np.ptp(mesh.points[mesh.boundaries["pad"], 0]))
    return hv.ContactProblem(
        mesh,
        hv.Material.young(YOUNG, POISSON, plane="stress"),
        {"joint:1": hv.Contact(glue, against="joint:2"), "crack:1": replace(touching, against="crack:2")},
        {"foot": hv.Fixed(y=0.0), "right": hv.Fixed(y=0.0), "pad": hv.Fixed(x=0.0)},
        tractions={"pad": (0.0, -force / width)},
        order=2,
    )


def flexure(crack: float, touching: hv.Contact = SIGNORINI) -> hv.Solution:
    """The beam under the force 1, where nothing is damaged."""
    return hv.solve(three_point_bending(crack, touching)).raise_for_status()


def sinks(solution: hv.Solution) -> float:
    """Mean displacement of the pad along the load."""
    problem = solution.problem.origin
    assert problem is not None
    nodes = problem.mesh.facet_nodes(problem.mesh.boundaries["pad"], 2)
    return -float((solution.displacement[nodes, 1] @ [1 / 6, 1 / 6, 4 / 6]).mean())


@pytest.mark.slow
def test_an_end_notched_beam_is_as_flexible_as_beams_are() -> None:
    """C = C_0 + 3 (a + D)^3/(8 E h^3), D the length by which a crack seems longer; the arms share the left reaction.

    The upper arm is pushed up by the lower one with a quarter of the load, whatever friction there is.
    """
    cracks = np.array([8.0, 11.0, 14.0])
    whole = sinks(flexure(11.0, hv.Contact(STIFF)))
    solved = [flexure(crack) for crack in cracks.tolist()]
    slope, start = np.polyfit(cracks, np.cbrt([sinks(one) - whole for one in solved]), 1)
    assert slope == pytest.approx(np.cbrt(3.0 / (8.0 * YOUNG * ARM**3)), rel=5e-3)
    assert 0.0 < start / slope < 0.42 * ARM  # of orthotropic arms 0.42 chi h, chi at most 1 here
    rough = flexure(14.0, hv.Contact(hv.Signorini(), hv.Coulomb(0.2)))
    for crack, one in zip([*cracks.tolist(), 14.0], [*solved, rough], strict=True):
        touching = one.on("crack:1")
        away = touching.contact.points[:, 0] < crack - 2.0 * ARM
        assert touching.contact.weights[away] @ touching.pressure[away] == pytest.approx(0.25, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("strength", "cells", "part"), [(60.0, 50, 0.88), (120.0, 100, 0.95)])
def test_an_end_notched_beam_fails_where_beam_theory_says(strength: float, cells: int, part: float) -> None:
    """At G_II = 9 P^2 (a + D)^2/(16 E h^3), the nearer the stronger the glue: then the crack runs past the pad."""
    crack, longer = 11.0, 0.29 * ARM  # as the test above finds it
    limit = np.sqrt(16.0 * SHEAR_ENERGY * YOUNG * ARM**3 / 9.0) / (crack + longer)
    at, broken = None, []
    for factor in (*np.linspace(0.5, part, 10).tolist(), 1.0):
        problem = three_point_bending(crack, force=factor * limit, glue=stiff(strength), cells=cells)
        found = hv.solve(problem, initial=at).raise_for_status()
        at, places = found.unknowns, found.contact.points
        assert places is not None
        broken.append(float(places[found.debonding["damage"] == 1.0, 0].max(initial=0.0)))
    assert max(broken[:-1]) < crack + 1.0
    assert broken[-1] > HALF


BLOCK = ModeDependentGlue(0.4, 1.2, 20.0, BenzeggaghKenane(0.05, 0.1, 2.0))
ONE_ENERGY = ModeDependentGlue(0.4, 0.6, 20.0, BenzeggaghKenane(0.3, 0.3, 2.0))
#: The same law: one energy, the first damage at the same effective opening, ratio = shear strength/strength.
AS_POTENTIAL = MixedMode(BilinearCohesion(0.4, 0.3, 20.0), 1.5)
CONTACTS = {
    "signorini": SIGNORINI,
    "tresca": hv.Contact(hv.Signorini(), hv.Tresca(0.02)),
    "coulomb": hv.Contact(hv.Signorini(), hv.Coulomb(0.3)),
    "softening": hv.Contact(hv.Softening(20.0, 0.02, 2.0)),
}


def cracked(glue: hv.laws.VectorLaw, touching: hv.Contact, pull: tuple[float, float], swapped: str = "") -> hv.Solution:
    """A block on a foundation with friction, cut in two: in contact on one half of the cut, glued on the other."""
    whole = hv.rectangle((1.0, 1.0), 4)
    cut = np.flatnonzero(np.abs(whole.points[:, 1] - 0.5) < 1e-9)
    cut = cut[np.argsort(whole.points[cut, 0])]
    joint, crack = np.split(np.column_stack([cut[:-1], cut[1:]]), 2)
    mesh = whole.with_interfaces({"crack": crack, "joint": joint}).opened("crack").opened("joint")
    sides = {name: ("2", "1") if name == swapped else ("1", "2") for name in ("crack", "joint")}
    pairs = {
        f"{name}:{sides[name][0]}": replace(one, against=f"{name}:{sides[name][1]}")
        for name, one in (("crack", touching), ("joint", hv.Contact(glue)))
    }
    problem = hv.ContactProblem(
        mesh,
        hv.Material.lame(40.0, 40.0),
        {**pairs, "left": hv.Contact(hv.Compliance(20.0), hv.Coulomb(0.1))},
        {"bottom": hv.Clamped()},
        tractions={"top": pull},
    )
    return hv.solve(problem, controls=hv.Controls(rtol=1e-11)).raise_for_status()


def same_displacement(one: hv.Solution, other: hv.Solution, near: float) -> None:
    size = np.abs(one.displacement).max()
    np.testing.assert_allclose(other.displacement, one.displacement, atol=near * size)


@pytest.mark.parametrize("name", ["signorini", slow("coulomb"), slow("tresca"), slow("softening")])
def test_with_one_energy_it_is_the_potential(name: str) -> None:
    """Another law, whose joint with friction of the state has no mode: the same displacement, damaged and all."""
    pull = (0.27, -0.1) if name == "coulomb" else (0.1, 0.18)
    found = cracked(ONE_ENERGY, CONTACTS[name], pull)
    assert 0.0 < np.nanmax(found.debonding["damage"]) < 1.0
    same_displacement(found, cracked(AS_POTENTIAL, CONTACTS[name], pull), 1e-8)


@pytest.mark.parametrize("name", [slow("signorini"), "coulomb"])
def test_which_side_comes_first_does_not_matter(name: str) -> None:
    """The node where the crack ends belongs to the glue, whichever side of the cut sees the other one."""
    found = cracked(BLOCK, CONTACTS[name], (0.03, -0.1))
    for side in ("crack", "joint"):
        same_displacement(found, cracked(BLOCK, CONTACTS[name], (0.03, -0.1), side), 1e-7)


@pytest.mark.parametrize("bound", [slow(0.02), hv.laws.CoulombBound(0.2)])
def test_beside_friction_that_has_a_direction(bound: float | hv.laws.StateBound) -> None:
    """In space, by two methods."""
    problem = hv.ContactProblem(
        hv.box(cells=1),
        hv.Material.lame(40.0, 40.0),
        {"bottom": hv.Contact(hv.Compliance(20.0), OrthotropicFriction(bound, ratio=0.5)), "top": hv.Contact(BLOCK)},
        body_force=(0.1, 0.05, -1.0),
    )
    found = hv.solve(problem, controls=hv.Controls(rtol=1e-11)).raise_for_status()
    again = hv.solve(problem, FixedPoint(METHODS["multigrid"]), controls=hv.Controls(rtol=1e-11)).raise_for_status()
    np.testing.assert_allclose(again.unknowns, found.unknowns, atol=1e-8 * np.abs(found.unknowns).max())
    assert np.nanmax(found.debonding["damage"]) > 0.0
    assert found.method != again.method
