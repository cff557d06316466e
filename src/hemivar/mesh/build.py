"""Built-in meshes: rectangles and boxes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import quoted
from hemivar.basics.arrays import real_array
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.types import IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.checks import check_grid, is_whole
from hemivar.mesh.keys import frozen
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.recipe import Grid, MeshRecipe
from hemivar.mesh.refine import Refinement

__all__ = ["box", "rectangle"]

_NUMBER = {2: "two", 3: "three"}
#: The triangle that the triangles of each quarter of a square are parts of: quarters by rows, triangles by columns.
_QUARTERS = {
    "right": [[0, 1], [0, 0], [1, 1], [0, 1]],
    "left": [[0, 0], [0, 1], [0, 1], [1, 1]],
    "cross": [[0, 0, 3, 3], [0, 1, 1, 0], [3, 2, 2, 3], [1, 1, 2, 2]],
}


@known_keywords
def rectangle(
    size: tuple[float, float] = (1.0, 1.0),
    cells: int | tuple[int, int] = 8,
    pattern: Literal["cross", "right", "left"] = "right",
    origin: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """A rectangle cut into triangles, with boundaries ``left``, ``right``, ``bottom`` and ``top``.

    Parameters
    ----------
    size : pair of floats
        Width and height.
    cells : int or pair of ints
        Number of small rectangles along x and y; one number serves for both.
    pattern : str
        ``"right"`` cuts each small rectangle by its rising diagonal, ``"left"`` by its falling one,
        ``"cross"`` into four triangles by its centre.
    origin : pair of floats
        The lower left corner.

    Returns
    -------
    Mesh

    Raises
    ------
    ProblemError
        If a length or a number of cells is not positive, the pattern is unknown, the mesh does not fit into memory, or
        the origin is so far away that rounding spoils the cells.

    Examples
    --------
    >>> import hemivar as hv
    >>> mesh = hv.rectangle((40.0, 10.0), (8, 2))
    >>> len(mesh.points), len(mesh.cells), sorted(mesh.boundaries)
    (27, 32, ['bottom', 'left', 'right', 'top'])
    """
    if not isinstance(pattern, str) or pattern not in ("cross", "right", "left"):
        raise ProblemError(f"pattern {quoted(pattern)} is unknown; choose 'cross', 'right' or 'left'")
    width, height = _lengths(size, 2)
    nx, ny = _counts(cells, 2)
    x0, y0 = _numbers(origin, 2, "origin", "coordinates")
    check_grid((width, height), (nx, ny), (x0, y0), 4 if pattern == "cross" else 2)
    x = x0 + width * np.arange(nx + 1) / nx
    y = y0 + height * np.arange(ny + 1) / ny
    points = np.column_stack([np.tile(x, ny + 1), np.repeat(y, nx + 1)])
    corner = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    a, b, c, d = corner, corner + 1, corner + nx + 2, corner + nx + 1
    if pattern == "cross":
        centre = len(points) + np.arange(nx * ny)
        middle = np.column_stack([np.tile(0.5 * (x[1:] + x[:-1]), ny), np.repeat(0.5 * (y[1:] + y[:-1]), nx)])
        points = np.vstack([points, middle])
        triangles = [(a, b, centre), (b, c, centre), (c, d, centre), (d, a, centre)]
    elif pattern == "right":
        triangles = [(a, b, c), (a, c, d)]
    else:
        triangles = [(a, b, d), (b, c, d)]
    connectivity = np.stack([np.column_stack(t) for t in triangles], axis=1).reshape(-1, 3)
    bottom = np.arange(nx + 1)
    top = bottom + ny * (nx + 1)
    left = np.arange(ny + 1) * (nx + 1)
    right = left + nx
    boundaries = {
        "left": np.column_stack([left[1:], left[:-1]]),
        "right": np.column_stack([right[:-1], right[1:]]),
        "bottom": np.column_stack([bottom[:-1], bottom[1:]]),
        "top": np.column_stack([top[1:], top[:-1]]),
    }
    grid = Grid((width, height), (nx, ny), pattern, (x0, y0))
    return Mesh.trusted(points, connectivity, boundaries, {}, _rectangle_parent(grid), MeshRecipe(grid))


@known_keywords
def box(
    size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    cells: int | tuple[int, int, int] = 8,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Mesh:
    """A box cut into tetrahedra.

    Boundaries: ``left`` and ``right`` (x), ``front`` and ``back`` (y), ``bottom`` and ``top`` (z). Each small box is
    cut into six tetrahedra around its diagonal from the lowest to the highest corner (Kuhn, Freudenthal); a box
    refined uniformly is a box of twice as many cells.

    Parameters
    ----------
    size : three floats
        Extent along x, y and z.
    cells : int or three ints
        Number of small boxes along x, y and z; one number serves for all.
    origin : three floats
        The corner of lowest coordinates.

    Returns
    -------
    Mesh

    Raises
    ------
    ProblemError
        If a length or a number of cells is not positive, the mesh does not fit into memory, or the origin is so far
        away that rounding spoils the cells.

    Examples
    --------
    >>> import hemivar as hv
    >>> mesh = hv.box((1.0, 1.0, 1.0), 2)
    >>> len(mesh.points), len(mesh.cells), sorted(mesh.boundaries)
    (27, 48, ['back', 'bottom', 'front', 'left', 'right', 'top'])
    """
    extent, lowest = _lengths(size, 3), _numbers(origin, 3, "origin", "coordinates")
    nx, ny, nz = _counts(cells, 3)
    check_grid(extent, (nx, ny, nz), lowest, 6)
    x, y, z = (lowest[k] + extent[k] * np.arange(n + 1) / n for k, n in enumerate((nx, ny, nz)))
    nodes = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    points = np.empty((*nodes.shape, 3))
    points[..., 0], points[..., 1], points[..., 2] = x, y[:, None], z[:, None, None]
    step = (1, nx + 1, (nx + 1) * (ny + 1))
    corner = nodes[:-1, :-1, :-1].ravel()
    connectivity = np.empty((len(corner), 6, 4), dtype=np.int64)
    for number, order in enumerate(permutations(range(3))):
        path = np.cumsum([0] + [step[axis] for axis in order])
        if order not in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            path = np.roll(path, -1)  # turns an inverted tetrahedron and keeps the diagonal that refinement takes
        connectivity[:, number] = corner[:, None] + path
    boundaries = {
        "left": _split_squares(nodes[:, :, 0])[:, ::-1],
        "right": _split_squares(nodes[:, :, -1]),
        "front": _split_squares(nodes[:, 0, :]),
        "back": _split_squares(nodes[:, -1, :])[:, ::-1],
        "bottom": _split_squares(nodes[0])[:, ::-1],
        "top": _split_squares(nodes[-1]),
    }
    grid = Grid(extent, (nx, ny, nz), "right", lowest)
    cut = connectivity.reshape(-1, 4)
    return Mesh.trusted(points.reshape(-1, 3), cut, boundaries, {}, _box_parent(grid), MeshRecipe(grid))


def _split_squares(nodes: IntArray) -> IntArray:
    """The squares of a grid of nodes cut by their rising diagonal, counterclockwise if columns are the first axis."""
    a, b, c, d = (part.ravel() for part in (nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]))
    return np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1).reshape(-1, 3)


def _box_parent(grid: Grid) -> Refinement | None:
    """What a box is the refinement of, if all its numbers of cells are even."""
    if any(number % 2 for number in grid.cells):
        return None
    nx, ny, _ = (n // 2 for n in grid.cells)
    ends = []
    for extra in (0, 1):
        i, j, k = ((np.arange(n + 1) + extra) // 2 for n in grid.cells)
        ends.append((i + (nx + 1) * (j[:, None] + (ny + 1) * k[:, None, None])).ravel())
    orders = list(permutations(range(3)))
    # a point of an eighth lies farther along the axes on whose upper side the eighth is; the others keep their order
    eighths = [
        [orders.index(tuple(sorted(order, key=lambda a: ~eighth >> a & 1))) for order in orders] for eighth in range(8)
    ]
    return Refinement(grid.build(1), frozen(np.column_stack(ends)), frozen(_cells_above(grid.cells, eighths)))


def _rectangle_parent(grid: Grid) -> Refinement | None:
    """What a rectangle is the refinement of, if both its numbers of cells are even."""
    if any(number % 2 for number in grid.cells):
        return None
    (nx, ny), pattern = grid.cells, grid.pattern
    width, centres = nx // 2 + 1, (nx // 2 + 1) * (ny // 2 + 1)
    sides = []
    for extra in (0, 1):
        i = (np.arange(nx + 1) + (1 - extra if pattern == "left" else extra)) // 2
        sides.append(i + width * ((np.arange(ny + 1) + extra) // 2)[:, None])
    if pattern == "cross":
        i, j = np.arange(nx), np.arange(ny)[:, None]
        middle = centres + (j // 2) * (nx // 2) + i // 2
        corner = (j // 2 + j % 2) * width + i // 2 + i % 2
        for side in sides:
            side[1::2, 1::2] = middle[::2, ::2]
        sides = [np.append(side, more) for side, more in zip(sides, (middle, corner), strict=True)]
    ends = frozen(np.column_stack([side.ravel() for side in sides]))
    return Refinement(grid.build(1), ends, frozen(_cells_above(grid.cells, _QUARTERS[pattern])))


def _cells_above(counts: Sequence[int], table: list[list[int]]) -> IntArray:
    """The cell of a grid of half as many boxes that each cell of a grid is a part of, (M,).

    ``table`` tells for each of the 2^d parts of a box, and each cell in the small box there, the cell of the box.
    """
    box, part, stride = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64), 1
    for axis, count in enumerate(counts):
        index = np.arange(count)[:, None]
        box = (box + stride * (index // 2)).ravel()
        part = (part + 2**axis * (index % 2)).ravel()
        stride *= count // 2
    return np.asarray(box[:, None] * len(table[0]) + np.array(table)[part], dtype=np.int64).ravel()


def _lengths(size: ArrayLike, axes: int) -> tuple[float, ...]:
    """Positive lengths along the axes."""
    lengths = _numbers(size, axes, "size", "lengths")
    if not all(length > 0.0 for length in lengths):
        raise ProblemError(f"size = {quoted(size)}; every length must be positive")
    return lengths


def _numbers(values: ArrayLike, axes: int, what: str, each: str) -> tuple[float, ...]:
    """One number for each axis."""
    numbers = real_array(values, what)
    if numbers.shape != (axes,):
        raise ProblemError(f"{what} = {quoted(values)}; give {_NUMBER[axes]} {each}")
    return tuple(numbers.tolist())


def _counts(cells: float | Sequence[float], axes: int) -> tuple[int, ...]:
    """Numbers of cells along the axes, from one number or one for each."""
    try:
        entries = [cast(float, cells)] * axes if np.ndim(cells) == 0 else list(cast(Sequence[float], cells))
    except (TypeError, ValueError) as error:
        raise ProblemError(f"cells = {quoted(cells)}; give one or {_NUMBER[axes]} numbers") from error
    if len(entries) != axes:
        raise ProblemError(f"cells = {quoted(cells)}; give one or {_NUMBER[axes]} numbers")
    if not all(is_whole(entry, 1) for entry in entries):
        along = "x and y" if axes == 2 else "x, y and z"
        raise ProblemError(f"cells = {quoted(cells)}; give whole numbers of at least 1 along {along}")
    return tuple(int(entry) for entry in entries)
