"""Printed and exact results of examples/literature, each on its coarse mesh."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from tests.samples import slow

FOLDER = Path(__file__).parents[2] / "examples" / "literature"
TABLE = runpy.run_path(str(FOLDER / "table.py"))
#: Cases that take more than about a second.
LONG = {
    "archard_punch",
    "bouncing_bar",
    "brazilian_disc",
    "cantilever_on_glue",
    "alfano_crisfield",
    "equal_cylinders",
    "sphere_and_punch",
    "punch_with_friction",
    "softening_jumps",
    "stick_slip_on_a_belt",
    "johnson_kendall_roberts",
    "velocity_step",
}
PAGE = (FOLDER.parents[1] / "docs" / "evidence.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [slow(name) if name in LONG else name for name in TABLE["NAMES"]])
def test_what_is_printed_is_found(name: str) -> None:
    one = TABLE["case"](name)
    assert one["__doc__"].strip()
    assert one["SOURCE"].strip()
    assert one["REASON"].strip()
    for quantity, (printed, found, off) in TABLE["deviations"](one).items():
        assert abs(off) <= one["WITHIN"], f"{quantity}: {printed} printed, {found} found"


def test_the_page_has_every_case_once() -> None:
    rows = re.findall(r"^\| \[(\w+)\]\(\.\./examples/literature/\1\.py\)", PAGE, re.MULTILINE)
    assert rows == TABLE["NAMES"]
    assert 25 <= len(rows) <= 30
