"""Each command loads what it needs: packages that take long to load and that it does not use are left alone."""

from __future__ import annotations

import importlib
import json
import pkgutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.samples import slow

#: What takes long to load, by command: none of these may be loaded.
_TIME = ("hemivar.evolution", "hemivar.branches", "hemivar.identification", "hemivar.gallery", "hemivar.bounds")
_SCIPY = ("scipy.stats", "scipy.optimize", "scipy.ndimage", "scipy.integrate", "scipy.interpolate", "scipy.spatial")
ABSENT = {
    "solve": (
        *_TIME,
        *_SCIPY,
        "hemivar.bounds.exact_distance",
        "hemivar.studio",
        "matplotlib",
        "meshio",
    ),
    "new": (*_TIME, *_SCIPY, "scipy", "numpy", "hemivar.laws", "hemivar.solvers"),
    "laws": (*_TIME, *_SCIPY, "scipy.sparse", "skfem", "hemivar.mesh", "hemivar.solvers", "matplotlib"),
    "--help": (*_TIME, *_SCIPY, "scipy", "numpy", "hemivar.laws"),
}
_CODE = """
import contextlib, io, json, sys
from hemivar.cli import main
sys.argv = ["hemivar", *sys.argv[1:]]
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main()
print(json.dumps(sorted(sys.modules)))
"""


@pytest.mark.parametrize("command", ABSENT)
def test_a_command_leaves_alone_what_it_does_not_use(command: str, tmp_path: Path) -> None:
    problem = tmp_path / "problem.toml"
    if command == "solve":
        subprocess.run([sys.executable, "-m", "hemivar", "new", str(problem)], check=True, capture_output=True)
    words = {"solve": [str(problem)], "new": [str(problem)], "laws": ["softening"], "--help": []}[command]
    done = subprocess.run([sys.executable, "-c", _CODE, command, *words], capture_output=True, text=True, check=True)
    loaded = set(json.loads(done.stdout.splitlines()[-1]))
    assert command == "--help" or any(name.startswith("hemivar.files") or name == "hemivar.laws" for name in loaded)
    assert not loaded.intersection(ABSENT[command])


def test_a_name_loaded_on_first_use_is_not_hidden_by_a_module_of_its_name() -> None:
    code = """
import hemivar.evolution.march, hemivar.workflows.study, hemivar.workflows.sweep
import hemivar
for found in (hemivar.evolution.march, hemivar.workflows.study, hemivar.workflows.sweep, hemivar.march):
    assert callable(found), found
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_what_lists_the_modules_of_the_package_finds_modules_only() -> None:
    """Editors, pydoc and the collection of doctests import each name that they list."""
    kernels = importlib.import_module("hemivar.kernels")
    names = {module.name for module in pkgutil.iter_modules(kernels.__path__)}
    assert names == {path.stem for path in Path(kernels.__path__[0]).glob("*.py")} - {"__init__"}


#: Ctrl-C when a module is looked for; extensions in C make another error of it.
_PRESSED = """
import os, signal, sys, time
handlers = lambda: [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
before = handlers()
import hemivar.cli
assert handlers() == before
module, number, sys.argv[1:] = sys.argv[1], int(sys.argv[2]), sys.argv[3:]

class Pressed:
    def find_spec(self, name, *_):
        if name == module:
            try:
                os.kill(os.getpid(), number)
                time.sleep(5)
            except KeyboardInterrupt:
                raise ImportError("it failed to import") from None

sys.meta_path.insert(0, Pressed())
sys.exit(hemivar.cli.main())
"""


@pytest.mark.parametrize(
    ("module", "number"),
    [("typer", signal.SIGINT), ("skfem", signal.SIGTERM), slow("typer", signal.SIGHUP), slow("skfem", signal.SIGINT)],
)
def test_an_interruption_while_modules_load_is_one_line(module: str, number: signal.Signals, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "hemivar", "new", "a.toml"], cwd=tmp_path, check=True)
    done = subprocess.run(
        [sys.executable, "-c", _PRESSED, module, str(int(number)), "solve", "a.toml"],
        cwd=tmp_path, capture_output=True, text=True,
        preexec_fn=lambda: [signal.signal(one, signal.SIG_DFL) for one in (signal.SIGINT, signal.SIGHUP)],
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "hemivar: interrupted\n")
