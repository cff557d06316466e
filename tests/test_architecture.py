"""The order of the rooms: who may import whom, what is loaded when, and what every module must have.

Each rule is one function that goes over all files and names every place that breaks it.  What each must find, and what
it must let pass, is planted in a folder of its own.
"""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import itertools
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import grimp
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

import hemivar
from tests.sources import PACKAGE, ROOT, Source, sources, trees

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
CONTRACTS = {one["id"]: one for one in PROJECT["tool"]["importlinter"]["contracts"]}
#: Packages by rank, as the contract of import-linter has them: each may import itself and those of a lower rank.
RANK = {
    name: rank
    for rank, names in enumerate(reversed(CONTRACTS["order"]["layers"]))
    for name in re.findall(r"\w+", names)
}

Files = Sequence[Source]
Rule = Callable[[Files], Iterator[str]]


def private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def given(file: Source) -> Iterator[str]:
    """Names that a module gives to a function, a class or an attribute."""
    for node in file.nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def private_names_stay_in_their_package(files: Files) -> Iterator[str]:
    """Make a name with an underscore public, or go another way than taking it from another package."""
    attributes: dict[str, set[str]] = defaultdict(set)
    for file in files:
        attributes[file.room].update(given(file))
    for file in files:
        own = file.package.split(".")[0]
        for node in file.nodes:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hemivar."):
                source = (node.module or "").removeprefix("hemivar.")
                for name in (*source.split("."), *(alias.name for alias in node.names)):
                    if private(name) and source.split(".")[0] != own:
                        yield file.at(node, f"{source}: {name}")
            elif isinstance(node, ast.Attribute) and private(node.attr) and isinstance(node.value, ast.Name):
                known = private(node.value.id) or node.value.id in ("self", "cls", "os", "sys")
                if not known and node.attr not in attributes[own]:
                    yield file.at(node, f"{node.value.id}.{node.attr}")


#: Names that two modules may share: what both engines have. A workflow and the command that shows it share theirs.
SHARED = {
    "assembly": {"fem", "ranks"},
    "certificate": {"certificates", "ranks"},
    "solve": {"solvers", "ranks"},
}


def no_two_modules_share_a_name(files: Files) -> Iterator[str]:
    """One idea has one name: rename one of the two."""
    homes: dict[str, list[Source]] = defaultdict(list)
    for file in files:
        if file.path.name != "__init__.py":
            homes[file.path.stem].append(file)
    for name, found in homes.items():
        rooms = [file.room for file in found]
        if len(found) > 2 or (len(found) > 1 and set(rooms) not in ({"workflows", "cli"}, SHARED.get(name))):
            yield from (file.at(1, f"there is a {name}.py in {', '.join(rooms)}") for file in found)


#: Classes that share a name: the memory of contact laws, and that of the method on levels.
SHARED_CLASSES = {"Memory"}


def no_two_classes_share_a_name(files: Files) -> Iterator[str]:
    """Rename one of the two: a traceback, a message of mypy and a page of the reference then say which is meant."""
    homes: dict[str, list[str]] = defaultdict(list)
    for file in files:
        for node in file.tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(file.at(node, f"another class {node.name}"))
    for name, found in homes.items():
        if len(found) > 1 and name not in SHARED_CLASSES:
            yield from found


def inside(file: Source, rooms: tuple[str, ...]) -> bool:
    return any(file.name == room or file.name.startswith(room + ".") for room in rooms)


def called(file: Source) -> Iterator[tuple[str, str, int]]:
    """Calls of ``above``: the method around each, or the module where a function asks, the entry, and the line."""
    module = file.name.rpartition(".")[2]
    if module == "defined_above":
        return
    for kind in (node for node in ast.walk(file.tree) if isinstance(node, ast.ClassDef | ast.FunctionDef)):
        for method in kind.body if isinstance(kind, ast.ClassDef) else [kind]:
            if not isinstance(method, ast.FunctionDef):
                continue
            for node in ast.walk(method):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("above", "defined_above"):
                    entry = ast.literal_eval(node.args[0])
                    own = f"{kind.name}.{method.name}" if isinstance(kind, ast.ClassDef) else ""
                    asked = f"{module}.{entry.partition('.')[2]}"
                    if isinstance(kind, ast.ClassDef) or entry[0].islower():
                        yield asked if entry[0].islower() else own, entry, node.lineno


def methods_that_hand_their_value_on_are_those_of_the_table(files: Files) -> Iterator[str]:
    """Ask for the method's own entry of ``hemivar._DEFINED_ABOVE``, which leads to a room above."""
    for file in files:
        for method, entry, line in called(file):
            target = hemivar._DEFINED_ABOVE.get(entry)
            if method != entry:
                yield file.at(line, f"{method} asks for {entry}")
            elif target is None:
                yield file.at(line, f"{entry} is not in the table")
            elif RANK[target.split(".")[0]] < RANK[file.room]:
                yield file.at(line, f"{entry} leads to {target}, which is in no room above")


def unlocked(node: ast.AST, locked: bool = False) -> Iterator[int]:
    """Lines of imports from this package in functions, outside ``with IMPORTS``."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ImportFrom) and not locked and (child.module or "").startswith("hemivar"):
            yield child.lineno
        holds = isinstance(child, ast.With) and any(getattr(x.context_expr, "id", "") == "IMPORTS" for x in child.items)
        yield from unlocked(child, locked or holds)


def imports_on_first_use_stand_under_the_lock(files: Files) -> Iterator[str]:
    """Import under ``basics.first_use.IMPORTS``: two threads that load one package get modules that are half loaded."""
    for file in files:
        if file.room != "cli":  # one thread
            functions = (node for node in file.nodes if isinstance(node, ast.FunctionDef))
            lines = {line for function in functions for line in unlocked(function)}
            yield from (file.at(line, "import outside of the lock") for line in lines)


#: Methods that write or read a file; a temporary name of ``whole_file`` may be written to.
WRITING = {"write_text", "write_bytes", "savefig", "screenshot", "to_csv", "tofile", "savez", "savetxt", "touch"}
READING = {"read_text", "read_bytes", "loadtxt", "genfromtxt"}
#: Where files are opened otherwise: descriptors of the process, files of the system, parallel writers of one file,
#: arrays that are packed into a stream, matplotlib's own method of a figure, which users call.
OPENING = (
    "basics.disk",
    "cli.terminal",
    "basics.machine",
    "ranks.checkpoint",
    "ranks.files",
    "ranks.march_checkpoint",
    "basics.packed",
    "evolution.march_state",
    "ranks.on_ranks",
    "report.picture",
)


def opening_calls(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Calls that open a file, or make a library do so, outside ``with whole_file(...)``."""

    def search(node: ast.AST, inside: bool) -> Iterator[tuple[str, int]]:
        if isinstance(node, ast.With):
            calls = [item.context_expr for item in node.items if isinstance(item.context_expr, ast.Call)]
            inside = inside or any(isinstance(c.func, ast.Name) and c.func.id == "whole_file" for c in calls)
        if isinstance(node, ast.Call) and not inside:
            name, owner = "", ""
            if isinstance(node.func, ast.Attribute):
                name = node.func.attr
                owner = node.func.value.id if isinstance(node.func.value, ast.Name) else ""
            elif isinstance(node.func, ast.Name) and node.func.id == "open":
                name = "open"
            keywords = {keyword.arg for keyword in node.keywords}
            direct = owner != "disk" and name in {"open", *WRITING, *READING}
            by_meshio = name in ("write", "save") and "file_format" in keywords
            if direct or by_meshio:
                yield name, node.lineno
        for child in ast.iter_child_nodes(node):
            yield from search(child, inside)

    yield from search(tree, False)


def files_are_opened_by_one_module(files: Files) -> Iterator[str]:
    """Read and write by ``hemivar.basics.disk``."""
    for file in files:
        if not inside(file, OPENING):
            yield from (file.at(line, name) for name, line in opening_calls(file.tree))


#: Where a type cannot be named, how often at most, and why.  A number may fall; a new place wants a reason here.
UNTYPED = {
    "basics.arguments": (2, "a union of classes as a value has no type of its own"),
    "basics.defined_above": (3, "functions of rooms above, of any kind"),
    "basics.types": (2, "entries of any kind; JSON"),
    "cli.march_run": (1, "keywords of a film"),
    "evolution.evolution_problem": (3, "initial fields as users give them"),
    "evolution.history": (3, "a DataFrame, keywords of matplotlib"),
    "evolution.march": (1, "keywords of a plan"),
    "evolution.save": (4, "places as users give them"),
    "fem.form_field": (1, "objects of scikit-fem"),
    "files.material_table": (1, "keywords of a dataclass, read from a file"),
    "files.contact_table": (3, "dataclasses found by their names"),
    "files.schema": (1, "keywords of a dataclass, read from a file"),
    "linear.truncated_level": (1, "compiled kernels without types"),
    "linear.threads": (4, "libraries of threadpoolctl"),
    "studio.toml_numbers": (1, "a document of tomlkit"),
    "report.animation": (1, "writer of matplotlib"),
    "report.drawn_body": (2, "keywords of matplotlib"),
    "report.film_pictures": (2, "axes in the plane or in space; canvas of matplotlib"),
    "report.march_figures": (2, "keywords of matplotlib"),
    "report.loglog": (1, "keywords of matplotlib"),
    "report.mesh_figures": (1, "axes in the plane or in space"),
    "report.picture": (2, "parameters of matplotlib"),
    "report.style": (3, "keywords of matplotlib"),
    "solvers.base": (6, "each method has its own system and memory"),
    "solvers.fixed_point": (1, "the memory of the method inside"),
    "workflows.marching": (1, "keywords of a plan"),
}


MOST_UNTYPED = 60


def untyped(file: Source) -> list[int]:
    """The lines in which ``Any`` is said in code, imports left out."""
    return [
        node.lineno
        for node in file.nodes
        if (isinstance(node, ast.Name) and node.id == "Any") or (isinstance(node, ast.Attribute) and node.attr == "Any")
    ]


def any_stands_at_true_boundaries_only(files: Files) -> Iterator[str]:
    """Name a type (object, a protocol, a TypedDict), or list the module in UNTYPED with its reason."""
    for file in files:
        lines, (most, _) = untyped(file), UNTYPED.get(file.name, (0, ""))
        if len(lines) > most:
            yield from (file.at(line, f"Any; {most} are allowed here") for line in lines)


#: Data classes that change while a method works with them; all others are frozen.
WORKING = {
    "branches.follower": ("TrackPoint", "Track", "Follower"),
    "branches.graph_follower": ("GraphFollower",),
    "branches.nonlinear_follower": ("NonlinearFollower",),
    "discrete.recession": ("_Programme",),
    "evolution.stage_solver": ("_GradientFlow",),
    "solvers.newton_on_graph": ("NewtonCache",),
    "systems.dense_newton": ("DenseFactor",),
}


def data_classes(file: Source) -> Iterator[tuple[ast.ClassDef, dict[str, bool]]]:
    """The data classes of a module with the options of their decorators."""
    for node in file.nodes:
        for decorator in node.decorator_list if isinstance(node, ast.ClassDef) else ():
            name = decorator.func if isinstance(decorator, ast.Call) else decorator
            if isinstance(name, ast.Name) and name.id == "dataclass":
                assert isinstance(node, ast.ClassDef)
                options = decorator.keywords if isinstance(decorator, ast.Call) else []
                yield node, {option.arg or "": ast.literal_eval(option.value) for option in options}


def compared_arrays(node: ast.ClassDef) -> list[str]:
    """Fields of a data class that are arrays and count when two of them are compared."""
    found = []
    for field in node.body:
        if isinstance(field, ast.AnnAssign) and "compare=False" not in ast.unparse(field):
            type_of = ast.unparse(field.annotation)
            arrays = re.search(r"\b(Bool|Int)?Array\b|\bNDArray\b|\bc[scr]{2}_array\b", type_of)
            if arrays and not re.match(r"Callable|ClassVar|InitVar", type_of):
                found.append(ast.unparse(field.target))
    return found


def data_classes_are_frozen(files: Files) -> Iterator[str]:
    """State @dataclass(frozen=True); those that change while a method works with them are in WORKING."""
    for file in files:
        for node, options in data_classes(file):
            if not options.get("frozen", False) and node.name not in WORKING.get(file.name, ()):
                yield file.at(node, f"{node.name} is not frozen")


def data_classes_of_arrays_are_compared_by_identity(files: Files) -> Iterator[str]:
    """State @dataclass(eq=False), or field(compare=False): ``==`` of arrays has no single answer, and would fail."""
    for file in files:
        for node, options in data_classes(file):
            if options.get("eq", True) and "__eq__" not in {getattr(part, "name", "") for part in node.body}:
                yield from (file.at(node, f"{node.name}.{name}") for name in compared_arrays(node))


def public_modules_say_what_is_public_and_what_for(files: Files) -> Iterator[str]:
    """Write a docstring, and ``__all__`` with each name once; no name is hidden by a module, all are described."""
    public = [file for file in files if not any(part.startswith("_") for part in file.name.split("."))]
    modules = [importlib.import_module(".".join(filter(None, (file.root.name, file.name)))) for file in public]
    for file, module in zip(public, modules, strict=True):
        names = getattr(module, "__all__", None)
        if not module.__doc__:
            yield file.at(1, "no docstring")
        if names is None:
            yield file.at(1, "no __all__")
        for name in names or ():
            value = getattr(module, name)
            if names.count(name) > 1:
                yield file.at(1, f"__all__ repeats {name}")
            if inspect.ismodule(value):
                yield file.at(1, f"{name} is a module")
            if (inspect.isclass(value) or inspect.isfunction(value)) and not inspect.getdoc(value):
                yield file.at(1, f"{name} has no docstring")


#: Types of packages that are not imported by name.
FOREIGN = {"AnyWidget", "Mat", "NullSpace"}
#: Sections of docstrings in which a type may stand alone.
ALONE = ("Returns", "Yields", "Raises", "Warns")


def types_said(text: str) -> Iterator[tuple[int, str]]:
    """Types of a docstring with the number of the line: after a name and a colon, or alone in a section."""
    section, lines = "", [*text.split("\n"), ""]
    for number, (line, under) in enumerate(itertools.pairwise(lines)):
        if re.fullmatch("-{3,}", under):
            section = line
        elif told := re.fullmatch(r"\s*[*\w][\w, *]* : (.+)" if section not in ALONE else r"(\w.*)", line):
            yield from ((number, name) for name in re.findall(r"\b[A-Z]\w+", told[1].split(".")[0]))


def names_bound(file: Source) -> Iterator[str]:
    """Names of classes, of what is imported, and of what a module sets."""
    for node in file.nodes:
        if isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.ImportFrom):
            yield from (alias.asname or alias.name for alias in node.names)
    for statement in file.tree.body:
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        yield from (target.id for target in targets if isinstance(target, ast.Name))


def types_in_docstrings_exist(files: Files) -> Iterator[str]:
    """Write the name that the type has today."""
    known = {*dir(builtins), *FOREIGN}.union(*map(names_bound, files))
    for file in files:
        for node in file.nodes:
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                first = node.body[0].lineno
                yield from (file.at(first + n, f"no {name}") for n, name in types_said(text) if name not in known)


def texts_name_no_folder_of_one_machine_and_leave_nothing_undone(files: Files) -> Iterator[str]:
    """Write a path that any reader has; do what is to be done."""
    for file in files:
        for found in re.finditer(r"(?<![\w.])/(tmp|work|home|root|Users)/|\b(TODO|FIXME|XXX)\b", file.text):
            yield file.at(file.text.count("\n", 0, found.start()) + 1, found[0])


#: What is held of every module, and of every text.
RULES: tuple[Rule, ...] = (
    private_names_stay_in_their_package,
    no_two_modules_share_a_name,
    no_two_classes_share_a_name,
    methods_that_hand_their_value_on_are_those_of_the_table,
    imports_on_first_use_stand_under_the_lock,
    files_are_opened_by_one_module,
    any_stands_at_true_boundaries_only,
    data_classes_are_frozen,
    data_classes_of_arrays_are_compared_by_identity,
    public_modules_say_what_is_public_and_what_for,
    types_in_docstrings_exist,
)
OF_TEXTS: Rule = texts_name_no_folder_of_one_machine_and_leave_nothing_undone


@pytest.fixture(scope="module")
def library() -> Iterator[Files]:
    with trees(sources(PACKAGE)) as found:
        yield found


def named(rule: Rule) -> str:
    return rule.__name__


def hold(rule: Rule, files: Files) -> None:
    found = list(rule(files))
    assert not found, "\n".join([rule.__doc__ or "", *found])


@pytest.mark.parametrize("rule", RULES, ids=named)
def test_the_library_keeps_the_rule(rule: Rule, library: Files) -> None:
    assert len(library) > 400
    hold(rule, library)


def test_texts_keep_the_rule() -> None:
    hold(OF_TEXTS, sources(ROOT, "src", "examples", "docs", "benchmarks", kinds=(".py", ".md", ".toml")))


def test_tables_of_the_rules_name_what_is_there(library: Files) -> None:
    said = {file.name: len(untyped(file)) for file in library}
    assert [name for name in UNTYPED if not said.get(name)] == [], "strike them from UNTYPED"
    assert sum(said.values()) <= MOST_UNTYPED
    classes = {(file.name, node.name): options for file in library for node, options in data_classes(file)}
    working = [(name, kind) for name, kinds in WORKING.items() for kind in kinds]
    assert [one for one in working if classes.get(one, {"frozen": True}).get("frozen")] == [], (
        "strike them from WORKING"
    )
    assert {entry for file in library for _, entry, _ in called(file)} == hemivar._DEFINED_ABOVE.keys()
    for target in hemivar._DEFINED_ABOVE.values():
        module, _, function = target.rpartition(".")
        assert callable(getattr(importlib.import_module(f"hemivar.{module}"), function)), target


#: Of each rule: files that break it, beside lines that do not, and what it must say of them.
PLANTED: dict[Rule, tuple[dict[str, str], list[str]]] = {
    private_names_stay_in_their_package: (
        {
            "solvers/a.py": "from hemivar.mesh._keys import facets\n"
            "from hemivar.mesh.mesh import _facets, Mesh\n"
            "from hemivar.solvers._steps import step\n"
            "mesh._trusted(1)\nself._own\nos._exit(1)\nmesh.__dict__\nsystem._step\n",
            "solvers/b.py": "class System:\n    def _step(self): ...\n",
        },
        ["solvers/a.py:1: mesh._keys: _keys", "solvers/a.py:2: mesh.mesh: _facets", "solvers/a.py:4: mesh._trusted"],
    ),
    no_two_modules_share_a_name: (
        {
            "laws/steps.py": "",
            "mesh/steps.py": "",
            "solvers/solve.py": "",
            "ranks/solve.py": "",
            "workflows/run.py": "",
            "cli/run.py": "",
            "workflows/sweep.py": "",
            "cli/sweep.py": "",
            "cli/shown/sweep.py": "",
            "mesh/__init__.py": "",
            "laws/__init__.py": "",
        },
        [
            "laws/steps.py:1: there is a steps.py in laws, mesh",
            "mesh/steps.py:1: there is a steps.py in laws, mesh",
            "cli/shown/sweep.py:1: there is a sweep.py in cli, cli, workflows",
            "cli/sweep.py:1: there is a sweep.py in cli, cli, workflows",
            "workflows/sweep.py:1: there is a sweep.py in cli, cli, workflows",
        ],
    ),
    no_two_classes_share_a_name: (
        {
            "laws/a.py": "class Law: ...\nclass _Own: ...\nclass Memory: ...\n",
            "mesh/b.py": "x = 1\nclass Law: ...\nclass _Own: ...\nclass Memory: ...\n",
        },
        ["laws/a.py:1: another class Law", "mesh/b.py:2: another class Law"],
    ),
    methods_that_hand_their_value_on_are_those_of_the_table: (
        {
            "identification/a.py": "class Fit:\n    def plot(self):\n        return above('Fit.plot')(self)\n"
            "    def summary(self):\n        return above('Fit.plot')(self)\n"
            "    def show(self):\n        return above('Fit.show')(self)\n",
            "cli/a.py": "class Solution:\n    def certify(self):\n        return above('Solution.certify')(self)\n",
        },
        [
            "identification/a.py:5: Fit.summary asks for Fit.plot",
            "identification/a.py:7: Fit.show is not in the table",
            "cli/a.py:3: Solution.certify leads to certificates.certify, which is in no room above",
        ],
    ),
    imports_on_first_use_stand_under_the_lock: (
        {
            "laws/a.py": "from hemivar.basics import x\ndef f():\n    import numpy\n    with IMPORTS:\n"
            "        from hemivar.report import y\n    with other:\n        from hemivar.report import z\n",
            "cli/a.py": "def f():\n    from hemivar.report import y\n",
        },
        ["laws/a.py:7: import outside of the lock"],
    ),
    files_are_opened_by_one_module: (
        {
            "laws/a.py": "with whole_file(path) as name:\n    fig.savefig(name)\n    name.write_text('')\n"
            "fig.savefig(path)\npath.open('w')\nopen(path)\ngrid.write(path, file_format='vtu')\n"
            "stream.write('text')\ndisk.write_text(path, '')\nread_text(path)\npath.write_text('')\n",
            "basics/disk.py": "open(path)\n",
        },
        [
            "laws/a.py:4: savefig",
            "laws/a.py:5: open",
            "laws/a.py:6: open",
            "laws/a.py:7: write",
            "laws/a.py:11: write_text",
        ],
    ),
    any_stands_at_true_boundaries_only: (
        {
            "basics/types.py": "from typing import Any\nx: Any\ny: Any\n",
            "laws/a.py": "from typing import Any\nimport typing\nx: Any = 1\n"
            "def f(a: dict[str, Any]) -> typing.Any:\n    y: list[int]\n",
            "evolution/march.py": "x: Any\ny: Any\n",
        },
        [
            "laws/a.py:3: Any; 0 are allowed here",
            "laws/a.py:4: Any; 0 are allowed here",
            "laws/a.py:4: Any; 0 are allowed here",
            "evolution/march.py:1: Any; 1 are allowed here",
            "evolution/march.py:2: Any; 1 are allowed here",
        ],
    ),
    data_classes_are_frozen: (
        {
            "laws/a.py": "@dataclass(frozen=True)\nclass A: ...\n@dataclass\nclass B: ...\n"
            "@dataclass(eq=False)\nclass C: ...\nclass D: ...\n",
            "systems/dense_newton.py": "@dataclass\nclass DenseFactor: ...\n"
            "@dataclass(frozen=False)\nclass Other: ...\n",
        },
        [
            "laws/a.py:4: B is not frozen",
            "laws/a.py:6: C is not frozen",
            "systems/dense_newton.py:4: Other is not frozen",
        ],
    ),
    data_classes_of_arrays_are_compared_by_identity: (
        {
            "laws/a.py": "@dataclass(frozen=True)\nclass A:\n    x: Array | None\n    f: Callable[[Array], float]\n"
            "    y: IntArray = field(compare=False)\n    z: tuple[sp.csr_array, ...] = ()\n    n: int\n"
            "@dataclass(frozen=True, eq=False)\nclass B:\n    x: Array\n"
            "@dataclass(frozen=True)\nclass C:\n    x: Array\n    def __eq__(self, other): ...\n"
            "@dataclass\nclass D:\n    x: NDArray[float]\n",
        },
        ["laws/a.py:2: A.x", "laws/a.py:2: A.z", "laws/a.py:16: D.x"],
    ),
    public_modules_say_what_is_public_and_what_for: (
        {
            "__init__.py": "'''A package.'''\n__all__ = []\n",
            "bare.py": "",
            "full.py": "'''A module.'''\nimport os\n__all__ = ['f', 'g', 'g', 'A', 'os', 'n']\nn = 1\ndef f(): ...\n"
            "def g():\n    '''What it does.'''\nclass A: ...\n",
            "_own.py": "raise ImportError\n",
        },
        [
            "bare.py:1: no docstring",
            "bare.py:1: no __all__",
            "full.py:1: f has no docstring",
            "full.py:1: __all__ repeats g",
            "full.py:1: __all__ repeats g",
            "full.py:1: A has no docstring",
            "full.py:1: os is a module",
        ],
    ),
    types_in_docstrings_exist: (
        {
            "laws/a.py": "from numpy import ndarray, bool_ as Truth\nKind = Truth\nlimit: 'Limit' = 1\n"
            "class Law:\n    '''A Thing : of prose.\n\n    Attributes\n    ----------\n    a, b : tuple of Gone\n"
            "        Of this Kind, as Prose is.\n    c : Law, Kind, Truth or None. As Said.\n    '''\n"
            "    def f(self):\n        '''Do it.\n\n        Returns\n        -------\n        Lost\n"
            "            A Word.\n\n        Raises\n        ------\n        ValueError, PastError\n"
            "            Where.\n\n"
            "        Notes\n        -----\n        Prose here.\n        '''\n",
        },
        ["laws/a.py:9: no Gone", "laws/a.py:18: no Lost", "laws/a.py:23: no PastError"],
    ),
    OF_TEXTS: (
        {"docs/a.md": "/tmp/x, src/work/ and\n/home/me; ../tmp/\n", "laws/a.py": "x = 1\n# TODO\nXXXL = 'FIXME'\n"},
        ["docs/a.md:1: /tmp/", "docs/a.md:2: /home/", "laws/a.py:2: TODO", "laws/a.py:3: FIXME"],
    ),
}


def planted(root: Path, files: dict[str, str]) -> Path:
    """A folder with these files."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize("rule", [*RULES, OF_TEXTS], ids=named)
def test_what_breaks_the_rule_is_named(rule: Rule, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    files, expected = PLANTED[rule]
    root = planted(tmp_path / "planted", files)
    found = list(rule(sources(root, kinds=(".py", ".md"))))
    assert sorted(found) == sorted(expected)
    with pytest.raises(AssertionError, match=re.escape(found[-1])):
        hold(rule, sources(root, kinds=(".py", ".md")))


def linted(root: Path) -> list[str]:
    """What breaks the contracts of ``pyproject.toml``, of the package ``hemivar`` in a folder."""
    code = (
        "import sys; from importlinter.cli import lint_imports; "
        f"sys.exit(lint_imports(config_filename={str(ROOT / 'pyproject.toml')!r}, no_cache=True))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False)
    assert f"{len(CONTRACTS)} kept" in run.stdout or run.returncode, run.stdout + run.stderr
    assert f" kept, {run.stdout.count(' BROKEN')} broken." in run.stdout, run.stdout + run.stderr
    return sorted(set(re.findall(r"^- +(\S+.*)$", run.stdout, re.MULTILINE)))


def test_packages_import_what_the_contract_allows() -> None:
    assert linted(PACKAGE.parent) == []


def test_an_import_that_breaks_the_contract_is_named(tmp_path: Path) -> None:
    stubs = (name if name in ("errors", "materials", "__main__") else f"{name}/__init__" for name in RANK)
    root = planted(
        tmp_path,
        {f"hemivar/{name}.py": "" for name in stubs}
        | {
            "hemivar/__init__.py": "",
            "hemivar/cli/app.py": "from hemivar import __version__\nimport typer\n",
            "hemivar/workflows/diagnosis.py": "",
            "hemivar/laws/a.py": "import hemivar\nfrom hemivar import solvers\nimport numpy\n"
            "from hemivar.basics import arrays\nfrom ..mesh import Mesh\nfrom .b import Law\n"
            "if TYPE_CHECKING:\n    from hemivar.report import plot\nelse:\n    import hemivar.cli\n"
            "def f():\n    from hemivar.report import plot\n",
            "hemivar/laws/b.py": "import gmsh\ndef f():\n    from skfem.helpers import dot\n",
            "hemivar/strange/__init__.py": "",
            "hemivar/certificates/a.py": "from hemivar.solvers import solve\nfrom hemivar.laws import a\n",
            "hemivar/survey/a.py": "from hemivar.identification import fit\nimport matplotlib, mpl_toolkits\n",
            "hemivar/fem/a.py": "import skfem\nimport pypardiso, pyamg, meshio\n",
            "hemivar/linear/a.py": "import pyamg\n",
            "hemivar/report/a.py": "import matplotlib.pyplot\nimport mpl_toolkits\nimport typer\n",
            "hemivar/files/a.py": "import meshio\n",
        },
    )
    assert linted(root) == [
        "hemivar.certificates.a -> hemivar.laws.a (l.2)",  # on a way to what uses the method
        "hemivar.certificates.a -> hemivar.solvers (l.1)",
        "hemivar.fem.a -> meshio (l.2)",
        "hemivar.fem.a -> pyamg (l.2)",
        "hemivar.fem.a -> pypardiso (l.2)",
        "hemivar.laws.a -> hemivar (l.1)",
        "hemivar.laws.a -> hemivar.cli (l.10)",
        "hemivar.laws.a -> hemivar.mesh (l.5)",
        "hemivar.laws.a -> hemivar.report (l.12)",
        "hemivar.laws.a -> hemivar.solvers (l.2)",
        "hemivar.laws.b -> gmsh (l.1)",
        "hemivar.laws.b -> skfem (l.3)",
        "hemivar.report.a -> typer (l.3)",
        "hemivar.strange",  # has no place in the order
        "hemivar.survey.a -> hemivar.identification (l.1)",
        "hemivar.survey.a -> mpl_toolkits (l.2)",
    ]


def test_the_picture_of_the_packages_is_the_contract() -> None:
    drawn = re.findall(
        r"^\| (\w+) |^\+- (.+?) -", CONTRIBUTING.partition("```text\n")[2].partition("```")[0], re.MULTILINE
    )
    assert [name for name, tier in drawn if not tier] == sorted(RANK, key=RANK.__getitem__, reverse=True)
    method = drawn.index(("", "the method"))
    assert drawn[0] == ("", "what uses the method")
    assert {f"hemivar.{name}" for name, _ in drawn[1:method]} == set(CONTRACTS["tiers"]["forbidden_modules"])
    assert {f"hemivar.{name}" for name, _ in drawn[method + 1 :]} == set(CONTRACTS["tiers"]["source_modules"])
    assert {one.name for one in PACKAGE.iterdir() if one.is_dir() and one.name != "__pycache__"} < {
        name for name, _ in drawn
    }


def imports(package: str, types: bool) -> set[tuple[str, str]]:
    """Pairs of modules of a package of which the first imports the second, anywhere; or for types alone as well."""
    graph = grimp.build_graph(package, exclude_type_checking_imports=not types, cache_dir=None)
    return {(one, other) for one in graph.modules for other in graph.find_modules_directly_imported_by(one)}


def room_of(module: str) -> str:
    """The package below that of the library."""
    return module.partition(".")[2].partition(".")[0]


#: Types that the method names, of what uses it.
TYPES_FROM_ABOVE = {
    ("hemivar.certificates.wording", "hemivar.bounds.stated_distance"),
    ("hemivar.evolution.stage_solver", "hemivar.branches.solutions"),
    ("hemivar.solvers.solution", "hemivar.report.summary"),
}


def test_the_method_takes_three_types_from_what_uses_it() -> None:
    above = {room_of(name) for name in CONTRACTS["tiers"]["forbidden_modules"]}
    found = {pair for pair in imports("hemivar", True) if room_of(pair[1]) in above and room_of(pair[0]) not in above}
    assert found == TYPES_FROM_ABOVE


def circles(arrows: set[tuple[str, str]]) -> list[set[str]]:
    """Files that import one another on some way, largest sets first."""
    names = sorted({name for pair in arrows for name in pair})
    row, column = ([names.index(pair[side]) for pair in arrows] for side in (0, 1))
    graph = sp.coo_array((np.ones(len(row)), (row, column)), shape=(len(names),) * 2)
    label = connected_components(graph, connection="strong")[1]
    groups = [{names[k] for k in np.flatnonzero(label == one)} for one in range(label.max(initial=-1) + 1)]
    return sorted((group for group in groups if len(group) > 1), key=lambda group: (-len(group), min(group)))


def test_files_of_a_package_form_three_circles() -> None:
    arrows = imports("hemivar", True)
    inside = {pair for pair in arrows if room_of(pair[0]) == room_of(pair[1])}
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \| .{20,} \|$", CONTRIBUTING.partition("no circle")[2], re.MULTILINE)
    allowed = [{f"hemivar.{room}.{name}" for name in re.findall(r"\w+", files)} for room, files in rows]
    found = circles(inside)
    assert len(found) <= 3
    assert sorted(map(sorted, found)) == sorted(map(sorted, allowed)), "let no file of a circle import another one"
    of_packages = {(room_of(one), room_of(other)) for one, other in arrows - inside - TYPES_FROM_ABOVE}
    assert circles({pair for pair in of_packages if all(pair)}) == []


def test_a_circle_of_files_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    files = {
        "__init__": "",
        "a": "from planted_circle.b import f\n",
        "b": "def f():\n    from planted_circle import c\n",
        "c": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from planted_circle.a import A\n",
        "d": "from planted_circle import a\n",
        "e/__init__": "from planted_circle.e.f import f\n",
        "e/f": "from planted_circle.e import g, h\n",
        "e/g": "",
    }
    planted(tmp_path, {f"planted_circle/{name}.py": text for name, text in files.items()})
    named = [{f"planted_circle.{name}" for name in "abc"}, {"planted_circle.e", "planted_circle.e.f"}]
    assert circles(imports("planted_circle", True)) == named
    assert circles(imports("planted_circle", False)) == [named[1]]


#: Packages that are slow to load.
SLOW = tuple(PROJECT["tool"]["ruff"]["lint"]["flake8-tidy-imports"]["banned-module-level-imports"])


def test_a_slow_package_is_imported_where_it_is_used(tmp_path: Path) -> None:
    text = "import matplotlib.pyplot\nfrom meshio import read\ndef f():\n    import gmsh\n"
    root = planted(tmp_path, {"src/hemivar/report/a.py": text, "tests/a.py": text})
    ruff = ["ruff", "check", "--no-cache", "--output-format=concise", "--select=TID253"]
    command = [sys.executable, "-m", *ruff, f"--config={ROOT / 'pyproject.toml'}", "."]
    run = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert re.findall(r"^(\S+): (TID253 `\w+`)", run.stdout, re.MULTILINE) == [
        ("src/hemivar/report/a.py:1:8", "TID253 `matplotlib`"),
        ("src/hemivar/report/a.py:2:1", "TID253 `meshio`"),
    ]


#: Modules, and packages that none of them and of those before loads.
LOADED_LATE = (
    ("hemivar", ("numpy", "scipy", "skfem", *SLOW)),
    ("hemivar.cli", ("scipy", "skfem", *SLOW)),
    ("hemivar.laws", ("skfem", *SLOW)),
    *((f"hemivar.{file.name}", SLOW) for file in sources(PACKAGE) if file.name not in ("", "__main__")),
)


def loaded_early(modules: Sequence[tuple[str, tuple[str, ...]]]) -> list[str]:
    """What a fresh interpreter has loaded too early when it has imported these modules in turn."""
    code = (
        f"import importlib, sys\nfor module, absent in {modules!r}:\n    importlib.import_module(module)\n"
        "    print(*(f'{module}:{name}' for name in absent if name in sys.modules))"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_import_is_quick() -> None:
    assert loaded_early(LOADED_LATE) == []


def test_a_package_that_is_loaded_early_is_named() -> None:
    assert loaded_early((("token", ("xmlrpc",)), ("json", ("json.decoder", "xmlrpc")))) == ["json:json.decoder"]


def test_lazy_names_are_all_there_and_typed() -> None:
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    imports = [(node.module, alias) for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert all(alias.asname == alias.name for _, alias in imports), "as NAME makes a type checker take it for public"
    rooms = {alias.name for module, alias in imports if module is None}
    names = [alias.name for module, alias in imports if module is not None]
    assert {"__version__", *names} == set(hemivar.__all__)
    assert 30 <= len(names) <= 41
    assert set(dir(hemivar)) == {*hemivar.__all__, *rooms}
    assert all(getattr(hemivar, room).__name__ == f"hemivar.{room}" for room in rooms)


def test_a_name_of_a_room_says_in_which_room_it_is() -> None:
    for name, where in (("Sphere", r"; it is hemivar\.mechanics\.Sphere"), ("Spheer", "")):
        with pytest.raises(AttributeError, match=f"no attribute '{name}'{where}$"):
            getattr(hemivar, name)


def test_versions_agree() -> None:
    assert PROJECT["project"]["version"] == hemivar.__version__
    assert f"[{hemivar.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_tests_are_found_by_the_name_of_what_they_test() -> None:
    """``test_MODULE.py`` or ``test_MODULE_WHAT.py``: four of five; others test pages, the whole, or many modules."""
    modules = {path.stem.strip("_") for path in PACKAGE.rglob("*.py")} | {path.stem for path in PACKAGE.rglob("*.cpp")}

    def module_of(test: Path) -> str | None:
        words = test.stem.removeprefix("test_").split("_")
        heads = ("_".join(words[:count]) for count in range(len(words), 0, -1))
        return next((head for head in heads if head in modules), None)

    files = list((ROOT / "tests").rglob("test_*.py"))
    lost = [str(test.relative_to(ROOT)) for test in files if module_of(test) is None]
    assert len(lost) <= 0.2 * len(files), lost


#: Names that helper functions share in three files of tests or more.
RECURRING = 10


def test_helpers_of_tests_say_what_they_build() -> None:
    """Take a builder of ``tests/bodies.py``, or let the name say what is built: no ``block`` in a fifth file."""
    homes: dict[str, set[str]] = defaultdict(set)
    for file in sources(ROOT, "tests"):
        for node in file.tree.body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith(("test_", "pytest_")):
                marks = " ".join(map(ast.unparse, node.decorator_list))
                homes["fixture" if "fixture" in marks else node.name].add(file.file)
    del homes["fixture"]
    often = {name: sorted(found) for name, found in homes.items() if len(found) > 2}
    assert len(often) <= RECURRING, often
