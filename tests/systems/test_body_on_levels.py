"""What a body on levels makes of its contact points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg as la

import hemivar as hv
from hemivar import gallery
from hemivar.systems.body_on_levels import MatrixAtContact, set_up


def mirrored_body() -> hv.DiscreteProblem:
    """A body without a mesh, whose unknowns count some components of the contact points against their direction."""
    rng, m, d, n = np.random.default_rng(1), 7, 3, 30
    trace = np.zeros((m * d, n))
    trace[np.arange(m * d), rng.permutation(n)[: m * d]] = rng.choice([-1.0, 1.0], m * d)
    root = rng.standard_normal((n, n))
    law = hv.laws.ContactLaw(hv.laws.ThresholdCompliance(0.1, 2.0), hv.laws.Tresca(0.2))
    stiffness = root @ root.T + n * np.eye(n)
    return hv.DiscreteProblem.of_arrays(stiffness, np.ones(n), trace, np.ones(m), np.zeros(m), law)


@pytest.mark.parametrize(
    "make",
    [
        lambda: hv.discretize(gallery.survey("5.1", 8, "right")),
        lambda: hv.discretize(gallery.survey_cube("5.1", 4)),
        mirrored_body,
    ],
)
def test_blocks_of_points_are_added_where_the_trace_has_them(make: Callable[[], hv.DiscreteProblem]) -> None:
    problem = make()
    body = set_up(problem, hv.systems.Workspace())
    elastic = body.elastic
    assert isinstance(elastic, MatrixAtContact)
    m, d = body.active.shape
    half = np.random.default_rng(0).standard_normal((m, d, d))
    blocks = half + np.swapaxes(half, 1, 2)
    trace = problem.contact.trace.toarray()
    expected = (trace.T @ la.block_diag(*blocks) @ trace)[np.ix_(body.unknown, body.unknown)]
    found = elastic.coupling.matrix(elastic.added(blocks)).toarray()
    np.testing.assert_allclose(found[np.ix_(elastic.own, elastic.own)], expected, atol=1e-14)
