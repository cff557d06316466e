"""The thermo-viscoelastic body of the literature: its balances, its file, its order in time."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, History, march
from hemivar.files.problem_file import read_problem_file
from hemivar.gallery import thermoviscoelastic
from hemivar.workflows.marching import evolution_of

FILE = Path(__file__).parents[1] / "examples" / "problems" / "thermoviscoelastic.toml"


def moved(n: int, steps: int, until: float = 0.25) -> History:
    body = thermoviscoelastic(n)
    return march(Evolution(body.problem, inertia=True, heat=body.heat), until, step=until / steps)


def test_balances_that_no_step_asks_for() -> None:
    """Momentum along the foundation: tractions (48 - 44)/6 of time less friction; heat: by hand from the frames."""
    history = moved(4, 16)
    discrete, frame = history.discrete, history.frames[-1]
    assert discrete.mass is not None
    rigid = discrete.restrict(np.tile([1.0, 0.0], (len(frame.velocity), 1)), np.zeros(0))
    momentum = rigid @ discrete.mass.times(discrete.restrict(frame.velocity, np.zeros(0)))
    friction = sum(
        row.step * float(discrete.problem.contact.weights @ one.multiplier[:, 1])
        for row, one in zip(history.steps[1:], history.frames[1:], strict=True)
    )
    tangent = discrete.problem.contact.frames[0, 1, 0]  # type: ignore[index]
    assert momentum == pytest.approx(0.25 * 4.0 / 6.0 - tangent * friction, rel=1e-8)
    # heat that the foundation gave: 0.1 (0.27 - th) over the bottom, by the trapezoidal rule
    mesh = discrete.field.mesh
    bottom = np.flatnonzero(mesh.points[:, 1] == 0.0)
    weights = np.full(bottom.size, 0.25)
    weights[np.isin(mesh.points[bottom, 0], (0.0, 1.5))] *= 0.5
    gave = sum(
        row.step * float(weights @ (0.1 * (0.27 - one.temperature[bottom])))  # type: ignore[index]
        for row, one in zip(history.steps[1:], history.frames[1:], strict=True)
    )
    assert history.state.heat is not None
    book = history.state.heat.book
    assert book.contact == pytest.approx(gave, rel=1e-9)
    # heat of deformation: -1/2 int div u, by the divergence on each cell
    grown = np.einsum("mii,m->", hv.fem.strain(mesh, frame.displacement), mesh.volumes)
    assert book.deformation == pytest.approx(-0.5 * grown, rel=1e-8)
    assert book.content == pytest.approx(0.25 * 1.5 + gave - 0.5 * grown + book.friction, rel=1e-9)
    assert book.friction == pytest.approx(0.1 * history.ledger["friction"], rel=1e-9)


def test_the_order_in_time_is_one() -> None:
    """What is left to halve falls by halves with the step, as the theorem of the paper has it."""
    frames = [moved(2, steps, 0.0625).frames[-1] for steps in (8, 16, 32, 64)]
    for name in ("displacement", "velocity", "temperature"):
        values = [getattr(frame, name) for frame in frames]
        changes = [np.abs(later - sooner).max() for sooner, later in itertools.pairwise(values)]
        rates = np.log2(np.array(changes[:-1]) / changes[1:])
        assert 0.75 < rates[-1] < 1.3, name


def test_the_file_is_the_gallery() -> None:
    one = march(evolution_of(read_problem_file(FILE)), 0.0625, step=0.03125).frames[-1]
    body = thermoviscoelastic(16)
    two = march(Evolution(body.problem, inertia=True, heat=body.heat), 0.0625, step=0.03125).frames[-1]
    np.testing.assert_allclose(one.displacement, two.displacement, atol=1e-12)
    np.testing.assert_allclose(one.temperature, two.temperature, rtol=1e-12)  # type: ignore[arg-type]
