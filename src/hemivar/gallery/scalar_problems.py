"""Scalar problems with exact solutions, derived in the docstrings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.optimize import brentq

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.laws import Signorini, Tresca
from hemivar.mechanics import ContactProblem, ScalarContact, ScalarProblem
from hemivar.mechanics.foundation import Side
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mesh import rectangle

__all__ = ["KnownScalarProblem", "antiplane_friction", "membrane_obstacle", "membrane_radius"]


@dataclass(frozen=True, eq=False)
class KnownScalarProblem(ManufacturedProblem):
    """A scalar problem with its exact solution; it may be given wherever a problem is asked for.

    Attributes
    ----------
    problem : ContactProblem
    solution : callable
        Exact u, points (k, 2) -> (k,).
    gradient : callable
        Its gradient, points (k, 2) -> (k, 2).
    multiplier : callable
        Exact force on the foundation per area or length, points (k, 2) -> (k,).
    """

    problem: ContactProblem
    solution: Callable[[Array], Array]
    gradient: Callable[[Array], Array]
    multiplier: Callable[[Array], Array]

    @property
    def statement(self) -> ContactProblem:
        """The problem."""
        return self.problem


def membrane_radius(height: float, radius: float, load: float = 0.0) -> float:
    """Radius a of the contact of :func:`membrane_obstacle`: the root in (0, 1) of its equation.

    Parameters
    ----------
    height : float
        Of the hill.
    radius : float
        Of the hill.
    load : float
        Force per area, down.

    Returns
    -------
    float

    Raises
    ------
    ProblemError
        There is no contact inside the rim.
    """

    def off(a: float) -> float:
        c = load / 4.0
        return height - a**2 / (2.0 * radius) + (a**2 / radius + 2.0 * c * a**2) * log(a) + c * (1.0 - a**2)

    if not off(1e-12) > 0.0 > off(1.0 - 1e-12):
        raise ProblemError(
            f"a hill of height {height:g} and radius {radius:g} under the load {load:g} has no contact inside the rim; "
            "take height below 1 / (2 radius)"
        )
    return float(brentq(off, 1e-12, 1.0 - 1e-12, xtol=1e-15, rtol=1e-14))


@expecting(n=int, height=positive, radius=positive, load=float, tension=positive)
def membrane_obstacle(
    n: int = 32, *, height: float = 0.3, radius: float = 0.8, load: float = 0.5, tension: float = 1.0
) -> KnownScalarProblem:
    """A membrane that loads press on a hill: contact on a disc whose radius solves a transcendental equation.

    The membrane of tension T spans the unit disc, u = 0 at its rim, over the paraboloid ``psi = H - rho^2/(2R)``, under
    the load ``-T q`` per area.  For rho <= a it lies on the hill; outside ``T (u'' + u'/rho) = T q``, so
    ``u = A + B ln rho + c rho^2`` with ``c = q/4``.  It leaves the hill with its slope, ``B/a + 2 c a = -a/R``, at its
    height, ``A = psi(a) - B ln a - c a^2``, and u(1) = 0 gives the equation for a::

        H - a^2/(2R) + (a^2/R + 2 c a^2) ln a + c (1 - a^2) = 0.

    On the hill its force per area is ``T (2/R + q)``, elsewhere 0.  The mesh is that of the square (-s, s)^2,
    s = 1/sqrt(2), inside the disc, with u prescribed on its sides.

    Parameters
    ----------
    n : int
        Cells along a side.
    height, radius : float
        H and R; the hill must lie below the rim where it meets it, ``H < 1/(2R)``.
    load : float
        q, load per area over the tension.
    tension : float
        T.

    Returns
    -------
    KnownScalarProblem

    Raises
    ------
    ProblemError
        The contact reaches the rim.
    """
    H, R, T, c = height, radius, tension, load / 4.0
    a = membrane_radius(H, R, load)
    B = -(a**2) * (1.0 / R + 2.0 * c)
    A = H - a**2 / (2.0 * R) - B * log(a) - c * a**2
    half = 0.5**0.5
    if not a < half:
        raise ProblemError(f"the contact radius is {a:.4g}, and the mesh reaches to {half:.4g}; take a lower hill")

    def solution(points: Array) -> Array:
        rho = np.linalg.norm(points, axis=1)
        outside = A + B * np.log(np.maximum(rho, a)) + c * rho**2
        return np.asarray(np.where(rho <= a, H - rho**2 / (2.0 * R), outside))

    def gradient(points: Array) -> Array:
        rho = np.linalg.norm(points, axis=1)
        slope = np.where(rho <= a, -1.0 / R, B / np.maximum(rho, a) ** 2 + 2.0 * c)
        return np.asarray(slope[:, None] * points)

    def multiplier(points: Array) -> Array:
        return np.where(np.linalg.norm(points, axis=1) <= a, T * (2.0 / R + load), 0.0)

    rim = Formula(f"{A!r} + {0.5 * B!r}*log(x^2 + y^2) + {c!r}*(x^2 + y^2)")
    hill = Formula(f"{H!r} - {0.5 / R!r}*(x^2 + y^2)")
    problem = ScalarProblem(
        rectangle((2.0 * half, 2.0 * half), (n, n), origin=(-half, -half)),
        tension,
        area=ScalarContact(Signorini(), hill, Side.BELOW),
        supports=dict.fromkeys(("left", "right", "bottom", "top"), rim),
        source=-tension * load,
        title="A membrane on a hill",
    )
    return KnownScalarProblem(problem, solution, gradient, multiplier)


def antiplane_friction(
    n: int = 16, *, modulus: float = 2.0, bound: float = 1.0, opening: float = 0.2
) -> KnownScalarProblem:
    """A block that is sheared across its plane and slips on one half of its base.

    On (-1, 1) x (0, 1) with Tresca's bound g at the base y = 0 and the modulus mu, in polar coordinates::

        u = (g/mu) y + k r^(3/2) cos(3 phi/2)

    is harmonic.  On the base it vanishes for x < 0; there the friction ``mu u_y = g - (3/2) mu k sqrt(-x)`` is less
    than g as long as ``mu k < 4 g/3``: the block sticks.  For x > 0 the friction is g, and the slip ``k x^(3/2)`` has
    its direction.  On the other sides u is prescribed.

    Parameters
    ----------
    n : int
        Cells along the height.
    modulus, bound, opening : float
        mu, g and k, with ``0 < mu k < 4 g/3``.

    Returns
    -------
    KnownScalarProblem

    Raises
    ------
    ProblemError
        The solution by hand holds for other data.
    """
    mu, g, k = modulus, bound, opening
    if not 0.0 < mu * k < 4.0 * g / 3.0:
        raise ProblemError(
            f"modulus times opening is {mu * k:g}; it must lie between 0 and 4/3 of the bound, {4 * g / 3:g}"
        )

    def solution(points: Array) -> Array:
        x, y = points.T
        r = np.hypot(x, y)
        return np.asarray(g / mu * y + k * np.sqrt(np.maximum(r + x, 0.0) / 2.0) * (2.0 * x - r))

    def gradient(points: Array) -> Array:
        z = np.sqrt(points[:, 0] + 1j * np.abs(points[:, 1]))
        return np.column_stack([1.5 * k * z.real, g / mu - 1.5 * k * z.imag])

    def multiplier(points: Array) -> Array:
        return np.asarray(g - 1.5 * mu * k * np.sqrt(np.maximum(-points[:, 0], 0.0)))

    r = "sqrt(x^2 + y^2)"
    exact = Formula(f"{g / mu!r}*y + {k!r}*sqrt(max({r} + x, 0)/2)*(2*x - {r})")
    problem = ScalarProblem(
        rectangle((2.0, 1.0), (2 * n, n), origin=(-1.0, 0.0)),
        modulus,
        contact={"bottom": ScalarContact(Tresca(bound))},
        supports=dict.fromkeys(("left", "right", "top"), exact),
        kind=ScalarKind.ANTIPLANE,
        title="Antiplane shear with friction on the base",
    )
    return KnownScalarProblem(problem, solution, gradient, multiplier)
