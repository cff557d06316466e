"""Formulas as text wherever numbers and functions are taken: each is what the function of the same values gives."""

from __future__ import annotations

import re

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws.parameters import parameter


def displacement_of(**given: object) -> Array:
    """Displacements of a block, with some of its data replaced."""
    stated: dict[str, object] = {
        "mesh": hv.rectangle((1.0, 1.0), 3),
        "material": hv.Material.young(10.0, 0.3),
        "contact": {"bottom": hv.Contact(hv.Signorini(), gap="0.1*x")},
        "supports": {"left": hv.Clamped()},
        "body_force": (0.1, -0.2),
    }
    return hv.solve(hv.ContactProblem(**(stated | given))).raise_for_status().displacement  # type: ignore[arg-type]


def x(points: Array) -> Array:
    return points[:, 0]


def down(points: Array) -> Array:
    return np.column_stack([0.0 * x(points), -x(points)])


ALIKE = {
    "load": ({"body_force": ("0", "-x")}, {"body_force": down}),
    "numbers beside formulas": ({"tractions": {"top": (0.0, "-x")}}, {"tractions": {"top": down}}),
    "pressure": ({"tractions": {"top": hv.Pressure("x")}}, {"tractions": {"top": hv.Pressure(x)}}),
    "support": ({"supports": {"left": hv.Prescribed(("0", "-x"))}}, {"supports": {"left": hv.Prescribed(down)}}),
    "component": (
        {"supports": {"left": hv.Fixed(x="0.1*y", y=0.0)}},
        {"supports": {"left": hv.Fixed(x=lambda p: 0.1 * p[:, 1], y=0.0)}},
    ),
    "material": (
        {"material": hv.Material.young("10 + x", 0.3)},
        {"material": hv.Material.young(lambda p: 10.0 + x(p), 0.3)},
    ),
    "laws": (
        {"contact": {"bottom": hv.Contact(hv.Softening("10*x + 1", 0.02, 5.0), hv.Tresca("0.1*x"))}},
        {
            "contact": {
                "bottom": hv.Contact(
                    hv.Softening(lambda p: 10.0 * x(p) + 1.0, 0.02, 5.0), hv.Tresca(lambda p: 0.1 * x(p))
                )
            }
        },
    ),
    "coulomb": (
        {"contact": {"bottom": hv.Contact(hv.Compliance("1 + x"), hv.Coulomb("0.1 + x"))}},
        {"contact": {"bottom": hv.Contact(hv.Compliance(lambda p: 1.0 + x(p)), hv.Coulomb(lambda p: 0.1 + x(p)))}},
    ),
    "glue": (
        {"contact": {"bottom": hv.Contact(hv.Adhesive("1 + x", 0.1))}},
        {"contact": {"bottom": hv.Contact(hv.Adhesive(lambda p: 1.0 + x(p), 0.1))}},
    ),
}


@pytest.mark.parametrize("name", ALIKE)
def test_a_formula_is_the_function_of_its_values(name: str) -> None:
    by_text, by_function = ALIKE[name]
    np.testing.assert_allclose(displacement_of(**by_text), displacement_of(**by_function), rtol=0.0, atol=1e-14)


def test_a_formula_of_time_is_a_quantity_that_depends_on_time() -> None:
    def marched(traction: object, law: hv.Superpotential, friction: object) -> Array:
        problem = hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 2),
            material=hv.Material.young(10.0, 0.3),
            contact={"bottom": hv.Contact(law, friction)},  # type: ignore[arg-type]
            supports={"left": hv.Clamped()},
            tractions={"top": traction},  # type: ignore[dict-item]
        )
        return hv.march(hv.Evolution(problem), 1.0, step=0.5).frames[-1].displacement

    by_text = marched(("0.1*t", "-t"), hv.Compliance("10*(1 + t)"), hv.Coulomb("0.3*t"))
    by_function = marched(
        lambda p, t: np.tile([0.1 * t, -t], (len(p), 1)),
        hv.Compliance(lambda p, t: np.full(len(p), 10.0 * (1.0 + t))),  # type: ignore[arg-type]
        hv.Coulomb(lambda p, t: np.full(len(p), 0.3 * t)),  # type: ignore[arg-type]
    )
    np.testing.assert_allclose(by_text, by_function, rtol=0.0, atol=1e-14)


def test_what_is_no_formula_is_named_where_it_stands() -> None:
    with pytest.raises(hv.HemivarError, match=re.escape("body_force: formula '-q' at character 2: 'q' is not known")):
        displacement_of(body_force=("0", "-q"))
    with pytest.raises(hv.HemivarError, match="stiffness of law 'softening': formula"):
        hv.Softening("x +", 0.02, 5.0)


def test_a_parameter_states_the_most_that_it_may_be() -> None:
    from dataclasses import dataclass, field

    from hemivar.laws.parametrised import NamedLaw
    from hemivar.laws.piecewise import PiecewiseQuadratic

    @dataclass(frozen=True)
    class Share(NamedLaw):
        part: object = field(default=0.5, metadata=parameter("a part", "1", least=0.0, most=1.0))
        name = "share"

        def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
            return hv.Compliance(float(values["part"][0])).at(None)._table  # pragma: no cover

    with pytest.raises(hv.HemivarError, match=r"part of law 'share' is 1\.5; it must be at most 1"):
        Share(1.5).at(None)
