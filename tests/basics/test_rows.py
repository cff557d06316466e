"""Columns that are stated once: records and tables that are made of them, by hand."""

from __future__ import annotations

import numpy as np

from hemivar.basics.rows import Column, Rows
from hemivar.basics.units import Units
from hemivar.report.tables import Table

ROWS = Rows(
    (
        Column("h", np.array([0.5, 0.25]), "h", unit="length"),
        Column("error", np.array([np.nan, 0.125]), "u", "errors", brief="e", cell="{:.1f}".format),
        Column(None, [..., np.inf], "bound"),
        Column("margin", [-np.inf, 2], brief=None),
        Column(None, [np.array([1.0, np.nan]), []], "all"),
    )
)


def test_a_record_is_nested_and_has_what_is_known() -> None:
    assert list(ROWS) == [
        {"h": 0.5, "errors": {"u": None}, "all": [1.0, None]},
        {"h": 0.25, "errors": {"u": 0.125}, "bound": None, "all": []},
    ]
    assert list(ROWS[1]) == ["h", "errors", "bound", "all"]
    assert ROWS[-1] == ROWS[1] == ROWS[1:][0]


def test_tables_have_headings_units_and_cells() -> None:
    assert Table.of(ROWS, "t", units=Units(length="mm")) == Table(
        ("h (mm)", "error", "margin"), ((0.5, None, -np.inf), (0.25, "0.1", 2)), "t"
    )
    assert Table.of(ROWS, brief=True) == Table(("h", "e"), ((0.5, None), (0.25, "0.1")))
    assert Table.of(Rows((Column("h", ()),))) == Table(("h",), ())
