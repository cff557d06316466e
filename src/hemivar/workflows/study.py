"""Mesh convergence: errors on halved meshes against an exact solution or the finest mesh, and their orders."""

from __future__ import annotations

import contextlib
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, expect, expecting, whole_number
from hemivar.basics.content import digest_of
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords, showing_options
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.processes import results
from hemivar.basics.rows import Claim, Column, ResultRows
from hemivar.basics.types import Array
from hemivar.basics.user_code import checked_code
from hemivar.bounds import exact_distance
from hemivar.bounds.exact_certificate import statement_of
from hemivar.bounds.scalar_distance import scalar_distance
from hemivar.bounds.trace_bounds import body_constants
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize, interpolate
from hemivar.fem.error_norms import KnownField, error_norms
from hemivar.fem.transfer import beside_nodes, interpolation_matrix
from hemivar.files.problem_file import read_problem_file
from hemivar.files.resume_log import ResumeLog
from hemivar.files.stored_solution import StoredSolution
from hemivar.linear.threads import one_thread
from hemivar.mechanics import ContactProblem
from hemivar.mesh import Mesh
from hemivar.solvers import Controls, Solution, Solver, Status
from hemivar.solvers.methods import as_method
from hemivar.solvers.numbers_by_name import check_quantity, checked_names, quantity_of, unit_of
from hemivar.systems import Workspace
from hemivar.workflows.convergence import Convergence, ErrorLevel
from hemivar.workflows.events import MethodEvent, Phase, StartEvent, WarningEvent, Work
from hemivar.workflows.solving import from_coarser

__all__ = ["Study", "StudyLevel", "StudyOptions", "study", "study_digest", "studying"]

#: Halvings that can be asked for.
_MOST_REFINED = 12
#: Bytes of a file with solutions that is read.
_MOST_KEPT = 2**36
#: Ends of a solve after which a mesh is not done.
_NO_LEVEL = (Status.INTERRUPTED, Status.OUT_OF_MEMORY)
#: Seconds between two looks for a solution of another process.
_PAUSE = 0.02


@dataclass(frozen=True)
class StudyOptions:
    """How far to refine, and what to compare with.

    Parameters
    ----------
    refine : int
        How often the mesh of the problem is halved: ``refine + 1`` meshes.
    known : KnownField or sequence of str, optional
        The known solution by formulas of x, y (and z), one for each component; the solution on the finest mesh by
        default.
    method : Solver or str, optional
        The method, or its name; chosen for the finest mesh by predicted cost and memory if not given.
    controls : Controls
        Tolerances and limits of each solve; the tolerance must lie far below the errors.
    jobs : int
        Processes that work at once: the finest mesh is made and assembled while the coarser ones are solved.  A script
        that asks for more than one does so below ``if __name__ == "__main__":``, for each process reads it again.
    checkpoint : str or Path, optional
        A file to which the solution on every mesh goes when it is done; meshes that it holds are not solved again, also
        where the mesh is now halved more often, or compared with another known solution.
    must_keep : bool
        Whether the study ends where that file cannot be written; else ``Study.unkept`` says why.
    exact : bool
        Whether the error on each mesh is bounded as well, see :func:`hemivar.bounds.exact_distance`.
    code : sequence of str
        Modules and files whose laws the problem file may name, as for :func:`hemivar.read_problem`.
    columns : tuple of str
        Numbers of each solution beside its errors, as for :func:`hemivar.sweep`; whole tables have the largest pressure
        and stress by default.

    Raises
    ------
    ProblemError
        The number of halvings or of processes makes no sense, a formula is none, or the controls have a function to
        call in other processes.
    """

    refine: int = 4
    known: KnownField | Sequence[str] | None = None
    method: Solver | str | None = None
    controls: Controls = field(default_factory=Controls)
    jobs: int = 1
    checkpoint: str | Path | None = None
    must_keep: bool = True
    exact: bool = False
    code: Sequence[str] = ()
    columns: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", checked_names(self.columns))
        count = whole_number(self.refine, "refine", 1)
        if count > _MOST_REFINED:
            raise ProblemError(f"refine is {count}; a mesh can be halved {_MOST_REFINED} times at most")
        as_method(self.method)
        expect(self.controls, Controls, "controls", "pass Controls(rtol=..., max_time=...)")
        if whole_number(self.jobs, "jobs", 1) > 1 and self.controls.callback is not None:
            raise ProblemError(
                "a study by several processes calls no function after every step; leave the callback of its controls "
                "out, or take jobs = 1"
            )
        expect(self.exact, bool, "exact", "give True or False")
        checked_code(self.code)
        if self.known is not None and not isinstance(self.known, KnownField):
            listed: Sequence[str] = expect(
                self.known, Sequence, "known", "give a formula of x and y for each component"
            )  # type: ignore[type-abstract]
            object.__setattr__(self, "known", KnownField(listed))


@dataclass(frozen=True, eq=False, repr=False)
class StudyLevel(ErrorLevel):
    """One mesh, with its size and errors.

    Attributes
    ----------
    solution : Solution
    bound : float
        Bound of the error in the energy norm, guaranteed or on conditions; nan where none was asked for, inf where
        there is none.
    unbounded : tuple of str
        Why there is no bound; one sentence each.
    conditions : tuple of str
        Those under which it is a bound; empty where it is guaranteed.
    """

    solution: Solution
    bound: float = math.nan
    unbounded: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        """Whether the solve met its tolerance."""
        return self.solution.status is Status.CONVERGED


@dataclass(frozen=True, eq=False, repr=False)
class Study(Convergence):
    """What :func:`study` found.

    Attributes
    ----------
    options : StudyOptions
    levels : tuple of StudyLevel
        One for each mesh, from coarse to fine.  Errors are absolute: ``energy`` is ``sqrt(int eps(e) : C eps(e))`` (or
        ``sqrt(int A grad e . grad e)``; of a material that is not linear C is C_low), ``displacement`` is
        ``sqrt(int |e|^2)``, ``pressure`` the mean square over the contact boundary, ``sqrt(sum_j w_j (p_j - p)^2)``.
        nan where there is none: on the finest mesh if that is the reference, and for the pressure at midpoints of
        facets.
    norms : mapping of quantity to float
        The same norms of the reference.
    reference : str
        ``"exact solution"`` or ``"finest mesh"``.
    interrupted : bool
        Whether the work was stopped from the keyboard; the meshes until then are here.
    unkept : str
        Why the solutions could not be kept in their file; empty if they were, and if none was asked for.
    """

    levels: tuple[StudyLevel, ...]
    options: StudyOptions
    unkept: str = ""

    each = "meshes"
    measured_by = "mesh size h"

    @property
    def remark(self) -> str:
        """The conditions of the bounds, or why there is none."""
        remarks = [f"if {' and '.join(level.conditions)}" for level in self.levels if level.conditions]
        remarks += [f"none, because {'; '.join(level.unbounded)}" for level in self.levels if level.unbounded]
        return f"; {self.kind_of_bound}: {remarks[-1]}" if remarks else ""

    @property
    def bounds(self) -> Array:
        """Bounds of the errors in the energy norm on each mesh, absolute; see :class:`StudyLevel`."""
        return np.array([level.bound for level in self.levels])

    @property
    def kind_of_bound(self) -> str:
        """What the bounds are called: guaranteed, or conditional where some of them hold on conditions only."""
        return "conditional bound" if any(level.conditions for level in self.levels) else "guaranteed bound"

    def rows(self, *, relative: bool = False) -> ResultRows:
        """A row for each mesh: size, unknowns, errors, orders from the mesh before, bound, energy, force, status.

        ``relative``: errors and the bound in tables over the norms of the reference.
        """
        levels, solutions = self.levels, [level.solution for level in self.levels]
        status = [solution.status.value for solution in solutions]
        columns = [
            Column("h", self.sizes, "h", unit="length"),
            Column("unknowns", [solution.problem.unknowns for solution in solutions], "unknowns"),
            Column(None, status, "status"),
            *self.error_columns(relative),
        ]
        if not np.isnan(self.bounds).all():
            size = self.norms["energy"] if relative else 1.0
            columns.append(Column(self.kind_of_bound, np.where(np.isfinite(self.bounds), self.bounds, np.nan) / size))
        guaranteed = [... if level.conditions or math.isnan(level.bound) else level.bound for level in levels]
        columns += [
            Column(None, [level.bound if level.conditions else ... for level in levels], "conditional_bound"),
            Column(None, [level.conditions or ... for level in levels], "conditions"),
            Column(None, guaranteed, "guaranteed_bound"),
            Column("energy", [solution.energy for solution in solutions], "energy", brief=None, unit="energy"),
            Column(
                "normal force",
                [float(one.normal_force) if one.problem.contact_points else None for one in solutions],
                "normal_force",
                brief=None,
                unit="force",
            ),
            Column("status", status, brief=None if self.converged else ...),
        ]
        stated = solutions[0].problem.origin if solutions else None
        usual = ("max-pressure", "max-stress") if stated is not None and not stated.kind else ()
        for name in self.options.columns or usual:
            values = [quantity_of(solution, name) for solution in solutions]
            hidden = ... if self.options.columns else None
            columns.append(Column(name, values, name.replace("-", "_"), brief=hidden, unit=unit_of(name)))
        return ResultRows(tuple(columns))

    def claims(self) -> list[Claim]:
        """What the errors are of, the fitted orders, and the bound on the finest mesh, or why there is none."""
        claims, level, norm = super().claims(), self.levels[-1], self.norms["energy"]
        if math.isfinite(level.bound):
            relative = f", relative {level.bound / norm:.3g}" if norm > 0.0 else ""
            sentence = f"{level.bound:.3g} in the energy norm on the finest mesh{relative}"
            conditions = [f"if {' and '.join(level.conditions)}"] if level.conditions else []
            claims += [Claim(self.kind_of_bound, sentence, level.bound), *(Claim("", one) for one in conditions)]
        elif not math.isnan(level.bound):
            claims.append(Claim("guaranteed bound", "none on the finest mesh"))
            claims += [Claim("", f"because {reason}") for reason in level.unbounded]
        return claims


@expecting(options=StudyOptions)
def studying(
    problem: ContactProblem | ManufacturedProblem | str | Path, options: StudyOptions | None = None
) -> Work[Study]:
    """Solve a problem on meshes that are halved, each from the solution on the one before, and measure the errors.

    Yields :class:`WarningEvent`, :class:`MethodEvent`, for every mesh :class:`Phase`, :class:`StartEvent`, the steps
    of the solve and :class:`StudyLevel`; of a mesh that was kept or that another process solves, :class:`Phase` and
    :class:`StudyLevel`. An interruption ends the work; where the finest mesh is the reference, it is the finest
    then reached. Every mesh is solved by one thread, so that the numbers depend neither on the number of processes
    nor on what was kept. Where a problem has several solutions, that on each mesh is the one that its coarser
    neighbour leads to.

    Parameters
    ----------
    problem : ContactProblem, or path of a problem file
    options : StudyOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`Study`.

    Raises
    ------
    ProblemError, MethodError, FileError
        As :func:`hemivar.solve`; the problem is no statement, or the exact solution does not fit; a process ended; the
        record is that of another study.
    """
    options = StudyOptions() if options is None else options
    stated = (
        read_problem_file(problem, code=options.code).problem
        if isinstance(problem, str | Path)
        else ManufacturedProblem.of(problem)
    )
    if not isinstance(stated, ContactProblem):
        raise ProblemError(
            f"study: the problem is {described(stated)}; give a ContactProblem, a ScalarProblem or a problem file, "
            "whose mesh can be refined, or a function of the level to hemivar.workflows.study_levels"
        )
    for name in options.columns:
        check_quantity(name, stated)
    known = options.known if isinstance(options.known, KnownField) else None
    if known is not None:
        error_norms(stated, np.zeros((len(stated.mesh.nodes(stated.order)), stated.components)), known)
    kept: ResumeLog[StoredSolution] | None = None
    if options.checkpoint is not None:
        digest = study_digest(stated, options)
        kept = ResumeLog(
            options.checkpoint,
            "study",
            "mesh",
            digest,
            StoredSolution.of_line,
            most_bytes=_MOST_KEPT,
            wanted=options.must_keep,
        )
    levels: list[StudyLevel] = []
    interrupted = False
    try:
        interrupted = yield from _levels(stated, options, kept, levels)
    except KeyboardInterrupt:
        interrupted = True
    if options.exact and not interrupted:
        try:
            interrupted = yield from _bounded(levels)
        except KeyboardInterrupt:
            interrupted = True
    if not levels and interrupted:
        raise KeyboardInterrupt
    if not levels:
        raise ProblemError("study: no mesh was solved before the end of the work; take a coarser mesh, or more time")
    return _measured(options, levels, stated, known, interrupted, "" if kept is None else kept.unkept)


def study_digest(problem: ContactProblem, options: StudyOptions) -> str:
    """What tells whether two studies solve the same problems: of the statement with its mesh, the method, the controls.

    How often the mesh is halved, and what the solutions are compared with, do not count.
    """
    return digest_of(problem, as_method(options.method), replace(options.controls, callback=None))


@known_keywords
@showing_options(StudyOptions)
def study(
    problem: ContactProblem | ManufacturedProblem | str | Path, refine: int = StudyOptions.refine, **options: object
) -> Study:
    """Solve a problem on finer and finer meshes, and measure errors and orders of convergence.

    >>> import hemivar as hv
    >>> study = hv.study(hv.gallery.survey("5.1", 2), refine=3)
    >>> [level.solution.problem.unknowns for level in study.levels]
    [20, 72, 272, 1056]
    >>> study.reference, round(study.orders["energy"], 1)
    ('finest mesh', 0.8)

    Errors are those against a known solution, or against the solution on the finest mesh.

    Parameters
    ----------
    problem : ContactProblem, or path of a problem file
    refine : int
        How often the mesh is halved: ``refine + 1`` meshes.
    **options

    Returns
    -------
    Study
        ``study.levels`` has a solution and its errors for each mesh, ``study.orders`` the observed orders.

    Raises
    ------
    ProblemError, MethodError, FileError
        An option makes no sense, a solve is refused, or the file is that of another study.
    """
    return result_of(studying(problem, StudyOptions(refine, **options)))  # type: ignore[arg-type]


# ---- the meshes, one after the other or by processes -----------------------------------------------------------


def _levels(
    stated: ContactProblem, options: StudyOptions, kept: ResumeLog[StoredSolution] | None, levels: list[StudyLevel]
) -> Work[bool]:
    """All meshes from coarse to fine, put into the list when they are done; returns whether it was interrupted."""
    count = options.refine + 1
    there = {} if kept is None else {one.number: one for one in kept}
    mesh = stated.mesh
    last: Solution | None = None
    number = 0
    while number < count and number in there:  # nothing is known of a mesh without those before it
        mesh = mesh if number == 0 else mesh.refined()
        last = there[number].solution(discretize(stated.on(mesh)))
        if number == 0:
            yield from _opening(last.problem, options)
        yield Phase(f"{_named(mesh, last.problem)}: kept", number, count)
        levels.append(_level(last, mesh, options))
        yield levels[-1]
        number += 1
    if number == count:
        return False
    if min(options.jobs, count - number) > 1:
        return (yield from _by_processes(stated, options, kept, levels))
    for mine in range(number, count):
        mesh = mesh if mine == 0 else mesh.refined()
        discrete = discretize(stated.on(mesh))
        if mine == 0:
            yield from _opening(discrete, options)
        yield Phase(_named(mesh, discrete), mine, count)
        yield StartEvent(discrete, mine, count)
        last = yield from _solving(discrete, last, options)
        if last.status in _NO_LEVEL:
            return last.status is Status.INTERRUPTED
        _keep(kept, mine, last)
        levels.append(_level(last, mesh, options))
        yield levels[-1]
    return False


def _opening(discrete: DiscreteProblem, options: StudyOptions) -> Work[None]:
    """What is told before the first mesh."""
    for warning in discrete.notes:
        yield WarningEvent(warning)
    if (method := as_method(options.method)) is not None:
        yield MethodEvent(method, "")


def _named(mesh: Mesh, discrete: DiscreteProblem) -> str:
    return f"h = {mesh.size:.4g}, {discrete.unknowns} unknowns"


def _keep(kept: ResumeLog[StoredSolution] | None, number: int, solution: Solution) -> None:
    """Keep what is the same whenever it is computed: not what a time limit ended."""
    if kept is not None and solution.status is not Status.MAX_TIME:
        kept.add(StoredSolution.of(number, solution))


def _solving(discrete: DiscreteProblem, last: Solution | None, options: StudyOptions) -> Work[Solution]:
    """The solution on one mesh from that on the mesh before, by one thread: the same bits in every process."""
    with one_thread():
        return (yield from from_coarser(discrete, last, as_method(options.method), options.controls))


def _level(solution: Solution, mesh: Mesh, options: StudyOptions) -> StudyLevel:
    """A mesh, with its errors if the exact solution is known."""
    level = StudyLevel(mesh.size, solution)
    if not isinstance(options.known, KnownField):
        return level
    stated = solution.problem.origin
    assert isinstance(stated, ContactProblem)
    return _against(level, stated, options.known)


@dataclass(frozen=True, eq=False)
class _Task:
    """One mesh, with all that a process needs for it."""

    number: int
    stated: ContactProblem
    options: StudyOptions
    folder: Path
    first: int
    start: Solution | None


def _by_processes(
    stated: ContactProblem, options: StudyOptions, kept: ResumeLog[StoredSolution] | None, levels: list[StudyLevel]
) -> Work[bool]:
    """The meshes that are not in the list yet, by several processes; returns whether the work was interrupted.

    Each mesh needs the solution on the one before, but not to be made and assembled.  The finest meshes come first,
    each in a process of its own that has assembled its problem when the solution arrives; what is left is the chain of
    the coarser ones for the last process, so that there is always one that waits for nothing.
    """
    first, count = len(levels), options.refine + 1
    start = levels[-1].solution if levels else None
    heads = min(options.jobs, count - first) - 1
    order = [*range(count - 1, count - 1 - heads, -1), *range(first, count - heads)]
    plain = replace(options, checkpoint=None, jobs=1)
    with tempfile.TemporaryDirectory(prefix="hemivar-study-") as folder:
        tasks = [_Task(number, stated, plain, Path(folder), first, start) for number in order]
        with contextlib.closing(results(_mesh, tasks, options.jobs)) as finished:
            done: dict[int, StudyLevel] = {}
            for number, level in finished:
                done[number] = level
                while len(levels) in done:  # two may be done at once, the finer first
                    mine = len(levels)
                    solution, size = done[mine].solution, done[mine].size
                    if mine == 0:
                        yield from _opening(solution.problem, options)
                    if solution.status in _NO_LEVEL:
                        return solution.status is Status.INTERRUPTED
                    _keep(kept, mine, solution)
                    levels.append(done.pop(mine))
                    yield Phase(f"h = {size:.4g}, {solution.problem.unknowns} unknowns: done", mine, count)
                    if (yield levels[-1]):
                        return len(levels) < count
    return False


def _mesh(task: _Task) -> tuple[int, StudyLevel]:
    """The solution on one mesh, in a process of its own."""
    mesh = task.stated.mesh
    before = mesh
    for _ in range(task.number):
        before, mesh = mesh, mesh.refined()
    discrete = discretize(task.stated.on(mesh))
    last = task.start
    if task.number > task.first:
        coarse = discretize(task.stated.on(before))
        passed = task.folder / str(task.number - 1)
        while not passed.exists():
            time.sleep(_PAUSE)
        last = StoredSolution.read(passed, _MOST_KEPT).solution(coarse)
    solution = result_of(_solving(discrete, last, task.options))
    if task.number < task.options.refine and solution.status not in _NO_LEVEL:
        StoredSolution.of(task.number, solution).keep(task.folder / str(task.number))
    return task.number, _level(solution, mesh, task.options)


# ---- errors ----------------------------------------------------------------------------------------------------


def _on(solution: Solution) -> Mesh:
    assert solution.problem.field is not None
    return solution.problem.field.mesh


def _against(level: StudyLevel, stated: ContactProblem, known: KnownField) -> StudyLevel:
    """A level with its errors against formulas."""
    norms = error_norms(stated, _nodal(level.solution), known)
    contact = level.solution.contact
    off = level.solution.pressure - _pressure(level.solution, stated, known)
    pressure = math.sqrt(float(contact.weights @ off**2)) if contact.count else math.nan
    return replace(level, energy=norms.energy, displacement=norms.mean_square, pressure=pressure)


def _nodal(solution: Solution) -> Array:
    assert solution.problem.field is not None
    return solution.displacement.reshape(-1, solution.problem.field.components)


def _pressure(solution: Solution, stated: ContactProblem, known: KnownField) -> Array:
    """The pressure ``-n . sigma n`` of a known field at the contact points, n their normal; (m,)."""
    contact = solution.contact
    if not contact.count or contact.points is None or contact.frames is None:
        return np.full(contact.count, np.nan)
    normal, points = contact.frames[:, 0], contact.points
    if stated.mesh.regions and not stated.material.homogeneous:
        return np.full(contact.count, np.nan)  # a point may lie between two materials
    slope = known.gradients(points)
    stress = np.einsum("mij,mj->mi", stated.material.stiffness_tensor(points), stated.kinematics.strain(slope))
    if stated.kinematics.ring:
        around = stated.kinematics.hoop_strain(points, known.values(points), slope)
        stress = stress + stated.material.hoop_row(points)[:, :3] * around[:, None]
    stress = stress[:, stated.kinematics.rows]
    return np.asarray(-np.einsum("mi,mij,mj->m", normal, stress, normal))


def _bounded(levels: list[StudyLevel]) -> Work[bool]:
    """Put the bound of its error into each level; returns whether the work was interrupted."""
    first = levels[0].solution.problem
    with one_thread():
        scalar = first.origin is not None and first.origin.kind is not None
        # of the body: they hold on every mesh of it
        constants = None if scalar else body_constants(first, Workspace())
        for number, level in enumerate(levels):
            yield Phase(f"h = {level.size:.4g}: bound of the error", number, len(levels))
            stated = level.solution.problem.origin
            assert stated is not None
            try:
                u = level.solution.displacement
                distance = (
                    scalar_distance(stated, u)
                    if constants is None
                    else statement_of(exact_distance(stated, u, constants))
                )
                bound = distance.bound if distance.guaranteed or distance.conditions else math.inf
                reasons, conditions = distance.reasons, distance.conditions
            except ProblemError as error:
                bound, reasons, conditions = math.inf, (str(error),), ()
            reasons, conditions = ((), conditions) if math.isfinite(bound) else (reasons, ())
            levels[number] = replace(level, bound=bound, unbounded=reasons, conditions=conditions)
            if (yield levels[number]):
                return number + 1 < len(levels)
    return False


def _measured(
    options: StudyOptions,
    levels: list[StudyLevel],
    stated: ContactProblem,
    known: KnownField | None,
    interrupted: bool,
    unkept: str,
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
    return Study(tuple(levels), MappingProxyType(sizes), reference, interrupted, options, unkept)


def _against_finest(level: StudyLevel, finest: Solution, fine: ContactProblem) -> StudyLevel:
    """A level with its errors against the solution on the finest mesh, on which its own is interpolated exactly."""
    source, target = level.solution.problem.field, finest.problem.field
    assert source is not None
    assert target is not None
    if source.order == 1:
        values, interpolations = _nodal(level.solution), []
        mesh = target.mesh
        while mesh.number_of_nodes > source.mesh.number_of_nodes and mesh.parent is not None:
            interpolations.append(mesh.parent.interpolation)
            mesh = mesh.parent.mesh
        for step in reversed(interpolations):
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
    assert fine.problem.field is not None
    mesh, order = coarse.problem.field.mesh, coarse.problem.field.order
    sides = beside_nodes(mesh, fine.problem.field)
    off = np.zeros(other.count)
    for boundary in np.unique(other.boundary):
        mine, theirs = one.boundary == boundary, other.boundary == boundary
        values = np.zeros(coarse.problem.field.number_of_nodes)
        values[one.node[mine]] = coarse.pressure[mine]
        inside = None if sides is None else sides[other.node[theirs]]
        off[theirs] = interpolation_matrix(mesh, order, other.points[theirs], inside) @ values - fine.pressure[theirs]
    return math.sqrt(float(other.weights @ off**2))
