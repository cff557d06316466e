"""Laws that have no energy: nothing that is said of their solutions may speak of minimisers or of stability."""

from __future__ import annotations

import json

import pytest

import hemivar as hv
from hemivar.discrete.point_kind import PointKind
from hemivar.laws import BenzeggaghKenane, ModeDependentGlue
from hemivar.mechanics import Contact
from hemivar.studio.badges import badge_of
from tests import bodies
from tests.certificates.test_wording_without_energy import FIXED, FRICTIONS, softening_square


def said(solution: hv.Solution) -> str:
    """All that is told of a solution where its kind is known, in lower case."""
    certificate = solution.certify()
    badge = badge_of(certificate)
    found = hv.find_solutions(solution.problem, starts=2)
    table = [str(one.kind) for one in found]
    told = [certificate.brief(), *certificate.lines(whole=True), *badge, *table, json.dumps(certificate.record())]
    return "\n".join([*told, str(solution.summary(certificate))]).lower()


@pytest.mark.parametrize("name", ["coulomb", "penetration"])
def test_a_friction_bound_of_the_solution_leaves_no_energy_to_be_least(name: str) -> None:
    solution = hv.solve(softening_square(FRICTIONS[name]))
    certificate = solution.certify()
    assert certificate.unique is None
    assert certificate.kind is PointKind.BOUND_FIXED_MINIMISER
    words = said(solution)
    assert "minimiser with the friction bound held fixed" in words
    for claim in ("local minimiser", "saddle", "directionally stationary"):
        assert words.count(claim) == words.count(claim + FIXED)
    assert "local minimum of the energy" not in words
    assert "stable equilibrium" not in words
    energies = [line for line in words.split("\n") if line.startswith("energy ")]
    assert len(energies) == 2
    assert all(line.endswith(FIXED) for line in energies)
    assert hv.find_solutions(solution.problem, starts=2).minima == ()
    assert badge_of(certificate).title == "an equilibrium"


def test_a_bound_that_is_a_number_has_an_energy() -> None:
    solution = hv.solve(softening_square(FRICTIONS["tresca"]))
    assert solution.certify().kind is PointKind.LOCAL_MINIMISER
    words = said(solution)
    assert FIXED not in words
    assert "a local minimum of the energy" in words
    assert len(hv.find_solutions(solution.problem, starts=2).minima) >= 1


def test_glue_with_the_mode_of_the_solution_has_no_energy() -> None:
    glue = ModeDependentGlue(3.0, 4.5, 1e3, BenzeggaghKenane(0.5, 0.9, 2.0))
    solution = hv.solve(bodies.square(Contact(glue), 3, body_force=(0.4, 0.8)))
    certificate = solution.certify()
    assert not certificate.kind.has_energy
    assert "minimiser" not in f"{certificate.brief()} {badge_of(certificate)}"
    assert badge_of(certificate)[:2] == ("fair", "an equilibrium")
    words = said(solution)
    assert FIXED not in words
    assert "energy has no minimum" not in words
