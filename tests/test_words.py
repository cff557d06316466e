"""Names in the code say what a thing is, and numbers of modules where they come from: both are counted.

``python -m tests.test_words`` prints the counts.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterator

from tests.sources import PACKAGE, sources

#: How often names may stand in the code that say nothing of what they name.
AT_MOST = {"found": 20, "place": 50}
#: Names for which the field has better ones: message, result, discrete, gradient flow, local minimiser.
NEVER = {
    "Posable", "PosedSystem", "downhill", "hand_on", "handing_on", "posed", "posed_below", "ramped", "sunk_by_a_jump",
    "tell", "told",
}  # fmt: skip
#: Numeric constants of modules, one for each name.
CONSTANTS = 560


def names(text: str) -> Iterator[str]:
    """The names in a text, but for ``tell``, asked of a stream, which is Python's."""
    before = ""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME and (before, token.string) != (".", "tell"):
            yield token.string
        before = token.string


def is_number(node: ast.expr) -> bool:
    match node:
        case ast.Constant(value=value):
            return type(value) in (int, float)
        case ast.UnaryOp(operand=part):
            return is_number(part)
        case ast.BinOp(left=left, right=right):
            return is_number(left) and is_number(right)
        case ast.Tuple(elts=parts):
            return bool(parts) and all(map(is_number, parts))
    return False


def constants(text: str) -> Iterator[tuple[str, int, bool]]:
    """Numeric constants of a module: the line, how many names it has, and whether a comment is above or beside it."""
    lines = ["", *text.splitlines()]
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and is_number(node.value):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            line, above = lines[node.lineno], lines[node.lineno - 1]
            yield line, len(target.elts) if isinstance(target, ast.Tuple) else 1, "#" in line or above.startswith("#")


def counted_names() -> tuple[Counter[str], list[str]]:
    """How often each name stands in the code, and where those stand that have better ones."""
    counts: Counter[str] = Counter()
    worse = []
    for file in sources(PACKAGE, kinds=(".py",)):
        count = Counter(names(file.text))
        counts += count
        worse += [f"{file.file}: {name}" for name in sorted(NEVER & count.keys())]
    return counts, worse


def counted_constants() -> tuple[Counter[str], list[str]]:
    """Numeric constants by package, and those without a comment."""
    counts: Counter[str] = Counter()
    bare = []
    for file in sources(PACKAGE, kinds=(".py",)):
        for line, number, explained in constants(file.text):
            counts[file.file.partition("/")[0]] += number
            bare += [] if explained else [f"{file.file}: {line}"]
    return counts, bare


def test_names_say_what_a_thing_is() -> None:
    counts, worse = counted_names()
    assert {name: counts[name] for name, most in AT_MOST.items() if counts[name] > most} == {}
    assert worse == []


def test_numbers_of_modules_say_where_they_come_from() -> None:
    counts, bare = counted_constants()
    assert bare == []
    assert counts.total() <= CONSTANTS


def test_which_names_are_counted() -> None:
    text = 'def told(posed):\n    """A place."""\n    return posed.found + stream.tell()  # told\n'
    assert Counter(names(text)) == Counter(["def", "told", "posed", "return", "posed", "found", "stream"])


def test_which_constants_are_counted() -> None:
    """Each with what is found of it: without a comment, with one above, with one beside, and what is no number."""
    text = "\n_B, _C = 2, -0.5\n#: Said.\n_A: float = 1e-3\n_E = (3 * 2, 1.0)  # said\n_D, _F, _G = 'x', True, {1: 2}\n"
    assert [(number, explained) for _, number, explained in constants(text)] == [(2, False), (1, True), (1, True)]


if __name__ == "__main__":
    count, worse = counted_names()
    print({name: count[name] for name in AT_MOST}, worse, counted_constants())
