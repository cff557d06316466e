"""Nonlinear bodies in time: against an integrator of an assembly of its own, and linear bodies written as energies."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import (
    BDF2,
    SDIRK2,
    AdaptiveStep,
    Evolution,
    GeneralizedAlpha,
    History,
    ImplicitEuler,
    Midpoint,
    MoreauJean,
    Newmark,
    Scheme,
    march,
)
from hemivar.evolution.barrier import along
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.stepper import TimeStepper
from hemivar.mechanics.gradient_energy import PowerLaw
from hemivar.solvers import NonsmoothMultigrid, NonsmoothNewton
from tests.samples import slow

TIGHT = hv.solvers.Controls(rtol=1e-12)
#: Bulk and shear modulus, the part that is left, and the strain at which a body of Hencky's kind softens.
K, MU, Q, E0 = 20 / 3, 4.0, 0.25, 0.05
LAM_V, MU_V, DENSITY, SPRING = 0.3, 0.5, 1.3, 20.0
FOUNDATION = {"bottom": hv.Contact(hv.Compliance(SPRING))}


def hencky(part: float = Q, viscosity: tuple[float, float] | None = None, density: float | None = None) -> hv.Material:
    return hv.Material.hencky(K, MU, part, E0, viscosity=viscosity, density=density)


def lame(viscosity: tuple[float, float] | None = None, density: float | None = None) -> hv.Material:
    return hv.Material.lame(K - 2 * MU / 3, MU, viscosity=viscosity, density=density)


END = 0.8


def pull(t: float) -> tuple[float, float]:
    """Force per length at the top."""
    return 0.15 * math.sin(3.0 * t), -1.0 + 0.4 * math.cos(5.0 * t)


def push(t: float) -> tuple[float, float]:
    """Height and velocity of the top where a support moves it."""
    return -0.06 - 0.03 * math.sin(4.0 * t), -0.12 * math.cos(4.0 * t)


def start(points: Array) -> Array:
    return np.column_stack([0.02 * points[:, 0] * points[:, 1], -0.06 - 0.02 * points[:, 1]])


def lowered(points: Array) -> Array:
    return np.tile([0.0, -0.06], (len(points), 1))


# ---- an integrator of its own -----------------------------------------------------------------------------


class Block:
    """A square of four triangles on springs: forces, mass and viscosity, summed by hand."""

    def __init__(self) -> None:
        self.mesh = hv.rectangle(cells=1, pattern="cross")
        self.points, self.cells = self.mesh.points, self.mesh.cells
        n = 2 * len(self.points)
        self.mass, self.viscosity = np.zeros((n, n)), np.zeros((n, n))
        self.strains, self.areas, self.where = [], [], []
        V = np.diag([2 * MU_V, 2 * MU_V, MU_V]) + LAM_V * np.outer([1, 1, 0], [1, 1, 0])
        for cell in self.cells:
            edges = np.column_stack([np.ones(3), self.points[cell]])
            slopes, area = np.linalg.inv(edges)[1:], 0.5 * abs(np.linalg.det(edges))
            B = np.zeros((3, 6))
            B[0, 0::2], B[1, 1::2] = slopes
            B[2, 0::2], B[2, 1::2] = slopes[1], slopes[0]
            at = (2 * cell[:, None] + np.arange(2)).ravel()
            self.strains.append(B), self.areas.append(area), self.where.append(at)
            self.viscosity[np.ix_(at, at)] += area * B.T @ V @ B
            self.mass[np.ix_(at, at)] += DENSITY * area / 12 * np.kron(np.ones((3, 3)) + np.eye(3), np.eye(2))
        self.bottom = np.flatnonzero(np.isclose(self.points[:, 1], 0.0))
        self.top = np.flatnonzero(np.isclose(self.points[:, 1], 1.0))

    def energy(self, u: Array) -> float:
        total = 0.0
        for B, area, at in zip(self.strains, self.areas, self.where, strict=True):
            trace, square = self._invariants(B @ u[at])
            root = math.sqrt(1 + square / E0**2)
            total += area * (0.5 * K * trace**2 + MU * Q * square + 2 * MU * (1 - Q) * E0**2 * (root - 1))
        return total

    def forces(self, u: Array) -> Array:
        total = np.zeros(u.size)
        for B, area, at in zip(self.strains, self.areas, self.where, strict=True):
            e = B @ u[at]
            trace, square = self._invariants(e)
            secant = 2 * MU * (Q + (1 - Q) / math.sqrt(1 + square / E0**2))
            deviator = np.array([e[0] - trace / 3, e[1] - trace / 3, 0.5 * e[2]])
            total[at] += area * B.T @ (K * trace * np.array([1, 1, 0]) + secant * deviator)
        return total

    @staticmethod
    def _invariants(e: Array) -> tuple[float, float]:
        trace = e[0] + e[1]
        return trace, (e[0] - trace / 3) ** 2 + (e[1] - trace / 3) ** 2 + (trace / 3) ** 2 + 0.5 * e[2] ** 2

    def rest(self, u: Array, t: float) -> Array:
        """What elastic forces and springs leave of the load; every point stays on its spring."""
        force = -self.forces(u)
        for node in self.bottom:
            assert -u[2 * node + 1] > 0.0
            force[2 * node + 1] -= 0.5 * SPRING * u[2 * node + 1]
        for node in self.top:
            force[2 * node : 2 * node + 2] += 0.5 * np.array(pull(t))
        return force


@pytest.fixture(scope="module")
def block() -> Block:
    return Block()


def integrated(rate: Callable[[float, Array], Array], begin: Array) -> Array:
    found = scipy.integrate.solve_ivp(rate, (0.0, END), begin, method="DOP853", rtol=1e-12, atol=1e-13)
    assert found.success
    return np.asarray(found.y[:, -1])


@pytest.fixture(scope="module")
def thrown(block: Block) -> Array:
    """Displacements (nodes, 2) at the end of the block with mass, which nothing holds but its springs."""
    factor, u0 = scipy.linalg.cho_factor(block.mass), start(block.points).ravel()
    n = u0.size

    def rate(t: float, y: Array) -> Array:
        return np.r_[y[n:], scipy.linalg.cho_solve(factor, block.rest(y[:n], t) - block.viscosity @ y[n:])]

    return integrated(rate, np.r_[u0, np.zeros(n)])[:n].reshape(-1, 2)


@pytest.fixture(scope="module")
def pressed(block: Block) -> Array:
    """Displacements (nodes, 2) at the end of the block without mass, between a wall at its left and a moving top."""
    u0 = lowered(block.points).ravel()
    held = np.zeros(u0.size, dtype=bool)
    top = 2 * block.top + 1
    held[2 * np.flatnonzero(np.isclose(block.points[:, 0], 0.0))] = held[top] = True
    factor = scipy.linalg.cho_factor(block.viscosity[np.ix_(~held, ~held)])

    def whole(t: float, y: Array) -> Array:
        u = np.zeros(u0.size)
        u[~held], u[top] = y, push(t)[0]
        return u

    def rate(t: float, y: Array) -> Array:
        v = np.zeros(u0.size)
        v[top] = push(t)[1]
        force = block.rest(whole(t, y), t) - block.viscosity @ v
        return np.asarray(scipy.linalg.cho_solve(factor, force[~held]))

    return whole(END, integrated(rate, u0[~held])).reshape(-1, 2)


def thrown_block(block: Block, material: hv.Material) -> Evolution:
    def traction(points: Array, t: float) -> Array:
        return np.tile(pull(t), (len(points), 1))

    stated = hv.ContactProblem(block.mesh, material, FOUNDATION, {}, tractions={"top": traction})
    return Evolution(stated, inertia=True, displacement=start)


def pressed_block(block: Block, material: hv.Material) -> Evolution:
    def traction(points: Array, t: float) -> Array:
        return np.tile(pull(t), (len(points), 1))

    def height(points: Array, t: float) -> Array:
        return np.full(len(points), push(t)[0])

    held = {"left": "roller", "top": hv.Fixed(y=height)}
    stated = hv.ContactProblem(block.mesh, material, FOUNDATION, held, tractions={"top": traction})
    return Evolution(stated, displacement=lowered)


def nodal(history: History) -> Array:
    return history.discrete.full(history.state.body.displacement)


def rates(block: Block, stated: Evolution, scheme: Scheme, exact: Array) -> Array:
    """Observed orders in the step; elastic energies are compared with those that are summed here."""
    off = []
    for steps in (10, 20):
        history = march(stated, END, scheme=scheme, step=END / steps, controls=TIGHT)
        off.append(float(np.abs(nodal(history) - exact).max()))
        assert history.ledger["elastic"] == pytest.approx(block.energy(nodal(history).ravel()), rel=1e-11)
        assert np.abs(history["gap"]).max() < 1e-12
    return np.log2(np.array(off[:-1]) / off[1:])


def scheme_name(scheme: object) -> str | None:
    return scheme.name if isinstance(scheme, Scheme) else None


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        (GeneralizedAlpha(), 2),
        *(slow(s, n) for s, n in ((ImplicitEuler(), 1), (Midpoint(), 2), (Newmark(), 2), (BDF2(), 2))),
    ],
    ids=scheme_name,
)
def test_the_order_with_mass(block: Block, thrown: Array, scheme: Scheme, order: int) -> None:
    stated = thrown_block(block, hencky(viscosity=(LAM_V, MU_V), density=DENSITY))
    assert rates(block, stated, scheme, thrown)[-1] == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize(
    ("scheme", "order"),
    [(Midpoint(), 2), *(slow(s, n) for s, n in ((ImplicitEuler(), 1), (SDIRK2(), 2), (BDF2(), 2)))],
    ids=scheme_name,
)
def test_the_order_without_mass_below_a_moving_support(
    block: Block, pressed: Array, scheme: Scheme, order: int
) -> None:
    stated = pressed_block(block, hencky(viscosity=(LAM_V, MU_V)))
    assert rates(block, stated, scheme, pressed)[-1] == pytest.approx(order, abs=0.25)


@pytest.mark.slow
def test_adaptive_steps_keep_to_their_tolerance(block: Block, thrown: Array) -> None:
    stated = thrown_block(block, hencky(viscosity=(LAM_V, MU_V), density=DENSITY))
    off = [
        np.abs(nodal(march(stated, END, scheme=Midpoint(), step=AdaptiveStep(rtol=rtol))) - thrown).max()
        for rtol in (1e-2, 1e-3)
    ]
    assert off[1] < 2e-2 * np.abs(thrown).max()
    assert off[1] < 0.5 * off[0]


def test_without_viscosity_the_midpoint_rule_loses_energy_of_the_second_order_only(block: Block) -> None:
    free = thrown_block(block, hencky(density=DENSITY))
    still = dataclasses.replace(free, problem=dataclasses.replace(free.problem, tractions={}, body_force=(0.0, -1.2)))
    lost = []
    for steps in (16, 32):
        history = march(still, END, scheme=Midpoint(), step=END / steps, controls=TIGHT)
        ledger = history.ledger
        assert abs(ledger["gap"]) < 1e-12
        lost.append(np.abs(history["numerical"]).max())
        stored = sum(ledger[name] for name in ("elastic", "kinetic", "contact"))
        begun = history["elastic"][0] + history["contact"][0] + history["kinetic"][0]
        assert stored - begun == pytest.approx(ledger["work"] - ledger["numerical"], abs=1e-12)
    assert lost[1] < 0.3 * lost[0]


# ---- linear bodies as energies ----------------------------------------------------------------------------


def gliding(material: hv.Material, law: object = None, friction: object = None) -> hv.ContactProblem:
    """A block that a moving top presses and shears on a foundation with friction."""
    top = hv.Fixed(
        x=lambda points, t: np.full(len(points), 0.06 * math.sin(3.0 * t)),
        y=lambda points, t: np.full(len(points), -0.08 * min(2.0 * t, 1.0)),
    )
    law, friction = hv.Compliance(SPRING) if law is None else law, hv.Tresca(0.1) if friction is None else friction
    foundation = hv.Contact(law, friction)
    return hv.ContactProblem(hv.rectangle(cells=2), material, {"bottom": foundation}, {"top": top})


@pytest.mark.parametrize(
    "scheme",
    [BDF2(), Newmark(), MoreauJean(), *map(slow, (ImplicitEuler(), SDIRK2(), Midpoint(), GeneralizedAlpha()))],
    ids=scheme_name,
)
def test_a_linear_material_as_an_energy_goes_as_before(scheme: Scheme) -> None:
    inertia = scheme.needs_mass
    found = []
    for make in (lambda **more: hencky(1.0, **more), lame):
        material = make(viscosity=(LAM_V, MU_V), density=DENSITY)
        law = hv.Signorini() if scheme.is_impact_law else None
        stated = Evolution(gliding(material, law), inertia=inertia)
        found.append(march(stated, 0.5, scheme=scheme, step=0.1, controls=TIGHT))
    energy, linear = found
    assert not energy.discrete.linear
    assert linear.discrete.linear
    assert nodal(energy) == pytest.approx(nodal(linear), abs=1e-9 * np.abs(nodal(linear)).max())
    for name in ("elastic", "viscous", "kinetic", "friction", "contact", "work", "moved", "numerical", "normal_force"):
        assert energy[name] == pytest.approx(linear[name], rel=1e-8, abs=1e-9), name
    assert energy["margin"][1:] == pytest.approx(linear["margin"][1:], rel=1e-6)


def test_coulombs_friction_and_the_energy_of_a_linear_body() -> None:
    found = [
        march(Evolution(gliding(make(), friction=hv.Coulomb(0.3))), 0.3, step=0.1)
        for make in (lambda: hencky(1.0), lame)
    ]
    assert nodal(found[0]) == pytest.approx(nodal(found[1]), abs=1e-8)
    assert found[0]["friction"] == pytest.approx(found[1]["friction"], rel=1e-6, abs=1e-9)


def test_branches_and_redistributed_mass_serve_as_well() -> None:
    branch = hv.materials.Branch(time=0.2, lame=(2.0, 1.5))
    found = []
    for material in (
        hv.Material.hencky(K, MU, 1.0, E0, density=DENSITY, branches=(branch,)),
        hv.Material.lame(K - 2 * MU / 3, MU, density=DENSITY, branches=(branch,)),
    ):
        stated = Evolution(gliding(material), inertia=True, mass="redistributed")
        found.append(march(stated, 0.5, scheme=GeneralizedAlpha(), step=0.1, controls=TIGHT))
    energy, linear = found
    assert nodal(energy) == pytest.approx(nodal(linear), abs=1e-9)
    assert energy["branches"] == pytest.approx(linear["branches"], rel=1e-8, abs=1e-10)
    assert np.abs(energy["gap"]).max() < 1e-11


@pytest.mark.parametrize("jump", ["local", slow("viscous")])
def test_a_jump_of_a_linear_body_as_an_energy(jump: str) -> None:
    """Glue whose margin is lost: the body leaves its equilibrium, downhill or against the least viscosity."""
    glue = hv.Adhesive(stiffness=40.0, strength=0.5, softening=30.0)
    top = hv.Fixed(x=0.0, y=lambda points, t: np.full(len(points), 0.12 * t))
    found = []
    for material in (hencky(1.0), lame()):
        stated = hv.ContactProblem(hv.rectangle(cells=3), material, {"bottom": hv.Contact(glue)}, {"top": top})
        found.append(march(Evolution(stated), 1.0, step=0.1, jump=jump, controls=hv.solvers.Controls(rtol=1e-11)))
    energy, linear = found
    assert linear.margin < 0.0
    assert energy["margin"][1:] == pytest.approx(linear["margin"][1:], rel=1e-6)
    assert energy["jumped"] == pytest.approx(linear["jumped"])
    assert energy["normal_force"] == pytest.approx(linear["normal_force"], abs=1e-7)
    assert nodal(energy) == pytest.approx(nodal(linear), abs=1e-8)
    assert energy["jumps"] == pytest.approx(linear["jumps"], abs=1e-8)


def test_heat_that_conducts_by_an_energy_is_what_it_was() -> None:
    """``PowerLaw`` of exponent two has a constant flux; a capacity stores."""
    mesh, found = hv.rectangle(cells=6), []
    for coefficient in (PowerLaw(2.0, 1.0, 1e6, 1.5), 1.5):
        stated = hv.ScalarProblem(mesh, coefficient, supports={"top": 1.0}, kind="heat", capacity=0.7, bedding=0.2)
        found.append(march(Evolution(stated, displacement=lambda points: 1.0 + points[:, 0]), 0.4, step=0.05))
    energy, linear = found
    assert not energy.discrete.linear
    assert nodal(energy) == pytest.approx(nodal(linear), abs=1e-9)


# ---- margins, meshes, files -------------------------------------------------------------------------------


@pytest.mark.parametrize("inertia", [False, True])
def test_the_margin_is_that_of_the_lower_bound(inertia: bool) -> None:
    """Against dense matrices; the viscosity is in proportion to the stiffness at rest."""
    time, step, alpha = 0.04, 0.1, 5.0
    viscous = ((K - 2 * MU / 3) * time, MU * time)
    law = hv.Softening(20.0, 0.02, alpha)
    problem = gliding(hencky(viscosity=viscous, density=DENSITY), law, hv.Tresca(0.0))
    history = march(Evolution(problem, inertia=inertia), 2 * step, step=step)
    low = gliding(hv.Material.lame(K - 2 * Q * MU / 3, Q * MU, viscosity=viscous, density=DENSITY), law, hv.Tresca(0.0))
    family = hv.fem.dynamics.body_family(low.at_time(0.0))
    A = family.stiffness.inner + family.viscosity.inner / step
    if inertia:
        A = A + family.mass.inner / step**2
    contact = history.discrete.problem.contact
    normal = contact.trace[:: contact.components].toarray()
    B = normal.T @ np.diag(alpha * contact.weights) @ normal
    expected = 1.0 - scipy.linalg.eigh(B, A.toarray(), eigvals_only=True)[-1]
    assert history["margin"][1:] == pytest.approx(expected, rel=1e-9)
    longest = history["largest_step"][-1]
    assert longest > step
    A = family.stiffness.inner + family.viscosity.inner / longest + (family.mass.inner / longest**2 if inertia else 0)
    assert 1.0 - scipy.linalg.eigh(B, A.toarray(), eigvals_only=True)[-1] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("inertia", [False, True])
def test_multigrid_goes_the_same_way(inertia: bool) -> None:
    def stated() -> hv.ContactProblem:
        mesh = hv.rectangle(cells=2).refined().refined()
        problem = gliding(
            hencky(viscosity=(LAM_V, MU_V), density=DENSITY), hv.Softening(20.0, 0.02, 3.0), hv.Tresca(0.1)
        )
        return dataclasses.replace(problem, mesh=mesh)

    found = [
        march(Evolution(stated(), inertia=inertia), 0.3, step=0.1, method=method, controls=TIGHT)
        for method in (NonsmoothNewton(), NonsmoothMultigrid())
    ]
    assert nodal(found[0]) == pytest.approx(nodal(found[1]), abs=1e-9)
    assert found[0]["margin"][1:] == pytest.approx(found[1]["margin"][1:], rel=1e-6)


def test_it_goes_on_from_a_checkpoint_to_the_last_bit(tmp_path: Path) -> None:
    stated = Evolution(gliding(hencky(viscosity=(LAM_V, MU_V), density=DENSITY)), inertia=True)
    for scheme in (GeneralizedAlpha(), BDF2()):
        options = {"scheme": scheme, "step": 0.05, "checkpoint": tmp_path / f"{scheme.name}.ckpt"}
        whole = march(stated, 0.5, scheme=scheme, step=0.05)
        march(stated, 0.25, **options)
        resumed = march(stated, 0.5, **options, resume=True)
        assert np.array_equal(nodal(whole), nodal(resumed))
        for name in ("elastic", "gap", "margin", "normal_force", "numerical"):
            assert np.array_equal(whole[name], resumed[name], equal_nan=True), name


def test_what_is_made_for_linear_bodies_is_refused() -> None:
    body = Evolution(gliding(hencky()))
    with pytest.raises(ProblemError, match="jump = 'arc-length' is made for linear bodies"):
        march(body, 1.0, jump="arc-length")
    with pytest.raises(ProblemError, match="jump = 'global' is made for linear bodies"):
        march(body, 1.0, jump="global")
    with pytest.raises(ProblemError, match="is for linear bodies"):
        march(body, 1.0, scheme=Midpoint(conserving=True))
    with pytest.raises(ProblemError, match="heat is coupled with the motion of linear materials only"):
        Evolution(body.problem, heat=hv.mechanics.Heat(1.0, 1.0))
    assert march(body, 0.1, step=0.05).ledger["gap"] == pytest.approx(0.0, abs=1e-13)


def test_the_energy_along_a_step_bends_as_that_of_the_linear_body() -> None:
    bends = []
    for material in (hencky(1.0), lame()):
        body = gliding(material, hv.Adhesive(stiffness=40.0, strength=0.5, softening=30.0))
        advance = TimeStepper.of(discretize_evolution(Evolution(body)), ImplicitEuler(), None, TIGHT)
        taken = advance.take(initial_state(advance), 0.1)
        bends.append(along(taken.stages[0].problem, taken.solutions[0])[0])
    assert bends[1].min() > 0.0
    assert bends[0] == pytest.approx(bends[1], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("cells", [4, 32])
def test_supports_that_move_within_a_step_strain_no_cell_beyond_what_it_bears(cells: int) -> None:
    """Energy that ends at a shear strain of 0.2; alone, a support moves by ``0.025 / h`` in a step."""

    def pressure(e: float) -> float:
        return 6.0 * e + 2.0 / 3.0 * e / (0.04 - 2.0 / 3.0 * e**2)

    exact = brentq(lambda s: pressure(0.1 - s) - 20.0 * s, 0.0, 0.1, xtol=1e-16)
    down = hv.Fixed(y=lambda points, t: np.full(len(points), -0.1 * t))
    material = hv.Material.potential("3*tr^2 - 0.5*log(1 - dev2/0.04)", reach=0.19)
    supports = {"left": "roller", "right": "roller", "top": down}
    stated = hv.ContactProblem(
        hv.rectangle(cells=cells), material, {"bottom": hv.Contact(hv.Compliance(20.0))}, supports
    )
    history = march(Evolution(stated), 1.0, step=0.25)
    assert history.finished
    assert history["penetration"][-1] == pytest.approx(exact, rel=1e-9)
