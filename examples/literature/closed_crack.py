"""A closed crack under compression, with friction.

A crack of the half length 1, inclined by 20 degrees to a compression of 100 MPa in a large body in plane strain: E
= 25 GPa, nu = 0.25, friction tan 30. With s and c the sine and the cosine of 20 degrees its normal traction is 100
s^2, and the slip in the middle 4 (1 - nu^2)/E 100 s (c - s tan 30).
"""

import numpy as np

import hemivar as hv

SOURCE = "Phan, Napier, Gray, Kaplan 2003; GEOS"
PRINTED = {"slip in the middle": 3.808e-3, "normal traction": 11.698}
REASON = "the body ends at 40 half lengths; slip is a root at the tips, where cells are smaller"
WITHIN = 0.01


def cracked(cells: int, growth: float) -> hv.Mesh:
    """A square around a crack on y = 0 with so many cells; the cells beyond it grow, to a side of 80."""
    inner = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, cells // 2 + 1))  # small at the tips
    away = np.cumsum((1.0 - inner[-2]) * growth ** np.arange(100))
    away = np.append(away[away < 35.0], 40.0)
    x, y = np.append(inner, 1.0 + away[:-1]), np.append(0.0, away)
    x, y = (np.append(-half[:0:-1], half) for half in (np.append(x, 40.0), y))
    square = hv.rectangle((x.size - 1, y.size - 1), (x.size - 1, y.size - 1))
    i, j = np.rint(square.points).astype(int).T
    mesh = hv.Mesh(np.column_stack([x[i], y[j]]), square.cells, square.boundaries)
    crack = {"crack": lambda x: (np.abs(x[:, 1]) < 1e-9) & (np.abs(x[:, 0]) < 1.0)}
    return mesh.with_interfaces(crack).opened("crack")


def computed(fine: bool = False) -> dict[str, float]:
    """The crack lies along x, and the compression is inclined; quadratic elements."""
    along = np.array([np.cos(np.radians(20.0)), np.sin(np.radians(20.0))])
    stress = -100.0 * np.outer(along, along)
    sides = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "bottom": (0.0, -1.0), "top": (0.0, 1.0)}
    problem = hv.ContactProblem(
        mesh=cracked(32 if fine else 12, 1.3 if fine else 1.6),
        material=hv.Material.young(25e3, 0.25),
        contact={"crack:1": hv.Contact(hv.Signorini(), hv.Coulomb(np.tan(np.radians(30.0))), against="crack:2")},
        supports={"held": hv.Clamped(at=(-40.0, -40.0)), "guided": hv.Fixed(y=0.0, at=(40.0, -40.0))},
        tractions={name: tuple(stress @ normal) for name, normal in sides.items()},
        order=2,
    )
    solution = hv.solve(problem).raise_for_status()
    x = solution.contact.points[:, 0]
    middle = np.abs(x) < 0.5
    return {
        "slip in the middle": float(np.abs(solution.slip).max()),
        "normal traction": float(np.average(solution.pressure[middle], weights=solution.contact.weights[middle])),
    }
