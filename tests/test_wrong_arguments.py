"""The public names called with arguments of wrong kinds: each call returns, or raises an error in words."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import hemivar as hv

#: What is given in turn for every argument.
WRONG: tuple[object, ...] = (
    None, b"", b"\xff\0", "abc", "x" * 10_000, True, float("nan"), -1.0, [1, 2], [[1], [1, 2]], [True, 0.5], {1: 2},
    object(), 1j, np.zeros((2, 2, 2)), np.array(["a"]), 10**400,
)  # fmt: skip

MESH = hv.rectangle((1.0, 1.0), 1)
PROBLEM = hv.ContactProblem(
    mesh=MESH,
    material=hv.Material.lame(4.0, 4.0),
    supports={"left": hv.Clamped()},
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3), hv.Tresca(0.5))},
)
#: What stands for the other arguments that must be given.
RIGHT: dict[str, object] = {
    "mesh": MESH, "material": PROBLEM.material, "problem": PROBLEM, "points": MESH.points, "cells": MESH.cells,
    "law": hv.laws.ThresholdCompliance(0.3), "normal": hv.laws.ThresholdCompliance(0.3), "friction": hv.Tresca(0.5),
    "size": (1.0, 1.0),
}  # fmt: skip
ROOMS = (hv, hv.laws, hv.mechanics, hv.solvers, hv.evolution, hv.adapt)
CALLED: dict[str, Callable[..., object]] = {
    name: next(getattr(room, name) for room in ROOMS if name in room.__all__)
    for name in (
        "Adhesive", "AugmentedLagrangian", "Bilateral", "Bonding", "Branch", "Capped", "Checkpoint", "Compliance",
        "Contact", "ContactProblem", "Controls", "CoulombBound", "Cylinder", "Evolution", "FixedPoint", "FixedStep",
        "FormulaLaw", "Friction", "FunctionLaw", "GeneralizedAlpha", "LBFGS", "Layered", "LoadStepping", "Logarithmic",
        "Memory", "Mesh", "MoreauJean", "Newmark", "NonsmoothMultigrid", "NonsmoothNewton", "PenetrationBound",
        "PiecewiseQuadratic", "Plane", "Powell", "Prescribed", "PrimalDualActiveSet", "ProximalBundle", "RateAndState",
        "Roller", "Save", "SawTooth", "ScalarContact", "ScalarProblem", "SemismoothNewton", "Signorini", "SlipTable",
        "SlipWeakening", "Softening", "Sphere", "StaticKinetic", "ThresholdCompliance", "Tresca", "ViscousFoundation",
        "Wear", "When", "affine", "bonded", "box", "discretize", "envelope", "find_solutions", "known_goals", "plus",
        "read_law_table", "read_mesh", "read_problem", "rectangle", "secant", "solve_nested", "table_law",
        "write_problem",
    )
} | {
    "Material.lame": hv.Material.lame, "Material.young": hv.Material.young, "Mesh.oriented": hv.Mesh.oriented,
    "mesh.scaled": MESH.scaled, "mesh.rotated": MESH.rotated, "mesh.with_boundaries": MESH.with_boundaries,
    "problem.at_time": PROBLEM.at_time,
}  # fmt: skip


def calls(function: Callable[..., object]) -> Iterator[dict[str, object]]:
    """Arguments of which one is wrong."""
    parameters = [
        one for one in inspect.signature(function).parameters.values()
        if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD, one.POSITIONAL_ONLY)
    ]  # fmt: skip
    needed = {one.name: RIGHT.get(one.name, 0.3) for one in parameters if one.default is one.empty}
    for one in (one for one in parameters if one.name not in ("name", "where", "normals", "check_coercivity")):
        for value in WRONG:
            yield {**needed, one.name: value}


def trouble(function: Callable[..., object], given: dict[str, object]) -> str:
    """How a call failed, if not in words."""
    try:
        made = function(**given)
        if isinstance(
            made, hv.laws.Superpotential | hv.laws.Friction
        ):  # which look at their parameters where they are evaluated
            at = made.at(MESH.points)
            _ = at.knots if isinstance(at, hv.laws.Superpotential) else at.bound
    except hv.HemivarError as error:
        return "" if len(str(error)) > 15 else f"says {str(error)!r}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:80]}"
    return ""


@pytest.mark.parametrize("name", CALLED)
def test_wrong_arguments_are_refused_in_words(
    name: str, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path_factory.getbasetemp())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        raw = [f"{given!r:.200}: {told}" for given in calls(CALLED[name]) if (told := trouble(CALLED[name], given))]
    assert not raw, "\n".join(raw)


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
