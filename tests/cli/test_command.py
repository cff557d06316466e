"""The runner of all commands: what it does in which order, which files it writes, and the exit code."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Annotated, get_type_hints

import pytest

from hemivar.cli import options as opt
from hemivar.cli.app import COMMANDS
from hemivar.cli.command import Command, Done, function_of
from hemivar.cli.options import Exit, option, written
from hemivar.errors import FileError, ProblemError

#: Options that name a folder, or the beginning of several names.
_NO_FILE = {("march", "output"), ("survey", "output")}
ENDS = {
    "reached": (Done(), Exit.CONVERGED),
    "not reached": (Done(reached=False), Exit.NOT_CONVERGED),
    "interrupted": (Done(reached=False, interrupted=True), Exit.INTERRUPTED),
    "code": (Done(last=lambda: Exit.BAD_INPUT), Exit.BAD_INPUT),
}


class _Told(Command):
    """Say a word."""

    word: Annotated[str, option("A word.", of="WORD")] = "yes"
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw it.")] = None

    def check(self) -> None:
        if self.word == "no":
            raise ProblemError("--word no: say yes")

    def work(self) -> Done:
        print(self.word)
        return Done({"--json": {"word": self.word}}, last=lambda: print("last"))


@pytest.mark.parametrize("case", ENDS)
def test_what_a_command_leaves_is_its_exit_code(case: str) -> None:
    done, code = ENDS[case]

    class Ending(Command):
        def work(self) -> Done:
            return done

    assert Ending().run() == code


def test_files_are_written_after_the_work_and_named_before_the_last_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert _Told(json=Path("a.json")).run() == 0
    assert capsys.readouterr().out == "yes\nwritten           a.json\nlast\n"
    assert Path("a.json").read_text() == '{\n "word": "yes"\n}\n'


def test_options_are_refused_before_files_and_files_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ProblemError, match="say yes"):
        _Told("no", json=tmp_path / "a.txt").run()
    with pytest.raises(ProblemError, match=r"must end in \.json"):
        _Told("yes", json=tmp_path / "a.txt").run()
    assert capsys.readouterr().out == ""


def test_a_file_that_fails_goes_before_success_and_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    class Failing(_Told):
        def work(self) -> Done:
            def fail() -> None:
                raise FileError("the disk is full")

            return Done({"--plot": fail, tmp_path / "b.png": fail, "--json": {}})

    assert Failing(json=tmp_path / "a.json", plot=tmp_path / "a.png").run() == Exit.BAD_INPUT
    assert (tmp_path / "a.json").exists()
    assert capsys.readouterr().err.count("--plot: the disk is full") == 2


def test_a_command_as_a_function_has_a_parameter_for_each_field() -> None:
    call = function_of(_Told)
    assert call.__doc__ == "Say a word."
    assert call(word="yes", json=None, plot=None) == 0


@pytest.mark.parametrize("name", COMMANDS)
def test_what_says_that_it_writes_or_draws_is_an_output(name: str) -> None:
    """A figure whose field does not say so would be asked for, and never be drawn."""
    kind = COMMANDS[name]
    hints = get_type_hints(kind, include_extras=True)
    says = {one: str(getattr(hint.__metadata__[-1], "help", "")) for one, hint in hints.items() if one != "names_files"}
    drawn = {one for one, text in says.items() if text.startswith(("Write ", "Draw ")) and (name, one) not in _NO_FILE}
    marked = {one for one, hint in hints.items() if opt.WRITTEN in getattr(hint, "__metadata__", ())}
    assert drawn <= marked
    assert marked <= drawn | {"checkpoint"}


def test_garbage_is_looked_for_from_the_work_on() -> None:
    seen = []

    class Working(Command):
        def work(self) -> Done:
            seen.append(gc.isenabled())
            return Done()

    gc.disable()  # as a process of its own begins
    try:
        Working().run()
    finally:
        gc.enable()
        gc.unfreeze()
    assert seen == [True]
