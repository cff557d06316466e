"""What a page asks for, as generators of messages: a solution, all solutions, the load path, an evolution."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from hemivar.basics.disk import noting_files_read
from hemivar.basics.memory import refined_cells
from hemivar.basics.types import AnyArray
from hemivar.branches import Path as EquilibriumPath
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.model import Model
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import HemivarError, ProblemError
from hemivar.evolution import History
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.history import Frame
from hemivar.fem import discretize
from hemivar.files.mesh_table import StatedMesh
from hemivar.files.problem_file import ProblemFile, parse_problem_file
from hemivar.files.toml import printable
from hemivar.mesh import Mesh
from hemivar.mesh.recipe import Assembly, Grid, MeshRecipe
from hemivar.solvers import Controls, Solution, Solver, Status, solve
from hemivar.solvers.contact_states import contact_states
from hemivar.solvers.methods import method_named
from hemivar.solvers.one_branch import on_one_branch
from hemivar.studio.badges import Badge, badge_in_time, badge_of
from hemivar.studio.binary_message import Message
from hemivar.studio.body_picture import BodyShape, fields_of
from hemivar.studio.law_curves import curves_of
from hemivar.studio.requests import Request
from hemivar.studio.sliders import key_of_message, sliders_of
from hemivar.studio.toml_numbers import in_utf16, numbers_of, replaced
from hemivar.systems import Workspace
from hemivar.workflows import (
    CertificateEvent,
    Event,
    FoundEvent,
    PathOptions,
    PathProgress,
    ProgressEvent,
    ReadyEvent,
    RunOptions,
    SearchProgress,
    SolutionsOptions,
    WarningEvent,
    Work,
    march,
    path,
    run,
    solutions,
)
from hemivar.workflows.marching import evolution_of, plan_of

__all__ = ["MOST_CELLS", "MOST_UNKNOWNS", "Bench", "Stopped"]

#: Unknowns of a problem up to which a page solves it; the command has no such limit.
MOST_UNKNOWNS = 200_000
#: Cells of a mesh that a page shows.
MOST_CELLS = 400_000
#: Seconds that a search, a path or an evolution may take.
_SECONDS = 120.0
#: Points of a path, solutions of a search, frames of an evolution and values of a sweep that a page shows.
_MOST_POINTS, _MOST_SOLUTIONS, _FRAMES, _VALUES = 1500, 12, 120, 41

#: Whether a newer request is there.
Stopped = Callable[[], bool]
Messages = Iterator[Message]


@dataclass(frozen=True, eq=False)
class _Stated:
    """A text that was read."""

    text: str
    file: ProblemFile
    keys: tuple[str, ...]
    body: object


@dataclass(frozen=True, eq=False)
class _Kept:
    """The last problem, and the tables that say what its body is."""

    problem: DiscreteProblem
    tables: object


class Bench:
    """Where the requests of one page are worked on; it keeps what is expensive about the last body.

    Parameters
    ----------
    folder : Path
        Where meshes and tables that a text names are looked for.
    workspace : Workspace, optional
        Shared by pages of one process.
    given : str, optional
        The text with which the page begins; the files that it names may lie elsewhere.
    code : sequence of str
        Modules and files whose laws a text may name, as for :func:`hemivar.read_problem`.
    """

    def __init__(
        self, folder: Path, workspace: Workspace | None = None, given: str = "", code: Sequence[str] = ()
    ) -> None:
        self.folder, self.code = folder, code
        self._given = frozenset(_files_in(_tables(given)))
        self.workspace = Workspace.given(workspace)
        self._kept: _Kept | None = None
        self._shape: BodyShape | None = None
        self._of: Model | None = None
        self._path: tuple[str, EquilibriumPath] | None = None

    def answer(self, request: Request, stopped: Stopped) -> Messages:
        """The messages that answer a request, the picture before the certificate; ends early where it is stopped."""
        work = {
            "solve": self._solve, "solutions": self._solutions, "path": self._follow, "point": self._point,
            "energies": self._energies,
        }[request.kind]  # fmt: skip
        keys: tuple[str, ...] = ()
        try:
            stated = self._read(request)
            keys = stated.keys
            if request.kind == "solve":
                yield self._problem_message(request, stated)
            yield from work(request, stated, stopped)
            yield Message({"type": "done", "generation": request.generation, "of": request.kind})
        except HemivarError as error:
            if not keys:
                keys = _keys(request.text)
            message = str(error).removeprefix("problem: ")
            head = {"type": "error", "generation": request.generation, "message": message, "of": request.kind}
            yield Message({**head, "key": key_of_message(message, list(keys))})
        except MemoryError:
            head = {"type": "error", "generation": request.generation, "of": request.kind, "key": None}
            yield Message({**head, "message": "not enough memory for this problem; take fewer cells"})

    # ---- reading ----------------------------------------------------------------------------------------

    def _read(self, request: Request) -> _Stated:
        self._refuse_elsewhere(_tables(request.text))
        with noting_files_read() as read:
            try:
                file = parse_problem_file(request.text, self.folder, "problem", _small_enough, code=self.code)
            finally:  # nor is anything told of them
                self._refuse_included(read)
        mesh, order = file.problem.mesh, getattr(file.problem, "order", 1)
        nodes = mesh.number_of_nodes + (len(mesh.edges) if order == 2 else 0)
        data = tomllib.loads(request.text)
        size = nodes * (1 if "kind" in data else mesh.dim)
        if size > MOST_UNKNOWNS:
            raise ProblemError(
                f"problem: [mesh] cells: the body has about {size} unknowns; the studio solves up to {MOST_UNKNOWNS}: "
                "take fewer cells, or the command 'hemivar solve'"
            )
        body = [data.get(key) for key in ("kind", "mesh", "material", "supports")]
        return _Stated(request.text, file, _keys(request.text), body)

    def _refuse_elsewhere(self, data: object) -> None:
        """Refuse files outside of the folder, but those that the page began with."""
        home = self.folder.resolve()
        for name in _files_in(data):
            if name not in self._given and not (home / name).resolve().is_relative_to(home):
                raise ProblemError(
                    f"problem: '{printable(name)}' lies outside of the folder of the problem, and the page reads "
                    "files of that folder only; make a copy in it"
                )

    def _refuse_included(self, read: Sequence[Path]) -> None:
        """Refuse files that meshes include from outside of the folder, and of those that the page began with."""
        homes = [self.folder.resolve(), *((self.folder / name).resolve().parent for name in self._given)]
        for file in read:
            if not any(file.resolve().is_relative_to(home) for home in homes):
                raise ProblemError(
                    f"problem: '{printable(file.name)}' is included from outside of the folder of the problem, and the "
                    "page reads files of that folder only; make a copy in it"
                )

    def _problem_message(self, request: Request, stated: _Stated) -> Message:
        data = tomllib.loads(stated.text)
        sliders = sliders_of(data, in_utf16(stated.text, numbers_of(stated.text)), stated.file.units, self.code)
        return Message(
            {
                "type": "problem",
                "generation": request.generation,
                "title": stated.file.problem.title,
                "timed": stated.file.time is not None,
                "units": stated.file.units.record(),
                "sliders": [slider.record() for slider in sliders],
            }
        )

    def _discrete(self, stated: _Stated) -> DiscreteProblem:
        """The discrete problem, on the body that is kept if it is the same one."""
        fresh = discretize(stated.file.problem)
        if self._kept is not None and _same_body(self._kept, fresh, stated.body):
            fresh = fresh.on_the_same(self._kept.problem.model)
        self._kept = _Kept(fresh, stated.body)
        return fresh

    def _shown(self, request: Request, problem: DiscreteProblem) -> Messages:
        """The shape of the body, unless the page has it."""
        shape = self._shape
        kept = shape is not None and problem.field is not None and self._of is problem.model
        if not kept or shape is None:
            shape = BodyShape.of(problem)
            self._shape, self._of = shape, problem.model
        if shape.key != request.shape:
            yield shape.message(request.generation)

    def _picture(self, request: Request, solution: Solution, more: Mapping[str, object] | None = None) -> Message:
        assert self._shape is not None
        problem, shape = solution.problem, self._shape
        arrays = fields_of(shape, problem, solution.displacement, solution.local, solution.multiplier, solution.states)
        head = {
            "type": "picture",
            "generation": request.generation,
            "shape": shape.key,
            "status": solution.status.value,
            "converged": solution.status is Status.CONVERGED,
            "remedy": "" if solution.status is Status.CONVERGED else solution.remedy,
            "method": solution.method,
            "steps": solution.steps,
            "unknowns": problem.unknowns,
            "energy": solution.energy,
            "residual": solution.residual.relative,
            "normal_force": solution.normal_force,
            "friction_force": np.atleast_1d(solution.friction_force).tolist(),
            "curves": curves_of(problem, solution.local, solution.multiplier),
            **(more or {}),
        }
        return Message(head, arrays)

    # ---- the requests ---------------------------------------------------------------------------------------

    def _solve(self, request: Request, stated: _Stated, stopped: Stopped) -> Messages:
        if stated.file.time is not None:
            yield from self._march(request, stated, stopped)
            return
        problem = self._discrete(stated)
        yield from self._shown(request, problem)
        options = RunOptions(_method(stated), _controls(stated, stopped))
        work = _Watched(run(problem, options, self.workspace), stopped)
        for event in work:
            if isinstance(event, WarningEvent):
                yield Message({"type": "notice", "generation": request.generation, "text": event.text})
            elif isinstance(event, FoundEvent):
                if not stopped():
                    yield self._picture(request, event.solution)
                    for text in event.solution.warnings:
                        yield Message({"type": "notice", "generation": request.generation, "text": text})
            elif isinstance(event, CertificateEvent):
                yield _badge(request, badge_of(event.certificate), event.certificate.lines())

    def _solutions(self, request: Request, stated: _Stated, stopped: Stopped) -> Messages:
        problem = self._discrete(_static(stated, "solutions"))
        yield from self._shown(request, problem)
        controls = Controls(max_time=_SECONDS, callback=lambda progress: stopped())
        options = SolutionsOptions(max_solutions=_MOST_SOLUTIONS, controls=controls)
        work = _Watched(solutions(problem, options), stopped)
        number = 0
        for event in work:
            if isinstance(event, SearchProgress):
                done = event.starts / event.planned if event.planned else None
                yield _progress(request, done, f"{event.found} found")
            elif isinstance(event, FoundEvent):
                solution = event.solution
                kind = "" if solution.kind is None else solution.kind.value
                yield self._picture(request, solution, {"solution": number, "kind": kind})
                number += 1
        result = work.result
        if result is not None:
            known = "all solutions" if result.exhaustive else "perhaps not all"
            words = f"{len(result)} solution{'' if len(result) == 1 else 's'}, {known}: {result.searched}"
            yield Message({"type": "solutions", "generation": request.generation, "count": number, "words": words})

    def _follow(self, request: Request, stated: _Stated, stopped: Stopped) -> Messages:
        stated = _static(stated, "the load path")
        options = PathOptions((0.0, request.upper), max_points=_MOST_POINTS, max_time=_SECONDS)
        work = _Watched(path(stated.file.problem, options), stopped)
        reported = 0
        for event in work:
            if isinstance(event, PathProgress) and event.points >= reported + 20:
                reported = event.points
                yield _progress(request, None, f"{event.points} points, load factor {event.load_factor:.3g}")
        curve = work.result
        if curve is None:
            return
        self._path = stated.text, curve
        yield from self._shown(request, curve.problem)
        yield Message(
            {
                "type": "path",
                "generation": request.generation,
                "words": f"{curve.failure}; {curve.ended}",
                "folds": [fold.index for fold in curve.main_folds],
                "jumps": [[jump.index, jump.load_factor] for jump in curve.main_jumps],
                "warnings": list(curve.warnings),
            },
            {
                "load_factor": curve.load_factor,
                "penetration": curve.max_penetration,
                "normal_force": curve.normal_force,
                "friction_force": np.linalg.norm(curve.friction_force, axis=1),
                "energy": curve.energy,
                "stable": curve.stable.astype(float),
            },
        )
        yield self._at(request, curve, len(curve) - 1)

    def _point(self, request: Request, stated: _Stated, stopped: Stopped) -> Messages:
        if self._path is None or self._path[0] != stated.text:
            raise ProblemError("the load path belongs to another problem; follow it again")
        curve = self._path[1]
        yield from self._shown(request, curve.problem)
        yield self._at(request, curve, min(request.index, len(curve) - 1))

    def _energies(self, request: Request, stated: _Stated, stopped: Stopped) -> Messages:
        """The energy of the solution over the values of one number of the text."""
        stated = _static(stated, "the energy over a slider")
        number = next((entry for entry in numbers_of(request.text) if entry.key == request.key), None)
        if number is None:
            raise ProblemError(f"'{printable(request.key)}' is not a number of the problem; choose one with a slider")
        values = np.linspace(request.low, request.high, _VALUES)
        if isinstance(number.value, int):
            values = np.unique(np.round(values))
        points: list[tuple[float, float]] = []
        last: Solution | None = None
        for count, value in enumerate(values.tolist()):
            if stopped():
                return
            before, last = last, None
            written = replaced(request.text, number, round(value) if isinstance(number.value, int) else value)
            try:
                problem = self._discrete(self._read(replace(request, text=written)))
            except ProblemError:
                points.append((value, np.nan))  # no problem at this value
                continue
            if problem.law.state_dependent:
                raise ProblemError("Coulomb friction has no energy; choose Tresca friction to draw one")
            solution = solve(problem, _method(stated), _controls(stated, stopped), workspace=self.workspace)
            last = solution if solution.status is Status.CONVERGED else None
            if before and last and not on_one_branch(before, last, self.workspace, _controls(stated, stopped)):
                points.append((0.5 * (points[-1][0] + value), np.nan))  # the state jumps, and the curve breaks
            points.append((value, solution.energy if last else np.nan))
            yield _progress(request, (count + 1) / len(values), f"{count + 1} of {len(values)} values")
        drawn, energies = np.array(points).T
        if not np.isfinite(energies).any():
            raise ProblemError("no value of this slider has a solution; choose another one")
        head = {"type": "energies", "generation": request.generation, "key": request.key}
        yield Message(head, {"value": drawn, "energy": energies})

    def _at(self, request: Request, curve: EquilibriumPath, index: int) -> Message:
        """The body at a point of a path."""
        assert self._shape is not None
        local, multiplier = curve.local[index], curve.multiplier[index]
        problem = curve.line.at(float(curve.load_factor[index]))
        unknowns = self.workspace.condensed(problem).unknowns(local)
        field, contact = problem.field, problem.contact
        assert field is not None
        states = contact_states(problem.law, local, multiplier, without_friction=contact.without_friction)
        arrays = fields_of(self._shape, problem, field.full(unknowns), local, multiplier, states)
        head = {
            "type": "picture", "generation": request.generation, "shape": self._shape.key, "converged": True,
            "status": f"load factor {curve.load_factor[index]:.6g}", "remedy": "", "index": index,
            "stable": bool(curve.stable[min(index, len(curve.stable) - 1)]), "energy": float(curve.energy[index]),
            "normal_force": float(curve.normal_force[index]), "friction_force": curve.friction_force[index].tolist(),
            "unknowns": problem.unknowns, "curves": curves_of(problem, local, multiplier),
        }  # fmt: skip
        return Message(head, arrays)

    def _march(self, request: Request, stated: _Stated, stopped: Stopped) -> Messages:
        time = stated.file.time
        assert time is not None
        # files are not written from a page
        plan = plan_of(stated.file, every=time.march.until / _FRAMES, max_time=_SECONDS, checkpoint=None)
        work = _Watched(march(evolution_of(stated.file), plan), stopped)
        discrete: DiscreteEvolution | None = None
        for event in work:
            if isinstance(event, ReadyEvent):
                discrete = event.discrete
                yield from self._shown(request, discrete.problem)
            elif isinstance(event, ProgressEvent):
                assert discrete is not None
                taken = event.stepped
                frames = [frame for _, frame in taken.earlier] + ([] if taken.frame is None else [taken.frame])
                for frame in frames:
                    yield self._frame(request, discrete, frame)
                if frames:
                    yield _progress(request, taken.done, f"t = {taken.row.time:.4g}")
        history = work.result
        if history is not None:
            yield _history(request, history)
            yield _badge(request, badge_in_time(history), list(history.messages))

    def _frame(self, request: Request, discrete: DiscreteEvolution, frame: Frame) -> Message:
        assert self._shape is not None
        problem = discrete.problem
        states = contact_states(problem.law, frame.local, frame.multiplier)
        arrays = fields_of(self._shape, problem, frame.displacement, frame.local, frame.multiplier, states)
        weights = problem.contact.weights
        head = {
            "type": "picture", "generation": request.generation, "shape": self._shape.key, "time": frame.time,
            "converged": True, "status": f"t = {frame.time:.4g}", "remedy": "",
            "unknowns": problem.unknowns, "normal_force": float(weights @ frame.multiplier[:, 0]),
            "curves": curves_of(problem, frame.local, frame.multiplier, frame.rate, ~discrete.follows_slip),
        }  # fmt: skip
        return Message(head, arrays)


Result = TypeVar("Result")


class _Watched(Generic[Result]):
    """Work that ends early where it is stopped; its events, and then its result."""

    def __init__(self, work: Work[Result], stopped: Stopped) -> None:
        self._work, self._stopped = work, stopped
        self.result: Result | None = None

    def __iter__(self) -> Iterator[Event]:
        stop: bool | None = None
        while True:
            try:
                event = self._work.send(stop) if stop else next(self._work)
            except StopIteration as end:
                self.result = end.value
                return
            yield event
            stop = self._stopped()


def _same_body(kept: _Kept, fresh: DiscreteProblem, tables: object) -> bool:
    """Whether a problem differs from the one that is kept by its load, gap and law at most."""
    one, other = kept.problem.model, fresh.model
    if kept.tables != tables or not (isinstance(one.bulk, Quadratic) and isinstance(other.bulk, Quadratic)):
        return False
    if one.origin is None or other.origin is None or one.origin.stiffening != other.origin.stiffening:
        return False
    pairs = [
        (one.bulk.stiffness.data, other.bulk.stiffness.data),
        (one.bulk.stiffness.indices, other.bulk.stiffness.indices),
        (one.contact.trace.data, other.contact.trace.data),
        (one.contact.trace.indices, other.contact.trace.indices),
        (one.contact.weights, other.contact.weights),
        (one.contact.points, other.contact.points),
        (one.contact.frames, other.contact.frames),
        (one.contact.boundary, other.contact.boundary),
    ]
    return (
        all(a is b or (a is not None and b is not None and np.array_equal(a, b)) for a, b in pairs)
        and one.contact.names == other.contact.names
    )


def _small_enough(stated: StatedMesh) -> Mesh:
    """The mesh, refused before it is made where it has more cells than a page shows."""
    _, count = _cells_of(stated.recipe)
    if count > MOST_CELLS:
        raise stated.table.error(
            "cells",
            f"the mesh has {count:.3g} cells; the studio shows up to {MOST_CELLS}: take fewer, or the command "
            "'hemivar solve'",
        )
    return stated.build()


def _cells_of(recipe: MeshRecipe) -> tuple[int, float]:
    """The dimension, and cells of the rectangles and boxes of a mesh; those of files are known when these are read."""
    source = recipe.source
    if isinstance(source, Assembly):
        parts = [_cells_of(part) for part in source.parts.values()]
        dim, count = parts[0][0], sum(cells for _, cells in parts)
    elif isinstance(source, Grid):
        dim = len(source.size)
        in_each = 6.0 if dim == 3 else 4.0 if source.pattern == "cross" else 2.0
        count = in_each * math.prod(map(float, source.cells))
    else:
        dim, count = 3, 0.0
    return dim, refined_cells(dim, count, recipe.refine)


def _files_in(data: object) -> Iterator[str]:
    """The files that a text names: under the keys ``file`` and ``table``, wherever they stand."""
    if isinstance(data, dict):
        data = {key: value for key, value in data.items() if key != "output"}  # of which nothing is written
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in entries:
        if isinstance(value, str) and key in ("file", "table"):
            yield value
        yield from _files_in(value)


def _keys(text: str) -> tuple[str, ...]:
    """The numbers of a text by their keys; none where it is not TOML."""
    return tuple(number.key for number in numbers_of(text)) if _tables(text) else ()


def _tables(text: str) -> dict[str, object]:
    """The tables of a text; none where it is not TOML, which the reader reports."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return {}


def _static(stated: _Stated, what: str) -> _Stated:
    if stated.file.time is not None:
        raise ProblemError(f"problem: [time]: {what} is for problems at rest; leave this table out")
    return stated


def _method(stated: _Stated) -> Solver | None:
    name = stated.file.solver.method
    return None if name is None else method_named(name)


def _controls(stated: _Stated, stopped: Stopped) -> Controls:
    """The limits of the text, within those of a page."""
    given, usual = stated.file.solver, Controls()
    return Controls(
        rtol=usual.rtol if given.rtol is None else given.rtol,
        max_steps=given.max_steps,
        max_time=min(_SECONDS, math.inf if given.max_time is None else given.max_time),
        callback=lambda progress: stopped(),
    )


def _badge(request: Request, badge: Badge, lines: list[str]) -> Message:
    head = {"type": "certificate", "generation": request.generation, "lines": lines}
    return Message({**head, "level": badge.level, "title": badge.title, "meaning": badge.meaning})


def _progress(request: Request, done: float | None, words: str) -> Message:
    return Message({"type": "progress", "generation": request.generation, "done": done, "words": words})


def _history(request: Request, history: History) -> Message:
    names = [name for name in ("normal_force", "friction_force", "contact") if name in history.columns]
    table: dict[str, AnyArray] = {name: history[name] for name in names}
    head = {
        "type": "history", "generation": request.generation, "ended": history.ended, "messages": list(history.messages),
        "names": names, "events": [list(event) for event in history.events],
    }  # fmt: skip
    return Message(head, {"times": history.times, **table})
