"""What rests on sampled constants is an estimate, and is never called unique, exhaustive or guaranteed."""

from __future__ import annotations

import numpy as np

from hemivar.certificates import smallness
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, Friction, FunctionLaw, PenetrationBound


def one_point(law: ContactLaw, load: tuple[float, float] = (1.0, 0.3)) -> DiscreteProblem:
    return DiscreteProblem.of_arrays(np.eye(2), np.array(load), np.eye(2), np.ones(1), np.zeros(1), law)  # type: ignore[arg-type]


def test_profiles_of_friction_whose_bound_depends_on_the_penetration() -> None:
    steep = FunctionLaw(lambda r: r, lambda r: np.ones_like(r), even=True)
    bound = PenetrationBound("min(max(s, 0), 0.5)/4")
    assert smallness(one_point(ContactLaw(Compliance(0.5), Friction(bound, steep)))).m_L_sampled
    assert not smallness(one_point(ContactLaw(Compliance(0.5), Friction(0.2, steep)))).m_L_sampled
