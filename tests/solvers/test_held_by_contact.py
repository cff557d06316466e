"""Bodies that only their foundation holds: semicoercive problems, solvable and not."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.discrete import DiscreteProblem, Quadratic
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import discretize
from hemivar.laws import Compliance, ContactLaw, NoContact, Signorini, Superpotential, ThresholdCompliance
from hemivar.mechanics import Pressure
from hemivar.solvers import METHODS, Controls, Status, solve
from tests import bodies
from tests.samples import sampled


def free_bar(load: tuple[float, float], law: Superpotential) -> DiscreteProblem:
    """Two nodes and one spring, held by the foundation under the second node alone."""
    K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return DiscreteProblem.of_arrays(
        K,
        np.array(load),
        np.array([[0.0, 1.0]]),
        np.ones(1),
        np.zeros(1),
        ContactLaw(law),  # type: ignore[arg-type]
    )


def block(law: Superpotential) -> DiscreteProblem:
    """A block between frictionless walls, pressed on its foundation by a pressure 0.5."""
    return discretize(bodies.column(law, cells=4, pattern="cross", top=None, tractions={"top": Pressure(0.5)}))


FOUNDATIONS = (
    (Compliance(2.0), 0.25),
    (ThresholdCompliance(0.3, 2.0), 0.1),
    (ThresholdCompliance(0.6, 2.0), 0.0),
    (Signorini(), 0.0),
)


@pytest.mark.parametrize(
    ("method", "law", "penetration"), sampled([(name, *one) for name in METHODS for one in FOUNDATIONS], 3)
)
def test_block_on_its_foundation(method: str, law: Superpotential, penetration: float) -> None:
    try:
        found = solve(block(law), METHODS[method], Controls(max_steps=4000))
    except MethodError:
        assert isinstance(law, Signorini)
        return
    if found.status is Status.CONVERGED:
        np.testing.assert_allclose(found.penetration, penetration, atol=1e-7)
        np.testing.assert_allclose(found.pressure, 0.5, atol=1e-6)
    else:
        assert method in ("direct-powell", "active-set-krylov", "bundle")
    if method == "newton":
        assert found.status is Status.CONVERGED


@pytest.mark.parametrize("method", METHODS)
def test_bar_on_its_foundation(method: str) -> None:
    found = solve(free_bar((0.2, 0.3), Compliance(4.0)), METHODS[method])
    if found.status is Status.CONVERGED:
        np.testing.assert_allclose(found.unknowns, [0.325, 0.125], atol=1e-7)
    else:
        assert method in ("direct-powell", "active-set-krylov", "bundle")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", [NoContact(), Compliance(3.0), ThresholdCompliance(0.3, 2.0), Signorini()])
def test_body_pulled_off_its_foundation_is_refused(method: str, law: Superpotential) -> None:
    with pytest.raises((ProblemError, MethodError), match=r"no lower bound|\+inf"):
        solve(free_bar((-0.2, -0.3), law), METHODS[method])


def test_load_beyond_what_the_foundation_can_carry_is_refused() -> None:
    with pytest.raises(ProblemError, match="no lower bound"):
        solve(free_bar((0.2, 0.3), ThresholdCompliance(0.4)))
    held = solve(free_bar((0.2, 0.3), ThresholdCompliance(0.6)))
    assert held.status is Status.CONVERGED
    assert held.pressure[0] == pytest.approx(0.5)


def test_body_loaded_by_its_foundation_alone() -> None:
    """No load at all, but the body starts 0.1 deep in the foundation: r + 2 r = 0.1 - ... in closed form."""
    problem = DiscreteProblem.of_arrays(
        np.array([[1.0]]),
        np.zeros(1),
        np.array([[1.0]]),
        np.ones(1),
        np.array([-0.1]),
        ContactLaw(Compliance(2.0)),  # type: ignore[arg-type]
    )
    for name, method in METHODS.items():
        found = solve(problem, method)
        if name != "direct-powell":
            assert found.status is Status.CONVERGED
            assert found.unknowns[0] == pytest.approx(-0.2 / 3.0, abs=1e-8)


def test_runaway_iterates_do_not_excuse_themselves() -> None:
    from hemivar.discrete import residual

    problem = free_bar((-0.2, -0.3), Compliance(3.0))
    far = residual(problem, np.full(2, -8e15), np.zeros((1, 1)))
    assert far.rounding <= 1e-6 * far.scale
    assert not far.below(0.0, 1e-9)


def test_what_was_shown_to_be_held_is_not_decided_again(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib import import_module

    decisions = []
    module = import_module("hemivar.solvers.solve")
    real = module.decide
    monkeypatch.setattr(module, "decide", lambda growth: decisions.append(growth) or real(growth))
    problem = block(Compliance(2.0))
    assert problem.held
    assert pickle.loads(pickle.dumps(problem)).held
    for same in (problem, problem.with_(offset=problem.offset + 0.1)):
        assert same.held
        assert solve(same).status is Status.CONVERGED
    assert not decisions


@pytest.mark.parametrize("what", ["load", "law", "bulk", "contact", "not looked at"])
def test_another_load_law_or_body_is_decided_anew(what: str) -> None:
    """However the problem was changed: a mark that outlived what it was put on would let a body fall for ever."""
    problem = block(Compliance(2.0))
    lifted = -problem.load
    contact = problem.contact
    changed = {
        "load": lambda: problem.with_(load=lifted),
        "bulk": lambda: problem.with_(bulk=Quadratic(problem.stiffness), load=lifted),
        "law": lambda: problem.with_(law=ContactLaw(NoContact()).at(contact.points)),  # type: ignore[arg-type]
        "contact": lambda: replace(
            problem, model=replace(problem.model, contact=replace(contact, trace=sp.csr_array(-contact.trace)))
        ),
        "not looked at": lambda: discretize(problem.origin, check_coercivity=False).with_(load=lifted),
    }[what]()
    assert not changed.held
    with pytest.raises(ProblemError, match="no lower bound"):
        solve(changed)
