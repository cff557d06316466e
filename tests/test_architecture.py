"""The order of the rooms: who may import whom, what is loaded when, and what every module must have."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import hemivar

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "hemivar"

#: Modules and packages of hemivar by rank: each may import itself and what stands on a lower line.
LAYERS: tuple[tuple[str, ...], ...] = (
    ("errors",),
    ("basics",),
    ("kernels",),  # compiled code
    ("linear",),  # matrices, never problems
    ("formula",),
    ("laws",),
    ("mesh",),
    ("coercivity",),  # knows problems by their types only
    ("discrete",),
    ("mechanics",),
    ("materials",),
    ("fem",),
    ("systems",),
    ("solvers", "certificates"),
    ("branches", "adapt"),
    ("evolution", "identification"),
    ("engines", "gallery"),
    ("files",),
    ("workflows",),
    ("report",),
    ("studio",),
    ("cli",),
    ("__main__",),
)
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}

#: External packages that only some rooms know; module path prefixes inside hemivar.
ONLY_IN = {
    "skfem": ("fem",),
    "matplotlib": ("report",),
    "mpl_toolkits": ("report",),
    "meshio": ("mesh", "files"),
    "gmsh": (),
    "pyamg": ("linear",),
    "typer": ("cli",),
    "mumps": ("linear.factorisation",),
}

FILES = sorted(PACKAGE.rglob("*.py"))


def module_name(path: Path) -> str:
    """Dotted name below hemivar, ``""`` for the package itself."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def is_type_checking(test: ast.expr) -> bool:
    name = test.attr if isinstance(test, ast.Attribute) else getattr(test, "id", None)
    return name == "TYPE_CHECKING"


def walk(node: ast.AST, function: str = "") -> Iterator[tuple[ast.stmt, str]]:
    """Import statements and the function in which they run, "" if at import; type checking blocks are left out."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, function
        elif isinstance(child, ast.If) and is_type_checking(child.test):
            for other in child.orelse:
                yield from walk(ast.Module([other], []), function)
        else:
            named = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef)
            yield from walk(child, function or (child.name if named else ""))


def imports(path: Path) -> Iterator[tuple[str, str, int]]:
    """Absolute names of imported modules, with the function that loads them, "" if at import, and the line."""
    package = ("hemivar", *module_name(path).split(".")) if module_name(path) else ("hemivar",)
    if path.name != "__init__.py":
        package = package[:-1]
    for node, function in walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, function, node.lineno
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            source = ".".join(part for part in (base, node.module or "") if part)
            if source == "hemivar":
                for alias in node.names:
                    yield f"hemivar.{alias.name}", function, node.lineno
            else:
                yield source, function, node.lineno


def private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def borrowed(path: Path) -> Iterator[tuple[str, int]]:
    """Names and modules with ``_`` that a module takes from a package other than its own, or reaches into."""
    own = module_name(path).rpartition(".")[0] if path.name != "__init__.py" else module_name(path)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hemivar."):
            source = (node.module or "").removeprefix("hemivar.")
            for name in (*source.split("."), *(alias.name for alias in node.names)):
                if private(name) and source.split(".")[0] != own.split(".")[0]:
                    yield f"{source}: {name}", node.lineno
        elif isinstance(node, ast.Attribute) and private(node.attr) and isinstance(node.value, ast.Name):
            known = private(node.value.id) or node.value.id in ("self", "cls", "os", "sys")
            if not known and node.attr not in attributes_of(own.split(".")[0]):
                yield f"{node.value.id}.{node.attr}", node.lineno


@cache
def attributes_of(room: str) -> frozenset[str]:
    """Every private name that the modules of a room give to a function, a class or an attribute."""
    names: set[str] = set()
    for path in FILES:
        if layer(module_name(path)) == room:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef | ast.ClassDef):
                    names.add(node.name)
                elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                    names.add(node.attr)
                elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    names.add(node.id)
    return frozenset(names)


@pytest.mark.parametrize("path", FILES, ids=lambda path: module_name(path) or "hemivar")
def test_a_name_with_an_underscore_stays_in_its_package(path: Path) -> None:
    found = [f"{path}:{line}: {name}" for name, line in borrowed(path)]
    assert not found, f"make them public, or go another way: {found}"


def test_a_borrowed_private_name_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = tmp_path / "solvers" / "a.py"
    code.parent.mkdir()
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path)
    monkeypatch.setitem(globals(), "FILES", [code])
    for text, count in (
        ("from hemivar.mesh._keys import facets", 1),
        ("from hemivar.mesh.mesh import _facets, Mesh", 1),
        ("from hemivar.solvers._steps import step", 0),
        ("mesh._trusted(1)", 1),
        ("self._own\nos._exit(1)\nmesh.__dict__", 0),
    ):
        code.write_text(text)
        assert len(list(borrowed(code))) == count, text


#: Names that two modules may share: what both engines have. A workflow and the command that shows it share theirs.
SHARED = {
    "assembly": {"fem", "engines"},
    "certificate": {"certificates", "engines"},
    "on_ranks": {"report", "cli"},
    "solve": {"solvers", "engines"},
}


def test_no_two_modules_share_a_name() -> None:
    rooms: dict[str, list[str]] = {}
    for path in FILES:
        if path.name != "__init__.py":
            rooms.setdefault(path.stem, []).append(layer(module_name(path)))
    twice = {
        f"{name}.py in {', '.join(found)}"
        for name, found in rooms.items()
        if len(found) > 1 and (len(found) > 2 or set(found) not in ({"workflows", "cli"}, SHARED.get(name)))
    }
    assert not twice, "one idea has one name"


def test_no_two_classes_share_a_name() -> None:
    """A traceback, a message of mypy and a page of the reference then say which is meant."""
    homes: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(module_name(path))
    twice = {name: found for name, found in homes.items() if len(found) > 1}
    assert twice.keys() <= {"Memory"}, twice  # of contact laws, and of the method on levels


def layer(module: str) -> str:
    return module.split(".")[0]


@pytest.mark.parametrize("path", FILES, ids=lambda path: module_name(path) or "hemivar")
def test_imports_go_downwards(path: Path) -> None:
    own = layer(module_name(path))
    if own == "":
        return  # the package itself loads its public names on demand
    assert own in RANK, f"hemivar.{own} has no rank; place it in LAYERS"
    for name, _, line in imports(path):
        if not name.startswith("hemivar."):
            assert name != "hemivar", f"{path}:{line} imports hemivar itself; import the submodule"
            continue
        other = layer(name.removeprefix("hemivar."))
        if other == "__version__":
            continue
        assert other in RANK, f"{path}:{line} imports hemivar.{other}, which has no rank"
        assert other == own or RANK[other] < RANK[own], f"{path}:{line}: {own} must not import {other}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: module_name(path) or "hemivar")
def test_external_packages_stay_in_their_rooms(path: Path) -> None:
    own = module_name(path)
    for name, _, line in imports(path):
        rooms = ONLY_IN.get(name.split(".")[0])
        if rooms is not None:
            allowed = any(own == room or own.startswith(room + ".") for room in rooms)
            assert allowed, f"{path}:{line}: {name} may be imported in {rooms} only"


@pytest.mark.parametrize("path", FILES, ids=lambda path: module_name(path) or "hemivar")
def test_slow_packages_are_imported_where_they_are_used(path: Path) -> None:
    for name, function, line in imports(path):
        if name.split(".")[0] in ("matplotlib", "mpl_toolkits", "meshio"):
            assert function, f"{path}:{line}: import {name} inside the function that uses it"


def called(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Methods that hand their value on: the type and method around a call of ``above``, and what it is called with."""
    for kind in (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)):
        for method in (node for node in kind.body if isinstance(node, ast.FunctionDef)):
            for node in ast.walk(method):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "above":
                    yield f"{kind.name}.{method.name}", ast.literal_eval(node.args[0])


def test_methods_that_hand_their_value_on_are_those_of_the_table() -> None:
    """Every entry leads from a method that asks for it to a function that is there, in a room above."""
    asked: dict[str, str] = {}
    for path in FILES:
        for method, entry in called(ast.parse(path.read_text(encoding="utf-8"))):
            assert method == entry, f"{path}: {method} asks for {entry}"
            asked[entry] = layer(module_name(path))
    table = hemivar._HANDED_ON
    assert asked.keys() == table.keys()
    for entry, target in table.items():
        module, _, function = target.rpartition(".")
        assert callable(getattr(importlib.import_module(f"hemivar.{module}"), function)), target
        assert RANK[target.split(".")[0]] >= RANK[asked[entry]], f"{entry} leads to no room above"


def unlocked(node: ast.AST, locked: bool = False) -> Iterator[int]:
    """Lines of imports from this package in functions, outside ``with IMPORTS``."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ImportFrom) and not locked and (child.module or "").startswith("hemivar"):
            yield child.lineno
        holds = isinstance(child, ast.With) and any(getattr(x.context_expr, "id", "") == "IMPORTS" for x in child.items)
        yield from unlocked(child, locked or holds)


@pytest.mark.parametrize("path", FILES, ids=lambda path: module_name(path) or "hemivar")
def test_imports_on_first_use_stand_under_the_lock(path: Path) -> None:
    """Two threads that load one package from different ends are given modules that are half loaded."""
    if layer(module_name(path)) == "cli":
        return  # one thread
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    lines = [line for function in functions for line in unlocked(function)]
    assert not lines, f"{path}:{lines}: import under basics.first_use.IMPORTS"


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("hemivar", ("numpy", "scipy", "skfem", "matplotlib", "meshio", "rich")),
        ("hemivar.cli", ("scipy", "skfem", "matplotlib", "meshio")),
        ("hemivar.laws", ("skfem", "matplotlib", "meshio")),
        ("hemivar.solvers", ("matplotlib",)),
        ("hemivar.report", ("matplotlib",)),
    ],
)
def test_import_is_quick(module: str, absent: tuple[str, ...]) -> None:
    code = f"import sys, {module}; print(*[name for name in {absent!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


#: Methods that write or read a file; a temporary name of ``whole_file`` may be written to.
WRITING = {"write_text", "write_bytes", "savefig", "screenshot", "to_csv", "tofile", "savez", "savetxt", "touch"}
READING = {"read_text", "read_bytes", "loadtxt", "genfromtxt"}
#: Where files are opened otherwise: descriptors of the process, files of the system, parallel writers of one file,
#: arrays that are packed into a stream.
OPENING = (
    "basics.disk",
    "cli.terminal",
    "basics.machine",
    "engines.petsc.checkpoint",
    "engines.petsc.files",
    "engines.petsc.march_checkpoint",
    "basics.packed",
    "evolution.march_state",
    "report.on_ranks",
)


def opened(path: Path) -> Iterator[tuple[str, int]]:
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

    yield from search(ast.parse(path.read_text(encoding="utf-8")), False)


@pytest.mark.parametrize("path", FILES, ids=lambda path: module_name(path) or "hemivar")
def test_files_are_opened_by_one_module(path: Path) -> None:
    own = module_name(path)
    if any(own == room or own.startswith(room + ".") for room in OPENING):
        return
    found = [f"{path}:{line}: {name}" for name, line in opened(path)]
    assert not found, f"read and write by hemivar.disk: {found}"


def test_a_file_opened_elsewhere_is_found(tmp_path: Path) -> None:
    code = tmp_path / "a.py"
    for text, count in (
        ("with whole_file(path) as name:\n    fig.savefig(name)\n    name.write_text('')", 0),
        ("fig.savefig(path)", 1),
        ("path.open('w')", 1),
        ("open(path)", 1),
        ("grid.write(path, file_format='vtu')", 1),
        ("stream.write('text')\ndisk.write_text(path, '')\nread_text(path)", 0),
        ("with whole_file(path) as name:\n    pass\npath.write_text('')", 1),
    ):
        code.write_text(text)
        assert len(list(opened(code))) == count, text


#: Where a type cannot be named, how often at most, and why.  A number may fall; a new place wants a reason here.
UNTYPED = {
    "basics.arguments": (2, "a union of classes as a value has no type of its own"),
    "basics.defined_above": (2, "functions of rooms above, of any kind"),
    "basics.types": (2, "entries of any kind; JSON"),
    "cli.adapting": (3, "options of the command by name"),
    "cli.march_results": (1, "keywords of a film"),
    "cli.march_run": (1, "keywords of a film"),
    "evolution.evolution_problem": (3, "initial fields as users give them"),
    "evolution.history": (3, "a DataFrame, keywords of matplotlib"),
    "evolution.march": (1, "keywords of a plan"),
    "evolution.march_state": (1, "JSON"),
    "evolution.save": (4, "places as users give them"),
    "files.material_table": (1, "keywords of a dataclass, read from a file"),
    "files.memory_table": (3, "dataclasses found by their names"),
    "files.schema": (1, "keywords of a dataclass, read from a file"),
    "linear.pyamg_kernels": (1, "compiled kernels without types"),
    "linear.threads": (4, "libraries of threadpoolctl"),
    "report.adaptive_figures": (1, "axes in the plane or in space"),
    "report.animation": (2, "canvas and writer of matplotlib"),
    "report.film_pictures": (1, "axes in the plane or in space"),
    "report.march_figures": (2, "keywords of matplotlib"),
    "report.frames": (4, "tables of values of any kind"),
    "report.scene": (2, "a plotter of pyvista"),
    "report.style": (3, "parameters and keywords of matplotlib"),
    "solvers.base": (6, "each method has its own system and memory"),
    "solvers.fixed_point": (1, "the memory of the method inside"),
    "workflows.marching": (1, "keywords of a plan"),
}


def untyped(tree: ast.AST) -> int:
    """How often ``Any`` is said in code, imports left out."""
    return sum(
        (isinstance(node, ast.Name) and node.id == "Any") or (isinstance(node, ast.Attribute) and node.attr == "Any")
        for node in ast.walk(tree)
    )


def test_any_stands_at_true_boundaries_only() -> None:
    found = {module_name(path): untyped(ast.parse(path.read_text(encoding="utf-8"))) for path in FILES}
    more = {name: count for name, count in found.items() if count > UNTYPED.get(name, (0, ""))[0]}
    assert not more, f"name a type (object, a protocol, a TypedDict), or list the module with its reason: {more}"
    stale = [name for name in UNTYPED if not found.get(name)]
    assert not stale, f"strike them from UNTYPED: {stale}"
    assert sum(found.values()) <= 58


def test_any_is_counted_wherever_it_is_said() -> None:
    code = (
        "from typing import Any\nimport typing\nx: Any = 1\ndef f(a: dict[str, Any]) -> typing.Any:\n    y: list[int]\n"
    )
    assert untyped(ast.parse(code)) == 3


#: Data classes that change while a method works with them; all others are frozen.
WORKING = {
    "branches.follower": ("TrackPoint", "Track", "Follower"),
    "coercivity.recession": ("_Programme",),
    "evolution.jump_paths": ("_GradientFlow",),
    "laws.testing": ("_Checker",),
    "solvers.active_set_newton": ("NewtonCache",),
    "systems.dense_newton": ("DenseFactor",),
}


def data_classes(tree: ast.AST) -> Iterator[tuple[ast.ClassDef, dict[str, bool]]]:
    """The data classes of a module with the options of their decorators."""
    for node in ast.walk(tree):
        for decorator in node.decorator_list if isinstance(node, ast.ClassDef) else ():
            called = decorator.func if isinstance(decorator, ast.Call) else decorator
            if isinstance(called, ast.Name) and called.id == "dataclass":
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


def test_data_classes_are_frozen_and_those_of_arrays_are_compared_by_identity() -> None:
    """Arrays have no single answer to ``==``, so that a comparison entry by entry would fail where it is asked for."""
    thawed, compared = {}, {}
    for path in FILES:
        for node, options in data_classes(ast.parse(path.read_text(encoding="utf-8"))):
            name = module_name(path)
            if not options.get("frozen", False):
                thawed[name] = (*thawed.get(name, ()), node.name)
            if options.get("eq", True) and "__eq__" not in {getattr(part, "name", "") for part in node.body}:
                compared.update({f"{name}.{node.name}": fields for fields in [compared_arrays(node)] if fields})
    assert thawed == WORKING
    assert not compared, f"state @dataclass(eq=False), or field(compare=False): {compared}"


def test_arrays_of_data_classes_are_found() -> None:
    code = (
        "@dataclass(frozen=True)\nclass A:\n    x: Array | None\n    f: Callable[[Array], float]\n"
        "    y: IntArray = field(compare=False)\n    z: tuple[sp.csr_array, ...] = ()\n"
        "@dataclass\nclass B:\n    n: int\n"
    )
    (first, options), (second, none) = data_classes(ast.parse(code))
    assert (options, none) == ({"frozen": True}, {})
    assert (compared_arrays(first), compared_arrays(second)) == (["x", "z"], [])


def public_modules() -> list[str]:
    names = [module_name(path) for path in FILES]
    public = [name for name in names if not any(part.startswith("_") for part in name.split("."))]
    return [f"hemivar.{name}" if name else "hemivar" for name in public]


@pytest.mark.parametrize("name", public_modules())
def test_public_modules_say_what_is_public_and_what_for(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__doc__, f"{name} has no docstring"
    assert hasattr(module, "__all__"), f"{name} has no __all__"
    assert len(set(module.__all__)) == len(module.__all__), f"{name}.__all__ repeats a name"
    for public in module.__all__:
        value = getattr(module, public)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert inspect.getdoc(value), f"{name}.{public} has no docstring"


def test_lazy_names_are_all_there_and_typed() -> None:
    import hemivar

    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    imports = [(node.module, alias) for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert all(alias.asname == alias.name for _, alias in imports), "as NAME makes a type checker take it for public"
    rooms = {alias.name for module, alias in imports if module is None}
    names = [alias.name for module, alias in imports if module is not None]
    assert {"__version__", *names} == set(hemivar.__all__)
    assert 30 <= len(names) <= 40
    assert set(dir(hemivar)) == {*hemivar.__all__, *rooms}
    assert all(getattr(hemivar, room).__name__ == f"hemivar.{room}" for room in rooms)


def test_a_name_of_a_room_says_in_which_room_it_is() -> None:
    for name, where in (("Sphere", r"; it is hemivar\.mechanics\.Sphere"), ("Spheer", "")):
        with pytest.raises(AttributeError, match=f"no attribute '{name}'{where}$"):
            getattr(hemivar, name)


TEXTS = sorted(
    path
    for folder in ("src", "examples", "docs", "benchmarks")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".md", ".toml")
)


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_texts_name_no_folder_of_one_machine_and_leave_nothing_undone(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    for pattern in (r"(?<![\w.])/(tmp|work|home|root|Users)/", r"\b(TODO|FIXME|XXX)\b"):
        found = re.search(pattern, text)
        assert found is None, f"{path}: {found and found[0]}"


def test_versions_agree() -> None:
    import tomllib

    import hemivar

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == hemivar.__version__
    assert f"[{hemivar.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
