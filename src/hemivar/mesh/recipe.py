"""Provenance of a mesh: a rectangle, a box, a file or several of these, then placed, opened and refined."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated

if TYPE_CHECKING:
    from hemivar.mesh.mesh import Mesh

__all__ = ["Assembly", "Grid", "Marking", "MeshRecipe", "Opening"]


@dataclass(frozen=True)
class Grid:
    """A built-in mesh of a rectangle (two numbers each) or a box (three)."""

    size: tuple[float, ...]
    cells: tuple[int, ...]  # numbers along the axes
    pattern: Literal["cross", "right", "left"]  # how a small rectangle is cut; "right" for boxes
    origin: tuple[float, ...]  # the corner of lowest coordinates

    def build(self, halvings: int = 0) -> Mesh:
        """The mesh, with numbers of cells halved so many times."""
        with IMPORTS:
            from hemivar.mesh.build import box, rectangle

        size, cells, origin = self.size, tuple(n >> halvings for n in self.cells), self.origin
        if len(size) == 3:
            return box((size[0], size[1], size[2]), (cells[0], cells[1], cells[2]), (origin[0], origin[1], origin[2]))
        return rectangle((size[0], size[1]), (cells[0], cells[1]), self.pattern, (origin[0], origin[1]))


@dataclass(frozen=True)
class Assembly(PickleMixin):
    """Several meshes as one."""

    parts: Mapping[str, MeshRecipe]

    def build(self, halvings: int = 0) -> Mesh:
        """The mesh, with numbers of cells of built-in parts halved so many times."""
        with IMPORTS:
            from hemivar.mesh.mesh import Mesh

        return Mesh.assembled(
            {name: recipe.begin(halvings).refined(recipe.refine) for name, recipe in self.parts.items()}
        )


@dataclass(frozen=True)
class Opening:
    """A curve or surface inside a body that was opened."""

    name: str  # an interface of the mesh where no regions are named
    between: tuple[str, str] | None = None  # two regions: all facets between a cell of each


@dataclass(frozen=True)
class Marking:
    """A boundary that was named by a condition."""

    name: str
    condition: str  # true at the corners of its facets


@dataclass(frozen=True)
class MeshRecipe:
    """How a mesh was made, in the order of the fields, so that a file can say it."""

    source: Grid | Path | Assembly
    scale: float = field(
        default=1.0,
        metadata=stated(
            Form.NUMBER, "factor for all coordinates, such as `1e-3` from mm to m", above=0.0, table="mesh"
        ),
    )
    mirror: str = field(
        default="",
        metadata=stated(
            Form.TEXT,
            'the coordinate whose sign is changed: `"x"`, `"y"`, or `"z"` in space; names of boundaries stay',
            choices=("x", "y", "z"),
            table="mesh",
            left_out="not mirrored",
        ),
    )
    turn: float = field(
        default=0.0,
        metadata=stated(
            Form.NUMBER,
            "angle in degrees by which the mesh is turned about the origin, after `scale` and `mirror`",
            table="mesh",
        ),
    )
    axis: tuple[float, ...] = field(
        default=(),
        metadata=stated(
            Form.LIST,
            "in space, direction of the axis through the origin about which `turn` turns, such as `[0, 0, 1]`",
            table="mesh",
            left_out="none",
        ),
    )
    shift: tuple[float, ...] = field(
        default=(),
        metadata=stated(
            Form.LIST,
            "by how much the mesh is moved, a number for each direction, after `turn`",
            table="mesh",
            left_out="not moved",
        ),
    )
    boundaries: tuple[Marking, ...] = field(
        default=(),
        metadata=stated(
            Form.OWN,
            "boundaries beside those of the mesh, by conditions that are true at the corners of their facets, such as "
            '`{ right = "x > 39.9", hole = "(x - 5)^2 + y^2 < 4.01" }`',
            table="mesh",
            left_out="none",
        ),
    )
    opened: tuple[Opening, ...] = field(
        default=(),
        metadata=stated(
            Form.OWN,
            'curves or surfaces inside the body that are opened, by name, such as `["glue"]` or '
            '`[{ name = "glue", between = ["steel", "rubber"] }]`',
            table="mesh",
            left_out="none",
        ),
    )
    refine: int = field(
        default=0,
        metadata=stated(
            Form.WHOLE, "how many times every triangle is cut into four (tetrahedron into eight)", table="mesh"
        ),
    )
    order: int | None = None  # 1 where a mesh file was read for linear elements

    def begin(self, halvings: int = 0) -> Mesh:
        """The mesh before refinement, from numbers of cells halved so many times (0 for files)."""
        with IMPORTS:
            from hemivar.mesh.read import read_mesh

        source = self.source
        mesh = read_mesh(source, self.order) if isinstance(source, Path) else source.build(halvings)
        if self.scale != 1.0:
            mesh = mesh.scaled(self.scale)
        if self.mirror:
            mesh = mesh.mirrored(self.mirror)
        if self.turn or self.axis:
            mesh = mesh.rotated(math.radians(self.turn), self.axis or None)
        if self.shift:
            mesh = mesh.moved(np.eye(mesh.dim), self.shift)
        if self.boundaries:
            mesh = mesh.marked({one.name: one.condition for one in self.boundaries})
        for one in self.opened:
            mesh = mesh.opened(one.name, one.between)
        return mesh.made_by(replace(self, refine=0))

    def build(self) -> Mesh:
        """The mesh."""
        return self.begin().refined(self.refine)

    @property
    def grid(self) -> Grid | None:
        """The built-in mesh that it is, scaled and refined at most; None for others."""
        placed = bool(self.mirror or self.turn or self.shift or self.opened)
        return self.source if isinstance(self.source, Grid) and not placed else None

    @property
    def halvings(self) -> int:
        """How often the numbers of cells can be halved and stay at least 2; 0 where conditions would name others."""
        if self.boundaries:
            return 0
        if isinstance(self.source, Assembly):
            return min(recipe.halvings for recipe in self.source.parts.values())
        times = 0
        counts = self.source.cells if isinstance(self.source, Grid) else (1,)
        while all(n % 2 ** (times + 1) == 0 and n >> (times + 1) >= 2 for n in counts):
            times += 1
        return times

    def scaled(self, factor: float) -> MeshRecipe | None:
        """The recipe of the mesh times a factor; None where no recipe gives its coordinates to the last digit."""
        plain = self == MeshRecipe(self.source, order=self.order)
        return replace(self, scale=float(factor)) if plain else None

    def opening(self, name: str, between: tuple[str, str] | None) -> MeshRecipe | None:
        """The recipe of the mesh with one more curve or surface opened; None where it was refined before."""
        return replace(self, opened=(*self.opened, Opening(name, between))) if self.refine == 0 else None

    def marking(self, conditions: Mapping[str, str]) -> MeshRecipe | None:
        """The recipe of the mesh with more boundaries named; None where it was opened or refined before."""
        more = tuple(Marking(name, condition) for name, condition in conditions.items())
        early = self.refine == 0 and not self.opened
        return replace(self, boundaries=(*self.boundaries, *more)) if early else None

    @property
    def linear(self) -> bool:
        """Whether a mesh file in it was read for linear elements."""
        parts = self.source.parts.values() if isinstance(self.source, Assembly) else ()
        return self.order == 1 or any(part.linear for part in parts)

    @property
    def as_suggested(self) -> MeshRecipe:
        """The recipe with its mesh files read for the order that they suggest."""
        if not isinstance(self.source, Assembly):
            return replace(self, order=None)
        return replace(self, source=Assembly({name: part.as_suggested for name, part in self.source.parts.items()}))

    def refined(self) -> MeshRecipe:
        """The recipe of the mesh refined once more."""
        return replace(self, refine=self.refine + 1)
