"""Columns that are stated once: records and tables that are made of them, by hand."""

from __future__ import annotations

import numpy as np

from hemivar.basics.rows import Column, ResultRows, plain
from hemivar.basics.units import Units
from hemivar.report.tables import Table

ROWS = ResultRows(
    (
        Column("h", np.array([0.5, 0.25]), "h", unit="length"),
        Column("error", np.array([np.nan, 0.125]), "u", "errors", brief="e", cell="{:.1f}".format),
        Column(None, [..., np.inf], "bound"),
        Column("margin", [-np.inf, 2], brief=None),
        Column(None, [np.array([1.0, np.nan]), []], "all"),
    )
)


def test_a_record_is_nested_and_has_what_is_known() -> None:
    assert plain(list(ROWS)) == [
        {"h": 0.5, "errors": {"u": None}, "all": [1.0, None]},
        {"h": 0.25, "errors": {"u": 0.125}, "bound": None, "all": []},
    ]
    assert list(ROWS[1]) == ["h", "errors", "bound", "all"]
    assert plain(ROWS[-1]) == plain(ROWS[1:][0])
    assert ROWS[1]["bound"] == np.inf


def test_columns_by_their_names_are_split_where_they_hold_vectors() -> None:
    rows = ResultRows((Column("a", np.eye(2), "a"), Column(None, np.ones((2, 1)), "b"), Column("c", ["x", "y"])))
    assert plain(rows.by_name()) == {"a_1": [1.0, 0.0], "a_2": [0.0, 1.0], "b": [1.0, 1.0]}


def test_what_stands_in_a_table_of_a_record_is_named_by_its_heading_in_a_frame() -> None:
    assert plain(ROWS.by_name()) == {
        "h": [0.5, 0.25],
        "error": [None, 0.125],
        "bound": [None, None],
        "all": [[1.0, None], []],
    }


def test_tables_have_headings_units_and_cells() -> None:
    assert Table.of(ROWS, "t", units=Units(length="mm")) == Table(
        ("h (mm)", "error", "margin"), ((0.5, None, -np.inf), (0.25, "0.1", 2)), "t"
    )
    assert Table.of(ROWS, brief=True) == Table(("h", "e"), ((0.5, None), (0.25, "0.1")))
    assert Table.of(ResultRows((Column("h", ()),))) == Table(("h",), ())
