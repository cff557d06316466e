"""Data of the figures in three dimensions that ``_static/figure3d.js`` shows: written when the site is built."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.fem import nodal_average, von_mises
from hemivar.solvers import NormalState, Solution, TangentialState


def three_equilibria() -> list[Solution]:
    """A cube that is pushed onto a softening foundation, in each of its three states."""
    cube = hv.ContactProblem(
        mesh=hv.box((1.0, 1.0, 1.0), 5),
        material=hv.Material.lame(4.0, 4.0),
        supports={"top": hv.Fixed(x=0.0, y=0.0, z=-0.07)},
        contact={"bottom": hv.Contact(hv.Softening(60.0, 0.02, 16.0))},
        body_force=(0.0, 0.0, -1.0),
    )
    found = hv.find_solutions(cube, starts=12, seed=1)
    return list(found)


def dragged_cube() -> list[Solution]:
    """A cube that slips in two directions."""
    return [hv.solve(hv.gallery.survey_cube("5.1", 8)).raise_for_status()]


def write(file: Path, title: str, solutions: list[Solution], told: list[str], scale: float) -> None:
    """The surface of the body, and displacement, stress and states of each solution.

    Parameters
    ----------
    file : Path
    title : str
    solutions : list of Solution
        Of one problem.
    told : list of str
        What is said of each.
    scale : float
        Factor of the displacement.
    """
    problem = solutions[0].problem
    assert problem.field is not None
    mesh, contact = problem.field.mesh, problem.contact
    used, corners = np.unique(mesh.boundary_facets, return_inverse=True)
    corners = corners.reshape(-1, 3)
    edges = np.unique(np.sort(np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1), axis=0)
    kinds = {(NormalState.OPEN, None): 0}
    shown = []
    for number, (one, words) in enumerate(zip(solutions, told, strict=True), start=1):
        stress = nodal_average(mesh, von_mises(one.problem.origin, one.displacement))  # type: ignore[arg-type]
        shown.append(
            {
                "name": f"{number}",
                "told": words,
                "displacement": np.round(one.displacement[used], 6).ravel().tolist(),
                "stress": np.round(stress[used], 5).tolist(),
                "states": _states(one),
            }
        )
    del kinds
    body = {
        "title": title,
        "scale": scale,
        "pitch": -0.35,
        "most": float(max(max(one["stress"]) for one in shown)),  # type: ignore[type-var, arg-type]
        "points": np.round(mesh.points[used], 6).ravel().tolist(),
        "triangles": corners.ravel().tolist(),
        "edges": edges.ravel().tolist(),
        "contact": np.searchsorted(used, contact.node).tolist(),
        "solutions": shown,
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(body, separators=(",", ":")), encoding="utf-8")
