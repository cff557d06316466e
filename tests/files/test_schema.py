"""Fields that say themselves how a file states them: read, written, refused, and shown on the page of the reference."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hemivar.basics.stated import Form, keys_of, stated, stated_fields
from hemivar.errors import ProblemError
from hemivar.evolution import March, Save
from hemivar.evolution.schemes.by_name import SCHEMES
from hemivar.files.not_expressible import difference
from hemivar.files.schema import decode, encode, rows_of
from hemivar.files.settings import OutputSettings, SolverSettings, TimeSettings
from hemivar.files.toml import KEYS, TomlTable
from hemivar.formula import Formula
from hemivar.mechanics import Pressure
from hemivar.mechanics.statement import Contact, ContactProblem
from hemivar.mechanics.thermal import Heat, HeatContact
from hemivar.mesh.recipe import MeshRecipe

DOCS = Path(__file__).parents[2] / "docs"
#: Page and heading, the classes whose fields stand below, and whether their table has a column of defaults.
ON_THE_PAGE: dict[str, tuple[str, str, tuple[Any, ...], bool]] = {
    "mesh": ("problem-file.md", "`[mesh]`", (MeshRecipe, ContactProblem), True),
    "loads": ("problem-file.md", "`[loads]`", (ContactProblem, Pressure), False),
    "contact.*": ("problem-file.md", "`[contact.NAME]`", (Contact,), True),
    "time": ("problem-file.md", "`[time]`", (March, TimeSettings), True),
    "output": ("problem-file.md", "`[output]`", (Save, OutputSettings), False),
    "solver": ("problem-file.md", "`[solver]`", (SolverSettings,), True),
    "heat": ("thermal.md", "In a problem file", (Heat, HeatContact), True),
}
#: Tables that state a part of a class only.
SPREAD = ("mesh", "loads")


@dataclass(frozen=True)
class Sample:
    """Every form."""

    length: float = field(metadata=stated(Form.NUMBER, "the length", above=0.0, below=9.0))
    part: float = field(default=0.5, metadata=stated(Form.NUMBER, least=0.0, most=1.0))
    count: int = field(default=1, metadata=stated(Form.WHOLE, least=1, most=9))
    on: bool = field(default=False, metadata=stated(Form.FLAG))
    kind: str = field(default="a", metadata=stated(Form.TEXT, choices=("a", "b")))
    name: str | None = field(default=None, metadata=stated(Form.FILE, key="file", endings=(".csv",)))
    place: Any = field(default=(0.0, 0.0), metadata=stated(Form.POINT))
    load: Any = field(default=0.0, metadata=stated(Form.QUANTITY, timed=True))
    motion: Any = field(default=0.0, metadata=stated(Form.VECTOR))
    more: Any = field(default=None, metadata=stated(Form.OWN))
    hidden: int = 3


def toml_table(**data: object) -> TomlTable:
    return TomlTable(data, "a.toml", "sample", None)


FULL = {
    "length": 2.0, "part": 0.25, "count": 4, "on": True, "kind": "b", "file": "x.csv", "place": [1.0, 2.0],
    "load": "t + x", "motion": [0.0, "x"], "more": [1],
}  # fmt: skip


def test_what_is_written_is_read_again() -> None:
    read = Sample(**decode(Sample, toml_table(**FULL), 2, more=lambda given: given.data["more"]))
    assert read.name == "x.csv"
    assert isinstance(read.load, Formula)
    assert encode(read, more=list) == FULL
    assert (
        difference(read, Sample(**decode(Sample, toml_table(**FULL), 2, more=lambda given: given.data["more"]))) is None
    )


def test_what_has_its_default_is_not_written() -> None:
    assert encode(Sample(2.0)) == {"length": 2.0}
    assert encode(Sample(2.0, place=np.zeros(2))) == {"length": 2.0}
    assert decode(Sample, toml_table(length=2)) == {"length": 2.0}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "a.toml: [sample] length: is missing; give the length"),
        ({"length": 0}, "length: is 0; it must be positive"),
        ({"length": 9}, "length: is 9; it must be smaller than 9"),
        ({"length": True}, "length: must be a number, not true"),
        ({"part": 1.5}, "part: is 1.5; it must lie between 0 and 1"),
        ({"count": 0}, "count: is 0; give a whole number of at least 1"),
        ({"count": 10}, "count: is 10; write a whole number from 1 to 9"),
        ({"on": 1}, "on: must be true or false, not the number 1"),
        ({"kind": "c"}, "kind: 'c' is not known"),
        ({"file": "x.png"}, "file: is 'x.png'; give the name of a file that ends in .csv"),
        ({"place": [1]}, "place: has 1 entries; it must be a list of 2 numbers"),
        ({"load": "q"}, "load: formula 'q'"),
        ({"motion": ["t", 0]}, "motion: formula 't' uses t, but this cannot change with time"),
    ],
    ids=str,
)
def test_refused_in_one_line(given: dict[str, object], words: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(words)):
        decode(Sample, toml_table(**({"length": 1} if given else {}) | given), 2)


def test_functions_are_refused() -> None:
    with pytest.raises(ProblemError, match=r"part.load is the Python function .*, which a problem file cannot express"):
        encode(Sample(1.0, load=lambda x: x), "part")


@pytest.mark.parametrize("name", ON_THE_PAGE)
def test_the_page_says_what_the_fields_say(name: str) -> None:
    """The rows of the page are those that ``rows_of`` makes."""
    page, heading, classes, defaults = ON_THE_PAGE[name]
    part = re.split(r"\n## ", (DOCS / page).read_text(encoding="utf-8").split(f"## {heading}\n")[1])[0]
    table = name if name in SPREAD else ""
    missing = [row for row in rows_of(*classes, defaults=defaults, part=table) if row not in part.splitlines()]
    assert missing == []
    keys = set(KEYS[name]) if name in KEYS else set(keys_of(*classes))
    assert keys <= set(re.findall(r"^\| `(\w+)` \|", part, re.MULTILINE))


@pytest.mark.parametrize("name", ON_THE_PAGE)
def test_what_may_be_a_formula_is_marked(name: str) -> None:
    for cls in ON_THE_PAGE[name][2]:
        for key, (_, said) in stated_fields(cls, name if name in SPREAD else "").items():
            if said.form is not Form.OWN:
                formula = said.form in (Form.QUANTITY, Form.VECTOR, Form.TENSOR)
                mark = "*(f, t)*" if said.timed else "*(f)*" if formula else ""
                assert (mark in said.says) if mark else "*(f" not in said.says, key


def test_every_parameter_of_a_scheme_can_be_stated() -> None:
    for scheme in SCHEMES.values():
        assert set(stated_fields(scheme)) == set(vars(scheme))
