"""Write docs/api.md, the reference of every public name: ``python docs/api.py``."""

from __future__ import annotations

import enum
import importlib
import inspect
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from types import ModuleType

import hemivar

TARGET = Path(__file__).with_name("api.md")
ROOMS = (
    "errors", "laws", "mesh", "discrete", "mechanics", "fem", "systems", "solvers", "certificates",
    "certificates.continuous", "branches", "adapt",
    "evolution", "gallery", "files", "workflows", "report",
)  # fmt: skip
HEAD = """# Reference

Every public name with its docstring, room by room. What is listed as `hemivar.name` is there without its room, too.
This page is made by `python docs/api.py`; a test compares the two.
"""


def reference() -> str:
    """The whole page."""
    modules = [importlib.import_module(f"hemivar.{room}") for room in ROOMS]
    listed = {id(getattr(module, name)) for module in modules for name in module.__all__}
    parts = [HEAD]
    for module in modules:
        parts.append(f"## {module.__name__}\n\n{_sentence(inspect.getdoc(module) or '')}\n")
        names = sorted(module.__all__, key=lambda name: (name.lower(), name))
        parts += [_entry(module, name, listed) for name in names]
    return "\n".join(parts)


def room_pages() -> dict[str, str]:
    """Sources of the site's reference: a page for each room, and an index of them."""
    pages: dict[str, str] = {}
    told: set[int] = set()
    modules = [importlib.import_module(f"hemivar.{room}") for room in ROOMS]
    listed = {id(getattr(module, name)) for module in modules for name in module.__all__}
    for room in ROOMS:
        module = importlib.import_module(f"hemivar.{room}")
        title = module.__name__
        parts = [f"{title}\n{'=' * len(title)}\n", _sentence(inspect.getdoc(module) or "").replace("|", r"\|") + "\n"]
        names = [_place(module, name) for name in sorted(module.__all__, key=lambda name: (name.lower(), name))]
        parts += [".. autosummary::\n\n" + "".join(f"   {place}\n" for place, _ in names)]
        for place, value in names:
            if id(value) not in told:  # the same class may be a name of two rooms
                parts.append(_directive(place, value, listed))
            if inspect.isclass(value) or inspect.isfunction(value):
                told.add(id(value))
        pages[room] = "\n".join(parts)
    entries = "".join(f"   {room}\n" for room in ROOMS) + "   All on one page <../api>\n"
    pages["index"] = (
        "Reference\n=========\n\nEvery public name, room by room. What is listed as ``hemivar.name`` is there without"
        f" its room, too.\n\n.. toctree::\n   :maxdepth: 1\n\n{entries}"
    )
    return pages


def _place(module: ModuleType, name: str) -> tuple[str, object]:
    """Where a name is documented: at the top if it is there, otherwise in its room."""
    value = getattr(module, name)
    short = name in hemivar.__all__ and getattr(hemivar, name) is value
    return f"{'hemivar' if short else module.__name__}.{name}", value


def _directive(place: str, value: object, listed: set[int]) -> str:
    if inspect.isclass(value):
        kind, options = "exception" if issubclass(value, BaseException) else "class", "   :members:\n"
        # What it inherits from classes of no entry of their own is told here.
        bases = [base for base in value.__mro__[1:] if id(base) in listed or not base.__module__.startswith("hemivar")]
        options += f"   :inherited-members: {', '.join(sorted(base.__name__ for base in bases))}\n"
        if issubclass(value, enum.Enum):
            options += "   :undoc-members:\n"
    else:
        kind, options = ("function" if inspect.isfunction(value) else "data"), ""
        options += "   :no-value:\n" if kind == "data" else ""
    return f".. auto{kind}:: {place}\n{options}"


def _entry(module: ModuleType, name: str, listed: set[int]) -> str:
    value = getattr(module, name)
    short = name in hemivar.__all__ and getattr(hemivar, name) is value
    heading = f"### {'hemivar' if short else module.__name__}.{name}\n"
    if not (inspect.isclass(value) or inspect.isfunction(value)):
        return f"{heading}\n{_constant(value)}\n"
    lines = [heading, f"```text\n{name}{_signature(value)}\n\n{inspect.getdoc(value)}\n```\n"]
    if inspect.isclass(value):
        members = list(_members(value, listed))
        lines += ["\n".join(members) + "\n"] if members else []
    return "\n".join(lines)


def _members(kind: type, listed: set[int]) -> Iterator[str]:
    """What a class defines, and what it inherits from classes that have no entry of their own."""
    if issubclass(kind, enum.Enum):
        yield "Members: " + ", ".join(f"`{member}`" for member in kind.__members__) + "."
        return
    told = {name for base in kind.__mro__[1:] if id(base) in listed for name in vars(base)}
    known: dict[str, object] = {}
    for base in reversed(kind.__mro__):
        if base.__module__.startswith("hemivar"):
            known |= {name: value for name, value in vars(base).items() if name not in told and name[0] != "_"}
    for name, value in sorted(known.items()):
        if isinstance(value, property | cached_property):
            yield f"* `{name}`: {_sentence(inspect.getdoc(value) or '')}"
        elif isinstance(value, classmethod | staticmethod) or inspect.isfunction(value):
            function = getattr(kind, name)
            yield f"* `{name}{_signature(function)}`: {_sentence(inspect.getdoc(function) or '')}"


def _sentence(text: str) -> str:
    """The first paragraph of a docstring, on one line."""
    return " ".join(text.split("\n\n")[0].split())


def _constant(value: object) -> str:
    if isinstance(value, str):
        return f"`{value!r}`"
    try:
        return "Keys: " + ", ".join(f"`{key}`" for key in value) + "."  # type: ignore[attr-defined]
    except TypeError:
        return "A type of arguments."


def _signature(function: object) -> str:
    """Names of the parameters with their plain defaults, the same under every version of Python."""
    try:
        parameters = list(inspect.signature(function).parameters.values())  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return ""
    shown: list[str] = []
    starred = False
    for parameter in parameters:
        if parameter.name == "self" or parameter.name.startswith("_"):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            shown.append("*")
            starred = True
        name = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "") + parameter.name
        starred = starred or parameter.kind is parameter.VAR_POSITIONAL
        shown.append(name if parameter.default is parameter.empty else f"{name}={_default(parameter.default)}")
    return f"({', '.join(shown)})"


def _default(value: object) -> str:
    if isinstance(value, enum.Enum):
        return f"{type(value).__name__}.{value.name}"
    plain = value is None or isinstance(value, bool | int | float | str)
    return repr(value) if plain else "..."


if __name__ == "__main__":
    TARGET.write_text(reference(), encoding="utf-8")
