"""Every message of the library and the command, from the source: errors, warnings, remedies, printed lines and help.

``python -m tests.messages`` prints them all, for reading.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from tests.sources import PACKAGE, sources, trees

#: Calls whose first text is a message, by the name that is called, with what kind it is.
_CALLS = {
    "error": "error", "not_expressible": "error", "tell": "note", "warn": "warning", "print": "line", "Claim": "line",
    "WarningEvent": "warning", "append": "note",
}  # fmt: skip
_REMEDY = re.compile(r"remed", re.IGNORECASE)


@dataclass(frozen=True)
class Message:
    """A message, with ``{}`` for what is put in.

    Attributes
    ----------
    kind : str
        "error", "warning", "remedy", "note", "line" or "help".
    text : str
    place : str
        File and line.
    """

    kind: str
    text: str
    place: str

    @property
    def sentences(self) -> list[str]:
        """Its sentences."""
        return [one for one in re.split(r"(?<=[.?!])\s+|\n+", self.text) if one.strip()]


def text_of(node: ast.expr | None) -> str | None:
    """The text of a string, a joined or an f-string, ``{}`` for every value; None of anything else."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(text_of(value) or "{}" if isinstance(value, ast.Constant) else "{}" for value in values)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            first, second = text_of(left), text_of(right)
            return None if first is None and second is None else f"{first or '{}'}{second or '{}'}"
        case ast.IfExp(body=body, orelse=orelse):
            found = [text for text in (text_of(body), text_of(orelse)) if text]
            return max(found, key=len, default=None)
    return None


def messages() -> list[Message]:
    """All of them, in the order of the files."""
    found: list[Message] = []
    with trees(sources(PACKAGE)) as files:
        for file in files:
            for kind, text, line in _of(file.nodes, file.room == "cli"):
                if " " in text.strip():
                    found.append(
                        Message(kind, " ".join(text.split()) if kind != "line" else text, f"{file.file}:{line}")
                    )
    return list(dict.fromkeys(found))


def _of(nodes: Iterable[ast.AST], command: bool) -> Iterator[tuple[str, str, int]]:
    for node in nodes:
        match node:
            case ast.Call(func=ast.Name(id=called) | ast.Attribute(attr=called)):
                yield from _called(node, called, command)
            case (
                ast.Assign(targets=[ast.Name(id=name)], value=value)
                | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
            ) if _REMEDY.search(name):
                yield from (("remedy", text, line) for text, line in _texts(value))
            case ast.FunctionDef(name=name) if _REMEDY.search(name):
                for inner in ast.walk(node):
                    if isinstance(inner, ast.Return) and inner.value is not None:
                        yield from (("remedy", text, line) for text, line in _texts(inner.value))


def _called(node: ast.Call, called: str, command: bool) -> Iterator[tuple[str, str, int]]:
    if called in ("option", "written", "argument") and command and node.args and (text := text_of(node.args[0])):
        yield "help", text, node.lineno
    if called.endswith("Error") or called in _CALLS:
        kind = "error" if called.endswith("Error") else _CALLS[called]
        if called == "print" and not command:
            return
        several = [text for text in map(text_of, node.args) if text is not None and (" " in text or called == "error")]
        if several:
            yield kind, several[-1], node.lineno
    for keyword in node.keywords:
        if keyword.arg == "help" and (text := text_of(keyword.value)):
            yield "help", text, node.lineno
        elif keyword.arg is not None and _REMEDY.search(keyword.arg) and (text := text_of(keyword.value)):
            yield "remedy", text, node.lineno


def _texts(value: ast.expr) -> Iterator[tuple[str, int]]:
    """The texts in an expression, those of f-strings whole."""
    text = text_of(value)
    if text is not None:
        yield text, value.lineno
        return
    for child in ast.iter_child_nodes(value):
        if isinstance(child, ast.expr):
            yield from _texts(child)


def written(found: Iterable[Message]) -> str:
    """Messages, one in a line, by kind."""
    lines = [f"{one.kind:<8}{one.place:<44}{one.text.strip()}".replace("\n", " / ") for one in found]
    return "\n".join(sorted(lines)) + "\n"


if __name__ == "__main__":
    sys.stdout.write(written(messages()))
