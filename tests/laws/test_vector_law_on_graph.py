"""Minty's chart of every law: the pair at p = a r + lam, its Lipschitz constant and its derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, VectorLaw
from hemivar.laws.coupled import BenzeggaghKenane, ModeDependentGlue
from hemivar.laws.friction import Friction, PenetrationBound
from hemivar.laws.testing import LawError, check_graph
from hemivar.laws.vector_law import OnGraph
from tests.laws.catalogue import LAWS

GLUE = ModeDependentGlue(1.0, 1.6, 20.0, BenzeggaghKenane(0.2, 0.5, 2.0)).at(None)
STATES: dict[str, VectorLaw] = {
    "coulomb on springs": ContactLaw(hv.Compliance(10.0), hv.Coulomb(0.4)).at(None),
    "coulomb on rigid ground": ContactLaw(hv.Signorini(), hv.Coulomb(0.4)).at(None),
    "coulomb and glue": ContactLaw(hv.laws.Adhesive(5.0, 1.0, 2.0), hv.Coulomb(0.7)).at(None),
    "bound of the penetration": ContactLaw(
        hv.Compliance(10.0), Friction(PenetrationBound("min(8*s, 0.8)"), hv.laws.SlipWeakening(1.0).profile)
    ).at(None),
    "glue of two energies": GLUE,
}


@pytest.mark.parametrize("components", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_every_law_with_friction(name: str, components: int) -> None:
    check_graph(ContactLaw(LAWS[name], hv.Tresca(0.3)).at(None), reach=1.0, components=components)


@pytest.mark.parametrize("components", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(STATES))
def test_laws_of_the_state(name: str, components: int) -> None:
    check_graph(STATES[name], reach=0.4, components=components)


def test_glue_of_two_energies_is_off_its_curve_where_a_is_small() -> None:
    with pytest.raises(ProblemError, match="is a curve for stiffnesses above"):
        GLUE.on_graph(np.ones((1, 2)), np.full((1, 2), 30.0))


class Wrong(ContactLaw):
    """A law that answers with a fault."""

    fault = ""

    def on_graph(self, p: Array, a: Array) -> OnGraph:
        on = super().on_graph(p, a)
        if self.fault == "pair":
            return replace(on, r=on.r + 1e-3 * np.abs(on.r))
        if self.fault == "column":
            jacobian = on.jacobian.copy()
            jacobian[:, 1:, 0] = 0.0
            return replace(on, jacobian=jacobian)
        return replace(on, jacobian=1.01 * on.jacobian)


@pytest.mark.parametrize("fault", ["pair", "column", "jacobian"])
def test_faults_are_found(fault: str) -> None:
    law = Wrong(hv.Compliance(10.0), hv.Coulomb(0.4)).at(None)
    object.__setattr__(law, "fault", fault)
    with pytest.raises(LawError):
        check_graph(law, reach=0.4)
