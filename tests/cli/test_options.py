"""One name of an option means one thing, in every command that has it."""

from __future__ import annotations

from collections import defaultdict

import pytest
from typer.main import get_command

from hemivar.cli.app import app

#: Options that draw, write or set what each command is about: the words with which their help begins.
_OF_THE_COMMAND = {
    "--plot": "Draw ", "--output": "Write ", "--set": "Set ", "--load-factor": "Factor of ", "--columns": "Columns",
    "--csv": "Write the ",
}  # fmt: skip
#: Options whose values differ in form: a sweep sets ranges, and names of folders and of films are paths.
_OTHER_VALUES = {"--set", "--output", "--load-factor"}
#: Options that take one number for one load, and a range of it for a path.
_ONE_OR_RANGE = {"--load-factor"}
#: Names that stood for the same things as another one once, and mean nothing now.
_GONE = ("--out", "--restart", "--keep", "--certify", "--unit", "--tolerance", "--film")


def _options() -> dict[str, dict[str, object]]:
    """Every option by its name, then by command."""
    found: dict[str, dict[str, object]] = defaultdict(dict)
    root = get_command(app)
    for command, one in root.commands.items():  # type: ignore[attr-defined]
        for option in one.params:
            if option.param_type_name == "option":
                found[option.opts[0]][command] = option
    return found


OPTIONS = _options()


def _form(option: object) -> tuple[object, ...]:
    """What an option takes, and its spellings."""
    names = ("is_flag", "multiple", "nargs", "opts", "secondary_opts")
    return str(option.type_descriptor.annotation), *(str(getattr(option, name)) for name in names)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted(OPTIONS))
def test_an_option_has_one_meaning_and_one_type(name: str) -> None:
    options = list(OPTIONS[name].values())
    helps = {option.help for option in options}  # type: ignore[attr-defined]
    assert all(helps)
    if name in _OF_THE_COMMAND:
        assert all(text.startswith(_OF_THE_COMMAND[name]) for text in helps)
    else:
        assert len(helps) == 1, helps
    forms = {_form(one) for one in options}
    assert len(forms) == 1 or name in _ONE_OR_RANGE, forms
    if name not in _OTHER_VALUES:
        assert len({one.metavar for one in options}) == 1  # type: ignore[attr-defined]


def test_one_help_is_the_help_of_one_option() -> None:
    names: dict[str, set[str]] = defaultdict(set)
    for name, commands in OPTIONS.items():
        for option in commands.values():
            names[option.help].add(name)  # type: ignore[attr-defined]
    assert {text: found for text, found in names.items() if len(found) > 1} == {}


def test_names_of_options_that_meant_the_same_are_gone() -> None:
    assert set(_GONE).isdisjoint(OPTIONS)
    for command in ("solve", "march"):
        assert command in OPTIONS["--checkpoint"]
        assert command in OPTIONS["--resume"]
        assert command in OPTIONS["--adaptive"]
    assert set(OPTIONS["--exact"]) == {"solve", "certify", "study"}
    assert set(OPTIONS["--output"]) == {"march", "animate", "survey"}


def test_no_help_has_brackets() -> None:
    """The terminal takes [words] in brackets for markup, and leaves them out."""
    for command, one in get_command(app).commands.items():  # type: ignore[attr-defined]
        assert "[" not in str(one.help), command
        for option in one.params:
            assert "[" not in str(getattr(option, "help", "")), (command, option.name)
