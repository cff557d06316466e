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
    "basics": 2042,  # claims of results; options stated by their dataclass
    "bounds": 7607,  # options of adaptive solves, moved here
    "branches": 2966,  # forces of supports along a path; points that stick eliminated before a step
    "certificates": 2015,  # bodies under the stress of the load
    "cli": 2913,  # hemivar steps; the page
    "discrete": 2512,  # links of displacements: ties and rigid plates
    "evolution": 6297,  # load steps; conductances by temperature
    "fem": 5636,  # springs, points, ties and rigid plates
    "files": 3614,  # load steps, springs, points and plates in problem files
    "formula": 1809,
    "gallery": 1367,
    "identification": 1238,  # sensitivities by the adjoint
    "kernels": 420,
    "laws": 10568,  # rock joints, bolts, friction of the slip rate
    "linear": 1954,  # factors without copies; patterns kept for pairs
    "mechanics": 4769,  # load steps, springs, points, rigid plates, minimal supports
    "mesh": 4778,  # Exodus; coordinate systems of Nastran; entities of Gmsh; mirrored parts
    "modules": 148,  # names of kinds
    "ranks": 2865,  # refusals of ties and plates
    "report": 4374,  # the page that is stapled to a calculation
    "solvers": 3502,  # numbers of a solution by name; motions of plates
    "studio": 1367,  # laws of the user
    "survey": 1471,
    "systems": 2353,  # constants of many planes by Cholesky
    "templates": 325,
    "workflows": 1873,  # studies over time steps; columns of sweeps and studies
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
