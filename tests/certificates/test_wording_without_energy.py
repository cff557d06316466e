"""Laws that have no energy: nothing that is said of their solutions may speak of minimisers or of stability."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.certificates.certificate import _known
from hemivar.discrete.point_kind import PointKind
from hemivar.mechanics import Contact, ContactProblem
from tests import bodies

FIXED = " with the friction bound held fixed"
FRICTIONS = {
    "coulomb": hv.laws.Coulomb(0.4),
    "penetration": hv.laws.Friction(hv.laws.PenetrationBound(([0.0, 1.0], [0.1, 20.0]))),
    "tresca": hv.Tresca(0.1),
}


def softening_square(friction: hv.laws.Friction, normal: hv.laws.Superpotential | None = None) -> ContactProblem:
    normal = hv.Softening(40.0, 0.02, 40.0) if normal is None else normal
    return bodies.square(Contact(normal, friction), 3, body_force=(0.4, -0.8))


def test_the_kind_is_that_of_the_bound_as_it_is() -> None:
    """The same point of the same bound, held fixed by hand, has the kind of an energy."""
    solution = hv.solve(softening_square(FRICTIONS["coulomb"]))
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
    certificate = replace(
        hv.solve(softening_square(FRICTIONS["tresca"])).certify(), kind=kind, unique=True, margin=np.nan
    )
    known = _known(certificate)
    assert known.unique is None
    assert known.kind.has_energy is kind.has_energy
