"""Scalar elliptic problems in their own words: membranes, antiplane shear, heat conduction.

    -div(A grad u) + bedding u = source      in the domain,      A grad u . nu = flux  or  u = value  on its boundary,

and on contact boundaries, or over an area, a force ``-lambda`` per length or area with ``lambda in dj(r)``, where r is
u less a level.  A membrane has its tension for A and a deflection for u, antiplane shear the shear modulus and the
displacement across the plane, heat the conductivity and the temperature.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Never

from hemivar.basics.arguments import described
from hemivar.basics.arrays import LARGEST
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.laws import Friction, NoContact, NoFriction, Superpotential
from hemivar.mechanics.conditions import ScalarData, plain_data
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.gradient_energy import Coefficient
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.per_volume import Regional, refuse_unknown
from hemivar.mechanics.statement import AREA, ContactProblem
from hemivar.mesh.mesh import Mesh

__all__ = ["ScalarContact", "ScalarProblem"]

_NONE: Mapping[str, Never] = MappingProxyType({})


@known_keywords
def ScalarContact(  # noqa: N802
    law: Superpotential | Friction, level: ScalarData = 0.0, side: Side | str = Side.ABOVE
) -> Contact:
    """A :class:`Contact` of one component: what a foundation does along a boundary or over an area.

    Parameters
    ----------
    law : Superpotential or Friction
        A law of the penetration ``r = u - level`` (``level - u`` where the foundation lies below), such as
        :class:`~hemivar.Signorini` for an obstacle; or friction, an even law of the slip ``u - level``, whose bound may
        depend on the place but not on the solution.  A law gives a force per length of a boundary, or per area.
    level : float or callable
        Where the foundation stands: height of an obstacle, displacement of the plane that is rubbed, temperature
        outside.  A callable gets points, shape (k, d), and returns shape (k,).  It is the gap of the contact.
    side : Side
        ``"above"`` (default) or ``"below"``.

    Returns
    -------
    Contact
        Its points remember nothing.

    Raises
    ------
    ProblemError
        The law is neither, or its bound depends on the solution.

    Examples
    --------
    >>> import hemivar as hv
    >>> obstacle = hv.ScalarContact(hv.Signorini(), level="-0.1 + 0.2*x", side="below")
    """
    if not isinstance(law, Superpotential | Friction):
        raise ProblemError(
            f"the law of a scalar contact is {described(law)}; give a superpotential such as Signorini(), or "
            "friction such as Tresca(0.5)"
        )
    normal, friction = (NoContact(), law) if isinstance(law, Friction) else (law, NoFriction())
    at = plain_data(level, "level", 1, LARGEST)
    made = Contact(normal, friction, at, side=side)  # type: ignore[arg-type]
    made = replace(made, memory=()) if made.law.remembers else made
    made.refuse_directions()
    return made


@known_keywords
def ScalarProblem(  # noqa: N802
    mesh: Mesh,
    coefficient: Coefficient | Mapping[str, Coefficient],
    contact: Mapping[str, Contact] = _NONE,
    area: Contact | Mapping[str, Contact] = _NONE,
    supports: Mapping[str, ScalarData] = _NONE,
    source: ScalarData = 0.0,
    fluxes: Mapping[str, ScalarData] = _NONE,
    bedding: ScalarData = 0.0,
    kind: ScalarKind | str = ScalarKind.MEMBRANE,
    title: str = "",
    order: int = 1,
    density: Regional | None = None,
    viscosity: Regional | None = None,
    capacity: Regional | None = None,
    units: Units | None = None,
) -> ContactProblem:
    """A :class:`ContactProblem` with one unknown function u: a membrane, antiplane shear or heat.

    >>> import hemivar as hv
    >>> membrane = hv.ScalarProblem(
    ...     hv.rectangle((1.0, 1.0), 8), 1.0, kind="membrane", source=-4.0,
    ...     supports={name: 0.0 for name in ("left", "right", "bottom", "top")},
    ...     area=hv.ScalarContact(hv.Signorini(), level=-0.1, side="below"))
    >>> round(float(hv.solve(membrane).displacement.min()), 3)
    -0.1

    Without contact ``-div(coefficient grad u) + bedding u = source``.  Contact may act on the boundary, ``contact``,
    and over the domain, ``area``, as under the membrane above.  Solve it as any other problem.

    Parameters
    ----------
    mesh : Mesh
        Plane, or in space for heat.
    coefficient : float, callable, tensor or GradientEnergy, or mapping of region name to one
        Of the material, see :meth:`Material.gradient`.
    contact : mapping of boundary name to Contact
        See :func:`ScalarContact`.
    area : Contact, or mapping of region name to Contact
        Contact over the domain or over regions of it; none by default.  It stands under ``contact`` of the problem,
        that over the domain as :data:`hemivar.mechanics.statement.AREA`.
    supports : mapping of boundary name to float or callable
        Values of u.
    source : float or callable
        Per area (volume in space): the body force of the problem.
    fluxes : mapping of boundary name to float or callable
        ``A grad u . nu``, per length (area in space), zero by default: the tractions of the problem.
    bedding : float or callable
        Elastic bedding ``-bedding u`` per area, not negative.
    kind : ScalarKind
    title : str
    order : int
        Polynomial degree of the elements, 1 or 2.
    density : float or callable, or mapping of region name to one, optional
        Of what moves; a problem at rest knows nothing of it, nor of the next two.
    viscosity : float or callable, or mapping of region name to one, optional
    capacity : float or callable, or mapping of region name to one, optional
        Of heat.
    units : Units, optional
        For labels; no number is converted.

    Returns
    -------
    ContactProblem

    Raises
    ------
    ProblemError
        If a name is unknown, numbers are not finite, conditions exclude each other, heat has a density or a
        viscosity, or something else a capacity.
    """
    material = Material.gradient(coefficient, kind, density=density, viscosity=viscosity, capacity=capacity)
    if not isinstance(area, Contact | Mapping):
        raise ProblemError(
            f"area is {described(area)}; give ScalarContact(law, level), or one for each region, "
            "{'patch': ScalarContact(...)}"
        )
    areas = {AREA: area} if isinstance(area, Contact) else area
    if isinstance(area, Mapping) and isinstance(mesh, Mesh):
        refuse_unknown("area", areas, list(mesh.regions))
    both = [name for name in areas if isinstance(contact, Mapping) and name in contact]
    if both:
        raise ProblemError(
            f"'{both[0]}' names a boundary with contact and a region with contact, which results could not tell "
            "apart; rename one of them in the mesh"
        )
    for name, one in contact.items() if isinstance(contact, Mapping) else ():
        if isinstance(one, Contact) and one.against:
            raise ProblemError(
                f"contact '{name}' against '{one.against}': a scalar problem has no bodies that touch; leave against "
                "out. Heat crosses a joint in an evolution of bodies, Evolution(problem, heat=Heat(...))"
            )
    return ContactProblem(
        mesh, material, {**contact, **areas} if isinstance(contact, Mapping) else contact, supports,
        body_force=source, tractions=fluxes,  # type: ignore[arg-type]
        title=title, order=order, bedding=bedding, units=Units() if units is None else units,
    )  # fmt: skip
