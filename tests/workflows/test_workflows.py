"""Use cases: their events in order, their values, and what an interruption leaves."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np
import pytest

import hemivar as hv
from hemivar import workflows
from hemivar.branches import PathProgress, SearchProgress, find_solutions, follow_path
from hemivar.branches.follow import following
from hemivar.branches.solutions import finding
from hemivar.errors import ProblemError
from hemivar.fem import LoadLine
from hemivar.gallery import survey as survey_problem
from hemivar.solvers import Controls, NonsmoothNewton
from hemivar.survey import SurveyEvent, SurveyOptions, survey
from hemivar.workflows import (
    Attempt,
    CertificateEvent,
    CertifyOptions,
    CompareOptions,
    Condensed,
    Event,
    FoundEvent,
    MethodEvent,
    PathOptions,
    Phase,
    Progress,
    RunOptions,
    SolutionsOptions,
    StartEvent,
    Work,
    equilibria,
    result_of,
    solving,
)
from hemivar.workflows.comparison import energy_norm_difference
from hemivar.workflows.convergence import observed_order

from ..problems import bar, square

Result = TypeVar("Result")
PROBLEM = square(n=4)


def watched(work: Work[Result], stop: Callable[[Event], bool] = lambda _: False) -> tuple[Result, list[Event]]:
    """The result, and all events; Ctrl-C at the first one for which ``stop`` holds."""
    events: list[Event] = []

    def see(event: Event) -> None:
        events.append(event)
        if stop(event):
            raise KeyboardInterrupt

    return result_of(work, see), events


def kinds(events: list[Event]) -> list[str]:
    """The types of events, repeated ones once."""
    names = [type(event).__name__ for event in events]
    return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]


# ---- run and certify -----------------------------------------------------------------------------------------


def test_a_run_tells_of_all_it_does_and_returns_what_solve_and_certify_return() -> None:
    result, events = watched(workflows.run(PROBLEM))
    assert kinds(events) == ["MethodEvent", "StartEvent", "Progress", "FoundEvent", "CertificateEvent"]
    expected = hv.solve(PROBLEM)
    np.testing.assert_array_equal(result.solution.unknowns, expected.unknowns)
    steps = [event for event in events if isinstance(event, Progress)]
    assert tuple(steps) == result.solution.history
    (found,) = (event for event in events if isinstance(event, FoundEvent))
    (certified,) = (event for event in events if isinstance(event, CertificateEvent))
    assert found.solution is result.solution
    assert certified.certificate is result.certificate
    assert result.certificate is not None
    assert result.certificate.margin == hv.certify(expected).margin
    assert (result.complaint, result.interrupted) == ("", False)
    assert result.certificate.tolerance == 1e-8
    loose = result_of(workflows.run(PROBLEM, RunOptions(controls=Controls(rtol=1e-3)))).certificate
    assert loose is not None
    assert loose.tolerance == 1e-3
    for event in workflows.run(PROBLEM):
        assert isinstance(event, Progress | workflows.Notice)


def test_warnings_come_first() -> None:
    nearly_incompressible = replace(square(n=2), material=hv.Material.young(1.0, 0.4999))
    events = watched(workflows.run(nearly_incompressible, RunOptions(coarser=[PROBLEM])))[1]
    assert kinds(events)[0] == "WarningEvent"
    assert [event.text for event in events if isinstance(event, workflows.WarningEvent)] == list(
        hv.discretize(nearly_incompressible).warnings
    )


def test_a_warm_start_goes_over_the_coarser_meshes() -> None:
    result, events = watched(workflows.run(PROBLEM, RunOptions(NonsmoothNewton(), coarser=[square(n=2)])))
    begun = [event for event in events if isinstance(event, StartEvent)]
    assert [(event.number, event.count) for event in begun] == [(0, 2), (1, 2)]
    assert begun[1].problem is result.solution.problem
    (chosen,) = (event for event in events if isinstance(event, MethodEvent))
    assert (chosen.solver, chosen.reason) == (NonsmoothNewton(), "")
    cold = hv.solve(PROBLEM)
    assert result.solution.energy == pytest.approx(cold.energy, rel=1e-12)
    assert result.solution.history[0].residual < 0.5 * cold.history[0].residual


@pytest.mark.parametrize("kind", [Progress, FoundEvent, CertificateEvent])
def test_an_interruption_keeps_what_there_is(kind: type[Event]) -> None:
    counted = RunOptions(controls=Controls(max_steps=100))  # by the steps of the method
    result, events = watched(workflows.run(PROBLEM, counted), lambda event: isinstance(event, kind))
    assert result.interrupted
    if kind is Progress:
        assert result.solution.status is hv.Status.INTERRUPTED
        assert result.solution.steps == 0
        assert result.certificate is not None  # of the best iterate
    else:
        assert result.solution.status is hv.Status.CONVERGED
        assert result.complaint == "interrupted"
        assert (result.certificate is None) == (kind is FoundEvent)
    assert sum(isinstance(event, FoundEvent) for event in events) == 1


def test_an_interruption_between_two_meshes_keeps_the_coarser_solution() -> None:
    options = RunOptions(coarser=[square(n=2)])
    result, _ = watched(
        workflows.run(PROBLEM, options), lambda event: isinstance(event, StartEvent) and event.number == 1
    )
    assert result.solution.status is hv.Status.INTERRUPTED
    assert result.solution.problem.unknowns == hv.discretize(square(n=2)).unknowns
    assert result.solution.residual.relative < 1e-9
    with pytest.raises(KeyboardInterrupt):
        watched(workflows.run(PROBLEM, options), lambda event: isinstance(event, StartEvent))


def test_a_lack_of_memory_for_the_certificate_is_no_lack_of_a_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(sys.modules[solving.__name__], "certificate_of", fail)
    result = result_of(workflows.run(PROBLEM))
    assert (result.certificate, result.complaint, result.interrupted) == (None, "not enough memory", False)
    assert result.solution.status is hv.Status.CONVERGED


def test_a_pair_is_certified_or_what_a_solve_finds() -> None:
    solved, events = watched(workflows.certify(PROBLEM))
    assert kinds(events) == ["MethodEvent", "StartEvent", "Progress", "FoundEvent", "CertificateEvent"]
    solution = hv.solve(PROBLEM)
    given, events = watched(workflows.certify(PROBLEM, solution.unknowns))
    assert kinds(events) == ["CertificateEvent"]
    assert given.margin == solved.margin
    assert given.stationary
    wrong = result_of(workflows.certify(PROBLEM, 1.01 * solution.unknowns))
    assert not wrong.stationary
    hasty = CertifyOptions(controls=Controls(max_time=1e-9))
    assert "margin" in result_of(workflows.certify(PROBLEM, solution.unknowns, options=hasty)).left_out
    assert result_of(
        workflows.certify(PROBLEM, 1.01 * solution.unknowns, options=CertifyOptions(tolerance=0.1))
    ).stationary


# ---- compare -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Failing(NonsmoothNewton):
    name: ClassVar[str] = "failing"

    def step(self, *_: object) -> None:  # type: ignore[override]
        raise ZeroDivisionError("by zero")


@dataclass(frozen=True)
class _Refusing(NonsmoothNewton):
    name: ClassVar[str] = "refusing"

    def refuse(self, problem: object) -> str:
        return "it is Monday"


METHODS = {"active-set": hv.solvers.METHODS["active-set"], "failing": _Failing(), "refusing": _Refusing()}


def test_a_comparison_has_an_attempt_for_every_method() -> None:
    found, events = watched(workflows.compare(PROBLEM, CompareOptions(METHODS)))
    assert [tried.name for tried in found.attempts] == ["newton", *METHODS]
    assert [tried.status for tried in found.attempts] == ["converged", "converged", "failed", "refused"]
    assert found.attempts[2].note == "ZeroDivisionError: by zero"
    assert found.attempts[3].note.endswith("it is Monday")
    assert found.reference is found.attempts[0]
    assert found.attempts[0].difference == 0.0
    assert 0.0 < (found.attempts[1].difference or 0.0) < 1e-9
    assert [event for event in events if isinstance(event, Attempt)] == list(found.attempts)
    stages = [event for event in events if isinstance(event, Phase)]
    assert [(event.name, event.number, event.count) for event in stages] == [
        (tried.name, number, 4) for number, tried in enumerate(found.attempts)
    ]
    assert isinstance(events[0], Condensed)
    for tried in found.attempts[:2]:  # the condensation is shared, and in no time of a method
        assert tried.solution is not None
        timings = dict(tried.solution.timings)
        assert timings.pop("condense") == events[0].seconds
        assert tried.seconds == pytest.approx(sum(timings.values()))


def test_a_comparison_that_is_interrupted_keeps_its_attempts() -> None:
    found, _ = watched(
        workflows.compare(PROBLEM, CompareOptions(METHODS)),
        lambda event: isinstance(event, Phase) and event.number == 1,
    )
    assert found.interrupted
    assert [tried.name for tried in found.attempts] == ["newton"]


# ---- solutions, path, laws -----------------------------------------------------------------------------------


def test_solutions_and_path_are_those_of_the_library() -> None:
    found, events = watched(workflows.solutions(PROBLEM, SolutionsOptions(starts=3)))
    np.testing.assert_array_equal(found.energies, find_solutions(PROBLEM, starts=3).energies)
    assert [event.solution for event in events if isinstance(event, FoundEvent)] == list(found)
    path = result_of(workflows.path(PROBLEM, PathOptions((0.0, 1.5))))
    np.testing.assert_array_equal(path.load_factor, follow_path(PROBLEM, (0.0, 1.5)).load_factor)
    assert result_of(workflows.solutions(PROBLEM, SolutionsOptions(max_solutions=1))).energies.size == 1
    assert not result_of(workflows.path(PROBLEM, PathOptions((0.0, 1.5), max_points=3))).reached_end


@pytest.mark.parametrize("enumerate_up_to", [20_000, 0])
def test_a_search_tells_of_its_starts_and_ends_when_asked_to(enumerate_up_to: int) -> None:
    problem = bar(0.5, hv.Softening(2.0, 0.1, 2.0))
    options = SolutionsOptions(starts=3, enumerate_up_to=enumerate_up_to)
    whole, events = watched(finding(problem, options))
    steps = [event for event in events if isinstance(event, SearchProgress)]
    assert steps[-1].found == len(whole) == 3
    assert [step.found for step in steps] == sorted(step.found for step in steps)
    assert steps[-1].starts == whole.starts
    assert (steps[-1].planned > 0) == (enumerate_up_to == 0)
    assert all(step.planned == steps[-1].planned for step in steps if step.starts > 1)
    if enumerate_up_to == 0:
        assert steps[0] == SearchProgress(0, 0)  # it tells of itself before the first start
        assert steps[-1].planned <= steps[-1].starts  # and of more where saddles lead to some
    first = result_of(finding(problem, options), lambda event: event.found == 1)
    assert first.interrupted
    assert len(first) == 1


def test_a_path_tells_of_its_points_and_ends_when_asked_to() -> None:
    problem = bar(0.5, hv.Softening(2.0, 0.1, 2.0))
    whole, events = watched(workflows.path(problem, PathOptions((0.0, 2.0))))
    steps = [event for event in events if isinstance(event, PathProgress)]
    assert {step.load_factor for step in steps} <= set(whole.load_factor)
    assert steps[-1].load_factor == whole.load_factor[-1]
    part = result_of(following(problem, PathOptions((0.0, 2.0))), lambda event: event.load_factor > 0.1)
    assert part.interrupted
    assert 2 <= len(part) < len(whole)


def test_the_options_of_a_search_reach_it(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[SolutionsOptions] = []

    def search(problem: hv.DiscreteProblem, options: SolutionsOptions) -> Work[tuple[hv.Solution, ...]]:
        seen.append(options)
        yield from ()
        return ()

    monkeypatch.setattr(equilibria, "finding", search)
    options = SolutionsOptions(3, 4, 5, Controls(rtol=1e-7))
    result_of(workflows.solutions(PROBLEM, options))
    assert seen == [options]


def test_prescribed_displacements_grow_with_the_load_of_a_statement() -> None:
    pushed = replace(square(n=2), supports={"left": hv.Prescribed((0.0, -0.1))})
    path = result_of(workflows.path(pushed))
    line = LoadLine.of(pushed)
    expected = follow_path(line.loaded, unloaded=line.unloaded)
    np.testing.assert_array_equal(path.local, expected.local)
    assert not np.allclose(path.local[0], path.local[-1])


def test_a_law_is_studied_with_values_given_as_numbers_or_text() -> None:
    for value in (3.0, "3", "sqrt(9)"):
        (study,) = result_of(workflows.study_law("softening", {"softening": value}))
        assert study.curve is not None
        assert study.curve.describe().alpha == 3.0
        assert set(study.examples) == {"stiffness", "limit"}
    both, events = watched(workflows.study_law("formula"))
    assert [study.entry.kind for study in both] == ["normal", "friction"]
    assert events == list(both)
    assert len(result_of(workflows.study_law("formula", friction=True))) == 1
    assert len(result_of(workflows.study_law("formula", first=True))) == 1
    (table,) = result_of(workflows.study_law("table", first=True))
    assert table.curve is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("softning",), "did you mean 'softening'"),
        (("softening", {"softness": 1.0}), "no parameter 'softness'"),
        (("softening", {"limit": "x"}), "parameter limit=x: give a number here"),
    ],
)
def test_a_law_that_is_not_known(arguments: tuple[str, dict[str, str]], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        result_of(workflows.study_law(*arguments))
    with pytest.raises(ProblemError, match="normal law"):
        result_of(workflows.study_law("softening", friction=True))


# ---- survey --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_survey_that_is_interrupted_keeps_what_is_done() -> None:
    runs, events = watched(survey(SurveyOptions(max_n=8)), lambda event: isinstance(event, Phase) and event.number == 1)
    assert runs.interrupted
    assert list(runs.figures) == ["figure1"]
    assert (runs.meshes, runs.errors) == ((), {})
    (done,) = (event for event in events if isinstance(event, SurveyEvent))
    assert done.part == "figure1"
    assert done.runs.figures["figure1"] == runs.figures["figure1"]
    newton = runs.figures["figure1"]["newton"]
    assert newton.energy == pytest.approx(hv.solve(survey_problem("figure1", 32)).energy, rel=1e-9)
    assert any(isinstance(event, Progress) for event in events)


def test_observed_order() -> None:
    sizes = 0.5 ** np.arange(1, 7)
    assert observed_order(sizes, 3.0 * sizes**0.8) == pytest.approx(0.8)
    assert observed_order(sizes, np.where(sizes > 0.1, sizes, np.nan)) == pytest.approx(1.0)
    assert np.isnan(observed_order(sizes[:1], sizes[:1]))


# ---- the room ------------------------------------------------------------------------------------------------


def test_nothing_here_prints_writes_or_exits() -> None:
    for file in Path(workflows.__file__).parent.glob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        called = {
            node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute)
        }
        assert not called & {"print", "exit", "_exit", "write_text", "open", "input"}, file
        imported = {
            name.split(".")[0]
            for node in ast.walk(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for name in ([a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""])
        }
        assert not imported & {"rich", "typer", "sys", "os", "matplotlib"}, file


def test_the_room_is_loaded_when_it_is_used() -> None:
    code = (
        "import sys, hemivar\nassert 'hemivar.workflows' not in sys.modules\n"
        "print(callable(hemivar.workflows.run), 'matplotlib' in sys.modules, 'rich' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False", "False"]


def test_controls_reach_the_solve() -> None:
    stopped = result_of(workflows.run(PROBLEM, RunOptions(hv.solvers.METHODS["direct-lbfgs"], Controls(max_steps=1))))
    assert stopped.solution.status is hv.Status.MAX_STEPS
    assert not stopped.interrupted


def test_solve_and_certificate_share_their_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    from hemivar.certificates import norms
    from hemivar.systems.body_on_levels import ElasticMultigrid

    made: list[int] = []
    original = ElasticMultigrid.of
    monkeypatch.setattr(ElasticMultigrid, "of", lambda problem: made.append(problem.unknowns) or original(problem))
    monkeypatch.setattr(norms, "FACTORISED", (10, 10))
    found = result_of(workflows.run(PROBLEM, RunOptions(hv.solvers.METHODS["multigrid"])))
    assert found.certificate is not None
    assert made == [found.solution.problem.unknowns]


def test_differences_of_methods_are_those_in_the_energy_norm() -> None:
    """``|u - v|_K / |v|_K`` by dense algebra, of a solution and of one that was moved."""
    solution = hv.solve(square("figure 2", 2))
    moved = replace(solution, unknowns=1.25 * solution.unknowns + 0.01)
    K = solution.problem.stiffness.toarray()
    root = np.linalg.cholesky(K).T
    off, size = (np.linalg.norm(root @ u) for u in (moved.unknowns - solution.unknowns, solution.unknowns))
    assert energy_norm_difference(moved, solution) == pytest.approx(off / size, rel=1e-10)
