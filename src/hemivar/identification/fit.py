"""Nonlinear least squares over the parameters of a law: confidence intervals, and what is not identifiable."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtrit

from hemivar.basics import arguments
from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.deadline import Budget, OutOfTime, check_time, limited
from hemivar.basics.defined_above import above
from hemivar.basics.last_used import Recent
from hemivar.basics.portable import PickleMixin
from hemivar.basics.rows import Column, ResultRows, plain
from hemivar.basics.types import Array, Record
from hemivar.errors import HemivarError, ProblemError
from hemivar.identification.experiment import Experiment
from hemivar.identification.law_derivative import derivative_by_law
from hemivar.identification.measurements import Measurements
from hemivar.laws import VectorLaw
from hemivar.solvers import Solution, Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hemivar.report.summary import Summary

__all__ = ["Fit", "FitOptions", "Parameter", "fit"]

#: Relative change of a parameter by which its law is differenced, to one side: an error of 1e-6 by curvature, 1e-10 by
#: rounding. 1e-5 and 1e-7 give the same fits in tests/identification.
_CHANGE = 1e-6
#: Misfit that is given to parameters for which the body cannot be solved, in units of the largest measured value. 1e2
#: and 1e4 give the same fits in tests/identification.
_NO_ANSWER = 1e3
#: How many times more or less than the first guess a curve is before its units are doubted. A choice: a mistaken unit
#: is mostly a factor of 1000.
_UNITS = 100.0
#: Standard errors, relative to the parameter, beyond which it counts as not identified. A choice: at 0.5 an interval of
#: 95 % reaches zero.
_KNOWN = 0.5
#: Singular values of the sensitivities, relative to the largest, that are none. It must be above the rounding of the
#: differences: 1e-6 and 1e-8 give the same fits in tests/identification, but 1e-8 does not with changes of 1e-7.
_RANK = 1e-7
#: How closely the curves of two starts agree where both found the same, relative to the largest measured value. 1e-5
#: and 1e-7 give the same fits in tests/identification.
_SAME = 1e-6
#: Misfit, relative to the same, beyond which a third start is tried though two agree. 0.03 and 0.3 give the same fits
#: in tests/identification.
_POOR = 0.1
#: Part of the variation of the measured curve that a law has to explain, else it is doubted. A choice.
_EXPLAINED = 0.9


@dataclass(frozen=True)
class Parameter:
    """A number of the law that is looked for.

    Parameters
    ----------
    key : str
        Key of the problem file, as ``contact.bottom.normal.strength``, or a name for a function of one's own.
    low, high : float
        Ends of the range in which it is looked for.
    start : float, optional
        Where to begin; by default in the middle of the range, in its logarithm where both ends are positive.

    Raises
    ------
    ProblemError
        The range is empty or not finite, or the start is outside it.
    """

    key: str
    low: float
    high: float
    start: float | None = None

    def __post_init__(self) -> None:
        for end, value in (("lower end", self.low), ("upper end", self.high)):
            arguments.number(value, f"the {end} of the range of {self.key}")
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ProblemError(
                f"the range of {self.key} is {self.low:g} to {self.high:g}; give a lower end and a higher one"
            )
        if self.start is not None and not self.low <= self.start <= self.high:
            raise ProblemError(
                f"{self.key} begins at {self.start:g}, outside {self.low:g} to {self.high:g}; widen the range"
            )

    @property
    def by_logarithm(self) -> bool:
        """Whether steps are taken in the logarithm."""
        return self.low > 0.0

    def inside(self, value: Array | float) -> Array:
        """The variable of the least squares."""
        return np.asarray(np.log(value) if self.by_logarithm else value)

    def outside(self, variable: float) -> float:
        """The parameter of a variable."""
        value = math.exp(variable) if self.by_logarithm else variable
        return min(max(value, self.low), self.high)

    @property
    def middle(self) -> float:
        """Where the first attempt begins."""
        if self.start is not None:
            return self.start
        return math.sqrt(self.low * self.high) if self.by_logarithm else 0.5 * (self.low + self.high)


@dataclass(frozen=True)
class FitOptions:
    """How to look for the parameters.

    Parameters
    ----------
    starts : int
        Attempts at most, the first from the start of each parameter, the others from random places of the ranges; no
        more are made when two have found the same curve.
    seed : int
        Of these.
    confidence : float
        Of the intervals.
    noise : float, optional
        Standard deviation of the measurements, relative to the largest of each quantity; by default it is estimated
        from what the fit leaves.

    Raises
    ------
    ProblemError
        A number makes no sense.
    """

    starts: int = 6
    seed: int = 0
    confidence: float = 0.95
    noise: float | None = None

    def __post_init__(self) -> None:
        whole_number(self.starts, "starts", 1)
        whole_number(self.seed, "seed", 0)
        if not 0.0 < self.confidence < 1.0:
            raise ProblemError(f"confidence = {self.confidence:g}; give a number between 0 and 1, such as 0.95")
        if self.noise is not None and not 0.0 < self.noise < math.inf:
            raise ProblemError(f"noise = {self.noise:g}; give a positive number, or leave it out")


@dataclass(frozen=True, eq=False)
class Fit(PickleMixin):
    """Parameters that fit a measured curve, and what the curve says of them.

    Attributes
    ----------
    parameters : tuple of Parameter
    values : array (p,)
        The parameters found.
    intervals : array (p, 2)
        Each holds the true parameter with the confidence asked for if the law is the right one and the noise is normal
        and independent: ``t`` times the standard error, and what the certified errors of the solutions can change,
        to both sides of the value; of its logarithm where the range is positive.
    standard_errors : array (p,)
        Infinite where the curve does not depend on a parameter.
    certified : array (p,)
        Part of the half width that stands for the error of the solutions; nan where one of them has no bound.
    confidence : float
    noise : float
        Standard deviation of the measurements, relative to the largest of each quantity: given, or estimated.
    measurements : Measurements
    predicted : array (n, q)
    sensitivity : array (n q, p)
        Derivatives of the quantities, each relative to its largest, by the logarithms of the parameters (by the
        parameters where a range reaches zero).
    singular_values : array (p,)
        Of the sensitivity over the noise: beyond one the curve tells something of that combination.
    directions : array (p, p)
        The combination that belongs to each, in rows.
    solutions : tuple of Solution
        Of each row.
    messages : tuple of str
        What is to be known beside the numbers.
    """

    parameters: tuple[Parameter, ...]
    values: Array
    intervals: Array
    standard_errors: Array
    certified: Array
    confidence: float
    noise: float
    measurements: Measurements
    predicted: Array
    sensitivity: Array
    singular_values: Array
    directions: Array
    solutions: tuple[Solution, ...]
    messages: tuple[str, ...] = ()

    @property
    def misfit(self) -> float:
        """Root of the mean square of what is left, relative to the largest measured value of each quantity."""
        off = (self.measurements.values - self.predicted) / self.measurements.scales
        return float(np.sqrt((off**2).mean()))

    @property
    def identified(self) -> tuple[bool, ...]:
        """Of each parameter, whether the curve tells its size: a standard error of at most half of it."""
        return tuple((self.standard_errors <= _KNOWN * np.abs(self.values)).tolist())

    def rows(self) -> ResultRows:
        """A row for each parameter: value, interval, standard error, and whether the curve tells it."""
        low, high = np.where(np.isfinite(self.intervals), self.intervals, np.nan).T
        columns = (
            Column("parameter", [one.key for one in self.parameters]),
            Column("value", self.values, "value"),
            Column("low", low),
            Column("high", high),
            Column(None, self.intervals, "interval"),
            Column(
                "standard error",
                np.where(np.isfinite(self.standard_errors), self.standard_errors, np.nan),
                "standard_error",
            ),
            Column(None, self.certified, "certified"),
            Column("identified", self.identified, "identified", cell=lambda sure: "yes" if sure else "no"),
            Column(None, [(one.low, one.high) for one in self.parameters], "range"),
        )
        return ResultRows(columns)

    def record(self) -> Record:
        """Plain numbers, lists and strings for JSON; what is infinite or not known is null."""
        data = self.measurements
        return {
            "parameters": plain(dict(zip([one.key for one in self.parameters], self.rows(), strict=True))),
            "confidence": self.confidence,
            "noise": self.noise,
            "misfit": self.misfit,
            "singular_values": plain(self.singular_values),
            "directions": plain(self.directions),
            "inputs": {key: plain(values) for key, values in data.inputs.items()},
            "measured": {key: plain(values) for key, values in data.measured.items()},
            "predicted": dict(zip(data.measured, map(plain, self.predicted.T), strict=True)),
            "messages": list(self.messages),
        }

    def value(self, key: str) -> float:
        """A parameter by its key, or by the last part of it."""
        keys = [parameter.key for parameter in self.parameters]
        for name, value in zip(keys, self.values, strict=True):
            if key in (name, name.rpartition(".")[2]):
                return float(value)
        raise ProblemError(f"'{key}' was not fitted; fitted were {', '.join(keys)}")

    def plot(self, *, title: str | None = None) -> Figure:
        """Curve, fit, what is left, and intervals; see :func:`.plot_fit`."""
        figure: Figure = above("Fit.plot")(self, title=title)
        return figure

    def summary(self) -> Summary:
        """Parameters with their intervals, misfit, noise and notes, a line each."""
        summary: Summary = above("Fit.summary")(self)
        return summary

    def __repr__(self) -> str:
        values = ", ".join(
            f"{parameter.key.rpartition('.')[2]} = {value:.4g}"
            for parameter, value in zip(self.parameters, self.values, strict=True)
        )
        return f"Fit({values}; misfit {self.misfit:.2g})"


@dataclass(frozen=True, eq=False)
class FitAttempt:
    """A start is done."""

    number: int
    count: int
    misfit: float  # relative to the largest measured value


#: Law, solutions of all rows and what would be measured, for some parameters.
_Answer: TypeAlias = tuple[VectorLaw, list[Solution], Array]


@dataclass(frozen=True, eq=False)
class _Curve:
    """Curve and sensitivities over the variables of the least squares."""

    experiment: Experiment
    measurements: Measurements
    parameters: Sequence[Parameter]
    law: Callable[[Array], VectorLaw]
    known: Recent[bytes, _Answer] = field(default_factory=lambda: Recent(2), repr=False)

    def values(self, variables: Array) -> Array:
        return np.array([key.outside(float(x)) for key, x in zip(self.parameters, variables, strict=True)])

    def at(self, variables: Array) -> _Answer:
        """Law, solutions and predicted quantities."""

        def made() -> _Answer:
            law = self.law(self.values(variables))
            solutions = self.experiment.solutions(law)
            return law, solutions, self.experiment.predicted(solutions)

        return self.known.once(variables.tobytes(), made)

    def off(self, variables: Array) -> Array:
        """What is left (n q,), relative to the largest of each quantity; large where there is no answer."""
        try:
            return self.left_by(self.at(variables))
        except HemivarError:
            return np.full(self.measurements.values.size, _NO_ANSWER)

    def left_by(self, answer: _Answer) -> Array:
        """:meth:`off` where the answer is known."""
        _, solutions, predicted = answer
        left = (predicted - self.measurements.values) / self.measurements.scales
        left[[solution.status is not Status.CONVERGED for solution in solutions]] = _NO_ANSWER
        return np.nan_to_num(left.ravel(), nan=_NO_ANSWER, posinf=_NO_ANSWER, neginf=-_NO_ANSWER)

    def slopes(self, variables: Array) -> Array:
        """Derivatives (n q, p) of :meth:`off`."""
        try:
            answer = self.at(variables)
        except HemivarError:
            return np.zeros((self.measurements.values.size, len(self.parameters)))
        return self.slopes_of(variables, answer)

    def slopes_of(self, variables: Array, answer: _Answer) -> Array:
        """:meth:`slopes` where the answer is known."""
        n, q, p = self.measurements.count, self.measurements.values.shape[1], len(self.parameters)
        law, solutions, _ = answer
        changed = []
        for i, parameter in enumerate(self.parameters):
            inwards = -1.0 if self.values(variables)[i] >= parameter.high else 1.0
            step = inwards * _CHANGE * (1.0 if parameter.by_logarithm else max(1.0, abs(variables[i])))
            moved = variables.copy()
            moved[i] += step
            changed.append((self.law(self.values(moved)), step))
        slopes = np.empty((n, q, p))
        for number, solution in enumerate(solutions):
            check_time()
            system = self.experiment.system(number, law)
            change = derivative_by_law(system, solution.local, solution.multiplier, changed)
            slopes[number] = np.einsum("qmd,mdp->qp", self.experiment.linear, change)
        scaled = slopes / self.measurements.scales[None, :, None]
        return np.asarray(np.nan_to_num(scaled.reshape(n * q, p), nan=0.0, posinf=0.0, neginf=0.0))


class _Watched:
    """What is left, and where it was least so far, of all starts; the answer there stays known."""

    def __init__(self, curve: _Curve) -> None:
        self.curve = curve
        self.best, self.least, self.left = np.zeros(0), math.inf, np.full(1, np.inf)
        self.answer: _Answer | None = None  # while the body was not solved for any parameters

    def off(self, variables: Array) -> Array:
        left = self.curve.off(variables)
        misfit = math.sqrt(float(left @ left) / left.size)
        if misfit < min(self.least, _NO_ANSWER / math.sqrt(left.size)):
            self.best, self.least, self.left = variables.copy(), misfit, left
            self.answer = self.curve.at(variables)
        return left


def fit(
    experiment: Experiment,
    measurements: Measurements,
    parameters: Sequence[Parameter],
    law: Callable[[Array], VectorLaw],
    options: FitOptions | None = None,
    max_time: float | Budget = math.inf,
) -> Generator[FitAttempt, bool | None, Fit]:
    """Least squares over the parameters of a law, from several starts; yields an :class:`FitAttempt` after each.

    The quantities are weighted by their largest values.  Derivatives go through the solution map
    (:func:`derivative_by_law`), so that an iteration costs a solve for each row, and a small system for each parameter.

    Parameters
    ----------
    experiment : Experiment
    measurements : Measurements
        With a row for each of its problems.
    parameters : sequence of Parameter
    law : callable
        The law at the contact points for values (p,).
    options : FitOptions, optional
    max_time : float or Budget
        Seconds for all starts and the certificates, or what is left of them; then the best that was found is returned,
        and a message says so.

    Returns
    -------
    Fit

    Raises
    ------
    ProblemError
        There are no more measured values than parameters, or the units of the curve cannot be those of the model.
    """
    options = expect(options or FitOptions(), FitOptions, "the options", "pass FitOptions(starts=...)")
    count, p = measurements.values.size, len(parameters)
    if count <= p:
        raise ProblemError(
            f"{count} measured value{'s' if count > 1 else ''} cannot fit {p} parameter{'s' if p > 1 else ''} and show "
            f"what is left; measure at least {p + 1}, or fit fewer parameters"
        )
    curve = _Curve(experiment, measurements, parameters, law)
    begin, low, high = np.array([[float(p.inside(x)) for x in (p.middle, p.low, p.high)] for p in parameters]).T
    rng = np.random.default_rng(options.seed)
    budget, watched, late = max_time if isinstance(max_time, Budget) else Budget(max_time), _Watched(curve), ""
    for number in range(options.starts):
        start = begin if not number else rng.uniform(low, high)
        least, left = watched.least, watched.left
        try:
            with limited(budget):
                if not number:
                    _check_units(curve, begin)
                optimum = least_squares(
                    watched.off, np.clip(start, low, high), curve.slopes, (low, high), x_scale=1.0, ftol=1e-12,
                    xtol=1e-10, gtol=1e-12, max_nfev=60,
                )  # fmt: skip
        except OutOfTime:
            late = f"the time limit of {budget.limit:g} s ended the fit in start {number + 1} of {options.starts}"
            break
        misfit = math.sqrt(2.0 * optimum.cost / count)
        yield FitAttempt(number, options.starts, misfit)
        again = misfit <= least * (1.0 + _SAME) and bool((np.abs(optimum.fun - left) <= _SAME).all())
        if number and again and misfit < _POOR:
            break
    if late and watched.answer is None:
        raise ProblemError(f"{late}, before the body was solved for any parameters; give more time")
    if watched.answer is None:
        raise ProblemError(
            "the body could not be solved for any parameters that were tried; look at the solution of the stated "
            "problem first, and narrow the ranges"
        )
    fitted = _fitted(curve, watched.best, watched.answer, options, (low, high), budget)
    return replace(fitted, messages=(f"{late}: others may fit better", *fitted.messages)) if late else fitted


def _check_units(curve: _Curve, begin: Array) -> None:
    """Refuse a curve that is of another size than that of the first guess."""
    _, _, predicted = curve.at(begin)
    for name, sizes, scale in zip(curve.measurements.measured, predicted.T, curve.measurements.scales, strict=True):
        size = float(np.abs(sizes).max())
        if size > 0.0 and not 1.0 / _UNITS <= scale / size <= _UNITS:
            raise ProblemError(
                f"the measured {name} reaches {scale:.3g}, but the stated body gives {size:.3g} before the fit; "
                f"check the units and the order of the columns, or begin nearer to what was measured"
            )


def _fitted(
    curve: _Curve, best: Array, answer: _Answer, options: FitOptions, ends: tuple[Array, Array], budget: Budget
) -> Fit:
    measurements, parameters = curve.measurements, curve.parameters
    law, solutions, predicted = answer
    J, off = curve.slopes_of(best, answer), curve.left_by(answer)
    count, p = J.shape
    noise = options.noise if options.noise is not None else float(np.sqrt(off @ off / (count - p)))
    _, singular, directions = np.linalg.svd(J, full_matrices=False)
    known = singular > _RANK * max(float(singular[0]), 1e-300)
    inverse = np.where(known, 1.0 / np.where(known, singular, 1.0), 0.0)
    spread = np.sqrt(((directions * inverse[:, None]) ** 2).sum(axis=0)) * noise
    lost = (np.abs(directions[~known]) > math.sqrt(_RANK)).any(axis=0)
    values = curve.values(best)
    by_log = np.array([parameter.by_logarithm for parameter in parameters])
    unit = np.where(by_log, values, 1.0)
    errors = np.where(lost, np.inf, spread * unit)
    doubt = "a row has several solutions or no certificate"
    try:
        with limited(budget):
            bounds = curve.experiment.error_bounds(law, solutions) / measurements.scales
    except OutOfTime:
        bounds, doubt = np.full((1, 1), np.inf), f"the time limit of {budget.limit:g} s left none for certificates"
    pseudo = np.linalg.pinv(J, rcond=_RANK)
    certified = np.full(p, np.nan) if not np.isfinite(bounds).all() else np.abs(pseudo) @ bounds.ravel() * unit
    factor = float(stdtrit(count - p, 0.5 + 0.5 * options.confidence)) if options.noise is None else _normal(options)
    half = factor * errors + np.nan_to_num(certified, nan=0.0)
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.exp(half / unit)  # in the logarithm: what is positive has no interval below zero
        low, high = np.where(by_log, values / ratio, values - half), np.where(by_log, values * ratio, values + half)
    intervals = np.column_stack([low, high])
    fitted = Fit(
        tuple(parameters), values, intervals, errors, certified, options.confidence, noise, measurements, predicted, J,
        singular / max(noise, 1e-300), directions, tuple(solutions),
    )  # fmt: skip
    return _with_messages(fitted, best, ends, doubt)


def _normal(options: FitOptions) -> float:
    return float(ndtri(0.5 + 0.5 * options.confidence))


def _with_messages(fitted: Fit, best: Array, ends: tuple[Array, Array], doubt: str) -> Fit:
    """The fit with what is to be known beside its numbers, in sentences."""
    messages = []
    low, high = ends
    at_end = np.minimum(best - low, high - best) <= 1e-6 * (high - low)
    keys = [parameter.key for parameter in fitted.parameters]
    for i, (key, identified) in enumerate(zip(keys, fitted.identified, strict=True)):
        if not identified:
            reach = fitted.intervals[i]
            how = (
                "the curve does not depend on it; leave it out of the fit, or measure where it acts"
                if np.isinf(reach).any()
                else f"it may lie from {reach[0]:.3g} to {reach[1]:.3g}"
            )
            messages.append(f"{key} is not identifiable from this curve: {how}")
        elif at_end[i]:
            messages.append(f"{key} ended at the limit of its range, {fitted.values[i]:.3g}: widen the range")
    weak = [row for row, size in zip(fitted.directions, fitted.singular_values, strict=True) if size < 1.0 / _KNOWN]
    for row in weak:
        members = [key for key, share in zip(keys, row, strict=True) if abs(share) > 0.3]
        if len(members) > 1:
            messages.append(f"the curve cannot distinguish {' and '.join(members)}: another pair fits as well")
    measured = fitted.measurements.values / fitted.measurements.scales
    varied = float(((measured - measured.mean(axis=0)) ** 2).sum())
    left = fitted.misfit**2 * measured.size
    if varied > 0.0 and left > (1.0 - _EXPLAINED) * varied:
        messages.append(
            f"the law explains {max(0.0, 1.0 - left / varied):.0%} of the variation of the curve: use another law, "
            f"or check the units and the order of the columns"
        )
    if np.isnan(fitted.certified).any():
        messages.append(f"{doubt}: the intervals include the noise only")
    return replace(fitted, messages=tuple(messages))
