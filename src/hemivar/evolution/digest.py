"""What makes an evolution the same one: a digest of its content."""

from __future__ import annotations

import hashlib
from importlib.metadata import version

import numpy as np

from hemivar.basics.content import content
from hemivar.basics.types import Array
from hemivar.evolution.stepper import TimeStepper
from hemivar.evolution.steps import AdaptiveStep, FixedStep
from hemivar.laws import ContactLaw

__all__ = ["identity"]


def identity(advance: TimeStepper, *options: object) -> str:
    """A digest of matrices, contact points, loads, laws, memories, method and options, for checkpoints.

    What was stated counts by its content: arrays by all their numbers, formulas by their text, functions by their
    code and what they enclose.  Loads and laws are looked at as well, at times within the first step: a function may
    do what its code does not say.
    """
    discrete, digest = advance.discrete, hashlib.sha256()

    def add(*values: object) -> None:
        for value in values:
            for part in content(value):
                digest.update(part)

    add(version("hemivar"))
    for operator in (discrete.stiffness, discrete.viscosity, discrete.mass):
        add(None if operator is None else operator.numbers)
    add([(period, part.numbers) for period, part in discrete.branches])
    contact = discrete.problem.contact
    add(contact.trace.indptr, contact.trace.indices, contact.trace.data, contact.weights)
    evolution = discrete.evolution
    add(evolution)
    for time in _looked_at(evolution.start, *options):
        acting = advance.data.at(time)
        add(acting.load, acting.prescribed, acting.offset)
        if contact.count:
            add(*_law_at(acting.law, acting.offset))
    for name in ("displacement", "velocity"):
        add(evolution.initial(name))
    if advance.beside is not None:
        add(identity(advance.beside))
    add(advance.scheme, advance.stages.solver, advance.controls.rtol, advance.controls.atol, options)
    return digest.hexdigest()


def _looked_at(start: float, *options: object) -> list[float]:
    """Times at which loads are looked at: none lies beyond the first step, which no end cuts."""
    steps = [one.step for one in options if isinstance(one, FixedStep)]
    steps += [one.first_step for one in options if isinstance(one, AdaptiveStep) and one.first_step is not None]
    return [start, *(start + part * step for step in steps for part in (0.37, 1.0))]


def _law_at(law: ContactLaw, offset: Array) -> tuple[Array, ...]:
    """Values of a law at penetrations and slips of many sizes."""
    size = max(float(np.abs(offset).max(initial=0.0)), 1.0)
    found = []
    for factor in 10.0 ** np.arange(-6.0, 2.0):
        r = np.full(offset.shape, factor * size)
        for sign in (1.0, -1.0):
            r[:, 0] = sign * factor * size
            with np.errstate(all="ignore"):
                found.append(np.nan_to_num(law.frozen(r, np.abs(r)).value(r)))
    return tuple(found)
