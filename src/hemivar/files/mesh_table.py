"""The table [mesh] of a problem file, read and written."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

from hemivar.basics.memory import problem_bytes, refined_cells, require
from hemivar.errors import ProblemError
from hemivar.files.schema import decode, encode
from hemivar.files.toml import TomlTable, context, printable
from hemivar.mechanics.scalar import ScalarProblem
from hemivar.mechanics.statement import ContactProblem, Quadrature
from hemivar.mesh import Grid, Mesh, MeshRecipe

__all__ = ["StatedMesh", "file_name", "mesh_record", "read_mesh_table"]


@dataclass(frozen=True, eq=False)
class StatedMesh:
    """What the table [mesh] says.

    Attributes
    ----------
    recipe : MeshRecipe
    order : int
        Polynomial degree of the elements.
    quadrature : Quadrature
    table : TomlTable
        Where it stands, for messages.
    """

    recipe: MeshRecipe
    order: int
    quadrature: Quadrature
    table: TomlTable

    def begin(self, halvings: int = 0) -> Mesh:
        """The mesh before refinement, from numbers of cells halved so many times."""
        source = self.recipe.source
        if isinstance(source, Grid):
            return self.recipe.begin(halvings)
        try:
            return self.recipe.begin()
        except ProblemError as error:
            named = "" if printable(source) in str(error) else f"'{printable(source)}': "
            raise self.table.error("file", f"{named}{error}") from error

    def build(self) -> Mesh:
        """The mesh; refused before it is made if a problem on it does not fit into memory."""
        source, refine = self.recipe.source, self.recipe.refine
        if isinstance(source, Grid):
            dim = len(source.size)
            simplices = 6.0 if dim == 3 else 4.0 if source.pattern == "cross" else 2.0
            count = simplices * math.prod(map(float, source.cells))
            self._check_size("cells", dim, count)
            self._check_size("refine", dim, refined_cells(dim, count, refine))
            return self.begin().refined(refine)
        mesh = self.begin()
        self._check_size("refine", mesh.dim, refined_cells(mesh.dim, mesh.number_of_cells, refine))
        return mesh.refined(refine)

    def _check_size(self, key: str, dim: int, cells: float) -> None:
        degree = "" if self.order == 1 else f" of order {self.order}"
        with context(f"{self.table.where(key)}:"):
            require(problem_bytes(dim, cells, self.order), f"a problem on {cells:.3g} cells{degree}")


def read_mesh_table(table: TomlTable, folder: Path) -> StatedMesh:
    """What the table says; mesh files are looked for in a folder."""
    sources = [key for key in ("rectangle", "box", "file") if key in table]
    if len(sources) != 1:
        given = f"{' and '.join(sources)} are given" if sources else "none is given"
        raise table.error("rectangle, box, file", f"{given}; give one of the three")
    source = _file(table, folder) if sources[0] == "file" else _grid(table, sources[0])
    recipe, elements = decode(MeshRecipe, table, part="mesh"), decode(ContactProblem, table, part="mesh")
    quadrature = Quadrature(elements.get("quadrature", Quadrature.NODAL))
    return StatedMesh(MeshRecipe(source, **recipe), elements.get("order", 1), quadrature, table)


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


def mesh_record(recipe: MeshRecipe, problem: ContactProblem | ScalarProblem, folder: Path) -> dict[str, object]:
    """The table [mesh] for a mesh that was made like this, in a problem file of a folder."""
    source = recipe.source
    record: dict[str, object]
    if isinstance(source, Grid):
        record = {"rectangle" if len(source.size) == 2 else "box": source.size, "cells": source.cells}
        if len(source.size) == 2:
            record["pattern"] = source.pattern
        if any(source.origin):
            record["origin"] = source.origin
    else:
        record = {"file": file_name(source, folder)}
    return record | encode(recipe, part="mesh") | encode(problem, part="mesh")


def file_name(path: Path, folder: Path) -> str:
    """A file as a problem file in a folder names it: relative to that folder where there is a way."""
    target = os.path.realpath(path)
    try:
        return Path(os.path.relpath(target, os.path.realpath(folder))).as_posix()
    except ValueError:  # another drive
        return target
