"""Singular and indefinite stiffness matrices: no claim of a unique solution, or of a minimiser, rests on rounding."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.certificates import PointKind, certify
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.discrete import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import discretize
from hemivar.laws import Compliance, ContactLaw, Signorini
from hemivar.linear import products
from hemivar.linear.definite import below_zero, indefinite, quotient, rounding
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Roller
from hemivar.mesh import rectangle
from hemivar.solvers import METHODS, NonsmoothMultigrid, Status, solve
from hemivar.systems.free_unknowns import free_unknowns
from tests import bodies
from tests.samples import slow


def between_walls(cells: int, angle: float, *, clamped: bool = False) -> DiscreteProblem:
    """A square on rollers between two walls with gaps, turned: it may move from wall to wall."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    wall = Contact(Signorini(), gap=0.1)
    statement = ContactProblem(
        rectangle((1.0, 1.0), cells).moved(turn),
        Material.lame(4.0, 4.0),
        {"left": wall, "right": wall},
        {"bottom": Clamped() if clamped else Roller()},
        body_force=tuple(turn @ (0.0, -0.5)),
    )
    return discretize(statement, check_coercivity=False)


def arrays_of(problem: DiscreteProblem) -> DiscreteProblem:
    return DiscreteProblem.of_arrays(
        problem.stiffness,
        problem.load,
        problem.contact.trace,
        problem.contact.weights,
        problem.gap,
        problem.law,
        slip_offset=problem.offset[:, 1:],
    )


@pytest.mark.parametrize(
    ("cells", "angle", "by_arrays"),
    [
        (cells, angle, arrays) if (cells, arrays) != (64, True) else slow(cells, angle, arrays)
        for cells, angle in ((3, 0.05), (3, 0.1), (64, 0.0), (5, 0.7), (8, 2.2))
        for arrays in (False, True)
    ],
)
def test_body_that_may_slide_is_nowhere_called_unique(cells: int, angle: float, by_arrays: bool) -> None:
    problem = between_walls(cells, angle)
    problem = arrays_of(problem) if by_arrays else problem
    solution = solve(problem)
    assert solution.status is Status.CONVERGED
    for factor in (energy_norm(problem), EnergyNorm(problem.stiffness), EnergyNorm.by_multigrid(problem)):
        if not factor.factorised and problem.unknowns < 200:
            continue
        assert not factor.definite
        found = certify(problem, solution.unknowns, solution.multiplier, factor=factor, trace_constant=False)
        assert found.kind is PointKind.GLOBAL_MINIMISER
        assert found.unique is None
        assert found.error_bound == np.inf
        assert found.margin == -np.inf


def test_many_turned_squares() -> None:
    for angle in np.linspace(0.0, 3.1, 120):
        problem = between_walls(3, float(angle))
        assert not EnergyNorm(problem.stiffness).definite
        assert EnergyNorm(between_walls(3, float(angle), clamped=True).stiffness).definite


def test_held_bodies_stay_unique() -> None:
    """Slender, fine and stiffly mixed bodies are definite all the same."""
    for size, cells in (((1.0, 1.0), (64, 64)), ((100.0, 1.0), (400, 4)), ((1.0, 1.0), (2, 300))):
        statement = bodies.strip(Compliance(1.0), cells, size=size)
        problem = discretize(statement)
        assert energy_norm(problem).definite
        assert EnergyNorm(problem.stiffness).definite


def own(K: np.ndarray, load: np.ndarray, contact: list[int], law: ContactLaw | None = None) -> DiscreteProblem:
    m = len(contact)
    trace = np.zeros((m, len(load)))
    trace[range(m), contact] = 1.0
    law = ContactLaw(Compliance(1.0)) if law is None else law
    return DiscreteProblem.of_arrays(K, load, trace, np.ones(m), np.zeros(m), law.at(None))  # type: ignore[arg-type]


def spectrum(rng: np.random.Generator, eigenvalues: np.ndarray) -> np.ndarray:
    n = len(eigenvalues)
    axes = np.linalg.qr(rng.standard_normal((n, n)))[0]
    K = (axes * eigenvalues) @ axes.T
    return 0.5 * (K + K.T)


def indefinite_arrays(scale: float) -> Iterator[DiscreteProblem]:
    """Forty problems with one eigenvalue below zero."""
    rng = np.random.default_rng(3)
    count = 0
    while count < 40:
        n = int(rng.integers(2, 9))
        values = rng.random(n) + 0.1
        values[0] = -(10.0 ** rng.uniform(-6.0, -0.3))
        K = scale * spectrum(rng, values)
        if np.diag(K).min() <= 0.0:
            continue
        count += 1
        contact = sorted(rng.choice(n, int(rng.integers(1, n + 1)), replace=False).tolist())
        law = ContactLaw(Signorini() if count % 2 else Compliance(scale))
        yield own(K, scale * rng.standard_normal(n), contact, law)


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e12])
def test_indefinite_arrays_are_refused_everywhere(scale: float) -> None:
    for problem in indefinite_arrays(scale):
        for work in (
            lambda p: solve(p),
            lambda p: solve(p, NonsmoothMultigrid()),
            lambda p: certify(p, np.zeros(p.unknowns)),
        ):
            with pytest.raises(ProblemError, match=r"not positive semidefinite.*eigenvalue is at most -"):
                work(problem)


@pytest.mark.parametrize("method", METHODS)
def test_indefinite_arrays_are_refused_by_every_method(method: str) -> None:
    K = np.array([[1.0, 0.0, 1.2], [0.0, 1.0, 0.0], [1.2, 0.0, 1.0]])
    with pytest.raises((ProblemError, MethodError), match="not positive semidefinite"):
        solve(own(K, np.ones(3), [0, 1]), METHODS[method])
    with pytest.raises((ProblemError, MethodError), match="not positive semidefinite"):
        solve(own(K, np.ones(3), [1]), METHODS[method])


def test_semidefinite_arrays_are_not_refused() -> None:
    rng = np.random.default_rng(8)
    for _ in range(60):
        n = int(rng.integers(2, 9))
        values = rng.random(n) + 0.1
        values[0] = 0.0
        K = spectrum(rng, values)
        kernel = np.linalg.eigh(K)[1][:, 0]
        load = rng.standard_normal(n)
        load -= kernel * (kernel @ load)
        problem = own(K, load, [0])
        assert indefinite(problem.stiffness) is None
        assert not energy_norm(problem).definite
        solution = solve(problem)
        assert solution.status is Status.CONVERGED
        found = certify(problem, solution.unknowns, solution.multiplier)
        assert found.kind in (PointKind.GLOBAL_MINIMISER, PointKind.NOT_STATIONARY)


@pytest.mark.parametrize("negative", [1e-3, 1e-6])
def test_large_indefinite_arrays(negative: float) -> None:
    """One negative eigenvalue in a matrix with a mesh behind it that it does not tell."""
    made = between_walls(80, 0.0, clamped=True)
    j = int(np.setdiff1d(np.arange(made.unknowns), made.contact.trace.indices)[40])
    K = made.stiffness.tolil()
    diagonal = float(K[j, j])
    inverse = EnergyNorm(made.stiffness).solve(np.eye(1, made.unknowns, j).ravel())[j]
    K[j, j] = diagonal - (1.0 + negative) / inverse  # what makes it singular, and a little more
    assert K[j, j] > 0.0
    problem = DiscreteProblem.of_arrays(
        sp.csr_array(K), made.load, made.contact.trace, made.contact.weights, made.gap, made.law
    )
    at_rest = np.zeros(problem.unknowns)
    for work in (
        lambda: solve(problem),
        lambda: certify(problem, at_rest),
        lambda: certify(problem, at_rest, factor=EnergyNorm.by_multigrid(problem)),
    ):
        with pytest.raises(ProblemError, match="semidefinite"):
            work()


def test_springs_added_to_the_stiffness_of_a_mesh_count() -> None:
    """The motions of the mesh are not those of a matrix that resists them."""
    made = between_walls(4, 0.3)
    free = free_unknowns(made)
    assert free is not None
    assert free.shape[1] == 1
    stiffer = DiscreteProblem.of_arrays(
        made.stiffness + sp.eye_array(made.unknowns),
        made.load,
        made.contact.trace,
        made.contact.weights,
        made.gap,
        made.law,
        slip_offset=made.offset[:, 1:],
        points=made.contact.points,
        frames=made.contact.frames,
        field=made.field,
    )
    assert free_unknowns(stiffer) is None
    assert energy_norm(stiffer).definite
    solution = solve(stiffer)
    assert certify(stiffer, solution.unknowns, solution.multiplier).kind is PointKind.UNIQUE_MINIMISER


def test_rounding_of_some_rows_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = between_walls(4, 0.3)
    root = np.sqrt(problem.stiffness.diagonal())
    largest = (np.abs(problem.stiffness.toarray()) / np.outer(root, root)).sum(axis=1).max()
    for rows in (3, 1000):
        monkeypatch.setattr(products, "_ROWS", rows)
        assert rounding(problem.stiffness) == pytest.approx(64.0 * np.finfo(float).eps * largest, rel=1e-12)


def test_what_rounded_entries_make_of_an_eigenvalue_that_is_zero_is_not_below_zero() -> None:
    """``v v'``, |v_i| = 1, with entries a rounding off: an eigenvalue is -n eps, for n of them add up in every row."""
    n, eps = 300, np.finfo(float).eps
    v, w = np.resize([1.0, -1.0], n), np.resize([1.0, 1.0, -1.0, -1.0], n)  # orthogonal
    for off, counts in ((eps, False), (1e-9, True)):
        K = np.outer(v, v) - off * np.outer(w, w)
        B = np.eye(1, n)
        problem = DiscreteProblem.of_arrays(K, np.zeros(n), B, np.ones(1), np.zeros(1), ContactLaw(Signorini()))
        lowest = quotient(problem.stiffness, w)
        assert lowest == pytest.approx(-n * off, rel=1e-3)
        assert (below_zero(problem.stiffness, lowest) is not None) == counts
        down = -np.arange(1.0, n + 1.0)
        assert quotient(problem.stiffness, down) == quotient(problem.stiffness, -down)


@pytest.mark.parametrize("stiffness", [1.0, -1.0])
def test_motions_are_not_free_where_a_spring_was_added(stiffness: float) -> None:
    """Also one that pulls, and so gives forces of the other sign."""
    problem = between_walls(3, 0.0)
    free = free_unknowns(problem)
    assert free is not None
    row = int(np.argmax(np.abs(free).max(axis=1)))
    changed = problem.stiffness.tolil()
    changed[row, row] += 0.1 * stiffness * np.sign(free[row, 0]) * changed[row, row]
    assert free_unknowns(problem.with_(bulk=replace(problem.linear, stiffness=sp.csr_array(changed)))) is None
