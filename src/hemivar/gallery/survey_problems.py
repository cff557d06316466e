"""The survey's body on its foundation, in two and three dimensions.

Source: "A survey of numerical methods for hemivariational inequalities with applications to Contact Mechanics"
(arXiv 2103.14518).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from hemivar.basics.arguments import expect, quoted
from hemivar.errors import ProblemError
from hemivar.laws import Friction, Logarithmic, ThresholdCompliance, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import box, rectangle

__all__ = [
    "SURVEY_DATA",
    "SurveyData",
    "survey",
    "survey_cube",
    "survey_cube_logarithmic",
    "survey_logarithmic",
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

    Returns
    -------
    ContactProblem

    Raises
    ------
    ProblemError
        Unknown data.
    """
    if isinstance(data, str):
        if data not in SURVEY_DATA:
            raise ProblemError(f"the survey has no data {quoted(data)}; choose one of {', '.join(SURVEY_DATA)}")
        title, data = f"survey, {data}", SURVEY_DATA[data]
    else:
        title, data = "survey's body, own data", expect(data, SurveyData, "data", "give a name or SurveyData(...)")
    return ContactProblem(
        mesh=rectangle((1.0, 1.0), n, pattern=pattern),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(ThresholdCompliance(data.q_max, data.p_const), Tresca(data.friction_bound))},
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

    Returns
    -------
    ContactProblem
    """
    plane = survey(data, 1)
    title = plane.title
    data = SURVEY_DATA[data] if isinstance(data, str) else data
    along, down = data.body_force
    law: Friction = Tresca(data.friction_bound) if friction is None else friction
    return ContactProblem(
        mesh=box((1.0, 1.0, 1.0), n),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(ThresholdCompliance(data.q_max, data.p_const), law)},
        supports={"left": Clamped()},
        body_force=(along, lateral, down),
        title=f"{title}, on a cube",
    )


def survey_logarithmic(
    bound: float = 0.5, n: int = 32, pattern: Literal["cross", "right", "left"] = "cross"
) -> ContactProblem:
    """The survey's body with data (5.1) and friction that weakens with the slip, ``bound ln(1 + |u_tau|)``.

    alpha_tau = bound: unique while the margin of :func:`hemivar.certificates.smallness` is positive.

    Parameters
    ----------
    bound : float
        Friction against the first slip, force per length.
    n : int
        Number of contact edges, 1/h.
    pattern : {"cross", "right", "left"}
        How the squares are cut into triangles.

    Returns
    -------
    ContactProblem
    """
    problem = survey("5.1", n, pattern)
    contact = {"bottom": Contact(problem.contact["bottom"].normal, Logarithmic(bound))}
    return replace(problem, contact=contact, title=f"survey's body, friction {bound:g} ln(1 + |u_tau|)")


def survey_cube_logarithmic(bound: float = 0.3, n: int = 8) -> ContactProblem:
    """The cube of :func:`survey_cube`, data (5.1), and friction that weakens with the slip, ``bound ln(1 + |u_tau|)``.

    alpha_tau = bound: unique while the margin of :func:`hemivar.certificates.smallness` is positive, as it is by
    default.

    Parameters
    ----------
    bound : float
        Friction against the first slip, force per area.
    n : int
        Cells along each side.

    Returns
    -------
    ContactProblem
    """
    problem = survey_cube("5.1", n, friction=Logarithmic(bound))
    return replace(problem, title=f"survey's body on a cube, friction {bound:g} ln(1 + |u_tau|)")
