"""Laws that have no energy: nothing that is said of their solutions may speak of minimisers or of stability."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.certificates.certificate import _known
from hemivar.discrete.point_kind import PointKind
from hemivar.files.sweep_point import SweepPoint
from hemivar.laws import BenzeggaghKenane, ModeDependentGlue
from hemivar.mechanics import Contact, ContactProblem
from hemivar.studio.badges import badge_of
from tests import bodies

FIXED = " with the friction bound held fixed"
FRICTIONS = {
    "coulomb": hv.laws.Coulomb(0.4),
    "penetration": hv.laws.Friction(hv.laws.PenetrationBound(([0.0, 1.0], [0.1, 20.0]))),
    "tresca": hv.Tresca(0.1),
}


def pressed(friction: hv.laws.Friction, normal: hv.laws.Superpotential | None = None) -> ContactProblem:
    normal = hv.Softening(40.0, 0.02, 40.0) if normal is None else normal
    return bodies.square(Contact(normal, friction), 3, body_force=(0.4, -0.8))


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
    solution = hv.solve(pressed(FRICTIONS[name]))
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
    solution = hv.solve(pressed(FRICTIONS["tresca"]))
    assert solution.certify().kind is PointKind.LOCAL_MINIMISER
    words = said(solution)
    assert FIXED not in words
    assert "a local minimum of the energy" in words
    assert len(hv.find_solutions(solution.problem, starts=2).minima) >= 1


def test_the_kind_is_that_of_the_bound_as_it_is() -> None:
    """The same point of the same bound, held fixed by hand, has the kind of an energy."""
    solution = hv.solve(pressed(FRICTIONS["coulomb"]))
    problem = solution.problem
    fixed = problem.with_(law=problem.law.frozen(solution.local, solution.multiplier))
    kind = hv.certify(fixed, solution.unknowns, solution.multiplier).kind
    assert kind is PointKind.LOCAL_MINIMISER
    assert solution.certify().kind is kind.bound_fixed
    assert str(kind.bound_fixed) == f"{kind}{FIXED}"
    assert {kind for kind in PointKind if kind.bound_fixed is not kind} == {
        PointKind.LOCAL_MINIMISER, PointKind.SADDLE, PointKind.MAXIMUM, PointKind.DIRECTIONALLY_STATIONARY,
        PointKind.CLARKE_STATIONARY,
    }  # fmt: skip


@pytest.mark.parametrize("kind", [PointKind.UNIQUE_SOLUTION, PointKind.UNIQUE_MINIMISER])
def test_a_number_that_is_none_proves_nothing_and_gives_no_energy(kind: PointKind) -> None:
    certificate = replace(hv.solve(pressed(FRICTIONS["tresca"])).certify(), kind=kind, unique=True, margin=np.nan)
    known = _known(certificate)
    assert known.unique is None
    assert known.kind.has_energy is kind.has_energy


def test_glue_with_the_mode_of_the_solution_has_no_energy() -> None:
    glue = ModeDependentGlue(3.0, 4.5, 1e3, BenzeggaghKenane(0.5, 0.9, 2.0))
    solution = hv.solve(bodies.square(Contact(glue), 3, body_force=(0.4, 0.8)))
    certificate = solution.certify()
    assert not certificate.kind.has_energy
    assert "minimiser" not in f"{certificate.brief()} {badge_of(certificate)}"


def test_a_sweep_counts_minima_of_energies_only() -> None:
    fixed = SweepPoint((0,), energies=(1.0, 2.0), kinds=("saddle" + FIXED, "local minimiser" + FIXED))
    assert fixed.minima is None
    assert replace(fixed, kinds=("saddle", "local minimiser")).minima == 1
    assert np.isnan(fixed.margin)
