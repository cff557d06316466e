"""What belongs to the whole process is as before after every public function, and results repeat bit by bit."""

from __future__ import annotations

import locale
import os
import pickle
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

import hemivar as hv
from hemivar import files, report
from hemivar.fem.near_kernel import near_kernel, node_slots
from hemivar.linear.algebraic import algebraic_levels
from hemivar.mesh.mesh import Mesh
from tests.problems import bar, square
from tests.samples import sampled

TOML = """
[mesh]
rectangle = [1.0, 1.0]
cells = [4, 4]
[material]
lame = [4.0, 4.0]
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "signorini" }
"""


def unstructured(n: int) -> hv.DiscreteProblem:
    """A square whose mesh is not known to be the refinement of another: its coarse levels are algebraic."""
    problem = square(n=n)
    mesh = problem.mesh
    mesh = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries), dict(mesh.regions))
    return hv.discretize(problem.on(mesh))


def process_state() -> dict[str, Any]:
    """Everything in the process that a library may spoil for others."""
    import matplotlib as mpl
    from matplotlib import pyplot

    libraries = ThreadpoolController().select(user_api="blas").lib_controllers
    return {
        "numpy.random": pickle.dumps(np.random.get_state()),  # noqa: NPY002 - the global one is what is watched
        "seterr": np.geterr(),
        "printoptions": np.get_printoptions(),
        "warnings": list(warnings.filters),
        "showwarning": warnings.showwarning,
        "BLAS threads": {library.filepath: library.num_threads for library in libraries},
        "signals": {number: signal.getsignal(number) for number in signal.valid_signals()},
        "locale": locale.setlocale(locale.LC_ALL),
        "rcParams": dict(mpl.rcParams),
        "backend": mpl.get_backend(),
        "figures": pyplot.get_fignums(),
        "environ": dict(os.environ),
        "directory": Path.cwd(),
        "threads": threading.active_count(),
        "recursion": sys.getrecursionlimit(),
        "stdout": (sys.stdout, sys.stderr, sys.excepthook),
    }


@pytest.fixture(scope="module")
def solved() -> hv.Solution:
    return hv.solve(hv.discretize(square(n=8)))


def refused_formula(formula: str) -> None:
    with pytest.raises(hv.errors.ProblemError):
        hv.FormulaLaw(formula)


PUBLIC: dict[str, Callable[[hv.Solution, Path], object]] = {
    "rectangle": lambda s, path: hv.rectangle((1.0, 1.0), (4, 4)).refined(),
    "box": lambda s, path: hv.box((1.0, 1.0, 1.0), (2, 2, 2)),
    "discretize": lambda s, path: hv.discretize(square(n=4)),
    "solve": lambda s, path: hv.solve(s.problem),
    "solve by multigrid": lambda s, path: hv.solve(unstructured(32), hv.solvers.NonsmoothMultigrid()),
    "solve by every method": lambda s, path: [
        hv.solve(hv.discretize(square(n=4)), method, hv.Controls(max_steps=5)) for method in hv.solvers.METHODS.values()
    ],
    "solve_nested": lambda s, path: hv.solvers.solve_nested([hv.discretize(square(n=n)) for n in (2, 4)]),
    "certify": lambda s, path: hv.certify(s.problem, s.unknowns, s.multiplier),
    "smallness": lambda s, path: hv.certificates.smallness(s.problem),
    "residual": lambda s, path: hv.discrete.residual(s.problem, s.unknowns, s.multiplier),
    "condense": lambda s, path: hv.systems.condense(s.problem),
    "find_solutions": lambda s, path: hv.find_solutions(
        bar(0.5, hv.laws.ThresholdCompliance(0.3, 2.0)), enumerate_up_to=0, starts=3
    ),
    "follow_path": lambda s, path: hv.follow_path(bar(0.5, hv.laws.ThresholdCompliance(0.3, 2.0))),
    "laws": lambda s, path: [
        hv.FormulaLaw("10 * max(r, 0)^2 + sqrt(1 + abs(r))"),
        hv.laws.PenetrationBound("min(8*s, 0.8)"),
        hv.table_law([0.0, 0.01, 0.02], [0.0, 1.0, 0.5]),
    ],
    "refused": lambda s, path: refused_formula("foo(r)"),
    "figures": lambda s, path: report.save(report.plot_solution(s), path / "figure.png"),
    "contact figures": lambda s, path: report.save(report.plot_contact(s), path / "figure.svg"),
    "files": lambda s, path: [files.write_csv(s, path / "x.csv"), files.write_vtu(s, path / "x.vtu")],
}


@pytest.mark.parametrize("name", sampled(PUBLIC, 3))
def test_nothing_global_changes(name: str, solved: hv.Solution, tmp_path: Path) -> None:
    PUBLIC[name](solved, tmp_path)  # what the first use imports is not watched
    before = process_state()
    PUBLIC[name](solved, tmp_path)
    after = process_state()
    assert [key for key in before if before[key] != after[key]] == []


def test_read_problem_changes_nothing_global(tmp_path: Path) -> None:
    file = tmp_path / "problem.toml"
    file.write_text(TOML, encoding="utf-8")
    before = process_state()
    hv.read_problem(file)
    assert process_state() == before


def test_importing_every_room_changes_nothing_global() -> None:
    code = (
        "import numpy as np, warnings, os, signal, locale, pickle\n"
        "import scipy.special, pyamg, skfem  # what these do is theirs\n"
        "def state(): return (pickle.dumps(np.random.get_state()), np.geterr(), list(warnings.filters),"
        " dict(os.environ), [signal.getsignal(s) for s in signal.valid_signals()], locale.setlocale(locale.LC_ALL))\n"
        "before = state()\n"
        "import hemivar, hemivar.report, hemivar.branches, hemivar.files.problem_file, hemivar.gallery, hemivar.cli\n"
        "[getattr(hemivar, name) for name in hemivar.__all__]\n"
        "print(before == state())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["True"], done.stderr


def test_algebraic_levels_repeat_bit_by_bit() -> None:
    problem = unstructured(32)
    np.random.seed(1)  # noqa: NPY002 - must not matter
    given = problem.stiffness, near_kernel(problem.field), node_slots(problem.field, problem.stiffness)
    first = algebraic_levels(*given)
    np.random.seed(2)  # noqa: NPY002
    second = algebraic_levels(*given)
    assert first
    for (matrix, transfer), (again, other) in zip(first, second, strict=True):
        np.testing.assert_array_equal(matrix.data, again.data)
        np.testing.assert_array_equal(transfer.prolongation.data, other.prolongation.data)


def test_solves_repeat_bit_by_bit() -> None:
    found = [hv.solve(unstructured(32), hv.solvers.NonsmoothMultigrid()) for _ in range(2)]
    np.testing.assert_array_equal(found[0].unknowns, found[1].unknowns)
    np.testing.assert_array_equal(found[0].multiplier, found[1].multiplier)


def test_algebraic_levels_warn_of_nothing() -> None:
    problem = unstructured(32)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert algebraic_levels(
            problem.stiffness, near_kernel(problem.field), node_slots(problem.field, problem.stiffness)
        )


@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=["newton", "multigrid"]
)
def test_threads_solve_one_problem(method: object) -> None:
    """At the same time, and with other loads on the same levels: each as if it were alone."""
    problem = unstructured(24)
    light = hv.solve(problem, method).problem.with_(law=problem.law)  # shares the levels
    expected = hv.solve(unstructured(24), method)
    barrier = threading.Barrier(4)

    def work(which: hv.DiscreteProblem) -> hv.Solution:
        barrier.wait(30)
        return hv.solve(which, method)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(work, [problem, light, problem, light]))
    for solution in found:
        assert solution.status is hv.Status.CONVERGED
        np.testing.assert_allclose(solution.unknowns, expected.unknowns, rtol=0.0, atol=1e-13)


def test_a_certificate_beside_a_solve(monkeypatch: pytest.MonkeyPatch) -> None:
    from hemivar.certificates import norms

    monkeypatch.setattr(norms, "FACTORISED", (10, 10))
    problem = unstructured(24)
    solution = hv.solve(problem, hv.solvers.NonsmoothMultigrid())
    expected = hv.certify(problem, solution.unknowns, solution.multiplier).record()
    with ThreadPoolExecutor(2) as pool:
        solving = pool.submit(lambda: [hv.solve(problem, hv.solvers.NonsmoothMultigrid()) for _ in range(3)])
        certifying = pool.submit(lambda: hv.certify(problem, solution.unknowns, solution.multiplier))
        found, solutions = certifying.result().record(), solving.result()
    assert all(other.status is hv.Status.CONVERGED for other in solutions)
    assert found["kind"] == expected["kind"]
    for key in ("equilibrium", "margin", "error_bound"):
        assert found[key] == pytest.approx(expected[key], rel=1e-6, abs=1e-15), key
