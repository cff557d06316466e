"""Bodies of Hencky's material on a foundation, with solutions by equations in one variable, solved here apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.gallery.known import KnownProblem
from hemivar.laws import Compliance, Superpotential
from hemivar.mechanics import Contact, ContactProblem, Fixed, Material, Prescribed, Roller
from hemivar.mesh import Mesh, rectangle

__all__ = ["HenckyConstants", "hencky_block", "hencky_ring"]


@dataclass(frozen=True)
class HenckyConstants:
    """Constants of :meth:`Material.hencky`, and its stress in plane strain along the axes, for solutions by hand.

    Attributes
    ----------
    bulk, shear, softened, strain : float
    """

    bulk: float = 20.0 / 3.0
    shear: float = 4.0
    softened: float = 0.25
    strain: float = 0.05

    @property
    def material(self) -> Material:
        """The material."""
        return Material.hencky(self.bulk, self.shear, self.softened, self.strain)

    def stress(self, along: float, across: float) -> float:
        """The stress along one axis of strains along it and across it, with none out of the plane."""
        part, _ = self._shear(along, across)
        return self.bulk * (along + across) + part * (2.0 * along - across) / 3.0

    def slopes(self, along: float, across: float) -> tuple[float, float]:
        """The derivatives of :meth:`stress` by both strains."""
        part, rate = self._shear(along, across)
        first = self.bulk + 2.0 * part / 3.0 + rate * (2.0 * along - across) ** 2 * 2.0 / 9.0
        mixed = rate * (2.0 * along - across) * (2.0 * across - along) * 2.0 / 9.0
        return first, self.bulk - part / 3.0 + mixed

    def _shear(self, along: float, across: float) -> tuple[float, float]:
        """phi and its derivative by ``|dev eps|^2 = 2/3 (along^2 + across^2 - along across)``."""
        size = 1.0 + 2.0 / 3.0 * (along**2 + across**2 - along * across) / self.strain**2
        lost = 2.0 * self.shear * (1.0 - self.softened)
        return 2.0 * self.shear * self.softened + lost / np.sqrt(size), -0.5 * lost / self.strain**2 * size**-1.5


@expecting(law=Superpotential, n=int, pushed=positive, constants=HenckyConstants, order=int)
def hencky_block(
    law: Superpotential | None = None,
    n: int = 8,
    *,
    pushed: float = 0.1,
    constants: HenckyConstants | None = None,
    order: int = 1,
) -> KnownProblem:
    """A unit block of Hencky's material between smooth walls, whose top is pushed down by D onto a foundation.

    The strain is ``eps_yy = -(D - s)`` everywhere, s the penetration, and ``-sigma_yy(s - D) = j'(s)``.

    Parameters
    ----------
    law : Superpotential, optional
        Normal law with one value for each penetration; ``Compliance(20)`` by default, for which s = 0.034941569056.
    n : int
        Cells along each side.
    pushed : float
        D, positive.
    constants : HenckyConstants, optional
    order : int
        Polynomial degree of the elements.

    Returns
    -------
    KnownProblem

    Raises
    ------
    ProblemError
        The top is not pushed down.
    """
    law, hencky = Compliance(20.0) if law is None else law, constants or HenckyConstants()
    roots = _roots(lambda r, _: -hencky.stress(r - pushed, 0.0) - _pressure(law, r), pushed)
    if not roots:
        raise ProblemError("the law presses nowhere as hard as the block; give one that does, such as a compliance")
    s = roots[0]
    pressure = -hencky.stress(s - pushed, 0.0)

    def displacement(x: Array) -> Array:
        y = x[:, 1]
        return np.column_stack([np.zeros_like(y), -s - (pushed - s) * y])

    problem = ContactProblem(
        mesh=rectangle((1.0, 1.0), n),
        material=hencky.material,
        contact={"bottom": Contact(law)},
        supports={"left": Roller(), "right": Roller(), "top": Fixed(y=-pushed)},
        order=order,
        title="block of Hencky's material",
    )
    return KnownProblem(problem, displacement, lambda x: np.full(len(x), pressure))


@expecting(law=Superpotential, n=int, pushed=positive, constants=HenckyConstants, order=int)
def hencky_ring(
    law: Superpotential | None = None,
    n: int = 16,
    *,
    pushed: float = 0.1,
    constants: HenckyConstants | None = None,
    order: int = 1,
) -> KnownProblem:
    """A ring 1 < r < 2 of Hencky's material whose outer side is pushed inwards by D, on a foundation at its inner side.

    The displacement is radial, and ``(r sigma_r)' = sigma_t`` with the strains u' and u/r. From a penetration
    ``s = -u(1)`` the law gives ``sigma_r(1) = -j'(s)``, and the equation is integrated outwards; the solutions are the
    zeros of ``u(2) + D``. The plane deviator in place of that of space gives other numbers here.

    Parameters
    ----------
    law : Superpotential, optional
        Normal law with one value for each penetration; ``Compliance(2)`` by default, for which s = 0.0949739517132.
        ``Softening(40, 0.02, 25)`` has three solutions for D = 0.055.
    n : int
        Cells along the radius of a quarter of it; twice as many along the arc.
    pushed : float
        D, positive.
    constants : HenckyConstants, optional
    order : int
        Polynomial degree of the elements.

    Returns
    -------
    KnownProblem
        The solution with the least penetration, and then the others.

    Raises
    ------
    ProblemError
        The ring is not pushed inwards.
    """
    law, hencky = Compliance(2.0) if law is None else law, constants or HenckyConstants()
    roots = _roots(lambda s, rough: _displacement(hencky, law, s, [2.0], rough)[0] + pushed, 2.0 * pushed)

    def inwards(points: Array) -> Array:
        return np.asarray(-pushed * points / np.linalg.norm(points, axis=1)[:, None], dtype=float)

    problem = ContactProblem(
        mesh=_quarter_ring(n),
        material=hencky.material,
        contact={"left": Contact(law)},
        supports={"bottom": Roller(), "top": Roller(), "right": Prescribed(inwards)},
        order=order,
        title="ring of Hencky's material",
    )

    def known(s: float) -> KnownProblem:
        def displacement(x: Array) -> Array:
            r = np.linalg.norm(x, axis=1)
            radii, back = np.unique(r, return_inverse=True)
            return np.asarray(x * (_displacement(hencky, law, s, radii.tolist())[back] / r)[:, None])

        return KnownProblem(problem, displacement, lambda x: np.full(len(x), _pressure(law, s)))

    first, *others = (known(s) for s in roots)
    return replace(first, others=tuple(others))


def _pressure(law: Superpotential, s: float) -> float:
    return float(law.at(np.zeros((1, 2))).derivative(np.array([s]))[0])


def _displacement(
    hencky: HenckyConstants, law: Superpotential, s: float, radii: Sequence[float], rough: bool = False
) -> Array:
    """Radial displacements of the ring at increasing radii from 1 on, from the penetration at its inner side."""
    pressure = _pressure(law, s)
    reach = 1.0 + 10.0 * abs(s) + pressure / hencky.bulk
    start = brentq(lambda slope: hencky.stress(slope, -s) + pressure, -reach, reach, xtol=1e-15)

    def rate(r: float, at: Array) -> list[float]:
        u, slope = at
        hoop = u / r
        by_slope, by_hoop = hencky.slopes(slope, hoop)
        balance = hencky.stress(slope, hoop) - hencky.stress(hoop, slope)
        return [slope, -(balance / r + by_hoop * (slope - hoop) / r) / by_slope]

    end, rtol = max(radii[-1], 1.0 + 1e-9), 1e-6 if rough else 1e-13
    path = solve_ivp(rate, (1.0, end), [-s, start], "DOP853", dense_output=True, rtol=rtol, atol=1e-2 * rtol)
    return np.asarray(path.sol(np.asarray(radii))[0])


def _roots(function: Callable[[float, bool], float], last: float) -> list[float]:
    """All zeros between 0 and a number: signs at 200 numbers between them bracket each, where values may be rough."""
    if not 0.0 < last < np.inf:
        raise ProblemError(f"pushed is {last:g}; it must be positive, so that there is contact")
    tried = np.linspace(0.0, last, 201)[1:].tolist()
    signs = np.sign([function(s, True) for s in tried])
    return [
        float(brentq(lambda s: function(s, False), tried[i], tried[i + 1], xtol=1e-15, rtol=1e-14))
        for i in np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
    ]


def _quarter_ring(cells: int) -> Mesh:
    """``left`` is the inner side, ``right`` the outer one, ``bottom`` and ``top`` are the cuts."""
    flat = rectangle((1.0, 0.5 * np.pi), (cells, 2 * cells), origin=(1.0, 0.0))
    r, angle = flat.points.T
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    points[np.abs(points) < 1e-14] = 0.0
    return Mesh(points, flat.cells, boundaries=dict(flat.boundaries))
