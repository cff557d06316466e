"""One problem on meshes that are halved: errors against an exact solution or the finest mesh, and their orders."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, expect, whole_number
from hemivar.basics.display import Displayed, brief
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.fem import discretize, interpolate
from hemivar.fem.elements import voigt_index
from hemivar.fem.error_norms import KnownField, error_norms, voigt_strain
from hemivar.fem.transfer import interpolation_matrix
from hemivar.files.problem_file import read_problem_file
from hemivar.mechanics import Statement
from hemivar.mechanics.scalar import ScalarProblem
from hemivar.mesh import Mesh
from hemivar.solvers import Controls, Solution, Solver, Status, solving, suited, transfer_solution
from hemivar.solvers.choice import choose
from hemivar.workflows.events import Begun, Chosen, Notice, Stage, Warned, Work
from hemivar.workflows.survey_runs import observed_order

__all__ = ["QUANTITIES", "Study", "StudyLevel", "StudyOptions", "study", "studying"]

#: Errors that a study tells, by name.
QUANTITIES = ("energy", "displacement", "pressure")
#: Halvings that can be asked for.
_MOST_REFINED = 12


@dataclass(frozen=True)
class StudyOptions:
    """How far to refine, and what to compare with.

    Parameters
    ----------
    refine : int
        How often the mesh of the problem is halved: ``refine + 1`` meshes.
    exact : KnownField or sequence of str, optional
        The exact solution by formulas of x, y (and z), one for each component; the solution on the finest mesh by
        default.
    solver : Solver, optional
        The method; chosen for the finest mesh by predicted cost and memory if not given.
    controls : Controls
        Tolerances and limits of each solve; the tolerance must lie far below the errors.

    Raises
    ------
    ProblemError
        The number of halvings makes no sense, or a formula is none.
    """

    refine: int = 4
    exact: KnownField | Sequence[str] | None = None
    solver: Solver | None = None
    controls: Controls = field(default_factory=Controls)

    def __post_init__(self) -> None:
        count = whole_number(self.refine, "refine", 1)
        if count > _MOST_REFINED:
            raise ProblemError(f"refine is {count}; a mesh can be halved {_MOST_REFINED} times at most")
        expect(self.controls, Controls, "controls", "pass Controls(rtol=..., max_time=...)")
        if self.exact is not None and not isinstance(self.exact, KnownField):
            object.__setattr__(self, "exact", KnownField(self.exact))


@dataclass(frozen=True, eq=False)
class StudyLevel(Notice):
    """One mesh.

    Attributes
    ----------
    solution : Solution
    size : float
        The mesh size h: length of the longest edge.
    energy, displacement, pressure : float
        Errors, as :class:`Study` tells; nan while there is nothing to compare with.
    """

    solution: Solution
    size: float
    energy: float = math.nan
    displacement: float = math.nan
    pressure: float = math.nan

    __repr__ = brief

    @property
    def converged(self) -> bool:
        """Whether the solve met its tolerance."""
        return self.solution.status is Status.CONVERGED


@dataclass(frozen=True, eq=False)
class Study(Displayed):
    """What :func:`study` found.

    Attributes
    ----------
    options : StudyOptions
    levels : tuple of StudyLevel
        One for each mesh, from coarse to fine.  Errors are absolute: ``energy`` is ``sqrt(int eps(e) : C eps(e))`` (or
        ``sqrt(int A grad e . grad e)``), ``displacement`` is ``sqrt(int |e|^2)``, ``pressure`` the mean square over the
        contact boundary, ``sqrt(sum_j w_j (p_j - p)^2)``.  nan where there is none: on the finest mesh if that is the
        reference, and for the pressure at midpoints of facets.
    norms : mapping of quantity to float
        The same norms of the reference.
    reference : str
        ``"exact solution"`` or ``"finest mesh"``.
    interrupted : bool
        Whether the work was stopped from the keyboard; the meshes until then are here.
    """

    options: StudyOptions
    levels: tuple[StudyLevel, ...]
    norms: Mapping[str, float]
    reference: str
    interrupted: bool = False

    def __repr__(self) -> str:
        orders = ", ".join(f"{name} {order:.2f}" for name, order in self.orders.items() if not math.isnan(order))
        h, count = self.sizes, len(self.levels)
        meshes = f"{count} meshes, h {h[0]:.3g} to {h[-1]:.3g}"
        return f"Study({meshes}, against the {self.reference}; orders: {orders or 'none'})"

    @property
    def sizes(self) -> Array:
        """Mesh sizes h, from large to small."""
        return np.array([level.size for level in self.levels])

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the errors that there are."""
        return tuple(name for name in QUANTITIES if np.isfinite(self.errors(name)).any())

    @property
    def converged(self) -> bool:
        """Whether all solves met their tolerances."""
        return all(level.converged for level in self.levels)

    def errors(self, quantity: str) -> Array:
        """The errors of a quantity on each mesh, absolute.

        Raises
        ------
        ProblemError
            The quantity is not known.
        """
        if quantity not in QUANTITIES:
            raise ProblemError(f"quantity '{quantity}' is not known; the quantities are {', '.join(QUANTITIES)}")
        return np.array([getattr(level, quantity) for level in self.levels])

    def relative(self, quantity: str) -> Array:
        """The errors of a quantity over the norm of the reference; nan where that is zero."""
        errors, norm = self.errors(quantity), self.norms[quantity]
        return errors / norm if norm > 0.0 else np.full_like(errors, np.nan)

    def steps(self, quantity: str) -> Array:
        """Observed orders from each mesh to the next, ``log(e_k-1 / e_k) / log(h_k-1 / h_k)``; nan for the first."""
        errors, sizes = self.errors(quantity), self.sizes
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.log(errors[:-1] / errors[1:]) / np.log(sizes[:-1] / sizes[1:])
        return np.concatenate([[np.nan], np.where(np.isfinite(found), found, np.nan)])

    @cached_property
    def orders(self) -> dict[str, float]:
        """The order of each quantity, fitted to the errors on the finest four meshes that can be trusted.

        Where the finest mesh is the reference, the mesh before it shares much of its error, which makes its own look
        too small: it is left out.  nan with fewer than two meshes.
        """
        return {name: observed_order(self.sizes[self.trusted], self.errors(name)[self.trusted]) for name in QUANTITIES}

    @property
    def trusted(self) -> BoolArray:
        """Which meshes are far enough from the reference, bool (k,)."""
        count = len(self.levels)
        return np.arange(count) < (count if self.reference == "exact solution" else max(count - 2, 0))


def studying(problem: Statement | str | Path, options: StudyOptions | None = None) -> Work[Study]:
    """Solve a problem on meshes that are halved, each from the solution on the one before, and measure the errors.

    Yields :class:`Warned`, :class:`Chosen`, for every mesh :class:`Stage`, :class:`Begun`, the steps of the solve and
    :class:`StudyLevel`.  An interruption ends the work; where the finest mesh is the reference, it is the finest then
    reached.  Where a problem has several solutions, that on each mesh is the one that its coarser neighbour leads to.

    Parameters
    ----------
    problem : ContactProblem, ScalarProblem, or path of a problem file
    options : StudyOptions, optional

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.solve`; the problem is no statement, or the exact solution does not fit.
    """
    options = StudyOptions() if options is None else options
    stated = read_problem_file(problem).problem if isinstance(problem, str | Path) else problem
    if not isinstance(stated, Statement):
        raise ProblemError(
            f"study: the problem is {described(stated)}; give a ContactProblem, a ScalarProblem or a problem file, "
            "whose mesh can be refined"
        )
    known = options.exact if isinstance(options.exact, KnownField) else None
    levels: list[StudyLevel] = []
    interrupted = False
    solver = options.solver
    mesh = stated.mesh
    last: Solution | None = None
    try:
        for number in range(options.refine + 1):
            mesh = mesh if number == 0 else mesh.refined()
            discrete = discretize(stated.on(mesh))
            if number == 0:
                if known is not None:
                    error_norms(stated, np.zeros((len(mesh.nodes(stated.order)), _components(stated))), known)
                for warning in discrete.warnings:
                    yield Warned(warning)
                if solver is not None:
                    yield Chosen(solver, "")
            yield Stage(f"h = {mesh.size:.4g}, {discrete.unknowns} unknowns", number, options.refine + 1)
            yield Begun(discrete, number, options.refine + 1)
            chosen = choose(discrete)[0] if solver is None else solver
            guess = None if last is None else transfer_solution(last, discrete)
            last = yield from solving(discrete, suited(chosen, discrete), options.controls, initial=guess)
            interrupted = last.status is Status.INTERRUPTED
            if interrupted or last.status is Status.OUT_OF_MEMORY:
                break
            level = StudyLevel(last, mesh.size)
            level = level if known is None else _against(level, stated.on(mesh), known)
            levels.append(level)
            yield level
    except KeyboardInterrupt:
        interrupted = True
    if not levels:
        raise ProblemError("study: no mesh was solved before the end of the work; take a coarser mesh, or more time")
    return _measured(options, levels, stated, known, interrupted)


def study(
    problem: Statement | str | Path,
    refine: int = 4,
    *,
    exact: KnownField | Sequence[str] | None = None,
    solver: Solver | None = None,
    controls: Controls | None = None,
) -> Study:
    """:func:`studying` to its end, as a value.

    Parameters
    ----------
    problem : ContactProblem, ScalarProblem, or path of a problem file
    refine, exact, solver, controls
        As in :class:`StudyOptions`.

    Returns
    -------
    Study

    Raises
    ------
    ProblemError, MethodError
        As :func:`studying`.
    """
    given = StudyOptions(refine, exact, solver, Controls() if controls is None else controls)
    return result_of(studying(problem, given))


def _components(stated: Statement) -> int:
    return 1 if isinstance(stated, ScalarProblem) else stated.mesh.dim


def _on(solution: Solution) -> Mesh:
    assert solution.problem.field is not None
    return solution.problem.field.mesh


def _against(level: StudyLevel, stated: Statement, known: KnownField) -> StudyLevel:
    """A level with its errors against formulas."""
    norms = error_norms(stated, _nodal(level.solution), known)
    contact = level.solution.contact
    off = level.solution.pressure - _pressure(level.solution, stated, known)
    pressure = math.sqrt(float(contact.weights @ off**2)) if contact.count else math.nan
    return replace(level, energy=norms.energy, displacement=norms.mean_square, pressure=pressure)


def _nodal(solution: Solution) -> Array:
    assert solution.problem.field is not None
    return solution.displacement.reshape(-1, solution.problem.field.components)


def _pressure(solution: Solution, stated: Statement, known: KnownField) -> Array:
    """The pressure ``-n . sigma n`` of a known field at the contact points, n their normal; (m,)."""
    contact = solution.contact
    if not contact.count or contact.points is None or contact.frames is None or isinstance(stated, ScalarProblem):
        return np.full(contact.count, np.nan)
    normal, points = contact.frames[:, 0], contact.points
    if stated.mesh.regions and not stated.material.homogeneous:
        return np.full(contact.count, np.nan)  # a point may lie between two materials
    slope = known.gradients(points)
    strain = voigt_strain(slope)
    stress = np.einsum("mij,mj->mi", stated.material.stiffness_tensor(points), strain)
    stress = stress[:, voigt_index(stated.mesh.dim)]
    return np.asarray(-np.einsum("mi,mij,mj->m", normal, stress, normal))


def _measured(
    options: StudyOptions, levels: list[StudyLevel], stated: Statement, known: KnownField | None, interrupted: bool
) -> Study:
    """The study, with the errors against the finest mesh if there is no exact solution."""
    finest = levels[-1].solution
    fine = stated.on(_on(finest))
    weights = finest.contact.weights
    if known is not None:
        norms = error_norms(fine, np.zeros_like(_nodal(finest)), known)
        pressure, reference = _pressure(finest, fine, known), "exact solution"
    else:
        norms, pressure, reference = error_norms(fine, _nodal(finest)), finest.pressure, "finest mesh"
        levels = [*(_against_finest(level, finest, fine) for level in levels[:-1]), levels[-1]]
    size = math.sqrt(float(weights @ pressure**2))
    sizes = {"energy": norms.energy, "displacement": norms.mean_square, "pressure": size}
    return Study(options, tuple(levels), MappingProxyType(sizes), reference, interrupted)


def _against_finest(level: StudyLevel, finest: Solution, fine: Statement) -> StudyLevel:
    """A level with its errors against the solution on the finest mesh, on which its own is interpolated exactly."""
    source, target = level.solution.problem.field, finest.problem.field
    assert source is not None
    assert target is not None
    if source.order == 1:
        values, way = _nodal(level.solution), []
        mesh = target.mesh
        while mesh.number_of_nodes > source.mesh.number_of_nodes and mesh.parent is not None:
            way.append(mesh.parent.interpolation)
            mesh = mesh.parent.mesh
        for step in reversed(way):
            values = step @ values
    else:
        values = interpolate(source, _nodal(level.solution), target)
    norms = error_norms(fine, values - _nodal(finest))
    pressure = _pressure_off(level.solution, finest)
    return replace(level, energy=norms.energy, displacement=norms.mean_square, pressure=pressure)


def _pressure_off(coarse: Solution, fine: Solution) -> float:
    """``sqrt(sum_j w_j (I p_H - p_h)^2)``, the coarser pressure interpolated along each contact boundary."""
    one, other = coarse.contact, fine.contact
    nodal = (one.node >= 0).all() and (other.node >= 0).all()
    if not other.count or other.points is None or not nodal or one.names != other.names:
        return math.nan
    assert coarse.problem.field is not None
    mesh, order = coarse.problem.field.mesh, coarse.problem.field.order
    off = np.zeros(other.count)
    for boundary in np.unique(other.boundary):
        mine, theirs = one.boundary == boundary, other.boundary == boundary
        values = np.zeros(coarse.problem.field.number_of_nodes)
        values[one.node[mine]] = coarse.pressure[mine]
        off[theirs] = interpolation_matrix(mesh, order, other.points[theirs]) @ values - fine.pressure[theirs]
    return math.sqrt(float(other.weights @ off**2))
