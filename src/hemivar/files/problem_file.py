"""Problem files: a contact problem stated in TOML, read and written back.

Every key is documented in ``docs/problem-file.md``.  Reading is strict: a key that is not known, a value of
the wrong type or shape, a name that the mesh does not have, are reported in one line that names file, table
and key.  Writing is honest: what is written is read again, and what would come back otherwise is refused in one
sentence.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hemivar.basics import disk
from hemivar.basics.arguments import expect
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.stated import OF_ONE, keys_of
from hemivar.basics.units import Units
from hemivar.basics.user_code import checked_code, loaded_code
from hemivar.errors import FileError, ProblemError
from hemivar.files.body_table import (
    HEAT_KEYS,
    heat_record,
    loads_record,
    read_heat,
    read_loads,
    read_supports,
    supports_record,
)
from hemivar.files.changes import Change, changed
from hemivar.files.contact_table import SideFiles, _Reader, contact_records, read_contacts
from hemivar.files.material_table import material_record, read_material
from hemivar.files.mesh_table import StatedMesh, mesh_record, read_mesh_table
from hemivar.files.not_expressible import difference, not_expressible
from hemivar.files.schema import decode, encode
from hemivar.files.settings import OutputSettings, SolverSettings, TimeSettings
from hemivar.files.toml import KEYS, KEYS_OF_ONE, TomlTable, context, printable, text_of
from hemivar.mechanics.load_steps import Step
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.statement import ContactProblem, Quadrature
from hemivar.mechanics.thermal import Heat
from hemivar.mesh import Mesh
from hemivar.mesh.recipe import MeshRecipe
from hemivar.mesh.write import msh_text
from hemivar.solvers import METHODS, Controls, Solver

__all__ = [
    "ProblemFile",
    "parse_problem",
    "parse_problem_file",
    "problem_text",
    "read_problem",
    "read_problem_file",
    "read_text",
    "write_problem",
]

#: Bytes of a problem file that are read; larger data belong in mesh files and tables.
_MOST_BYTES = 16 * 2**20
#: Tables and lists in one another that are read: those of a problem are fewer than ten, Python bears about a thousand.
_DEEPEST = 50


@dataclass(frozen=True, eq=False)
class ProblemFile:
    """A problem file that has been read.

    Attributes
    ----------
    problem : ContactProblem
    solver : SolverSettings
    name : str
        The file, as it is named in messages.
    levels : int
        How many coarser meshes of the same body it describes: those that ``refine`` starts from, and built-in ones
        with half the numbers of cells.
    time : TimeSettings or None
        How the problem goes through time; None for a static one.
    output : OutputSettings
        Files to write on the way.
    heat : Heat or None
        Heat in the body.
    changes : tuple of Change
        Values that replaced those of the file.
    """

    problem: ContactProblem
    solver: SolverSettings = field(default_factory=SolverSettings)
    name: str = "problem"
    levels: int = 0
    time: TimeSettings | None = None
    output: OutputSettings = field(default_factory=OutputSettings)
    heat: Heat | None = None
    changes: tuple[Change, ...] = ()

    @property
    def units(self) -> Units:
        """Units for labels, of the table [units]; no number is converted."""
        return self.problem.units

    def coarser_meshes(self) -> list[Mesh]:
        """The coarser meshes of the same body, coarsest first, for a warm start; empty if there are none."""
        meshes: list[Mesh] = []
        mesh = self.problem.mesh
        while len(meshes) < self.levels and mesh.parent is not None:
            mesh = mesh.parent.mesh
            meshes.insert(0, mesh)
        return meshes


def read_problem(path: str | Path, *, code: Sequence[str] = ()) -> ContactProblem:
    """Read a contact problem from a TOML file.

    Parameters
    ----------
    path : str or Path
        Mesh files named in it are looked for in its folder.
    code : sequence of str
        Modules, and files such as ``"./mymodule.py"``, whose laws the file may name as ``module:Class``. They are
        imported when it does; no other code is.

    Returns
    -------
    ContactProblem

    Raises
    ------
    ProblemError
        If the file cannot be read or does not state a problem; one line that names file, table and key.

    Examples
    --------
    >>> import hemivar as hv
    >>> import pathlib
    >>> import tempfile
    >>> text = '''
    ... mesh = { rectangle = [1.0, 1.0], cells = [4, 4] }
    ... material = { young = 100.0, poisson = 0.0 }
    ... supports.top = { displacement = [0.0, -0.1] }  # pressed down by 0.1
    ... contact.bottom = { normal = { law = "compliance", stiffness = 100.0 } }
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "block.toml"
    ...     _ = path.write_text(text)
    ...     problem = hv.read_problem(path)
    >>> hv.solve(problem).on("bottom").force.round(9)  # springs of 100 and 100 in series
    array([0., 5.])
    """
    return read_problem_file(path, code=code).problem


def read_problem_file(path: str | Path, changes: Sequence[Change] = (), *, code: Sequence[str] = ()) -> ProblemFile:
    """Like :func:`read_problem`, with the settings for the solver and the hierarchy of meshes.

    ``changes`` replace what the file says.

    Parameters
    ----------
    path : str or Path
        Name of the TOML file.
    changes : sequence of Change
        Values that replace those of the file.
    code : sequence of str
        As for :func:`read_problem`.

    Returns
    -------
    ProblemFile
    """
    return parse_problem_file(read_text(path), Path(path).parent, str(path), changes=changes, code=code)


def read_text(path: str | Path) -> str:
    """The text of a problem file, which is a regular file of at most 16 MiB."""
    path = disk.path_of(path)
    try:
        return disk.read_text(path, "problem file", _MOST_BYTES)
    except FileError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            what = "the problem file does not exist; check the path, or write one with 'hemivar new'"
            raise FileError(f"{printable(path)}: {what}") from error
        if os.path.isdir(path):
            raise FileError(f"{printable(path)}: this is a folder; name the problem file in it") from error
        raise


def parse_problem(
    text: str, base_dir: str | Path = ".", name: str = "problem", *, code: Sequence[str] = ()
) -> ContactProblem:
    """A contact problem from the text of a problem file; ``code`` is as for :func:`read_problem`."""
    return parse_problem_file(text, base_dir, name, code=code).problem


def _colon_in_quotes(text: str, reason: str) -> str:
    """What to write where the key in the line of a TOML error has a colon outside of quotes; else nothing."""
    line = re.search(r"at line (\d+)", reason)
    if line is None:
        return ""
    key = text.splitlines()[int(line[1]) - 1].partition("=")[0]
    name = re.search(r"[^][\s.\"']+:[^][\s.\"']+", re.sub(r"\"[^\"]*\"|'[^']*'", "", key))
    return "" if name is None else f'put the name in quotes, for it has a colon: "{name[0]}"'


def parse_problem_file(
    text: str,
    base_dir: str | Path = ".",
    name: str = "problem",
    make_mesh: Callable[[StatedMesh], Mesh] | None = None,
    changes: Sequence[Change] = (),
    code: Sequence[str] = (),
) -> ProblemFile:
    """Like :func:`parse_problem`, with the settings for the solver and the hierarchy of meshes.

    ``make_mesh`` makes the mesh in another way than whole; what the file says is then checked on what it makes.
    ``changes`` replace what the file says, before anything of it is read. ``code`` is as for :func:`read_problem`.
    """
    checked_code(code)
    try:
        data = tomllib.loads(text)
        _refuse_deep(data)
    except tomllib.TOMLDecodeError as error:
        remedy = _colon_in_quotes(text, str(error)) or "correct that line"
        raise ProblemError(f"{name}: not valid TOML: {error}; {remedy}") from None
    except RecursionError:
        raise ProblemError(f"{name}: brackets or tables are nested too deeply for a problem file; correct it") from None
    except ValueError as error:
        raise ProblemError(f"{name}: not valid TOML ({error}); correct it") from None
    data = changed(data, changes, name)
    of_one = "kind" in data
    top = TomlTable(data, name, "", KEYS_OF_ONE if of_one else KEYS[""])
    for key in ("mesh", "material"):
        if key not in data:
            raise ProblemError(f"{name}: the table [{key}] is missing; add it")
    solver = SolverSettings(**decode(SolverSettings, top.table("solver", KEYS["solver"])))
    units = _units(top.table("units", KEYS["units"]))
    folder, table = Path(base_dir), _mesh_table(top)
    stated = read_mesh_table(table, folder)
    mesh = stated.build() if make_mesh is None else make_mesh(stated)
    levels = stated.recipe.halvings + stated.recipe.refine
    field = _field(top, table, stated, mesh) if of_one else None
    material = read_material(top.table("material", None), mesh, field, code)
    keys = keys_of(ContactProblem, table="loads", by=OF_ONE) if of_one else KEYS["loads"]
    loads = read_loads(top.table("loads", keys), mesh, of_one)
    supports = read_supports(top, mesh, of_one)
    contact = read_contacts(top, mesh, folder, of_one, code)
    time, output = _read_in_time(top, mesh, material.inert, field)
    if stated.quadrature is Quadrature.MIDPOINT and mesh.dim == 3 and contact:
        raise table.error(
            "quadrature",
            "midpoints are for plane bodies: in 3D there are about twice as many facets as nodes, more pressures than "
            'displacements can tell apart; write quadrature = "nodal"',
        )
    with context(f"{name}: [contact]"):
        problem = ContactProblem(
            mesh=mesh,
            material=material,
            contact=contact,
            supports=supports,
            title=top.text("title", ""),
            order=stated.order,  # type: ignore[arg-type]  # None: what the mesh suggests
            quadrature=stated.quadrature,
            geometry=stated.geometry,
            trace_constant=stated.trace_constant,
            units=units,
            **loads,  # type: ignore[arg-type]
        )
    if "steps" in top:
        with context(f"{name}: [[steps]]"):
            problem = replace(problem, steps=_read_steps(top, mesh))
    heat = None
    if "heat" in top:
        if time is None:
            raise top.error("heat", "depends on time; add a table [time], or remove it")
        heat = read_heat(top.table("heat", HEAT_KEYS), problem, _Reader(mesh.dim, folder, code))
    return ProblemFile(problem, solver, name, levels, time, output, heat, tuple(changes))


def _field(top: TomlTable, table: TomlTable, stated: StatedMesh, mesh: Mesh) -> ScalarKind:
    """What the one component of a file is."""
    if stated.quadrature is Quadrature.MIDPOINT:
        raise table.error("quadrature", "a scalar problem has its laws at the nodes; remove it")
    chosen = ScalarKind(top.text("kind", None, [kind.value for kind in ScalarKind]))
    if mesh.dim == 3 and chosen is not ScalarKind.HEAT:
        raise top.error("kind", f"'{chosen}' needs a plane mesh; write a rectangle in [mesh]")
    return chosen


def _refuse_deep(data: object) -> None:
    """RecursionError where tables and lists stand in one another deeper than in any problem file."""
    level = [data]
    for _ in range(_DEEPEST):
        level = [inner for outer in level for inner in _inside(outer)]
    if level:
        raise RecursionError


def _inside(value: object) -> Iterable[object]:
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


def _units(table: TomlTable) -> Units:
    """Units for labels, one checked by one so that the message names its key."""
    units = Units()
    for key in table.data:
        text = table.text(key)
        try:
            units = replace(units, **{key: text})
        except ProblemError:
            raise table.error(key, "is no unit; give a short text, such as 'mm', without '$'") from None
    return units


# ---- writing ----------------------------------------------------------------------------------------------


def write_problem(
    problem: ContactProblem | ManufacturedProblem | ProblemFile,
    path: str | Path,
    *,
    method: str | Solver | None = None,
    controls: Controls | None = None,
    beside: bool = False,
) -> Path:
    """Write a problem file that states a problem: :func:`read_problem` gives the same statement back.

    What is written is read again before the file takes its name. Meshes are written by how they were made (rectangle,
    box or file, scaled, refined), laws by name with their parameters, quantities as numbers or as the text of
    formulas, files by their way from the folder of ``path``.

    Parameters
    ----------
    problem : ContactProblem or ProblemFile
        A file that was read keeps its settings for the solver, the time and the output.
    path : str or Path
        The file; its folder must be there.
    method : str or Solver, optional
        A method with its standard options, for the table ``[solver]``.
    controls : Controls, optional
        Relative tolerance and limits, for the same table.
    beside : bool
        Whether meshes and tables that come from no file are written too, as files that begin with its name.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ProblemError
        If the problem holds what a problem file cannot express (a Python function, a mesh of one's own without
        ``beside``, an option of a method, ...); one sentence that names it. Nothing is written then.
    FileError
        If a file cannot be written, or one of these files would take the place of another one.

    Examples
    --------
    >>> import hemivar as hv
    >>> import pathlib
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "problem.toml"
    ...     _ = hv.write_problem(hv.gallery.survey("5.1", 8), path, method="newton", controls=hv.Controls(rtol=1e-8))
    ...     print(*path.read_text().splitlines()[-3:], sep="; ")
    [solver]; method = "newton"; rtol = 1e-08
    """
    path = disk.path_of(path)
    if method is not None:
        expect(method, str | Solver, "method", "give its name or a method of hemivar.solvers")
    if controls is not None:
        expect(controls, Controls, "controls", "give Controls(...)")
    expect(beside, bool, "beside", "give True or False")
    stated = _as_file(problem)
    settings = _settings(stated.solver, method, controls)
    with contextlib.ExitStack() as undone:
        files = _Beside(path, undone) if beside else None
        disk.write_text(path, _read_again(stated, settings, path.parent, str(path), files))
        undone.pop_all()
    return path


def problem_text(problem: ContactProblem | ManufacturedProblem | ProblemFile, folder: str | Path = ".") -> str:
    """The text that :func:`write_problem` writes."""
    stated = _as_file(problem)
    return _read_again(stated, _settings(stated.solver, None, None), Path(folder), "problem", None)


def _as_file(problem: ContactProblem | ManufacturedProblem | ProblemFile) -> ProblemFile:
    remedy = "give a ContactProblem, a ScalarProblem or a ProblemFile"
    given = expect(problem, ContactProblem | ProblemFile, "what to write as a problem file", remedy)
    if isinstance(given, ProblemFile):
        return given
    return ProblemFile(given, time=_through(given.steps) if given.steps else None)


def _read_again(stated: ProblemFile, settings: SolverSettings, folder: Path, name: str, files: _Beside | None) -> str:
    """The text, from which the same problem comes back."""
    text = _text(stated, settings, folder, files)
    again = parse_problem_file(text, folder, name, code=loaded_code())
    differs = (
        difference(stated.problem, again.problem)
        or difference(settings, again.solver, "solver")
        or difference(stated.time, again.time, "time")
        or difference(stated.output, again.output, "output")
        or difference(stated.heat, again.heat, "heat")
    )
    if differs is not None:
        raise ProblemError(
            f"{differs} would be read back differently from a problem file, which cannot express it; state it by "
            f"numbers, "
            f"formulas as text, and the laws that 'hemivar laws' lists"
        )
    return text


def _settings(given: SolverSettings, method: str | Solver | None, controls: Controls | None) -> SolverSettings:
    """The settings with a method and limits in place of their own."""
    name = given.method if method is None else method if isinstance(method, str) else method.name
    if name is not None and name not in METHODS:
        raise not_expressible("method", name, f"one of {', '.join(METHODS)}")
    if isinstance(method, Solver) and METHODS[method.name] != method:
        raise not_expressible(
            "method", f"'{method.name}' with options of its own", "methods with their standard options"
        )
    if controls is None:
        return SolverSettings(name, given.rtol, given.max_steps, given.max_time)
    for option in ("atol", "callback"):
        if getattr(controls, option) != getattr(Controls(), option):
            raise not_expressible(f"controls.{option}", getattr(controls, option), "rtol, max_steps and max_time")
    return SolverSettings(
        name, controls.rtol, controls.max_steps, None if controls.max_time == math.inf else controls.max_time
    )


def _text(stated: ProblemFile, settings: SolverSettings, folder: Path, files: _Beside | None) -> str:
    """The text of the file, with meshes and tables without a file put beside it."""
    problem = stated.problem
    recipe = problem.mesh.recipe
    if recipe is not None and files is not None and difference(problem.mesh, recipe.build(), "mesh"):
        recipe = None  # the mesh was changed by replace(), or its file is another one by now
    made = "made of arrays, or changed after it was made"
    can = "rectangles, boxes and mesh files, scaled and then refined: beside=True writes the mesh as a file"
    if recipe is not None and (read := _read_for(recipe, problem)) != problem.order:
        recipe, made = None, f"read for elements of order {read}, and the problem has order {problem.order}"
        can = (
            f"the mesh of read_mesh(path, order={problem.order}): read it so, or beside=True writes the mesh as a file"
        )
    if recipe is None:
        if files is None:
            raise not_expressible("mesh", made, can)
        recipe = MeshRecipe(files.put("mesh.msh", msh_text(problem.mesh)))
    aside = SideFiles(folder, None if files is None else files.table)
    data: dict[str, object] = {"kind": problem.kind.value} if problem.kind else {}
    data |= {"title": problem.title} if problem.title else {}
    data["mesh"] = mesh_record(recipe, problem, folder)
    data["material"] = material_record(problem.material)
    data["loads"] = loads_record(problem)
    data["supports"] = supports_record(problem)
    data |= contact_records(problem, aside)
    if problem.steps:
        with IMPORTS:
            from hemivar.files.steps_table import steps_record
        data["steps"] = steps_record(problem)
    if stated.heat is not None:
        data["heat"] = heat_record(stated.heat, aside)
    return _encoded(data | _time_records(stated, problem.kind), settings)


def _read_for(recipe: MeshRecipe, problem: ContactProblem) -> int:
    """The order that mesh files were read for, if they give another mesh for the order of the problem; else that."""
    mesh, order = problem.mesh, int(problem.order)
    if order == 1 and mesh.dim == 3 and mesh.suggested_order == 2:
        return 2
    return 1 if order == 2 and recipe.linear and difference(mesh, recipe.as_suggested.build(), "mesh") else order


def _mesh_table(top: TomlTable) -> TomlTable:
    """The table [mesh]; each table in it is a part."""
    table = top.table("mesh", None)
    table.only((*KEYS["mesh"], *(key for key, value in table.data.items() if isinstance(value, dict))))
    return table


def _read_in_time(
    top: TomlTable, mesh: Mesh, inert: bool, scalar: ScalarKind | None = None
) -> tuple[TimeSettings | None, OutputSettings]:
    """The tables [time] and [output]; what time needs is loaded where one of them stands."""
    if not any(key in top for key in ("time", "output", "steps")):
        return None, OutputSettings()
    with IMPORTS:
        from hemivar.files.time_table import read_in_time
    return read_in_time(top, mesh, inert, scalar)


def _read_steps(top: TomlTable, mesh: Mesh) -> Sequence[Step]:
    """The list [[steps]]; what reads it is loaded where there is one."""
    with IMPORTS:
        from hemivar.files.steps_table import read_steps
    return read_steps(top, mesh)


def _through(steps: Sequence[Step]) -> TimeSettings:
    """The way through load steps, one increment for each."""
    with IMPORTS:
        from hemivar.evolution.plan import March
    return TimeSettings(March(float(len(steps))))


def _time_records(stated: ProblemFile, scalar: ScalarKind | None = None) -> dict[str, object]:
    """The tables [time], [output] and [units]."""
    units = stated.units.record()
    records: dict[str, object] = {"units": units} if units else {}
    if stated.time is not None:
        with IMPORTS:
            from hemivar.files.time_table import output_record, time_record
        if not stated.problem.steps:
            records["time"] = time_record(stated.time, scalar)
        records["output"] = output_record(stated.time.march, stated.output)
    return records


def _encoded(data: dict[str, object], settings: SolverSettings) -> str:
    data["solver"] = encode(settings, "solver")
    text = text_of(data)
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ProblemError("a title, a name or a path of the problem is not valid Unicode; rename it") from None
    return text


class _Beside:
    """Files beside a problem file, which go again unless all is well."""

    def __init__(self, path: Path, undone: contextlib.ExitStack) -> None:
        self.path = path
        self.undone = undone

    def put(self, name: str, text: str) -> Path:
        """Write a file; one that is there already must hold the same."""
        path = self.path.with_name(f"{self.path.stem}.{name}")
        if os.path.lexists(path):
            if disk.read_text(path, "file") != text:
                raise FileError(
                    f"cannot write {disk.shown(path)}: another file has that name; move it, or rename {self.path.name}"
                )
            return path
        disk.write_text(path, text)
        self.undone.callback(disk.remove_file, path)
        return path

    def table(self, name: str, text: str) -> str:
        """Write a table of a law; returns its name for the problem file."""
        plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
        return self.put(f"{plain}.csv", text).name
