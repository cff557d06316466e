"""The reference of public names says what the code says."""

from __future__ import annotations

import runpy
from pathlib import Path

import hemivar

DOCS = Path(__file__).parents[1] / "docs"


def test_reference_is_up_to_date() -> None:
    made = runpy.run_path(str(DOCS / "api.py"))["reference"]()
    assert made == (DOCS / "api.md").read_text(encoding="utf-8"), "run: python docs/api.py"


def test_every_public_name_is_listed() -> None:
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    missing = [name for name in hemivar.__all__ if f"### hemivar.{name}\n" not in text and name != "__version__"]
    assert missing == []
