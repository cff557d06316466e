"""What a workspace spares certificates, searches and paths, and that it changes none of their answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar.certificates import energy_norm, norms, smallness
from hemivar.discrete import DiscreteProblem, Model, Space
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.loading import Loading
from hemivar.systems import Workspace, body_on_levels, elimination
from tests.problems import bar, square

STATEMENT = square(n=6)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """One entry for each factorisation and each hierarchy."""
    calls: list[str] = []

    def watch(owner: object, name: str, what: str) -> None:
        original = getattr(owner, name)

        def counting(*arguments: object, **options: object) -> object:
            calls.append(what)
            return original(*arguments, **options)

        monkeypatch.setattr(owner, name, counting)

    watch(spla, "splu", "factor")
    watch(elimination, "factorise", "condensation")
    watch(body_on_levels, "coarser", "level")
    return calls


def others(problem: DiscreteProblem) -> list[DiscreteProblem]:
    """The same body under another load, gap and law."""
    law = hv.laws.ContactLaw(hv.Softening(2.0, 0.02, 0.4), hv.Tresca(0.05))
    offset = problem.offset + 0.01 * np.eye(1, problem.contact.components)
    return [problem.with_(load=2.0 * problem.load), problem.with_(offset=offset), problem.with_(law=law)]


def test_another_load_gap_or_law_costs_no_factorisation(counted: list[str]) -> None:
    problem = hv.discretize(STATEMENT)
    kept = Workspace()
    first = hv.certify(hv.solve(problem, workspace=kept), workspace=kept)
    assert first.unique
    smallness(others(problem)[2], workspace=kept)  # the first law that softens asks for the constant of the body
    assert "factor" in counted
    counted.clear()
    for other in others(problem):
        solution = hv.solve(other, workspace=kept)
        found = solution.certify(workspace=kept)
        assert counted == []
        alone = hv.certify(other, solution.unknowns, solution.multiplier)
        counted.clear()
        for name in ("margin", "error_bound", "equilibrium", "energy", "kind", "unique"):
            assert getattr(found, name) == getattr(alone, name), name
        assert found.smallness.trace_constant == alone.smallness.trace_constant


def test_levels_are_shared_by_solves_and_certificates(counted: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(norms, "FACTORISED", (100, 100))
    problem = hv.discretize(square(n=16))
    kept = Workspace()
    solution = hv.solve(problem, hv.solvers.NonsmoothMultigrid(), workspace=kept)
    assert counted.count("level") > 0
    counted.clear()
    found = hv.certify(solution, trace_constant=False, workspace=kept)
    assert found.method == "multigrid"
    assert counted.count("level") == 0
    assert not energy_norm(problem, kept).factorised
    for other in others(problem):
        other_solution = hv.solve(other, hv.solvers.NonsmoothMultigrid(), workspace=kept)
        assert hv.certify(other_solution, trace_constant=False, workspace=kept).method == "multigrid"
    assert counted.count("level") == 0


def test_a_trace_constant_belongs_to_its_weights() -> None:
    problem = hv.discretize(STATEMENT)
    kept = Workspace()
    first = smallness(problem, workspace=kept).trace_constant
    contact = replace(problem.contact, weights=2.0 * problem.contact.weights)
    doubled = replace(problem, model=replace(problem.model, contact=contact))
    second = smallness(doubled, workspace=kept).trace_constant
    assert first is not None
    assert second == pytest.approx(np.sqrt(2.0) * first)


def test_something_else_is_no_workspace() -> None:
    with pytest.raises(hv.errors.ProblemError, match="the workspace is"):
        hv.certify(bar(0.5, hv.Compliance(1.0)), np.zeros(8), workspace={})  # type: ignore[arg-type]


def test_a_certificate_does_not_depend_on_the_basis_of_the_unknowns() -> None:
    """Unknowns of other sizes, mixed with their neighbours: another K, f and B for the same body."""
    problem = hv.discretize(STATEMENT)
    bulk, contact, field = problem.bulk, problem.contact, problem.field
    assert isinstance(bulk, Quadratic)
    assert field is not None
    n = problem.unknowns
    mix = sp.diags_array([np.linspace(0.5, 3.0, n), np.full(n - 1, 0.3)], offsets=[0, 1]).tocsr()
    inverse = sp.csr_array(np.linalg.inv(mix.toarray()))
    stiffness = mix.T @ bulk.stiffness @ mix
    points = replace(contact, trace=sp.csr_array(contact.trace @ mix))
    mixed = replace(field, basis=sp.csr_array(field.basis @ mix), lift=sp.csr_array(inverse @ field.lift))
    model = Model(Quadratic(0.5 * (stiffness + stiffness.T)), points, Space((mixed,)), problem.origin)
    other = DiscreteProblem(model, Loading(mix.T @ problem.load, problem.offset, problem.law, problem.constant))
    solution = hv.solve(problem)
    u = 1.001 * solution.unknowns
    lam = solution.multiplier
    expected, found = hv.certify(problem, u, lam), hv.certify(other, inverse @ u, lam)
    assert found.unique
    assert found.margin == pytest.approx(expected.margin, rel=1e-9)
    assert found.energy == pytest.approx(expected.energy, rel=1e-9)
    assert found.equilibrium == pytest.approx(expected.equilibrium, rel=1e-6)
    assert found.error_bound >= found.equilibrium
    assert found.smallness.trace_constant == pytest.approx(expected.smallness.trace_constant, rel=1e-6)
    nodal = hv.certify(other, solution.displacement, lam)
    assert nodal.energy == pytest.approx(solution.energy, rel=1e-9)
    assert nodal.error_bound < 1e-8
