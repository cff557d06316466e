"""Every combination of a law, a body and a task works and agrees with a second way, or is refused as it is listed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

import hemivar as hv
from tests.composition import outcome, rules
from tests.composition.cases import Row
from tests.composition.covering import every_pair, few_rows, pairs_of, refused_rows
from tests.composition.outcome import check_row
from tests.composition.page import PAGE, page
from tests.composition.rules import FACTORS, RULES, matching, statable
from tests.samples import sampled

#: Laws that are like others of these: with them the pairs are tried in the slow tests only.
_ALIKE = ("function", "table", "coupled-function", "finite", "bilateral")
FEW: Mapping[str, tuple[str, ...]] = {
    **FACTORS,
    "normal": tuple(normal for normal in FACTORS["normal"] if normal not in _ALIKE),
}
QUICK = few_rows(FEW)
#: Each fourth row runs by default, but for what searches a curve of exponentials for seconds; others are slow tests.
BY_DEFAULT = [row for row in QUICK[::4] if row.normal != "cohesion" or row.task not in ("all solutions", "bracket")]
for _name, _levels in FEW.items():
    for _level in set(_levels) - {getattr(row, _name) for row in BY_DEFAULT}:
        BY_DEFAULT.append(next(row for row in QUICK if getattr(row, _name) == _level))
REFUSED = refused_rows()


@pytest.mark.parametrize("row", sampled(QUICK, BY_DEFAULT), ids=str)
def test_what_works(row: Row, tmp_path: Path) -> None:
    check_row(row, tmp_path)


@pytest.mark.parametrize("row", REFUSED, ids=str)
def test_what_is_refused(row: Row, tmp_path: Path) -> None:
    check_row(row, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("row", every_pair(), ids=str)
def test_every_two_levels(row: Row, tmp_path: Path) -> None:
    check_row(row, tmp_path)


def test_every_two_levels_that_can_meet_do() -> None:
    """Counted anew: a pair is missing only where no combination with it can be stated and works."""
    met = set().union(*map(pairs_of, QUICK))
    for row in every_pair():
        if matching(vars(row)) or row.normal in _ALIKE:
            continue
        assert pairs_of(row) <= met, row
    assert len(QUICK) <= 420


def test_every_level_is_met_by_default() -> None:
    for name, levels in FEW.items():
        assert set(levels) <= {getattr(row, name) for row in BY_DEFAULT}, name


def test_rules_speak_of_levels_that_are_there() -> None:
    for rule in RULES:
        for name, levels in FACTORS.items():
            assert set(getattr(rule, name)) <= set(levels), rule.said
    assert {rule.said for row in REFUSED for rule in matching(vars(row))} == {rule.said for rule in RULES}
    assert all(statable(vars(row)) for row in (*QUICK, *REFUSED))


def test_the_page_of_the_docs_says_so() -> None:
    """``python -m tests.composition.page`` writes it."""
    assert page() == PAGE.read_text(encoding="utf-8")


def test_a_fault_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong answer, an error that is none of the library's, a refusal in other words, one that is not listed."""
    row = Row("solve")
    check_row(row, tmp_path)
    solve = hv.solve

    def wrong(*arguments: object, **options: object) -> hv.Solution:
        found = solve(*arguments, **options)  # type: ignore[arg-type]
        return replace(found, unknowns=found.unknowns * (1.0 if options.get("controls") else 1.01))

    with monkeypatch.context() as patch:
        patch.setattr("tests.composition.tasks._by_another_method", lambda solution: wrong(solution.problem))
        with pytest.raises(AssertionError, match="apart"):
            check_row(row, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(outcome, "TASKS", {"solve": lambda row, folder: 1 / 0})
        with pytest.raises(ZeroDivisionError):
            check_row(row, tmp_path)
    listed = Row("path", "nonlinear", "saw-tooth")
    with monkeypatch.context() as patch:
        patch.setattr(rules, "RULES", ())
        with pytest.raises(AssertionError, match=r"is refused: .* drops discontinuously"):
            check_row(listed, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(rules, "RULES", (rules.Rule("other words", "", ("path",), ("nonlinear",)),))
        with pytest.raises(AssertionError, match="in other words"):
            check_row(listed, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(rules, "RULES", (rules.Rule("anything", "", ("solve",)),))
        with pytest.raises(AssertionError, match="is listed as refused"):
            check_row(row, tmp_path)
