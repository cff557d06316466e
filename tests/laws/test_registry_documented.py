"""The pages name every law, friction and bound, with its parameters, and none that is not there."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar import laws
from hemivar.basics.stated import Form
from hemivar.laws import Friction, SlipMeasure, StateBound, Superpotential, friction, normal, own
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, NORMAL_LAWS, LawEntry

DOCS = Path(__file__).parents[2] / "docs"
LAWS_PAGE = (DOCS / "laws.md").read_text(encoding="utf-8")
FILE_PAGE = (DOCS / "problem-file.md").read_text(encoding="utf-8")

#: Calls as the tables and lists of the page write them: ``Name(first, second)``.
CALLS = dict(re.findall(r"`([A-Z]\w*|table_law)\(([\w, ]*)\)`", LAWS_PAGE))
#: What makes a law, a friction or a bound; formulas and functions are shown by example.
MAKERS = {
    *normal.__all__,
    *(set(friction.__all__) & set(laws.__all__)),
    "ContactLaw",
    "PiecewiseQuadratic",
    "table_law",
} - {"StateBound", "SlipMeasure", "friction_in_increments"}

#: What the pages explain once for all frictions: what they are a law of in time.
OF = "of"


@pytest.mark.parametrize("name", sorted(laws.__all__))
def test_every_public_name_stands_on_the_page_about_laws(name: str) -> None:
    assert re.search(rf"`{name}\b", LAWS_PAGE), f"docs/laws.md does not name {name}"


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_the_page_about_laws_gives_the_parameters(name: str) -> None:
    assert name in CALLS, f"docs/laws.md has no `{name}(...)`"
    known = [p for p in inspect.signature(getattr(laws, name)).parameters if p not in ("name", "file", "stated", OF)]
    given = [p.strip() for p in CALLS[name].split(",") if p.strip()]
    if name == "table_law":
        assert given == known[:2]
        return
    assert given == known, f"docs/laws.md writes {name}({', '.join(given)})"


def test_the_pages_say_what_friction_is_a_law_of() -> None:
    for page in (LAWS_PAGE, FILE_PAGE):
        assert all(re.search(rf"`(of=)?\"{one}\"`", page) for one in SlipMeasure)


def test_every_class_of_laws_is_public() -> None:
    """A law, a friction or a bound that a user may want is exported; what is built in between is not."""
    inner = {"ExponentialWeakening", "LogarithmicWeakening", "StaticKineticProfile"}
    for room in (normal, friction, own):
        for name in room.__all__:
            value = getattr(room, name)
            if inspect.isclass(value) and issubclass(value, Superpotential | Friction | StateBound):
                assert name in laws.__all__ or name in inner, name


def rows(title: str) -> dict[str, str]:
    """Rows of the table of the page about problem files whose head begins so, by the law that they name."""
    table = FILE_PAGE.split(f"| {title} |", 1)[1].split("\n\n", 1)[0]
    return {found[1]: row for row in table.splitlines() if (found := re.match(r'\| `"([\w-]+)"`', row))}


@pytest.mark.parametrize(
    ("title", "entries"), [("normal law", NORMAL_LAWS), ("law of both", COUPLED_LAWS), ("friction law", FRICTION_LAWS)]
)
def test_the_page_about_problem_files_lists_the_laws(title: str, entries: Mapping[str, LawEntry]) -> None:
    found = rows(title)
    assert set(found) == set(entries)
    for name, entry in entries.items():
        told = set(re.findall(r"`(\w+)`", found[name].split("|")[-2]))
        assert told == {parameter.key for parameter in entry.parameters} - {OF}, name


@pytest.mark.parametrize(
    ("title", "entries"), [("normal law", NORMAL_LAWS), ("law of both", COUPLED_LAWS), ("friction law", FRICTION_LAWS)]
)
def test_the_page_about_problem_files_gives_limits_and_defaults(title: str, entries: Mapping[str, LawEntry]) -> None:
    """Written by hand, so that a limit that a law states wrongly, and keeps to, is noticed."""
    found = rows(title)
    for name, entry in entries.items():
        cell = found[name].split("|")[-2]
        for p in (p for p in entry.parameters if p.stated.form is Form.QUANTITY):
            tail = re.split(rf"`{p.key}`", cell)[1].split("`")[0]
            limit, default = re.match(r" (>=?) (\d+)", tail), re.search(r"default ([\d.]+)", tail)
            kind = ">" if p.stated.above is not None else ">=" if p.stated.least is not None else ""
            assert (limit[1] if limit else "") == kind, (name, p.key)
            assert limit is None or float(limit[2]) == p.stated.lowest, (name, p.key)
            assert (float(default[1]) if default else None) == p.default, (name, p.key)


@pytest.mark.parametrize("name", [*NORMAL_LAWS, *FRICTION_LAWS, *COUPLED_LAWS])
def test_what_the_registry_says_of_zero_is_what_the_law_does(name: str) -> None:
    """The table of ``hemivar laws`` says *at least 0* where zero is taken, and *positive* where it is refused."""
    entry = (NORMAL_LAWS | FRICTION_LAWS | COUPLED_LAWS)[name]
    given = {p.key: p.shown for p in entry.parameters if p.required}
    for p in (p for p in entry.parameters if p.stated.lowest == 0.0 and p.stated.form is Form.QUANTITY):
        if (name, p.key) == ("mixed-mode", "plateau"):  # which only one of its shapes has
            continue
        try:
            at = entry.make(**{**given, p.key: 0.0}).at(np.zeros((1, 2)))
            _ = getattr(at, "knots", None), getattr(at, "bound", None)
            refused = ""
        except hv.HemivarError as error:
            refused = str(error)
        assert (p.stated.above == 0.0) == ("positive" in refused), (p.key, refused)
