"""The search by deflation: many places of the graph at once, and what one start finds is deflated for the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.deadline import Budget
from hemivar.branches.search import SolutionSearch
from hemivar.branches.state_chain import state_chain_of
from hemivar.laws import Friction, PenetrationBound, Superpotential
from hemivar.solvers import Controls, NonsmoothNewton, Status
from hemivar.systems.chain import Chain, chain_of


def uneven(x: hv.basics.types.Array) -> hv.basics.types.Array:
    """Another number at each contact point."""
    return np.asarray(1.0 + x[:, 0])


FOAM = hv.FormulaLaw("piecewise((0, r < 0), (0.05*(1 - (1 + r/0.02)*exp(-r/0.02)), True))")
FRICTIONS = {
    "formula": Friction(uneven, hv.FormulaLaw("r/(1 + 40*r)", even=True)),
    "Coulomb": hv.Coulomb(lambda x: 0.3 * uneven(x)),
    "penetration": hv.SlipWeakening(PenetrationBound(([0.0, 0.1], [0.1, 0.5])), 1.0, 0.5, 20.0),
}


def curves(normal: Superpotential, friction: Friction) -> Chain:
    problem = hv.discretize(
        hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 2),
            material=hv.Material.lame(4.0, 4.0),
            supports={"top": hv.Fixed(y=-0.07), "right": hv.Roller()},
            contact={"bottom": hv.Contact(normal, friction)},
            body_force=(0.5, -1.0),
        )
    )
    return (state_chain_of if problem.law.state_dependent else chain_of)(hv.systems.Workspace().condensed(problem))


@pytest.mark.parametrize("friction", FRICTIONS.values(), ids=FRICTIONS)
@pytest.mark.parametrize("normal", [FOAM, hv.Softening(lambda x: 60.0 * uneven(x), 0.02, 16.0)], ids=["foam", "soft"])
def test_many_places_at_once_are_each_place(normal: Superpotential, friction: Friction) -> None:
    chain = curves(normal, friction)
    theta = np.random.default_rng(3).normal(size=(5, chain.size)) * chain.length
    segment = chain.segment_of(theta)
    F, J = chain.balance(theta, segment, chain.force)
    for place, on, f, j in zip(theta, segment, F, J, strict=True):
        np.testing.assert_array_equal(on, chain.segment_of(place))
        one = chain.balance(place, on, chain.force)
        size = np.abs(one[0]).max() + np.abs(chain.force).max()
        np.testing.assert_allclose(f, one[0], rtol=0.0, atol=1e-12 * size)
        np.testing.assert_allclose(j, one[1], rtol=0.0, atol=1e-12 * np.abs(one[1]).max())
        np.testing.assert_allclose(f, chain.out_of_balance(place, on, chain.force), rtol=0.0, atol=1e-12 * size)


def search_of_a_spring() -> SolutionSearch:
    """kappa (r0 - r) = j'(r), which has three solutions."""
    law = hv.laws.ContactLaw(hv.Softening(stiffness=2.0, limit=0.1, softening=0.9)).at(None)
    spring = hv.DiscreteProblem.of_arrays([[0.5]], [0.225], [[1.0]], [1.0], [0.0], law)
    kept = hv.systems.Workspace()
    system = kept.condensed(spring)
    random, budget = np.random.default_rng(0), Budget(np.inf)
    return SolutionSearch(system, kept, chain_of(system), Controls(), 100, random, budget)


def test_what_one_start_finds_is_deflated_for_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """All starts at one place find several: kappa (r0 - r) = j'(r) has three solutions by hand."""
    monkeypatch.setattr(SolutionSearch, "_on_graph", lambda search, k: np.array([0.05]))
    search = search_of_a_spring()
    assert sum(1 for _ in search.from_deflation(10)) == search.starts == 20
    found = np.array([solution.local[0, 0] for solution in search.solutions])
    assert len(found) > 1
    by_hand = np.array([0.5 * 0.45 / 2.5, (0.5 * 0.45 - 0.29) / (0.5 - 0.9), 0.45])
    assert np.abs(found[:, None] - by_hand).min(axis=1).max() < 1e-9


def test_a_start_that_is_lost_is_not_solved_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solve that ends without an equilibrium at a rough tolerance has none at a finer one."""
    tolerances = list[float]()

    def lost(problem: hv.DiscreteProblem, solver: object, controls: Controls, **kept: object) -> hv.Solution:
        tolerances.append(controls.rtol)
        return replace(hv.solve(problem), status=Status.NOT_CARRIED)

    search = search_of_a_spring()
    monkeypatch.setattr("hemivar.branches.search.solve", lost)
    search.run(NonsmoothNewton(), np.zeros((1, 1)))
    assert len(tolerances) == 1
    assert not search.solutions
