"""Pictures in a window, or in the notebook."""

from __future__ import annotations

from hemivar.basics.first_use import IMPORTS
from hemivar.errors import ProblemError
from hemivar.report.notebook import picture_of

__all__ = ["show"]

#: Backends of matplotlib that write files and open no window.
_FILES_ONLY = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")


def show(value: object) -> None:
    """Show the picture of a value, and wait until its window is closed.

    Parameters
    ----------
    value : object
        What has a picture, such as a solution.

    Raises
    ------
    ProblemError
        There is no picture of it, or no window can be opened here.
    """
    figure = picture_of(value)
    with IMPORTS:
        import matplotlib.pyplot as plt
    backend = plt.get_backend().lower()
    if backend in _FILES_ONLY:
        raise ProblemError(
            f"no window can be opened here (matplotlib's backend is '{backend}'); write the picture to a file, "
            ".plot().savefig('figure.png')"
        )
    manager = plt.figure().canvas.manager
    assert manager is not None
    manager.canvas.figure = figure
    figure.set_canvas(manager.canvas)
    plt.show()
