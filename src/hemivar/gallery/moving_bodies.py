"""Bodies in motion and in friction whose answers are known: bars, a cantilever, a manufactured motion, spheres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import asinh, ceil, cos, pi, sin
from types import MappingProxyType
from typing import Literal

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution
from hemivar.laws import Compliance, NoContact, Signorini, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Prescribed, Roller
from hemivar.mechanics.conditions import Support
from hemivar.mesh import Mesh, box, rectangle

__all__ = [
    "CANTILEVER",
    "ManufacturedMotion",
    "MindlinSphere",
    "bar_on_wall",
    "moving_bar",
    "thrown_bar",
    "viscoelastic_cantilever",
]


def moving_bar(
    cells: int,
    contact: Contact | None = None,
    *,
    modulus: float = 1.0,
    density: float = 1.0,
    clamped: bool = False,
    velocity: float = 0.0,
    stretched: float = 0.0,
    mass: str = "consistent",
) -> Evolution:
    """A bar of length one along y, a column of squares between rollers; its lower end is ``bottom``.

    Parameters
    ----------
    cells : int
        Squares; the bar is 1/cells wide.
    contact : Contact, optional
        At the bottom.
    modulus, density : float
        Uniaxial modulus and density.
    clamped : bool
        Whether the upper end is held.
    velocity : float
        Downwards, at the start.
    stretched : float
        Displacement of the lower end at the start, the upper one being where it was.
    mass : str
        As in :class:`~hemivar.Evolution`.

    Returns
    -------
    Evolution
    """
    supports: dict[str, Support] = {"left": Roller(), "right": Roller()}
    if clamped:
        supports["top"] = Clamped()

    def initial(x: Array) -> Array:
        return np.stack([0.0 * x[:, 0], stretched * (1.0 - x[:, 1])], axis=1)

    problem = ContactProblem(
        mesh=rectangle((1.0 / cells, 1.0), (1, cells)),
        material=Material.lame(0.0, 0.5 * modulus, density=density),
        supports=supports,
        contact={} if contact is None else {"bottom": contact},
    )
    return Evolution(
        problem,
        inertia=True,
        displacement=initial if stretched else None,
        velocity=(0.0, -velocity) if velocity else None,
        mass=mass,  # type: ignore[arg-type]
    )


def bar_on_wall(cells: int, mass: str = "redistributed") -> Evolution:
    """A bar that is let go stretched by 1/2 and hits a rigid wall (Doyen, Ern, Piperno, 10.1137/100791440).

    L = E = rho = 1, fixed at the far end, ``u(x, 0) = (1 - x)/2`` at rest.  The end moves as ``(1 - t)/2`` and reaches
    the wall at 0 when t = 1; there it stays with the pressure 1/2 until t = 2, and goes back to 1/2 by t = 3, the
    period.  No energy is lost.

    Parameters
    ----------
    cells : int
    mass : str
        ``"redistributed"`` for schemes without a law of impact.

    Returns
    -------
    Evolution
    """
    return moving_bar(cells, Contact(Signorini()), clamped=True, stretched=0.5, mass=mass)


def thrown_bar(cells: int) -> Evolution:
    """A bar that is thrown onto a spring: E = 12, rho = 3, L = 1, velocity 0.1, spring 24 per area.

    Waves of the speed c = 2 carry the impedance z = 6: ``z r' = z v0 - p(t) - 2 sum_k p(t - 2 k L/c)``, ``p = 24 r``,
    so that ``r(1) = 0.025 (1 - exp(-4))`` when the first wave comes back, and the bar leaves at t = 1.41821665.

    Parameters
    ----------
    cells : int
        In its length.

    Returns
    -------
    Evolution
    """
    return moving_bar(cells, Contact(Compliance(24.0)), modulus=12.0, density=3.0, velocity=0.1)


#: What :func:`viscoelastic_cantilever` has done after 32 steps of 0.1 by implicit Euler, computed apart from this code:
#: displacement of the node (2.5, 0) with mass and without, and the ledger with mass.
CANTILEVER: Mapping[str, tuple[float, float] | Mapping[str, float]] = MappingProxyType(
    {
        "with mass": (0.20666963, 0.89704124),
        "without": (0.2371944, 1.01936226),
        "ledger": MappingProxyType(
            {
                "work": 0.196662003127,
                "elastic": 0.083057848838,
                "viscous": 0.060053022992,
                "kinetic": 0.047717078193,
                "numerical": 0.005834053104,
            }
        ),
    }
)


def viscoelastic_cantilever(inertia: bool = True) -> Evolution:
    """The cantilever of :func:`beam`, of density 1 and with the viscosities 4 and 4: see :data:`CANTILEVER`.

    Parameters
    ----------
    inertia : bool
        Whether it has mass.

    Returns
    -------
    Evolution
    """
    problem = ContactProblem(
        mesh=rectangle((2.5, 1.0), (5, 2), pattern="cross"),
        material=Material.lame(4.0, 4.0, density=1.0, viscosity=(4.0, 4.0)),
        supports={"left": Clamped()},
        body_force=(0.0, 0.2),
        title="viscoelastic cantilever",
    )
    return Evolution(problem, inertia=inertia)


@dataclass(frozen=True)
class ManufacturedMotion:
    """``u = sin(t) (2 x y + x y^2, -x^2 (1 + y))/20`` on (0, 2) x (0, 1), on springs with dampers.

    The strains are ``eps_xx = T (2 y + y^2)/20``, ``eps_yy = -T x^2/20``, ``eps_xy = 0``, T = sin t.  On the base y = 0
    the pressure is ``(lam + 2 mu) u_nu + (lam_v + 2 mu_v) u_nu'``, which springs and dampers of these moduli carry as
    long as T and T' are positive; there is no friction.  ``-div sigma = (lam T + lam_v T') (x, -(1 + y))/10``, to which
    the force adds ``rho u''``.  The body is clamped at x = 0, where u = 0; the right and the top bear the tractions.

    Attributes
    ----------
    lam, mu, lam_v, mu_v, density : float
    """

    lam: float = 2.0
    mu: float = 1.0
    lam_v: float = 0.5
    mu_v: float = 0.3
    density: float = 1.5

    def displacement(self, x: Array, t: float) -> Array:
        """Exact displacement, points (k, 2) -> (k, 2)."""
        return sin(t) * _shape(x)

    def pressure(self, x: Array, t: float) -> Array:
        """Exact pressure on the base, points (k, 2) -> (k,)."""
        rate = (self.lam + 2.0 * self.mu) * sin(t) + (self.lam_v + 2.0 * self.mu_v) * cos(t)
        return np.asarray(rate * x[:, 0] ** 2 / 20.0)

    def evolution(self, n: int, *, order: int = 1, pattern: Literal["cross", "right", "left"] = "right") -> Evolution:
        """The problem, for times of (0, pi/2).

        Parameters
        ----------
        n : int
            Cells along the height; twice as many along the length.
        order : int
            Of the elements.
        pattern : str
            How squares are cut.
        """

        def stress(x: Array, t: float) -> tuple[Array, Array]:
            along, across = (2.0 * x[:, 1] + x[:, 1] ** 2) / 20.0, -(x[:, 0] ** 2) / 20.0
            lam = self.lam * sin(t) + self.lam_v * cos(t)
            mu = self.mu * sin(t) + self.mu_v * cos(t)
            both = lam * (along + across)
            return both + 2.0 * mu * along, both + 2.0 * mu * across

        def right(x: Array, t: float) -> Array:
            return np.stack([stress(x, t)[0], 0.0 * x[:, 0]], axis=1)

        def top(x: Array, t: float) -> Array:
            return np.stack([0.0 * x[:, 0], stress(x, t)[1]], axis=1)

        def force(x: Array, t: float) -> Array:
            elastic = np.stack([x[:, 0], -(1.0 + x[:, 1])], axis=1) / 10.0
            inert = -self.density * sin(t) * _shape(x)
            return np.asarray(inert + (self.lam * sin(t) + self.lam_v * cos(t)) * elastic)

        problem = ContactProblem(
            mesh=rectangle((2.0, 1.0), (2 * n, n), pattern=pattern),
            material=Material.lame(self.lam, self.mu, density=self.density, viscosity=(self.lam_v, self.mu_v)),
            supports={"left": Clamped()},
            tractions={"right": right, "top": top},
            body_force=force,
            contact={
                "bottom": Contact(
                    Compliance(self.lam + 2.0 * self.mu), damping=Compliance(self.lam_v + 2.0 * self.mu_v)
                )
            },
            order=order,
            title="manufactured motion on springs and dampers",
        )
        return Evolution(problem, inertia=True, velocity=_shape)


def _shape(x: Array) -> Array:
    return np.asarray(
        np.stack([2.0 * x[:, 0] * x[:, 1] + x[:, 0] * x[:, 1] ** 2, -(x[:, 0] ** 2) * (1.0 + x[:, 1])], axis=1) / 20.0
    )


@dataclass(frozen=True)
class MindlinSphere:
    """A sphere pressed onto a rigid plane and rubbed to and fro (Mindlin and Deresiewicz 1953): the loss of a cycle.

    Under the normal force P with Hertz's pressure and friction mu the tangential force Q shifts the sphere by
    ``3 mu P/(16 a G*) (1 - (1 - Q/(mu P))^(2/3))`` when it grows first; turned back from Q* it moves twice as far for
    twice the force (Masing), so that a cycle between -Q* and Q* loses

        9 mu^2 P^2/(10 a G*) (1 - (1 - x)^(5/3) - (5 x/6) (1 + (1 - x)^(2/3))),    x = Q*/(mu P),    G* = G/(2 - nu).

    The theory is that of two half spaces under given pressure; it takes friction along the force only, and leaves out
    what tangential tractions do to the pressure.

    Attributes
    ----------
    radius : float
        a, of the contact.
    peak : float
        p0, Hertz's largest pressure.
    friction : float
        mu.
    shear, poisson : float
        G and nu.
    """

    radius: float = 1.0
    peak: float = 0.03
    friction: float = 0.5
    shear: float = 1.0
    poisson: float = 0.3

    @property
    def force(self) -> float:
        """P."""
        return 2.0 / 3.0 * pi * self.radius**2 * self.peak

    @property
    def compliant(self) -> float:
        """G*."""
        return self.shear / (2.0 - self.poisson)

    def shift(self, share: float) -> float:
        """Displacement under the force ``share`` mu P that grows for the first time."""
        slid = float(1.0 - (1.0 - share) ** (2.0 / 3.0))
        return 3.0 * self.friction * self.force / (16.0 * self.radius * self.compliant) * slid

    def loss(self, share: float) -> float:
        """Heat of a cycle between the forces ``-share`` and ``share`` times mu P."""
        rest = 1.0 - share
        loop = float(1.0 - rest ** (5.0 / 3.0) - 5.0 * share / 6.0 * (1.0 + rest ** (2.0 / 3.0)))
        return 0.9 * (self.friction * self.force) ** 2 / (self.radius * self.compliant) * loop

    def evolution(self, cells: float, share: float = 0.7, *, sides: float = 8.0) -> Evolution:
        """A quarter of a cube under Hertz's pressure, whose far sides go to and fro once in a time of 5.

        The displacement of the far sides goes from 0 to its largest value at t = 1, to the opposite at t = 3 and back
        at t = 5, so that the cycle is that from t = 1 on.  Nothing but a multiple of the closed form is prescribed; the
        force that comes of it is to be measured.  Symmetric about y = 0, antisymmetric about x = 0.

        Parameters
        ----------
        cells : float
            Cells along the radius of the contact; growing steadily outside.
        share : float
            Force that is aimed at, over mu P; it comes out smaller, for the cube is softer than its middle.
        sides : float
            Length of a side of the cube, over the radius.
        """
        if not 0.0 < share < 1.0:
            raise ProblemError(f"share = {share:g}: give the part of the force of full slip, between 0 and 1")
        largest = self.shift(share)
        a = self.radius

        def bound(x: Array) -> Array:
            square = 1.0 - (x[:, :2] ** 2).sum(axis=1) / a**2
            return np.asarray(self.friction * self.peak * np.sqrt(np.maximum(square, 0.0)))

        def far(x: Array, t: float) -> Array:
            part = t if t <= 1.0 else 2.0 - t if t <= 3.0 else t - 4.0
            return np.tile([largest * part, 0.0, 0.0], (len(x), 1))

        problem = ContactProblem(
            mesh=_quarter(a, cells, sides * a),
            material=Material.lame(2.0 * self.shear * self.poisson / (1.0 - 2.0 * self.poisson), self.shear),
            supports={"far": Prescribed(far), "left": Fixed(y=0.0, z=0.0), "front": Fixed(y=0.0)},
            contact={"contact": Contact(NoContact(), Tresca(bound))},
            title="sphere rubbed to and fro",
        )
        return Evolution(problem)


def _quarter(fine: float, cells: float, side: float) -> Mesh:
    """[0, side]^3, graded towards the origin; ``contact`` lies within 1.3 of the radius."""
    steep = asinh(side / fine)
    count = ceil(cells * steep)
    grid = side * np.sinh(steep * np.linspace(0.0, 1.0, count + 1)) / np.sinh(steep)
    even = box((1.0, 1.0, 1.0), count)
    mesh = Mesh(grid[np.rint(even.points * count).astype(int)], even.cells, {})
    small = 1e-9 * side
    return mesh.with_boundaries(
        {
            "left": lambda x: x[:, 0] < small,
            "front": lambda x: x[:, 1] < small,
            "far": lambda x: (np.abs(x[:, :2]) > side - small).any(axis=1) | (x[:, 2] > side - small),
            "contact": lambda x: (x[:, 2] < small) & (np.linalg.norm(x[:, :2], axis=1) < 1.5 * fine),
        }
    )
