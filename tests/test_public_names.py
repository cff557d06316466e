"""Public names mean the same whatever has been imported, and in whatever order."""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping

import pytest

import hemivar
from tests.sources import PACKAGE, ROOT, sources

MODULES = [f"hemivar.{file.name}" for file in sources(PACKAGE) if file.name not in ("", "__main__")]

# One interpreter that has loaded what takes long and is not hemivar.  Each start runs in a fork of it, and each code
# that comes after that start in a fork of that; all say how they ended, and what they have told.
INTERPRETER = """
import asyncio, concurrent.futures.process, gc, json, multiprocessing.queues, os, sys, tomllib, traceback, webbrowser
import matplotlib.figure, meshio, numpy, pyamg, rich.console, skfem, typer
import scipy.integrate, scipy.interpolate, scipy.ndimage, scipy.optimize, scipy.sparse.linalg, scipy.stats

def fork(label, code, later, names):
    if child := os.fork():
        os.waitpid(child, 0)
        return
    failed = ""
    try:
        exec(code, names)
    except BaseException:
        failed = traceback.format_exc()
    print(json.dumps([label, failed, names.get("told")]), flush=True)
    for other in later:
        fork(label, other, (), names)
    os._exit(0)

assert not [name for name in sys.modules if name.startswith("hemivar")]
gc.disable()
gc.freeze()
for label, (code, *later) in json.load(sys.stdin).items():
    fork(label, code, later, {"__name__": "__main__"})
"""

KINDS = "import hemivar as hv; told = {name: type(getattr(hv, name)).__name__ for name in hv.__all__}"
PICKLED = "import hemivar as hv, pickle; assert pickle.loads(pickle.dumps(hv.certify)) is hv.certify"
ROOM = "import hemivar.certificates, hemivar; assert hemivar.certificates.certify is hemivar.certify"
CALLED = "assert callable(hv.certify) and callable(hv.march) and callable(hv.solve)"
REPLACED = "import hemivar as hv; hv.mark = 1; hv.solve = len; assert (hv.mark, hv.solve) == (1, len)"
USED = ("find_solutions", "follow_path", "solve", "read_problem", "certificates.smallness", "laws.Capped")


def imported(*modules: str) -> str:
    return "import " + ", ".join(modules)


Starts = Mapping[str, tuple[str, ...]]
#: What is run in a fresh interpreter, and each of what is run after it.
STARTS: Starts = {
    "nothing": ("", KINDS, PICKLED, ROOM, REPLACED),
    "certify": ("import hemivar as hv; hv.certify", PICKLED, ROOM),
    "report": (imported("hemivar.report"), KINDS, PICKLED, ROOM),
    "a room from within": (imported("hemivar.certificates.smallness", "hemivar", "hemivar.certificates"), KINDS),
    "every module": (imported(*MODULES), KINDS),
    "every module from the back": (imported("hemivar", *MODULES[::-1]), KINDS),
    **{name: (f"import hemivar as hv; hv.{name}", CALLED) for name in USED},
}
#: The full orders that differ from those by when the package itself is named.
OTHER_ORDERS: Starts = {
    "nothing": ("", KINDS),
    "the package, then every module": (imported("hemivar", *MODULES), KINDS),
    "every module from the back, then the package": (imported(*MODULES[::-1], "hemivar"), KINDS),
}
#: What must be found.
PLANTED: Starts = {
    "a start that fails": (imported("hemivar.nowhere"),),
    "a module in the place of a function": ("import hemivar as hv; hv.certify = hv", CALLED),
    "another kind": ("told = {'certify': 'type'}",),
    "an interpreter that dies": ("import os", "os._exit(1)"),
}


def misfits(starts: Starts) -> dict[str, list[str]]:
    """What failed or was cut short, and the names that are of another kind than in a fresh interpreter, by start."""
    done = subprocess.run(
        [sys.executable, "-c", INTERPRETER], input=json.dumps(starts), capture_output=True, text=True, check=True
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    fresh = next(kinds for label, _, kinds in answers if label == "nothing" and kinds)
    found = {}
    for label, codes in starts.items():
        told = [(failed, kinds or {}) for name, failed, kinds in answers if name == label]
        faults = [failed for failed, _ in told if failed]
        kinds = [kind for _, kinds in told for kind in kinds.items()]
        faults += [f"{name} is a {kind}" for name, kind in kinds if kind == "module" or kind != fresh[name]]
        faults += [f"{len(codes) - len(told)} codes did not end"] * (len(told) < len(codes))
        found |= {label: faults} if faults else {}
    return found


@pytest.fixture(scope="module")
def found() -> dict[str, list[str]]:
    return misfits({**STARTS, **PLANTED})


def test_names_are_the_same_after_every_import(found: dict[str, list[str]]) -> None:
    """And ``certify`` is a function, pickled by its name; the room of certificates has another name."""
    assert {label: faults for label, faults in found.items() if label not in PLANTED} == {}


def test_a_name_that_is_not_the_same_is_found(found: dict[str, list[str]]) -> None:
    first = {label: faults[0].splitlines()[-1] for label, faults in found.items() if label in PLANTED}
    assert first == {
        "a start that fails": "ModuleNotFoundError: No module named 'hemivar.nowhere'",
        "a module in the place of a function": "AssertionError",
        "another kind": "certify is a type",
        "an interpreter that dies": "1 codes did not end",
    }


@pytest.mark.slow
def test_names_are_the_same_after_the_other_orders() -> None:
    assert misfits(OTHER_ORDERS) == {}


def test_no_module_has_the_name_of_a_public_one() -> None:
    assert not {name.removeprefix("hemivar.") for name in MODULES} & set(hemivar.__all__)
    assert "hemivar.certify" not in MODULES


def said_as_code() -> set[str]:
    """Words that pages, notebooks and examples write as code."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    code = [part for page in pages for part in re.findall(r"```.*?```|`[^`]+`", page.read_text(), re.DOTALL)]
    code += [one.text for one in (*sources(ROOT, "docs", kinds=(".ipynb",)), *sources(ROOT, "examples"))]
    return set(re.findall(r"\w+", "\n".join(code)))


def unmentioned(rooms: Iterable[str], said: set[str]) -> list[str]:
    """Names that rooms list and no page and no example names."""
    lists = {room: getattr(importlib.import_module(f"hemivar.{room}"), "__all__", []) for room in rooms}
    return [f"{room}.{name}" for room, names in lists.items() for name in names if name not in said]


def test_a_public_name_stands_on_a_page_or_in_an_example() -> None:
    """Else it is no name for users: who needs it inside takes it from its module."""
    found = unmentioned((room.name for room in pkgutil.iter_modules(hemivar.__path__)), said_as_code())
    assert len(found) <= 14, found


def test_a_name_on_no_page_is_found() -> None:
    assert unmentioned(("linear", "studio"), {"Hierarchy", "window"}) == ["studio.show"]
