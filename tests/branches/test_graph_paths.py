"""Paths in Minty's chart: coupled laws, bodies in space, Coulomb's law; bifurcations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.branches import follow, follow_path
from hemivar.branches.graph_chart import chart_of
from hemivar.branches.path import PathEnd
from hemivar.laws import ContactLaw, VectorLaw
from hemivar.laws.vector_law import OnGraph
from hemivar.systems import condense
from tests.bodies import points_on_springs
from tests.samples import sampled, slow

from .test_path_peel import load_where, pair

L = hv.laws


def glue_on_a_line(alpha: float, strength: float = 2.4, stiffness: float = 24.0, ratio: float = 1.0) -> VectorLaw:
    """Mixed-mode glue on a line that falls by alpha."""
    onset = strength / stiffness
    energy = 0.5 * strength * (onset + strength / alpha)
    return L.MixedMode(L.BilinearCohesion(strength=strength, energy=energy, stiffness=stiffness), ratio=ratio)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize("components", [2, 3])
def test_a_point_of_glue_on_a_spring_turns_where_the_closed_form_does(
    unit: float, angle: float, components: int
) -> None:
    """Spring 12, glue 24 up to .1, falling by 36: at rho = .1 the far end is at .3, at the break 1/6 at 1/6."""
    way = np.zeros(components)
    way[:2] = -np.cos(angle), np.sin(angle)
    law = glue_on_a_line(36.0 / unit, stiffness=24.0 / unit)
    problem = points_on_springs(np.eye(components) * 12.0 / unit, 12.0 * way, law, components)
    path = follow_path(problem, (0.0, 0.5))
    np.testing.assert_allclose([fold.load_factor for fold in path.folds], [0.3, 1.0 / 6.0], rtol=1e-9)
    np.testing.assert_allclose(path.local[[f.index for f in path.folds], 0] @ way, [0.1 * unit, unit / 6.0], rtol=1e-8)
    assert path.reached_end
    assert path.first_instability == pytest.approx(0.3, rel=1e-9)
    assert not path.bifurcations
    np.testing.assert_allclose(path.local[-1, 0] @ way, 0.5 * unit, rtol=1e-9)
    up, down = path.jumps
    assert up.local is not None
    assert down.local is not None
    np.testing.assert_allclose(up.local[0] @ way, 0.3 * unit, rtol=1e-8)
    np.testing.assert_allclose(down.local[0] @ way, unit * 12.0 / 36.0 / 6.0, rtol=1e-8)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_two_points_branch_at_the_corner_where_the_other_mode_loses_its_stiffness(unit: float) -> None:
    """A body that turns more easily than it is pulled, [[k, c], [c, k]], and glue that falls by alpha.

    As ``k - c < alpha < k + c``, the load goes on to grow while both points soften, from onset to break together.
    """
    stiffness = np.kron([[12.0, 6.0], [6.0, 12.0]], np.eye(2)) / unit
    law = glue_on_a_line(10.0 / unit, stiffness=24.0 / unit)
    path = follow_path(points_on_springs(stiffness, np.array([-1.0, 0.0, -1.0, 0.0]), law, 2), (0.0, 10.0))
    assert not path.perturbed
    assert not path.folds
    onset, broken = 18.0 * 0.1 + 2.4, 18.0 * 0.34
    assert path.first_instability == pytest.approx(onset, rel=1e-8)
    np.testing.assert_allclose([b.load_factor for b in path.bifurcations], [onset, broken], rtol=1e-8)
    assert "2 bifurcations" in repr(path)


@pytest.mark.parametrize(
    ("largest_step", "curves"), [(0.02, "scalar"), (0.2, "scalar"), (0.2, "chart"), slow(0.02, "chart")]
)
def test_two_points_branch_on_a_curve_where_the_other_mode_loses_its_stiffness(
    largest_step: float, curves: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if curves == "chart":
        monkeypatch.setattr(follow, "_curves", lambda system, begun: chart_of(system, begun.local, begun.multiplier))
    path = follow_path(pair(6.0, 4.5), (0.0, 20.0), largest_step=largest_step)
    loads = [load_where(-1.5, 10.5), load_where(-1.5, 10.5, again=True)]
    assert not path.folds
    np.testing.assert_allclose([b.load_factor for b in path.bifurcations], loads, rtol=1e-6)
    assert path.first_instability == pytest.approx(loads[0], rel=1e-6)


@pytest.mark.parametrize("seed", sampled(range(60), 20))
def test_the_chart_finds_the_path_of_the_scalar_curves(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two followers that share neither the numbers along the graph nor the way to find corners."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 5))
    spread = random.normal(size=(n, n))
    law = L.Softening(stiffness=60.0, limit=0.02, softening=float(random.uniform(2.0, 40.0)))
    stiffness = spread @ spread.T / n * 10.0 + 4.0 * np.eye(n)
    problem = points_on_springs(stiffness, random.uniform(0.1, 1.0, n), ContactLaw(law), 1)
    one = follow_path(problem, (0.0, 2.0))
    monkeypatch.setattr(follow, "_curves", lambda system, begun: chart_of(system, begun.local, begun.multiplier))
    other = follow_path(problem, (0.0, 2.0))
    folds = [[fold.load_factor for fold in path.folds] for path in (one, other)]
    np.testing.assert_allclose(folds[1], folds[0], rtol=1e-8)
    assert one.ended is other.ended
    for path in (one, other):
        assert not path.bifurcations  # nothing is alike
    np.testing.assert_allclose(other.local[-1], one.local[-1], rtol=1e-9)
    crossings = [path.at(1.0) for path in (one, other)]
    assert [stable for _, stable in crossings[0]] == [stable for _, stable in crossings[1]]
    for (r, _), (s, _) in zip(*crossings, strict=True):
        np.testing.assert_allclose(r, s, atol=1e-9)


FRICTIONS = {
    "none": None,
    "tresca": L.Tresca(0.05),
    "coulomb": L.Tresca(L.CoulombBound(0.3)),
    "penetration": L.Tresca(L.PenetrationBound(([0.0, 1.0], [0.0, 0.5]))),
}
NORMALS = [L.Signorini(), L.Compliance(20.0), L.Softening(stiffness=60.0, limit=0.02, softening=1.0)]


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("normal", range(3))
def test_the_end_of_a_path_in_space_is_the_solution(normal: int, friction: str) -> None:
    rubs = FRICTIONS[friction]
    contact = hv.Contact(NORMALS[normal]) if rubs is None else hv.Contact(NORMALS[normal], rubs)
    problem = hv.ContactProblem(
        mesh=hv.box((1.0, 1.0, 1.0), 2),
        material=hv.Material.lame(4.0, 4.0),
        contact={"bottom": contact},
        supports={"top": hv.Prescribed((0.03, 0.01, -0.08))},
    )
    path = follow_path(problem)
    solved = hv.solve(problem, controls=hv.Controls(rtol=1e-12))
    assert path.load_factor[-1] == 1.0
    assert path.stable.all()
    assert not path.folds
    np.testing.assert_allclose(path.local[-1], solved.local, atol=1e-7 * np.abs(solved.local).max())


def equilibrium_error(path: hv.branches.Path, stiffness: np.ndarray, load: np.ndarray) -> float:
    """What is out of balance at the points of a path of :func:`arrays`, and what is off the graph of the law."""
    law, off = path.problem.law, 0.0
    for t, r, lam in zip(path.load_factor, path.local, path.multiplier, strict=True):
        here = law.frozen(r, lam)
        off = max(off, float(np.abs(stiffness @ r.ravel() + lam.ravel() - t * load).max()))
        off = max(off, float(here.graph_distance(r, lam, np.full((len(r), 2), 1.0 / 12.0)).max()))
    return off


@pytest.mark.parametrize("seed", sampled(range(100), (20, 50, 90)))
def test_random_paths_of_coupled_glue_are_equilibria_and_end_at_solutions(seed: int) -> None:
    random = np.random.default_rng(seed)
    points, components = int(random.integers(1, 4)), int(random.integers(2, 4))
    n = points * components
    spread = random.normal(size=(n, n))
    stiffness = spread @ spread.T / n * 8.0 + 4.0 * np.eye(n)
    load = random.normal(size=n) * 3.0
    load[::components] = -np.abs(load[::components])
    law = glue_on_a_line(float(random.uniform(4.0, 60.0)), ratio=float(random.uniform(0.5, 2.0)))
    path = follow_path(points_on_springs(stiffness, load, law, components), (0.0, 4.0), max_points=3000)
    assert path.reached_end, path.ended
    assert equilibrium_error(path, stiffness, load) <= 1e-8
    t = path.load_factor
    t = t[np.append(True, np.abs(np.diff(t)) > 1e-9)]  # rounding turns nothing
    turns = [t[i] for i in range(1, t.size - 1) if (t[i] - t[i - 1]) * (t[i + 1] - t[i]) < 0.0]
    assert turns == pytest.approx([fold.load_factor for fold in path.folds], abs=1e-8)


def test_contact_points_that_a_support_holds_in_part_are_followed() -> None:
    """Rollers at both sides hold the slip of the outer points; every column opens alone, as the closed form says."""
    block = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 3),
        material=hv.Material.lame(4.0, 4.0),
        contact={"bottom": hv.Contact(glue_on_a_line(6.0))},
        supports={"left": "roller", "right": "roller", "top": hv.Fixed(x=0.0, y=0.4)},
    )
    path = follow_path(block)
    # a column of stiffness 12: w = .3, traction 1.2
    np.testing.assert_allclose(path.local[-1][:, 0], -0.3, rtol=1e-9)
    np.testing.assert_allclose(path.multiplier[-1][:, 0], -1.2, rtol=1e-9)
    assert path.stable.all()
    assert not path.folds


# ---- the end of a path at a value ------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize(("name", "value", "load"), [("max-opening", 0.15, 0.2), ("normal-force", -1.2, 0.1 + 0.05)])
def test_a_path_ends_where_a_quantity_has_its_value(unit: float, name: str, value: float, load: float) -> None:
    """Softening, u = .15 carries .6: 12 (t - .15) = .6.  Before onset 24 u = 1.2 gives 12 (t - .05) = 1.2."""
    problem = points_on_springs(
        np.eye(2) * 12.0 / unit, np.array([-12.0, 0.0]), glue_on_a_line(36.0 / unit, stiffness=24.0 / unit), 2
    )
    size = unit if name == "max-opening" else 1.0
    path = follow_path(problem, (0.0, 0.5), until={name: value * size})
    assert path.ended is PathEnd.UNTIL
    assert path.load_factor[-1] == pytest.approx(load, rel=1e-10)
    r, lam = path.local[-1], path.multiplier[-1]
    found = -r[0, 0] if name == "max-opening" else lam[0, 0]
    assert found == pytest.approx(value * size, rel=1e-10)
    assert len(path.folds) == (name == "max-opening")
    assert path.limit_load is None


@pytest.mark.parametrize("curves", ["scalar", "chart"])
def test_the_value_of_an_end_is_met_on_curved_pieces(curves: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if curves == "chart":
        monkeypatch.setattr(follow, "_curves", lambda system, begun: chart_of(system, begun.local, begun.multiplier))
    whole = follow_path(pair(6.0, 4.5), (0.0, 20.0), largest_step=0.1)
    value = 0.37 * float(whole.max_penetration[-1])
    path = follow_path(pair(6.0, 4.5), (0.0, 20.0), until={"max-penetration": value}, largest_step=0.1)
    assert path.max_penetration[-1] == pytest.approx(value, rel=1e-10)
    assert path.ended is PathEnd.UNTIL


@pytest.mark.parametrize(("where", "load"), [("left", 0.3), ("right", 0.15)])
def test_a_path_ends_where_one_boundary_has_its_value(where: str, load: float) -> None:
    """Two bars on springs of 4 and 12 that are pulled by ends that move alike: u = 12 t / (12 + k)."""
    bars = {side: hv.rectangle((1.0, 1.0), 1, origin=(at, 0.0)) for side, at in (("left", 0.0), ("right", 2.0))}
    springs = {"left": hv.laws.BilinearCohesion(1e3, 1e6, 4.0), "right": hv.laws.BilinearCohesion(1e3, 1e6, 12.0)}
    contact = {f"{side}:bottom": hv.Contact(law) for side, law in springs.items()}
    mesh = hv.Mesh.assembled(bars)
    supports = {f"{side}:top": hv.Prescribed((0.0, 1.0)) for side in ("left", "right")}
    supports |= {f"{side}:{edge}": hv.Roller() for side in ("left", "right") for edge in ("left", "right")}
    problem = hv.ContactProblem(mesh, hv.Material.young(12.0, 0.0), contact, supports)
    ends = {"left": 0.75 * load, "right": 0.5 * load}
    path = follow_path(problem, until={f"opening:{where}:bottom": ends[where]})
    assert path.load_factor[-1] == pytest.approx(load, rel=1e-9)
    with pytest.raises(hv.errors.ProblemError, match="no contact boundary 'lef'"):
        follow_path(problem, until={"slip:lef": 1.0})


def test_values_of_an_end_are_refused_before_any_work() -> None:
    with pytest.raises(hv.errors.ProblemError, match=r"'max-openin', which is not known; did you mean 'max-opening'"):
        follow_path(pair(6.0, 4.5), until={"max-openin": 1.0})
    with pytest.raises(hv.errors.ProblemError, match="finite"):
        follow_path(pair(6.0, 4.5), until={"max-opening": np.inf})


@pytest.mark.parametrize("seed", range(6))
def test_falling_directions_of_a_law_of_the_state_are_counted_as_by_eigenvalues(seed: int) -> None:
    """Against the eigenvalues of the derivative of all forces by differences, of elastic and softening points."""
    rng = np.random.default_rng(seed)
    n, components = 8, 2
    root = rng.normal(size=(n, n))
    stiffness = root @ root.T + 8.0 * np.eye(n)
    criterion = L.BenzeggaghKenane(0.3, 0.6, 1.5)
    law = L.ModeDependentGlue(4.0, 4.5, 40.0, criterion, compression=hv.Compliance(100.0))
    system = condense(points_on_springs(stiffness, np.ones(n), law, components))
    r = -0.1 * rng.uniform(0.2, 2.0, (n // components, components))
    chart = chart_of(system, r, system.law.nearest_multiplier(r, np.zeros_like(r)))
    theta, side = chart.nearest(r, system.law.nearest_multiplier(r, np.zeros_like(r)))

    def pulled(x: np.ndarray) -> np.ndarray:
        at = x.reshape(r.shape)
        return system.law.nearest_multiplier(at, np.zeros_like(at)).ravel()

    little = 1e-7 * np.eye(n)
    slopes = np.array([(pulled(r.ravel() + one) - pulled(r.ravel() - one)) / 2e-7 for one in little]).T
    for scale in (0.02, 0.3, 1.0):  # a soft body has more falling directions than a stiff one
        own = replace(chart, system=condense(points_on_springs(scale * stiffness, np.ones(n), law, components)))
        falling = np.linalg.eigvals(scale * stiffness + slopes).real
        assert own.negative(theta, side) == int((falling < 0.0).sum())


def test_a_step_asks_no_more_of_a_curved_law_than_it_must(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the end of a step has told is not asked again where the next one begins, nor for the points of the path."""
    calls: list[int] = []
    on_graph = L.MixedMode.on_graph

    def counted(law: L.MixedMode, p: np.ndarray, a: np.ndarray) -> OnGraph:
        calls.append(len(p))
        return on_graph(law, p, a)

    monkeypatch.setattr(L.MixedMode, "on_graph", counted)
    problem = points_on_springs(np.diag([12.0, 9.0]), np.array([-12.0, 4.0]), glue_on_a_line(36.0, ratio=0.7), 2)
    path = follow_path(problem, (0.0, 2.0), largest_step=2e-3)
    assert int(path.curved.sum()) >= 30
    assert len(calls) <= 9 * len(path)


def test_points_that_stick_have_a_diagonal_column_and_the_rest_is_the_difference_of_forces() -> None:
    """Half of the points of the survey's cube stick."""
    problem = hv.discretize(hv.gallery.survey_cube("5.1", 2))
    chart = chart_of(condense(problem), *np.zeros((2, *condense(problem).shape)))
    theta = chart.length * np.where(np.arange(chart.size // 3)[:, None] % 2, 1e-3, [0.3, 40.0, 30.0]).ravel()
    force, step = chart.load_of(chart.system), 1e-6 * chart.length
    _, J = chart.balance(theta, chart.here, force)
    shifts = step * np.eye(chart.size)
    forth, back = (
        np.array([chart.out_of_balance(theta + sign * s, chart.here, force) for s in shifts]) for sign in (1.0, -1.0)
    )
    np.testing.assert_allclose(J, (forth - back).T / (2.0 * step), atol=1e-7 * np.abs(J).max())
    still = ~chart.moving(theta, chart.here)
    assert 0 < still.sum() < still.size
    np.testing.assert_array_equal(J[:, still], np.diag(np.diagonal(J))[:, still])
