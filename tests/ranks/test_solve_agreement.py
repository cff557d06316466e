"""Both engines are one method: the same energy, and about as many steps and cycles."""

from __future__ import annotations

import json
import os
import shutil
from functools import cache
from pathlib import Path
from unittest.mock import patch

import pytest

import hemivar as hv
from hemivar.kernels import kernels
from tests.ranks.benchmark_problems import PROBLEMS, RTOL
from tests.ranks.running import mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_HERE = Path(__file__).parent


@cache
def _over_ranks(ranks: int, *coarsest: str) -> dict[str, tuple[str, int, int, float]]:
    done = mpirun(ranks, "-m", "tests.ranks.agree", *coarsest, limit=300.0)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])  # type: ignore[no-any-return]


@cache
def _serial(name: str) -> hv.Solution:
    """By cycles in double precision, as those of PETSc are; the compiled ones have another smoother."""
    state, size = PROBLEMS[name]
    with patch.dict(os.environ, HEMIVAR_KERNELS="none"):
        kernels.cache_clear()
        try:
            return hv.solve(hv.discretize(state(size)), hv.solvers.NonsmoothMultigrid(), RTOL)
        finally:
            kernels.cache_clear()


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", PROBLEMS)
def test_energy_steps_and_cycles_agree(name: str, ranks: int) -> None:
    """Down to the same mesh, of 8 x 8 or 4 x 4 x 4 blocks, the engines are within one cycle of each other."""
    serial = _serial(name)
    status, steps, cycles, energy = _over_ranks(ranks, str(100 // ranks))[name]
    assert status == serial.status.value == "converged"
    assert energy == pytest.approx(serial.energy, rel=1e-10)
    assert abs(steps - serial.steps) <= 1
    assert abs(cycles - serial.evaluations) <= 1


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", PROBLEMS)
def test_a_finer_coarsest_mesh_saves_cycles(name: str, ranks: int) -> None:
    """PETSc has at least 400 cells for each rank on the coarsest mesh, which it solves by a factorisation."""
    serial = _serial(name)
    status, steps, cycles, energy = _over_ranks(ranks)[name]
    assert status == "converged"
    assert energy == pytest.approx(serial.energy, rel=1e-10)
    assert abs(steps - serial.steps) <= 1
    assert serial.evaluations - 6 <= cycles <= serial.evaluations
