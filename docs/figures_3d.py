"""Data of the figures in three dimensions that ``_static/figure3d.js`` shows: written when the site is built."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.fem import nodal_average, von_mises
from hemivar.solvers import NormalState, Solution, TangentialState

DRAWN = Path(__file__).parent / "drawn" / "static"
#: Colour of a contact point: open, in contact without friction, sticking, slipping.
_NUMBERS = {TangentialState.FREE: 1, TangentialState.STICK: 2, TangentialState.SLIP: 3}


def two_equilibria() -> list[Solution]:
    """A cube on a foundation that softens, which bears it or has given way under the same load."""

    def cube(push: float) -> hv.ContactProblem:
        return hv.ContactProblem(
            mesh=hv.box((1.0, 1.0, 1.0), 6),
            material=hv.Material.lame(4.0, 4.0),
            supports={"top": hv.Fixed(x=0.0, y=0.0, z=-push)},
            contact={"bottom": hv.Contact(hv.Softening(60.0, 0.02, 16.0))},
            body_force=(0.0, 0.0, -1.0),
        )

    deep = hv.solve(cube(0.2)).raise_for_status()
    return [hv.solve(cube(0.07), initial=start).raise_for_status() for start in (None, deep)]


def dragged_cube() -> list[Solution]:
    """A cube that slips in two directions."""
    return [hv.solve(hv.gallery.survey_cube("5.1", 8)).raise_for_status()]


def _states(solution: Solution) -> list[int]:
    normal, along = solution.states.normal, solution.states.tangential
    return [
        0 if one == NormalState.OPEN else _NUMBERS[TangentialState(two)] for one, two in zip(normal, along, strict=True)
    ]


def write(file: Path, title: str, solutions: list[Solution], told: list[str], scale: float) -> None:
    """The surface of a unit cube on z = 0, and displacement, stress and states of each solution.

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
    body = {
        "title": title,
        "scale": scale,
        "pitch": -0.35,
        "most": float(max(max(one["stress"]) for one in shown)),  # type: ignore[type-var, arg-type]
        "points": np.round(mesh.points[used], 6).ravel().tolist(),
        "triangles": corners.ravel().tolist(),
        "edges": edges.ravel().tolist(),
        "contact": np.searchsorted(used, contact.node).tolist(),
        "ground": [(x, y, 0.0) for x, y in ((-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1))],
        "solutions": shown,
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(body, separators=(",", ":")), encoding="utf-8")


def main() -> None:
    """Write both."""
    bears, gave = two_equilibria()
    told = [
        f"{words}: penetration up to {one.penetration.max():.3f}, energy {one.energy:.4f}"
        for one, words in ((bears, "The foundation bears"), (gave, "The foundation has given way"))
    ]
    write(DRAWN / "two_equilibria.json", "A cube on a foundation that softens", [bears, gave], told, 1.0)
    (dragged,) = dragged_cube()
    counts = {kind: int(np.count_nonzero(here)) for kind, here in dragged.states.present.items()}
    words = ", ".join(f"{kind.label} ({count})" for kind, count in counts.items())
    write(
        DRAWN / "dragged_cube.json", "A cube dragged over its foundation", [dragged], [f"Contact points: {words}"], 1.0
    )


if __name__ == "__main__":
    main()
