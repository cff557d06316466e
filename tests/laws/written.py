"""What is written from laws: the exports of their packages, and rows of the pages for laws that have none.

python -m tests.laws.written      # writes them; a test compares

A law is a class or a function under ``named`` in any file of ``laws/normal``, ``laws/friction`` or ``laws/coupled``;
where it is to be imported from ``hemivar.laws`` its name stands in ``__all__`` of that file.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

import hemivar
from hemivar.basics.stated import Argument, Form
from hemivar.laws import Superpotential
from hemivar.laws.named import LawEntry
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, NORMAL_LAWS

LAWS = Path(hemivar.__file__).parent / "laws"
DOCS = Path(__file__).parents[2] / "docs"
#: Packages of laws by name, with the laws, and how the heads of their tables begin on the pages.
PACKAGES = {
    "normal": (NORMAL_LAWS, "| | pressure at penetration r |", "| normal law |"),
    "coupled": (COUPLED_LAWS, "", "| law of both |"),
    "friction": (FRICTION_LAWS, "| | friction while slipping by s |", "| friction law |"),
}
#: Lines of at most so many characters.
WIDTH = 120


def makers(package: str) -> Iterator[tuple[str, str, LawEntry]]:
    """Modules, names and entries of the laws of a package that are exported."""
    for entry in PACKAGES[package][0].values():
        module, name = entry.build.__module__, entry.build.__name__
        if f".laws.{package}." in module and not name.startswith("_"):
            yield module, name, entry


# ---- exports ------------------------------------------------------------------------------------------------


def exports(file: Path, more: Mapping[str, set[str]]) -> str:
    """An ``__init__.py`` that imports these names from modules, too, and exports them."""
    text = file.read_text(encoding="utf-8")
    tree = ast.parse(text)
    imported: dict[str, dict[str, str]] = {}
    exported: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            assert node.module
            imported.setdefault(node.module, {}).update({one.name: one.asname or one.name for one in node.names})
        elif isinstance(node, ast.Assign):
            exported |= set(ast.literal_eval(node.value))
    for module, names in more.items():
        imported.setdefault(module, {}).update({name: name for name in names - exported})
        exported |= names
    head = text[: text.index('"""', 3) + 3]
    lines = [
        _wrapped(f"from {module} import ", sorted(names, key=_order)) for module, names in sorted(imported.items())
    ]
    rows = "".join(f'    "{name}",\n' for name in sorted(exported, key=_order))
    return f"{head}\n\n" + "".join(lines) + f"\n__all__ = [\n{rows}]\n"


def _order(name: str) -> tuple[int, str]:
    """Constants, classes, functions, as imports are sorted."""
    return 0 if name.isupper() else 1 if name[0].isupper() else 2, name


def _wrapped(head: str, names: list[str]) -> str:
    plain = head + ", ".join(names)
    if len(plain) <= WIDTH:
        return plain + "\n"
    return f"{head}(\n" + "".join(f"    {name},\n" for name in names) + ")\n"


# ---- rows of pages ------------------------------------------------------------------------------------------


def with_rows(text: str, head: str, rows: Iterator[tuple[str, str]]) -> str:
    """A page whose table with this head has these rows at its end, where a mark of theirs does not stand on it yet."""
    if not head:
        return text
    begin = text.index("\n" + head) + 1
    end = text.index("\n\n", begin)
    missing = "".join("\n" + row for mark, row in rows if mark not in text[begin:end])
    return text[:end] + missing + text[end:]


def row_of_laws(name: str, entry: LawEntry) -> tuple[str, str]:
    """The row of docs/laws.md: call, formula, weak convexity of the example."""
    arguments = [one for one in inspect.signature(entry.build).parameters if one not in ("name", "of")]
    call = f"`{name}({', '.join(arguments)})`"
    law = entry.make(**(entry.example or {}))
    profile = law if isinstance(law, Superpotential) else law.profile  # type: ignore[attr-defined]
    alpha = float(np.max(profile.at(np.zeros((1, 2))).weak_convexity))
    size = "0" if alpha == 0.0 else "infinite" if np.isinf(alpha) else f"{alpha:.3g} in the example of `hemivar laws`"
    return f"`{name}(", f"| {call} | {entry.formula} | {size} |"


def row_of_files(entry: LawEntry) -> tuple[str, str]:
    """The row of docs/problem-file.md: name, what it does, parameters with limits and defaults."""
    said = ", ".join(_parameter(one) for one in entry.parameters if one.key != "of")
    return f'| `"{entry.name}"` |', f'| `"{entry.name}"` | {entry.summary} | {said} |'


def _parameter(one: Argument) -> str:
    text = f"`{one.key}`"
    if one.stated.form is Form.QUANTITY:
        limit = ">" if one.stated.above is not None else ">=" if one.stated.least is not None else ""
        text += f" {limit} {one.stated.lowest:g}" if limit else ""
    return text if one.default is None else f"{text}, default {one.default:g}" if _is_number(one.default) else text


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


# ---- all of it ----------------------------------------------------------------------------------------------


def written() -> dict[Path, str]:
    """Files as they must be."""
    files, all_names = {}, dict[str, set[str]]()
    pages = {name: (DOCS / name).read_text(encoding="utf-8") for name in ("laws.md", "problem-file.md")}
    for package, (entries, of_laws, of_files) in PACKAGES.items():
        own = list(makers(package))
        modules = {module: {name for of, name, _ in own if of == module} for module, _, _ in own}
        files[LAWS / package / "__init__.py"] = exports(LAWS / package / "__init__.py", modules)
        all_names[f"hemivar.laws.{package}"] = {name for _, name, _ in own}
        rows = (row_of_laws(name, entry) for _, name, entry in own)
        pages["laws.md"] = with_rows(pages["laws.md"], of_laws, rows)
        pages["problem-file.md"] = with_rows(
            pages["problem-file.md"], of_files, (row_of_files(entry) for entry in entries.values())
        )
    files[LAWS / "__init__.py"] = exports(LAWS / "__init__.py", all_names)
    return files | {DOCS / name: text for name, text in pages.items()}


if __name__ == "__main__":
    for path, text in written().items():
        if path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(path.name)
