"""Adaptive solves as work that tells of its meshes."""

from __future__ import annotations

import pytest

from hemivar.errors import ProblemError
from hemivar.gallery import antiplane_friction, survey
from hemivar.workflows import (
    AdaptOptions,
    CertificateEvent,
    CertifyOptions,
    Refined,
    RunOptions,
    adapt,
    certify,
    result_of,
    run,
)


def test_every_mesh_is_an_event_and_the_last_solution_is_certified() -> None:
    events: list[object] = []
    result = result_of(adapt(survey("5.1", 4), AdaptOptions(rtol=0.15)), events.append)
    meshes = [event for event in events if isinstance(event, Refined)]
    assert [event.number for event in meshes] == list(range(len(result.adaptive.levels)))
    assert tuple(event.level for event in meshes) == result.adaptive.levels
    assert isinstance(events[-1], CertificateEvent)
    assert result.certificate is not None
    assert result.certificate.exact is not None
    assert result.certificate.exact.bound == result.adaptive.distance.distance
    assert result.certificate.unique
    assert not result.interrupted


def test_it_ends_where_it_is_told_to_and_on_ctrl_c() -> None:
    def told(event: object) -> bool:
        return isinstance(event, Refined) and event.number == 1

    stopped = result_of(adapt(survey("5.1", 4), AdaptOptions(rtol=0.01)), told)
    assert (stopped.adaptive.ended, len(stopped.adaptive.levels)) == ("stopped", 2)

    def struck(event: object) -> None:
        if told(event):
            raise KeyboardInterrupt

    broken = result_of(adapt(survey("5.1", 4), AdaptOptions(rtol=0.01)), struck)
    assert (broken.adaptive.ended, len(broken.adaptive.levels)) == ("interrupted", 2)
    assert broken.interrupted
    assert broken.certificate is not None


def test_run_and_certify_bound_the_distance_to_the_exact_solution_where_asked() -> None:
    problem = survey("5.1", 4)
    plain, whole = (result_of(run(problem, RunOptions(exact=exact))).certificate for exact in (False, True))
    assert plain is not None
    assert plain.exact is None
    assert whole is not None
    assert whole.exact is not None
    again = result_of(certify(problem, options=CertifyOptions(exact=True)))
    assert again.exact is not None
    assert again.exact.bound == pytest.approx(whole.exact.bound)


def test_other_statements_are_refused() -> None:
    with pytest.raises(ProblemError, match="give a ContactProblem"):
        result_of(adapt(antiplane_friction(4).problem))  # type: ignore[arg-type]
