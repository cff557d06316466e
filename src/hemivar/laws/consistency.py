"""A quick look, from samples, at whether what a user gave for a law fits together; the kit in testing looks closer."""

from __future__ import annotations

import contextlib
from typing import ClassVar
from weakref import WeakSet

import numpy as np

from hemivar.errors import ProblemError
from hemivar.laws.scalar_samples import Samples
from hemivar.laws.superpotential import Superpotential

__all__ = ["check_consistency", "check_own"]

#: Knots next to which a value may rise ever more steeply.
_MOST_KNOTS = 40

_REMEDY = "correct the functions, or leave one of them out"

_SEEN: WeakSet[Superpotential] = WeakSet()


def check_own(law: Superpotential) -> None:
    """Look at a law of a class that is not hemivar's, once, if its parameters are numbers."""
    if type(law).__module__.startswith("hemivar."):
        return
    try:
        if law in _SEEN:
            return
    except TypeError:  # a class that cannot be hashed is looked at again
        pass
    try:
        one = law.take(np.array([0])) if law.knots.shape[0] > 1 else law
        reach = 3.0 * float(np.abs(one.knots[np.isfinite(one.knots)]).max(initial=0.0)) or 1.0
        one.value(np.zeros(1))
    except Exception:  # parameters that are not known yet, or a law that only the kit can describe
        return
    check_consistency(one, reach, alpha=float(np.atleast_1d(one.weak_convexity)[0]))
    with contextlib.suppress(TypeError):
        _SEEN.add(law)


def check_consistency(law: Superpotential, reach: float, alpha: float | None = None, remedy: str = _REMEDY) -> None:
    """Refuse a law of one contact point whose value, derivative and curvature do not belong to each other.

    Places up to ``reach`` are tried, and ``alpha`` as the user states it; messages name the place.
    """
    with np.errstate(all="ignore"):
        look = _QuickLook(law, reach, f" of law '{law.name}'")
        questions = (
            (look.slopes, ""),
            (look.kinks, ""),
            (look.derivative, f"; {_REMEDY}"),
            (look.curvature, f"; {remedy}"),
            (look.zero, ""),
            (lambda: None if alpha is None else look.falls_within(alpha), ""),
        )
        for question, todo in questions:
            if wrong := question():
                raise ProblemError(f"{wrong}{todo}")


class _QuickLook(Samples):
    """Few cells, on which a rate is known roughly."""

    places: ClassVar[tuple[int, int, float]] = (25, 6, 1e-4)
    exact: ClassVar[tuple[float, float, float, float]] = (0.02, 1e-3, 1e-6, 1e-11)
    falls: ClassVar[tuple[float, float, float]] = (1e-2, 1e-4, 1e-4)
    jumps: ClassVar[tuple[float, float, float]] = (1e-3, 0.0, 0.1)
    closer: ClassVar[bool] = True

    def slopes(self) -> str | None:
        """A value that rises ever more steeply next to a knot or to zero."""
        knots, law = self.knots[:_MOST_KNOTS], self.law
        steps = self.reach * np.array([1e-3, 1e-5, 1e-7, 1e-9])
        beside = (np.abs(knots) <= steps[0]).any()  # a knot beside zero stands for it
        places = knots if beside else np.append(knots, 0.0)
        for place in np.unique(places):
            for side in (-1.0, 1.0):
                at = place + side * steps
                if not self.ends[0] <= at[0] <= self.ends[1]:
                    continue
                value = law.value(np.full(steps.size, place))
                rate = np.abs(law.value(at) - value) / steps
                if np.all(rate[1:] > 1.3 * rate[:-1] + (8.0 * np.finfo(float).eps * np.abs(value) / steps)[1:]):
                    return (
                        f"the derivative{self.whose} grows without bound at r = {place:.6g}; a law needs a finite "
                        "slope everywhere (but at jumps of its derivative)"
                    )
        return None
