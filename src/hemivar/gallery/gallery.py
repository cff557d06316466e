"""Named problems: the survey's simulations, nonmonotone problems of the literature, problems with known solutions.

Sources: *survey* is "A survey of numerical methods for hemivariational inequalities with applications to Contact
Mechanics" (arXiv 2103.14518); *Jureczka and Ochal* is doi 10.1007/s00245-019-09593-y; the problems with exact
solutions are derived in the docstrings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
import scipy.sparse as sp
from scipy.special import lambertw

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import (
    Bilateral,
    Capped,
    ContactLaw,
    Friction,
    Logarithmic,
    PenetrationBound,
    PiecewiseQuadratic,
    SawTooth,
    SlipWeakening,
    Softening,
    Superpotential,
    SurveyLaw,
    Tresca,
)
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Prescribed
from hemivar.mesh import box, rectangle

__all__ = [
    "BEAM_DISPLACEMENTS",
    "SURVEY_DATA",
    "KnownProblem",
    "SurveyData",
    "beam",
    "broken_foundation",
    "delamination",
    "elastic_bar",
    "elastic_bar_penetrations",
    "manufactured_softening",
    "manufactured_spring",
    "shear_block",
    "shear_block_slips",
    "shear_column",
    "softening_block",
    "softening_spring",
    "survey",
    "survey_cube",
    "survey_cube_logarithmic",
    "survey_logarithmic",
    "weighted_block",
]


@dataclass(frozen=True)
class SurveyData:
    """Data of one of the survey's simulations (section 5.3).

    Attributes
    ----------
    body_force : (float, float)
        f_0, force per area of the plane body.
    friction_bound : float
        h_tau, force per length.
    q_max : float
        Pressure up to which the foundation is rigid.
    p_const : float
        Stiffness of the foundation beyond it.
    """

    body_force: tuple[float, float]
    friction_bound: float
    q_max: float
    p_const: float

    @property
    def text(self) -> str:
        """The data in one line."""
        x, y = self.body_force
        return (
            f"f0 = ({x:g}, {y:g}), h_tau = {self.friction_bound:g}, q_max = {self.q_max:g}, p_const = {self.p_const:g}"
        )


#: Data of the survey's Figures 1 to 4, and of its convergence study and Table 1 (5.1).
SURVEY_DATA: Mapping[str, SurveyData] = MappingProxyType(
    {
        "figure1": SurveyData((-0.5, -1.0), 0.1, 0.1, 10.0),
        "figure2": SurveyData((-0.5, -1.0), 0.1, 0.7, 0.0),
        "figure3": SurveyData((-0.5, -1.0), 0.5, 0.5, 0.0),
        "figure4": SurveyData((0.5, -1.0), 0.1, 10.0, 0.0),
        "5.1": SurveyData((-0.8, -0.8), 0.5, 0.3, 2.0),
    }
)


def survey(
    data: str | SurveyData = "5.1", n: int = 32, pattern: Literal["cross", "right", "left"] = "cross"
) -> ContactProblem:
    """The survey's body on its foundation.

    Unit square with Lame constants 4 and 4, clamped at x = 0, in contact with the foundation at y = 0 (gap 0), free
    elsewhere; 1/h = n squares along each side. With ``pattern="cross"`` every square is cut into four triangles by
    its centre: then the largest friction of Figure 3 is 0.4986, 0.4988, 0.4990 at n = 32, 64, 128.

    Parameters
    ----------
    data : str or SurveyData
        A key of :data:`SURVEY_DATA`: ``"figure1"`` ... ``"figure4"`` or ``"5.1"``; or data of one's own.
    n : int
        Number of contact edges, 1/h.
    pattern : {"cross", "right", "left"}
        How the squares are cut into triangles.

    Raises
    ------
    ProblemError
        Unknown data.
    """
    if isinstance(data, str):
        if data not in SURVEY_DATA:
            raise ProblemError(f"the survey has no data '{data}'; choose one of {', '.join(SURVEY_DATA)}")
        title, data = f"survey, {data}", SURVEY_DATA[data]
    else:
        title = "survey's body, own data"
    return ContactProblem(
        mesh=rectangle((1.0, 1.0), n, pattern=pattern),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(SurveyLaw(data.q_max, data.p_const), Tresca(data.friction_bound))},
        supports={"left": Clamped()},
        body_force=data.body_force,
        title=title,
    )


def survey_cube(
    data: str | SurveyData = "5.1", n: int = 8, *, lateral: float = -0.4, friction: Friction | None = None
) -> ContactProblem:
    """The survey's body with a third dimension: a unit cube on its foundation.

    Lame constants 4 and 4, clamped at x = 0, in contact with the foundation at z = 0 (gap 0), free elsewhere. The body
    force of the data acts along x and z, and ``lateral`` along y, so that the slip has two components.

    Parameters
    ----------
    data : str or SurveyData
        As in :func:`survey`; forces are per volume, bounds per area.
    n : int
        Cells along each side.
    lateral : float
        Body force along y, force per volume.
    friction : Friction, optional
        In place of Tresca's law with the bound of the data.
    """
    plane = survey(data, 1)
    title = plane.title
    data = SURVEY_DATA[data] if isinstance(data, str) else data
    along, down = data.body_force
    law: Friction = Tresca(data.friction_bound) if friction is None else friction
    return ContactProblem(
        mesh=box((1.0, 1.0, 1.0), n),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(SurveyLaw(data.q_max, data.p_const), law)},
        supports={"left": Clamped()},
        body_force=(along, lateral, down),
        title=f"{title}, on a cube",
    )


@dataclass(frozen=True, eq=False)
class KnownProblem:
    """A problem with its exact solution.

    Attributes
    ----------
    problem : ContactProblem
    displacement : callable
        Exact displacement, points (k, d) -> (k, d).
    pressure : callable
        Exact pressure on the contact boundary, points (k, d) -> (k,).
    """

    problem: ContactProblem
    displacement: Callable[[Array], Array]
    pressure: Callable[[Array], Array]


def softening_spring(stiffness: float, limit: float, softening: float) -> PiecewiseQuadratic:
    """A spring that weakens: derivative ``k r`` on [0, delta], then falling at rate alpha to zero, then zero.

    Weakly convex with constant alpha; zero for r < 0.

    Parameters
    ----------
    stiffness, limit, softening : float
        k (force per area and length), delta (length) and alpha (force per area and length), all positive.
    """
    if not (stiffness > 0.0 and limit > 0.0 and softening > 0.0):
        raise ProblemError(
            f"softening_spring({stiffness}, {limit}, {softening}): stiffness, limit and softening must be positive"
        )
    end = limit * (1.0 + stiffness / softening)
    return PiecewiseQuadratic(
        np.array([[0.0, limit, end]]),
        np.array([[0.0, stiffness, -softening, 0.0]]),
        np.zeros((1, 3)),
        name="softening spring",
    )


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
        Normal law at the end; by default the softening spring k = 2, delta = 0.1, alpha = 0.5, for which r = 0.3.
        A convex variant: ``SurveyLaw(q, p)``, with ``r = max(kappa r0 - q, 0)/(kappa + p)``.
    elements : int
        Number of linear elements.
    rigidity, length, load : float
        EA (force), L and b (force per length).
    """
    if elements < 1 or not (rigidity > 0.0 and length > 0.0):
        raise ProblemError(
            f"elastic_bar: elements = {elements}, rigidity = {rigidity}, length = {length} must be positive"
        )
    law = softening_spring(2.0, 0.1, 0.5) if law is None else law
    h = length / elements
    diagonal = np.full(elements, 2.0)
    diagonal[-1] = 1.0
    off = np.full(elements - 1, -1.0)
    stiffness = sp.csr_array(sp.diags_array([off, diagonal, off], offsets=(-1, 0, 1))) * (rigidity / h)
    forces = np.full(elements, load * h)
    forces[-1] *= 0.5
    end = np.array([[length]])
    return DiscreteProblem.of_arrays(
        stiffness=sp.csr_array(stiffness),
        load=forces,
        trace=sp.csr_array(([1.0], ([0], [elements - 1])), shape=(1, elements)),
        weights=np.ones(1),
        gap=np.zeros(1),
        law=ContactLaw(law).at(end),
        points=end,
    )


def elastic_bar_penetrations(
    kappa: float, free: float, stiffness: float, limit: float, softening: float
) -> tuple[float, ...]:
    """All exact end displacements of :func:`elastic_bar` with a :func:`softening_spring`, in increasing order.

    Parameters
    ----------
    kappa : float
        EA/L.
    free : float
        r0, the end displacement without foundation.
    stiffness, limit, softening : float
        Parameters of the softening spring; with softening < kappa there is one solution, otherwise up to three.
    """
    if softening == kappa:
        raise ProblemError("softening equals kappa: the falling branch holds a whole interval of solutions or none")
    end = limit * (1.0 + stiffness / softening)
    found = []
    if free <= 0.0 or free >= end:
        found.append(free)
    if 0.0 < free <= limit * (1.0 + stiffness / kappa):
        found.append(kappa * free / (kappa + stiffness))
    falling = (kappa * free - (stiffness + softening) * limit) / (kappa - softening)
    if limit < falling < end:
        found.append(falling)
    return tuple(sorted(found))


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
    law : SurveyLaw, optional
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
    """
    law = SurveyLaw(0.3, 2.0) if law is None else law
    if not isinstance(law, SurveyLaw) or callable(law.q_max) or callable(law.p_const):
        raise ProblemError("weighted_block has a closed form for SurveyLaw with constant parameters only")
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
    """
    return ContactProblem(
        mesh=rectangle((2.5, 1.0), (5, 2), pattern="cross"),
        material=Material.lame(4.0, 4.0),
        supports={"left": Clamped()},
        body_force=(0.0, 0.2),
        title="cantilever",
    )


# ---- nonmonotone laws -------------------------------------------------------------------------------------


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


def survey_logarithmic(
    bound: float = 0.5, n: int = 32, pattern: Literal["cross", "right", "left"] = "cross"
) -> ContactProblem:
    """The survey's body with data (5.1) and friction that weakens with the slip, ``bound ln(1 + |u_tau|)``.

    alpha_tau = bound: unique while the margin of :func:`hemivar.certify.smallness` is positive.

    Parameters
    ----------
    bound : float
        Friction against the first slip, force per length.
    n : int
        Number of contact edges, 1/h.
    pattern : {"cross", "right", "left"}
        How the squares are cut into triangles.
    """
    data = SURVEY_DATA["5.1"]
    return ContactProblem(
        mesh=rectangle((1.0, 1.0), n, pattern=pattern),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(SurveyLaw(data.q_max, data.p_const), Logarithmic(bound))},
        supports={"left": Clamped()},
        body_force=data.body_force,
        title=f"survey's body, friction {bound:g} ln(1 + |u_tau|)",
    )


def survey_cube_logarithmic(bound: float = 0.3, n: int = 8) -> ContactProblem:
    """The cube of :func:`survey_cube`, data (5.1), and friction that weakens with the slip, ``bound ln(1 + |u_tau|)``.

    alpha_tau = bound: unique while the margin of :func:`hemivar.certify.smallness` is positive, as it is by default.

    Parameters
    ----------
    bound : float
        Friction against the first slip, force per area.
    n : int
        Cells along each side.
    """
    problem = survey_cube("5.1", n, friction=Logarithmic(bound))
    return replace(problem, title=f"survey's body on a cube, friction {bound:g} ln(1 + |u_tau|)")


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
) -> tuple[KnownProblem, ...]:
    """A block between frictionless walls pushed by its top onto softening springs: all its uniform solutions.

    As the patch version of :func:`weighted_block`, with ``kappa (D - s) in dj(s)`` for a :class:`Softening` law; every
    solution s is uniform and its displacement linear, ``u_y = -s - (D - s) y/b``. The same problem is returned once
    for each of them, in the order of s; there is one if softening < kappa = (lam + 2 mu)/b, otherwise up to three (and
    then others that are not uniform).

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
    return tuple(known(s) for s in roots)


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
    """
    if not (kappa > 0.0 and free >= 0.0 and static > kinetic and rate > 0.0):
        raise ProblemError(
            f"shear_block_slips(kappa={kappa}, free={free}, static={static}, kinetic={kinetic}, rate={rate}): "
            "kappa and rate must be positive, free at least 0 and static above kinetic"
        )
    c = free - kinetic * bound / kappa
    drop = rate * (static - kinetic) * bound / kappa
    found = [0.0] if kappa * free <= static * bound else []
    argument = -drop * np.exp(-rate * c)
    if argument >= -np.exp(-1.0):
        for branch in (-1, 0):
            slip = c + float(lambertw(argument, branch).real) / rate
            if slip > 0.0:
                found.append(slip)
    return tuple(sorted(set(found)))


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
    """
    h = height / elements
    diagonal = np.full(elements, 2.0)
    diagonal[0] = 1.0
    off = np.full(elements - 1, -1.0)
    stiffness = sp.csr_array(sp.diags_array([off, diagonal, off], offsets=(-1, 0, 1))) * (shear_modulus / h)
    forces = np.full(elements, load * h)
    forces[0] *= 0.5
    foot = np.zeros((1, 2))
    law = ContactLaw(Bilateral(), SlipWeakening(bound, static, kinetic, rate))
    return DiscreteProblem.of_arrays(
        stiffness=sp.csr_array(stiffness),
        load=forces,
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
) -> tuple[KnownProblem, ...]:
    """A block sheared along its base against friction that weakens with the slip: all its uniform solutions.

    On (0, a) x (0, b), no normal displacement at y = 0, top fixed, body force (f, 0) and the side tractions
    ``(0, +-sigma_xy)`` that keep everything a function of y: with ``kappa = mu/b`` and ``w0 = f b^2/(2 mu)`` the slip w
    solves ``kappa (w0 - w) in bound dj_tau(w)`` (:func:`shear_block_slips`) and
    ``u_x = w + (T y - f y^2/2)/mu``, ``T = kappa (w0 - w)``, ``sigma_xy = T - f y``.

    The side tractions belong to the solution, so that problems differ; one is returned for each uniform solution, in
    the order of the slip. :class:`KnownProblem`'s pressure is zero; T is the friction. Elements of order 2, the
    default, hold the solutions exactly.
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

    return tuple(known(slip) for slip in shear_block_slips(kappa, free, bound, static, kinetic, rate))


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
