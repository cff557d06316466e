"""Random bodies that contact alone holds in some direction, against the cone of contact forces by a linear programme.

A body whose load some admissible contact forces balance for every rigid motion, with a margin, has an equilibrium and
is solved; one whose load none balance has none, and that is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.linalg as la
from scipy.optimize import linprog

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem

METHODS = (None, "newton", "multigrid")
MARGIN = 1e-3
#: Directions of friction in space, by which a disc is held from inside.
CIRCLE = 16


@dataclass(frozen=True)
class Posed:
    """A body, the bound of its friction on each contact point, and whether it is glued."""

    problem: DiscreteProblem
    bounds: Array
    glued: bool

    @property
    def rigid(self) -> Array:
        """Motions (n, k) that deform nothing."""
        return np.asarray(la.null_space(self.problem.stiffness.toarray(), rcond=1e-11))

    def resultants(self, unit: float) -> tuple[Array, Array]:
        """What unit forces of the contact points do on rigid motions, (k, ...): normal ones, and ends of friction.

        ``unit`` is the radius of the polygon that stands for the disc of friction.
        """
        contact, problem = self.problem.contact, self.problem
        trace = (contact.trace @ self.rigid).reshape(*contact.shape, -1)
        weighed = problem.contact.weights[:, None] * trace[:, 0]
        turns = 2.0 * np.pi * np.arange(CIRCLE) / CIRCLE
        heads = np.stack([np.cos(turns), np.sin(turns)])[: contact.shape[1] - 1]
        ends = np.einsum("mtk,th->mhk", trace[:, 1:], unit * heads) * contact.weights[:, None, None]
        return weighed.T, (self.bounds[:, None, None] * ends).reshape(-1, trace.shape[2]).T

    def margin(self) -> float:
        """Part of the load that may be added to it along any rigid motion; negative where nothing balances it."""
        load = self.rigid.T @ self.problem.load
        if not load.size:
            return 1.0
        size = float(np.linalg.norm(load))
        inner, outer = self.resultants(1.0), self.resultants(1.0 / np.cos(np.pi / CIRCLE))
        missed = _programme(outer, load / size, np.eye(load.size), free=True)
        if missed > MARGIN:
            return -missed
        ways = np.concatenate([np.eye(load.size), -np.eye(load.size)])
        return min(_programme(inner, load / size, way[:, None]) for way in ways)


def _programme(forces: tuple[Array, Array], load: Array, ways: Array, free: bool = False) -> float:
    """How far a load can be moved along a way and stays balanced; ``free``: how far it must be moved at least."""
    normal, friction = forces
    m, k = normal.shape[1], ways.shape[1]
    sides = [normal, friction] + ([ways, -ways] if free else [-ways])
    matrix = np.concatenate(sides, axis=1)
    cost = np.zeros(matrix.shape[1])
    cost[m + friction.shape[1] :] = 1.0 if free else -1.0
    shares = np.zeros((m, matrix.shape[1]))
    shares[np.repeat(np.arange(m), friction.shape[1] // m), m + np.arange(friction.shape[1])] = 1.0
    upper = [(0.0, None)] * (matrix.shape[1] - k) + [(0.0, 1.0 if not free else None)] * k
    found = linprog(cost, A_ub=shares, b_ub=np.ones(m), A_eq=matrix, b_eq=load, bounds=upper)
    return abs(float(found.fun)) if found.status == 0 else -1.0


def _mesh_on_feet(rng: np.random.Generator, space: bool) -> hv.Mesh:
    sizes = rng.uniform(0.5, 4.0, 3 if space else 2)
    cells = rng.integers(3, 5, 3) if space else rng.integers(3, 9, 2)
    build = hv.box if space else hv.rectangle
    mesh = build(tuple(sizes.tolist()), tuple(cells.tolist()))
    back = {"back": mesh.boundaries["back"]} if space else {}
    up, near, far = sizes[-1], 0.34 * sizes[0], 0.66 * sizes[0]
    return mesh.with_boundaries(back | {
        "left foot": lambda x: (x[:, -1] < 1e-9) & (x[:, 0] < near),
        "right foot": lambda x: (x[:, -1] < 1e-9) & (x[:, 0] > far),
        "roof": lambda x: x[:, -1] > up - 1e-9,
        "wall": lambda x: x[:, 0] < 1e-9,
        "end": lambda x: x[:, 0] > sizes[0] - 1e-9,
    })  # fmt: skip


def _contact(rng: np.random.Generator, size: float) -> tuple[hv.Contact, float, bool]:
    kind, bound = rng.integers(5), float(10.0 ** rng.uniform(-2.0, 0.5)) if rng.random() < 0.4 else 0.0
    glued = kind == 4
    law = (
        hv.Signorini(),
        hv.Signorini(),
        hv.Signorini(),
        hv.Compliance(float(10.0 ** rng.uniform(0.0, 6.0))),
        hv.Adhesive(1e3, float(10.0 ** rng.uniform(-2.0, 0.0)), softening=100.0, compression=1e4),
    )[kind]
    gap, radius = float(rng.uniform(0.0, 0.1)) * size, float(10.0 ** rng.uniform(0.5, 2.0)) * size
    shape = rng.integers(3)
    friction = hv.Tresca(bound) if bound else hv.laws.NoFriction()
    chosen = (gap, lambda x: gap + (x[:, 0] - 0.3 * size) ** 2 / (2.0 * radius), 0.0)[shape]
    return hv.Contact(law, friction, gap=chosen), bound, bool(glued)


def random_body_on_feet(rng: np.random.Generator) -> Posed:
    """A random body, plane or in space, with one to three contact boundaries, held by supports in some directions."""
    space = bool(rng.random() < 0.3)
    mesh = _mesh_on_feet(rng, space)
    size = float(np.ptp(mesh.points[:, 0]))
    feet = [("left foot", "right foot"), ("left foot",), ("right foot",), ("left foot", "right foot", "wall")][
        rng.integers(4)
    ]
    made = {name: _contact(rng, size) for name in feet}
    supports: dict[str, hv.Fixed] = {}
    if rng.random() < 0.7:
        supports["end"] = hv.Fixed(x=0.0)
    if space:
        supports["back"] = hv.Fixed(y=0.0)
    pull = rng.normal(size=3 if space else 2) * (0.0 if rng.random() < 0.5 else 0.3)
    pull[-1] -= 1.0
    end = rng.normal(size=pull.size) * 0.3
    tractions = {"roof": tuple(pull.tolist())} | ({} if "wall" in feet else {"end": tuple(end.tolist())})
    material = hv.Material.young(float(10.0 ** rng.uniform(2.0, 6.0)), 0.3)
    problem = hv.ContactProblem(mesh, material, {name: made[name][0] for name in feet}, supports, tractions=tractions)
    discrete = hv.discretize(problem, check_coercivity=False)
    contact = discrete.contact
    bounds = np.array([made[name][1] for name in contact.names])[contact.boundary]
    if contact.without_friction is not None:
        bounds[contact.without_friction] = 0.0
    return Posed(discrete, bounds, any(glued for *_, glued in made.values()))


def _looked_at(number: int) -> str:
    """What became of a body, and whether that is right; methods take turns."""
    posed = random_body_on_feet(np.random.default_rng([39, number]))
    margin = posed.margin()
    refusal, found = "", None
    try:
        found = hv.solve(posed.problem, METHODS[number % len(METHODS)], max_time=60.0)
    except hv.HemivarError as error:
        refusal = str(error)
    if found is None:
        assert "no lower bound" in refusal or "free to move" in refusal, refusal
        assert margin < MARGIN, f"{number}: refused, but forces balance the load by {margin:.1e}"
        return "refused"
    if margin <= -MARGIN and not posed.glued:
        assert found.status is hv.Status.UNBOUNDED, f"{number}: {found.status}, but nothing balances the load"
    if margin < MARGIN:
        return "edge"
    assert found.status is hv.Status.CONVERGED, f"{number}: {found.status} after {found.steps}, margin {margin:.1e}"
    assert found.steps <= 30
    load = posed.rigid.T @ posed.problem.load
    left = load - posed.rigid.T @ posed.problem.contact_force(found.multiplier)
    assert np.abs(left).max(initial=0.0) <= 1e-6 * max(np.linalg.norm(posed.problem.load), 1e-300)
    return "held"


def test_thirty_bodies_are_held_as_the_forces_say() -> None:
    seen = [_looked_at(number) for number in range(30)]
    assert seen.count("held") >= 10
    assert seen.count("refused") >= 3


@pytest.mark.slow
@pytest.mark.parametrize("block", range(9))
def test_hundreds_of_bodies_are_held_as_the_forces_say(block: int) -> None:
    seen = [_looked_at(number) for number in range(1000 + 30 * block, 1030 + 30 * block)]
    assert "held" in seen


def half_beam(rng: np.random.Generator, method: str, units: float = 1.0) -> hv.Solution:
    """Three-point bending by halves: a nose presses on the plane of symmetry, a round support carries the end."""
    length, radius, force = float(rng.choice([40.0, 60.0, 80.0])), rng.uniform(5.0, 100.0), rng.uniform(1.0, 60.0)
    at = rng.uniform(0.5, 0.8) * length
    mesh = hv.rectangle((length, 8.0), (60, 4)).with_boundaries({
        "axis": lambda x: x[:, 0] < 1e-9, "bottom": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 0.3 * length),
        "nose": lambda x: (x[:, 1] > 8.0 - 1e-9) & (x[:, 0] < length / 20.0 + 1e-9),
    })  # fmt: skip
    contact = hv.Contact(hv.Signorini(), gap=lambda x: (x[:, 0] - at) ** 2 / (2.0 * radius))
    width = np.ptp(mesh.points[np.unique(mesh.boundaries["nose"]), 0])
    problem = hv.ContactProblem(
        mesh, hv.Material.young(2e4 * units, 0.3, plane="stress"), {"bottom": contact}, {"axis": hv.Fixed(x=0.0)},
        tractions={"nose": (0.0, -force * units / width)},
    )  # fmt: skip
    found = hv.solve(problem, method)
    assert found.normal_force == pytest.approx(force * units, rel=1e-6)
    return found


@pytest.mark.parametrize("method", ["newton", "multigrid"])
@pytest.mark.parametrize("seed", range(6))
def test_half_beams_on_round_supports_carry_their_load(seed: int, method: str) -> None:
    found, other = (half_beam(np.random.default_rng(seed), method, units) for units in (1.0, 1e6))
    assert found.status is other.status is hv.Status.CONVERGED
    assert max(found.steps, other.steps) <= 12


@pytest.mark.parametrize(("mu", "cells"), [(0.6, 4), (0.3, 8), (0.1, 8)])
def test_a_beam_on_two_round_supports_with_coulombs_law(mu: float, cells: int) -> None:
    mesh = hv.rectangle((30.0, 2.0), (15 * cells // 2, cells // 2 + 1)).with_boundaries({
        "a": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] < 6.0), "b": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 24.0),
        "middle": lambda x: (x[:, 1] > 2.0 - 1e-9) & (np.abs(x[:, 0] - 15.0) < 2.01),
        "end": lambda x: np.abs(x[:, 0] - 30.0) < 1e-9,
    })  # fmt: skip
    contact = {
        name: hv.Contact(hv.Signorini(), hv.Coulomb(mu), obstacle=hv.mechanics.Sphere((x, -4.0), 4.0))
        for name, x in (("a", 3.0), ("b", 27.0))
    }
    problem = hv.ContactProblem(
        mesh, hv.Material.young(5e4, 0.3), contact, {"end": hv.Fixed(x=0.0)}, tractions={"middle": (0.0, -0.02)}
    )
    found, reference = (hv.solve(problem, chosen) for chosen in (None, hv.solvers.FixedPoint()))
    assert found.status is hv.Status.CONVERGED
    assert found.steps <= 12
    size = np.abs(reference.displacement).max()
    np.testing.assert_allclose(found.displacement, reference.displacement, atol=1e-6 * size)
