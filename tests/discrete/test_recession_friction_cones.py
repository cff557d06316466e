"""Friction that the pressure bounds, before the solve: round cones, cut off at what the foundation can press."""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete.held_at_rest import AT_LIMIT, BY_FRICTION, NO_MINIMUM
from hemivar.discrete.recession import Coercivity, FrictionCones, RecessionFunction, decide
from hemivar.laws import CoulombBound, Friction, OrthotropicFriction
from tests.samples import sampled

clarabel = pytest.importorskip("clarabel")

MU = 0.3


def load_factor(cones: FrictionCones, work: Array) -> float:
    """The largest multiple of the work of a load that forces of the cones balance, by a conic programme for the forces.

    At each point a pressure p <= s F, a friction |q| <= p, and a pull of at most (1 - s) D, with a share s of 0 to 1.
    """
    count, t, a = cones.slips.shape
    width, n = t + 3, (t + 3) * count + 1  # p, q, pull, share; at last the multiple
    balance = np.zeros((a, n))
    upper, rows, round_ones = [], [], []
    for k in range(count):
        p, pull, share = (np.zeros(n) for _ in range(3))
        p[width * k], pull[width * k + t + 1], share[width * k + t + 2] = 1.0, 1.0, 1.0
        balance += np.outer(cones.normal[k], p) - np.outer(cones.normal[k], pull)
        for c in range(t):
            balance[:, width * k + 1 + c] = cones.slips[k, c]
        firm = np.isinf(cones.capacity[k])
        rows += [-pull, pull + cones.pull[k] * share, -share, share] + ([] if firm else [p - cones.capacity[k] * share])
        upper += [0.0, cones.pull[k], 0.0, 1.0] + ([] if firm else [0.0])
        block = np.zeros((t + 1, n))
        block[0] = -p
        for c in range(t):
            block[1 + c, width * k + 1 + c] = -1.0
        round_ones.append(block)
    balance[:, -1] = -work
    cost = np.zeros(n)
    cost[-1] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(a), clarabel.NonnegativeConeT(len(rows))]
    kinds += [clarabel.SecondOrderConeT(t + 1)] * count
    matrix = sp.csc_matrix(np.vstack([balance, rows, *round_ones]))
    side = np.concatenate([np.zeros(a), upper, np.zeros((t + 1) * count)])
    found = clarabel.DefaultSolver(sp.csc_matrix((n, n)), cost, matrix, side, kinds, settings).solve()
    if "Infeasible" in str(found.status):  # no bound of the multiple
        return np.inf
    assert "Solved" in str(found.status)
    return float(found.x[-1])


def random_cones(rng: np.random.Generator) -> tuple[FrictionCones, Array]:
    """Points of a body in the plane or in space, firm, of some strength, or glued, and a load that presses it down."""
    dim = int(rng.integers(2, 4))
    a, count = (3, 6)[dim - 2], int(rng.integers(3, 7))
    at = rng.uniform(-1.0, 1.0, (count, dim))
    moves = np.zeros((count, dim, a))
    moves[:, :, :dim] = np.eye(dim)
    for column, (i, j) in enumerate([(0, 1), (0, 2), (1, 2)][: a - dim], start=dim):
        moves[:, i, column], moves[:, j, column] = -at[:, j], at[:, i]
    normal, slips = -moves[:, -1], rng.uniform(0.1, 1.0) * moves[:, :-1]
    capacity = np.where(rng.random(count) < 0.5, np.inf, rng.uniform(0.2, 2.0, count))
    pull = np.where(np.isinf(capacity) | (rng.random(count) < 0.6), 0.0, rng.uniform(0.0, 0.5, count))
    press = rng.uniform(0.0, 1.0, count)  # a load that forces inside of the cones balance, and some more
    work = normal.T @ (press * np.minimum(capacity, 1.0)) + 0.1 * rng.standard_normal(a)
    return FrictionCones(normal, slips, capacity, pull), work


@pytest.mark.parametrize("seed", sampled(range(60), 10))
def test_what_is_held_is_what_forces_of_the_cones_balance(seed: int) -> None:
    rng = np.random.default_rng([52, seed])
    cones, work = random_cones(rng)
    most = load_factor(cones, work)
    if most < 1e-3 or most > 1e3:
        return
    a = work.size
    for part, verdict in ((1.0 - 1e-5, Coercivity.HELD), (1.0 + 1e-5, Coercivity.FALLS)):
        load = part * most * work
        size = float(np.abs(load).sum())
        none = np.zeros(0)
        growth = RecessionFunction(
            load, size, np.zeros((0, a)), none, none, np.zeros((0, 2, a)), none, friction=cones
        )  # fmt: skip
        found = decide(growth)
        if part > 1.0 or np.linalg.matrix_rank(np.concatenate([cones.normal, *cones.slips.swapaxes(0, 1)])) == a:
            assert found.verdict is verdict, (most, found)


def test_the_samples_of_cones_are_of_both_kinds() -> None:
    factors = [load_factor(*random_cones(np.random.default_rng([52, seed]))) for seed in range(10)]
    assert sum(1e-3 < factor < 1e3 for factor in factors) >= 6


def test_a_cone_that_is_cut_off_takes_up_the_most_of_its_edges_by_hand() -> None:
    """With F = 3 and D = 5: 9 along v_n = 1 and mu v_t = 2, either way; where it opens by 2 it pulls by 10."""
    cones = FrictionCones(np.array([[1.0, 0.0]]), np.array([[[0.0, 1.0]]]), np.array([3.0]), np.array([5.0]))
    none = np.zeros(0)
    growth = RecessionFunction(
        np.zeros(2), 0.0, np.zeros((0, 2)), none, none, np.zeros((0, 2, 2)), none, friction=cones
    )  # fmt: skip
    for z, taken in (((1, 2), 9.0), ((1, -2), 9.0), ((-1, 2), 5.0), ((-1, 4), 9.0), ((-2, 1), 10.0), ((0, -1), 3.0)):
        assert growth(np.array(z, dtype=float))[0] == taken


def drawn_block(
    pull: tuple[float, ...], friction: Friction, normal: hv.laws.Superpotential | None = None
) -> hv.ContactProblem:
    space = len(pull) == 2
    mesh = hv.box((1.0, 1.0, 0.3), (2, 2, 1)) if space else hv.rectangle((2.0, 1.0), (4, 2))
    contact = {"bottom": hv.Contact(hv.Signorini() if normal is None else normal, friction)}
    return hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, tractions={"top": (*pull, -1.0)})


def along(angle: float, size: float) -> tuple[float, float]:
    return size * np.cos(angle), size * np.sin(angle)


@pytest.mark.parametrize("angle", sampled(np.radians([0.0, 10.0, 11.25, 22.5, 33.7, 60.0, 101.0, 190.0]).tolist(), 3))
def test_the_cone_is_round(angle: float) -> None:
    """Held up to the limit in every direction of the pull; beyond it the message gives the excess, not all friction."""
    for short in (1e-2, 2e-6):
        found = hv.discretize(drawn_block(along(angle, (1.0 - short) * MU), hv.Coulomb(MU)))
        assert BY_FRICTION in found.warnings
        assert found.balanced_by_friction
        assert not found.held
    for excess in (2e-6, 1e-4):
        with pytest.raises(hv.errors.SupportError, match="free to move: the loads exceed") as caught:
            hv.discretize(drawn_block(along(angle, (1.0 + excess) * MU), hv.Coulomb(MU)))
        (falls,) = re.findall(r"falls by ([\d.e+-]+) per", str(caught.value))
        assert 0.5 * excess * MU <= float(falls) <= 1.5 * excess * MU  # the motion has components of one at most


@pytest.mark.parametrize("dim", [2, 3])
def test_what_is_at_the_limit_of_friction_is_left_to_the_solve(dim: int) -> None:
    pull = (MU,) if dim == 2 else along(0.7, MU)
    found = hv.discretize(drawn_block(pull, hv.Coulomb(MU)))
    assert AT_LIMIT in found.warnings
    assert not found.balanced_by_friction
    assert not found.held


def test_the_ellipse_of_orthotropic_friction_holds() -> None:
    friction = OrthotropicFriction(CoulombBound(0.5), ratio=0.5, axis=(1.0, 0.0, 0.0))
    for pull in ((0.0, 0.24), (0.34, 0.17)):
        hv.discretize(drawn_block(pull, friction))
    for pull in ((0.51, 0.0), (0.36, 0.18)):
        with pytest.raises(hv.errors.SupportError, match="free to move"):
            hv.discretize(drawn_block(pull, friction))


BEDDINGS = {
    "softening": hv.Softening(10.0, 0.6, 1.0),
    "plateau": hv.laws.Capped(10.0, 0.6, 1.0),
    "smooth": hv.laws.FormulaLaw("6*(sqrt(max(r, 0)^2 + 0.36) - 0.6)"),
    "breaks": hv.laws.Capped(10.0, 0.6, 0.0),
}


@pytest.mark.parametrize("name", sampled(BEDDINGS, 4))
def test_a_foundation_of_some_strength_holds_by_friction(name: str) -> None:
    """As Tresca's law of a bound that the pressure nowhere falls short of; refused beyond the coefficient."""
    normal = BEDDINGS[name]
    found = hv.solve(drawn_block((0.1,), hv.Coulomb(0.5), normal))
    assert found.status is hv.Status.CONVERGED
    np.testing.assert_allclose(found.on("bottom").force, [-0.2, 2.0], rtol=1e-8)
    assert (NO_MINIMUM in found.warnings) is (name in ("softening", "breaks"))
    with pytest.raises(hv.errors.SupportError, match=r"falls by 0\.0002 per"):
        hv.discretize(drawn_block((0.5001,), hv.Coulomb(0.5), normal))


def test_a_foundation_bears_its_strength_and_no_more_beside_its_friction() -> None:
    """A pressure of one on a plateau of 1.02, and of 0.98."""
    found = hv.discretize(drawn_block((1e-3,), hv.Coulomb(0.5), hv.laws.Capped(10.0, 0.102, 1.0)))
    assert BY_FRICTION in found.warnings
    with pytest.raises(hv.errors.SupportError, match="free to move: the loads exceed"):
        hv.discretize(drawn_block((1e-3,), hv.Coulomb(0.5), hv.laws.Capped(10.0, 0.098, 1.0)))


def test_friction_that_weakens_holds_at_rest() -> None:
    """Between the kinetic and the static coefficient, as with a bound that does not depend on the pressure."""
    friction = hv.laws.StaticKinetic(CoulombBound(0.5), 0.01, 1.0, 0.4)
    found = hv.solve(drawn_block((0.45,), friction))
    assert found.status is hv.Status.CONVERGED
    np.testing.assert_allclose(found.on("bottom").force, [-0.9, 2.0], rtol=1e-8)
    assert np.abs(found.slip).max() < 0.01
    with pytest.raises(hv.errors.SupportError, match="free to move"):
        hv.discretize(drawn_block((0.55,), friction))
