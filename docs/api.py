"""Sources of the reference on the site: a page for each module with every public name, read by docs/conf.py."""

from __future__ import annotations

import enum
import importlib
import inspect
from types import ModuleType

import hemivar

ROOMS = (
    "errors", "laws", "mesh", "discrete", "mechanics", "fem", "systems", "solvers", "certificates",
    "evolution", "branches", "bounds", "gallery", "files", "workflows", "report", "survey", "identification",
)  # fmt: skip


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
    entries = "".join(f"   {room}\n" for room in ROOMS)
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


def _sentence(text: str) -> str:
    """The first paragraph of a docstring, on one line."""
    return " ".join(text.split("\n\n")[0].split())
