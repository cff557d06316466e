"""Public names mean the same whatever has been imported, and in whatever order."""

from __future__ import annotations

import atexit
import json
import pkgutil
import subprocess
import sys
from functools import cache

import pytest

import hemivar

MODULES = [
    module.name
    for module in pkgutil.walk_packages(hemivar.__path__, "hemivar.")
    if not module.name.endswith(("__main__", "kernels._compiled")) and ".distributed" not in module.name
]

KINDS = """
import importlib, json, sys
for module in {modules!r}:
    importlib.import_module(module)
import hemivar
for module in {later!r}:
    importlib.import_module(module)
print(json.dumps({{name: type(getattr(hemivar, name)).__name__ for name in hemivar.__all__}}))
"""


# One interpreter that has loaded what takes long and is not hemivar; each code runs in a fork of it.
SERVER = """
import contextlib, io, json, os, sys, traceback
import matplotlib.figure, meshio, numpy, pyamg, rich.console, scipy.optimize, scipy.sparse.linalg, skfem, typer
assert not [name for name in sys.modules if name.startswith("hemivar")]
for line in sys.stdin:
    if os.fork():
        os.wait()
        continue
    printed, failed = io.StringIO(), ""
    try:
        with contextlib.redirect_stdout(printed):
            exec(json.loads(line), {"__name__": "__main__"})
    except BaseException:
        failed = traceback.format_exc()
    print(json.dumps([printed.getvalue(), failed]), flush=True)
    os._exit(0)
"""


@cache
def server() -> subprocess.Popen[str]:
    made = subprocess.Popen([sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(made.kill)
    return made


def python(code: str) -> str:
    """What a code prints in an interpreter that has imported nothing of hemivar."""
    asked, answers = server().stdin, server().stdout
    assert asked is not None
    assert answers is not None
    asked.write(json.dumps(code) + "\n")
    asked.flush()
    printed, failed = json.loads(answers.readline())
    assert not failed, failed
    return str(printed)


def kinds(modules: list[str], later: list[str]) -> dict[str, str]:
    return dict(json.loads(python(KINDS.format(modules=modules, later=later))))


@pytest.fixture(scope="module")
def expected() -> dict[str, str]:
    """What each name is in a fresh interpreter."""
    return kinds([], [])


@pytest.mark.parametrize(
    ("modules", "later"),
    [
        (MODULES, []),
        (MODULES[::-1], []),
        ([], MODULES),
        ([], MODULES[::-1]),
        (["hemivar.report"], []),
        (["hemivar.certificates.smallness"], ["hemivar.certificates"]),
    ],
    ids=["first", "first, from the back", "later", "later, from the back", "report", "a room from within"],
)
def test_names_are_the_same_after_every_import(expected: dict[str, str], modules: list[str], later: list[str]) -> None:
    assert "module" not in expected.values()
    assert kinds(modules, later) == expected


@pytest.mark.parametrize(
    "name", ["find_solutions", "follow_path", "solve", "read_problem", "certificates.smallness", "laws.Capped"]
)
def test_using_one_name_changes_no_other(name: str) -> None:
    code = f"import hemivar as hv; hv.{name}; print(callable(hv.certify), callable(hv.march), callable(hv.solve))"
    assert python(code).split() == ["True", "True", "True"]


@pytest.mark.parametrize("name", [name for name in MODULES if not any(p.startswith("_") for p in name.split("."))])
def test_no_name_that_a_module_exports_is_hidden_by_a_module(name: str) -> None:
    module = sys.modules.get(name) or __import__(name, fromlist=["_"])
    hidden = [public for public in getattr(module, "__all__", ()) if type(getattr(module, public)).__name__ == "module"]
    assert hidden == []


@pytest.mark.parametrize("before", ["", "import hemivar as hv; hv.certify", "import hemivar.report"])
def test_certify_is_a_function_and_no_module(before: str) -> None:
    """A name is a function or a package; the room of certificates has another name than the function."""
    python(f"{before}\nimport hemivar, pickle; assert pickle.loads(pickle.dumps(hemivar.certify)) is hemivar.certify")
    python(f"{before}\nimport hemivar.certificates, hemivar; assert hemivar.certificates.certify is hemivar.certify")
    assert "hemivar.certify" not in MODULES


def test_no_module_at_the_root_has_the_name_of_a_public_one() -> None:
    assert not {name.removeprefix("hemivar.") for name in MODULES} & set(hemivar.__all__)


def test_own_attributes_can_be_set_and_a_name_replaced() -> None:
    code = "import hemivar; hemivar.mark = 1; hemivar.solve = len; print(hemivar.mark, hemivar.solve is len)"
    assert python(code).split() == ["1", "True"]
