"""Loads that jump at a stop: schemes of second order keep it, against the exact motion of the discrete body."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import scipy.linalg as la

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from tests import bodies
from tests.samples import sampled

#: Where the load jumps, and where the motion ends.
_AT, _UNTIL = 0.5, 1.0
SCHEMES = (hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.8), hv.evolution.Midpoint())


def swinging(inclusive: bool = False, first: float = 0.3, then: float = -1.0) -> Evolution:
    """A column that hangs free, at rest at the start, under a load on its foot that grows and then jumps."""

    def load(x: Array, t: float) -> Array:
        grows = t <= _AT if inclusive else t < _AT
        return np.column_stack([0.0 * x[:, 0], np.full(len(x), first * t if grows else then)])

    problem = bodies.column(top=hv.Clamped(), lame=(1, 1), density=1.0, tractions={"bottom": load})
    return Evolution(problem, inertia=True)


def exact_end(evolution: Evolution, first: float = 0.3, then: float = -1.0) -> tuple[Array, Array]:
    """Displacement and velocity (n,) of the discrete body at the end, mode by mode."""
    discrete = discretize_evolution(evolution)
    assert discrete.mass is not None
    square, modes = la.eigh(discrete.stiffness.inner.toarray(), discrete.mass.inner.toarray())
    w = np.sqrt(square)
    push = modes.T @ (discrete.data_at(_UNTIL).load / then)
    q = first * push * (_AT / w**2 - np.sin(w * _AT) / w**3)
    v = first * push * (1.0 - np.cos(w * _AT)) / w**2
    rest, c, s = then * push / w**2, np.cos(w * (_UNTIL - _AT)), np.sin(w * (_UNTIL - _AT))
    return modes @ (rest + (q - rest) * c + v / w * s), modes @ (v * c - (q - rest) * w * s)


@pytest.mark.parametrize(
    ("scheme", "inclusive"),
    sampled(itertools.product(SCHEMES, (False, True)), 5),
    ids=lambda value: value.name if isinstance(value, Scheme) else "after" if value else "from",
)
def test_a_load_that_jumps_at_a_stop_costs_no_order(scheme: Scheme, inclusive: bool) -> None:
    stated = swinging(inclusive)
    places, speeds = exact_end(stated)
    off = []
    for steps in (50, 100, 200):
        found = march(stated, _UNTIL, step=_UNTIL / steps, scheme=scheme, stops=(_AT,)).state.body
        errors = np.abs(found.displacement - places).max(), np.abs(found.velocity - speeds).max()
        off.append(np.array(errors) / (np.abs(places).max(), np.abs(speeds).max()))
    orders = np.log2(np.array(off[:-1]) / np.array(off[1:]))
    assert orders.min() > 1.8, (off, orders)
    assert np.max(off[-1]) < 2e-3
