"""Problems with exact or manufactured solutions, derived in the docstrings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import scipy.sparse as sp

from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, PiecewiseQuadratic, Softening, Superpotential, ThresholdCompliance
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Prescribed
from hemivar.mesh import rectangle

__all__ = [
    "BEAM_DISPLACEMENTS",
    "KnownProblem",
    "beam",
    "column",
    "elastic_bar",
    "elastic_bar_penetrations",
    "manufactured_spring",
    "weighted_block",
]


@dataclass(frozen=True, eq=False)
class KnownProblem(ManufacturedProblem):
    """A problem with its exact solution; it may be given wherever a problem is asked for.

    Attributes
    ----------
    problem : ContactProblem
    displacement : callable
        Exact displacement, points (k, d) -> (k, d).
    pressure : callable
        Exact pressure on the contact boundary, points (k, d) -> (k,).
    others : tuple of KnownProblem
        Where more solutions are known: each of the others, with a problem that it solves.
    """

    problem: ContactProblem
    displacement: Callable[[Array], Array]
    pressure: Callable[[Array], Array]
    others: tuple[KnownProblem, ...] = ()

    @property
    def statement(self) -> ContactProblem:
        """The problem."""
        return self.problem

    @property
    def solutions(self) -> tuple[KnownProblem, ...]:
        """This solution and the others."""
        return (self, *self.others)


def elastic_bar(
    law: Superpotential | None = None,
    elements: int = 8,
    *,
    rigidity: float = 1.0,
    length: float = 1.0,
    load: float = 0.8,
) -> DiscreteProblem:
    """A bar on a foundation at its end, as a problem made of arrays.

    ``-EA u'' = b`` on (0, L), ``u(0) = 0``, contact at x = L. With ``kappa = EA/L`` and ``r0 = b L^2/(2 EA)`` the
    end displacement r solves ``kappa (r0 - r) in dj(r)``; linear elements are exact at the nodes.

    Parameters
    ----------
    law : Superpotential, optional
        Normal law at the end; by default ``Softening(2, 0.1, 0.5)``, for which r = 0.3.
        A convex variant: ``ThresholdCompliance(q, p)``, with ``r = max(kappa r0 - q, 0)/(kappa + p)``.
    elements : int
        Number of linear elements.
    rigidity, length, load : float
        EA (force), L and b (force per length).

    Returns
    -------
    DiscreteProblem

    Raises
    ------
    ProblemError
        A number is not positive.
    """
    if elements < 1 or not (rigidity > 0.0 and length > 0.0):
        raise ProblemError(
            f"elastic_bar: elements = {elements}, rigidity = {rigidity}, length = {length} must be positive"
        )
    law = Softening(2.0, 0.1, 0.5) if law is None else law
    stiffness, forces = column(elements, rigidity, length, load)
    end = np.array([[length]])
    return DiscreteProblem.of_arrays(
        stiffness=stiffness,
        load=forces,
        trace=sp.csr_array(([1.0], ([0], [elements - 1])), shape=(1, elements)),
        weights=np.ones(1),
        gap=np.zeros(1),
        law=ContactLaw(law).at(end),
        points=end,
    )


def column(elements: int, rigidity: float, length: float, load: float) -> tuple[sp.csr_array, Array]:
    """Stiffness and nodal loads of ``-EA u'' = b``; linear elements, held where the first begins, the last end free."""
    h = length / elements
    diagonal = np.full(elements, 2.0)
    diagonal[-1] = 1.0
    off = np.full(elements - 1, -1.0)
    forces = np.full(elements, load * h)
    forces[-1] *= 0.5
    return sp.csr_array(sp.diags_array([off, diagonal, off], offsets=(-1, 0, 1)) * (rigidity / h)), forces


def elastic_bar_penetrations(
    kappa: float, free: float, stiffness: float, limit: float, softening: float
) -> tuple[float, ...]:
    """All exact end displacements of :func:`elastic_bar` with a :class:`~hemivar.laws.Softening` law, increasing.

    Parameters
    ----------
    kappa : float
        EA/L.
    free : float
        r0, the end displacement without foundation.
    stiffness, limit, softening : float
        Parameters of that law; with softening < kappa there is one solution, otherwise up to three.

    Returns
    -------
    tuple of float

    Raises
    ------
    ProblemError
        The softening equals the stiffness.
    """
    if softening == kappa:
        raise ProblemError(
            "softening equals kappa, so that an interval of solutions exists, or none; change one of the two"
        )
    end = limit * (1.0 + stiffness / softening)
    solutions = []
    if free <= 0.0 or free >= end:
        solutions.append(free)
    if 0.0 < free <= limit * (1.0 + stiffness / kappa):
        solutions.append(kappa * free / (kappa + stiffness))
    falling = (kappa * free - (stiffness + softening) * limit) / (kappa - softening)
    if limit < falling < end:
        solutions.append(falling)
    return tuple(sorted(solutions))


def weighted_block(
    law: Superpotential | None = None,
    n: int = 8,
    *,
    width: float = 1.0,
    height: float = 1.0,
    weight: float = 1.0,
    top_displacement: float | None = None,
    lame: tuple[float, float] = (4.0, 4.0),
) -> KnownProblem:
    """A block between frictionless walls, pressed onto the survey's foundation by its weight or by its top.

    On (0, a) x (0, b) with ``u_x = 0`` at both sides and ``M = lam + 2 mu``: either the top is fixed and the body
    force is (0, -g), ``kappa = M/b``, ``r0 = g b^2/(2 M)``; or (patch version) there is no body force and the top is
    moved down by D, r0 = D, the displacement linear and reproduced exactly by linear elements. The penetration s solves
    ``P = kappa (r0 - s) in dj(s)``; for the survey's law ``s = max(kappa r0 - q, 0)/(kappa + p)``, and
    ``u_y = -s + (-P y + g y^2/2)/M``.

    Parameters
    ----------
    law : ThresholdCompliance, optional
        Constant parameters; q = 0.3, p = 2 by default.
    n : int
        Cells along each side.
    width, height : float
        a and b.
    weight : float
        g, force per volume; not used in the patch version.
    top_displacement : float, optional
        D of the patch version.
    lame : (float, float)
        lam and mu.

    Returns
    -------
    KnownProblem

    Raises
    ------
    ProblemError
        The law is another one, or varies.
    """
    law = ThresholdCompliance(0.3, 2.0) if law is None else law
    if not isinstance(law, ThresholdCompliance) or callable(law.q_max) or callable(law.p_const):
        raise ProblemError(
            "weighted_block has a closed form for ThresholdCompliance with numbers only; give such a law"
        )
    lam, mu = lame
    modulus = lam + 2.0 * mu
    kappa = modulus / height
    gravity = weight if top_displacement is None else 0.0
    r0 = gravity * height**2 / (2.0 * modulus) if top_displacement is None else top_displacement
    q, p = float(np.asarray(law.q_max)), float(np.asarray(law.p_const))
    s = max(kappa * r0 - q, 0.0) / (kappa + p) if r0 > 0.0 else r0
    pressure = kappa * (r0 - s)

    def displacement(x: Array) -> Array:
        y = x[:, 1]
        return np.column_stack([np.zeros_like(y), -s + (-pressure * y + 0.5 * gravity * y**2) / modulus])

    top = Prescribed((0.0, -(top_displacement or 0.0)))
    problem = ContactProblem(
        mesh=rectangle((width, height), n, pattern="cross"),
        material=Material.lame(lam, mu),
        contact={"bottom": Contact(law)},
        supports={"left": Fixed(x=0.0), "right": Fixed(x=0.0), "top": top},
        body_force=(0.0, -gravity),
        title="block under its own weight" if top_displacement is None else "block pressed down by its top",
    )
    return KnownProblem(problem, displacement, lambda x: np.full(len(x), pressure))


def manufactured_spring(n: int = 8, *, lame: tuple[float, float] = (4.0, 4.0), order: int = 1) -> KnownProblem:
    """A smooth manufactured solution on a foundation of linear springs.

    On (0, 2) x (0, 1), clamped at x = 0: ``u = 0.05 (2xy + xy^2, -x^2 (1 + y))``. Then the shear strain vanishes
    everywhere, the body force is ``0.1 lam (x, -(1 + y))``, the pressure at y = 0 is ``(lam + 2 mu) u_nu`` with
    ``u_nu = 0.05 x^2``, and there is no friction. Tractions at x = 2 and y = 1 follow from u.

    Parameters
    ----------
    n : int
        Cells along the height.
    lame : (float, float)
        lam and mu.
    order : int
        Polynomial degree of the elements.

    Returns
    -------
    KnownProblem
    """
    lam, mu = lame
    modulus = lam + 2.0 * mu
    springs = PiecewiseQuadratic(np.zeros((1, 1)), np.full((1, 2), modulus), np.zeros((1, 1)), name="linear springs")

    def displacement(x: Array) -> Array:
        return 0.05 * np.column_stack([2 * x[:, 0] * x[:, 1] + x[:, 0] * x[:, 1] ** 2, -(x[:, 0] ** 2) * (1 + x[:, 1])])

    def stresses(x: Array) -> tuple[Array, Array]:
        stretch_x = 0.05 * (2 * x[:, 1] + x[:, 1] ** 2)
        stretch_y = -0.05 * x[:, 0] ** 2
        volume = lam * (stretch_x + stretch_y)
        return volume + 2 * mu * stretch_x, volume + 2 * mu * stretch_y

    problem = ContactProblem(
        mesh=rectangle((2.0, 1.0), (2 * n, n), pattern="cross"),
        material=Material.lame(lam, mu),
        contact={"bottom": Contact(springs)},
        supports={"left": Clamped()},
        body_force=lambda x: 0.1 * lam * np.column_stack([x[:, 0], -(1.0 + x[:, 1])]),
        tractions={
            "right": lambda x: np.column_stack([stresses(x)[0], np.zeros(len(x))]),
            "top": lambda x: np.column_stack([np.zeros(len(x)), stresses(x)[1]]),
        },
        title="manufactured solution on springs",
        order=order,
    )
    return KnownProblem(problem, displacement, lambda x: modulus * 0.05 * x[:, 0] ** 2)


#: Displacements of :func:`beam` at two of its nodes, computed independently.
BEAM_DISPLACEMENTS: Mapping[tuple[float, float], tuple[float, float]] = MappingProxyType(
    {(0.5, 0.0): (0.11787841, 0.1252073), (2.5, 0.0): (0.24898703, 1.07004206)}
)


def beam() -> ContactProblem:
    """Linear elasticity alone: a cantilever 2.5 x 1 of squares of side 0.5, each cut into four triangles.

    Clamped at x = 0, Lame constants 4 and 4, body force (0, 0.2), no contact; see :data:`BEAM_DISPLACEMENTS`.

    Returns
    -------
    ContactProblem
    """
    return ContactProblem(
        mesh=rectangle((2.5, 1.0), (5, 2), pattern="cross"),
        material=Material.lame(4.0, 4.0),
        supports={"left": Clamped()},
        body_force=(0.0, 0.2),
        title="cantilever",
    )
