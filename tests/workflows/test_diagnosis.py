"""``hemivar doctor`` finds what is broken, and says what is missing for what."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest

from hemivar.cli import main
from hemivar.workflows import Diagnosis, Phase, diagnose, diagnosis, result_of


@pytest.fixture
def one_part(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A place for the module ``shaky``, the only optional package."""
    parts = ("shaky", "shaky", "shaking", "pip install shaky")
    pair = (("petsc4py", "no_such_petsc", "", ""), ("mpi4py", "no_such_mpi", "", ""))
    monkeypatch.setattr(diagnosis, "_OPTIONAL", (parts, *pair))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    true = importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "1.5" if name == "shaky" else true(name))
    return tmp_path


def found(limit: float = 20.0) -> Diagnosis:
    return result_of(diagnose(limit=limit))


def test_what_is_there_works() -> None:
    said: list[str] = []
    result = result_of(diagnose(), lambda event: said.append(event.name))
    assert result.sound
    assert result.failed is None
    assert result.seconds is not None
    assert result.seconds < 20.0
    assert {part.name: part.version for part in result.required}["numpy"] == importlib.metadata.version("numpy")
    assert said[-1] == "solving a small problem"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", None),
        ("raise OSError('libGLU.so.1: cannot open shared object file')", "libGLU"),
        ("import os; os._exit(3)", "code 3"),
        ("import time; time.sleep(60)", "more than 1 s"),
    ],
)
def test_an_optional_package_that_cannot_be_imported(one_part: Path, text: str, why: str | None) -> None:
    (one_part / "shaky.py").write_text(text, encoding="utf-8")
    result = found(limit=1.0 if "sleep" in text else 20.0)
    part = result.optional[0]
    assert part.version == "1.5"
    assert part.works == (why is None)
    assert result.sound
    if why is not None:
        assert why in (part.broken or "")
        assert any("shaky" in remark for remark in result.remarks)


def test_a_package_that_is_not_there(one_part: Path) -> None:
    part = found().optional[0]
    assert (part.version, part.works, part.remedy) == (None, False, "pip install shaky")


def test_a_solver_that_gives_nonsense_is_told(
    one_part: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*arguments: object) -> object:
        raise RuntimeError("a library of the wrong kind")

    monkeypatch.setattr("hemivar.solvers.solve", broken)
    result = found()
    assert not result.sound
    assert "wrong kind" in (result.failed or "")
    assert main(["doctor"]) == 1
    assert "to do" in capsys.readouterr().out


def test_too_many_threads_are_told(one_part: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis, "_threads", lambda: (("openblas 0.3", 4096),))
    assert any("4096 threads" in remark for remark in found().remarks)


def test_stages_are_counted(one_part: Path) -> None:
    (one_part / "shaky.py").write_text("", encoding="utf-8")
    events: list[Phase] = []
    result_of(diagnose(), events.append)
    assert [event.name for event in events] == ["importing shaky", "solving a small problem"]
    assert all(0 <= event.number < event.count for event in events)
