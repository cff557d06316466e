"""Friction laws by name, each a profile with a bound."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from hemivar.basics.stated import stating
from hemivar.basics.types import Parameter
from hemivar.laws.friction.bounds import CoulombBound, StateBound
from hemivar.laws.friction.friction_law import Friction, SlipMeasure
from hemivar.laws.friction.profiles import ExponentialWeakening, LogarithmicWeakening, StaticKineticProfile
from hemivar.laws.own.table_law import check_points, even_table
from hemivar.laws.parameters import FRICTION, LENGTH, numbers, parameter

__all__ = ["Coulomb", "Logarithmic", "NoFriction", "SlipTable", "SlipWeakening", "StaticKinetic", "Tresca"]


@stating(**FRICTION)
def Tresca(  # noqa: N802 - a law, named as the others are
    bound: Parameter | StateBound, *, of: SlipMeasure | str | None = None
) -> Friction:
    """Tresca's law: friction at most ``bound``, against the slip once it slips (j_tau = |.|).

    Parameters
    ----------
    bound : number, array, function or StateBound
        Force per area.
    of : "slip" or "rate", optional
        What friction acts against in time: the rate of the slip, as by default, or the slip since the start. A problem
        at rest knows the slip only.

    Returns
    -------
    Friction

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.Contact(hv.Signorini(), hv.Tresca(0.5)).friction.acts
    True
    """
    return Friction(bound, of=of)


@stating(coefficient=parameter("friction coefficient mu", "1", 0.3, least=0.0), **FRICTION)
def Coulomb(  # noqa: N802 - a law, named as the others are
    coefficient: Parameter, *, of: SlipMeasure | str | None = None
) -> Friction:
    """Coulomb's law: friction at most ``coefficient`` times the pressure (quasi-variational).

    Parameters
    ----------
    coefficient : number, array or function
        Friction coefficient mu >= 0.
    of : "slip" or "rate", optional
        What friction acts against in time: the rate of the slip, as by default, or the slip since the start. A problem
        at rest knows the slip only.

    Returns
    -------
    Friction

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.Coulomb("0.3 + 0.1*x").state_dependent
    True
    """
    return Friction(CoulombBound(coefficient), of=of)


def NoFriction() -> Friction:  # noqa: N802 - a law, named as the others are
    """No friction.

    Returns
    -------
    Friction
    """
    return Friction(0.0)


@stating(ExponentialWeakening, **FRICTION)
def SlipWeakening(  # noqa: N802 - a law, named as the others are
    bound: Parameter | StateBound,
    static: Parameter = 1.0,
    kinetic: Parameter = 0.7,
    rate: Parameter = 1.0,
    *,
    of: SlipMeasure | str | None = None,
) -> Friction:
    """Friction that falls with the slip from ``bound static`` to ``bound kinetic`` like exp(-rate |slip|).

    The defaults are the survey's j_tau(r) = 0.7 r - 0.3 exp(-r).

    Parameters
    ----------
    bound : number, array, function or StateBound
        Force per area.
    static : number, array or function
        Part of the bound at rest.
    kinetic : number, array or function
        Part of the bound after a long slip.
    rate : number, array or function
        One over a slip.
    of : "slip" or "rate", optional
        Whether it is a law of the slip since the start or of its rate; a problem in time must say it, statics knows the
        slip only.

    Returns
    -------
    Friction

    Examples
    --------
    >>> import hemivar as hv
    >>> friction = hv.SlipWeakening(0.5, kinetic=0.7, rate=20.0)
    >>> friction.profile.derivative([0.01, 1.0]).round(3)  # of the bound
    array([0.946, 0.7  ])
    """
    return Friction(bound, ExponentialWeakening(static, kinetic, rate), of=of)


@stating(LogarithmicWeakening, **FRICTION)
def Logarithmic(  # noqa: N802 - a law, named as the others are
    bound: Parameter | StateBound, scale: Parameter = 1.0, *, of: SlipMeasure | str | None = None
) -> Friction:
    """Friction ``bound/(scale + |slip|)``, j_tau(r) = ln(1 + |r|/scale).

    Parameters
    ----------
    bound : number, array, function or StateBound
        Force per area.
    scale : number, array or function
        A slip.
    of : "slip" or "rate", optional
        Whether it is a law of the slip since the start or of its rate; a problem in time must say it, statics knows the
        slip only.

    Returns
    -------
    Friction
    """
    return Friction(bound, LogarithmicWeakening(scale), of=of)


@stating(StaticKineticProfile, **FRICTION)
def StaticKinetic(  # noqa: N802
    bound: Parameter | StateBound,
    slip: Parameter,
    static: Parameter = 1.0,
    kinetic: Parameter = 0.7,
    *,
    of: SlipMeasure | str | None = None,
) -> Friction:
    """Friction ``bound static`` up to the slip ``slip`` > 0, then at once ``bound kinetic``.

    Parameters
    ----------
    bound : number, array, function or StateBound
        Force per area.
    slip : number, array or function
        A length.
    static : number, array or function
        Part of the bound before that slip.
    kinetic : number, array or function
        Part of the bound after it.
    of : "slip" or "rate", optional
        Whether it is a law of the slip since the start or of its rate; a problem in time must say it, statics knows the
        slip only.

    Returns
    -------
    Friction
    """
    return Friction(bound, StaticKineticProfile(slip, static, kinetic), of=of)


@stating(
    slips=numbers("from 0 on, increasing", LENGTH, (0.0, 0.2)),
    values=numbers("factors of the bound there", "1", (1.0, 0.5)),
    **FRICTION,
)
def SlipTable(  # noqa: N802
    bound: Parameter | StateBound,
    slips: Sequence[float],
    values: Sequence[float],
    *,
    of: SlipMeasure | str | None = None,
) -> Friction:
    """Friction ``bound`` times a table of the slip, linear between its points and constant beyond them.

    Parameters
    ----------
    bound : Parameter or StateBound
    slips : sequence of float
        >= 0, not falling; a repeated one is a jump.
    values : sequence of float
        j_tau' at the slips.
    of : "slip" or "rate", optional
        Whether it is a law of the slip since the start or of its rate; a problem in time must say it, statics knows the
        slip only.

    Returns
    -------
    Friction
    """
    r, d = check_points(slips, values, "slips of law 'slip-table'", friction=True)
    stated = MappingProxyType({"law": "slip-table", "slips": r, "values": d})
    return Friction(bound, even_table(r, d, name="slip-table", stated=stated), of=of)
