"""The content of a value: the same in every process, and another one when anything counts that is another."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import types
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.content import content, digest_of
from hemivar.evolution.jumps import SelectionRule
from hemivar.formula import Formula

LEVEL = 1.0
TABLE = np.arange(3.0)


def enclosing(level: float) -> Callable[[Any, float], Any]:
    return lambda x, t: level * t + 0.0 * x


def named(x: Any) -> Any:
    return LEVEL * TABLE.sum() + x


class Slope:
    """A function that is an object."""

    def __init__(self, slope: float) -> None:
        self.slope = slope

    def __call__(self, x: Any) -> Any:
        return self.slope * x

    def twice(self, x: Any) -> Any:
        return 2.0 * self.slope * x


def nudged(array: np.ndarray[Any, Any], place: int) -> np.ndarray[Any, Any]:
    array = array.copy()
    array[place] += 1e-15
    return array


LONG = np.linspace(0.0, 1.0, 5000)
PAIRS: dict[str, tuple[object, object]] = {
    "beyond what is printed": (LONG, nudged(LONG, 2500)),
    "shapes": (np.zeros((2, 3)), np.zeros((3, 2))),
    "kinds of number": (np.zeros(2), np.zeros(2, dtype=np.float32)),
    "last bits": (0.1, 0.1 + 2e-17 + 1e-17),
    "formulas": (Formula("min(t, 1)"), Formula("min(t, 2)")),
    "laws": (hv.Compliance(3.0), hv.Compliance(3.5)),
    "what a function encloses": (enclosing(1.0), enclosing(2.0)),
    "constants of a function": (lambda x: x + 1.0, lambda x: x + 2.0),
    "operations of a function": (lambda x: x + 1.0, lambda x: x - 1.0),
    "names of a function": (lambda x: np.sin(x), lambda x: np.cos(x)),
    "defaults": (lambda x, a=1.0: x, lambda x, a=2.0: x),
    "keywords": (lambda x, *, a=1.0: x, lambda x, *, a=2.0: x),
    "functions within": (lambda x: (lambda y: y + 1.0)(x), lambda x: (lambda y: y + 2.0)(x)),
    "partial": (partial(max, 1.0), partial(max, 2.0)),
    "objects that are functions": (Slope(1.0), Slope(2.0)),
    "methods": (Slope(1.0).twice, Slope(1.0).__call__),
    "owners of methods": (Slope(1.0).twice, Slope(2.0).twice),
    "mappings": ({"a": 1.0, "b": 2.0}, {"a": 2.0, "b": 1.0}),
    "names of mappings": ({"a": 1.0}, {"b": 1.0}),
    "sets": ({1, 2}, {1, 3}),
    "sparse matrices": (sp.csr_array(np.eye(2)), sp.csr_array(np.eye(2)[::-1])),
    "numbers and texts": (1, "1"),
    "whole numbers and floats": (1, 1.0),
    "nesting": (((1,), 2), ((1, 2),)),
    "true and one": (True, 1),
    "options": (hv.evolution.SDIRK2(), hv.evolution.ImplicitEuler()),
    "members": (SelectionRule.LOCAL, SelectionRule.STOP),
    "builtin functions": (abs, max),
    "functions of numpy": (np.sin, np.cos),
    "arrays of objects": (np.array([None, "a"], dtype=object), np.array([None, "b"], dtype=object)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_what_is_another_thing_has_another_content(name: str) -> None:
    one, other = PAIRS[name]
    assert digest_of(one) != digest_of(other)
    assert digest_of(one) == digest_of(one)


def test_what_a_function_names_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    before = digest_of(named)
    monkeypatch.setattr(sys.modules[__name__], "LEVEL", 2.0)
    assert digest_of(named) != before
    monkeypatch.undo()
    assert digest_of(named) == before
    monkeypatch.setattr(sys.modules[__name__], "TABLE", np.array([0.0, 1.0, 3.0]))
    assert digest_of(named) != before


def test_what_a_function_calls_in_a_module_of_the_user_counts() -> None:
    """Also through a function of that module, and not what else it holds."""

    def under(text: str) -> str:
        module = types.ModuleType("usermod")
        exec(text, module.__dict__)
        made: dict[str, object] = {"usermod": module}
        exec("load = lambda x, t: usermod.load(x, t)", made)
        return digest_of(made["load"])

    plain = "SCALE = 2.0\ndef help(t): return SCALE * t\ndef load(x, t): return help(t)\n"
    assert under(plain) == under(plain)
    assert under(plain) == under(plain + "def another(): return 3\n")
    assert under(plain) != under(plain.replace("help(t)\n", "help(t) + 1.0\n"))
    assert under(plain) != under(plain.replace("SCALE * t", "SCALE + t"))
    assert under(plain) != under(plain.replace("2.0", "3.0"))


def test_packages_that_are_installed_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    made: dict[str, object] = {"np": np}
    exec("load = lambda x, t: np.full(len(x), t)", made)
    before = digest_of(made["load"])
    monkeypatch.setattr(np, "full", np.zeros)
    assert digest_of(made["load"]) == before


def test_where_something_stands_does_not_count() -> None:
    assert digest_of(Formula("t", where="a.toml: load")) == digest_of(Formula("t", where="b.toml: load"))
    assert digest_of(Formula("t", minimum=0.0)) != digest_of(Formula("t"))


def test_a_value_that_holds_itself_comes_to_an_end() -> None:
    around: list[object] = [1.0]
    around.append(around)
    assert digest_of(around) != digest_of([1.0])


CODE = """
import hashlib, numpy as np
from hemivar.basics.content import content, digest_of
import hemivar as hv
pad = [object() for _ in range({pad})]
value = {{"f": (lambda a: lambda x, t: a * t + np.sin(x))(2.5), "law": hv.Compliance(lambda x: 1.0 + x[:, 0])}}
found = hashlib.sha256()
for part in content(value):
    found.update(part)
print(found.hexdigest())
"""


def test_addresses_do_not_count() -> None:
    told = {
        subprocess.run([sys.executable, "-c", CODE.format(pad=pad)], capture_output=True, text=True, check=True).stdout
        for pad in (0, 12345)
    }
    assert len(told) == 1


def test_the_digest_of_values_is_that_of_their_contents_one_after_the_other() -> None:
    values = ("one", TABLE, None)
    whole = b"".join(piece for value in values for piece in content(value))
    assert digest_of(*values) == hashlib.sha256(whole).hexdigest()
