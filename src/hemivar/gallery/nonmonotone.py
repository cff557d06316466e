"""Nonmonotone problems: of the literature, and with known solutions.

*Jureczka and Ochal* is doi 10.1007/s00245-019-09593-y; the solutions are derived in the docstrings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import scipy.sparse as sp
from scipy.special import lambertw

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.gallery.known import KnownProblem, column, elastic_bar_penetrations
from hemivar.laws import (
    Bilateral,
    Capped,
    ContactLaw,
    Logarithmic,
    PenetrationBound,
    SawTooth,
    SlipWeakening,
    Softening,
)
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Prescribed
from hemivar.mesh import rectangle

__all__ = [
    "broken_foundation",
    "delamination",
    "manufactured_softening",
    "shear_block",
    "shear_block_slips",
    "shear_column",
    "softening_block",
]


def broken_foundation(n: int = 16, pattern: Literal["cross", "right", "left"] = "cross") -> ContactProblem:
    """A body on a foundation that breaks, with friction that depends on the penetration (Jureczka and Ochal 2019).

    (0, 2) x (0, 1), clamped at x = 0, contact at y = 0, Lame constants 4 and 4, body force (-1.2, -0.9). The normal
    potential is 0 for s < 0, 10 s^2 up to s = 0.1 and 0.1 beyond: the pressure drops from 2 to 0. The friction
    potential is ``h(s) ln(1 + |u_tau|)`` with h(s) = 0, 8 s, 0.8 on the same three pieces, so that the functional
    has two arguments. There is a solution that the foundation supports, and one that has broken through.

    Parameters
    ----------
    n : int
        Cells along the height; twice as many along the length.
    pattern : {"cross", "right", "left"}
        How the cells are cut into triangles.

    Returns
    -------
    ContactProblem
    """
    bound = PenetrationBound(([0.0, 0.1], [0.0, 0.8]))
    return ContactProblem(
        mesh=rectangle((2.0, 1.0), (2 * n, n), pattern=pattern),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(Capped(20.0, 0.1), Logarithmic(bound))},
        supports={"left": Clamped()},
        body_force=(-1.2, -0.9),
        title="foundation that breaks (Jureczka and Ochal 2019)",
    )


def delamination(
    n: int = 4,
    *,
    length: float = 1.0,
    stress: float = 1.0,
    plane: Literal["stress", "strain"] = "stress",
    pattern: Literal["cross", "right", "left"] = "cross",
) -> ContactProblem:
    """A strip glued to a rigid ground and pulled off it (after Makela et al. 1998).

    80 mm x 10 mm, clamped at x = 0, glued along the bottom, pulled up with 26.2e3 kN/m^2 on the top;
    E = 1.378e8 kN/m^2, nu = 0.3. The glue's tension against the opening w (in m) is ``60e6 w`` up to 0.5 mm,
    ``20e6 w + 10e3`` up to 1 mm, ``10e6 w + 5e3`` up to 2 mm and then none: three downward jumps. The ground cannot be
    penetrated, and there is no friction.

    Parameters
    ----------
    n : int
        Cells along the height; eight times as many along the length.
    length, stress : float
        A metre and a kN/m^2 in the units wanted: ``length=1e3, stress=1e-3`` gives mm and MPa.
    plane : {"stress", "strain"}
    pattern : {"cross", "right", "left"}
        How the cells are cut into triangles.

    Returns
    -------
    ContactProblem
    """
    m, kpa = length, stress
    glue = SawTooth(
        [0.5e-3 * m, 1e-3 * m, 2e-3 * m], [60e6 * kpa / m, 20e6 * kpa / m, 10e6 * kpa / m], [0.0, 10e3 * kpa, 5e3 * kpa]
    )
    return ContactProblem(
        mesh=rectangle((0.08 * m, 0.01 * m), (8 * n, n), pattern=pattern),
        material=Material.young(1.378e8 * kpa, 0.3, plane=plane),
        contact={"bottom": Contact(glue)},
        supports={"left": Clamped()},
        tractions={"top": (0.0, 26.2e3 * kpa)},
        title="delamination of a strip (Makela et al. 1998)",
    )


def softening_block(
    stiffness: float = 30.0,
    limit: float = 0.05,
    softening: float = 6.0,
    n: int = 8,
    *,
    top_displacement: float = 0.2,
    width: float = 1.0,
    height: float = 1.0,
    lame: tuple[float, float] = (4.0, 4.0),
) -> KnownProblem:
    """A block between frictionless walls pushed by its top onto softening springs: all its uniform solutions.

    As the patch version of :func:`weighted_block`, with ``kappa (D - s) in dj(s)`` for a :class:`Softening` law; every
    solution s is uniform and its displacement linear, ``u_y = -s - (D - s) y/b``. The one with the smallest s is
    returned, and the others are its ``others``, in the order of s; there is one if softening < kappa = (lam + 2 mu)/b,
    otherwise up to three (and then others that are not uniform).

    Parameters
    ----------
    stiffness, limit, softening : float
        Of the springs.
    n : int
        Cells along each side.
    top_displacement : float
        D, downwards.
    width, height : float
        a and b.
    lame : (float, float)
        lam and mu.

    Returns
    -------
    KnownProblem
    """
    lam, mu = lame
    kappa = (lam + 2.0 * mu) / height
    problem = ContactProblem(
        mesh=rectangle((width, height), n, pattern="cross"),
        material=Material.lame(lam, mu),
        contact={"bottom": Contact(Softening(stiffness, limit, softening))},
        supports={"left": Fixed(x=0.0), "right": Fixed(x=0.0), "top": Prescribed((0.0, -top_displacement))},
        title="block on softening springs",
    )

    def known(s: float) -> KnownProblem:
        def displacement(x: Array) -> Array:
            return np.column_stack([np.zeros(len(x)), -s - (top_displacement - s) * x[:, 1] / height])

        return KnownProblem(problem, displacement, lambda x: np.full(len(x), kappa * (top_displacement - s)))

    roots = elastic_bar_penetrations(kappa, top_displacement, stiffness, limit, softening)
    first, *others = (known(s) for s in roots)
    return replace(first, others=tuple(others))


def shear_block_slips(
    kappa: float, free: float, bound: float, static: float = 1.0, kinetic: float = 0.7, rate: float = 1.0
) -> tuple[float, ...]:
    """All slips w >= 0 of a block with slip-weakening friction: ``kappa (w0 - w) in bound dj(w)``, w0 >= 0.

    With j'(w) = kinetic + (static - kinetic) exp(-rate w) for w > 0, ``c = w0 - kinetic bound/kappa`` and
    ``q = (static - kinetic) bound/kappa`` the slipping solutions are ``w = c + W(-rate q exp(-rate c))/rate`` on both
    real branches of Lambert's function, as far as they are positive; w = 0 is one if ``kappa w0 <= static bound``.

    Parameters
    ----------
    kappa : float
        Stiffness against slip (force per area and length).
    free : float
        w0, the slip without friction.
    bound, static, kinetic, rate : float
        Of :func:`hemivar.laws.SlipWeakening`, static > kinetic.

    Returns
    -------
    tuple of float

    Raises
    ------
    ProblemError
        The numbers make no sense.
    """
    if not (kappa > 0.0 and free >= 0.0 and static > kinetic and rate > 0.0):
        raise ProblemError(
            f"shear_block_slips(kappa={kappa}, free={free}, static={static}, kinetic={kinetic}, rate={rate}): "
            "kappa and rate must be positive, free at least 0 and static above kinetic"
        )
    c = free - kinetic * bound / kappa
    drop = rate * (static - kinetic) * bound / kappa
    slips = [0.0] if kappa * free <= static * bound else []
    argument = -drop * np.exp(-rate * c)
    if argument >= -np.exp(-1.0):
        for branch in (-1, 0):
            slip = c + float(lambertw(argument, branch).real) / rate
            if slip > 0.0:
                slips.append(slip)
    return tuple(sorted(set(slips)))


def shear_column(
    bound: float = 1.0,
    elements: int = 8,
    *,
    shear_modulus: float = 4.0,
    height: float = 1.0,
    load: float = 2.0,
    static: float = 1.0,
    kinetic: float = 0.7,
    rate: float = 1.0,
) -> DiscreteProblem:
    """The shear block with one contact point, as a problem made of arrays; see :func:`shear_block`.

    ``-mu u'' = f`` on (0, b), u(b) = 0, friction at y = 0, where the body cannot move normally. Linear elements are
    exact at the nodes; the slips are those of :func:`shear_block_slips` with kappa = mu/b and w0 = f b^2/(2 mu).

    Parameters
    ----------
    bound : float
        Force per area.
    elements : int
        In the height.
    shear_modulus : float
    height : float
    load : float
        Force at the upper end.
    static : float
        Of friction that weakens, as the next two.
    kinetic : float
    rate : float

    Returns
    -------
    DiscreteProblem
    """
    stiffness, forces = column(elements, shear_modulus, height, load)
    foot = np.zeros((1, 2))
    law = ContactLaw(Bilateral(), SlipWeakening(bound, static, kinetic, rate))
    return DiscreteProblem.of_arrays(
        stiffness=stiffness[::-1, ::-1],
        load=forces[::-1],
        trace=sp.csr_array(([1.0], ([1], [0])), shape=(2, elements)),
        weights=np.ones(1),
        gap=np.zeros(1),
        law=law.at(foot),
        points=foot,
    )


def shear_block(
    bound: float = 0.5,
    n: int = 8,
    *,
    width: float = 1.0,
    height: float = 1.0,
    load: float = 2.4,
    lame: tuple[float, float] = (4.0, 4.0),
    static: float = 1.0,
    kinetic: float = 0.7,
    rate: float = 1.0,
    order: int = 2,
) -> KnownProblem:
    """A block sheared along its base against friction that weakens with the slip: all its uniform solutions.

    On (0, a) x (0, b), no normal displacement at y = 0, top fixed, body force (f, 0) and the side tractions
    ``(0, +-sigma_xy)`` that keep everything a function of y: with ``kappa = mu/b`` and ``w0 = f b^2/(2 mu)`` the slip w
    solves ``kappa (w0 - w) in bound dj_tau(w)`` (:func:`shear_block_slips`) and
    ``u_x = w + (T y - f y^2/2)/mu``, ``T = kappa (w0 - w)``, ``sigma_xy = T - f y``.

    The side tractions belong to the solution, so that problems differ; the one with the smallest slip is returned, and
    the others are its ``others``, in the order of the slip. :class:`KnownProblem`'s pressure is zero; T is the
    friction. Elements of order 2, the default, hold the solutions exactly.

    Parameters
    ----------
    bound : float
        Force per area.
    n : int
        Cells on each side.
    width : float
    height : float
    load : float
        Traction on the upper face.
    lame : tuple of two floats
        Lame constants.
    static : float
        Of :class:`~hemivar.laws.SlipWeakening`, as the next two.
    kinetic : float
    rate : float
    order : int
        Of the elements, 1 or 2.

    Returns
    -------
    KnownProblem
    """
    lam, mu = lame
    kappa, free = mu / height, load * height**2 / (2.0 * mu)

    def known(slip: float) -> KnownProblem:
        friction = kappa * (free - slip)

        def displacement(x: Array) -> Array:
            y = x[:, 1]
            return np.column_stack([slip + (friction * y - 0.5 * load * y**2) / mu, np.zeros_like(y)])

        def side(sign: float) -> Callable[[Array], Array]:
            return lambda x: np.column_stack([np.zeros(len(x)), sign * (friction - load * x[:, 1])])

        problem = ContactProblem(
            mesh=rectangle((width, height), n, pattern="cross"),
            material=Material.lame(lam, mu),
            contact={"bottom": Contact(Bilateral(), SlipWeakening(bound, static, kinetic, rate))},
            supports={"top": Clamped()},
            body_force=(load, 0.0),
            tractions={"left": side(-1.0), "right": side(1.0)},
            title=f"shear block, slip {slip:g}",
            order=order,
        )
        return KnownProblem(problem, displacement, lambda x: np.zeros(len(x)))

    first, *others = (known(slip) for slip in shear_block_slips(kappa, free, bound, static, kinetic, rate))
    return replace(first, others=tuple(others))


def manufactured_softening(n: int = 8, pattern: Literal["cross", "right", "left"] = "right") -> KnownProblem:
    """A smooth manufactured solution on a foundation that softens, with sticking and slipping friction.

    On (0, 2) x (0, 1), clamped at x = 0, lam = mu = 40. The penetration at y = 0 is ``S = 0.05 (1 + (x - 1)^3)``: the
    pressure p(S) of ``Softening(4, 0.05, 1.5)`` rises for x < 1 and falls for x > 1. The slip is
    ``u_x = T = -0.06 max(x - 1/2, 0)^3``; the friction is ``L = -8 (0.7 + 0.3 exp(-2 |T|) - 2 max(1/2 - x, 0)^3)``,
    that of ``SlipWeakening(8, rate=2)`` where the body slips and less than its bound where it sticks. With
    ``A = -(p(S) + lam T')/(lam + 2 mu)`` and ``B = S' + L/mu``

        u = (T + y B, -S + y A)

    has these contact stresses and vanishes at x = 0. Crossings of kinks happen where S' = S'' = 0 or T' = T'' = 0, so
    that A and B have bounded second derivatives and the body force is bounded. The margin is about 0.4.

    Parameters
    ----------
    n : int
        Cells along the height; twice as many along the length. Take it even: the kinks are then at nodes.
    pattern : {"cross", "right", "left"}
        How the cells are cut into triangles.

    Returns
    -------
    KnownProblem
    """
    lam = mu = 40.0
    modulus = lam + 2.0 * mu
    k, limit, alpha, bound, rate, gain = 4.0, 0.05, 1.5, 8.0, 2.0, 0.3

    def parts(x: Array) -> tuple[tuple[Array, ...], ...]:
        """S, T, A, B with their first two derivatives along the base."""
        t, a, z = x[:, 0] - 1.0, np.maximum(x[:, 0] - 0.5, 0.0), np.maximum(0.5 - x[:, 0], 0.0)
        S = (limit * (1.0 + t**3), 3 * limit * t**2, 6 * limit * t, np.full_like(t, 6 * limit))
        T = (-0.06 * a**3, -0.18 * a**2, -0.36 * a, np.where(a > 0.0, -0.36, 0.0))
        slope = np.where(t <= 0.0, k, -alpha)
        p = (k * limit + slope * (S[0] - limit), slope * S[1], slope * S[2])
        fading = gain * np.exp(rate * T[0])
        L = (
            -bound * (1.0 - gain + fading - 2 * z**3),
            -bound * (rate * T[1] * fading + 6 * z**2),
            -bound * ((rate * T[2] + rate**2 * T[1] ** 2) * fading - 12 * z),
        )
        A = tuple(-(p[i] + lam * T[i + 1]) / modulus for i in range(3))
        B = tuple(S[i + 1] + L[i] / mu for i in range(3))
        return S, T, A, B

    def displacement(x: Array) -> Array:
        S, T, A, B = parts(x)
        return np.column_stack([T[0] + x[:, 1] * B[0], -S[0] + x[:, 1] * A[0]])

    def stress(x: Array) -> tuple[Array, Array, Array]:
        S, T, A, B = parts(x)
        y = x[:, 1]
        along, across = T[1] + y * B[1], A[0]
        return modulus * along + lam * across, lam * along + modulus * across, mu * (B[0] - S[1] + y * A[1])

    def body_force(x: Array) -> Array:
        S, T, A, B = parts(x)
        y = x[:, 1]
        fx = modulus * (T[2] + y * B[2]) + (lam + mu) * A[1]
        fy = mu * (B[1] - S[2] + y * A[2]) + lam * B[1]
        return -np.column_stack([fx, fy])

    def on_right(x: Array) -> Array:
        sxx, _, sxy = stress(x)
        return np.column_stack([sxx, sxy])

    def on_top(x: Array) -> Array:
        _, syy, sxy = stress(x)
        return np.column_stack([sxy, syy])

    problem = ContactProblem(
        mesh=rectangle((2.0, 1.0), (2 * n, n), pattern=pattern),
        material=Material.lame(lam, mu),
        contact={"bottom": Contact(Softening(k, limit, alpha), SlipWeakening(bound, rate=rate))},
        supports={"left": Clamped()},
        body_force=body_force,
        tractions={"right": on_right, "top": on_top},
        title="manufactured solution on softening springs",
    )
    return KnownProblem(problem, displacement, lambda x: -stress(x)[1])
