"""The table of what is covered, in docs/bounds.md, is what the library answers, and agrees with what it refuses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds import goal_named
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.goal_values import goal_value
from hemivar.bounds.goals import known_goals
from hemivar.bounds.trace_bounds import body_constants
from hemivar.errors import HemivarError
from hemivar.fem import FormProblem
from hemivar.formula import Formula
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace
from tests.bounds.test_joined_bodies import contact, opened, two
from tests.composition.cases import BODIES
from tests.composition.rules import matching

DOCS = Path(__file__).parents[2] / "docs" / "bounds.md"
RUBS = hv.Contact(hv.Compliance(500.0), hv.Tresca(0.3))
COULOMB = hv.Contact(hv.Compliance(500.0), hv.Coulomb(0.3))
SOFTENS = hv.Contact(hv.Softening(500.0, 2e-3, 20.0))
RESTING: dict[str, Any] = {"supports": {"left": hv.Roller()}}


def block(touching: hv.Contact = RUBS, mesh: hv.Mesh | None = None, **more: Any) -> hv.ContactProblem:
    """Clamped above, pressed on what is below."""
    mesh = hv.rectangle((2.0, 1.0), (8, 4)) if mesh is None else mesh
    body = more.pop("material", hv.Material.young(1e3, 0.3))
    force = (0.1, *(0.0,) * (mesh.dim - 2), -0.5)
    held = more.pop("supports", {"top": hv.Clamped()})
    return hv.ContactProblem(mesh, body, {"bottom": touching}, held, body_force=force, **more)


def curved() -> hv.Mesh:
    """A bottom that is a parabola."""
    mesh = hv.rectangle((2.0, 1.0), (8, 4))
    x, y = mesh.points.T
    return hv.Mesh(np.column_stack([x, y + 0.1 * (x - 1.0) ** 2 * (1.0 - y)]), mesh.cells, dict(mesh.boundaries))


def pair(friction: hv.laws.Friction, *, held: bool = True) -> hv.ContactProblem:
    """Two blocks whose facets coincide."""
    supports: dict[str, Any] = {"bottom": hv.Clamped()} | ({"top": hv.Prescribed((0.01, -0.03))} if held else {})
    mesh = opened(hv.rectangle((1.0, 1.0), (4, 4)), 0.5)
    loads = {} if held else {"tractions": {"top": (0.001, -0.03)}}
    return two(mesh, (1.0, 3.0), contact(0, hv.Compliance(10.0), friction), supports=supports, **loads)


def hencky_body(**more: Any) -> hv.ContactProblem:
    return block(material=hv.Material.hencky(bulk=800.0, shear=400.0, softened=0.25, strain=0.05), **more)


def of(body: str) -> Callable[[], Any]:
    """A body of the table of what works with what."""
    return lambda: BODIES[body](hv.Contact(hv.Compliance(20.0), hv.Tresca(0.05)), -1.0)


#: What the rows of the table are, in their order, and the body of the other table that is one of them.
ROWS: Mapping[str, tuple[Callable[[], Any], str]] = {
    "held by supports, convex law": (block, "plane"),
    "held by supports, law that softens": (lambda: block(SOFTENS), "plane"),
    "held by supports, Coulomb's friction": (lambda: block(COULOMB), ""),
    "held by contact alone, convex law": (lambda: block(**RESTING), "resting"),
    "held by contact alone, law that softens": (lambda: block(SOFTENS, **RESTING), ""),
    "held by contact alone, Coulomb's friction": (lambda: block(COULOMB, **RESTING), ""),
    "3D, linear elements": (lambda: block(mesh=hv.box((1.0, 1.0, 1.0), 2)), "space"),
    "2D, quadratic elements": (lambda: block(order=2), "quadratic"),
    "two bodies, facets coincide": (lambda: pair(hv.Tresca(0.02)), "glued inside"),
    "the same, one held by the other alone": (lambda: pair(hv.Tresca(0.02), held=False), "glued inside"),
    "the same, Coulomb's friction": (lambda: pair(hv.Coulomb(0.2)), ""),
    "two bodies, facets do not coincide": (of("pair"), "pair"),
    "curved boundary": (lambda: block(mesh=curved()), ""),
    "curved boundary, `as-meshed`": (lambda: block(mesh=curved(), geometry="as-meshed"), ""),
    "gap by a formula": (lambda: block(replace(RUBS, gap=Formula("0.0001 * (x - 1)^2"))), "plane"),
    "gap by a Python function": (lambda: block(replace(RUBS, gap=lambda x: 1e-4 * (x[:, 0] - 1.0) ** 2)), ""),
    "sphere or cylinder as obstacle": (
        lambda: block(replace(RUBS, obstacle=hv.mechanics.Sphere((1.0, -5.0), 5.0))), ""),
    "nonlinear material, linear elements": (hencky_body, "nonlinear"),
    "nonlinear material, quadratic elements": (lambda: hencky_body(order=2), ""),
    "body of revolution": (lambda: block(material=hv.Material.young(1e3, 0.3, plane="axisymmetric")), ""),
    "bedding": (of("bedded"), "bedded"),
    "initial stress or strain": (lambda: block(initial_strain=1e-4), ""),
    "one component: membrane, antiplane shear": (of("antiplane"), "antiplane"),
    "form of scikit-fem: quadrilaterals, hexahedra": (of("form"), "form"),
    "arrays": (of("arrays"), "arrays"),
}  # fmt: skip


def rows_of_page() -> dict[str, list[str]]:
    """The table of the page: what stands in the columns behind each first one."""
    text = DOCS.read_text(encoding="utf-8").split("## What is covered")[1].split("\n## ")[0]
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")][2:]
    cells = [[cell.strip() for cell in line] for line in lines[: len(ROWS)]]
    return {name: rest for name, *rest in cells}


def answered(known: bool, shown: bool) -> str:
    return ("yes" if shown else "estimate") if known else "no"


@lru_cache
def claims(name: str) -> list[str]:
    """What the library says of a row, in the order of the columns."""
    stated = ROWS[name][0]()
    solution = hv.solve(stated.discrete if isinstance(stated, FormProblem) else stated)
    certificate = hv.certify(solution, exact=True)
    exact = certificate.exact
    assert exact is not None
    return [
        answered(bool(certificate.unique), True),
        answered(np.isfinite(certificate.error_bound), True),
        answered(exact.unique, True),
        answered(np.isfinite(exact.bound), exact.guaranteed),
        goal(stated, solution),
    ]


def goal(stated: Any, solution: hv.Solution) -> str:
    """Whether a contact force has an interval."""
    try:
        name = next(name for name in known_goals(stated) if name.startswith("contact"))
        constants = body_constants(solution.problem, Workspace())
        distance = exact_distance(stated, solution.displacement, constants)
        found = goal_value(goal_named(stated, name), solution, distance, constants)
    except HemivarError:
        return "no"
    return answered(bool(np.isfinite(found.upper - found.lower).all()), found.guaranteed)


def test_the_page_has_these_rows() -> None:
    assert list(rows_of_page()) == list(ROWS)


@pytest.mark.parametrize("name", list(ROWS))
def test_the_page_says_what_the_library_answers(name: str) -> None:
    assert rows_of_page()[name] == claims(name)


@pytest.mark.parametrize("name", [name for name, (_, body) in ROWS.items() if body])
def test_the_page_agrees_with_what_is_refused(name: str) -> None:
    """The table of what works with what refuses a bound exactly where this one has none."""
    stated, body = ROWS[name][0](), ROWS[name][1]
    one = isinstance(stated, ContactProblem) and stated.kind == "antiplane"
    levels = {"task": "exact", "body": body, "normal": "none" if one else "compliance", "friction": "tresca"}
    assert (rows_of_page()[name][3] == "no") == bool(matching({**levels, "beside": "none"}))
