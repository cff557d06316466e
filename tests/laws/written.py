"""What is written from laws, memories, materials and schemes: exports of their packages, rows of pages that have none.

python -m tests.laws.written      # writes them; a test compares

Each is a class or a function under ``named`` in any file of ``laws/normal``, ``laws/friction``, ``laws/coupled``,
``laws/memory``, ``mechanics`` or ``evolution/schemes``; where it is to be imported its name stands in ``__all__`` of
that file.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

import hemivar
from hemivar.basics.stated import Argument, Form
from hemivar.evolution import March
from hemivar.evolution.schemes.by_name import SCHEME_ENTRIES
from hemivar.laws import Superpotential
from hemivar.laws.named import LawEntry, LawKind
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, MEMORIES, NORMAL_LAWS
from hemivar.mechanics import Material
from hemivar.mechanics.material_registry import MATERIAL_LAWS

HOUSE = Path(hemivar.__file__).parent
LAWS = HOUSE / "laws"
DOCS = Path(__file__).parents[2] / "docs"
#: Packages by name, with what they hold, and how the heads of their tables begin on the page of it and that of files.
PACKAGES: dict[str, tuple[Mapping[str, LawEntry], str, str, str]] = {
    "laws.normal": (NORMAL_LAWS, "laws.md", "| | pressure at penetration r |", "| normal law |"),
    "laws.coupled": (COUPLED_LAWS, "laws.md", "", "| law of both |"),
    "laws.friction": (FRICTION_LAWS, "laws.md", "| | friction while slipping by s |", "| friction law |"),
    "laws.memory": (MEMORIES, "evolution.md", "| memory | what it models |", "| memory |"),
    "mechanics": (MATERIAL_LAWS, "nonlinear.md", "", "| `law` | stress or energy |"),
    "evolution.schemes": (SCHEME_ENTRIES, "evolution.md", "| scheme | order |", ""),
}
#: Lines of at most so many characters.
WIDTH = 120


def makers(package: str) -> Iterator[tuple[str, str, LawEntry]]:
    """Modules, names and entries of what a package exports: no material that a constructor of ``Material`` makes."""
    for entry in PACKAGES[package][0].values():
        module, name = entry.build.__module__, entry.build.__name__
        made = entry.kind is LawKind.MATERIAL and hasattr(Material, entry.name.replace("-", "_"))
        if f".{package}." in module and not name.startswith("_") and not made:
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


def row_of_page(name: str, entry: LawEntry) -> tuple[str, str]:
    """The row of the page of its kind; of a law: call, formula, weak convexity of the example."""
    arguments = [one for one in inspect.signature(entry.build).parameters if one not in ("name", "of")]
    call = f"`{name}({', '.join(arguments)})`"
    if entry.kind is LawKind.MEMORY:
        return f"`{name}`", f"| `{name}` | {entry.summary} |"
    if entry.kind is LawKind.SCHEME:
        return f"`{name}(", f"| {call} | {entry.build().order} | {entry.summary} | {entry.formula} |"  # type: ignore[attr-defined]
    law = entry.make(**(entry.example or {}))
    profile = law if isinstance(law, Superpotential) else law.profile  # type: ignore[attr-defined]
    alpha = float(np.max(profile.at(np.zeros((1, 2))).weak_convexity))
    size = "0" if alpha == 0.0 else "infinite" if np.isinf(alpha) else f"{alpha:.3g} in the example of `hemivar laws`"
    return f"`{name}(", f"| {call} | {entry.formula} | {size} |"


def row_of_files(entry: LawEntry) -> tuple[str, str]:
    """The row of docs/problem-file.md: name, what it does, parameters with limits and defaults."""
    said = ", ".join(_parameter(one) for one in entry.parameters if one.key not in ("of", "plane"))
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
    pages = {name: (DOCS / name).read_text(encoding="utf-8") for name in ("laws.md", "evolution.md", "problem-file.md")}
    for package, (entries, page, of_kind, of_files) in PACKAGES.items():
        own = list(makers(package))
        modules = {module: {name for of, name, _ in own if of == module} for module, _, _ in own}
        file = HOUSE / package.replace(".", "/") / "__init__.py"
        files[file] = exports(file, modules)
        all_names[f"hemivar.{package}"] = {name for _, name, _ in own}
        if of_kind:
            pages[page] = with_rows(pages[page], of_kind, (row_of_page(name, entry) for _, name, entry in own))
        rows = (row_of_files(entry) for entry in entries.values())
        pages["problem-file.md"] = with_rows(pages["problem-file.md"], of_files, rows)
        if package == "mechanics":
            files[HOUSE / "materials.py"] = exports(HOUSE / "materials.py", modules)
    laws = {package: names for package, names in all_names.items() if ".laws." in package}
    files[LAWS / "__init__.py"] = exports(LAWS / "__init__.py", laws)
    stub = HOUSE / "evolution" / "__init__.pyi"
    files[stub] = with_stubs(stub.read_text(encoding="utf-8"), "schemes", all_names["hemivar.evolution.schemes"])
    from hemivar.files.schema import rows_of  # only here: tests of the method alone import this module

    (row,) = (row for row in rows_of(March) if row.startswith("| `scheme` |"))
    pages["problem-file.md"] = re.sub(r"\| `scheme` \|.*", lambda _: row, pages["problem-file.md"])
    return files | {DOCS / name: text for name, text in pages.items()}


def with_stubs(text: str, module: str, names: set[str]) -> str:
    """A stub that imports these names from a module, too."""
    old = [line for line in text.splitlines() if line.startswith(f"from .{module} ")]
    new = {f"from .{module} import {name} as {name}" for name in names} | set(old)
    block = sorted(new, key=lambda line: _order(line.split()[-1]))
    return text.replace("\n".join(old), "\n".join(block))


if __name__ == "__main__":
    for path, text in written().items():
        if path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(path.name)
