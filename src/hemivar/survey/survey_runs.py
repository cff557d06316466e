"""The simulations of the survey's section 5: its Figures 1 to 5 and its Table 1, as values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.display import brief
from hemivar.basics.first_use import cached_property
from hemivar.basics.rows import Column, ResultRows
from hemivar.basics.types import Array
from hemivar.bounds import exact_distance
from hemivar.bounds.trace_bounds import TraceBounds, guaranteed_trace_bounds
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize, interpolate, v_norm
from hemivar.gallery import survey as survey_problem
from hemivar.mechanics import ContactProblem
from hemivar.mesh import Mesh
from hemivar.solvers import METHODS, Controls, Solution
from hemivar.solvers.status import check_interrupt
from hemivar.systems import Workspace
from hemivar.workflows.comparison import energy_norm_difference
from hemivar.workflows.convergence import observed_order
from hemivar.workflows.events import Notice, Phase, Work
from hemivar.workflows.solving import from_coarser

__all__ = [
    "CAPTIONS",
    "DATA",
    "DEFAULT",
    "EXPECTED_FRICTION",
    "FIGURE_CELLS",
    "MOST_CELLS",
    "SURVEY_METHODS",
    "MeshRuns",
    "SurveyEvent",
    "SurveyOptions",
    "SurveyRuns",
    "survey",
]

#: Largest number of cells along a side of the finest mesh of Table 1; the references have twice as many.
MOST_CELLS = 1024
#: The survey's methods and the names of ours that are nearest to its implementations.
SURVEY_METHODS: Mapping[str, str] = MappingProxyType(
    {
        "direct optimization": "direct-powell",
        "augmented Lagrangian": "augmented-lagrangian",
        "primal-dual active set": "active-set-krylov",
    }
)
_SHORT = dict(zip(SURVEY_METHODS, ("Direct", "AL", "PD"), strict=True))
#: The method that the others are compared with.
DEFAULT = "newton"
#: The method that the survey's caption of each figure names.
CAPTIONS = MappingProxyType(
    {
        "figure1": "augmented Lagrangian",
        "figure2": "direct optimization",
        "figure3": "primal-dual active set",
        "figure4": "direct optimization",
    }
)
#: Cells along a side in the survey's captions of Figures 1 to 4.
FIGURE_CELLS = 32
#: Largest friction in Figure 3 on meshes of so many cells, known from independent computations.
EXPECTED_FRICTION = MappingProxyType({32: 0.4986, 64: 0.4988, 128: 0.4990})
#: The data of Table 1 and Figure 5.
DATA = "5.1"


@dataclass(frozen=True)
class SurveyOptions:
    """How far to go.

    Parameters
    ----------
    max_n : int
        The finest mesh of Table 1 and Figure 5 has h = 1/max_n; a power of two, at least 8.
    method_time_limit : float
        Limit in seconds for one solve.
    bounds : bool
        Bound the distance of every solution of Figure 5 to the exact one, too.

    Raises
    ------
    ProblemError
        ``max_n`` is not such a power of two, or the limit is not positive.
    """

    max_n: int = 128
    method_time_limit: float = 60.0
    bounds: bool = True

    def __post_init__(self) -> None:
        if not 8 <= self.max_n <= MOST_CELLS or self.max_n & (self.max_n - 1):
            raise ProblemError(
                f"max_n = {self.max_n}; the meshes are halved from h = 1/2 on: take a power of two from 8 to "
                f"{MOST_CELLS}"
            )
        if not self.method_time_limit > 0.0:
            raise ProblemError(f"method_time_limit = {self.method_time_limit}; give a positive number of seconds")


@dataclass(frozen=True, eq=False)
class MeshRuns:
    """One mesh of the convergence study, h = 1/n: its problem and one solution for each method."""

    n: int
    problem: DiscreteProblem
    solutions: Mapping[str, Solution]

    __repr__ = brief

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        assert self.problem.field is not None
        return self.problem.field.mesh


@dataclass(frozen=True, eq=False)
class SurveyRuns:
    """What was found so far.

    Attributes
    ----------
    options : SurveyOptions
    figures : mapping of "figure1" ... "figure4" to a mapping of method to Solution
    friction : mapping of n to float
        max |sigma_tau| in Figure 3 for 1/h = n.
    meshes : tuple of MeshRuns
        Those of Table 1, from coarse to fine, and last the one of the references.
    errors : mapping of (reference, method) to tuple of float
        V-norm errors on the meshes of Table 1; empty if the run was interrupted before.
    bounds : mapping of method to tuple of float
        Upper bounds of the distance in the V-norm to the exact solution of the continuous problem, on the same meshes.
    not_guaranteed : tuple of str
        Why bounds are estimates, one sentence each, if any of them is.
    interrupted : bool
        Whether the run was stopped before its end.
    """

    options: SurveyOptions
    figures: Mapping[str, Mapping[str, Solution]] = field(default_factory=dict)
    friction: Mapping[int, float] = field(default_factory=dict)
    meshes: tuple[MeshRuns, ...] = ()
    errors: Mapping[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    not_guaranteed: tuple[str, ...] = ()
    interrupted: bool = False

    __repr__ = brief

    def rows(self) -> ResultRows:
        """A row for each run of Table 1 and Figure 5: how it ended, and how far it is from the default method."""
        runs = [(level, name, solution) for level in self.meshes for name, solution in level.solutions.items()]
        solutions, to = [solution for *_, solution in runs], [level.solutions.get(DEFAULT) for level, *_ in runs]
        pairs = zip(solutions, to, strict=True)
        apart = [None if other is None else energy_norm_difference(one, other) for one, other in pairs]
        columns = (
            Column("h", [f"1/{level.n}" for level, *_ in runs], "h"),
            Column("method", [name for _, name, _ in runs], "method"),
            Column("status", [solution.status.value for solution in solutions], "status"),
            Column("residual", [solution.residual.relative for solution in solutions], "residual"),
            Column("difference", apart, "difference"),
            Column("steps", [solution.steps for solution in solutions], "steps"),
            Column("evaluations", [solution.evaluations for solution in solutions], "evaluations"),
            Column("iterate (s)", [solution.timings.get("iterate") for solution in solutions], "iterate"),
            Column("condense (s)", [solution.timings.get("condense") for solution in solutions], "condense"),
        )
        return ResultRows(columns)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Mesh sizes h of Table 1 and Figure 5."""
        return tuple(1.0 / level.n for level in self.meshes if level.n <= self.options.max_n)

    @cached_property
    def orders(self) -> Mapping[tuple[str, str], float]:
        """Orders of convergence, fitted to the errors on all meshes but the finest one."""
        sizes = np.array(self.sizes)
        trusted = sizes > 1.5 / self.options.max_n
        return {key: observed_order(sizes[trusted], np.array(values)[trusted]) for key, values in self.errors.items()}


@dataclass(frozen=True, eq=False)
class SurveyEvent(Notice):
    """A part is done: "figure1" ... "figure4", "friction", "mesh", "errors" or "bounds"; with all found so far.

    Attributes
    ----------
    part : str
        What is done.
    runs : SurveyRuns
        All found so far.
    """

    part: str
    runs: SurveyRuns


@expecting(options=SurveyOptions)
def survey(options: SurveyOptions | None = None) -> Work[SurveyRuns]:
    """Recompute the simulations of the survey (section 5.3).

    Figures 1 to 4 at h = 1/32, with all methods; the largest friction of Figure 3 on finer meshes; Table 1, three
    methods and the default one on meshes that are halved; Figure 5, the errors in the V-norm against the three methods
    at h = 1/(2 max_n), and guaranteed bounds of the distance to the exact solution. As in the survey, every method
    starts at h = 1/2 from zero and on every finer mesh from its own coarser solution, on the problem condensed onto the
    contact boundary.

    Yields :class:`Phase`, the steps of all solves, and :class:`SurveyEvent`. An interruption ends the work with what
    there is.

    Parameters
    ----------
    options : SurveyOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`SurveyRuns`.
    """
    runs = SurveyRuns(SurveyOptions() if options is None else options)
    max_n = runs.options.max_n
    controls = Controls(max_time=runs.options.method_time_limit)
    count, stage = len(CAPTIONS) + max_n.bit_length() + 1 + runs.options.bounds * (max_n.bit_length() - 1), 0
    try:
        for key, caption in CAPTIONS.items():
            text = f"Figure {key[-1]}: h = 1/{FIGURE_CELLS}, {caption} and all other methods"
            yield Phase(text, stage, count)
            stage += 1
            solutions: Mapping[str, Solution] = {}
            for n in _halved(FIGURE_CELLS):
                solutions = (yield from _on_mesh(key, n, METHODS, solutions, controls)).solutions
            runs = replace(runs, figures={**runs.figures, key: solutions})
            yield SurveyEvent(key, runs)
            if key == "figure3":
                runs = replace(runs, friction=(yield from _friction(solutions[DEFAULT], max_n, controls)))
                yield SurveyEvent("friction", runs)
        solutions = {}
        for n in _halved(max_n):
            yield Phase(f"Table 1 and Figure 5: h = 1/{n}", stage, count)
            stage += 1
            level = yield from _on_mesh(DATA, n, (*SURVEY_METHODS.values(), DEFAULT), solutions, controls)
            solutions = level.solutions
            runs = replace(runs, meshes=(*runs.meshes, level))
            yield SurveyEvent("mesh", runs)
        yield Phase(f"Figure 5: references at h = 1/{2 * max_n}", stage, count)
        finest = yield from _on_mesh(DATA, 2 * max_n, SURVEY_METHODS.values(), solutions, controls)
        yield Phase("Figure 5: errors", stage + 1, count)
        runs = replace(runs, errors=_errors(runs.meshes, finest), meshes=(*runs.meshes, finest))
        yield SurveyEvent("errors", runs)
        if runs.options.bounds:
            constants = None
            for number, level in enumerate(runs.meshes[:-1]):
                yield Phase(f"Figure 5: distance to the exact solution, h = 1/{level.n}", stage + 2 + number, count)
                constants = constants or guaranteed_trace_bounds(level.problem)
                runs = _bounded(runs, level, constants)
            yield SurveyEvent("bounds", runs)
    except KeyboardInterrupt:
        return replace(runs, interrupted=True)
    return runs


def _halved(last: int) -> list[int]:
    return [2**k for k in range(1, last.bit_length())]


def _on_mesh(
    data: str, n: int, names: Iterable[str], coarser: Mapping[str, Solution], controls: Controls
) -> Work[MeshRuns]:
    """Every method that treats the problem at h = 1/n, each from its own solution on the coarser mesh."""
    problem, workspace = discretize(survey_problem(data, n)), Workspace()
    solutions: dict[str, Solution] = {}
    for name in names:
        if METHODS[name].refuse(problem) is None:
            solution = yield from from_coarser(problem, coarser.get(name), METHODS[name], controls, workspace)
            check_interrupt(solution.status)
            solutions[name] = solution
    return MeshRuns(n, problem, solutions)


def _friction(solution: Solution, max_n: int, controls: Controls) -> Work[dict[int, float]]:
    """max |sigma_tau| in Figure 3 on its mesh and finer ones."""
    largest: dict[int, float] = {}
    for n in EXPECTED_FRICTION:
        if n > max_n and n > FIGURE_CELLS:
            break
        if n > FIGURE_CELLS:
            level = yield from _on_mesh("figure3", n, [DEFAULT], {DEFAULT: solution}, controls)
            solution = level.solutions[DEFAULT]
        largest[n] = float(np.abs(solution.friction).max())
    return largest


def _bounded(runs: SurveyRuns, level: MeshRuns, constants: TraceBounds) -> SurveyRuns:
    """With the bounds of one more mesh, in the V-norm: ``2 mu |eps|^2 <= C eps : eps``."""
    problem = level.problem.origin
    assert isinstance(problem, ContactProblem)
    stiffness = problem.material.stiffness_tensor(level.mesh.points[:1])
    scale = np.array([1.0, 1.0, np.sqrt(2.0)])  # Voigt's shear is twice the strain
    least = float(np.linalg.eigvalsh(stiffness * np.outer(scale, scale)).min())
    bounds, reasons = dict(runs.bounds), list(runs.not_guaranteed)
    for name, short in _SHORT.items():
        bound = exact_distance(problem, level.solutions[SURVEY_METHODS[name]].displacement, constants)
        bounds[short] = (*bounds.get(short, ()), bound.distance / math.sqrt(least))
        reasons += [f"{short}, h = 1/{level.n}: {reason}" for reason in bound.reasons]
    return replace(runs, bounds=bounds, not_guaranteed=tuple(reasons))


def _errors(levels: tuple[MeshRuns, ...], finest: MeshRuns) -> dict[tuple[str, str], tuple[float, ...]]:
    """V-norm of the difference of every solution to every reference, by (reference, method).

    The meshes are nested, so all solutions are carried from mesh to mesh, exactly, up to the finest.
    """
    names = list(SURVEY_METHODS.values())
    carried = np.zeros((levels[0].mesh.number_of_nodes, 0, 2))
    for level, finer in zip(levels, [*levels[1:], finest], strict=True):
        own: list[Array] = [level.solutions[name].displacement for name in names]
        carried = np.concatenate([carried, np.stack(own, axis=1)], axis=1)
        carried = interpolate(level.mesh, carried, finer.mesh)
    return {
        (_SHORT[reference], _SHORT[method]): tuple(
            v_norm(finest.mesh, finest.solutions[SURVEY_METHODS[reference]].displacement - carried[:, column])
            for column in range(k, len(levels) * len(names), len(names))
        )
        for reference in SURVEY_METHODS
        for k, method in enumerate(SURVEY_METHODS)
    }
