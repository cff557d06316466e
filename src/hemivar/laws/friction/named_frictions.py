"""Friction laws by name, each a profile with a bound."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType

from hemivar.basics.stated import Form, stated, stating
from hemivar.basics.types import Parameter
from hemivar.laws.friction.bounds import CoulombBound, StateBound
from hemivar.laws.friction.friction_law import Friction, OrthotropicFriction, SlipMeasure
from hemivar.laws.friction.profiles import ExponentialWeakening, LogarithmicWeakening, StaticKineticProfile
from hemivar.laws.named import LawKind, named
from hemivar.laws.own.formula_law import FORMULA, FormulaLaw
from hemivar.laws.own.table_law import EXTEND, TABLE, check_points, even_table, read_law_table
from hemivar.laws.parameters import FRICTION, LENGTH, numbers, parameter, positive

__all__ = [
    "Coulomb",
    "ExponentialDecay",
    "Logarithmic",
    "NoFriction",
    "SlipTable",
    "SlipWeakening",
    "StaticKinetic",
    "Tresca",
]


@named(
    LawKind.FRICTION,
    "tresca",
    "friction of at most bound; where the body slips it has this size and opposes the slip",
    "j(s) = bound |s|",
)
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


@named(
    LawKind.FRICTION,
    "coulomb",
    "friction of at most coefficient times the pressure (quasi-variational: the bound is iterated)",
    "j(s) = coefficient pressure |s|",
)
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


@named(
    LawKind.FRICTION,
    "none",
    "no friction",
    "j(s) = 0",
)
def NoFriction() -> Friction:  # noqa: N802 - a law, named as the others are
    """No friction.

    Returns
    -------
    Friction
    """
    return Friction(0.0)


@named(
    LawKind.FRICTION,
    "slip-weakening",
    "friction that falls with the slip from bound static to bound kinetic, exponentially",
    "j(s) = bound (kinetic |s| - (static - kinetic)/rate (exp(-rate |s|) - 1))",
)
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


@named(
    LawKind.FRICTION,
    "exponential-decay",
    "Coulomb friction that falls with the slip rate from coefficient static to kinetic, exponentially",
    "friction (kinetic + (static - kinetic) exp(-decay rate)) times the pressure",
)
@stating(
    static=parameter("coefficient at rest", "1", 0.5, least=0.0),
    kinetic=parameter("coefficient of fast slip", "1", 0.3, least=0.0),
    decay=positive("how fast it falls with the slip rate", "time/length", 1.0),
)
def ExponentialDecay(static: Parameter, kinetic: Parameter, decay: Parameter) -> Friction:  # noqa: N802
    """Coulomb's law whose coefficient falls with the slip rate v: kinetic + (static - kinetic) exp(-decay v).

    Parameters
    ----------
    static : number, array or function
        Coefficient at rest.
    kinetic : number, array or function
        Coefficient of fast slip.
    decay : number, array or function
        One over a slip rate.

    Returns
    -------
    Friction
        Of the slip rate: it belongs to a problem in time. A problem at rest reads the slip in its place.

    Examples
    --------
    >>> import hemivar as hv
    >>> friction = hv.laws.ExponentialDecay(0.5, 0.3, decay=2.0)
    >>> friction.profile.derivative([1e-9, 0.5, 10.0]).round(3)
    array([0.5  , 0.374, 0.3  ])
    """
    return Friction(CoulombBound(1.0), ExponentialWeakening(static, kinetic, decay), of=SlipMeasure.RATE)


@named(
    LawKind.FRICTION,
    "logarithmic",
    "friction bound/(scale + slip), which falls to zero with the slip",
    "j(s) = bound ln(1 + |s|/scale)",
)
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


@named(
    LawKind.FRICTION,
    "static-kinetic",
    "friction bound static up to a slip, from there at once bound kinetic",
    "j'(s) = bound static for 0 < s < slip, bound kinetic beyond",
)
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


@named(
    LawKind.FRICTION,
    "slip-table",
    "friction bound times a table of the slip, linear between its points and constant beyond; a "
    "repeated slip is a jump",
    "j'(s) = bound values(s)",
)
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


@named(
    LawKind.FRICTION,
    "orthotropic",
    "friction of at most bound along an axis of the surface and ratio bound across it, in 3D",
    "j(s) = bound sqrt(s1^2 + ratio^2 s2^2)",
)
@stating(
    bound=FRICTION["bound"],
    ratio=positive("bound across the axis over that along it", "1", 0.5),
    axis=numbers("a direction; its projection on the surface is the axis", "1", (1.0, 0.0, 0.0)),
)
def _orthotropic(bound: Parameter | StateBound, ratio: Parameter, axis: Sequence[float]) -> Friction:
    return OrthotropicFriction(bound, ratio=ratio, axis=axis)


@named(
    LawKind.FRICTION,
    "table",
    "friction bound times a CSV file with the columns r (slip >= 0) and derivative; the same in both directions",
    "j' from a table",
)
@stating(file=TABLE, extend=EXTEND, **FRICTION)
def _table(
    file: str | Path, bound: Parameter | StateBound = 1.0, extend: str = "constant", of: str | None = None
) -> Friction:
    return Friction(bound, read_law_table(file, extend=extend, friction=True), of=of)


@named(
    LawKind.FRICTION,
    "formula",
    "friction from any potential or its derivative, as a formula of the slip r >= 0; the same in both directions",
    "j(s) = bound potential(|s|)",
)
@stating(
    potential=stated(Form.TEXT, "formula of the slip r >= 0", unit=LENGTH, example="log(1 + r)"),
    derivative=stated(
        Form.TEXT, "formula of the friction over the bound, in place of potential", unit="1", instead="potential"
    ),
    **FORMULA,
    **FRICTION,
)
def _formula(
    potential: str | None = None,
    derivative: str | None = None,
    bound: Parameter | StateBound = 1.0,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    where: str = "",
    of: str | None = None,
) -> Friction:
    law = FormulaLaw(potential, derivative=derivative, kinks=kinks, reach=reach, even=True, where=where)
    return Friction(bound, law, of=of)
