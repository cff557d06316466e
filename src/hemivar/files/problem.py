"""Problem files: a contact problem stated in TOML.

Every key is documented in ``docs/problem-file.md``.  Reading is strict: a key that is not known, a value of
the wrong type or shape, a name that the mesh does not have, are reported in one line that names file, table
and key.
"""

from __future__ import annotations

import difflib
import math
import os
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from hemivar.basics import disk
from hemivar.basics.memory import problem_bytes, refined_cells, require
from hemivar.errors import FileError, ProblemError
from hemivar.formula import VARIABLES, Formula, FormulaArray, ScalarFormula
from hemivar.laws.bounds import CoulombBound, PenetrationBound
from hemivar.laws.columns import BOUND_COLUMNS, read_columns
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS, LawEntry, LawKind, LawParameter, ParameterForm
from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Pressure, Roller, Support, Traction
from hemivar.mechanics.material import Material, PlaneState
from hemivar.mechanics.obstacles import Cylinder, Normals, Obstacle, Plane, SignedDistance, Sphere
from hemivar.mechanics.statement import Contact, ContactProblem, Quadrature
from hemivar.mesh import Mesh, box, read_mesh, rectangle

__all__ = [
    "KEYS",
    "SAMPLE",
    "MeshRecipe",
    "ProblemFile",
    "SolverSettings",
    "parse_problem",
    "parse_problem_file",
    "read_problem",
    "read_problem_file",
    "read_text",
]

#: Keys of each table; tables named after boundaries or regions are written with a star.
KEYS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "": ("title", "mesh", "material", "loads", "supports", "contact", "solver"),
        "mesh": (
            "rectangle",
            "box",
            "cells",
            "pattern",
            "origin",
            "file",
            "scale",
            "refine",
            "order",
            "quadrature",
        ),
        "material": ("lame", "young", "poisson", "tensor", "out_of_plane", "plane", "regions"),
        "material.regions.*": ("lame", "young", "poisson", "tensor", "out_of_plane", "plane"),
        "loads": ("body", "traction", "pressure"),
        "contact.*": ("normal", "friction", "gap", "obstacle", "normals"),
        "solver": ("method", "rtol", "max_steps", "max_time"),
    }
)

#: Bytes of a problem file.
_MOST_BYTES = 16 * 2**20
#: Characters of a value that a message repeats.
_SHOWN = 60

Quantity = float | Formula


@dataclass(frozen=True)
class SolverSettings:
    """What the ``[solver]`` table of a problem file asks for; ``None`` where it says nothing.

    Attributes
    ----------
    method : str or None
        Name of a method, as in :data:`hemivar.solvers.METHODS`.
    rtol : float or None
        Relative tolerance of the residual.
    max_steps : int or None
    max_time : float or None
        Seconds.
    """

    method: str | None = None
    rtol: float | None = None
    max_steps: int | None = None
    max_time: float | None = None


@dataclass(frozen=True, eq=False)
class ProblemFile:
    """A problem file that has been read.

    Attributes
    ----------
    problem : ContactProblem
    solver : SolverSettings
    name : str
        The file, as it is named in messages.
    coarser_meshes : callable
        Makes the coarser meshes of the same body, coarsest first, for a warm start; the list is empty if the
        file describes none (an odd number of cells, or a mesh file without ``refine``).
    """

    problem: ContactProblem
    solver: SolverSettings = field(default_factory=SolverSettings)
    name: str = "problem"
    coarser_meshes: Callable[[], list[Mesh]] = list


def read_problem(path: str | Path) -> ContactProblem:
    """Read a contact problem from a TOML file.

    Parameters
    ----------
    path : str or Path
        Mesh files named in it are looked for in its folder.

    Raises
    ------
    ProblemError
        If the file cannot be read or does not state a problem; one line that names file, table and key.
    """
    return read_problem_file(path).problem


def read_problem_file(path: str | Path) -> ProblemFile:
    """Like :func:`read_problem`, with the settings for the solver and the hierarchy of meshes."""
    return parse_problem_file(read_text(path), Path(path).parent, str(path))


def read_text(path: str | Path) -> str:
    """The text of a problem file, which is a regular file of at most 16 MiB."""
    try:
        return disk.read_text(path, "problem file", _MOST_BYTES)
    except FileError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            what = "the problem file does not exist; check the path, or write one with 'hemivar new'"
            raise FileError(f"{_printable(path)}: {what}") from error
        if os.path.isdir(path):
            raise FileError(f"{_printable(path)}: this is a folder; name the problem file in it") from error
        raise


def parse_problem(text: str, base_dir: str | Path = ".", name: str = "problem") -> ContactProblem:
    """A contact problem from the text of a problem file.

    Parameters
    ----------
    text : str
        TOML.
    base_dir : str or Path
        Where mesh files are looked for.
    name : str
        What messages call the file.

    Raises
    ------
    ProblemError
    """
    return parse_problem_file(text, base_dir, name).problem


def parse_problem_file(
    text: str,
    base_dir: str | Path = ".",
    name: str = "problem",
    place: Callable[[MeshRecipe], Mesh] | None = None,
) -> ProblemFile:
    """Like :func:`parse_problem`, with the settings for the solver and the hierarchy of meshes.

    ``place`` makes the mesh in another way than whole; what the file says is then checked on what it makes.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ProblemError(f"{name}: not valid TOML: {error}; mend that line") from None
    except RecursionError:
        raise ProblemError(f"{name}: brackets or tables are nested too deeply for a problem file; mend it") from None
    except ValueError as error:
        raise ProblemError(f"{name}: not valid TOML ({error}); mend it") from None
    top = _Table(data, name, "", KEYS[""])
    for key in ("mesh", "material"):
        if key not in data:
            raise ProblemError(f"{name}: the table [{key}] is missing; add it")
    solver = _solver(top.table("solver", KEYS["solver"]))
    recipe, order, quadrature = _mesh(top.table("mesh", KEYS["mesh"]), Path(base_dir), whole=place is None)
    mesh = recipe.build() if place is None else place(recipe)
    reader = _Reader(mesh, Path(base_dir))
    material = reader.material(top.table("material", KEYS["material"]))
    with _context(f"{name}: [material]"):
        reader.check_material(material)
    loads = top.table("loads", KEYS["loads"])
    body, tractions = reader.loads(loads)
    supports = reader.supports(top.table("supports", None))
    contact = reader.contacts(top.table("contact", None))
    if order == 2 and mesh.dim == 3 and contact:
        raise top.table("mesh", None).error("order", "contact in 3D needs elements of order 1; write order = 1")
    if quadrature is Quadrature.MIDPOINT and mesh.dim == 3 and contact:
        raise top.table("mesh", None).error(
            "quadrature",
            "midpoints are for plane bodies: in 3D there are about twice as many facets as nodes, more pressures than "
            'displacements can tell apart; write quadrature = "nodal"',
        )
    with _context(f"{name}: [contact]"):
        problem = ContactProblem(
            mesh=mesh,
            material=material,
            contact=contact,
            supports=supports,
            body_force=body,
            tractions=tractions,
            title=top.text("title", ""),
            order=order,
            quadrature=quadrature,
        )
    return ProblemFile(problem, solver, name, recipe.coarser)


# ---- tables ----------------------------------------------------------------------------------------------


class _Table:
    """A table of the file that knows where it stands; every accessor raises an error that says so."""

    def __init__(
        self,
        data: Mapping[str, Any],
        source: str,
        name: str,
        keys: Iterable[str] | None,
        prefix: str = "",
    ) -> None:
        self.data = data
        self.source = source
        self.name = name
        self.prefix = prefix
        if keys is not None:
            self.only(tuple(keys))

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def where(self, key: str) -> str:
        """File, table and key, as messages begin."""
        table = f"[{self.name}] " if self.name else ""
        return f"{self.source}: {table}{self.prefix}{key}"

    def error(self, key: str, what: str) -> ProblemError:
        return ProblemError(f"{self.where(key)}: {what}")

    def only(self, keys: tuple[str, ...]) -> None:
        """Refuse keys that are not known."""
        for key in self.data:
            if key in keys:
                continue
            kind = "table" if isinstance(self.data[key], dict) and not self.name else "key"
            elsewhere = [
                f"[{table}]" if table else "the top of the file"
                for table, known in KEYS.items()
                if key in known and not self.prefix
            ]
            close = difflib.get_close_matches(key, keys, n=1)
            if close:
                hint = f"did you mean '{close[0]}'?"
            elif elsewhere:
                hint = f"it belongs in {elsewhere[0].replace('*', 'NAME')}"
            else:
                hint = "remove it"
            raise self.error(key, f"unknown {kind}; {hint} (known here: {', '.join(keys) or 'none'})")

    def table(self, key: str, keys: Iterable[str] | None, inline: bool = False) -> _Table:
        """The table under a key, empty if it is missing."""
        value = self.data.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, f"must be a table, not {_kind(value)}; write [{self._path(key)}]")
        if inline:
            return _Table(value, self.source, self.name, keys, f"{self.prefix}{key}.")
        return _Table(value, self.source, self._path(key), keys)

    def _path(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def text(self, key: str, default: str | None = None, choices: Sequence[str] | None = None) -> str:
        value = self.data.get(key, default)
        if not isinstance(value, str):
            quoted = f"; write one of {_list(choices)}" if choices else "; put it in quotes"
            raise self.error(key, f"must be a text, not {_kind(value)}{quoted}")
        if choices is not None and value not in choices:
            raise self.error(key, f"'{value}' is not known{_hint(value, choices)}")
        return value

    def _plain(self, key: str, value: Any, what: str = "a number") -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"must be {what}, not {_kind(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"is {number}; give a finite number")
        return number

    def positive(self, key: str) -> float:
        number = self._plain(key, self.data[key])
        if not number > 0:
            raise self.error(key, f"is {number:g}; it must be positive")
        return number

    def whole(self, key: str, value: Any, minimum: int) -> int:
        number = self._plain(key, value, "a whole number")
        if number != int(number) or number < minimum:
            raise self.error(key, f"is {_shown(value)}; give a whole number of at least {minimum}")
        return int(number)

    def items(self, key: str, value: Any, lengths: tuple[int, ...], what: str) -> list[Any]:
        """A list of one of the lengths."""
        if not isinstance(value, list):
            raise self.error(key, f"must be {what}, not {_kind(value)}")
        if len(value) not in lengths:
            raise self.error(key, f"has {len(value)} entries; it must be {what}")
        return value

    def numbers(self, key: str, length: int, what: str) -> tuple[float, ...]:
        return tuple(self._plain(key, v) for v in self.items(key, self.data[key], (length,), what))

    def quantity(
        self, key: str, value: Any, dim: int, minimum: float = -math.inf, above: float | None = None
    ) -> Quantity:
        """A number, or a formula of the coordinates."""
        if isinstance(value, str):
            formula = Formula(value, self.where(key), minimum if minimum > -math.inf else None)
            foreign = sorted(formula.variables - set(VARIABLES[:dim]))
            if foreign:
                raise self.error(key, f"formula '{value}' uses {foreign[0]}, but the mesh is plane; use x and y")
            if formula.variables:
                return formula
            number = float(Formula(value, self.where(key))(np.zeros((1, dim)))[0])
        else:
            number = self._plain(key, value, "a number or a formula in quotes")
        if number < minimum:
            raise self.error(key, f"is {number:g}; it must be at least {minimum:g}")
        if above is not None and not number > above:
            raise self.error(key, f"is {number:g}; it must be greater than {above:g}")
        return number

    def vector(self, key: str, value: Any, dim: int) -> Any:
        """A vector of numbers, or a function of the coordinates."""
        what = f"a list of {dim} numbers or formulas, one for each direction"
        return _array([self.quantity(key, v, dim) for v in self.items(key, value, (dim,), what)], (dim,))


def _array(entries: list[Quantity], shape: tuple[int, ...]) -> Any:
    if any(isinstance(entry, Formula) for entry in entries):
        return FormulaArray(tuple(entries), shape)
    return np.array(entries, dtype=float).reshape(shape)


def _kind(value: Any) -> str:
    """What a TOML value is, in words."""
    match value:
        case None:
            return "missing"
        case bool():
            return str(value).lower()
        case str():
            return f"the text '{_shown(value)}'"
        case list():
            return "a list"
        case dict():
            return "a table"
        case int() | float():
            return f"the number {_shown(value)}"
    return _shown(value)


def _shown(value: Any) -> str:
    """A value as a message repeats it: in one line that is not too long."""
    text = _printable(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def _printable(value: Any) -> str:
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(value))


def _list(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _hint(name: str, known: Sequence[str], what: str = "known") -> str:
    close = difflib.get_close_matches(name, known, n=1)
    guess = f"; did you mean '{close[0]}'?" if close else ""
    return f"{guess} ({what}: {', '.join(known) or 'none'})"


@contextmanager
def _context(where: str) -> Iterator[None]:
    """Put a place before the message of an error."""
    try:
        yield
    except ProblemError as error:
        message = str(error)
        placed = message.startswith(where.split(": ")[0] + ": ")
        raise ProblemError(message if placed else f"{where} {message}") from error


# ---- mesh ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MeshRecipe:
    """How to make the mesh, and the coarser meshes of the same body.

    Attributes
    ----------
    start : function
        Makes the mesh before refinement, built with numbers of cells halved so many times, unscaled.
    halvings : int
        How often they can be halved.
    scale : float
        Factor of all coordinates.
    refine : int
        How often the mesh is refined in the end.
    grid : tuple or None
        Origin, extent and numbers of cells of a built-in mesh, unscaled.
    crossed : bool
        Whether the triangles of a built-in mesh meet in the centres of squares, where they have their last node.
    cells : float or None
        Number of cells of the mesh in the end, where it is known before it is made; it may be inf.
    """

    start: Callable[[int], Mesh]
    halvings: int
    scale: float
    refine: int
    grid: tuple[tuple[float, ...], tuple[float, ...], tuple[int, ...]] | None = None
    crossed: bool = False
    cells: float | None = None

    def begin(self, halvings: int) -> Mesh:
        """The mesh before refinement, from numbers of cells halved so many times."""
        mesh = self.start(halvings)
        return mesh if self.scale == 1.0 else mesh.scaled(self.scale)

    def build(self) -> Mesh:
        return self.begin(0).refined(self.refine)

    def coarser(self) -> list[Mesh]:
        meshes = [self.begin(halvings) for halvings in range(self.halvings, 0, -1)]
        if self.refine:
            meshes.append(self.begin(0))
            for _ in range(self.refine - 1):
                meshes.append(meshes[-1].refined())
        return meshes


def _mesh(table: _Table, folder: Path, whole: bool) -> tuple[MeshRecipe, int, Quadrature]:
    sources = [key for key in ("rectangle", "box", "file") if key in table]
    if len(sources) != 1:
        given = f"{' and '.join(sources)} are given" if sources else "none is given"
        raise table.error("rectangle, box, file", f"{given}; give one of the three")
    source = sources[0]
    refine = table.whole("refine", table.data.get("refine", 0), 0)
    scale = table.positive("scale") if "scale" in table else 1.0
    order = table.whole("order", table.data.get("order", 1), 1)
    if order > 2:
        raise table.error("order", f"is {order}; elements of order 1 and 2 exist")
    quadrature = Quadrature(table.text("quadrature", "nodal", [q.value for q in Quadrature]))
    if source == "file":
        for key in ("cells", "pattern", "origin"):
            if key in table:
                raise table.error(key, "belongs to a rectangle or a box, but the mesh comes from a file; remove it")
        path = Path(table.text("file"))
        path = path if path.is_absolute() else folder / path

        @cache
        def read(_: int) -> Mesh:
            try:
                mesh = read_mesh(path)
            except ProblemError as error:
                named = "" if _printable(path) in str(error) else f"'{_printable(path)}': "
                raise table.error("file", f"{named}{error}") from error
            if whole:
                _check_size(table, "refine", mesh.dim, refined_cells(mesh.dim, mesh.number_of_cells, refine), order)
            return mesh

        return MeshRecipe(read, 0, scale, refine), order, quadrature

    dim, number, axes, sides = 3, "three", "x, y and z", "lengths along x, y and z"
    if source == "rectangle":
        dim, number, axes, sides = 2, "two", "x and y", "width and height"
    elif "pattern" in table:
        raise table.error("pattern", "belongs to a rectangle; a box is cut in one way only: remove it")
    size = table.numbers(source, dim, f"a list of {number} numbers, {sides}")
    if min(size) <= 0:
        raise table.error(source, f"is {list(size)}; {sides} must be positive")
    if "cells" not in table:
        raise table.error("cells", f"is missing; give the numbers of cells along {axes}, such as {[32, 32, 32][:dim]}")
    given = table.data["cells"]
    if isinstance(given, list):
        several = table.items("cells", given, (dim,), f"one whole number or a list of {number}, along {axes}")
    else:
        several = [given] * dim
    counts = [table.whole("cells", value, 1) for value in several]
    pattern: Any = table.text("pattern", "right", ["cross", "right", "left"])
    origin = table.numbers("origin", dim, f"a list of {number} numbers, {axes}") if "origin" in table else (0.0,) * dim
    simplices = (6.0 if dim == 3 else 4.0 if pattern == "cross" else 2.0) * math.prod(map(float, counts))
    finest = refined_cells(dim, simplices, refine)
    if whole:
        _check_size(table, "cells", dim, simplices, order)
        _check_size(table, "refine", dim, finest, order)
    halvings = 0
    while all(n % 2 ** (halvings + 1) == 0 and n >> (halvings + 1) >= 2 for n in counts):
        halvings += 1

    def start(times: int) -> Mesh:
        cells = [n >> times for n in counts]
        if source == "box":
            return box((size[0], size[1], size[2]), (cells[0], cells[1], cells[2]), (origin[0], origin[1], origin[2]))
        return rectangle((size[0], size[1]), (cells[0], cells[1]), pattern, (origin[0], origin[1]))

    grid = (tuple(origin), tuple(size), tuple(counts))
    return MeshRecipe(start, halvings, scale, refine, grid, pattern == "cross", finest), order, quadrature


def _check_size(table: _Table, key: str, dim: int, cells: float, order: int) -> None:
    """Refuse a problem that does not fit into memory before its mesh is made."""
    kind = "" if order == 1 else f" of order {order}"
    with _context(f"{table.where(key)}:"):
        require(problem_bytes(dim, cells, order), f"a problem on {cells:.3g} cells{kind}")


# ---- everything that refers to the mesh ------------------------------------------------------------------


class _Reader:
    """Reads what lives on a mesh."""

    def __init__(self, mesh: Mesh, folder: Path) -> None:
        self.mesh = mesh
        self.folder = folder
        self.dim = mesh.dim

    def check_boundary(self, table: _Table, name: str) -> None:
        known = list(self.mesh.boundaries)
        if name not in known:
            raise table.error(name, f"the mesh has no boundary '{name}'{_hint(name, known, 'boundaries')}")

    # -- material

    def material(self, table: _Table) -> Material:
        if "regions" not in table:
            return self.one_material(table)
        for key in table.data:
            if key != "regions":
                raise table.error(key, "cannot stand beside regions; state it in every [material.regions.NAME]")
        regions = table.table("regions", None)
        if not regions.data:
            raise table.error("regions", "is empty; add tables [material.regions.NAME]")
        known = list(self.mesh.regions)
        parts: dict[str, Material] = {}
        for name in regions.data:
            if name not in known:
                raise regions.error(name, f"the mesh has no region '{name}'{_hint(name, known, 'regions')}")
            parts[name] = self.one_material(regions.table(name, KEYS["material.regions.*"]))
        return Material.by_region(parts)

    def check_material(self, material: Material) -> None:
        """Evaluate the material in every cell, so that its errors come before everything else."""
        mesh = self.mesh
        if not mesh.number_of_cells:  # a rank without a part of the body
            return
        masks = {}
        for name, cells in mesh.regions.items():
            masks[name] = np.zeros(mesh.number_of_cells, dtype=bool)
            masks[name][cells] = True
        material.stiffness_tensor(mesh.points[mesh.cells].mean(axis=1), masks)

    def one_material(self, table: _Table) -> Material:
        ways = [way for way in ("lame", "young", "tensor") if way in table]
        if len(ways) != 1:
            found = f"{' and '.join(ways)} are given" if ways else "no elastic constants are given"
            raise table.error("lame, young, tensor", f"{found}; give lame, or young and poisson, or tensor")
        owner = {"poisson": ("young",), "out_of_plane": ("tensor",), "plane": ("lame", "young")}
        for key, allowed in owner.items():
            if key in table and ways[0] not in allowed:
                raise table.error(key, f"goes with {' or '.join(allowed)}, not with {ways[0]}; remove it")
        if "plane" in table and self.dim == 3:
            raise table.error("plane", "is for plane meshes, but this mesh is three-dimensional; remove it")
        plane = table.text("plane", "strain", [state.value for state in PlaneState])
        if ways[0] == "tensor":
            return self.tensor(table)
        if ways[0] == "lame":
            what = "a list of two numbers or formulas, lambda and mu"
            lam, mu = table.items("lame", table.data["lame"], (2,), what)
            first = table.quantity("lame", lam, self.dim)
            second = table.quantity("lame", mu, self.dim)
            if not isinstance(second, Formula) and not second > 0:
                raise table.error("lame", f"mu is {second:g}; it must be positive")
            with _context(f"{table.where('lame')}:"):
                return Material.lame(first, second, plane)
        if "poisson" not in table:
            raise table.error("poisson", "is missing; give it along with young")
        young = table.quantity("young", table.data["young"], self.dim, above=0.0)
        poisson = table.quantity("poisson", table.data["poisson"], self.dim)
        if not isinstance(poisson, Formula) and not -1 < poisson < 0.5:
            raise table.error("poisson", f"is {poisson:g}; it must lie between -1 and 0.5, both excluded")
        with _context(f"{table.where('young, poisson')}:"):
            return Material.young(young, poisson, plane)

    def tensor(self, table: _Table) -> Material:
        size = 3 if self.dim == 2 else 6
        what = f"{size} lists of {size} numbers or formulas, the rows of the elasticity matrix"
        rows = table.items("tensor", table.data["tensor"], (size,), what)
        entries = [
            table.quantity("tensor", value, self.dim)
            for row in rows
            for value in table.items("tensor", row, (size,), what)
        ]
        out = table.numbers("out_of_plane", 3, "a list of three numbers") if "out_of_plane" in table else None
        with _context(f"{table.where('tensor')}:"):
            return Material.tensor(_array(entries, (size, size)), out)

    # -- loads and supports

    def loads(self, table: _Table) -> tuple[Any, dict[str, Traction]]:
        body = table.vector("body", table.data["body"], self.dim) if "body" in table else 0.0
        traction = table.table("traction", None, inline=True)
        pressure = table.table("pressure", None, inline=True)
        tractions: dict[str, Traction] = {}
        for name, value in traction.data.items():
            self.check_boundary(traction, name)
            tractions[name] = traction.vector(name, value, self.dim)
        for name, value in pressure.data.items():
            self.check_boundary(pressure, name)
            if name in tractions:
                raise pressure.error(name, "this boundary has a traction too; give one of the two")
            tractions[name] = Pressure(pressure.quantity(name, value, self.dim))
        return body, tractions

    def supports(self, table: _Table) -> dict[str, Support]:
        found: dict[str, Support] = {}
        for name, value in table.data.items():
            self.check_boundary(table, name)
            if isinstance(value, str):
                chosen = table.text(name, None, ["clamped", "roller"])
                found[name] = Clamped() if chosen == "clamped" else Roller()
                continue
            if not isinstance(value, dict):
                ways = '"clamped", "roller", { x = 0.0 } or { displacement = [...] }'
                raise table.error(name, f"must be {ways}, not {_kind(value)}")
            axes = VARIABLES[: self.dim]
            held = table.table(name, (*axes, "displacement"), inline=True)
            if "displacement" in held:
                if len(held.data) > 1:
                    raise held.error("displacement", "fixes every direction; remove the single ones")
                found[name] = Prescribed(held.vector("displacement", value["displacement"], self.dim))
            elif not held.data:
                raise table.error(name, 'fixes nothing; give x, y or displacement, or write "clamped"')
            else:
                found[name] = Fixed(**{axis: held.quantity(axis, v, self.dim) for axis, v in value.items()})
        return found

    # -- contact

    def contacts(self, table: _Table) -> dict[str, Contact]:
        found: dict[str, Contact] = {}
        for name in table.data:
            self.check_boundary(table, name)
            one = table.table(name, KEYS["contact.*"])
            if "normal" not in one:
                raise one.error("normal", f"is missing; name a normal law ({', '.join(NORMAL_LAWS)})")
            normal = self.law(one, "normal", NORMAL_LAWS)
            friction = self.law(one, "friction", FRICTION_LAWS)
            gap = one.quantity("gap", one.data.get("gap", 0.0), self.dim)
            obstacle = self.obstacle(one) if "obstacle" in one else None
            normals = None
            if obstacle is None and "normals" in one:
                raise one.error("normals", "says whose normals contact with an obstacle has; add obstacle or remove it")
            if obstacle is not None:
                if "gap" in one:
                    raise one.error("gap", "follows from the obstacle; give one of the two")
                normals = Normals(one.text("normals", Normals.OBSTACLE, [way.value for way in Normals]))
            with _context(f"{one.where('normal')}:"):
                found[name] = Contact(normal, friction, gap, obstacle, normals)
        return found

    def obstacle(self, table: _Table) -> Obstacle:
        """A rigid obstacle: a table with one of plane, sphere, cylinder and distance."""
        given = table.table("obstacle", tuple(_OBSTACLES), inline=True)
        if len(given.data) != 1:
            ways = "{ plane = ... }, { sphere = ... }, { cylinder = ... } or { distance = FORMULA }"
            raise table.error("obstacle", f"give one of {ways}")
        shape = next(iter(given.data))
        if shape == "distance":
            distance = given.quantity(shape, given.data[shape], self.dim)
            if not isinstance(distance, Formula):
                raise given.error(shape, f"is {distance:g} everywhere; give a formula of the coordinates in quotes")
            return SignedDistance(distance)
        if shape == "cylinder" and self.dim == 2:
            raise given.error(shape, "in the plane it is a circle; write sphere = { center = ..., radius = ... }")
        one = given.table(shape, _OBSTACLES[shape], inline=True)
        missing = [key for key in _OBSTACLES[shape] if key not in one and key != "inside"]
        if missing:
            raise one.error(missing[0], f"is missing; write {shape} = {{ {' = ..., '.join(missing)} = ... }}")
        what = f"a list of {self.dim} numbers"
        vectors = {key: one.numbers(key, self.dim, what) for key in _OBSTACLES[shape] if key in _VECTORS}
        with _context(f"{given.where(shape)}:"):
            if shape == "plane":
                return Plane(**vectors)
            inside = one.data.get("inside", False)
            if not isinstance(inside, bool):
                raise one.error("inside", f"must be true or false, not {_kind(inside)}")
            kind = Sphere if shape == "sphere" else Cylinder
            return kind(**vectors, radius=one.positive("radius"), inside=inside)

    def law(self, table: _Table, key: str, laws: Mapping[str, LawEntry]) -> Any:
        value = table.data.get(key, "none")
        if isinstance(value, str):
            value = {"law": value}
        if not isinstance(value, dict):
            example = f'{{ law = "{next(iter(laws))}", ... }}'
            raise table.error(key, f"must be a law such as {example}, not {_kind(value)}")
        given = _Table(value, table.source, table.name, None, f"{table.prefix}{key}.")
        if "law" not in given:
            raise table.error(key, f"does not name a law; add law = one of {_list(list(laws))}")
        if not isinstance(value["law"], str):
            raise given.error("law", f"must be one of {_list(list(laws))}, not {_kind(value['law'])}")
        name = value["law"]
        if name not in laws:
            other = FRICTION_LAWS if laws is NORMAL_LAWS else NORMAL_LAWS
            if name in other:
                kind = other[name].kind
                raise given.error(
                    "law", f"'{name}' is a {kind} law; use it under {kind} (known here: {', '.join(laws)})"
                )
            raise given.error("law", f"'{name}' is not a {_KIND[key]} law{_hint(name, list(laws))}")
        entry = laws[name]
        given.only(("law", *(p.name for p in entry.parameters)))
        parameters: dict[str, Any] = {}
        for parameter in entry.parameters:
            if parameter.name in given:
                parameters[parameter.name] = self.parameter(given, parameter)
            elif parameter.required:
                example = ", ".join(f"{p} = ..." for p in entry.required)
                raise given.error(
                    parameter.name,
                    f'is missing ({parameter.meaning}); write {key} = {{ law = "{name}", {example} }}',
                )
        if "potential" in parameters:
            parameters["where"] = given.where("potential")
        with _context(f"{table.where(key)}:"):
            return entry.make(**parameters)

    def parameter(self, given: _Table, parameter: LawParameter) -> Any:
        """The value of a law parameter, in whatever form it is written."""
        name, value = parameter.name, given.data[parameter.name]
        match parameter.form:
            case ParameterForm.NUMBER:
                return given.quantity(name, value, self.dim, parameter.minimum)
            case ParameterForm.BOUND:
                return self.bound(given, parameter)
            case ParameterForm.FILE:
                return self.file(given, name)
            case ParameterForm.TEXT:
                return given.text(name, None, parameter.choices or None)
        if not isinstance(value, list) or not value:
            raise given.error(name, f"must be a list of numbers, not {_kind(value)}")
        return [given._plain(name, number) for number in value]

    def file(self, given: _Table, name: str) -> Path:
        path = Path(given.text(name))
        return path if path.is_absolute() else self.folder / path

    def bound(self, given: _Table, parameter: LawParameter) -> Any:
        """A friction bound: a number, a formula of x, or a table with one of table, formula and coulomb."""
        name, value = parameter.name, given.data[parameter.name]
        if not isinstance(value, dict):
            return given.quantity(name, value, self.dim, parameter.minimum)
        ways = ("table", "formula", "coulomb")
        inner = given.table(name, ways, inline=True)
        if len(inner.data) != 1:
            raise given.error(name, "give one of { table = FILE }, { formula = ... } of s and { coulomb = ... }")
        if "coulomb" in inner:
            return CoulombBound(inner.quantity("coulomb", value["coulomb"], self.dim, 0.0))
        if "formula" in inner:
            text = str(value["formula"]) if isinstance(value["formula"], int | float) else inner.text("formula")
            formula = ScalarFormula(text, "s", inner.where("formula"))
            with _context(f"{inner.where('formula')}:"):
                return PenetrationBound(formula)
        with _context(f"{inner.where('table')}:"):
            return PenetrationBound(read_columns(self.file(inner, "table"), BOUND_COLUMNS))


_OBSTACLES = {
    "plane": ("point", "normal"),
    "sphere": ("center", "radius", "inside"),
    "cylinder": ("point", "axis", "radius", "inside"),
    "distance": (),
}
_VECTORS = ("point", "normal", "center", "axis")

_KIND = {"normal": LawKind.NORMAL, "friction": LawKind.FRICTION}


def _solver(table: _Table) -> SolverSettings:
    method = None
    if "method" in table:
        from hemivar.solvers import METHODS

        method = table.text("method", None, list(METHODS))
    return SolverSettings(
        method=method,
        rtol=table.positive("rtol") if "rtol" in table else None,
        max_steps=table.whole("max_steps", table.data["max_steps"], 1) if "max_steps" in table else None,
        max_time=table.positive("max_time") if "max_time" in table else None,
    )


#: A problem that solves as it is; what ``hemivar new`` writes.
SAMPLE = """\
# A contact problem for hemivar.  Solve it with:   hemivar solve FILE --plot figure.png
# Lengths and forces are in any consistent units.  Every number marked (f) may also be a formula in quotes,
# such as "0.1 * x * (1 - x)", with sin cos tan tanh exp log sqrt abs min max and pi.

title = "elastic block, dragged over a foundation"

[mesh]
rectangle = [1.0, 1.0]       # width and height; boundaries: left, right, bottom, top
cells = [32, 32]             # along x and y
pattern = "cross"            # "cross": four triangles in each rectangle; "right" or "left": two
# box = [1.0, 1.0, 1.0]      # instead of a rectangle, with cells = [8, 8, 8]; boundaries also: front, back (y)
# file = "part.msh"          # or: Gmsh or anything meshio reads; its physical groups give
                             # the names of boundaries and regions
# refine = 1                 # cut every triangle into four, so many times
# order = 2                  # quadratic elements

[material]
lame = [4.0, 4.0]            # lambda and mu (f)
# young = 10.0               # or: Young's modulus (f)
# poisson = 0.25             #     and Poisson's ratio (f)
# plane = "stress"           # "strain" is the default

[loads]
body = [-0.8, -0.8]          # force per area of the body (f)
traction = { top = [0.0, 0.0] }   # force per length of the boundary (f)
# pressure = { right = 0.1 } # along the inward normal (f)

[supports]                   # by boundary: "clamped", "roller" (no normal displacement),
left = "clamped"             # { x = 0.0 } (one component) or { displacement = [0.0, -0.1] } (f)

[contact.bottom]             # one table for each boundary that may touch a foundation
normal = { law = "survey", q_max = 0.3, p_const = 2.0 }   # hemivar laws lists the laws (f)
friction = { law = "tresca", bound = 0.5 }                # leave it out for no friction (f)
gap = 0.0                    # distance between body and foundation (f)

# [solver]
# method = "newton"          # hemivar methods lists the methods
# rtol = 1e-10               # tolerance of the residual, relative to the load
"""
