"""Ctrl-C, the time limit and a lack of memory: the best iterate so far, with a status that says what happened."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar
import hemivar.basics.memory as machine_memory
from hemivar.certificates import certify
from hemivar.errors import MethodError
from hemivar.linear import factor_memory as memory
from hemivar.solvers import Controls, FixedPoint, LoadStepping, NonsmoothNewton, Solver, Status, solve, solve_nested
from hemivar.solvers.base import State
from hemivar.solvers.controls import Budget
from hemivar.systems import CondensedProblem, condense
from tests.samples import slow

from ..counting import sparse_factors
from ..problems import discrete_square

needs_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits and signals of Linux")


class _Stopped(NonsmoothNewton):
    """The default method, stopped inside its step ``at``."""

    at, error, taken = 2, KeyboardInterrupt, 0

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        type(self).taken += 1
        if self.taken == self.at:
            raise self.error
        return super().step(system, state, budget)


def stopped(error: type[BaseException], at: int = 2) -> Solver:
    kind = type("Stopped", (_Stopped,), {"at": at, "error": error, "taken": 0})
    solver = kind()
    assert isinstance(solver, Solver)
    return solver


@pytest.mark.parametrize(
    ("error", "status"), [(KeyboardInterrupt, Status.INTERRUPTED), (MemoryError, Status.OUT_OF_MEMORY)]
)
def test_an_end_inside_a_step_keeps_the_iterate_before_it(error: type[BaseException], status: Status) -> None:
    problem = discrete_square(n=16)
    one_step = solve(problem, controls=Controls(max_steps=1))
    found = solve(problem, stopped(error))
    assert found.status is status
    assert found.steps == 1
    np.testing.assert_array_equal(found.unknowns, one_step.unknowns)
    # Its certificate is that of any other point: a residual that shows, and a bound that holds.
    exact = solve(problem)
    certificate = certify(problem, found.unknowns, found.multiplier)
    v = found.unknowns - exact.unknowns
    assert 0.0 < np.sqrt(v @ (problem.stiffness @ v)) <= certificate.error_bound


@pytest.mark.parametrize(
    ("error", "status"), [(KeyboardInterrupt, Status.INTERRUPTED), (MemoryError, Status.OUT_OF_MEMORY)]
)
def test_an_end_before_the_first_step_gives_the_start(error: type[BaseException], status: Status) -> None:
    found = solve(discrete_square(n=8), stopped(error, at=1))
    assert found.status is status
    assert found.steps == 0
    assert np.isfinite(found.residual.relative)


def test_an_interruption_while_the_unknowns_are_recovered_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    recover = CondensedProblem.recover
    calls = []

    def interrupted_once(self: CondensedProblem, *arguments: Any) -> Any:
        calls.append(1)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return recover(self, *arguments)

    monkeypatch.setattr(CondensedProblem, "recover", interrupted_once)
    found = solve(discrete_square(n=8), controls=Controls(max_steps=1))
    assert found.status is Status.INTERRUPTED
    assert len(calls) == 2


def test_load_stepping_stops_at_the_load_it_has_reached() -> None:
    problem = discrete_square(n=8)
    inner = stopped(KeyboardInterrupt, at=4)
    found = solve(problem, LoadStepping(inner=inner, steps=8))
    assert found.status is Status.INTERRUPTED
    assert type(inner).taken == 4, "no other load was tried"  # type: ignore[attr-defined]
    full = solve(problem)
    assert 0.0 < np.abs(found.unknowns).max() < np.abs(full.unknowns).max()


def test_fixed_point_hands_on_why_its_inner_method_ended() -> None:
    assert solve(discrete_square(n=8), FixedPoint(stopped(MemoryError))).status is Status.OUT_OF_MEMORY


def test_no_finer_mesh_is_begun_after_an_interruption() -> None:
    found = solve_nested([discrete_square(n=n) for n in (4, 8, 16)], stopped(KeyboardInterrupt, at=2))
    assert [solution.status for solution in found] == [Status.INTERRUPTED]


# ---- in a process of its own -------------------------------------------------------------------------------------


def heed_interrupts() -> None:
    """A process started in the background may have been told to ignore Ctrl-C; its children should not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(code: str, folder: Path) -> subprocess.Popen[str]:
    source = str(Path(hemivar.__file__).parents[1])
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": source, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )


_BLOCK = """
    import resource, sys
    import numpy as np, scipy.sparse as sp
    from hemivar.errors import MethodError
    from hemivar.laws import ContactLaw, ThresholdCompliance, Tresca
    from hemivar.discrete import DiscreteProblem
    from hemivar.solvers import Controls, NonsmoothNewton, solve
    from hemivar.linear import factor_memory as memory

    def limit(mib):
        pages = int(open("/proc/self/statm").read().split()[0])
        soft = pages * resource.getpagesize() + mib * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (soft, resource.RLIM_INFINITY))

    m, rest = {points}, {interior}
    n = 2 * m + rest
    K = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(n, n), format="csr")
    if rest:  # a grid, whose factors fill
        side = round(n ** (1 / 3))
        n, one = side**3, sp.eye_array(side)
        line = sp.diags_array([-1.0, 2.1, -1.0], offsets=[-1, 0, 1], shape=(side, side))
        K = sp.csr_array(
            sp.kron(sp.kron(line, one), one) + sp.kron(sp.kron(one, line), one) + sp.kron(sp.kron(one, one), line)
        )
    d = 3 if rest else 2
    B = sp.eye_array(d * m, n, format="csr")
    law = ContactLaw(ThresholdCompliance(0.3, 2.0), Tresca(0.1))
    problem = DiscreteProblem.of_arrays(K, np.cos(np.arange(n)), B, np.ones(m), np.zeros(m), law)
    # everything is loaded
    solve(DiscreteProblem.of_arrays(np.eye(2), np.ones(2), np.eye(2), np.ones(1), np.zeros(1), law))
"""


def script_of_block(points: int, interior: int) -> str:
    return textwrap.dedent(_BLOCK).replace("{points}", str(points)).replace("{interior}", str(interior))


@needs_linux
def test_memory_that_gives_out_in_a_step_leaves_the_iterate(tmp_path: Path) -> None:
    process = start(
        script_of_block(1100, 0)  # matrices of 39 MB
        + textwrap.dedent(
            """
            found = solve(problem, NonsmoothNewton(), Controls(callback=lambda line: limit(8)))
            print(found.status.value, found.steps, np.isfinite(found.residual.relative))
            """
        ),
        tmp_path,
    )
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert out.split() == ["out_of_memory", "0", "True"]


@needs_linux
@pytest.mark.parametrize("checked", [True, slow(False)])
def test_a_factorisation_that_does_not_fit_is_refused_with_a_way_out(checked: bool, tmp_path: Path) -> None:
    """Before it starts where the model sees it coming, and with the same way out where the library runs into it."""
    process = start(
        script_of_block(30, 27**3)  # factors of some 200 MB
        + textwrap.dedent(
            f"""
            if not {checked}:
                memory.available_bytes = lambda: None
            limit(25)
            try:
                solve(problem, NonsmoothNewton())
            except MethodError as error:
                print(error)
            """
        ),
        tmp_path,
    )
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    message = out.splitlines()[-1]  # SuperLU prints a line of its own
    assert "--method multigrid" in message
    assert ("needs about" if checked else "memory ran out") in message


# ---- what there is and what it takes -----------------------------------------------------------------------------


def test_a_problem_that_fits_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    needed = memory.factorisation_bytes(16512, 2, 128)
    monkeypatch.setattr(memory, "available_bytes", lambda: 1.3 * needed)
    memory.check_memory(16512, 2, 128)
    monkeypatch.setattr(memory, "available_bytes", lambda: 1.2 * needed)
    with pytest.raises(MethodError, match=r"16512 unknowns.* needs about .* MiB.* are free; take the multigrid method"):
        memory.check_memory(16512, 2, 128)
    monkeypatch.setattr(memory, "available_bytes", lambda: None)
    memory.check_memory(10**9, 3, 10**6)


def test_condensation_asks_before_it_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "available_bytes", lambda: 1000.0)
    problem = discrete_square(n=8)
    with pytest.raises(MethodError, match=r"0\.000954 MiB are free"):
        solve(problem)


def test_marches_in_the_plane_are_predicted_as_they_are_factorised(monkeypatch: pytest.MonkeyPatch) -> None:
    """By SuperLU, whatever is installed, which takes more than PARDISO."""
    once: dict[tuple[bool, int, bool], float] = {}
    for pardiso, dim, many in itertools.product((False, True), (2, 3), (False, True)):
        monkeypatch.setattr(memory, "pardiso_available", lambda pardiso=pardiso: pardiso)
        once[pardiso, dim, many] = memory.factorisation_bytes(30_000, dim, 300, many)
    assert once[True, 2, True] == once[False, 2, True] == once[False, 2, False] > once[True, 2, False]
    assert once[True, 3, True] == once[True, 3, False] < once[False, 3, False]


def test_model_of_the_memory_is_above_the_factors_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    """The factors alone, counted, take 12 bytes an entry; the model allows for them, and not for ten times as much."""
    from hemivar.linear.pardiso import pardiso_available

    if pardiso_available():
        pytest.skip("the factors of PARDISO cannot be counted")
    factors = sparse_factors(monkeypatch)
    for problem in (discrete_square(n=32), discrete_square(n=64)):
        condense(problem)
        [counted] = [12.0 * one.nnz for one in factors if one.shape[0] == problem.unknowns]
        assert counted < memory.factorisation_bytes(problem.unknowns, 2, problem.contact_points * 2) < 10.0 * counted


def test_least_of_all_limits_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def group(folder: Path, limit: str, used: int, reclaimable: int) -> None:
        folder.mkdir(parents=True)
        (folder / "memory.max").write_text(f"{limit}\n")
        (folder / "memory.current").write_text(f"{used}\n")
        (folder / "memory.stat").write_text(f"anon 5\ninactive_file {reclaimable}\n")

    names = ("memory.max", "memory.current", "inactive_file")
    group(tmp_path / "a", "1000", 700, 100)
    group(tmp_path / "b", "max", 700, 100)
    assert machine_memory._group_left(tmp_path / "a", *names) == 400.0
    assert machine_memory._group_left(tmp_path / "b", *names) is None
    assert machine_memory._group_left(tmp_path / "none", *names) is None
    monkeypatch.setattr(machine_memory, "_machine_left", lambda: 900.0)
    monkeypatch.setattr(machine_memory, "_groups_left", lambda: iter([400.0, 500.0]))
    monkeypatch.setattr(machine_memory, "_address_space_left", lambda: None)
    assert machine_memory.available_bytes() == 400.0
    monkeypatch.setattr(machine_memory, "_groups_left", lambda: iter([]))
    monkeypatch.setattr(machine_memory, "_machine_left", lambda: None)
    assert machine_memory.available_bytes() is None


@needs_linux
def test_free_memory_of_this_machine_is_found() -> None:
    free = machine_memory.available_bytes()
    assert free is not None
    assert 2.0**20 < free < 2.0**50
