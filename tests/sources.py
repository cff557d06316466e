"""Files as text and trees, for the tests that read the source."""

from __future__ import annotations

import ast
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "hemivar"


@dataclass(frozen=True)
class Source:
    """A file as it was when it was read: whoever rewrites it reads it again.

    Attributes
    ----------
    root, path : Path
    text : str
    """

    root: Path
    path: Path
    text: str = field(repr=False)

    @cached_property
    def tree(self) -> ast.Module:
        """The tree of the text."""
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """Every node of the tree."""
        return tuple(ast.walk(self.tree))

    @property
    def file(self) -> str:
        """The path below the root."""
        return self.path.relative_to(self.root).as_posix()

    @property
    def name(self) -> str:
        """Dotted name below the root, ``""`` for the package itself."""
        return ".".join(Path(self.file).with_suffix("").parts).removesuffix("__init__").removesuffix(".")

    @property
    def package(self) -> str:
        """Dotted name of the package that it is in."""
        return self.name if self.path.name == "__init__.py" else self.name.rpartition(".")[0]

    @property
    def room(self) -> str:
        """The first part of its name."""
        return self.name.split(".")[0]

    def at(self, place: ast.stmt | ast.expr | int, what: str) -> str:
        """A finding, with its file and line."""
        return f"{self.file}:{place if isinstance(place, int) else place.lineno}: {what}"


def sources(root: Path, *folders: str, kinds: tuple[str, ...] = (".py",)) -> list[Source]:
    """The files of these kinds in the folders of a root, in its own without any."""
    below = [root / folder for folder in folders] or [root]
    paths = sorted(path for folder in below for path in folder.rglob("*") if path.suffix in kinds)
    return [Source(root, path, path.read_text(encoding="utf-8")) for path in paths]


@contextmanager
def trees(found: list[Source]) -> Iterator[list[Source]]:
    """Sources with their trees, out of sight of the garbage collector: it would go over them again and again."""
    gc.disable()
    try:
        for source in found:
            _ = source.nodes
        gc.freeze()
    finally:
        gc.enable()
    try:
        yield found
    finally:
        gc.unfreeze()
