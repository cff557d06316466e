"""What makes an evolution the same one: a digest of its content."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from hemivar.basics.content import digest_of
from hemivar.basics.types import Array
from hemivar.evolution.stepper import TimeStepper
from hemivar.evolution.steps import AdaptiveStep, FixedStep
from hemivar.laws import VectorLaw

__all__ = ["differences", "identity"]

#: What a march is known by, in the order in which it is written.
_PARTS = ("version", "evolution", "scheme", "method", "choice of steps, events or loads in time")


def identity(stepper: TimeStepper, *options: object) -> str:
    """The version, and digests of the evolution, the scheme, the method and the options, for checkpoints.

    The evolution is its matrices, contact points, loads, laws and memories.

    What was stated counts by its content: arrays by all their numbers, formulas by their text, functions by their
    code and what they enclose.  Loads and laws are looked at as well, at times within the first step: a function may
    do what its code does not say.
    """
    method = (stepper.stages.solver, stepper.controls.rtol, stepper.controls.atol)
    steps = _digest(options, *_within_the_first_step(stepper, *options))
    parts = (_evolution(stepper), _digest(stepper.scheme), _digest(*method), steps)
    return "|".join((version("hemivar"), *parts))


def differences(one: str, other: str) -> str:
    """Which parts of two identities differ, in words."""
    parts, others = one.split("|"), other.split("|")
    if not len(parts) == len(others) == len(_PARTS):
        return "evolution, scheme, method or version"
    different = [name for name, mine, yours in zip(_PARTS, parts, others, strict=True) if mine != yours]
    if "evolution" in different and different[-1] == _PARTS[-1]:  # whose loads are others anyway
        different.pop()
    return different[0] if len(different) == 1 else f"{', '.join(different[:-1])} and {different[-1]}"


def _digest(*values: object) -> str:
    return digest_of(*values)[:32]


def _evolution(stepper: TimeStepper) -> str:
    """The digest of what is computed, as it is stated."""
    discrete = stepper.discrete
    content: list[object] = []
    for operator in (discrete.stiffness, discrete.viscosity, discrete.mass):
        content.append(None if operator is None else operator.numbers)
    content.append([(period, part.numbers) for period, part in discrete.branches])
    contact = discrete.problem.contact
    content += [contact.trace.indptr, contact.trace.indices, contact.trace.data, contact.weights]
    evolution = discrete.evolution
    content.append(evolution)
    for name in ("displacement", "velocity"):
        content.append(evolution.initial(name))
    if stepper.beside is not None:
        content.append(identity(stepper.beside))
    return _digest(*content)


def _within_the_first_step(stepper: TimeStepper, *options: object) -> list[object]:
    """Loads and laws at times within the first step."""
    values: list[object] = []
    for time in _looked_at(stepper.discrete.evolution.start, *options):
        acting = stepper.data.at(time)
        values += [acting.load, acting.prescribed, acting.offset]
        if stepper.discrete.problem.contact.count:
            values += _law_at(acting.law, acting.offset)
    return values


def _looked_at(start: float, *options: object) -> list[float]:
    """Times at which loads are looked at: none lies beyond the first step, which no end cuts."""
    steps = [one.step for one in options if isinstance(one, FixedStep)]
    steps += [one.first_step for one in options if isinstance(one, AdaptiveStep) and one.first_step is not None]
    return [start, *(start + part * step for step in steps for part in (0.37, 1.0))]


def _law_at(law: VectorLaw, offset: Array) -> tuple[Array, ...]:
    """Values of a law at penetrations and slips of many sizes."""
    size = max(float(np.abs(offset).max(initial=0.0)), 1.0)
    values = []
    for factor in 10.0 ** np.arange(-6.0, 2.0):
        r = np.full(offset.shape, factor * size)
        for sign in (1.0, -1.0):
            r[:, 0] = sign * factor * size
            with np.errstate(all="ignore"):
                values.append(np.nan_to_num(law.frozen(r, np.abs(r)).value(r)))
    return tuple(values)
