"""Statements that bounds cannot serve: refused, or called an estimate or no bound, with a reason in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import exact_distance, lower_bounds, solve_adaptive
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.trace_bounds import TraceBounds, discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.errors import HemivarError
from hemivar.gallery import elastic_bar, membrane_obstacle, survey
from hemivar.mechanics import ContactProblem
from tests import bodies

PROBLEM = survey("5.1", 3)
SOLVED = hv.solve(PROBLEM)
U = SOLVED.displacement
PROVED = TraceBounds(2.5, 2.5, 2.5, 2.0, True, "for this test")
NODES = PROBLEM.mesh.number_of_nodes


def bound(problem: Any = PROBLEM, u: Any = U, constants: Any = PROVED, **options: Any) -> Any:
    return exact_distance(problem, u, constants, **options)


def problem_with(**changes: Any) -> ContactProblem:
    return replace(PROBLEM, **changes)


def foundation(*laws: Any, **options: Any) -> ContactProblem:
    return problem_with(contact={"bottom": hv.Contact(*laws, **options)})


def with_entry(value: float) -> Array:
    u = U.copy()
    u[0, 0] = value
    return u


def block_of_order_2() -> Any:
    problem = bodies.cube(cells=2, body_force=(0.0, 0.0, -1.0), order=2)
    return bound(problem, np.zeros(problem.mesh.nodes(2).shape))


def times_nan(x: Array) -> Array:
    return x * np.nan


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    # what is to be judged
    "not a statement": (lambda: bound(None), "the problem of the bound is None; give the ContactProblem"),
    "a discrete problem": (lambda: bound(SOLVED.problem), "is a DiscreteProblem; give the ContactProblem that states"),
    "a scalar problem": (lambda: bound(membrane_obstacle().problem), "is a ScalarProblem; .* elastic bodies at rest"),
    "an evolution": (lambda: bound(hv.Evolution(PROBLEM)), "is an Evolution; .* elastic bodies at rest"),
    "a solution for a displacement": (lambda: bound(u=SOLVED), "the displacement is not an array of numbers"),
    "text for a displacement": (lambda: bound(u="u.csv"), "the displacement is not an array of numbers: it is text"),
    "nan in the displacement": (lambda: bound(u=with_entry(np.nan)), r"displacement\[0, 0\] = nan; every number"),
    "inf in the displacement": (lambda: bound(u=with_entry(np.inf)), r"displacement\[0, 0\] = inf; every number"),
    "a complex displacement": (lambda: bound(u=U * 1j), "the displacement is complex; give real numbers"),
    "that of another mesh": (
        lambda: bound(u=U[:-1]),
        rf"shape \({NODES - 1}, 2\); a field of order 1 .* \({NODES}, 2\)",
    ),
    "one component": (lambda: bound(u=U[:, 0]), rf"the displacement has shape \({NODES},\)"),
    "supports missed": (
        lambda: bound(u=U + 0.01),
        r"differs from the prescribed one by 0.01 at node 0, x = \(0, 0\); give that of a sol",
    ),
    "prescribed values missed": (
        lambda: bound(problem_with(supports={"left": hv.Prescribed((0.1, 0.0))})),
        "differs from the prescribed one by 0.1",
    ),
    "constants of another kind": (lambda: bound(constants=2.5), "constants is 2.5; give those of guaranteed_trace_bou"),
    "constants not yet made": (
        lambda: bound(constants=TraceBounds),
        "constants is the class TraceBounds; create an instance",
    ),
    "a sweep by its name": (lambda: bound(sweeps=("vertex",)), "a sweep is 'vertex'; choose among"),
    "one sweep, no tuple": (lambda: bound(sweeps=PatchKind.VERTEX), r"sweeps is .*; give a tuple such as"),
    # statements
    "quadratic elements in space": (block_of_order_2, "order = 1"),
    "a bedding": (lambda: bound(problem_with(bedding=1.0)), "bodies without bedding; leave the bedding out"),
    "a load that depends on time": (
        lambda: bound(problem_with(body_force=lambda x, t: t * x)),
        r"a load of the problem depends on time; .*at_time\(0.0\)",
    ),
    "a law that depends on time": (
        lambda: bound(foundation(hv.laws.ThresholdCompliance(lambda x, t: 0.1 + t + 0.0 * x[:, 0]))),
        "a law of the problem depends on time",
    ),
    "damping": (
        lambda: bound(foundation(hv.laws.ThresholdCompliance(0.3, 2.0), damping=hv.Compliance(2.0))),
        "contact 'bottom' has damping",
    ),
    "a load that is not finite": (
        lambda: bound(problem_with(body_force=times_nan)),
        r"body_force: the callable returned \[nan nan\] at x = ",
    ),
    "a traction that is not finite": (
        lambda: bound(problem_with(tractions={"top": times_nan})),
        r"tractions\['top'\]: the callable returned \[nan nan\] at x",
    ),
    "a load of another shape": (
        lambda: bound(problem_with(body_force=lambda x: x[:, 0])),
        "body_force: .* must return shape",
    ),
    "a gap that is not finite": (
        lambda: bound(foundation(hv.laws.ThresholdCompliance(0.3), gap=lambda x: np.nan * x[:, 0])),
        "gap of contact 'bottom'.* nan",
    ),
    "law parameters for each node": (
        lambda: bound(foundation(hv.laws.ThresholdCompliance(np.linspace(0.1, 0.3, 4), 2.0))),
        "parameter q_max given at 4 contact points; .*: give a number, or a function of x",
    ),
    # constants of the body
    "a negative constant": (
        lambda: TraceBounds(-1.0, 1.0, 1.0, 1.0, True, ""),
        "'both' is -1.0; give a number that is",
    ),
    "a constant that is nan": (lambda: TraceBounds(1.0, np.nan, 1.0, 1.0, True, ""), "'normal' is nan; give a number"),
    "a constant in words": (
        lambda: TraceBounds(1.0, 1.0, "2", 1.0, True, ""),
        "'tangential' is 2; give a number",  # type: ignore[arg-type]
    ),
    "no body, arrays alone": (
        lambda: guaranteed_trace_bounds(elastic_bar()),
        "need a continuous problem; discretize a",
    ),
    "constants of a statement": (
        lambda: guaranteed_trace_bounds(PROBLEM),
        r"is a ContactProblem; give hemivar.discretize\(problem\)",  # type: ignore[arg-type]
    ),
    "lower bounds of nothing": (lambda: lower_bounds(None), "the problem of a lower bound is None; give the Contact"),  # type: ignore[arg-type]
    "no cells": (lambda: lower_bounds(PROBLEM, 0), "cells"),
    "cells that are no number": (lambda: lower_bounds(PROBLEM, float("nan")), "cells"),  # type: ignore[arg-type]
    "no contact": (
        lambda: lower_bounds(problem_with(contact={})),
        "no contact boundary, and so no trace constant; state Contact",
    ),
    "held by contact alone": (
        lambda: lower_bounds(problem_with(supports={})),
        "the supports do not constrain the body.*; add a support",
    ),
    "a material that varies within cells": (
        lambda: lower_bounds(problem_with(material=hv.Material.lame(lambda x: 4.0 + x[:, 0], 4.0))),
        "varies inside cells; ",
    ),
    # meshes that adapt
    "adaptive: a discrete problem": (
        lambda: solve_adaptive(SOLVED.problem),
        "a DiscreteProblem; give a ContactProblem",
    ),  # type: ignore[arg-type]
    "adaptive: a scalar problem": (lambda: solve_adaptive(membrane_obstacle().problem), "a ScalarProblem; give a Con"),  # type: ignore[arg-type]
    "adaptive: an evolution": (lambda: solve_adaptive(hv.Evolution(PROBLEM)), "an Evolution; give a ContactProblem"),  # type: ignore[arg-type]
    "adaptive: rtol 0": (lambda: solve_adaptive(PROBLEM, rtol=0.0), "rtol = 0.0; give a positive number"),
    "adaptive: rtol below 0": (lambda: solve_adaptive(PROBLEM, rtol=-0.1), "rtol = -0.1; give a positive number"),
    "adaptive: rtol nan": (lambda: solve_adaptive(PROBLEM, rtol=float("nan")), "rtol.*; give a positive number"),
    "adaptive: rtol in words": (lambda: solve_adaptive(PROBLEM, rtol="small"), "rtol is 'small'; give a positive"),  # type: ignore[arg-type]
    "adaptive: nothing marked": (lambda: solve_adaptive(PROBLEM, share=0.0), "share = 0.0; give a positive number"),
    "adaptive: more than all marked": (
        lambda: solve_adaptive(PROBLEM, share=1.5),
        "share = 1.5; .*cells, at most 1",
    ),
    "adaptive: no time": (lambda: solve_adaptive(PROBLEM, max_time=0.0), "max_time = 0.0; give a positive number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name: str) -> None:
    run, message = REFUSED[name]
    with pytest.raises(HemivarError, match=message):
        run()


def law_of_a_function() -> Any:
    return hv.laws.FunctionLaw(derivative=lambda r: 2.0 * (r > 0.0) + 0.009 * np.cos(9.0 * r))


#: What is left of a bound: how far it goes ("estimate" or "none"), and part of the reason.
LESSENED: dict[str, tuple[Callable[[], Any], str, str]] = {
    "constants of the discrete problem": (
        lambda: judged(foundation(hv.Softening(4.0, 0.5, 0.1)), constants=discrete_trace_bounds(SOLVED.problem)),
        "estimate",
        "no bounds of the continuous one",
    ),
    "only contact constrains the body": (
        lambda: judged(foundation(hv.Softening(4.0, 0.5, 0.1)), constants=TraceBounds(0.0, 0.0, 0.0, 0.0, True, "")),
        "none",
        "only contact constrains the body, and its law is not known to be convex",
    ),
    "a foundation that softens too much": (
        lambda: judged(foundation(hv.Softening(4.0, 0.02, 50.0)), shift=0.03),
        "none",
        "softens too much for the body",
    ),
    "constants that are poor": (
        lambda: judged(foundation(hv.Softening(4.0, 0.02, 1.0)), 0.03, TraceBounds(0.25, 0.25, 0.25, 2.0, True, "low")),
        "none",
        "the constants of the body are poor. They give c = 4, where displacements of the mesh show no more than 0.",
    ),
    "friction that weakens too much": (
        lambda: judged(foundation(hv.laws.ThresholdCompliance(0.3, 2.0), hv.SlipWeakening(1.0, 1.0, 0.0, 500.0))),
        "none",
        "softens too much",
    ),
    "a downward jump that is passed": (
        lambda: judged(foundation(hv.laws.Capped(4.0, 0.02, 0.01)), shift=0.02),
        "none",
        "passes a downward jump of the law on",
    ),
    "Coulomb on a rigid foundation": (
        lambda: judged(foundation(hv.Signorini(), hv.laws.Friction(hv.laws.CoulombBound(0.3)))),
        "none",
        "depends on the pressure",
    ),
    "Coulomb on a compliant foundation": (
        lambda: judged(foundation(hv.Compliance(2.0), hv.laws.Friction(hv.laws.CoulombBound(0.3)))),
        "none",
        "depends on the pressure",
    ),
    "a law that varies along the boundary": (
        lambda: judged(foundation(hv.laws.ThresholdCompliance(lambda x: 0.1 + x[:, 0], 2.0))),
        "estimate",
        "varies along the boundary (q_max)",
    ),
    "a law known from samples": (
        lambda: judged(foundation(law_of_a_function())),
        "estimate",
        "known from samples only",
    ),
    "a material that varies within cells": (
        lambda: judged(problem_with(material=hv.Material.lame(lambda x: 4.0 + x[:, 0], 4.0))),
        "estimate",
        "varies within cells",
    ),
    "a curved foundation": (
        lambda: judged(
            foundation(hv.laws.ThresholdCompliance(0.3, 2.0), obstacle=hv.mechanics.Sphere((0.5, -9.0), 9.0))
        ),
        "estimate",
        "the gap of",
    ),
    "a gap that is a function": (
        lambda: judged(foundation(hv.laws.ThresholdCompliance(0.3, 2.0), gap=lambda x: 0.01 * x[:, 0] ** 2)),
        "estimate",
        "the gap of",
    ),
    "prescribed displacements that are functions": (
        lambda: judged(problem_with(supports={"left": hv.Prescribed(lambda x: 0.01 * x**2)})),
        "estimate",
        "the mesh interpolates",
    ),
    "a penetration that the law forbids": (
        lambda: bound(
            foundation(hv.Signorini(), obstacle=hv.mechanics.Sphere((0.5, -9.0), 9.0)),
            U - 0.5 * PROBLEM.mesh.points[:, :1] * [0.0, 1.0],
        ),
        "estimate",
        "leaves the",
    ),
}


def judged(problem: ContactProblem, shift: float = 0.0, constants: TraceBounds = PROVED) -> Any:
    """The bound for the solution, or one that is pressed further in."""
    u = hv.solve(problem, controls=hv.Controls(max_steps=30)).displacement
    return bound(problem, u - shift * problem.mesh.points[:, :1] * [0.0, 1.0], constants)


@pytest.mark.parametrize("name", LESSENED)
def test_what_is_no_bound_says_why(name: str) -> None:
    run, kind, reason = LESSENED[name]
    found = run()
    assert not found.guaranteed
    assert (found.distance < np.inf) == (kind == "estimate"), found.reasons
    assert reason in " ".join(found.reasons)
    assert ("Coulomb" in name) <= ("softens" not in " ".join(found.reasons))  # of what is not the cause nothing is said


def test_the_same_without_the_fault_is_a_bound() -> None:
    """What the cases above are changes of."""
    assert bound().guaranteed
    assert bound().reasons == ()
    assert judged(foundation(hv.Softening(4.0, 0.02, 0.5)), shift=0.0).guaranteed
    assert len(REFUSED) + len(LESSENED) >= 25
