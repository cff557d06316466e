"""The studio in a notebook: it constructs, and its messages go there and back."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem
from hemivar.files.sample import template
from hemivar.studio import show
from hemivar.studio.notebook_widget import module_texts
from hemivar.studio.web_server import STATIC


def test_modules_stand_after_those_that_they_import() -> None:
    """The widget makes them modules one after the other, and the page's entry is left out."""
    before: list[str] = []
    for name, text in module_texts().items():
        for found in re.findall(r'(?:from|import)\s*["\']\./([\w./]+)["\']', text):
            folder = name.rpartition("/")[0]
            assert (f"{folder}/{found}" if folder else found) in before, f"{name} imports {found}"
        before.append(name)
    own = {path.name for path in STATIC.glob("*.js")} - {"main.js", "widget.js"}
    assert own == {name for name in before if "/" not in name}


def test_without_anywidget_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ProblemError, match="pip install anywidget tomlkit"):
        show()


class Kernel:
    """The page's side of a widget: what was sent to it, and messages to send."""

    def __init__(self, widget: object, monkeypatch: pytest.MonkeyPatch) -> None:
        self.widget = widget
        self.got: list[tuple[dict[str, object], Sequence[bytes]]] = []
        monkeypatch.setattr(type(widget), "send", lambda _, head, parts=(): self.got.append((head, parts)))

    def ask(self, content: object) -> None:
        self.widget._handle_custom_msg(content, [])  # type: ignore[attr-defined]

    def wait(self, kind: str) -> tuple[dict[str, object], Sequence[bytes]]:
        for _ in range(2000):
            for head, parts in list(self.got):
                if head["type"] == kind:
                    return head, parts
            time.sleep(0.01)
        raise AssertionError(f"no {kind} in {[head['type'] for head, _ in self.got]}")


def test_messages_of_the_widget_go_there_and_back(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget", reason="the widget needs anywidget: pip install anywidget tomlkit")
    problem = parse_problem(template("survey"))
    widget = hv.studio(problem)  # type: ignore[operator]
    kernel = Kernel(widget, monkeypatch)
    kernel.ask({"type": "hello"})
    text = str(kernel.wait("hello")[0]["text"])
    assert parse_problem(text).mesh.number_of_cells == problem.mesh.number_of_cells
    kernel.ask({"type": "solve", "generation": 2, "text": text.replace("0.3", "0.2", 1), "shape": ""})
    head, parts = kernel.wait("picture")
    arrays = {
        entry["name"]: np.frombuffer(part, entry["type"]).reshape(entry["shape"])
        for entry, part in zip(head["arrays"], parts, strict=True)  # type: ignore[call-overload]
    }
    solution = hv.solve(parse_problem(widget.text))
    np.testing.assert_allclose(arrays["pressure"], solution.pressure, atol=1e-6)
    assert "0.2" in widget.text
    assert kernel.wait("certificate")[0]["level"] == "good"
    kernel.ask(["no", "request"])
    assert "not an object" in str(kernel.wait("refused")[0]["message"])
    widget.close()


ENDING = """
import time
import hemivar as hv
from hemivar.files.sample import template
from hemivar.studio import show
widget = show()
widget.send = lambda *message: None
widget._handle_custom_msg({"type": "path", "generation": 1, "text": template("survey")}, [])
time.sleep(0.5)
print("the end")
"""


def test_a_kernel_may_end_while_the_widget_computes() -> None:
    """A thread that went on into the end of the interpreter made it fail there."""
    pytest.importorskip("anywidget", reason="the widget needs anywidget: pip install anywidget tomlkit")
    quiet = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True, env=quiet, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "the end\n", "")


def test_problem_files_and_what_cannot_be_shown(tmp_path: Path) -> None:
    pytest.importorskip("anywidget", reason="the widget needs anywidget: pip install anywidget tomlkit")
    path = tmp_path / "a.toml"
    path.write_text(template("softening"), encoding="utf-8")
    assert show(path).text == template("softening")
    assert "survey" in show().text
    with pytest.raises(ProblemError, match="this is a int"):
        show(3)
