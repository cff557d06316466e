"""A plugin, ``pytest -p tests.method_alone``: tests of the method where no package that uses it can be imported.

The gallery is data of tests, and stays.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from importlib.abc import MetaPathFinder

__all__ = ["USES", "Missing"]

#: The packages that use the method.
USES = ("bounds", "branches", "cli", "files", "gallery", "identification", "ranks", "report", "studio", "survey",
        "workflows")  # fmt: skip


class Missing(MetaPathFinder):
    """Packages of hemivar that are not installed."""

    def __init__(self, packages: Collection[str]) -> None:
        self._names = {f"hemivar.{package}" for package in packages}

    def find_spec(self, name: str, *_: object) -> None:
        if name in self._names:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


def pytest_configure() -> None:
    """Before any test is collected."""
    sys.meta_path.insert(0, Missing({*USES} - {"gallery"}))
