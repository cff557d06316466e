"""The conformance kit of laws of a point finds what is wrong with one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hemivar.laws import Adhesive, ContactLaw, Tresca
from hemivar.laws.testing import LawError, check_vector_law


def spoiled(**methods: Callable[..., Any]) -> ContactLaw:
    """Glue with friction, some of whose answers are changed by functions."""

    def changed(name: str, change: Callable[..., Any]) -> Callable[..., Any]:
        return lambda self, *given: change(getattr(ContactLaw, name)(self, *given))

    answers = {name: changed(name, change) for name, change in methods.items()}
    law: ContactLaw = type("Spoiled", (ContactLaw,), answers)(Adhesive(5.0, 1.0, 2.0, 3.0), Tresca(0.3)).at(None)
    return law


def test_the_law_to_be_spoiled_is_good() -> None:
    assert check_vector_law(spoiled(), reach=1.5).passed


@pytest.mark.parametrize(
    ("method", "change", "words"),
    [
        ("value", lambda j: j + 0.01, "the value is zero at r = 0"),
        ("linearise", lambda line: replace(line, gradient=1.001 * line.gradient), "the gradient is that of the value"),
        ("linearise", lambda line: replace(line, hessian=1.001 * line.hessian), "the hessian is that of the gradient"),
        ("local_argmin", lambda r: 1.01 * r, "local_argmin is the global minimiser"),
        ("local_argmin", lambda r: (1.0 + 1e-6) * r, "off the graph"),
        ("local_minimiser", lambda r: r + 1e-3, "local_minimiser is a stationary point that is not higher"),
        ("on_graph", lambda on: replace(on, jacobian=0.9 * on.jacobian), "prox_jacobian is the derivative of prox"),
        ("nearest_multiplier", lambda lam: lam + 0.01, "the nearest multiplier is an element"),
        ("on_graph", lambda on: replace(on, r=1.01 * on.r), "on_graph finds pairs of the law"),
    ],
)
def test_a_planted_fault_is_found(method: str, change: Callable[..., Any], words: str) -> None:
    with pytest.raises(LawError, match=words) as caught:
        check_vector_law(spoiled(**{method: change}), reach=1.5)
    assert str(caught.value) == str(check_vector_law(spoiled(**{method: change}), reach=1.5, raises=False))


def test_a_growth_rate_that_is_not_that_of_the_value_is_found() -> None:
    rates = property(lambda self: tuple(rate + 0.01 for rate in ContactLaw.rates.fget(self)))  # type: ignore[attr-defined]
    law = type("Spoiled", (ContactLaw,), {"rates": rates})(Adhesive(5.0, 1.0, 2.0, 3.0), Tresca(0.3)).at(None)
    assert "growth rate far away" in str(check_vector_law(law, reach=1.5, raises=False))
    assert np.isinf(law.rates[0]).all()
