"""Numbers of a solution by name: what the solution itself says, and names that are not known."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.solvers.numbers_by_name import check_quantity, quantity_of, unit_of


def pressed_block(load: float = -1.0) -> hv.ContactProblem:
    """A block on springs with friction, pressed_block down and held at its left side."""
    return hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (4, 2)),
        hv.Material.young(100.0, 0.3),
        contact={"bottom": hv.Contact(hv.Compliance(50.0), hv.Tresca(0.1))},
        supports={"left": "clamped"},
        tractions={"top": (0.3, load)},
    )


def test_each_number_is_that_of_the_solution() -> None:
    problem = pressed_block()
    solution = hv.solve(problem)
    expected = {
        "max-pressure": solution.pressure.max(),
        "max-penetration": solution.penetration.max(),
        "max-opening": -solution.penetration.min(),
        "max-slip": np.abs(solution.slip).max(),
        "max-displacement": np.hypot(*solution.displacement.reshape(-1, 2).T).max(),
        "max-stress": solution.von_mises().max(),
        "normal-force": solution.normal_force,
        "friction-force": np.linalg.norm(solution.friction_force),
        "contact-length": solution.contact_length,
        "energy": solution.energy,
        "load-factor": 1.0,
        "support.left.force": np.linalg.norm(solution.reactions["left"]),
        "support.left.force.x": solution.reactions["left"][0],
        "contact.bottom.force.y": solution.contact_forces["bottom"][1],
    }
    for name, value in expected.items():
        assert check_quantity(name, problem) == name
        assert quantity_of(solution, name) == pytest.approx(float(value), rel=1e-14), name
    balance = quantity_of(solution, "support.left.force.y") + quantity_of(solution, "contact.bottom.force.y")
    assert balance == pytest.approx(2.0)  # what the load presses down
    assert [unit_of(name) for name in ("max-stress", "max-slip", "support.left.force")] == ["stress", "length", "force"]


def test_a_load_that_is_not_carried_says_how_much_of_it_was() -> None:
    glue = hv.Contact(hv.laws.Adhesive(20.0, 0.2, softening=10.0))
    sides = {"left": "roller", "right": "roller"}
    body = hv.rectangle((2.0, 1.0), (4, 2))
    problem = hv.ContactProblem(body, hv.Material.young(100.0, 0.3), {"bottom": glue}, sides, tractions={"top": (0, 4)})
    solution = hv.solve(problem)
    assert solution.status is not hv.Status.CONVERGED
    assert quantity_of(solution, "load-factor") == pytest.approx(0.05, rel=0.05)  # strength 0.2 over the load 4


@pytest.mark.parametrize(
    "name", ["max-presure", "support.right.force", "support.left.force.z", "support.left", "contact.force", ""]
)
def test_names_that_are_not_known_are_refused(name: str) -> None:
    with pytest.raises(ProblemError, match="is not known"):
        check_quantity(name, pressed_block())
