"""Sizes of packages in lines that are neither blank, nor comments, nor docstrings: they only fall.

A number is lowered in the commit that makes it true (``python -m tests.test_size`` prints them all).  It rises only by
what a feature or a mended fault takes, with a comment beside it that says why.
"""

from __future__ import annotations

import re
from collections import Counter

from tests.sources import PACKAGE, sources

LINES: dict[str, int] = {
    "C++": 4810,  # cells of several kinds
    "JavaScript": 2184,
    "basics": 2016,  # what the user's code may be; pipes of processes
    "bounds": 7596,  # flat cells by way of better ones; cells by kinds, which takes a third less memory
    "branches": 2824,  # starts of the search solved roughly
    "certificates": 2022,  # bodies under the stress of the load
    "cli": 2909,  # laws of the user (--allow-code)
    "discrete": 2447,  # glue beside other laws
    "evolution": 6154,  # schemes named beside their classes
    "fem": 5177,  # quadratic tetrahedra; stress stiffness; initial stress
    "files": 3499,  # laws of the user in problem files; universal files
    "formula": 1809,
    "gallery": 1367,
    "identification": 860,  # laws of the user; rows of a fit
    "kernels": 420,
    "laws": 10590,  # memories and laws named beside their classes; the record of a constant
    "linear": 1954,  # factors without copies; patterns kept for pairs
    "mechanics": 4248,  # initial stress; kinematics asked in one place; materials named beside their classes
    "mesh": 4355,  # universal files; the rule of a boundary
    "modules": 149,  # names of kinds
    "ranks": 2858,  # laws of the user
    "report": 4327,
    "solvers": 3433,  # fields of options in place of thresholds
    "studio": 1366,  # laws of the user
    "survey": 1470,
    "systems": 2346,  # longer names wrap lines
    "templates": 325,
    "workflows": 1675,  # rows of studies, sweeps and comparisons
}
#: Files that are counted by their language; all others by their package.
LANGUAGES = {".cpp": "C++", ".hpp": "C++", ".js": "JavaScript"} | dict.fromkeys((".html", ".css", ".toml"), "templates")
DOCSTRING = re.compile(r'^[ \t]*r?"""(?:[^"\\]|\\.|"(?!""))*"""[ \t]*$', re.MULTILINE | re.DOTALL)


def lines_of(text: str, kind: str) -> int:
    """Lines that are not blank; of Python also without comments and docstrings."""
    if kind not in LANGUAGES:
        text = re.sub(r"^ *#.*", "", DOCSTRING.sub("", text), flags=re.MULTILINE)
    return sum(bool(line.strip()) for line in text.splitlines())


def counted() -> dict[str, int]:
    found: Counter[str] = Counter()
    for file in sources(PACKAGE, kinds=(".py", ".pyi", *LANGUAGES)):
        if "vendor" not in file.path.parts:
            room = file.file.partition("/")[0] if "/" in file.file else "modules"
            found[LANGUAGES.get(file.path.suffix, room)] += lines_of(file.text, file.path.suffix)
    return dict(sorted(found.items()))


def test_no_package_has_grown_and_every_number_is_true() -> None:
    found = counted()
    pairs = {name: (found.get(name, 0), LINES.get(name, 0)) for name in {**found, **LINES}}
    assert {name: pair for name, pair in pairs.items() if not 0 <= pair[1] - pair[0] < 25} == {}


def test_blanks_comments_and_docstrings_are_not_counted() -> None:
    said = '"""A\n\nB."""\n\nx = 1  # one\n# two\ny = """\nkept\n"""\n\ndef f():\n    """C."""\n    g("""\n kept""")\n'
    assert (lines_of(said, ".py"), lines_of("// said\n\nint a;\n", ".cpp")) == (7, 2)


if __name__ == "__main__":
    print("\n".join(f'    "{name}": {number},' for name, number in counted().items()))
