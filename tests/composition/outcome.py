"""What becomes of a combination."""

from __future__ import annotations

from pathlib import Path

import hemivar as hv
from tests.composition.cases import Row
from tests.composition.rules import matching
from tests.composition.tasks import TASKS

__all__ = ["check_row"]


def check_row(row: Row, folder: Path) -> None:
    """Nothing, where a combination works or is refused as it is listed.

    Raises
    ------
    AssertionError
        It is refused and not listed, or listed and works, or refused with another sentence.
    """
    expected = matching(vars(row))
    try:
        TASKS[row.task](row, folder)
    except hv.HemivarError as refused:
        said = str(refused)
        assert expected, f"{row} is refused: {said}"
        assert any(rule.said in said for rule in expected), f"{row} is refused in other words: {said}"
    else:
        assert not expected, f"{row} works, but is listed as refused: {expected[0].said}"
