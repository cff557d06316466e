"""Bodies that glue alone holds: an equilibrium near rest up to a limit, and no minimum of the energy."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.discrete.held_at_rest import NO_MINIMUM
from hemivar.discrete.point_kind import PointKind
from hemivar.solvers import METHODS
from tests.solvers.test_solve_glued_bodies import lever


def test_an_equilibrium_is_found_up_to_the_fold_of_the_path() -> None:
    path = hv.follow_path(lever(), (0.0, 5.0))
    limit = path.folds[0].load_factor
    for method in ("newton", "multigrid"):
        below = hv.solve(lever(0.9999 * limit), METHODS[method])
        assert below.status is hv.Status.CONVERGED
        expected = next(r for r, stable in path.at(0.9999 * limit) if stable)
        np.testing.assert_allclose(below.local, expected, atol=1e-7)
        assert hv.solve(lever(1.0001 * limit), METHODS[method]).status is hv.Status.NOT_CARRIED


def test_nothing_is_claimed_that_a_body_without_a_minimum_does_not_have(tmp_path: Path) -> None:
    solution = hv.solve(lever(0.4))
    certificate = solution.certify()
    assert certificate.kind is PointKind.LOCAL_MINIMISER
    assert certificate.unique is None
    assert certificate.margin == -np.inf
    assert certificate.error_bound == np.inf
    assert NO_MINIMUM in certificate.warnings
    assert any(NO_MINIMUM in line for line in certificate.lines())
    assert "supports alone do not constrain" in "\n".join(certificate.lines())
    assert NO_MINIMUM in json.loads(solution.to_json(tmp_path / "s.json").read_text())["warnings"]
    small = hv.discretize(lever(0.4, cells=1))
    found = hv.find_solutions(small)
    assert len(found)
    assert not found.exhaustive
    assert NO_MINIMUM in found.searched


def test_the_kind_of_a_point_is_that_of_the_curvature_of_all_unknowns() -> None:
    """Against the eigenvalues of the Hessian of the whole energy, on both sides of the fold."""
    path = hv.follow_path(lever(), (0.0, 5.0))
    kinds = set()
    fold = path.folds[0].index
    for index in (fold - 2, fold - 1, fold + 1, fold + 2):
        problem = hv.discretize(lever(float(path.load_factor[index])))
        r = 0.5 * (path.local[index] + path.local[index + (1 if index > fold else -1)])
        hessian = problem.law.linearise(r).hessian * problem.contact.weights[:, None, None]
        m, d = r.shape
        block = np.zeros((m * d, m * d))
        for j in range(m):
            block[j * d : (j + 1) * d, j * d : (j + 1) * d] = hessian[j]
        B = problem.contact.trace.toarray()
        lowest = np.linalg.eigvalsh(problem.stiffness.toarray() + B.T @ block @ B)[0]
        # a load that makes this place an equilibrium
        K, lam = problem.stiffness, np.zeros((m, d))
        lam[:, 0], lam[:, 1] = problem.law.normal.derivative(r[:, 0]), problem.law.tangential.derivative(r[:, 1])
        u = np.linalg.lstsq(B, (r + problem.offset).ravel(), rcond=None)[0]
        there = problem.with_(load=K @ u + problem.contact_force(lam))
        kind = hv.certify(there, u, lam).kind
        assert kind is (PointKind.LOCAL_MINIMISER if lowest > 0.0 else PointKind.SADDLE), (index, lowest)
        kinds.add(kind)
    assert kinds == {PointKind.LOCAL_MINIMISER, PointKind.SADDLE}
