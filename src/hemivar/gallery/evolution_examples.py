"""Evolutions of the survey's authors: viscoelastic bodies, quasistatic and with mass, friction of the slip rate.

Sources: M. Jureczka, A. Ochal, P. Bartman, "A nonsmooth optimization approach for time-dependent hemivariational
inequalities" (2023; data of its three simulations), and the dynamic and quasistatic examples of their package conmech.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.spatial import Delaunay

from hemivar.errors import ProblemError
from hemivar.evolution import Evolution
from hemivar.laws import Compliance, Friction, NoFriction, PenetrationBound, SlipWeakening, Softening
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import Mesh, rectangle

__all__ = ["SCREWED_ARCH_DATA", "ScrewedArchData", "screwed_arch", "viscoelastic_beam"]

#: The body is (0, 1.2) x (0, 0.6) without the arch and the screws, as in the article.
_LENGTH, _HEIGHT = 1.2, 0.6
#: Centre and radius of the arch, as in the article.
_ARCH = ((0.6, 0.0), 0.3)
#: Centre and radius of each screw, as in the article.
_SCREWS = (((0.15, 0.15), 0.05), ((0.15, 0.45), 0.05), ((1.05, 0.15), 0.05), ((1.05, 0.45), 0.05))


@dataclass(frozen=True)
class ScrewedArchData:
    """Data of one of the simulations of 2023.

    Attributes
    ----------
    stiffness : float
        The pressure is ``stiffness u_nu`` up to u_nu = 0.1, and constant beyond.
    friction : float
        n of the friction bound ``h(u_nu) = n u_nu`` up to u_nu = 0.1, constant beyond.
    screws : int
        How many of the four screws hold: 4, or 1, the lower left one.
    """

    stiffness: float
    friction: float
    screws: int


#: The simulations of 2023.
SCREWED_ARCH_DATA: Mapping[str, ScrewedArchData] = MappingProxyType(
    {
        "four screws": ScrewedArchData(300.0, 3.0, 4),
        "one screw": ScrewedArchData(300.0, 3.0, 1),
        "friction": ScrewedArchData(300.0, 300.0, 1),
        "hard": ScrewedArchData(3000.0, 3.0, 1),
    }
)


def screwed_arch(data: str | ScrewedArchData = "four screws", n: int = 8) -> Evolution:
    """A viscoelastic arch that is screwed to a wall and pressed onto its foundation (Jureczka, Ochal, Bartman 2023).

    (0, 1.2) x (0, 0.6) without the disc of radius 0.3 about (0.6, 0) and four discs of radius 0.05, whose rims are
    clamped.  Lame constants lam = 100, mu = 40, viscosities 100 and 40; body force (0, -1), traction (-4, -4) on the
    top and on the right; contact at y = 0 on both feet.  Friction ``h(u_nu) (0.7 + 0.3 exp(-|u_tau'|))`` weakens with
    the rate of the slip.  The authors take steps of 1/128 up to t = 1/4.

    Parameters
    ----------
    data : str or ScrewedArchData
        A key of :data:`SCREWED_ARCH_DATA`.
    n : int
        Cells along the height; 4 or more.

    Returns
    -------
    Evolution

    Raises
    ------
    ProblemError
        Unknown data, or a mesh too coarse for the holes.
    """
    if isinstance(data, str):
        if data not in SCREWED_ARCH_DATA:
            raise ProblemError(f"there are no data '{data}'; choose one of {', '.join(SCREWED_ARCH_DATA)}")
        data = SCREWED_ARCH_DATA[data]
    if data.screws not in (1, 4):
        raise ProblemError(f"{data.screws} screws hold the arch; take 1 or 4")
    names = [f"screw {k}" for k in range(1, 5)]
    contact = Contact(
        Softening(data.stiffness, 0.1, 0.0),
        SlipWeakening(PenetrationBound(([0.0, 0.1], [0.0, 0.1 * data.friction])), of="rate"),
    )
    problem = ContactProblem(
        mesh=_arch(n),
        material=Material.lame(100.0, 40.0, viscosity=(100.0, 40.0)),
        supports={name: Clamped() for name in names[: data.screws]},
        body_force=(0.0, -1.0),
        tractions={"top": (-4.0, -4.0), "right": (-4.0, -4.0)},
        contact={"feet": contact},
        title="screwed arch",
    )
    return Evolution(problem)


def viscoelastic_beam(
    inertia: bool = True,
    n: int = 2,
    *,
    stiffness: float = 10.0,
    friction: Friction | None = None,
    force: tuple[float, float] = (-0.2, -0.2),
) -> Evolution:
    """A clamped viscoelastic body that sinks onto springs, with mass or without: the examples of conmech.

    (0, 2.5) x (0, 1), clamped at x = 0, contact at y = 0 with the pressure ``stiffness u_nu``; Lame constants 4 and 4,
    viscosities 4 and 4, density 1, body force (-0.2, -0.2).  The authors take squares of side 0.5 that are cut by their
    centres, and 32 steps of 0.1, without friction; their law of friction is ``bound ln(1 + |u_tau'|)``,
    :func:`hemivar.laws.Logarithmic`.

    Parameters
    ----------
    inertia : bool
    n : int
        Squares along the height.
    stiffness : float
        Of the springs.
    friction : Friction, optional
        Of the rate of the slip; none by default.
    force : (float, float)
        Per area.

    Returns
    -------
    Evolution
    """
    problem = ContactProblem(
        mesh=rectangle((2.5, 1.0), (round(2.5 * n), n), pattern="cross"),
        material=Material.lame(4.0, 4.0, density=1.0, viscosity=(4.0, 4.0)),
        supports={"left": Clamped()},
        contact={"bottom": Contact(Compliance(stiffness), NoFriction() if friction is None else friction)},
        body_force=force,
        title="viscoelastic beam on springs",
    )
    return Evolution(problem, inertia=inertia)


def _arch(n: int) -> Mesh:
    """Triangles between points of a lattice, of the outline and of the rims."""
    if n < 4:
        raise ProblemError(f"n = {n} cells along the height leave no room between the holes; take 4 or more")
    h = _HEIGHT / n
    columns, rows = round(_LENGTH / h), n
    x, y = np.meshgrid(np.linspace(0.0, _LENGTH, columns + 1), np.linspace(0.0, _HEIGHT, rows + 1), indexing="ij")
    lattice = np.column_stack([x.ravel(), y.ravel()])
    # Inner points are shifted by an amount that is no multiple of anything, so that no four lie on one circle.
    inner = (lattice > 1e-9).all(axis=1) & (lattice < [_LENGTH - 1e-9, _HEIGHT - 1e-9]).all(axis=1)
    number = np.arange(len(lattice))
    jitter = 0.08 * h * np.column_stack([np.sin(12.9898 * number), np.sin(78.233 * number + 1.0)])
    lattice[inner] += jitter[inner]
    away = np.ones(len(lattice), dtype=bool)
    rims = []
    for (centre, radius), half in ((_ARCH, True), *((screw, False) for screw in _SCREWS)):
        span = np.pi if half else 2.0 * np.pi
        count = max(round(span * radius / h), 6)
        angles = span * np.arange(count + half) / count
        rims.append(np.array(centre) + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
        room = radius + min(0.5 * h, 0.6 * span * radius / count)
        away &= np.linalg.norm(lattice - centre, axis=1) > room
    rims[0][[0, -1], 1] = 0.0
    points = np.concatenate([lattice[away], *rims])
    cells = Delaunay(points).simplices
    middle = points[cells].mean(axis=1)
    kept = np.ones(len(cells), dtype=bool)
    for centre, radius in (_ARCH, *_SCREWS):
        kept &= np.linalg.norm(middle - centre, axis=1) > radius
    edges = points[cells][:, 1:] - points[cells][:, :1]
    area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    kept &= area > 1e-6 * h**2
    used, renumbered = np.unique(cells[kept], return_inverse=True)
    mesh = Mesh.oriented(points[used], renumbered.reshape(-1, 3))

    def rim(centre: tuple[float, float], radius: float) -> object:
        return lambda x: np.linalg.norm(x - centre, axis=1) < 1.5 * radius

    return mesh.with_boundaries(
        {
            "feet": lambda x: x[:, 1] < 1e-9,
            "top": lambda x: x[:, 1] > _HEIGHT - 1e-9,
            "right": lambda x: x[:, 0] > _LENGTH - 1e-9,
            **{f"screw {k}": rim(*screw) for k, screw in enumerate(_SCREWS, 1)},  # type: ignore[dict-item]
        }
    )
