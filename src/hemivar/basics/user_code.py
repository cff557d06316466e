"""Classes of the user's that a file names: of a module or a file that the user allows, or of an installed package.

Nothing is imported that was not allowed, and of what is imported nothing is called: only a class is looked up.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
import sys
import traceback
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

from hemivar.basics.arguments import described, expect, shortened
from hemivar.basics.first_use import IMPORTS
from hemivar.errors import ProblemError

__all__ = [
    "GROUP", "checked_code", "class_named", "installed", "load_file", "loaded_code", "loaded_files", "name_of_class",
    "of_user", "stands_at",
]  # fmt: skip

#: The entry points by which installed packages give names to their classes.
GROUP = "hemivar.laws"
_MODULE = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*")
_CLASS = re.compile(rf"({_MODULE.pattern}):([^\W\d]\w*)")
#: Files that were loaded, by the names of their modules: what other processes load as well.
_FILES: dict[str, Path] = {}
#: Modules of which classes were named.
_NAMED: set[str] = set()


def of_user(kind: type) -> bool:
    """Whether a class is none of this library."""
    return kind.__module__.partition(".")[0] != "hemivar"


def class_named(name: str, code: Sequence[str]) -> type | None:
    """The class of a name: ``module:Class`` of a module among the code, or a name that an installed package gives.

    None where the name has no colon, and no package gives it.
    """
    if ":" not in name:
        given = _installed().get(name, {})
        if len(set(given.values())) > 1:
            packages = " and ".join(f"'{package}'" for package in sorted(given))
            raise ProblemError(f"'{name}' is a name that the packages {packages} give; remove one of them")
        return _class_of(next(iter(given.values())), "") if given else None
    if not _CLASS.fullmatch(name):
        raise ProblemError(f"'{name}' names no class; write module:Class, the module as Python imports it")
    module = name.partition(":")[0]
    allowed = checked_code(code)
    if module not in allowed:
        file = "" if "." in module else f" or --allow-code ./{module}.py"
        raise ProblemError(
            f"'{name}' is code of your own, which runs when it is read; if you trust it, add --allow-code {module}"
            f"{file}, in Python code=['{module}']"
        )
    return _class_of(name, allowed[module])


def checked_code(code: Sequence[str]) -> dict[str, str]:
    """What the user allows, by names of modules: each with its file, empty for what Python finds itself."""
    if isinstance(code, str | bytes) or not isinstance(code, Sequence):
        raise ProblemError(f"code is {described(code)}; give a list of modules and files, such as ['mymodule']")
    for one in code:
        expect(one, str | os.PathLike, "an entry of code", "give the name of a module or a file, such as 'mymodule'")
    allowed: dict[str, str] = {}
    for one in map(os.fspath, code):
        file = one if one.endswith(".py") or os.path.basename(one) != one else ""
        module = Path(one).stem if file else one
        if not _MODULE.fullmatch(module) or (file and (not one.endswith(".py") or "." in module)):
            raise ProblemError(
                f"allowed code '{one}' is neither a module nor a Python file; give a name such as mymodule, or a file "
                "such as ./mymodule.py"
            )
        if allowed.setdefault(module, file) != file:
            raise ProblemError(f"allowed code: '{allowed[module] or module}' and '{one}' have one name; rename one")
    return allowed


def name_of_class(kind: type) -> str | None:
    """The name by which files know a class that is none of this library; None if it cannot be imported by any."""
    name = f"{kind.__module__}:{kind.__qualname__}"
    module = sys.modules.get(kind.__module__)
    if kind.__module__ == "__main__" or not _CLASS.fullmatch(name) or module is None:
        return None
    if vars(module).get(kind.__qualname__) is not kind:
        return None
    return next((short for short, given in _installed().items() if set(given.values()) == {name}), name)


@cache
def _installed() -> dict[str, dict[str, str]]:
    """The classes that packages name, by the name and the package; looked for when a name is not the library's."""
    from importlib.metadata import entry_points

    classes: dict[str, dict[str, str]] = {}
    for entry in entry_points(group=GROUP):
        package = entry.dist.name if entry.dist is not None else "?"
        classes.setdefault(entry.name, {})[package] = entry.value.partition("[")[0].strip()
    return classes


def installed() -> dict[str, str]:
    """The names that packages give to their classes, with the packages."""
    return {name: " and ".join(sorted(given)) for name, given in sorted(_installed().items())}


def _class_of(name: str, file: str) -> type:
    """The class of a module that may be imported."""
    if not _CLASS.fullmatch(name):
        raise ProblemError(f"'{name}' names no class; its package must write module:Class")
    module, _, attribute = name.partition(":")
    _NAMED.add(module)
    named = vars(_module(module, file)).get(attribute)
    if not issubclass(type(named), type):
        raise ProblemError(f"'{name}' is not a class of the module '{module}'; name a class")
    assert isinstance(named, type)
    if not of_user(named):
        raise ProblemError(f"'{name}' is the library's own; give its own name, as 'hemivar laws' lists it")
    if named.__module__ != module:
        raise ProblemError(f"'{name}' is only imported there; name it as {named.__module__}:{named.__qualname__}")
    return named


def _module(name: str, file: str) -> ModuleType:
    try:
        with IMPORTS:
            return load_file(Path(file)) if file else importlib.import_module(name)
    except ProblemError:
        raise
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
            raise ProblemError(
                f"there is no module '{error.name}'; install it, or allow its file, as in --allow-code ./{name}.py"
            ) from error
        why = f"{type(error).__name__}: {shortened(error)}"
        raise ProblemError(f"the module '{name}' cannot be imported ({why}); correct it") from error


def load_file(path: Path) -> ModuleType:
    """The module of a file, under the name of the file; one that is loaded already is kept."""
    if not path.is_file():
        raise ProblemError(f"allowed code '{path}': there is no such file; correct its name")
    name = path.stem
    loaded = sys.modules.get(name)
    spec = importlib.util.find_spec(name) if loaded is None else None
    known = getattr(loaded, "__file__", None) if loaded is not None else spec.origin if spec is not None else str(path)
    if known is None or not os.path.exists(known) or not os.path.samefile(known, path):
        raise ProblemError(f"'{path}' has the name of another module, '{name}'; rename the file")
    if loaded is not None:
        return loaded
    made = importlib.util.spec_from_file_location(name, path)
    assert made is not None
    assert made.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(made)
    try:
        made.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    _FILES[name] = path.resolve()
    return module


def loaded_code() -> tuple[str, ...]:
    """All modules that are loaded: to name their classes runs nothing."""
    return tuple(name for name in sys.modules if _MODULE.fullmatch(name) and not name.endswith(".py"))


def stands_at(error: BaseException) -> str:
    """The last line of the user's modules that an error came through, with its file; empty if it came through none."""
    lines = [
        f"{frame.f_code.co_filename}, line {number}"
        for frame, number in traceback.walk_tb(error.__traceback__)
        if frame.f_globals.get("__name__") in _NAMED
    ]
    return lines[-1] if lines else ""


def loaded_files() -> tuple[Path, ...]:
    """The files that were loaded here."""
    return tuple(_FILES.values())
