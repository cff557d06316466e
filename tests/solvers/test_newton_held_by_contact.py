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
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Pressure
from hemivar.mesh import rectangle
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


def pressed_between_walls(law: Superpotential) -> DiscreteProblem:
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
        found = solve(pressed_between_walls(law), METHODS[method], Controls(max_steps=4000))
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
    problem = pressed_between_walls(Compliance(2.0))
    assert problem.held
    assert pickle.loads(pickle.dumps(problem)).held
    for same in (problem, problem.with_(offset=problem.offset + 0.1)):
        assert same.held
        assert solve(same).status is Status.CONVERGED
    assert not decisions


@pytest.mark.parametrize("what", ["load", "law", "bulk", "contact", "not looked at"])
def test_another_load_law_or_body_is_decided_anew(what: str) -> None:
    """However the problem was changed: a mark that outlived what it was put on would let a body fall for ever."""
    problem = pressed_between_walls(Compliance(2.0))
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


@pytest.mark.parametrize("cells", [(8, 4), (32, 16)])
@pytest.mark.parametrize("bedding", [0.5, 0.005, 5e-7])
def test_a_bedding_holds_a_body_whatever_its_size(cells: tuple[int, int], bedding: float) -> None:
    """The pressure is that of the load on every mesh; how many digits the bedding keeps is said, and true."""
    stated = ContactProblem(
        rectangle((40.0, 20.0), cells),
        Material.young(2e9, 0.3),
        bedding=bedding,
        contact={"bottom": Contact(Signorini())},
        tractions={"top": (1e-3, -300.0)},
    )
    solution = solve(stated)
    assert solution.normal_force == pytest.approx(300.0 * 40.0, rel=1e-5)
    (warning,) = solution.problem.warnings
    share = bedding * 800.0 / np.prod(cells) / 2e9
    lost = int(warning.split("lose about ")[1].split()[0])
    assert abs(lost + np.log10(share)) < 1.0
    if lost < 15:
        assert solution.displacement[:, 0].mean() == pytest.approx(5e-5 / bedding, rel=10.0 ** (lost - 14))


def test_a_bedding_of_which_all_is_felt_is_not_spoken_of() -> None:
    parts = {
        "mesh": rectangle(cells=4),
        "material": Material.young(1.0, 0.3),
        "contact": {"bottom": Contact(Signorini())},
    }
    assert not discretize(ContactProblem(**parts, bedding=1.0)).warnings  # type: ignore[arg-type]
    held = ContactProblem(**parts, bedding=1e-12, supports={"left": Clamped()})  # type: ignore[arg-type]
    assert not discretize(held).warnings
