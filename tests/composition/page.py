"""The page "What works with what": ``python -m tests.composition.page`` writes docs/works-with.md from the rules."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.composition.covering import completed
from tests.composition.rules import FACTORS, matching, statable

PAGE = Path(__file__).parents[2] / "docs" / "works-with.md"

#: What is written above a table, for each factor.
FACTOR_NAMES: Mapping[str, str] = {
    "task": "tasks",
    "body": "bodies",
    "normal": "normal laws",
    "friction": "friction",
    "beside": "memory and damping",
}
#: Levels whose names in the tests are short.
LEVEL_NAMES: Mapping[tuple[str, str], str] = {
    ("task", "exact"): "certify, `exact=True`",
    ("task", "all solutions"): "find_solutions",
    ("task", "path"): "follow_path",
    ("task", "bracket"): "load_bracket",
    ("task", "mass"): "march with mass",
    ("task", "resume"): "checkpoint, resume",
    ("task", "output"): "JSON, VTU, plot",
    ("task", "pickle"): "pickle, copy",
    ("task", "file"): "problem file",
    ("task", "jobs"): "other processes",
    ("body", "plane"): "plane, linear",
    ("body", "quadratic"): "quadratic elements",
    ("body", "axisymmetric"): "body of revolution",
    ("body", "stiffened"): "stress stiffening",
    ("body", "stressed"): "initial stress and strain",
    ("body", "resting"): "held by contact",
    ("body", "sprung"): "on springs",
    ("body", "tied"): "two bodies tied",
    ("body", "plated"): "under a rigid plate",
    ("body", "parts"): "two parts",
    ("body", "pair"): "two bodies that touch",
    ("body", "glued inside"): "an opened interface",
    ("body", "cracked"): "glue beside contact",
    ("body", "antiplane"): "antiplane shear",
    ("body", "form"): "form of scikit-fem",
    ("body", "mixed"): "form with a pressure",
    ("normal", "compliance"): "power of the penetration",
    ("normal", "table"): "pressure table",
    ("normal", "function"): "Python function",
    ("normal", "coupled-function"): "coupled, Python function",
    ("normal", "coupled-formula"): "coupled formula",
    ("normal", "finite"): "finite penetration",
    ("normal", "none"): "no contact",
    ("friction", "bound"): "bound of the penetration",
    ("friction", "weakening"): "slip weakening",
    ("beside", "penetration"): "of the penetration",
    ("beside", "slip sum"): "sum of the slip",
    ("beside", "secant"): "largest opening",
    ("beside", "rubbing"): "friction of damaged glue",
    ("beside", "bond"): "bond with plastic slip",
}

_HEAD = """\
# What works with what

This page tells for any two of task, body, law, friction and memory whether they go together. It is made from a table
that the tests try out, `tests/composition`. What works there agrees with a second way: another method, a shorter step,
a round trip, or sampling.

**yes** means that the two work together, as long as the rest of the problem is plain. A number is a footnote: the
library refuses the two, in a sentence that says so. A dash means that the two cannot be written down together.
"""


def name_of(factor: str, level: str) -> str:
    """The name of a level on the page."""
    return LEVEL_NAMES.get((factor, level), level)


def cell(levels: Mapping[str, str], notes: dict[str, int]) -> str:
    """What becomes of two levels: "yes", the number of a footnote, or a dash."""
    if not statable(levels):
        return "-"
    if completed(levels) is not None:
        return "yes"
    row = completed(levels, refused=True)
    if row is None:
        return "-"
    why = matching(vars(row))[0].why
    return str(notes.setdefault(why, len(notes) + 1))


def table(rows: str, columns: str, notes: dict[str, int]) -> Iterator[str]:
    """Lines of the table of two factors; the one with more levels goes down."""
    yield f"## {FACTOR_NAMES[rows].capitalize()} and {FACTOR_NAMES[columns]}\n"
    heads = [name_of(columns, level) for level in FACTORS[columns]]
    yield f"| | {' | '.join(heads)} |"
    yield "|---" * (len(heads) + 1) + "|"
    for level in FACTORS[rows]:
        cells = [cell({rows: level, columns: other}, notes) for other in FACTORS[columns]]
        yield f"| {name_of(rows, level)} | {' | '.join(cells)} |"
    yield ""


def page() -> str:
    """The text of the page."""
    notes: dict[str, int] = {}
    lines = [_HEAD]
    for pair in itertools.combinations(FACTORS, 2):
        rows, columns = sorted(pair, key=lambda factor: -len(FACTORS[factor]))
        lines += table(rows, columns, notes)
    lines.append("## Footnotes\n")
    lines += [f"{number}. {why}" for why, number in notes.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(page())
