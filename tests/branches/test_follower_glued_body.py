"""Quasistatic marches of bodies that glue alone holds."""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.discrete.held_at_rest import PERHAPS_NO_MINIMUM
from hemivar.evolution.discrete import discretize_evolution
from tests import bodies


def pulled_off(jump: str, until: float) -> hv.evolution.History:
    """A block between frictionless walls, on glue of the strength 2, pulled off it by the tension t."""
    contact = hv.Adhesive(24.0, 2.0, 6.0, 72.0)
    block = bodies.column(contact, cells=2, top=None, tractions={"top": lambda x, t: np.tile([0.0, t], (len(x), 1))})
    evolution = hv.Evolution(block)
    assert discretize_evolution(evolution).problem.notes == (PERHAPS_NO_MINIMUM,)
    return hv.march(evolution, until=until, step=0.25, jump=jump, save=hv.evolution.Save(every=0.25))


def test_a_block_on_glue_follows_its_load_until_the_strength_is_reached() -> None:
    """The opening is tension over stiffness; at the strength the march ends, and says why."""
    for jump in ("local", "arc-length"):
        history = pulled_off(jump, until=1.75)
        assert history.finished
        penetration = history.frames[-1].local[:, 0]
        np.testing.assert_allclose(-penetration, 1.75 / 24.0, rtol=1e-7)
        beyond = pulled_off(jump, until=2.5)
        assert beyond.ended == "broken"
        assert beyond.frames[-1].time in (1.75, 2.0)
        assert any("may exceed what the foundation can carry" in message for message in beyond.messages)
