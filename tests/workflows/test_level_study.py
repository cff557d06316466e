"""Levels that a function makes: orders of elements by forms against a manufactured block, and bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skfem
from skfem.helpers import grad

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.fem import FormBody, FormProblem
from hemivar.solvers import Solution
from hemivar.workflows import study_levels
from tests.fem.test_forms import LAM, MU, elastic, grid

PRESSED, SLOPE, WAVE = 0.05, 0.05, 0.02


def across(x: Array) -> tuple[Array, Array, Array]:
    """``1 + cos(pi x) / 5`` with its derivatives."""
    return 1.0 + 0.2 * np.cos(np.pi * x), -0.2 * np.pi * np.sin(np.pi * x), -0.2 * np.pi**2 * np.cos(np.pi * x)


def along(y: Array) -> tuple[Array, Array, Array]:
    """``a y + b sin(3 y)`` with its derivatives."""
    return (
        SLOPE * y + WAVE * np.sin(3.0 * y), SLOPE + 3.0 * WAVE * np.cos(3.0 * y), -9.0 * WAVE * np.sin(3.0 * y)
    )  # fmt: skip


def displacement(x: Array) -> Array:
    """No motion along x; down by ``d + g(y) c(x)``, so that the foundation y = 0 is pressed in by d everywhere."""
    return -(PRESSED + along(x[1])[0] * across(x[0])[0])


@skfem.LinearForm
def force(v: Any, w: Any) -> Any:
    (c, c1, c2), (g, g1, g2) = across(w.x[0]), along(w.x[1])
    return (LAM + MU) * g1 * c1 * v[0] + (MU * g * c2 + (LAM + 2.0 * MU) * g2 * c) * v[1]


def stiffness(points: Array) -> Array:
    """Of the foundation, so that it carries the pressure of that displacement."""
    return (LAM + 2.0 * MU) * along(np.zeros(len(points)))[1] * across(points[:, 0])[0] / PRESSED


def form_square(kind: Any, element: Any, n: int) -> FormProblem:
    basis = skfem.Basis(grid(kind, n), skfem.ElementVector(element()), intorder=8)
    sides: dict[str, Any] = {side: {"u^1": 0.0} for side in ("left", "right")}
    body = FormBody(basis, elastic, force, sides | {"top": {"u^1": 0.0, "u^2": displacement}})
    return FormProblem(body, {"bottom": hv.Contact(hv.Compliance(stiffness))})


def errors(solution: Solution, made: Any) -> dict[str, float]:
    basis = made.body.basis
    whole = basis.interpolate(made.body.full(solution.problem, solution.unknowns))
    (c, c1, _), (g, g1, _) = across(basis.global_coordinates()[0]), along(basis.global_coordinates()[1])
    off = np.asarray(whole) - np.stack([0.0 * g, -(PRESSED + g * c)])
    slope = np.asarray(grad(whole)) - np.array([[0.0 * g, 0.0 * g], [-g * c1, -g1 * c]])
    return {
        "mean square": float(np.sqrt(((off**2).sum(axis=0) * basis.dx).sum())),
        "slope": float(np.sqrt(((slope**2).sum(axis=(0, 1)) * basis.dx).sum())),
        "force": solution.normal_force,
    }


@pytest.mark.parametrize(
    ("kind", "element", "order"),
    [
        (skfem.MeshQuad, skfem.ElementQuad1, 1),
        (skfem.MeshTri, skfem.ElementTriP2, 2),
        (skfem.MeshQuad, skfem.ElementQuad2, 2),
    ],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_orders_of_elements_by_forms(kind: Any, element: Any, order: int) -> None:
    exact = (LAM + 2.0 * MU) * along(np.zeros(1))[1][0]  # the mean of c is 1
    found = study_levels(
        lambda level: form_square(kind, element, 2 ** (level + 1)),
        3,
        measure=errors,
        known={"mean square": 0.0, "slope": 0.0, "force": exact},
    )
    assert found.steps("slope")[-1] == pytest.approx(order, abs=0.1)
    assert found.steps("mean square")[-1] == pytest.approx(order + 1, abs=0.15)
    assert found.steps("force")[-1] > 1.9
    assert np.isnan(found.steps("slope")[0])
    assert "order" in repr(found)
    assert f"{found.solutions[-1].problem.unknowns} unknowns" in repr(found)


def test_without_known_values_the_finest_level_is_the_reference() -> None:
    found = study_levels(lambda k: form_square(skfem.MeshQuad, skfem.ElementQuad1, 2 ** (k + 1)).discrete, 2,
                         measure=lambda solution, made: {"energy": solution.energy})  # fmt: skip
    values = found.values["energy"]
    np.testing.assert_allclose(found.errors("energy")[:2], np.abs(values[:2] - values[2]))
    assert np.isnan(found.errors("energy")[2])
    with pytest.raises(hv.errors.ProblemError, match="there are energy"):
        found.errors("force")


@pytest.mark.parametrize(
    ("make", "measure", "known", "words"),
    [
        (lambda k: 3, None, None, "the problem of level 0 is 3"),
        (None, lambda solution, made: 3.0, None, "return numbers by name"),
        (None, lambda solution, made: {str(solution.problem.unknowns): 1.0}, None, "level 1 measures"),
        (None, None, {"froce": 1.0}, "known names 'froce'"),
    ],
)
def test_what_is_wrong_is_told(make: Any, measure: Any, known: Any, words: str) -> None:
    def level(k: int) -> FormProblem:
        return form_square(skfem.MeshQuad, skfem.ElementQuad1, 2 ** (k + 1))

    with pytest.raises(hv.errors.ProblemError, match=words):
        study_levels(make or level, 1, measure=measure or errors, known=known)


def test_a_function_given_to_study_is_told_where_to_go() -> None:
    with pytest.raises(hv.errors.ProblemError, match="study_levels"):
        hv.study(lambda k: None)  # type: ignore[arg-type]
