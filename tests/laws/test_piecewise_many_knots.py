"""Tables of many rows are searched; they answer what going through all rows answers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.laws import FormulaLaw, Superpotential, superpotential, table_law
from hemivar.laws.minimisers import piece_bounds
from hemivar.laws.scalar_graph import kink_within, prox_slope
from hemivar.laws.transformed import affine
from tests.samples import sampled

M = 60


def random_table(seed: int, rows: int, kind: str) -> Superpotential:
    random = np.random.default_rng(seed)
    r = np.sort(random.uniform(-1.0, 1.0, rows))
    r[rows // 2] = r[rows // 2 - 1]  # a jump
    y = random.normal(size=rows)
    if kind == "convex":
        y = np.sort(y)
    elif kind == "smooth":
        r[rows // 2] = 0.5 * (r[rows // 2 - 1] + r[rows // 2 + 1])
        y = np.sin(5.0 * r)
    return table_law(r, y)


@pytest.mark.parametrize(
    ("made", "kind"), sampled(itertools.product(("itself", "scaled", "moved"), ("convex", "smooth", "rough")), 4)
)
@given(seed=st.integers(0, 10_000))
@settings(max_examples=8, deadline=None)
def test_searching_answers_what_going_through_answers(kind: str, made: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    law = random_table(seed, 90, kind)
    if made == "moved":
        law = affine(law, random.uniform(0.1, 3.0, M), random.uniform(-2.0, 2.0, M))
    if made != "itself":
        law = law.scaled(np.where(np.arange(M) % 7 == 0, 0.0, random.uniform(0.1, 3.0, M)))
    assert law.searched
    knots = np.broadcast_to(law.knots, (M, law.knots.shape[-1]))
    some = knots[np.arange(M), random.integers(knots.shape[-1], size=M)]
    r = np.where(random.random(M) < 0.5, some, some + random.normal(size=M))
    lam, tau = random.normal(size=M), 10.0 ** random.uniform(-3.0, 2.0, M)
    a, b = 10.0 ** random.uniform(-1.0, 3.0, M), 3.0 * random.normal(size=M)
    questions = {
        "piece_of": (r,),
        "at_kink": (r,),
        "value": (r,),
        "derivative": (r,),
        "distance": (r, lam),
        "graph_distance": (r, lam, tau),
        "local_argmin": (a, b),
    }

    def beside() -> list[np.ndarray]:
        return [kink_within(law, r + 1e-13, 1e-11), prox_slope(law, b, 1.0 / a), *piece_bounds(law, law.piece_of(r))]

    found = {name: getattr(law, name)(*given) for name, given in questions.items()}
    found_beside = beside()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(superpotential, "MANY", 1000)
        assert not law.searched
        for name, given in questions.items():
            np.testing.assert_allclose(found[name], getattr(law, name)(*given), rtol=1e-11, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(beside(), found_beside, rtol=1e-11, atol=1e-12)


def test_formulas_with_many_kinks() -> None:
    law = FormulaLaw("abs(sin(4*r)) + 0.05*r^2")
    assert law.searched
    random = np.random.default_rng(3)
    a, b = 10.0 ** random.uniform(-1.0, 2.0, 40), 5.0 * random.normal(size=40)
    r = law.local_argmin(a, b)
    grid = np.linspace(-9.9, 9.9, 20_001)
    energy = 0.5 * a[:, None] * grid**2 - b[:, None] * grid + law.value(grid)
    inside = np.abs(r) < 9.9
    here = 0.5 * a * r**2 - b * r + law.value(r)
    assert np.all(here[inside] <= energy.min(axis=1)[inside] + 1e-9)
