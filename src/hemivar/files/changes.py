"""Values that are put into the tables of a problem file before it is read: ``--set key=value``."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hemivar.basics.arguments import suggest
from hemivar.errors import ProblemError
from hemivar.files.toml import KEYS, KEYS_OF_ONE, kind, printable

__all__ = ["Change", "changed", "read_change"]

#: Tables that a file may leave out, and that are made for a value in them.
_MADE = {*KEYS[""], *KEYS_OF_ONE} - {"title", "kind"} | {"traction", "pressure", "flux", "regions"}


#: A quoted key, or one with a colon, such as the name of a boundary of a part.
_COLON = re.compile(r"""("[^"]*"|'[^']*')|([\w-]*:[\w:-]*)""")


@dataclass(frozen=True)
class Change:
    """A value for a key of a problem file.

    Parameters
    ----------
    key : str
        Keys of the tables on the way, joined by dots, as in ``contact.bottom.normal.q_max``; an entry of a list by its
        number, from 0: ``loads.body.1``.  Keys with other characters than letters, digits and ``_-:`` in quotes.
    value : object
        What a TOML file can hold.

    Raises
    ------
    ProblemError
        The key is none.
    """

    key: str
    value: object

    def __post_init__(self) -> None:
        _ = self.path

    @property
    def path(self) -> tuple[str, ...]:
        """The keys on the way."""
        key = _COLON.sub(lambda match: match[1] or f'"{match[2]}"', self.key)
        try:
            nested: object = tomllib.loads(f"{key} = 0") if "\n" not in key else {}
        except (tomllib.TOMLDecodeError, RecursionError, ValueError):
            nested = {}
        steps: list[str] = []
        while isinstance(nested, dict) and len(nested) == 1:
            (step,) = nested
            steps.append(step)
            nested = nested[step]
        if not steps or nested != 0:
            raise ProblemError(
                f"--set {printable(self.key)}: this is not a key; join the names of tables and key by dots, as in "
                "contact.bottom.normal.q_max=0.5"
            )
        return tuple(steps)

    def __str__(self) -> str:
        text = repr(self.value) if isinstance(self.value, float) else self.value
        return f"{self.key} = {text}" if not isinstance(self.value, str) else f'{self.key} = "{self.value}"'


def read_change(text: str) -> Change:
    """The change that ``key=value`` asks for, the value as TOML has it."""
    key, equals, written = text.partition("=")
    if not equals:
        raise ProblemError(f"--set {printable(text)}: write KEY=VALUE, as in contact.bottom.normal.q_max=0.5")
    try:
        read = tomllib.loads(f"value = {written}")
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        read = {}
    if set(read) != {"value"} or "\n" in written.strip():
        advice = "write texts and formulas in quotes"
        if re.fullmatch(r"\s*[^\s\"'\[\]{}]+\s*", written):
            advice += f""": --set '{printable(key.strip())}="{printable(written.strip())}"'"""
        raise ProblemError(f"--set {printable(text)}: the value is not valid TOML; {advice}")
    return Change(key.strip(), read["value"])


def changed(data: Mapping[str, object], changes: Sequence[Change], name: str) -> dict[str, object]:
    """Tables of a problem file with values replaced, in turn; what is given stays as it is.

    Tables that a file may leave out are made.  What is not known in its table is refused where the file is read.
    """
    made: dict[str, object] = copy.deepcopy(dict(data))
    for change in changes:
        _put(made, change, name)
    return made


def _put(data: dict[str, object], change: Change, name: str) -> None:
    *steps, last = change.path
    target: object = data
    for depth, step in enumerate(steps):
        here = ".".join(steps[:depth])
        if isinstance(target, dict) and step not in target:
            if step not in _MADE or depth > 1:
                raise _error(change, name, f"there is no table '{step}'{_inside(here)}{_known(step, target)}")
            target[step] = {}
        target = target[step] if isinstance(target, dict) else target[_number(target, step, change, name, here)]  # type: ignore[index]
        if not isinstance(target, dict | list):
            shown = ".".join(steps[: depth + 1])
            raise _error(change, name, f"{shown} is {kind(target)}, not a table; set {shown} to a table in braces")
    if isinstance(target, list):
        target[_number(target, last, change, name, ".".join(steps))] = change.value
    elif isinstance(target, dict):
        if not steps and last not in KEYS[""] and last not in KEYS_OF_ONE:
            raise _error(change, name, f"there is no key '{last}'{suggest(last, list(data))}")
        target[last] = change.value


def _number(entries: object, step: str, change: Change, name: str, here: str) -> int:
    """The place in a list that a key names."""
    count = len(entries) if isinstance(entries, list) else 0
    if not re.fullmatch(r"[0-9]{1,6}", step) or int(step) >= count:
        raise _error(change, name, f"{here} is a list of {count}; name an entry by a number from 0 to {count - 1}")
    return int(step)


def _known(step: str, table: Mapping[str, object]) -> str:
    tables = [key for key, value in table.items() if isinstance(value, dict | list)]
    return suggest(step, tables, "there are")


def _inside(here: str) -> str:
    return f" in [{here}]" if here else ""


def _error(change: Change, name: str, what: str) -> ProblemError:
    return ProblemError(f"{name}: --set {printable(change.key)}: {what}")
