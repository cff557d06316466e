"""Rounds of active sets in the compiled kernels against those in Python."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.kernels import kernels
from hemivar.laws.contact_chart import ContactChart, GraphTables
from hemivar.solvers.newton_on_graph import NewtonCache, _compiled_pairs, _Pair, _pairs, _Start
from hemivar.systems.compiled_rounds import CompiledRounds
from hemivar.systems.condensed import CondensedProblem, condense
from hemivar.systems.dense_newton import DenseNewton
from tests.samples import slow

built = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")


@pytest.fixture
def forget() -> Iterator[None]:
    """What is known of the library is found out anew, and forgotten at the end."""
    yield
    kernels.cache_clear()


LAWS = {
    "convex": hv.laws.ContactLaw(hv.laws.ThresholdCompliance(0.3, 2.0), hv.laws.Tresca(0.5)),
    "rigid": hv.laws.ContactLaw(hv.laws.Signorini(), hv.laws.Tresca(0.2)),
    "glue": hv.laws.ContactLaw(hv.laws.Adhesive(24.0, 0.05, 0.5, 0.2), hv.laws.Tresca(0.1)),
    "hills": hv.laws.ContactLaw(
        hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2, 0.5], [0.0, 3.0, -4.0, 1.0, 6.0], [0.0, -0.2, 0.0, 0.3])
    ),
    "weakening": hv.laws.ContactLaw(hv.laws.Compliance(3.0), hv.laws.SlipTable(0.4, [0.0, 0.1, 0.3], [1.0, 0.9, 0.2])),
    "soft": hv.laws.ContactLaw(hv.laws.Compliance(3.0), hv.laws.Tresca(0.2)),
    "hard soil": hv.laws.ContactLaw(hv.laws.ThresholdCompliance(0.1, 4.0)),
    "coulomb": hv.laws.ContactLaw(hv.laws.Signorini(), hv.laws.Coulomb(0.5)),
    "coulomb on soil": hv.laws.ContactLaw(hv.laws.ThresholdCompliance(0.1, 4.0), hv.laws.Coulomb(0.4)),
    "coulomb on glue": hv.laws.ContactLaw(hv.laws.Adhesive(24.0, 0.05, 0.5, 0.2), hv.laws.Coulomb(0.3)),
    "weakening coulomb": hv.laws.ContactLaw(
        hv.laws.Compliance(3.0), hv.laws.SlipTable(hv.laws.CoulombBound(0.4), [0.0, 0.1, 0.3], [1.0, 0.9, 0.2])
    ),
}


def small(law: str, m: int, d: int, seed: int, size: float = 1.0) -> CondensedProblem:
    """A body of a few contact points and unknowns beside them, loaded so that points lie on several pieces."""
    rng, n = np.random.default_rng(seed), m * d + 3
    root = rng.standard_normal((n, n))
    stiffness = size * (root @ root.T / n + np.eye(n) * rng.uniform(0.05, 2.0))
    trace = np.eye(m * d, n)
    own = LAWS[law] if d > 1 else hv.laws.ContactLaw(LAWS[law].normal)
    load = size * rng.normal(scale=0.5, size=n)
    weights, gap = rng.uniform(0.2, 2.0, m), rng.uniform(-0.1, 0.3, m)
    law_at = own.at(np.zeros((m, 2)))
    if size != 1.0:
        friction = own.friction if own.friction.state_dependent else hv.laws.Tresca(0.2 * size)
        law_at = replace(law_at, normal=law_at.normal.scaled(size), friction=friction).at(np.zeros((m, 2)))
    return condense(DiscreteProblem.of_arrays(stiffness, load, trace, weights, gap, law_at))


def start_of(system: CondensedProblem, r: Array, lam: Array, rounds: int = 12) -> tuple[_Start, NewtonCache]:
    cache = NewtonCache()
    equation = cache.equation(system)
    assert equation is not None
    return _Start(equation, r, lam, hv.Controls(rtol=1e-10), rounds), cache


def tables(start: _Start) -> GraphTables:
    chart = start.equation.chart
    assert isinstance(chart, ContactChart)
    known = chart.in_one
    assert known is not None
    return known[0]


def first(pairs: Iterator[_Pair]) -> _Pair | None:
    return next(pairs, None)


def both(system: CondensedProblem, r: Array, lam: Array, rounds: int = 12) -> tuple[_Pair | None, _Pair | None]:
    """What the rounds settle at in Python and in the kernels."""
    start, cache = start_of(system, r, lam, rounds)
    compiled = cache.compiled(system, start.equation.chart)
    assert compiled is not None
    return first(_pairs(start)), first(_compiled_pairs(start, compiled))


def agree(system: CondensedProblem, one: _Pair | None, other: _Pair | None) -> bool:
    """Whether both found the same in as many rounds, or both nothing; whether they found something is returned."""
    assert (one is None) == (other is None)
    if one is None or other is None:
        return False
    assert one[0] == other[0]
    scale = system.stretch(one[1]) + float(np.abs(one[1]).max())
    assert system.stretch(one[1] - other[1]) <= 1e-9 * scale
    np.testing.assert_allclose(other[2], one[2], atol=1e-9 * max(float(np.abs(one[2]).max()), 1e-300))
    return True


@built
@pytest.mark.parametrize(("seeds", "settling"), [(8, 2), slow(40, 20)])
@pytest.mark.parametrize("d", [1, 2])
@pytest.mark.parametrize("law", LAWS)
def test_rounds_are_those_of_python(law: str, d: int, seeds: int, settling: int) -> None:
    settled = 0
    for seed in range(seeds):
        m = (1, 2, 7, 30)[seed % 4]
        system, rng = small(law, m, d, seed), np.random.default_rng(seed + 1000)
        start = system.start()
        for size in (0.0, 0.05, 2.0):
            r = start + rng.normal(scale=size, size=start.shape) if size else start
            lam = rng.normal(scale=size, size=start.shape)
            settled += agree(system, *both(system, r, lam, rounds=3 if seed % 5 == 0 else 12))
    assert settled >= settling


@built
@pytest.mark.parametrize("law", LAWS)
def test_pairs_on_the_corner_of_a_graph_are_sorted_as_in_python(law: str) -> None:
    """The ends of every kink, to the last bit, and the numbers beside them."""
    system = small(law, 7, 2, 3)
    start, _ = start_of(system, system.start(), np.zeros((7, 2)))
    graphs = tables(start)
    for row in range(len(graphs.bounds)):
        knot = graphs.knots[row // 2]
        knot = np.where(np.isfinite(knot), knot, 0.0)
        for bound in (graphs.bounds[row], np.nextafter(graphs.bounds[row], np.inf)):
            pull = np.where(np.isfinite(bound), bound, 0.0)
            r, lam = knot.reshape(7, 2), (pull - graphs.stiffness * knot).reshape(7, 2)
            agree(system, *both(system, r, lam))


@built
def test_units_do_not_matter() -> None:
    for law in ("rigid", "soft", "coulomb"):
        expected = first_of(small(law, 7, 2, 11))
        for size in (2.0**300, 2.0**-300):
            found = first_of(small(law, 7, 2, 11, size))
            assert found[0] == expected[0]
            np.testing.assert_allclose(found[1], expected[1], rtol=1e-12)


def first_of(system: CondensedProblem) -> _Pair:
    found = both(system, system.start(), np.zeros(system.shape))[1]
    assert found is not None
    return found


@built
def test_what_is_not_finite_or_not_definite_is_given_up() -> None:
    system = small("convex", 7, 2, 0)
    for bad in (np.nan, np.inf, -np.inf):
        for which in range(2):
            pair = [system.start(), np.zeros((7, 2))]
            pair[which] = pair[which].copy()
            pair[which][3, 1] = bad
            assert both(system, *pair) == (None, None)
    soft = small("hills", 7, 1, 0)
    start, cache = start_of(soft, np.full((7, 1), 0.15), np.zeros((7, 1)))  # where the law falls
    loose = replace(soft, matrix=1e-6 * soft.matrix)
    compiled = cache.compiled(loose, start.equation.chart)
    assert compiled is not None
    equation = replace(start.equation, system=loose, equation=DenseNewton(loose))
    assert first(_compiled_pairs(replace(start, equation=equation), compiled)) is None
    assert first(_pairs(replace(start, equation=equation))) is None


@built
@pytest.mark.parametrize("law", LAWS)
def test_distances_to_the_graph_are_those_of_the_tables(law: str) -> None:
    system, rng = small(law, 30, 2, 5), np.random.default_rng(6)
    start, cache = start_of(system, system.start(), np.zeros((30, 2)))
    graphs, chart = tables(start), start.equation.chart
    compiled = cache.compiled(system, chart)
    assert compiled is not None
    knot = np.where(np.isfinite(graphs.knots[0]), graphs.knots[0], 0.0).reshape(30, 2)
    for r in (knot, rng.normal(scale=0.3, size=(30, 2)), np.where(rng.uniform(size=(30, 2)) < 0.5, knot, -0.1)):
        for lam in (rng.normal(size=(30, 2)), np.zeros((30, 2))):
            expected = norm(system.weights[:, None] * chart.graph_distance(r, lam, system.body.resilience))
            assert compiled.distance(r, lam) == pytest.approx(expected, rel=1e-13)
    assert np.isnan(compiled.distance(np.full((30, 2), np.nan), np.zeros((30, 2))))
    assert np.isnan(compiled.distance(np.zeros((30, 2)), np.full((30, 2), np.nan)))


@built
@pytest.mark.parametrize("data", ["5.1", "no friction", "coulomb", "no points"])
def test_solutions_and_steps_are_those_without_the_kernels(
    data: str, forget: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated = gallery.survey("5.1", 12, "right")
    if data == "no friction":
        stated = replace(stated, contact={"bottom": hv.Contact(hv.laws.Signorini())})
    if data == "coulomb":
        stated = replace(stated, contact={"bottom": hv.Contact(hv.laws.Compliance(50.0), hv.laws.Coulomb(0.3))})
    problem = hv.discretize(stated)
    if data == "no points":
        problem = DiscreteProblem.of_arrays(
            problem.stiffness, problem.load, np.zeros((0, problem.unknowns)), np.zeros(0), np.zeros(0), problem.law
        )
    evolution = hv.Evolution(
        replace(stated, material=replace(stated.material, density=1.0, viscosity=(0.4, 0.4))), inertia=True
    )
    found = {}
    for kind in ("none", "auto"):
        monkeypatch.setenv("HEMIVAR_KERNELS", kind)
        kernels.cache_clear()
        history = hv.march(evolution, 0.2, step=0.01)
        found[kind] = hv.solve(problem), history
    (one, slow), (other, quick) = found["none"], found["auto"]
    assert one.status is other.status is hv.Status.CONVERGED
    assert one.steps == other.steps
    change = one.unknowns - other.unknowns
    assert change @ (problem.stiffness @ change) <= 1e-18 * (one.unknowns @ (problem.stiffness @ one.unknowns))
    np.testing.assert_array_equal(slow["solver_steps"], quick["solver_steps"])
    np.testing.assert_allclose(quick["normal_force"], slow["normal_force"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(quick["elastic"], slow["elastic"], rtol=1e-9)


@built
def test_wrong_tables_and_pairs_are_refused_at_the_door() -> None:
    library, system = kernels(), small("convex", 7, 2, 0)
    assert library is not None
    start, _ = start_of(system, system.start(), np.zeros((7, 2)))
    law, matrix, weights, compliance = tables(start), system.matrix, system.weights, system.body.resilience
    for name in ("stiffness", "bounds", "anchor", "base", "slope", "knots", "low", "high"):
        table = getattr(law, name)
        for wrong in (table[..., :-1], table[1:], np.concatenate([table, table[:1]])):
            with pytest.raises(ValueError, match=r"table|components"):
                CompiledRounds(library, replace(law, **{name: wrong}), matrix, weights, compliance)
    ends = law.domain
    for other in (
        lambda: CompiledRounds(library, replace(law, domain=(ends[0][1:], ends[1])), matrix, weights, compliance),
        lambda: CompiledRounds(library, replace(law, shape=(14, 1)), matrix, weights, compliance),
        lambda: CompiledRounds(library, replace(law, curved=(None,)), matrix, weights, compliance),  # type: ignore[arg-type]
        lambda: CompiledRounds(library, law, matrix[1:], weights, compliance),
        lambda: CompiledRounds(library, law, matrix[:, 1:], weights, compliance),
        lambda: CompiledRounds(library, law, matrix, weights[1:], compliance),
        lambda: CompiledRounds(library, law, matrix, weights, compliance[1:]),
    ):
        with pytest.raises(ValueError, match=r"table|components|straight"):
            other()
    rounds = CompiledRounds(library, law, matrix, weights, compliance)
    r = np.zeros((7, 2))
    for load, place, lam in ((np.zeros(13), r, r), (np.zeros(14), r[1:], r), (np.zeros(14), r, r[:, :1])):
        with pytest.raises(ValueError, match="components are needed"):
            rounds.run(load, place, lam, 3, 0.0, 1e-9, 1.0)
    with pytest.raises(ValueError, match="components are needed"):
        rounds.distance(r, r[:1])
    with pytest.raises(TypeError, match="this process"):
        pickle.dumps(rounds)
    other = rounds.run(system.load[::-1][::-1], r.T.copy().T, r, 12, 0.0, 1e-9, 1.0)  # strides do not matter
    assert other is not None
    np.testing.assert_array_equal(other.r, rounds.run(system.load, r, r, 12, 0.0, 1e-9, 1.0).r)  # type: ignore[union-attr]
