"""Parameter identification: a contact law from a measured curve, for a problem file or a function."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeAlias, cast

import numpy as np

from hemivar.basics.arguments import answer, described, expect, expecting, quoted
from hemivar.basics.deadline import Budget, OutOfTime, check_time, limited
from hemivar.basics.disk import shown
from hemivar.basics.generators import each_as, result_of
from hemivar.basics.stated import Form
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.files.changes import Change
from hemivar.files.problem_file import parse_problem_file, read_text
from hemivar.identification.experiment import Experiment
from hemivar.identification.fit import Fit, FitAttempt, FitOptions, Parameter, fit
from hemivar.identification.measurements import Measurements, read_measurements
from hemivar.laws import Superpotential, VectorLaw, join_laws
from hemivar.laws.registry import NORMAL_LAWS, LawKind, entry_named
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers import Controls
from hemivar.workflows.events import Phase, Work

__all__ = ["identify", "identifying", "parameters_of_law"]

#: A problem file, or a function of the values of parameters and inputs by their names.
Model: TypeAlias = "str | Path | Callable[[Mapping[str, float]], ProblemLike]"

#: Tables of a problem file whose keys a column may set.
_SET_BY_COLUMNS = ("loads", "supports", "contact")
#: How far the range of a parameter reaches to both sides of its value in the file, as a factor. A choice: a decade to
#: both sides of a guess that is right up to a factor of two.
_RANGE = 20.0


@expecting(options=FitOptions, changes=[Change], controls=Controls)
def identify(
    problem: Model,
    data: Measurements | str | Path,
    parameters: Mapping[str, tuple[float, float]] | Sequence[Parameter],
    options: FitOptions | None = None,
    *,
    changes: Sequence[Change] = (),
    controls: Controls | None = None,
    code: Sequence[str] = (),
) -> Fit:
    """Parameters of a contact law that fit a measured curve.

    Parameters
    ----------
    problem : path or callable
        A problem file, whose keys name parameters and inputs; or a function that takes both by their names in one
        mapping and returns a statement.  Inputs are loads and prescribed displacements, parameters numbers of the law.
    data : Measurements or path
        The curve; a CSV file is read by :func:`hemivar.identification.read_measurements`.
    parameters : mapping of key to (low, high), or sequence of Parameter
        What is looked for, and where.
    options : FitOptions, optional
    changes : sequence of Change, optional
        Values that replace those of the problem file.
    controls : Controls, optional
        Of the solves.
    code : sequence of str
        Modules and files whose laws the problem file may name, as for :func:`hemivar.read_problem`.

    Returns
    -------
    Fit
        The parameters with their intervals; ``messages`` says what the curve leaves open.

    Raises
    ------
    ProblemError, FileError
        The file, the curve or the parameters make no sense; the message says which and what to do.

    Examples
    --------
    >>> fitted = hv.identification.identify("glue.toml", "curve.csv", {"contact.bottom.normal.strength": (0.5, 5.0)})
    ... # doctest: +SKIP
    """
    return result_of(identifying(problem, data, parameters, options, changes=changes, controls=controls, code=code))


@expecting(options=FitOptions, changes=[Change], controls=Controls)
def identifying(
    problem: Model,
    data: Measurements | str | Path,
    parameters: Mapping[str, tuple[float, float]] | Sequence[Parameter],
    options: FitOptions | None = None,
    *,
    changes: Sequence[Change] = (),
    controls: Controls | None = None,
    code: Sequence[str] = (),
) -> Work[Fit]:
    """As :func:`identify`, and tells of every start that is done.

    Parameters
    ----------
    problem : path or callable
    data : Measurements or path
    parameters : mapping of key to (low, high), or sequence of Parameter
    options : FitOptions, optional
    changes : sequence of Change, optional
    controls : Controls, optional
    code : sequence of str

    Yields
    ------
    Event
        A :class:`Phase` for every start; the generator returns a :class:`Fit`.

    Raises
    ------
    ProblemError
        As :func:`identify`, or the time limit is over before the rows of the curve are stated.
    """
    budget = Budget(math.inf if controls is None else controls.max_time)
    measured = read_measurements(data) if isinstance(data, str | Path) else data
    measured = expect(measured, Measurements, "the measured curve", "pass Measurements(...) or the path of a CSV file")
    wanted = _parameters(parameters, measured)
    state = _statement(problem, changes, measured.inputs, code)
    first = {parameter.key: parameter.middle for parameter in wanted}
    rows = [{**first, **measured.row(number)} for number in range(measured.count)]
    try:
        with limited(budget):
            experiment = Experiment.of([_discrete(state, row) for row in rows], tuple(measured.measured), controls)
    except OutOfTime:
        raise ProblemError(
            f"the time limit of {budget.limit:g} s was over before the rows of the curve were stated; give more time"
        ) from None
    begin = measured.row(0)

    def law(values: Array) -> VectorLaw:
        stated = state({**begin, **dict(zip(first, map(float, values), strict=True))})
        return _law_on(experiment.problems[0], stated)

    attempts = fit(experiment, measured, wanted, law, options, budget)
    return (yield from each_as(attempts, lambda attempt: Phase(_message(attempt), attempt.number, attempt.count)))


def parameters_of_law(
    problem: str | Path, law: str, contact: str | None = None, code: Sequence[str] = ()
) -> tuple[Parameter, ...]:
    """All numbers of the normal law of a contact boundary in a problem file, each around its value there."""
    import tomllib

    text = read_text(problem)
    parse_problem_file(text, Path(problem).parent, str(problem), code=code)  # what is wrong with it is said there
    tables = tomllib.loads(text).get("contact", {})
    names = [contact] if contact is not None else list(tables)
    if len(names) != 1 or names[0] not in tables:
        raise ProblemError(f"name the contact boundary whose law is to be fitted: one of {', '.join(tables)}")
    stated = tables[names[0]].get("normal", {})
    entry = NORMAL_LAWS.get(law) or entry_named(law, LawKind.NORMAL, (Superpotential, VectorLaw), code)
    if entry is None:
        raise ProblemError(f"normal law '{law}' is not known; choose one of {', '.join(NORMAL_LAWS)}")
    if stated.get("law") != law:
        raise ProblemError(
            f"contact '{names[0]}' has the law '{stated.get('law')}' in the file; state '{law}' there with a first "
            "guess of its parameters, or name each parameter and its range with --fit"
        )
    numbers = {field.key for field in entry.parameters if field.stated.form in (Form.QUANTITY, Form.NUMBER)}
    fitted = []
    for name, value in stated.items():
        if name not in numbers:
            continue
        if isinstance(value, str) or not value > 0.0:
            raise ProblemError(
                f"contact.{names[0]}.normal.{name} is {quoted(value)}: a range around it needs a positive number; "
                "name it with --fit"
            )
        fitted.append(Parameter(f"contact.{names[0]}.normal.{name}", value / _RANGE, value * _RANGE, float(value)))
    return tuple(fitted)


def _parameters(
    parameters: Mapping[str, tuple[float, float]] | Sequence[Parameter], measured: Measurements
) -> tuple[Parameter, ...]:
    if isinstance(parameters, Mapping):
        wanted = tuple(Parameter(key, *_range_of(key, ends)) for key, ends in parameters.items())
    else:
        listed: Iterable[object] = expect(parameters, Iterable, "the parameters", "give a dict of ranges by names")
        wanted = tuple(expect(item, Parameter, "a parameter", "pass Parameter(key, low, high)") for item in listed)
    if not wanted:
        raise ProblemError("no parameter is to be fitted; name at least one with its range")
    keys = [parameter.key for parameter in wanted]
    for key in keys:
        if keys.count(key) > 1:
            raise ProblemError(f"parameter '{key}' is there twice; give it once")
        if key in measured.inputs:
            raise ProblemError(
                f"'{key}' is a column of what was set and a parameter to be fitted; it can be one of them"
            )
    return wanted


def _range_of(key: str, ends: object) -> tuple[float, float]:
    """The two ends of the range of a parameter."""
    if not isinstance(ends, Sequence | np.ndarray) or isinstance(ends, str | bytes) or len(ends) != 2:
        raise ProblemError(f"the range of {key} is {described(ends)}; give its two ends, such as (0.5, 5.0)")
    return ends[0], ends[1]


def _statement(
    problem: Model, changes: Sequence[Change], inputs: Iterable[str], code: Sequence[str]
) -> Callable[[Mapping[str, float]], ProblemLike]:
    if callable(problem):
        takes = "let it take a dict of values by name and return a problem"
        return lambda values: cast(ProblemLike, answer(problem, (values,), "identify", takes))
    if not isinstance(problem, str | Path):
        raise ProblemError(
            f"identify: the problem is {described(problem)}; give the path of a problem file, or a function"
        )
    text, folder, name = read_text(problem), Path(problem).parent, str(problem)
    for key in inputs:
        if key.partition(".")[0] not in _SET_BY_COLUMNS:
            raise ProblemError(
                f"column '{key}' is neither a load nor a support of {shown(name)}; name it as a key of "
                f"{' or '.join(f'[{table}]' for table in _SET_BY_COLUMNS)}, or leave it out"
            )

    def state(values: Mapping[str, float]) -> ProblemLike:
        given = [*changes, *(Change(key, value) for key, value in values.items())]
        return parse_problem_file(text, folder, name, changes=given, code=code).problem

    return state


def _discrete(state: Callable[[Mapping[str, float]], ProblemLike], values: Mapping[str, float]) -> DiscreteProblem:
    check_time()
    return as_discrete(state(values), "identify")


def _law_on(problem: DiscreteProblem, stated: ProblemLike) -> VectorLaw:
    """The law of a statement at the contact points of a problem, which has the same body."""
    contact = problem.contact
    if not isinstance(stated, ContactProblem) or contact.points is None or (np.diff(contact.boundary) < 0).any():
        return as_discrete(stated, "identify").law
    groups = []
    for number, name in enumerate(contact.names):
        points = contact.points[contact.boundary == number]
        if len(points):
            groups.append((stated.contact[name].law.at(points), len(points)))
    return join_laws(groups)


def _message(attempt: FitAttempt) -> str:
    return f"start {attempt.number + 1} of {attempt.count}: misfit {attempt.misfit:.2%}"
