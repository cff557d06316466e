"""Laws, memories, materials and schemes by name: what each says of itself for files, lists and pages, beside its class.

The registry finds the laws of a package by what :func:`named` leaves on them, so that no list names them.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType, ModuleType
from typing import TypeVar

from hemivar.basics.stated import Argument, Form, arguments_of
from hemivar.errors import ProblemError

__all__ = ["LawEntry", "LawKind", "named", "named_in"]

Build = TypeVar("Build", bound=Callable[..., object])


class LawKind(StrEnum):
    """Which part of the contact law an entry describes, or that it is a material or a scheme."""

    NORMAL = "normal"
    FRICTION = "friction"
    MEMORY = "memory"
    MATERIAL = "material"
    SCHEME = "scheme"


@dataclass(frozen=True)
class LawEntry:
    """A law, a memory, a material or a scheme as it is known by name."""

    kind: LawKind
    name: str
    build: Callable[..., object]  # makes it from its parameters, which it states
    summary: str  # what the foundation or the material does; what a scheme is for
    formula: str  # j; of a material the stress or the stored energy; of a scheme its order and its step

    @property
    def parameters(self) -> tuple[Argument, ...]:
        """What it is made from."""
        return arguments_of(self.build)

    @property
    def noun(self) -> str:
        """What messages call it."""
        return "law" if self.kind in (LawKind.NORMAL, LawKind.FRICTION) else self.kind.value

    @property
    def key(self) -> str:
        """The key of its name in files."""
        return {LawKind.MEMORY: "kind", LawKind.SCHEME: "name"}.get(self.kind, "law")

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the parameters that must be given."""
        return tuple(p.key for p in self.parameters if p.required)

    @property
    def example(self) -> dict[str, object] | None:
        """Values that it is shown with, by their names in files; None where the user writes a formula or a table."""
        written = (Form.FILE, Form.TEXT)
        if any(one.stated.form in written and not one.stated.choices for one in self.parameters):
            return None
        return {one.key: one.shown for one in self.parameters if one.shown is not None}

    def make(self, **values: object) -> object:
        """The law or the material with these parameters, by their names in files."""
        known = {p.key: p.name for p in self.parameters}
        for key in values:
            if key not in known and not (key == "where" and "potential" in known):
                listed = ", ".join(known) or "none"
                raise ProblemError(f"{self.noun} '{self.name}' has no parameter '{key}' (parameters: {listed})")
        for key in self.required:
            if key not in values:
                raise ProblemError(f"{self.noun} '{self.name}' needs the parameter {key}")
        return self.build(**{known.get(key, key): value for key, value in values.items()})


def named(kind: LawKind, name: str, summary: str, formula: str) -> Callable[[Build], Build]:
    """Give a class or a function that makes laws its name in problem files, a line of description and its formula."""

    def mark(build: Build) -> Build:
        build.__entry__ = LawEntry(kind, name, build, summary, formula)  # type: ignore[attr-defined]
        return build

    return mark


def named_in(kind: LawKind, *packages: ModuleType) -> Mapping[str, LawEntry]:
    """All laws of a kind in the modules of packages by name, *none* last."""
    laws = {}
    for package in packages:
        for found in pkgutil.iter_modules(package.__path__):
            module = importlib.import_module(f"{package.__name__}.{found.name}")
            for value in vars(module).values():
                entry = vars(value).get("__entry__") if hasattr(value, "__dict__") else None
                if isinstance(entry, LawEntry) and entry.kind is kind and value.__module__ == module.__name__:
                    laws[entry.name] = entry
    return MappingProxyType({name: laws[name] for name in sorted(laws, key=lambda name: (name == "none", name))})
