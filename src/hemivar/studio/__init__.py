"""The studio: a page in the browser, or a widget in a notebook, that shows a problem and answers what is changed.

``hemivar studio problem.toml`` serves the page; ``hemivar.studio(problem)`` shows the same in a notebook.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import ModuleType

from hemivar.studio.notebook_widget import show

__all__ = ["show"]


class _Room(ModuleType):
    """This package can be called: ``hemivar.studio(problem)`` is :func:`hemivar.studio.show`."""

    def __call__(self, problem: object = None, *, code: Sequence[str] = ()) -> object:
        """See :func:`hemivar.studio.show`."""
        return show(problem, code=code)


sys.modules[__name__].__class__ = _Room
