"""Sizes of packages in lines that are neither blank, nor comments, nor docstrings: they only fall.

A number is lowered in the commit that makes it true (``python -m tests.test_size`` prints them all).  It rises only by
what a feature or a mended fault takes, with a comment beside it that says why.
"""

from __future__ import annotations

import re
from collections import Counter

from tests.sources import PACKAGE, sources

LINES: dict[str, int] = {
    "C++": 4808,
    "JavaScript": 2184,
    "basics": 1777,
    "bounds": 7488,  # flat cells by way of better ones
    "branches": 2752,  # paths that know their last step; brackets of stiffened bodies
    "certificates": 2021,  # bodies under the stress of the load
    "cli": 2952,
    "discrete": 2466,  # glue beside other laws
    "evolution": 6061,  # a load factor that is an answer, and is checked in checkpoints
    "fem": 5139,  # quadratic tetrahedra; stress stiffness; loads by portions
    "files": 3454,
    "formula": 1813,
    "gallery": 1367,
    "identification": 836,
    "kernels": 420,
    "laws": 10542,  # glue whose mode is kept stands beside every law
    "linear": 1899,
    "mechanics": 4065,
    "mesh": 4174,  # order of mesh files; longest edges halved
    "modules": 141,
    "ranks": 2857,
    "report": 4427,
    "solvers": 3416,  # stress stiffening
    "studio": 1343,
    "survey": 1470,
    "systems": 2340,
    "templates": 325,
    "workflows": 1581,
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
