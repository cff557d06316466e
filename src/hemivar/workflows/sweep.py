"""A parameter sweep: one problem for many values of its parameters: how many solutions there are, and the margin."""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np

from hemivar.basics.arguments import answer, described, expect, expecting, whole_number
from hemivar.basics.content import digest_of
from hemivar.basics.disk import noting_files_read, read_bytes
from hemivar.basics.display import ReprMixin
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.processes import results
from hemivar.basics.rows import Column, ResultRows
from hemivar.basics.types import Array
from hemivar.basics.user_code import checked_code
from hemivar.branches import SolutionsOptions
from hemivar.branches.solutions import finding
from hemivar.certificates import smallness
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import HemivarError, ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.files.changes import Change, read_change
from hemivar.files.problem_file import parse_problem_file, read_text
from hemivar.files.resume_log import ResumeLog
from hemivar.files.sweep_point import SweepPoint
from hemivar.linear.threads import one_thread
from hemivar.solvers import Controls, Status, solve
from hemivar.solvers.numbers_by_name import check_quantity, checked_names, quantity_of, unit_of
from hemivar.systems.workspace import Workspace
from hemivar.workflows.events import Notice, Phase, Work

__all__ = ["Sweep", "SweepAxis", "SweepEvent", "SweepOptions", "read_axis", "sweep", "sweep_digest", "sweeping"]

#: Points of a sweep.
_MOST_POINTS = 1_000_000
#: Seconds of work that it takes other processes to begin.
_BEGIN = 1.0
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER}):({_NUMBER}):(\d{{1,18}})(:log)?\s*")
_LIST = re.compile(rf"\s*{_NUMBER}(\s*,\s*{_NUMBER})+\s*")


@dataclass(frozen=True)
class SweepAxis:
    """A parameter and the values that it takes.

    Parameters
    ----------
    key : str
        A key of the problem file, as :class:`~hemivar.files.Change` has it, or a name for a function of the parameters.
    values : sequence
        What a TOML file can hold; at least one.

    Raises
    ------
    ProblemError
        There is no value.
    """

    key: str
    values: tuple[object, ...]

    def __post_init__(self) -> None:
        values = tuple(value.item() if isinstance(value, np.generic) else value for value in self.values)
        if not values:
            raise ProblemError(f"parameter '{self.key}' has no values; give at least one")
        object.__setattr__(self, "values", values)

    @property
    def numbers(self) -> Array | None:
        """The values as numbers, or None where one is none."""
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values):
            return np.array(self.values, dtype=float)
        return None


@expecting(text=str)
def read_axis(text: str) -> SweepAxis | Change:
    """The axis that ``key=low:high:count`` asks for, evenly spaced, or ``...:log`` evenly in the logarithm.

    ``key=0.1,0.15,0.2`` lists its values.

    The values are rounded to 12 digits; they are whole numbers if the ends and all between are.  What is no range is a
    value, which replaces that of the file.

    Parameters
    ----------
    text : str
        ``key=low:high:count``, or ``key=value``.

    Returns
    -------
    SweepAxis or Change

    Raises
    ------
    ProblemError
        The range makes no sense; otherwise as :func:`~hemivar.files.changes.read_change`.
    """
    key, _, written = text.partition("=")
    limits = _RANGE.fullmatch(written)
    if _LIST.fullmatch(written):
        listed = [one.strip() for one in written.split(",")]
        whole = all(re.fullmatch(r"[-+]?\d+", one) for one in listed)
        return SweepAxis(Change(key.strip(), 0).key, tuple(int(one) if whole else float(one) for one in listed))
    if limits is None:
        return read_change(text)
    key = Change(key.strip(), 0).key
    low, high, count = float(limits[1]), float(limits[2]), int(limits[3])
    if count < 2 or low == high or not (math.isfinite(low) and math.isfinite(high)):
        raise ProblemError(f"--set {text}: a range LOW:HIGH:COUNT has two different ends and at least two values")
    if limits[4] and not (low > 0.0 and high > 0.0):
        raise ProblemError(f"--set {text}: the ends of a range in the logarithm are positive")
    if count > _MOST_POINTS:
        raise ProblemError(f"--set {text}: a sweep has at most {_MOST_POINTS} points")
    between = np.geomspace(low, high, count) if limits[4] else np.linspace(low, high, count)
    values = [float(f"{value:.12g}") for value in between]
    whole = all(re.fullmatch(r"[-+]?\d+", end) for end in limits.groups()[:2]) and all(v.is_integer() for v in values)
    return SweepAxis(key, tuple(int(v) for v in values) if whole else tuple(values))


@dataclass(frozen=True)
class SweepOptions:
    """How to search, and how to work.

    Parameters
    ----------
    search : SolutionsOptions
        How far to look for solutions at each point; see :func:`hemivar.find_solutions`.
    jobs : int
        Processes that work at once; of many points, once the first second has shown that there is work for them.  A
        script that asks for more than one does so below ``if __name__ == "__main__":``, for each reads it again.
    checkpoint : str or Path, optional
        A file to which every point goes when it is done; points that it holds are not computed again.
    must_keep : bool
        Whether the sweep ends where that file cannot be written; else ``Sweep.unkept`` says why.
    changes : sequence of Change
        Values that replace those of the problem file at every point.
    code : sequence of str
        Modules and files whose laws the problem file may name, as for :func:`hemivar.read_problem`.
    columns : tuple of str
        Numbers of the solution, as :func:`hemivar.solvers.numbers_by_name.check_quantity` has them: each point is then
        solved once, and neither are further solutions looked for nor is the margin computed.

    Raises
    ------
    ProblemError
        The number of processes makes no sense, or the controls have a function to call.
    """

    search: SolutionsOptions = field(default_factory=SolutionsOptions)
    jobs: int = 1
    checkpoint: str | Path | None = None
    changes: tuple[Change, ...] = ()
    must_keep: bool = True
    code: Sequence[str] = ()
    columns: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        checked_code(self.code)
        object.__setattr__(self, "columns", checked_names(self.columns))
        whole_number(self.jobs, "jobs", 1)
        expect(self.search, SolutionsOptions, "search", "pass SolutionsOptions(starts=...)")
        if self.search.controls.callback is not None:
            raise ProblemError("a sweep calls no function after every step; leave the callback of its controls out")


@dataclass(frozen=True, eq=False)
class SweepEvent(Notice):
    """A point is done.

    Attributes
    ----------
    point : SweepPoint
    """

    point: SweepPoint


@dataclass(frozen=True, eq=False)
class Sweep(ReprMixin):
    """What :func:`sweep` found.

    Attributes
    ----------
    axes : tuple of SweepAxis
    points : tuple of SweepPoint
        Those that are done, the last parameter running fastest.
    interrupted : bool
        Whether the work was stopped from the keyboard.
    unkept : str
        Why the points could not be kept in their file; empty if they were, and if none was asked for.
    columns : tuple of str
        The numbers of a solution that were asked for; :attr:`SweepPoint.numbers` has them.
    """

    axes: tuple[SweepAxis, ...]
    points: tuple[SweepPoint, ...]
    interrupted: bool = False
    unkept: str = ""
    columns: tuple[str, ...] = ()

    def __repr__(self) -> str:
        keys = ", ".join(f"{axis.key} of {len(axis.values)}" for axis in self.axes)
        counts = sorted({point.count for point in self.points if not point.failed})
        numbers = ", ".join(map(str, counts[:8])) + (", ..." if len(counts) > 8 else "")
        failed = sum(point.failed for point in self.points)
        more = f", {failed} without a result" if failed else ""
        if self.columns:
            return f"Sweep({keys} values; {len(self.points)} points done{more}; {', '.join(self.columns)})"
        return f"Sweep({keys} values; {len(self.points)} points done{more}; numbers of solutions: {numbers or 'none'})"

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values of the parameters."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def complete(self) -> bool:
        """Whether every point is done."""
        return len(self.points) == math.prod(self.shape)

    @property
    def margin(self) -> Array:
        """The margin at each point, of :attr:`shape`; nan where there is none."""
        return self._grid(lambda point: point.margin)

    @property
    def count(self) -> Array:
        """The number of solutions found at each point, of :attr:`shape`; nan where it is not done or failed."""
        return self._grid(lambda point: math.nan if point.failed else point.count)

    @property
    def exhaustive(self) -> Array:
        """Where there are no other solutions, 1, else 0; nan as :attr:`count`."""
        return self._grid(lambda point: math.nan if point.failed else float(point.exhaustive))

    def values(self, point: SweepPoint) -> tuple[object, ...]:
        """The values of the parameters at a point."""
        return tuple(axis.values[i] for axis, i in zip(self.axes, point.place, strict=True))

    def rows(self) -> ResultRows:
        """A row for each point: its parameters, and the columns that were asked for.

        Else numbers of solutions and of minimisers, margin, and the lowest solution.
        """
        points = self.points
        values = [[one if isinstance(one, int | float | str) else str(one) for one in self.values(p)] for p in points]
        columns = [Column(axis.key, [row[k] for row in values], axis.key) for k, axis in enumerate(self.axes)]
        if self.columns:
            notes = [point.note for point in points]
            numbers = np.array([point.numbers or (math.nan,) * len(self.columns) for point in points])
            for name, column in zip(self.columns, numbers.reshape(-1, len(self.columns)).T, strict=True):
                columns.append(Column(name, column, name, unit=unit_of(name)))
            return ResultRows((*columns, Column("note" if any(notes) else None, notes, "note")))
        notes = [point.note if point.failed else "" for point in points]
        others = [None if point.failed else "no" if point.exhaustive else "perhaps" for point in points]
        columns += [
            Column("solutions", [None if point.failed else point.count for point in points], "solutions"),
            Column("minima", [None if point.failed else point.minima for point in points], "minima"),
            Column("others", others, "others"),
            Column("margin", [point.margin for point in points], "margin"),
            Column("energy", [_lowest(point.energies) for point in points], "energy", unit="energy"),
            Column("penetration", [_lowest(point.penetrations) for point in points], "penetration", unit="length"),
            Column("force", [_lowest(point.forces) for point in points], "force", unit="force"),
            Column("note" if any(notes) else None, notes, "note"),
        ]
        return ResultRows(tuple(columns))

    def _grid(self, number: Callable[[SweepPoint], float]) -> Array:
        grid = np.full(self.shape, np.nan)
        for point in self.points:
            grid[point.place] = number(point)
        return grid


def _lowest(values: Sequence[float]) -> float | None:
    """That of the solution of lowest energy, which stands first."""
    return values[0] if values else None


#: A problem for each choice of parameters: a file, or an importable function of their values.
Source = str | Path | Callable[..., ProblemLike]


@dataclass(frozen=True)
class _Task:
    """One point, with all that a process needs for it."""

    place: tuple[int, ...]
    values: tuple[object, ...]
    keys: tuple[str, ...]
    source: Callable[..., ProblemLike] | tuple[str, str, str]
    search: SolutionsOptions
    changes: tuple[Change, ...]
    code: Sequence[str]
    columns: tuple[str, ...]


@known_keywords
@expecting(controls=Controls, changes=[Change])
def sweep(
    problem: Source,
    axes: Mapping[str, Sequence[object]] | Sequence[SweepAxis],
    *,
    jobs: int = 1,
    checkpoint: str | Path | None = None,
    starts: int = 40,
    max_solutions: int = 100,
    seed: int = 0,
    controls: Controls | None = None,
    changes: Sequence[Change] = (),
    code: Sequence[str] = (),
    columns: Sequence[str] = (),
) -> Sweep:
    """Solve a problem for every combination of some values of its parameters: a map of solutions and margins.

    >>> import hemivar as hv
    >>> sweep = hv.sweep(lambda bound: hv.gallery.survey_logarithmic(bound, n=4), {"bound": [0.5, 1.0]})
    >>> sweep.margin.round(2)
    array([0.91, 0.82])

    The margin is positive where a point is shown to have one solution only.  A point that fails keeps its message, and
    the others are solved.

    Parameters
    ----------
    problem : path of a problem file, or function
        A function is called with the values of the parameters, in their order, and returns a problem.
    axes : mapping of key to values, or sequence of SweepAxis
        Keys of the file, such as ``"contact.bottom.normal.q_max"``, or names for the arguments of the function.
    jobs : int
        Processes that work at once.
    checkpoint : str or Path, optional
        A file that keeps each point; a second sweep continues from it.
    starts, max_solutions, seed, controls
        How far to look for solutions at each point, see :func:`hemivar.find_solutions`.
    changes : sequence of Change
        Values that replace those of the file at every point.
    code : sequence of str
        Modules and files whose laws the file may name, as for :func:`hemivar.read_problem`.
    columns : sequence of str
        Numbers of the solution, such as ``"max-pressure"`` or ``"support.bolt.force"``: each point is solved once, and
        its further solutions and its margin are left out.

    Returns
    -------
    Sweep
        ``sweep.points`` has the solutions, ``sweep.margin`` the margins, shaped as the parameters.

    Raises
    ------
    ProblemError, MethodError
        There are no parameters or too many points, or every point fails.
    """
    search = SolutionsOptions(starts, max_solutions, seed, Controls() if controls is None else controls)
    options = SweepOptions(search, jobs, checkpoint, tuple(changes), code=code, columns=columns)  # type: ignore[arg-type]
    return result_of(sweeping(problem, axes, options))


@expecting(options=SweepOptions)
def sweeping(
    problem: Source, axes: Mapping[str, Sequence[object]] | Sequence[SweepAxis], options: SweepOptions | None = None
) -> Work[Sweep]:
    """Find the solutions of a problem for every combination of some values of its parameters, and the margin.

    Every point is computed by itself, with one thread, so that its numbers depend neither on the number of processes
    nor on what was kept of earlier work.  A point at which the problem cannot be stated or solved has failed, with a
    note.

    Yields :class:`Phase` and :class:`SweepEvent` for every point.  An interruption ends the work with what is done.

    Parameters
    ----------
    problem : path of a problem file, or function
        A function is called with the values of the parameters, in their order; it returns a statement or a discrete
        problem, and must be importable for more than one process.
    axes : mapping of key to values, or sequence of SweepAxis
        At least one.
    options : SweepOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`Sweep`.

    Raises
    ------
    ProblemError, MethodError, FileError
        The file cannot be read, there are no parameters or too many points, every point fails for the first reason
        given; a process ended; the record is that of another sweep.
    """
    options = SweepOptions() if options is None else options
    given = _axes(axes)
    keys = tuple(axis.key for axis in given)
    source: Callable[..., ProblemLike] | tuple[str, str, str]
    if isinstance(problem, str | Path):
        source = (read_text(problem), str(Path(problem).parent), str(problem))
    elif callable(problem):
        source = problem
    else:
        raise ProblemError(
            f"sweep: the problem is {described(problem)}; give the path of a problem file, or a function"
        )
    indices = list(itertools.product(*(range(len(axis.values)) for axis in given)))
    record, done = None, dict[tuple[int, ...], SweepPoint]()
    if options.checkpoint is not None:
        digest, head = sweep_digest(problem, given, options), {"parameters": list(keys)}
        record = ResumeLog(
            options.checkpoint, "sweep", "point", digest, SweepPoint.of_line, head, wanted=options.must_keep
        )
        among = set(indices)
        done = {point.place: point for point in record if point.place in among}
    tasks = [
        _Task(
            index, _values(given, index), keys, source, options.search, options.changes, options.code, options.columns
        )
        for index in indices
        if index not in done
    ]
    interrupted = False
    try:
        with contextlib.closing(results(_point, tasks, options.jobs, _BEGIN)) as points:
            for point in points:
                if record is not None:
                    record.add(point)
                done[point.place] = point
                named = ", ".join(f"{k} = {v}" for k, v in zip(keys, _values(given, point.place), strict=True))
                yield Phase(f"{named}: {_outcome(point)}", len(done) - 1, len(indices))
                if (yield SweepEvent(point)):
                    interrupted = len(done) < len(indices)
                    break
    except KeyboardInterrupt:
        interrupted = True
    unkept = "" if record is None else record.unkept
    points_done = tuple(done[index] for index in indices if index in done)
    result = Sweep(given, points_done, interrupted, unkept, options.columns)
    if result.complete and all(point.failed for point in result.points):
        raise ProblemError(f"sweep: no point has a solution; the first: {result.points[0].note}")
    return result


def sweep_digest(problem: Source, axes: Sequence[SweepAxis], options: SweepOptions) -> str:
    """What tells whether two sweeps are the same work: of the file with all that it reads, parameters and options."""
    parts: list[object] = [[(axis.key, axis.values) for axis in axes], options.changes, options.search]
    parts += [options.columns] if options.columns else []
    if isinstance(problem, str | Path):
        text = read_text(problem)
        parts.append(text)
        with noting_files_read() as files, contextlib.suppress(HemivarError):
            first = [Change(axis.key, axis.values[0]) for axis in axes]
            changes = [*options.changes, *first]
            parse_problem_file(text, Path(problem).parent, str(problem), changes=changes, code=options.code)
        parts += [read_bytes(file) for file in files]
    else:
        parts.append(problem)
    return digest_of(*parts)


def _axes(axes: Mapping[str, Sequence[object]] | Sequence[SweepAxis]) -> tuple[SweepAxis, ...]:
    """The axes, checked."""
    if isinstance(axes, Mapping):
        checked = tuple(SweepAxis(key, _listed(key, values)) for key, values in axes.items())
    else:
        listed: Iterable[object] = expect(axes, Iterable, "the parameters", "give a dict of values by names")
        checked = tuple(expect(axis, SweepAxis, "an axis", "pass SweepAxis(key, values)") for axis in listed)
    if not checked:
        raise ProblemError("sweep: there is no parameter; give a range, as in contact.bottom.normal.q_max=0:1:21")
    twice = [axis.key for axis in checked if sum(other.key == axis.key for other in checked) > 1]
    if twice:
        raise ProblemError(f"sweep: parameter '{twice[0]}' is there twice; give it once")
    count = math.prod(len(axis.values) for axis in checked)
    if count > _MOST_POINTS:
        raise ProblemError(f"sweep: {count} points; take at most {_MOST_POINTS}")
    return checked


def _listed(key: str, values: object) -> tuple[object, ...]:
    """The values of a parameter: a list of them, not one number and no text."""
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise ProblemError(f"parameter '{key}' has the values {described(values)}; give a list, such as [1.0, 2.0]")
    return tuple(values)


def _values(axes: Sequence[SweepAxis], index: Sequence[int]) -> tuple[object, ...]:
    return tuple(axis.values[i] for axis, i in zip(axes, index, strict=True))


def _outcome(point: SweepPoint) -> str:
    if point.failed:
        return point.note
    if point.numbers:
        return point.note or "solved"
    more = "" if point.exhaustive else " at least"
    return f"{point.count} solution{'s' if point.count != 1 else ''}{more}, margin {point.margin:.3g}"


# ---- one point -------------------------------------------------------------------------------------------------


def _point(task: _Task) -> SweepPoint:
    """The solutions for one choice of parameters."""
    try:
        with one_thread():
            return _computed(task)
    except HemivarError as error:
        return SweepPoint(task.place, note=str(error), failed=True)
    except MemoryError:
        return SweepPoint(task.place, note="not enough memory", failed=True)


def _computed(task: _Task) -> SweepPoint:
    if isinstance(task.source, tuple):
        text, folder, name = task.source
        own = [Change(key, value) for key, value in zip(task.keys, task.values, strict=True)]
        changes = [*task.changes, *own]
        stated: ProblemLike = parse_problem_file(text, folder, name, changes=changes, code=task.code).problem
    else:
        takes = "let it take a value of each parameter and return a problem"
        stated = cast(ProblemLike, answer(task.source, task.values, "sweep", takes))
    problem, workspace = as_discrete(stated, "sweep"), Workspace()
    if task.columns:
        return _numbers(task, problem)
    solutions = result_of(finding(problem, task.search, workspace))
    if solutions.interrupted:
        raise KeyboardInterrupt
    near: dict[str, Array] = {}
    if problem.law.state_dependent and len(solutions):
        near = {"displacement": solutions[0].unknowns, "multiplier": solutions[0].multiplier}
    constants = smallness(problem, trace_constant=False, workspace=workspace, **near)  # type: ignore[arg-type]
    return SweepPoint(
        task.place,
        float(constants.margin),
        tuple(float(solution.energy) for solution in solutions),
        tuple("" if solution.kind is None else str(solution.kind) for solution in solutions),
        tuple(float(solution.penetration.max(initial=-math.inf)) for solution in solutions),
        tuple(float(solution.normal_force) for solution in solutions),
        solutions.exhaustive,
        solutions.searched,
    )


def _numbers(task: _Task, problem: DiscreteProblem) -> SweepPoint:
    """The numbers that are asked for, of one solve; of one that did not converge up to which load it was carried."""
    if problem.origin is None:
        raise ProblemError(
            "columns are numbers of a ContactProblem, and this problem was made of arrays; leave them out"
        )
    for name in task.columns:
        check_quantity(name, problem.origin)
    solution = solve(problem, controls=task.search.controls)
    if solution.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    converged = solution.status is Status.CONVERGED
    named = [name if converged or name == "load-factor" else "" for name in task.columns]
    numbers = tuple(quantity_of(solution, name) if name else math.nan for name in named)
    note = "" if converged else f"{solution.status.value}: {solution.remedy}"
    return SweepPoint(task.place, note=note, failed=bool(np.isnan(numbers).all()), numbers=numbers)
