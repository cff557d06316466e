"""What a problem file with a mistake says."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv


def refused(text: str, path: Path, words: str) -> None:
    """The file is written, and read or posed with an error in these words."""
    path.write_text(text)
    with pytest.raises(hv.errors.ProblemError, match=words):
        hv.discretize(hv.read_problem(path))
