"""Bounds on flat cells: not far above the error, or they say so."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.exact_certificate import statement_of
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stiffness_matrix
from hemivar.mesh import Mesh, box, rectangle


def layer(height: float, order: int = 1, unit: float = 1.0) -> hv.ContactProblem:
    """A layer of length one, bonded on top and pulled at its end, on 8 x 2 crossed cells."""
    mesh = rectangle((unit, height * unit), (8, 2), pattern="cross")
    law = hv.Contact(hv.Signorini(), hv.Tresca(0.05))
    return hv.ContactProblem(
        mesh, hv.Material.young(10.0, 0.3), {"bottom": law}, {"top": hv.Clamped()},
        body_force=(0.1 / unit, -0.4 / unit), tractions={"right": (0.05, -0.2)}, order=order,
    )  # fmt: skip


def bounded_wave(problem: hv.ContactProblem, change: float = 0.0) -> tuple[Array, ExactDistance]:
    """The displacement, moved away by some of a wave, and its bound."""
    solution = hv.solve(problem)
    field = solution.problem.field
    assert field is not None
    down = (problem.mesh.points[:, 1].max() - field.nodes[:, 1])[:, None]
    u = solution.displacement + change * down * np.sin(9.0 * field.nodes[:, :1]) * np.array([1.0, 0.5])
    return u, exact_distance(problem, u, guaranteed_trace_bounds(solution.problem))


def error_on_slender(problem: hv.ContactProblem, u: Array) -> float:
    """Against quadratic elements on a mesh with cells as long as high at both ends, in which that of u is nested."""
    mesh = problem.mesh
    at, height = np.linspace(0.0, 1.0, 9), problem.mesh.points[:, 1].max()
    near = 0.125 * 0.5 ** np.arange(1, 1 + int(np.ceil(np.log2(0.125 / height)) + 1))
    xs = np.unique(np.concatenate([at, near, 1.0 - near]))
    grid = rectangle((1.0, height), (len(xs) - 1, 8), pattern="cross")
    points = grid.points.copy()
    points[:, 0] = np.interp(points[:, 0], np.linspace(0.0, 1.0, len(xs)), xs)
    fine = replace(problem, mesh=Mesh(points, grid.cells, dict(grid.boundaries)), order=2)
    found = hv.solve(fine)
    field = found.problem.field
    assert field is not None
    off = (found.displacement - hv.fem.interpolate(mesh, u, field.nodes)).ravel()
    return float(np.sqrt(off @ (stiffness_matrix(fine.mesh, fine.material, 2) @ off)))


@pytest.mark.parametrize(
    ("height", "order"), [(1 / 100, 2), (1 / 300, 1), pytest.param(1 / 300, 2, marks=pytest.mark.slow)]
)
def test_a_thin_layer_has_a_bound_of_the_size_of_the_error(height: float, order: int) -> None:
    problem = layer(height, order)
    u, found = bounded_wave(problem)
    error = error_on_slender(problem, u)
    assert found.guaranteed
    assert error <= found.distance <= 20.0 * error
    assert "cells are flat" not in "".join(statement_of(found).lines())


def test_how_far_the_other_displacement_is_counts() -> None:
    problem = layer(1 / 100)
    u, found = bounded_wave(problem, 0.3)
    error = error_on_slender(problem, u)
    assert error <= found.distance <= 5.0 * error
    assert found.parts.correction > 0.5 * error


def test_what_belongs_to_cells_is_that_of_the_mesh() -> None:
    problem = layer(1 / 100)
    _, found = bounded_wave(problem)
    assert len(found.cells) == problem.mesh.number_of_cells
    assert found.stress.data.table.mesh is problem.mesh
    assert len(found.facets) == 8


def test_units_do_not_matter() -> None:
    (_, one), (_, other) = bounded_wave(layer(1 / 100)), bounded_wave(layer(1 / 100, unit=1024.0))
    assert other.relative == pytest.approx(one.relative, rel=1e-6)


def test_a_bound_far_above_the_error_says_so() -> None:
    load = (0.1, 0.1, -0.4)
    problem = hv.ContactProblem(
        box((1.0, 1.0, 0.01), (4, 4, 2)), hv.Material.young(10.0, 0.3), {"bottom": hv.Contact(hv.Signorini())},
        {"left": hv.Clamped()}, body_force=load, tractions={"right": load},
    )  # fmt: skip
    solution = hv.solve(problem)
    found = exact_distance(problem, solution.displacement, guaranteed_trace_bounds(solution.problem))
    assert found.above > 20.0
    assert "cells are flat: it may be" in "\n".join(statement_of(found).lines())
    assert statement_of(found).record()["above"] == found.above


def test_cells_as_long_as_high_say_nothing() -> None:
    problem = hv.gallery.survey("5.1", 4)
    solution = hv.solve(problem)
    found = exact_distance(problem, solution.displacement, guaranteed_trace_bounds(solution.problem))
    assert found.above == 0.0


def test_flat_bodies_that_touch_say_so() -> None:
    """A strip on another: facets coincide, or do not."""
    material = hv.Material.young(10.0, 0.3)
    for count in (4, 5):
        upper, lower = (rectangle((1.0, 0.01), (n, 1), pattern="right") for n in (4, count))
        pair = {"upper": upper.moved(np.eye(2), (0.0, 0.01)), "lower": lower}
        mesh = hv.Mesh.assembled(pair)
        law = hv.Contact(hv.Signorini(), against="lower:top")
        held = {"upper:top": hv.Clamped(), "lower:bottom": hv.Clamped()}
        problem = hv.ContactProblem(
            mesh, material, {"upper:bottom": law}, held, body_force=(0.1, -0.4), tractions={"upper:right": (0.1, 0.1)}
        )
        solution = hv.solve(problem)
        found = exact_distance(problem, solution.displacement, guaranteed_trace_bounds(solution.problem))
        assert found.above > 20.0


@pytest.mark.parametrize("where", ["bettered", "solve", "interpolate"])
def test_what_becomes_of_better_cells_does_not_cost_the_bound_in_hand(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = layer(1 / 100)
    u, _ = bounded_wave(problem)
    constants = guaranteed_trace_bounds(hv.discretize(problem))

    def refused(*_: object, **__: object) -> None:
        raise ProblemError("the mesh is refused")

    monkeypatch.setattr(sys.modules[ExactDistance.__module__], where, refused)
    found = exact_distance(problem, u, constants)
    assert found.guaranteed
    assert "cells are flat" in "".join(statement_of(found).lines())
