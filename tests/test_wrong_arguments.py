"""Public names and those of pages, called with wrong values: each call returns, or raises an error in words."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import signal
import types
import warnings
from collections.abc import Callable, Iterable, Iterator
from enum import EnumMeta
from functools import cache
from itertools import islice
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from matplotlib.figure import Figure
from skfem.helpers import ddot, sym_grad

import hemivar as hv
from hemivar.basics.conformance import ConformanceError
from tests.samples import slow
from tests.sources import ROOT

MESH = hv.rectangle((1.0, 1.0), 1)
PROBLEM = hv.ContactProblem(
    mesh=MESH,
    material=hv.Material.lame(4.0, 4.0),
    supports={"left": hv.Clamped()},
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3), hv.Tresca(0.5))},
)
DISCRETE = hv.discretize(PROBLEM)
SOLUTION = hv.solve(DISCRETE)
EVOLUTION = hv.Evolution(PROBLEM)
HISTORY = hv.march(EVOLUTION, until=0.2, step=0.1)
#: What is given in turn for every argument: wrong kinds, numbers, texts, arrays, and objects of the house.
WRONG: tuple[object, ...] = (
    None, b"", b"\xff\0", "", "abc", "x" * 3000, "two\nlines", True, float("nan"), float("inf"), -1.0, 1e308, 10**400,
    0, 1j, [], (), {}, [1, 2], [[1], [1, 2]], [True, 0.5], {1: 2}, {"left": 3}, object(), int, len, lambda x: x,
    np.zeros((2, 2, 2)), np.zeros(0), np.full((3, 2), np.nan), np.arange(2000.0), np.array(["a"]), np.ones(2, complex),
    np.array([None, {}], dtype=object), np.ma.masked_array([1.0, 2.0], mask=[False, True]), sp.csr_array(np.eye(2)),
    np.datetime64("2020-01-01"), MESH, PROBLEM.material, PROBLEM, DISCRETE, SOLUTION, hv.Signorini(), hv.Tresca(0.1),
    PROBLEM.contact["bottom"], hv.Clamped(), hv.Controls(), EVOLUTION, HISTORY,
)  # fmt: skip
SQUARE = skfem.MeshTri().refined(1).with_boundaries({"left": lambda x: x[0] < 0.01, "bottom": lambda x: x[1] < 0.01})
BASIS = skfem.Basis(SQUARE, skfem.ElementVector(skfem.ElementTriP1()))
FORM = skfem.BilinearForm(lambda u, v, w: ddot(sym_grad(u), sym_grad(v)))
BODY = hv.fem.FormBody(BASIS, FORM, supports={"left": 0.0})
#: What stands for the other arguments that must be given.
RIGHT: dict[str, object] = {
    "mesh": MESH, "material": PROBLEM.material, "problem": PROBLEM, "points": MESH.points, "cells": MESH.cells,
    "law": hv.laws.ThresholdCompliance(0.3), "normal": hv.laws.ThresholdCompliance(0.3), "friction": hv.Tresca(0.5),
    "size": (1.0, 1.0), "contact": PROBLEM.contact, "supports": PROBLEM.supports, "until": 0.1, "step": 0.1,
    "solution": SOLUTION, "evolution": EVOLUTION, "history": HISTORY, "path": "out.toml", "parts": {"a": MESH},
    "basis": BASIS, "form": FORM, "body": BODY,
}  # fmt: skip
#: Rooms below, of which all of these names are called as well.
ROOMS = (hv.laws, hv.mechanics, hv.solvers, hv.evolution, hv.bounds, hv.survey)
BELOW = (
    "AugmentedLagrangian", "Bilateral", "Bonding", "Branch", "Capped", "Checkpoint", "CoulombBound", "Cylinder",
    "FixedPoint", "FixedStep", "Friction", "FunctionLaw", "GeneralizedAlpha", "LBFGS", "Layered", "LoadStepping",
    "Logarithmic", "Memory", "MoreauJean", "Newmark", "NonsmoothMultigrid", "NonsmoothNewton", "PenetrationBound",
    "PiecewiseQuadratic", "Powell", "PrimalDualActiveSet", "ProximalBundle", "RateAndState", "Save", "SawTooth",
    "SemismoothNewton", "SlipTable", "Sphere", "StaticKinetic", "ThresholdCompliance", "ViscousFoundation", "Wear",
    "When", "affine", "bonded", "envelope", "known_goals", "plus", "read_law_table", "secant", "solve_nested",
)  # fmt: skip
#: A server, and objects that others make: a solution whose parts are wrong does not say so before it is asked.
LEFT_OUT = {"hemivar.studio", "hemivar.Solution", "Mesh.trusted"}
#: Methods of materials are called for each cell, and take what the library gives them.
OBJECTS = (MESH, PROBLEM, DISCRETE, SOLUTION, HISTORY, EVOLUTION, hv.certify(SOLUTION), BODY)
#: Seconds that a call may take: what is accepted is computed, and jobs start processes.
LONGEST = 20
#: Values of a quick test, for each argument.
FEW = 3
#: Calls that solve or draw where the value is accepted: slow tests.
HEAVY = re.compile(
    r"plot|animate|hencky|solve|march|study|sweep|find_|follow|identify|workflows|bracket|levels|save|survey"
)


def shown_on_pages() -> Iterator[str]:
    """Names of the library in the code of pages, with where they come from."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
            nodes = list(ast.walk(ast.parse(block)))
            known = {"hv": "hemivar"}
            for node in nodes:
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hemivar"):
                    known |= {one.asname or one.name: f"{node.module}.{one.name}" for one in node.names}
            yield from (name for name in known.values() if name != "hemivar")
            for node in nodes:
                parts: list[str] = []
                inner: ast.expr = node if isinstance(node, ast.Attribute) else ast.Constant(0)
                while isinstance(inner, ast.Attribute):
                    parts, inner = [inner.attr, *parts], inner.value
                if parts and isinstance(inner, ast.Name) and inner.id in known:
                    yield ".".join([known[inner.id], *parts])


def found_by(name: str) -> object:
    """The object of a dotted name; None where it names none, such as an attribute of an instance."""
    found: object = hv
    for number, part in enumerate(name.split(".")[1:], start=2):
        try:
            found = getattr(found, part)
        except AttributeError:
            try:
                found = importlib.import_module(".".join(name.split(".")[:number]))
            except ImportError:
                return None
    return found


@cache
def called() -> dict[str, Callable[..., object]]:
    """All that is called, by its name."""
    names = {f"hemivar.{name}" for name in hv.__all__} | set(shown_on_pages())
    found = {name: found_by(name) for name in sorted(names)}
    found |= {name: next(getattr(room, name) for room in ROOMS if name in room.__all__) for name in BELOW}
    for one in OBJECTS:
        kind = type(one)
        for name in (name for name in dir(kind) if not name.startswith("_")):
            method = getattr(kind, name)
            if inspect.isfunction(method):
                found[f"{kind.__name__}().{name}"] = getattr(one, name)
            elif inspect.ismethod(method):
                found[f"{kind.__name__}.{name}"] = method
    return {
        name: one for name, one in found.items()
        if callable(one) and name not in LEFT_OUT and not isinstance(one, EnumMeta | types.ModuleType)
        and not (isinstance(one, type) and issubclass(one, Exception))
    }  # fmt: skip


def arguments(function: Callable[..., object]) -> list[inspect.Parameter]:
    every = inspect.signature(function).parameters.values()
    return [one for one in every if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD, one.POSITIONAL_ONLY)]


def calls(name: str, few: bool) -> Iterator[dict[str, object]]:
    """Arguments of which one is wrong; a few values for each, others for every one."""
    parameters = arguments(called()[name])
    needed = {one.name: RIGHT.get(one.name, 0.3) for one in parameters if one.default is one.empty}
    for number, one in enumerate(one for one in parameters if one.name != "jobs"):
        values: Iterable[object] = WRONG
        if few:
            start = (len(name) * 7 + number * FEW) % len(WRONG)
            values = islice((*WRONG, *WRONG), start, start + FEW * 7, 7)
        for value in values:
            yield {**needed, one.name: value}


def trouble(function: Callable[..., object], given: dict[str, object]) -> str:
    """How a call failed, if not in words that stand in one line."""
    try:
        made = function(**given)
        if inspect.isgenerator(made):
            for _ in made:
                pass
        if isinstance(made, hv.laws.Superpotential | hv.laws.Friction):
            # which look at their parameters where they are evaluated
            at = made.at(MESH.points)
            _ = at.knots if isinstance(at, hv.laws.Superpotential) else at.bound
        if isinstance(made, hv.fem.FormProblem):
            _ = made.discrete
        if isinstance(made, Figure):
            plt.close(made)
        repr(made)
    except ConformanceError:  # a report of several lines
        return ""
    except hv.HemivarError as error:
        words = str(error)
        return "" if len(words) > 15 and "\n" not in words else f"says {words!r:.200}"
    except TimeoutError:
        return ""
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:80]}"
    return ""


def stop(*_: object) -> None:
    raise TimeoutError


@pytest.mark.parametrize(
    ("name", "few"),
    [(name, True) for name in called() if not HEAVY.search(name)] + [slow(name, False) for name in called()],
)
def test_wrong_arguments_are_refused_in_words(
    name: str, few: bool, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path_factory.getbasetemp())
    before = signal.signal(signal.SIGALRM, stop)
    raw = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for given in calls(name, few):
            signal.alarm(LONGEST)
            if told := trouble(called()[name], given):
                raw.append(f"{given!r:.200}: {told}")
            signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
    assert not raw, "\n".join(raw)


def test_names_of_pages_are_called() -> None:
    assert {"hemivar.report.plot_law", "hemivar.fem.FormBody", "hemivar.DiscreteProblem.of_forms"} < set(called())
    assert len(called()) > 200


@pytest.mark.parametrize("value", [True, np.True_, [True, 0.5], np.array([True])])
def test_truth_values_are_no_numbers(value: Any) -> None:
    for call in (
        lambda: hv.laws.ThresholdCompliance(value).knots,
        lambda: hv.Compliance(value).knots,
        lambda: hv.Tresca(value).at(MESH.points[:2]),
        lambda: hv.Material.young(value, 0.3),
        lambda: hv.laws.affine(hv.laws.ThresholdCompliance(0.3), value),
    ):
        with pytest.raises(hv.errors.ProblemError, match="truth value"):
            call()
