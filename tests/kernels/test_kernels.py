"""The compiled kernels against those of pyamg: the same answers, the same bits, nothing read that is not there."""

from __future__ import annotations

import copy
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar import gallery
from hemivar.discrete.contact import contact_unknowns
from hemivar.discrete.problem import DiscreteProblem
from hemivar.kernels import kernels, threads
from hemivar.kernels import library as library_module
from hemivar.kernels.mesh_sums import mesh_edges
from hemivar.linear import Hierarchy
from hemivar.linear.compiled import CompiledLevels, CompiledTruncation, NodeSlots
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import Levels, Preconditioner, Transfer, Truncated
from hemivar.linear.products import diagonal
from hemivar.linear.truncated_level import narrow
from hemivar.systems.body_on_levels import ElasticMultigrid
from tests.samples import slow

built = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")


@pytest.fixture
def forget() -> Iterator[None]:
    """What is known of the library is found out anew, and forgotten at the end."""
    kernels.cache_clear()
    yield
    kernels.cache_clear()
    kernels()


def survey_square(n: int = 64) -> DiscreteProblem:
    return hv.discretize(gallery.survey("5.1", n, "right"))


def survey_cube(n: int = 12) -> DiscreteProblem:
    return hv.discretize(gallery.survey_cube("5.1", n))


def energy_norm(problem: DiscreteProblem, v: np.ndarray) -> float:
    return float(np.sqrt(v @ (problem.stiffness @ v)))


@pytest.mark.skipif(shutil.which("g++") is None, reason="no compiler here")
def test_what_runs_them_under_sanitizers_fits_their_headers() -> None:
    here = Path(__file__).parent
    headers = here.parents[1] / "src" / "hemivar" / "kernels"
    call = ["g++", "-std=c++17", "-fsyntax-only", f"-I{headers}", str(here / "driver.cpp")]
    compiler = subprocess.run(call, capture_output=True, text=True)
    assert compiler.returncode == 0, compiler.stderr


def test_the_environment_says_how_many_threads_and_whether_at_all(
    monkeypatch: pytest.MonkeyPatch, forget: None
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3,2")
    monkeypatch.delenv("HEMIVAR_NUM_THREADS", raising=False)
    assert threads() == 3
    monkeypatch.setenv("HEMIVAR_NUM_THREADS", "2")
    assert threads() == 2
    monkeypatch.setenv("HEMIVAR_NUM_THREADS", "many")
    assert threads() == 3
    monkeypatch.delenv("OMP_NUM_THREADS")
    assert 1 <= threads() <= (os.cpu_count() or 1)
    monkeypatch.setenv("HEMIVAR_KERNELS", "none")
    assert kernels() is None


def test_a_library_that_is_damaged_or_of_another_version_is_left_alone(
    monkeypatch: pytest.MonkeyPatch, forget: None, tmp_path: Path
) -> None:
    (tmp_path / "_compiled.kernels.so").write_bytes(b"no library")
    monkeypatch.setattr(library_module, "__file__", str(tmp_path / "library.py"))
    assert kernels() is None


@built
@pytest.mark.parametrize("make", [survey_square, survey_cube])
@pytest.mark.parametrize("law", ["stated", "stiff friction"])
def test_contact_and_linear_solves_agree_with_those_without(
    make: object, law: str, monkeypatch: pytest.MonkeyPatch, forget: None
) -> None:
    problem = make()  # type: ignore[operator]
    if law == "stiff friction":
        stiff = hv.laws.ContactLaw(hv.laws.Signorini(), hv.laws.Tresca(0.05))
        problem = problem.with_(law=stiff.at(problem.contact.points))
    found = {}
    for kind in ("none", "auto"):
        monkeypatch.setenv("HEMIVAR_KERNELS", kind)
        kernels.cache_clear()
        hierarchy = ElasticMultigrid.of(problem)
        assert (hierarchy.levels.compiled is None) == (kind == "none")
        method = hv.solvers.NonsmoothMultigrid(tolerance=1e-12)
        solution = hv.solve(problem, method, hv.Controls(rtol=1e-11))
        assert solution.status is hv.Status.CONVERGED
        found[kind] = hierarchy.solve(problem.load, 1e-12)[0], solution.unknowns
    for one, other in zip(found["none"], found["auto"], strict=True):
        assert energy_norm(problem, one - other) <= 1e-9 * energy_norm(problem, one)


@built
@pytest.mark.parametrize("make", [survey_square, survey_cube])
def test_rows_of_contact_unknowns_are_changed_as_without(make: object) -> None:
    problem = make()  # type: ignore[operator]
    levels = ElasticMultigrid.of(problem).levels
    top = len(levels.sizes) - 1
    unknown = contact_unknowns(problem.contact)[0]
    rng = np.random.default_rng(3)
    held = rng.uniform(size=unknown.size) < 0.4
    added = sp.diags_array(np.where(held, 0.0, problem.stiffness.diagonal()[unknown]))
    truncated = Truncated(levels, top)
    truncated.change(held, sp.csr_array(added))
    x = rng.standard_normal(problem.unknowns)
    x[unknown[held]] = 0.0
    expected = truncated.matrix(top) @ x
    np.testing.assert_allclose(truncated.multiply(top, x), expected, atol=1e-12 * np.abs(expected).max())
    assert not truncated.fast_cycle(top, x)[unknown[held]].any()


@built
@pytest.mark.parametrize("weights", ["of entries", "of nodes", "of nodes but one"])
@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_cycle_is_that_of_dense_matrices(d: int, weights: str) -> None:
    """Sweeps by nodes around an exact coarse solve; unknowns that are missing or turned, other columns in every row."""
    rng, nodes, few = np.random.default_rng(10 * d + len(weights)), 60, 7
    there, below = rng.random((nodes, d)) < 0.8, rng.random((few, d)) < 0.8
    there[:, 0] = below[:, 0] = True
    place, n = np.flatnonzero(there), int(there.sum())
    A = np.where(rng.random((n, n)) < 0.1, rng.standard_normal((n, n)), 0.0)
    A = A + A.T
    A += np.diag(np.abs(A).sum(axis=1) + 0.1)
    size = 10.0 ** rng.uniform(-2, 2, nodes)[place // d]
    A = A * size * size[:, None]
    nodal = np.where(rng.random((nodes, few)) < 0.3, rng.uniform(0.2, 1.0, (nodes, few)), 0.0)
    P = np.kron(nodal, np.eye(d))
    if weights == "of entries":
        P = np.kron(nodal, np.ones((d, d))) * rng.uniform(size=(nodes * d, few * d))
    P = P[np.ix_(place, np.flatnonzero(below))]
    if weights == "of nodes but one":
        P[tuple(np.argwhere(P)[n // 2])] = 0.0
    signs = np.where(rng.random(n) < 0.5, -1.0, 1.0)
    P *= signs[:, None]
    coarse = P.T @ A @ P
    slots = [NodeSlots(np.flatnonzero(below), d, few), NodeSlots(place, d, nodes, signs)]
    none = [np.zeros(0, dtype=int)] * 2
    levels = Levels([sp.csr_array(coarse), sp.csr_array(A)], [Transfer.of(sp.csr_array(P))], none, none, slots=slots)
    assert levels.compiled is not None
    b = size * rng.standard_normal(n)
    lower = np.where(place[:, None] // d >= place // d, A, 0.0)
    expected = np.linalg.solve(lower, b)
    expected += P @ np.linalg.solve(coarse, P.T @ (b - A @ expected))
    expected += np.linalg.solve(lower.T, b - A @ expected)
    found = levels._whole.fast_cycle(1, b)
    np.testing.assert_allclose(found * size, expected * size, atol=2e-5 * np.abs(expected * size).max())


_RUN = """
import sys, hashlib, numpy as np, hemivar as hv
from dataclasses import replace
from hemivar import gallery
from hemivar.kernels import kernels, threads
for problem in hv.discretize(gallery.survey("5.1", 96, "right")), hv.discretize(gallery.survey_cube("5.1", 14)):
    found = hv.solve(problem, hv.solvers.NonsmoothMultigrid())
    print(hashlib.sha256(found.unknowns.tobytes()).hexdigest())
stated = gallery.survey("5.1", 16, "right")
stated = replace(stated, material=replace(stated.material, density=1.0, viscosity=(0.4, 0.4)))
print(hashlib.sha256(hv.solve(stated).unknowns.tobytes()).hexdigest())
history = hv.march(hv.Evolution(stated, inertia=True), 0.1, step=0.01)
print(hashlib.sha256(history.state.body.displacement.tobytes()).hexdigest())
assert kernels() is not None
print(threads(), file=sys.stderr)
"""


def printed_by_threads(code: str, counts: Iterable[str]) -> set[str]:
    """What processes with so many threads print of their results; on standard error each says how many it has."""
    outputs = set()
    for count in counts:
        environment = os.environ | {"HEMIVAR_NUM_THREADS": count, "HEMIVAR_KERNELS": "auto", "OMP_NUM_THREADS": "1"}
        run = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert run.returncode == 0, run.stderr
        assert run.stderr.split() == [count]
        outputs.add(run.stdout)
    return outputs


@built
@pytest.mark.parametrize("counts", [("1", "5"), slow(("1", "2", "5"))], ids=",".join)
def test_bits_do_not_depend_on_the_number_of_threads(counts: tuple[str, ...]) -> None:
    assert len(printed_by_threads(_RUN, counts)) == 1


_FORK = """
import os, sys, threading, numpy as np, hemivar as hv
from hemivar import gallery
from hemivar.systems.body_on_levels import ElasticMultigrid
problem = hv.discretize(gallery.survey("5.1", 96, "right"))
levels = ElasticMultigrid.of(problem).levels
top = len(levels.sizes) - 1
whole = levels._whole
expected = whole.fast_cycle(top, problem.load)
ends = []
def turn():
    for _ in range(50):
        ends.append(np.array_equal(whole.fast_cycle(top, problem.load), expected))
others = [threading.Thread(target=turn) for _ in range(3)]
for one in others: one.start()
for _ in range(5):
    child = os.fork()
    if child == 0:
        os._exit(0 if np.array_equal(whole.fast_cycle(top, problem.load), expected) else 3)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
for one in others: one.join()
assert all(ends) and len(ends) == 150
"""


@built
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_threads_share_a_hierarchy_and_forked_children_go_on_with_it() -> None:
    environment = os.environ | {"HEMIVAR_NUM_THREADS": "3", "HEMIVAR_KERNELS": "auto"}
    run = subprocess.run(
        [sys.executable, "-c", _FORK], env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stderr


@built
def test_a_body_that_hardly_anything_holds_is_solved_in_double_precision() -> None:
    """Springs of 1e-11 of its stiffness hold it: what single precision sees of them is rounding."""
    n = 40
    one = sp.diags_array([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1]).toarray()
    one[0, 0] = one[-1, -1] = 1.0
    A = sp.csr_array(sp.kron(one, sp.eye_array(n)) + sp.kron(sp.eye_array(n), one) + 1e-11 * sp.eye_array(n * n))
    hierarchy = Hierarchy.of(A)
    assert hierarchy.stack.compiled is not None
    b = np.random.default_rng(1).standard_normal(n * n)
    b += 1e-9 - b.mean()
    x, _ = hierarchy.solve(b, 1e-10)
    assert np.linalg.norm(b - A @ x) <= 2e-10 * np.linalg.norm(b)


class _Bad:
    """A cycle in single precision that does nothing, and one in double precision that is exact."""

    single = True

    def __init__(self, answer: float) -> None:
        self.answer, self.exact = answer, 0

    def fast_cycle(self, k: int, right: np.ndarray) -> np.ndarray:
        return self.answer * np.arange(1.0, right.size + 1.0) * right

    def cycle(self, k: int, right: np.ndarray) -> np.ndarray:
        self.exact += 1
        return right / np.arange(1.0, right.size + 1.0) ** 2


@pytest.mark.parametrize("answer", [1.0, -1.0, np.nan, np.inf])
def test_cycles_that_are_no_good_are_given_up(answer: float) -> None:
    A, b = sp.diags_array(np.arange(1.0, 41.0) ** 2), np.ones(40)
    bad = _Bad(answer)
    cycle = Preconditioner(bad, 0)  # type: ignore[arg-type]
    found = conjugate_gradients(sp.csr_array(A), A.diagonal(), b, cycle, 1e-10, 100, flexible=True)
    assert bad.exact > 0
    np.testing.assert_allclose(A @ found.solution, b, atol=1e-9)


def levels_of_a_line(n: int = 9) -> tuple[list[sp.csr_array], list[Transfer]]:
    fine = sp.csr_array(sp.diags_array([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1]))
    P = sp.csr_array(np.kron(np.eye((n + 1) // 2), np.ones((2, 1)))[:n])
    fine.indices, fine.indptr = fine.indices.astype(np.int32), fine.indptr.astype(np.int32)
    coarse = sp.csr_array(P.T @ fine @ P)
    coarse.sort_indices()
    coarse.indices, coarse.indptr = coarse.indices.astype(np.int32), coarse.indptr.astype(np.int32)
    return [coarse, fine], [Transfer.of(P)]


@built
def test_wrong_arrays_are_refused_at_the_door() -> None:
    library = kernels()
    assert library is not None

    def make(change: str) -> CompiledLevels:
        matrices, transfers = levels_of_a_line()
        A, n = matrices[1], 9
        contacts = [np.zeros(0, dtype=int), np.array([1, 4])]
        slots = [NodeSlots.single(5), NodeSlots.single(n)]
        scope = {"A": A, "P": transfers[0].prolongation, "np": np, "contacts": contacts, "slots": slots}
        scope |= {"NodeSlots": NodeSlots, "n": n}
        exec(change, scope)
        return CompiledLevels(library, matrices, transfers, contacts, slots)

    levels = make("pass")
    for change in (
        "A.indices[3] = 9",
        "A.indices[3] = -1",
        "A.indptr[2] = 99",
        "A.indptr[-1] += 1",
        "A.indptr[0] = 1",
        "A.data = A.data.astype(np.float32)",
        "A.indices = A.indices.astype(np.int64)",
        "A.data = np.repeat(A.data, 2)[::2]",
        "A.data = A.data[:-1]",
        "P.indices[0] = 5",
        "contacts[1] = np.array([4, 1])",
        "contacts[1] = np.array([1, 9])",
        "contacts[1] = np.array([-1])",
        "slots[1] = NodeSlots(np.arange(n), 1, n - 1)",
        "slots[1] = NodeSlots(np.zeros(n, dtype=int), 1, n)",
        "slots[1] = NodeSlots(np.arange(n), 4, n)",
        "slots[1] = NodeSlots(np.arange(n - 1), 1, n)",
        "slots[0] = NodeSlots.single(4)",
    ):
        with pytest.raises(ValueError, match=r"must|places|shape"):
            make(change)
    truncation = CompiledTruncation(levels)
    entries = levels.entries[1][1]
    for held, values in (
        (np.zeros(3, dtype=bool), np.zeros(entries)),
        (np.zeros(2, dtype=bool), np.zeros(entries + 1)),
    ):
        with pytest.raises(ValueError, match="contact unknowns and entries"):
            truncation.change(1, held, values)
    with pytest.raises(ValueError, match="another size"):
        truncation.set_root(np.eye(4))
    truncation.set_root(np.eye(5))
    for wrong in (np.zeros(8), np.zeros(10), np.zeros((9, 1))):
        with pytest.raises(ValueError, match="9 unknowns"):
            truncation.cycle(1, wrong)
        with pytest.raises(ValueError, match="9 unknowns"):
            levels.multiply(1, wrong)
    x = np.zeros(9)
    with pytest.raises(ValueError, match="vector of 9"):
        library.advance(1.0, np.zeros(8), x, x.copy(), x.copy())
    with pytest.raises(ValueError, match="in place"):
        library.advance(1.0, x, x, np.zeros(18)[::2], x.copy())
    with pytest.raises(ValueError, match="vector of 9"):
        library.products(x, np.zeros(10), x)
    with pytest.raises(ValueError, match="in place"):
        library.turn(1.0, x, np.zeros(18)[::2])
    assert np.isfinite(truncation.cycle(1, np.arange(9)[::-1])).all()


@built
@pytest.mark.parametrize("n", [1, 3, 4, 8191, 8192, 30_001])
def test_sums_and_steps_of_conjugate_gradients_are_those_of_numpy(n: int) -> None:
    library, rng = kernels(), np.random.default_rng(n)
    assert library is not None
    z, r, q, p = rng.standard_normal((4, n))
    diagonal = rng.uniform(1.0, 2.0, n)
    bits = []
    try:
        for count in (1, 2, 3):
            library.call.hv_set_threads(count)
            sums = [*library.products(z, r, q), *library.curvature(p, q, diagonal)]
            np.testing.assert_allclose(sums, [z @ r, z @ q, p @ q, p @ (diagonal * p)], atol=1e-13 * n)
            x, rest, turned = q.copy(), r.copy(), p.copy()
            square = library.advance(0.3, p, q, x, rest)
            library.turn(-0.7, z, turned)
            np.testing.assert_allclose(x, q + 0.3 * p, atol=1e-15)
            np.testing.assert_allclose(rest, r - 0.3 * q, atol=1e-15)
            np.testing.assert_allclose(square, rest @ rest, rtol=1e-13)
            np.testing.assert_allclose(turned, z - 0.7 * p, atol=1e-15)
            bits.append([*sums, square, *turned[:3]])
    finally:
        library.call.hv_set_threads(threads())
    assert bits[0] == bits[1] == bits[2]


@built
def test_a_diagonal_is_found_without_reading_all_entries(monkeypatch: pytest.MonkeyPatch, forget: None) -> None:
    rng, n = np.random.default_rng(4), 5000
    places, count = rng.integers(0, n, (2, 25_000)), 25_000
    scattered = sp.csr_array((rng.standard_normal(count), (places[0], places[1])), shape=(n, n))
    A = sp.csr_array(scattered + sp.diags_array(rng.standard_normal(n)))
    A.data[A.indices == 7] = 0.0
    A.eliminate_zeros()  # a row whose diagonal entry is not there
    narrowed = narrow(A)
    np.testing.assert_array_equal(diagonal(narrowed), A.diagonal())
    for other in (A, sp.csr_array((A.data, A.indices[::-1].copy(), A.indptr), shape=A.shape)):
        np.testing.assert_array_equal(diagonal(other), other.diagonal())
    library = kernels()
    assert library is not None
    starts, columns, numbers = narrowed.indptr, narrowed.indices, narrowed.data
    beyond = starts.copy()
    beyond[9] = columns.size + 1
    for parts in (
        (starts.astype(np.int64), columns, numbers),
        (starts, columns[::2], numbers[::2]),
        (starts, columns[:-1], numbers),
        (starts, columns, numbers.astype(np.float32)),
        (starts[:0], columns, numbers),
        (starts[::-1].copy(), columns, numbers),
        (-starts, columns, numbers),
        (beyond, columns, numbers),
    ):
        with pytest.raises(ValueError, match=r"must|cannot hold"):
            library.diagonal(*parts)
    with monkeypatch.context() as patch:
        patch.setenv("HEMIVAR_KERNELS", "none")
        kernels.cache_clear()
        np.testing.assert_array_equal(diagonal(narrowed), A.diagonal())


@built
def test_copies_of_a_hierarchy_work_by_themselves() -> None:
    problem = survey_square(24)
    hierarchy = ElasticMultigrid.of(problem).hierarchy
    expected = hierarchy.solve(problem.load)[0]
    for other in (copy.deepcopy(hierarchy), pickle.loads(pickle.dumps(hierarchy))):
        assert other.stack.compiled is not hierarchy.stack.compiled
        np.testing.assert_array_equal(other.solve(problem.load)[0], expected)
    with pytest.raises(TypeError, match="this process"):
        pickle.dumps(hierarchy.stack.compiled)


@built
def test_sizes_and_units_do_not_matter() -> None:
    matrices, transfers = levels_of_a_line()
    none = [np.zeros(0, dtype=int)] * 2
    b = np.random.default_rng(2).standard_normal(9)
    expected = Levels(matrices, transfers, none, none)._whole.fast_cycle(1, b)
    for size, load in ((2.0**200, 1.0), (2.0**-200, 2.0**-300), (1.0, 2.0**-900)):
        scaled = [sp.csr_array((size * A.data, A.indices, A.indptr), shape=A.shape) for A in matrices]
        found = Levels(scaled, transfers, none, none)._whole.fast_cycle(1, load * b)
        np.testing.assert_allclose(found * (size / load), expected, rtol=1e-6)


@built
def test_arrays_that_levels_keep_cannot_be_written_to() -> None:
    """Products read memory where the columns lead."""
    library = kernels()
    assert library is not None
    A = sp.csr_array(np.diag(np.arange(1.0, 6.0)))
    A.indices, A.indptr = A.indices.astype(np.int32), A.indptr.astype(np.int32)
    levels = CompiledLevels(library, [A], [], [np.zeros(0, dtype=int)], [NodeSlots.single(5)])
    for part in (levels.matrices[0].data, levels.matrices[0].indices, levels.matrices[0].indptr):
        with pytest.raises(ValueError, match="read-only"):
            part[0] = 0
    np.testing.assert_array_equal(levels.multiply(0, np.ones(5)), np.arange(1.0, 6.0))


@built
def test_a_lack_of_memory_is_called_one(monkeypatch: pytest.MonkeyPatch) -> None:
    library = kernels()
    assert library is not None
    for name in ("hv_edges_new", "hv_turn", "hv_advance", "hv_curvature", "hv_products", "hv_multiply", "hv_diagonal"):
        monkeypatch.setattr(library.call, name, lambda *_: 1)
    one = np.ones(3)
    mesh = hv.rectangle((1.0, 1.0), 1)
    for call in (
        lambda: mesh_edges(mesh.cells, mesh.number_of_nodes),
        lambda: library.turn(1.0, one, one.copy()),
        lambda: library.advance(1.0, one, one, one.copy(), one.copy()),
        lambda: library.curvature(one, one, one),
        lambda: library.products(one, one, one),
        lambda: library.diagonal(np.arange(4, dtype=np.int32), np.arange(3, dtype=np.int32), one),
    ):
        with pytest.raises(MemoryError):
            call()
