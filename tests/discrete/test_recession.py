"""Whether contact holds a body along its motions without deformation: by another solver, turned, in other units."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from hemivar.discrete.free_motion import free_growth
from hemivar.discrete.recession import Coercivity, RecessionFunction, decide, growth_along
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Compliance, ContactLaw, FormulaLaw, NoContact, Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import Contact, ContactProblem, Material, Roller
from hemivar.mesh import Mesh, box, rectangle
from tests import bodies
from tests.samples import slow

clarabel = pytest.importorskip("clarabel")


def least_growth(growth: RecessionFunction) -> float:
    """The least growth on the surface of the unit box, by conic programmes of another solver; inf if all is held."""
    a, q, p = growth.work.size, len(growth.up), len(growth.rates)
    n = a + q + p
    cost = np.concatenate([-growth.work, np.ones(q), growth.rates])
    rows = [np.concatenate([sign * np.eye(a)[i], np.zeros(q + p)]) for i in range(a) for sign in (1.0, -1.0)]
    right = [1.0] * (2 * a)
    for j in range(q):
        for rate, sign in ((growth.up[j], 1.0), (growth.down[j], -1.0)):
            row = np.zeros(n)
            row[:a] = growth.rows[j] * sign * (1.0 if np.isposinf(rate) else rate)
            row[a + j] = 0.0 if np.isposinf(rate) else -1.0
            rows.append(row)
            right.append(0.0)
    cones = []
    for k in range(p):
        block = np.zeros((3, n))
        block[0, a + q + k] = -1.0
        block[1:, :a] = -growth.cones[k]
        cones.append(block)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(1), clarabel.NonnegativeConeT(len(rows)), *([clarabel.SecondOrderConeT(3)] * p)]
    least = np.inf
    for face, sign in itertools.product(range(a), (1.0, -1.0)):
        at = np.zeros((1, n))
        at[0, face] = 1.0
        matrix = sp.csc_matrix(np.vstack([at, rows, *cones]))
        side = np.concatenate([[sign], right, np.zeros(3 * p)])
        found = clarabel.DefaultSolver(sp.csc_matrix((n, n)), cost, matrix, side, kinds, settings).solve()
        if "Infeasible" not in str(found.status):
            assert "Solved" in str(found.status)
            least = min(least, found.obj_val)
    return float(least)


def random_growth(rng: np.random.Generator) -> RecessionFunction:
    a, q = int(rng.integers(1, 7)), int(rng.integers(1, 12))
    p = int(rng.integers(0, 6)) if a > 3 else 0
    up = 2.0 * rng.random(q)
    down = rng.random(q) * rng.choice([0.0, 1.0, -0.3], q)
    up = np.maximum(up, -down)
    up[rng.random(q) < 0.3] = np.inf
    work = rng.standard_normal(a) * rng.choice([0.1, 1.0, 3.0])
    rows, cones = rng.standard_normal((q, a)), rng.standard_normal((p, 2, a))
    return RecessionFunction(work, float(np.abs(work).sum()), rows, up, down, cones, rng.random(p))


@pytest.mark.parametrize(("growths", "least_seen"), [(20, 5), slow(120, 30)])
def test_programme_agrees_with_another_solver(growths: int, least_seen: int) -> None:
    rng = np.random.default_rng(5)
    seen = {Coercivity.HELD: 0, Coercivity.FALLS: 0}
    for _ in range(growths):
        growth = random_growth(rng)
        hold, least = decide(growth), least_growth(growth)
        assert abs(least) > 1e-7
        assert hold.verdict is (Coercivity.HELD if least > 0.0 else Coercivity.FALLS)
        seen[hold.verdict] += 1
        if hold.direction is not None:
            assert growth(hold.direction)[0] == hold.growth < 0.0
            assert np.linalg.norm(hold.direction) == pytest.approx(1.0)
    assert min(seen.values()) > least_seen


def test_many_rigid_points() -> None:
    """More conditions than are taken up at first: the others must be found where they are violated."""
    rng = np.random.default_rng(11)
    seen = {Coercivity.HELD: 0, Coercivity.FALLS: 0}
    for _ in range(12):
        a = int(rng.integers(3, 7))
        rows = rng.standard_normal((300, a))
        rows[:, 0] = -np.abs(rows[:, 0]) - 0.5  # all let the body move along the first axis, and a cone around it
        work = -rng.random(a) * rng.choice([-0.2, 0.2, 1.0], a)
        work[0] = -rng.random()
        growth = RecessionFunction(
            work, float(np.abs(work).sum()), rows, np.full(300, np.inf), np.zeros(300), np.zeros((0, 2, a)), np.zeros(0)
        )
        least = least_growth(growth)
        assert abs(least) > 1e-6
        verdict = decide(growth).verdict
        assert verdict is (Coercivity.HELD if least > 0.0 else Coercivity.FALLS)
        seen[verdict] += 1
    assert min(seen.values()) > 0


@pytest.mark.parametrize("growths", [2, slow(10)])
def test_load_at_the_edge_of_what_holds(growths: int) -> None:
    """The load is raised to where the other solver sees the least growth turn its sign; next to it verdicts differ."""
    rng = np.random.default_rng(6)
    done = 0
    while done < growths:
        growth = random_growth(rng)
        if growth.work.size < 2 or not 0.0 < least_growth(growth) < np.inf:
            continue

        def under(times: float, growth: RecessionFunction = growth) -> RecessionFunction:
            return replace(growth, work=times * growth.work, load=times * growth.load)

        low, high = 1.0, 64.0
        if least_growth(under(high)) > 0.0:
            continue
        while high - low > 1e-5 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if least_growth(under(middle)) > 0.0 else (low, middle)
        assert decide(under(0.9999 * low)).verdict is Coercivity.HELD
        assert decide(under(1.0001 * high)).verdict is Coercivity.FALLS
        done += 1


def test_laws_that_pull_the_less_the_farther_they_open() -> None:
    """Hinges with up + down < 0: the growth is concave there; every sign of every row is looked at."""
    rng = np.random.default_rng(7)
    seen = {Coercivity.HELD: 0, Coercivity.FALLS: 0}
    for _ in range(60):
        a, q = int(rng.integers(2, 4)), int(rng.integers(2, 7))
        rows = rng.standard_normal((q, a))
        up, down = 3.0 * rng.random(q), 3.0 * rng.random(q)
        down[:2] = -up[:2] - 0.3 * rng.random(2)
        work = 0.05 * rng.standard_normal(a)
        growth = RecessionFunction(work, float(np.abs(work).sum()), rows, up, down, np.zeros((0, 2, a)), np.zeros(0))
        least = np.inf
        for signs in itertools.product((1.0, -1.0), repeat=2):  # on each sign pattern the growth is convex
            linear = work - sum((up[j] if signs[j] > 0.0 else -down[j]) * rows[j] for j in range(2))
            wall_up = np.concatenate([[np.inf if signs[j] < 0.0 else 0.0 for j in range(2)], up[2:]])
            wall_down = np.concatenate([[np.inf if signs[j] > 0.0 else 0.0 for j in range(2)], down[2:]])
            part = RecessionFunction(linear, growth.load, rows, wall_up, wall_down, growth.cones, growth.rates)
            least = min(least, least_growth(part))
        verdict = decide(growth).verdict
        assert verdict is (Coercivity.HELD if least > 0.0 else Coercivity.FALLS)
        seen[verdict] += 1
    assert min(seen.values()) > 3


def random_statement(mesh: Mesh, matrix: np.ndarray, seed: int, units: float = 1.0) -> ContactProblem:
    """A random body, turned by a matrix, in other units of length and force."""
    rng = np.random.default_rng(seed)
    dim = mesh.dim
    names = sorted(mesh.boundaries)
    rng.shuffle(names)
    force = 2.0 * rng.standard_normal(dim) * rng.choice([0.1, 1.0])
    torque = rng.standard_normal(dim)
    stress = units**3
    laws = {
        "rigid": Signorini(),
        "bounded": ThresholdCompliance(0.8 * stress, 0.0),
        "soft": Compliance(2.0 * stress),
        "none": NoContact(),
    }
    contact, supports = {}, {}
    for name in names[: int(rng.integers(1, 2 * dim))]:
        kind = str(rng.choice(list(laws)))
        friction = float(rng.choice([0.0, 0.3, 1.5])) * stress
        contact[name] = Contact(laws[kind], Tresca(friction))
    for name in names[len(contact) :][: int(rng.integers(0, 2))]:
        supports[name] = Roller()
    turned = mesh.moved(matrix, 0.3).scaled(units)

    def body_force(x: np.ndarray) -> np.ndarray:
        upright = (x / units - 0.3) @ matrix
        return stress / units * (force + torque * upright[:, ::-1]) @ matrix.T

    return ContactProblem(turned, Material.lame(stress, stress), contact, supports, body_force=body_force)


def turned_by(dim: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    if dim == 3:
        return np.asarray(Rotation.random(random_state=seed).as_matrix())
    c, s = np.cos(angle := rng.uniform(0.0, 6.3)), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def free_to_move(problem: ContactProblem) -> bool:
    try:
        discretize(problem)
    except ProblemError as error:
        return "free to move" in str(error)
    return False


@pytest.mark.parametrize(("dim", "seeds", "least_seen"), [(2, 12, 0), (3, 12, 0), slow(2, 120, 15), slow(3, 60, 15)])
def test_turned_bodies_fly_off_as_the_upright_ones_do(dim: int, seeds: int, least_seen: int) -> None:
    mesh = rectangle((1.0, 1.4), (3, 4)) if dim == 2 else box((1.0, 1.4, 0.8), (2, 2, 2))
    count = {True: 0, False: 0}
    for seed in range(seeds):
        problem = random_statement(mesh, turned_by(dim, seed), seed)
        upright = discretize(random_statement(mesh, np.eye(dim), seed), check_coercivity=False)
        assert upright.field is not None
        growths = free_growth(upright, upright.model.free_motions)
        least = min((least_growth(growth) for growth in growths), default=np.inf)
        if least < 1e-6 and least > -1e-6:
            continue  # nothing holds it, nothing pushes it: refused in words, tested elsewhere
        assert free_to_move(problem) is (least < 0.0), seed
        assert free_to_move(random_statement(mesh, turned_by(dim, seed), seed, units=1e-3)) is (least < 0.0), seed
        count[least < 0.0] += 1
    assert min(count.values()) > least_seen


@pytest.mark.parametrize("angle", [0.0, 0.05, 0.3, 2.0])
def test_sliding_without_friction_is_in_balance_in_every_frame(angle: float) -> None:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for far in (0.0, 1e4):
        mesh = rectangle((1.0, 1.0), 3).moved(turn, far)
        problem = ContactProblem(
            mesh, Material.lame(1, 1), {"bottom": Contact(Signorini())}, body_force=tuple(turn @ (0.0, -1.0))
        )
        with pytest.raises(ProblemError, match="in balance"):
            discretize(problem)


@pytest.mark.parametrize("bound", [1e6, 1e9, 1e12])
@pytest.mark.parametrize("dim", [2, 3])
def test_friction_far_above_the_load_holds(bound: float, dim: int) -> None:
    """It keeps the body from sliding, not from tipping; neither is lost beside the other."""
    mesh = rectangle((1.0, 1.0), 4) if dim == 2 else box((1.0, 1.0, 1.0), (3, 3, 3))
    turn = turned_by(dim, 3)
    contact = {"bottom": Contact(Signorini(), Tresca(bound))}
    for push, held in ((0.3, True), (1.1, False)):
        load = turn @ ((push, -1.0) if dim == 2 else (push, 0.1, -1.0))
        problem = ContactProblem(mesh.moved(turn), Material.lame(1, 1), contact, body_force=tuple(load))
        if held:
            discretize(problem)
        else:
            with pytest.raises(ProblemError, match=r"along the rigid motion .*rotation"):
                discretize(problem)


def test_ten_thousand_contact_points_take_a_moment() -> None:
    rng = np.random.default_rng(1)
    local = rng.standard_normal((10_000, 3, 6))
    law = ContactLaw(Compliance(1.0), Tresca(0.1)).at(None)
    work = 0.5 * 10_000 * 0.1 * rng.standard_normal(6) / 3.0
    growth = growth_along(law, local, np.ones(10_000), work, float(np.abs(work).sum()))
    assert decide(growth).verdict in (Coercivity.HELD, Coercivity.FALLS)


def test_a_law_that_falls_without_end_is_not_said_to_hold() -> None:
    falling = FormulaLaw("-0.5 * r^2")
    problem = bodies.square(falling, 2, lame=(1, 1), supports={}, body_force=(0.0, -1.0))
    with pytest.raises(ProblemError, match="free to move"):
        discretize(problem)


@pytest.mark.parametrize(
    ("cones", "growths", "least_seen"), [(False, 10, 0), (True, 10, 0), slow(False, 50, 5), slow(True, 50, 5)]
)
def test_verdicts_on_random_growths_by_sampling_every_direction(cones: bool, growths: int, least_seen: int) -> None:
    """Two motions: convex hinges, concave ones, forbidden sides; what is said agrees with a fine circle."""
    rng = np.random.default_rng(17 + cones)
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    seen = dict.fromkeys(Coercivity, 0)
    for _ in range(growths):
        q, p = int(rng.integers(1, 6)), int(rng.integers(0, 3)) if cones else 0
        up, down = rng.normal(0.6, 1.0, q), rng.normal(0.6, 1.0, q)
        up[rng.random(q) < 0.2] = np.inf
        work = rng.normal(size=2) * rng.choice([0.0, 0.5, 1.0])
        growth = RecessionFunction(
            work, float(np.abs(work).sum()), rng.normal(size=(q, 2)), up, down,
            rng.normal(size=(p, 2, 2)), rng.uniform(0.0, 1.0, p),
        )  # fmt: skip
        least = min(growth(z)[0] for z in circle)
        found = decide(growth)
        seen[found.verdict] += 1
        if found.verdict is Coercivity.HELD:
            assert least > 0.0
        elif found.verdict is Coercivity.FALLS:
            assert found.direction is not None
            assert growth(found.direction)[0] < 0.0
            assert found.growth == pytest.approx(growth(found.direction)[0])
        if least < -1e-2:
            assert found.verdict is Coercivity.FALLS
        if least > 0.1:
            assert found.verdict in (Coercivity.HELD, Coercivity.UNDECIDED)
    assert seen[Coercivity.HELD] > least_seen
    assert seen[Coercivity.FALLS] > least_seen
