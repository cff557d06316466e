"""How a mesh was made: a rectangle, a box or a file, then scaled, then refined."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.stated import Form, stated

if TYPE_CHECKING:
    from hemivar.mesh.mesh import Mesh

__all__ = ["Grid", "MeshRecipe"]


@dataclass(frozen=True)
class Grid:
    """A built-in mesh of a rectangle (two numbers each) or a box (three).

    Attributes
    ----------
    size : tuple of float
        Lengths of the sides.
    cells : tuple of int
        Numbers of small rectangles or boxes along the axes.
    pattern : str
        How a small rectangle is cut into triangles; ``"right"`` for boxes, which are cut in one way.
    origin : tuple of float
        The corner of lowest coordinates.
    """

    size: tuple[float, ...]
    cells: tuple[int, ...]
    pattern: Literal["cross", "right", "left"]
    origin: tuple[float, ...]

    def build(self, halvings: int = 0) -> Mesh:
        """The mesh, with numbers of cells halved so many times."""
        with IMPORTS:
            from hemivar.mesh import box, rectangle

        size, cells, origin = self.size, tuple(n >> halvings for n in self.cells), self.origin
        if len(size) == 3:
            return box((size[0], size[1], size[2]), (cells[0], cells[1], cells[2]), (origin[0], origin[1], origin[2]))
        return rectangle((size[0], size[1]), (cells[0], cells[1]), self.pattern, (origin[0], origin[1]))


@dataclass(frozen=True)
class MeshRecipe:
    """How a mesh was made, so that a file can say it.

    Attributes
    ----------
    source : Grid or Path
        A built-in mesh, or a mesh file.
    scale : float
        Factor of all coordinates.
    refine : int
        How often the mesh was refined after that.
    """

    source: Grid | Path
    scale: float = field(
        default=1.0,
        metadata=stated(
            Form.NUMBER, "factor for all coordinates, such as `1e-3` from mm to m", above=0.0, table="mesh"
        ),
    )
    refine: int = field(
        default=0,
        metadata=stated(
            Form.WHOLE, "how many times every triangle is cut into four (tetrahedron into eight)", table="mesh"
        ),
    )

    def begin(self, halvings: int = 0) -> Mesh:
        """The mesh before refinement, from numbers of cells halved so many times (0 for files)."""
        with IMPORTS:
            from hemivar.mesh import read_mesh

        mesh = self.source.build(halvings) if isinstance(self.source, Grid) else read_mesh(self.source)
        return mesh if self.scale == 1.0 else mesh.scaled(self.scale)

    def build(self) -> Mesh:
        """The mesh."""
        return self.begin().refined(self.refine)

    @property
    def halvings(self) -> int:
        """How often the numbers of cells can be halved and stay at least 2."""
        times = 0
        counts = self.source.cells if isinstance(self.source, Grid) else (1,)
        while all(n % 2 ** (times + 1) == 0 and n >> (times + 1) >= 2 for n in counts):
            times += 1
        return times

    def scaled(self, factor: float) -> MeshRecipe | None:
        """The recipe of the mesh times a factor; None where no recipe gives its coordinates to the last digit."""
        plain = self.scale == 1.0 and self.refine == 0
        return replace(self, scale=float(factor)) if plain else None

    def refined(self) -> MeshRecipe:
        """The recipe of the mesh refined once more."""
        return replace(self, refine=self.refine + 1)
