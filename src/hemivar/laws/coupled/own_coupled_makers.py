"""Laws of one's own that couple opening and slip: by a formula of r and s, or by Python functions."""

from __future__ import annotations

from types import MappingProxyType

from hemivar.basics.arguments import described, one_line
from hemivar.basics.stated import Form, stated, stating
from hemivar.errors import ProblemError
from hemivar.laws.coupled.own_coupled import OwnCoupledLaw
from hemivar.laws.coupled.plane_potential import FormulaPotential, FunctionPotential, PotentialFunction
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LENGTH, LINE, checked_reach, parameter, word

__all__ = ["CoupledFormulaLaw", "CoupledFunctionLaw"]


def CoupledFormulaLaw(  # noqa: N802 - a law, named as the others are
    potential: str, *, reach: float, rigid: bool = False, name: str = "coupled-formula", where: str = ""
) -> OwnCoupledLaw:
    """A law that couples opening and slip, by a formula of the penetration ``r`` and the length ``s`` of the slip.

    ``CoupledFormulaLaw("0.5*(1 - exp(-(min(r, 0)^2 + 4*s^2)/2e-4)) + 5e3*max(r, 0)^2", reach=0.2)`` is glue that opens
    (r < 0) and slips, on springs. The law is the same in all directions of the slip. The formula may have any value at
    r = s = 0.

    Its gradient is continuous but at r = 0, where the derivative by r may jump upwards, and at s = 0, where the
    derivative by s may be positive (friction). Where the branches of abs, min, max and piecewise lie at r = 0 or s = 0
    only, alpha is shown by intervals up to the reach, if a bound within 10 % of what is seen is found; otherwise it is
    sampled. Where alpha does not show that a local problem has one minimiser, Newton's method starts from the valleys
    of a grid up to the reach; valleys narrower than a seventieth of the reach, or a tenth of the distance to zero, may
    be missed.

    Parameters
    ----------
    potential : str
        j (force per length).
    reach : float
        Length up to which constants and minimisers are looked for: larger than any displacement that matters, and some
        ten times what the law needs to change.
    rigid : bool
        Nothing penetrates: the formula holds for r <= 0.
    name : str
        What the law is called in messages.
    where : str
        What stands before messages about the formula.

    Returns
    -------
    OwnCoupledLaw

    Raises
    ------
    ProblemError
        The text is no formula of r and s, or no law: see above. One sentence says where.
    """
    one_line(name, "the name of a law"), one_line(where, "where")
    if not isinstance(potential, str):
        raise ProblemError(
            f"law '{name}': the potential is {described(potential)}; give a formula of r and s such as 'r^2 + s^2', or "
            "take CoupledFunctionLaw"
        )
    far = checked_reach(reach, f"law '{name}'")
    shut = "rigid" if rigid is True else "formula"
    stated = {"law": "coupled-formula", "potential": potential, "reach": far, "penetration": shut}
    return OwnCoupledLaw.of(FormulaPotential(potential, where), far, rigid, name, MappingProxyType(stated))


def CoupledFunctionLaw(  # noqa: N802 - a law, named as the others are
    potential: PotentialFunction,
    gradient: PotentialFunction,
    hessian: PotentialFunction | None = None,
    *,
    reach: float,
    rigid: bool = False,
    name: str = "coupled-function",
) -> OwnCoupledLaw:
    """A law that couples opening and slip, by Python functions of the penetration and the length of the slip.

    What is asked of it and how it is solved is as for :func:`CoupledFormulaLaw`; alpha is sampled.

    Parameters
    ----------
    potential : callable
        j: arrays r and s (k,), with s > 0 and r not 0, to an array (k,).
    gradient : callable
        The derivatives by r and by s, two arrays (k,).
    hessian : callable, optional
        f_rr, f_rs and f_ss, three arrays (k,); by differences of the gradient if it is left out.
    reach : float
    rigid : bool
    name : str

    Returns
    -------
    OwnCoupledLaw

    Raises
    ------
    ProblemError
        A function does not return such arrays, the gradient is not that of the potential, or it is no law.
    """
    one_line(name, "the name of a law")
    for what, function in (("potential", potential), ("gradient", gradient), ("hessian", hessian)):
        if not callable(function) and (function is not None or what != "hessian"):
            raise ProblemError(
                f"the {what} of law '{name}' is {described(function)}; give a function of r and s, or a formula to "
                "CoupledFormulaLaw"
            )
    far = checked_reach(reach, f"law '{name}'")
    return OwnCoupledLaw.of(FunctionPotential(potential, gradient, hessian, far, name), far, rigid, name)


@named(
    LawKind.NORMAL,
    "coupled-formula",
    "any potential of penetration and slip, as a formula of r (negative: opening) and the length s of"
    " the slip; includes friction",
    "j(r, s) = potential",
)
@stating(
    potential=stated(
        Form.TEXT,
        "formula of the penetration r and the slip s",
        unit=LINE,
        example="0.5*(1 - exp(-(min(r, 0)^2 + 4*s^2)/2e-4)) + 5e3*max(r, 0)^2",
    ),
    reach=parameter("length up to which constants and minimisers are computed", LENGTH, 0.1),
    penetration=word("what resists penetration: the formula, or a rigid foundation", "formula", "rigid"),
)
def _by_values(potential: str, reach: float, penetration: str = "formula", where: str = "") -> OwnCoupledLaw:
    return CoupledFormulaLaw(potential, reach=reach, rigid=penetration == "rigid", where=where)
