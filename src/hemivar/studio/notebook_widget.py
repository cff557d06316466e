"""The studio in a notebook: the same page as a widget."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hemivar.basics import disk
from hemivar.errors import ProblemError
from hemivar.files.problem_file import ProblemFile, problem_text, read_text
from hemivar.files.sample import template
from hemivar.mechanics.statement import ContactProblem
from hemivar.studio.binary_message import Message
from hemivar.studio.jobs import Bench
from hemivar.studio.page_worker import Desk
from hemivar.studio.requests import request_of
from hemivar.studio.web_server import STATIC, hello

if TYPE_CHECKING:
    import anywidget

__all__ = ["module_texts", "show", "widget_of"]

#: The modules of the page, each after those that it imports.
_MODULES = (
    "vendor/three.core.min.js", "vendor/three.module.min.js", "dom.js", "colours.js", "plot.js", "edges.js", "body.js",
    "law.js", "charts.js", "sliders.js", "text.js", "export.js", "tabs.js", "certificate.js",
    "address.js", "deformation.js", "studio.js",
)  # fmt: skip


def show(problem: object = None, *, code: Sequence[str] = ()) -> anywidget.AnyWidget:
    """The studio of a problem, as a widget of a notebook.

    Parameters
    ----------
    problem : ContactProblem, ScalarProblem, ProblemFile, str or Path, optional
        A problem that a problem file can state, or the path of one; an example by default.
    code : sequence of str
        Modules and files whose laws the file may name, as for :func:`hemivar.read_problem`.

    Returns
    -------
    AnyWidget
        ``widget.text`` is the problem file as it stands now.

    Raises
    ------
    ProblemError
        anywidget is not installed, or a problem file cannot state the problem.
    """
    absent = [name for name in ("anywidget", "tomlkit") if importlib.util.find_spec(name) is None]
    if absent:
        needed = " and ".join(absent)
        raise ProblemError(f"the studio of a notebook needs {needed}; run pip install {' '.join(absent)}")
    if problem is None:
        return widget_of(template("survey"), Path(), "survey.toml", code)
    if isinstance(problem, str | Path):
        path = disk.path_of(problem)
        return widget_of(read_text(path), path.parent, path.name, code)
    return widget_of(_stated(problem), Path(), "problem.toml", code)


def _stated(problem: object) -> str:
    """The problem file that states a problem."""
    if not isinstance(problem, ContactProblem | ProblemFile):
        kind = type(problem).__name__
        raise ProblemError(f"the studio shows a ContactProblem, a ScalarProblem or a problem file; this is a {kind}")
    return problem_text(problem)


def module_texts() -> dict[str, str]:
    """The modules of the page by their names, each after those that it imports."""
    return {name: disk.read_text(STATIC / name, "module") for name in _MODULES}


def widget_of(text: str, folder: Path, name: str, code: Sequence[str] = ()) -> anywidget.AnyWidget:
    """The widget of a problem file."""
    import anywidget
    import traitlets

    class Studio(anywidget.AnyWidget):  # type: ignore[misc]
        """The studio; its page asks by messages, as over a socket."""

        _esm = disk.read_text(STATIC / "widget.js", "module")
        _css = disk.read_text(STATIC / "studio.css", "style")
        modules = traitlets.Dict(module_texts()).tag(sync=True)
        text = traitlets.Unicode()

        def close(self) -> None:
            """End the work and the widget."""
            desk.close()
            super().close()

    widget = Studio(text=text)

    def send(message: Message) -> None:
        head, parts = message.buffers()
        widget.send(head, parts)

    desk = Desk(Bench(folder, given=text, code=code), send)

    def received(_: object, content: object, buffers: Sequence[object]) -> None:
        if isinstance(content, dict) and content.get("type") == "hello":
            send(hello(text, name))
            return
        try:
            request = request_of(content)
        except ProblemError as error:
            send(Message({"type": "refused", "generation": 0, "message": f"the page sent {error}"}))
            return
        if request.text:
            widget.text = request.text
        desk.put(request)

    widget.on_msg(received)
    return widget
