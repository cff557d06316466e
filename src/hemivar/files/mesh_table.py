"""The table [mesh] of a problem file, read and written."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Literal, cast

from hemivar.basics.arguments import quoted
from hemivar.basics.memory import problem_bytes, refined_cells, require
from hemivar.basics.stated import keys_of
from hemivar.errors import ProblemError
from hemivar.files.schema import decode, encode
from hemivar.files.toml import TomlTable, context, kind, printable
from hemivar.mechanics.statement import ContactProblem, Geometry, Quadrature
from hemivar.mesh import Mesh
from hemivar.mesh.recipe import Assembly, Grid, Marking, MeshRecipe, Opening

#: What a mesh is made of, of which one is given.
_SOURCES = ("rectangle", "box", "file")
#: Keys of the table of a part.
_PART = (*_SOURCES, "cells", "pattern", "origin", *keys_of(MeshRecipe, table="mesh"))
_PLAIN = MeshRecipe(Path())

__all__ = ["StatedMesh", "file_name", "mesh_record", "read_mesh_table"]


@dataclass(frozen=True, eq=False)
class StatedMesh:
    """What the table [mesh] says."""

    recipe: MeshRecipe
    order: int | None  # polynomial degree of the elements
    quadrature: Quadrature
    geometry: Geometry
    trace_constant: float | None
    table: TomlTable  # where it stands, for messages

    def begin(self, halvings: int = 0) -> Mesh:
        """The mesh before refinement, from numbers of cells halved so many times."""
        try:
            return self.recipe.begin(halvings)
        except ProblemError as error:
            source = self.recipe.source
            if not isinstance(source, Path):
                raise ProblemError(f"{self.table.where(_of_mesh(self.recipe))}: {error}") from error
            named = "" if printable(source) in str(error) else f"'{printable(source)}': "
            raise self.table.error("file", f"{named}{error}") from error

    def build(self) -> Mesh:
        """The mesh; refused before it is made if a problem on it does not fit into memory."""
        refine = self.recipe.refine
        cells = self._cells(self.recipe)
        if cells is not None:
            dim, count = cells
            self._check_size("cells", dim, count)
            self._check_size("refine", dim, refined_cells(dim, count, refine))
            return self.begin().refined(refine)
        mesh = self.begin()
        self._check_size("refine", mesh.dim, refined_cells(mesh.dim, mesh.number_of_cells, refine))
        return mesh.refined(refine)

    def _cells(self, recipe: MeshRecipe) -> tuple[int, float] | None:
        """Dimension and number of cells before refinement; None where a file has to be read for it."""
        source = recipe.source
        if isinstance(source, Grid):
            dim = len(source.size)
            simplices = 6.0 if dim == 3 else 4.0 if source.pattern == "cross" else 2.0
            return dim, simplices * math.prod(map(float, source.cells))
        if isinstance(source, Path):
            return None
        parts = [(self._cells(part), part.refine) for part in source.parts.values()]
        known = [(cells[0], refined_cells(*cells, refine)) for cells, refine in parts if cells is not None]
        return (known[0][0], sum(count for _, count in known)) if len(known) == len(parts) else None

    def _check_size(self, key: str, dim: int, cells: float) -> None:
        order = self.order or 1
        degree = "" if order == 1 else f" of order {order}"
        with context(f"{self.table.where(key)}:"):
            require(problem_bytes(dim, cells, order), f"a problem on {cells:.3g} cells{degree}")


def read_mesh_table(table: TomlTable, folder: Path) -> StatedMesh:
    """What the table says; mesh files are looked for in a folder."""
    elements = decode(ContactProblem, table, part="mesh")
    quadrature = Quadrature(elements.get("quadrature", Quadrature.NODAL))
    geometry = Geometry(elements.get("geometry", Geometry.CURVED))
    order, constant = elements.get("order"), elements.get("trace_constant")
    return StatedMesh(_recipe(table, folder, order), order, quadrature, geometry, constant, table)


def _recipe(table: TomlTable, folder: Path, order: int | None) -> MeshRecipe:
    """How the mesh of a table is made: from a rectangle, a box or a file, or of the parts that have tables."""
    sources = [key for key in _SOURCES if key in table]
    names = [key for key, value in table.data.items() if isinstance(value, dict) and key != "boundaries"]
    source: Grid | Path | Assembly
    if names:
        for key in (*_SOURCES, "cells", "pattern", "origin"):
            if key in table:
                raise table.error(key, f"belongs to one part, but the mesh has parts; write it under [mesh.{names[0]}]")
        parts = {name: _recipe(table.table(name, _PART), folder, order) for name in names}
        source = Assembly(MappingProxyType(parts))
    else:
        if len(sources) != 1:
            given = f"{' and '.join(sources)} are given" if sources else "none is given"
            raise table.error("rectangle, box, file", f"{given}; give one of the three")
        source = _file(table, folder) if sources[0] == "file" else _grid(table, sources[0])
    recipe = decode(MeshRecipe, table, part="mesh", boundaries=_markings, opened=_openings)
    read_for = 1 if isinstance(source, Path) and order == 1 else None
    recipe |= {key: tuple(recipe[key]) for key in ("axis", "shift") if key in recipe}
    return MeshRecipe(source, **recipe, order=read_for)


def _markings(table: TomlTable) -> tuple[Marking, ...]:
    named = table.table("boundaries", None, inline=True)
    return tuple(Marking(name, named.text(name, "")) for name in named.data)


def _openings(table: TomlTable) -> tuple[Opening, ...]:
    value, how = table.data["opened"], 'write ["glue"], or [{ name = "glue", between = ["steel", "rubber"] }]'
    if not isinstance(value, list):
        raise table.error("opened", f"must be a list of names, not {kind(value)}; {how}")
    openings = []
    for entry in value:
        if isinstance(entry, str):
            openings.append(Opening(entry))
            continue
        names = entry.get("between") if isinstance(entry, dict) and entry.keys() == {"name", "between"} else None
        if not isinstance(names, list) or len(names) != 2 or not all(isinstance(name, str) for name in names):
            raise table.error("opened", f"{quoted(entry)} names no curve or surface inside the body; {how}")
        openings.append(Opening(str(entry["name"]), (names[0], names[1])))
    return tuple(openings)


def _of_mesh(recipe: MeshRecipe) -> str:
    """The key to which an error in placing or opening a mesh belongs."""
    given = [
        key
        for key in ("opened", "boundaries", "shift", "axis", "turn", "mirror", "scale")
        if getattr(recipe, key) != getattr(_PLAIN, key)
    ]
    return given[0] if given else ", ".join(recipe.source.parts) if isinstance(recipe.source, Assembly) else "cells"


def _file(table: TomlTable, folder: Path) -> Path:
    for key in ("cells", "pattern", "origin"):
        if key in table:
            raise table.error(key, "belongs to a rectangle or a box, but the mesh comes from a file; remove it")
    path = Path(table.text("file"))
    return path if path.is_absolute() else folder / path


def _grid(table: TomlTable, shape: str) -> Grid:
    dim, number, axes, sides = 3, "three", "x, y and z", "lengths along x, y and z"
    if shape == "rectangle":
        dim, number, axes, sides = 2, "two", "x and y", "width and height"
    elif "pattern" in table:
        raise table.error("pattern", "belongs to a rectangle; a box is cut in one way only: remove it")
    size = table.numbers(shape, dim, f"a list of {number} numbers, {sides}")
    if min(size) <= 0:
        raise table.error(shape, f"is {list(size)}; {sides} must be positive")
    if "cells" not in table:
        raise table.error("cells", f"is missing; give the numbers of cells along {axes}, such as {[32, 32, 32][:dim]}")
    given = table.data["cells"]
    if isinstance(given, list):
        several = table.items("cells", given, (dim,), f"one whole number or a list of {number}, along {axes}")
    else:
        several = [given] * dim
    counts = tuple(table.whole("cells", value, 1) for value in several)
    pattern = cast(Literal["cross", "right", "left"], table.text("pattern", "right", ["cross", "right", "left"]))
    origin = table.numbers("origin", dim, f"a list of {number} numbers, {axes}") if "origin" in table else (0.0,) * dim
    return Grid(size, counts, pattern, origin)


def mesh_record(recipe: MeshRecipe, problem: ContactProblem, folder: Path) -> dict[str, object]:
    """The table [mesh] for a mesh that was made like this, in a problem file of a folder."""
    elements = encode(problem, part="mesh")
    left_out = problem.mesh.suggested_order if recipe is problem.mesh.recipe else 1
    if problem.order == left_out and not recipe.linear:
        del elements["order"]
    return _recipe_record(recipe, folder) | elements


def _recipe_record(recipe: MeshRecipe, folder: Path) -> dict[str, object]:
    source = recipe.source
    record: dict[str, object]
    if isinstance(source, Assembly):
        record = {name: _recipe_record(part, folder) for name, part in source.parts.items()}
    elif isinstance(source, Path):
        record = {"file": file_name(source, folder)}
    else:
        record = {"rectangle" if len(source.size) == 2 else "box": source.size, "cells": source.cells}
        if len(source.size) == 2:
            record["pattern"] = source.pattern
        if any(source.origin):
            record["origin"] = source.origin
    placed = encode(
        recipe,
        part="mesh",
        boundaries=lambda marked: {one.name: one.condition for one in marked},
        opened=lambda parts: [
            one.name if one.between is None else {"name": one.name, "between": list(one.between)} for one in parts
        ],
    )
    return placed | record if isinstance(source, Assembly) else record | placed


def file_name(path: Path, folder: Path) -> str:
    """A file as a problem file in a folder names it: relative to that folder where there is a way."""
    target = os.path.realpath(path)
    try:
        return Path(os.path.relpath(target, os.path.realpath(folder))).as_posix()
    except ValueError:  # another drive
        return target
