"""Both engines are one method: the same energy, and about as many steps and cycles."""

from __future__ import annotations

import json
import shutil
from functools import cache
from pathlib import Path

import pytest

import hemivar as hv
from tests.engines.benchmark_problems import PROBLEMS, RTOL
from tests.engines.running import mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_HERE = Path(__file__).parent


@cache
def _over_ranks(ranks: int) -> dict[str, tuple[str, int, int, float]]:
    done = mpirun(ranks, "-m", "tests.engines.agree", limit=300.0)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])  # type: ignore[no-any-return]


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", PROBLEMS)
def test_energy_steps_and_cycles_agree(name: str, ranks: int) -> None:
    """Never more than one cycle more; fewer where PETSc smooths whole nodes and solves on a finer coarsest mesh."""
    state, size = PROBLEMS[name]
    serial = hv.solve(hv.discretize(state(size)), hv.NonsmoothMultigrid(), RTOL)
    status, steps, cycles, energy = _over_ranks(ranks)[name]
    assert status == serial.status.value == "converged"
    assert energy == pytest.approx(serial.energy, rel=1e-10)
    assert abs(steps - serial.steps) <= 1
    assert 0.6 * serial.evaluations <= cycles <= serial.evaluations + 1
