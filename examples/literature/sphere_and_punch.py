"""A sphere and a flat punch on a half space.

Both rigid: a sphere of the radius 8 by 0.01485067 (Hertz: force 1.5, radius of contact 0.34468, pressure 6.0283),
and a punch of the radius 1 by 0.01 (Sneddon: force 4.3956, pressure in the middle 0.69958). E = 200, nu = 0.3.
"""

import numpy as np

import hemivar as hv

SOURCE = "Hertz; Sneddon 1965"
PRINTED = {
    "force, sphere": 1.5,
    "pressure, sphere": 6.028325694,
    "force, punch": 4.395604396,
    "pressure, punch": 0.6995821674,
}
REASON = "the block is 64 or 128 times the punch, not a half space, and the punch has a singular edge"
WITHIN = 0.03


def block(under: np.ndarray, size: float) -> hv.Mesh:
    """Half of a block with nodes ``under`` the indenter, and cells that grow beyond."""
    away = (under[-1] - under[-2]) * np.cumsum(1.15 ** np.arange(1, 99))
    away = np.append(away[away < 0.8 * size], size)
    x, y = np.append(under, under[-1] + away), np.append(-away[::-1], 0.0)
    square = hv.rectangle((x.size - 1, y.size - 1), (x.size - 1, y.size - 1))
    i, j = np.rint(square.points).astype(int).T
    mesh = hv.Mesh(np.column_stack([x[i], y[j]]), square.cells, square.boundaries)
    return mesh.marked({"under": lambda p: (p[:, 1] > -1e-9) & (p[:, 0] < under[-1] + 1e-9)})


def pressed(mesh: hv.Mesh, down: float, gap: str) -> tuple[float, float]:
    """Force and pressure on the axis; the base is lifted to the indenter."""
    problem = hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.young(200.0, 0.3, plane="axisymmetric"),
        contact={"under": hv.Contact(hv.Signorini(), gap=hv.formula.Formula(gap))},
        supports={"bottom": hv.Prescribed((0.0, down))},
        order=2,
    )
    solution = hv.solve(problem).raise_for_status()
    return solution.normal_force, float(solution.pressure[solution.contact.points[:, 0].argmin()])


def computed(fine: bool = False) -> dict[str, float]:
    """24 or 60 cells below the sphere; those below the punch are smaller at its edge."""
    n, size = (60, 128.0) if fine else (24, 64.0)
    edge = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, n // 2 + 1))
    sphere = pressed(block(np.linspace(0.0, 0.5, n + 1), size), 0.01485066667, "x^2/16")
    return dict(zip(PRINTED, sphere + pressed(block(edge, size), 0.01, "0"), strict=True))
