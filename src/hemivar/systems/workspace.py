"""The cache of what is expensive about a model, kept by whoever owns it: factors, Schur complement, levels, norms."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np

from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.first_use import Lock
from hemivar.basics.types import AnyArray
from hemivar.discrete.model import Model
from hemivar.discrete.problem import DiscreteProblem
from hemivar.systems.condensed import CondensedProblem, condense

__all__ = ["Workspace"]

K = TypeVar("K")
T = TypeVar("T")
_CONDENSATION, _FOR_MANY = "condensation", "condensation for many loads"


class Workspace:
    """What has been paid for a body, so that it is paid once.

    Pass the same workspace to :func:`hemivar.solve`, :func:`hemivar.certify`, :func:`hemivar.find_solutions` and
    :func:`hemivar.follow_path`.  What it holds belongs to the model of a problem, that very object.  Another load, gap
    or law, made by :meth:`DiscreteProblem.with_`, costs no new factorisation.  Nothing in it changes an answer.  It may
    be used by several threads: one makes what the others wait for.

    Parameters
    ----------
    bodies : int
        How many models it holds at a time; the one used longest ago is forgotten first.
    """

    def __init__(self, bodies: int = 8) -> None:
        self._bodies = whole_number(bodies, "bodies of a workspace", 1)
        self._lock = Lock()
        self._of_models: OrderedDict[Model, _Shelf] = OrderedDict()
        self._of_contents: OrderedDict[bytes, _Shelf] = OrderedDict()
        self._of_foundations: OrderedDict[tuple[int, ...], _Shelf] = OrderedDict()

    def __repr__(self) -> str:
        with self._lock:
            kept = [f"{m.unknowns} unknowns: {', '.join(sorted(shelf.things))}" for m, shelf in self._of_models.items()]
            kept += [name for shelf in self._of_contents.values() for name in sorted(shelf.things)]
        return f"Workspace({'; '.join(kept) or 'empty'})"

    def __reduce__(self) -> tuple[type[Workspace], tuple[int]]:
        return Workspace, (self._bodies,)  # factors cannot travel: they are made again on arrival

    @staticmethod
    def given(workspace: Workspace | None) -> Workspace:
        """What a caller passed, or a new one; anything else is refused.

        Raises
        ------
        ProblemError
        """
        if workspace is None:
            return Workspace()
        remedy = "make one, hemivar.systems.Workspace(), and pass it to every call"
        return expect(workspace, Workspace, "the workspace", remedy)

    @classmethod
    def holding(cls, condensed: CondensedProblem) -> Workspace:
        """A workspace that knows a condensation already."""
        workspace = cls()
        workspace.once(_CONDENSATION, condensed.problem.model, lambda: condensed)
        return workspace

    def once(self, what: str, key: Model | tuple[AnyArray, ...], make: Callable[[], T]) -> T:
        """What is known of a model, or of the numbers of some arrays, under a name; made on the first call.

        What depends on numbers alone is kept through meshes that are refined, and through problems that are stated
        again.

        Parameters
        ----------
        what : str
            The name; it stands for one kind of thing that depends on the key alone.
        key : Model or tuple of arrays
        make : function
            Makes it. Other threads that ask for the same wait.
        """
        shelf = self._shelf(key) if isinstance(key, Model) else self._shelf_of_content(what, key)
        return self._once(shelf, what, make)

    def under_any_load(self, what: str, problem: DiscreteProblem, make: Callable[[], T]) -> T:
        """What is known of all problems that differ from this one in their loads alone; made on the first call.

        Parameters
        ----------
        what : str
            The name; it stands for one kind of thing that depends on model, law and offset.
        problem : DiscreteProblem
        make : function
        """
        parts = problem.model, problem.law, problem.offset
        with self._lock:
            shelf = _recent(self._of_foundations, tuple(map(id, parts)), self._bodies)
        shelf.things.setdefault("", parts)  # while they are held here, none else has their numbers
        return self._once(shelf, what, make)

    def _once(self, shelf: _Shelf, what: str, make: Callable[[], T]) -> T:
        if what in shelf.things:
            return cast(T, shelf.things[what])
        with self._lock:
            lock = shelf.locks.setdefault(what, Lock())
        with lock:
            if what not in shelf.things:
                shelf.things[what] = make()
            return cast(T, shelf.things[what])

    def condensed(self, problem: DiscreteProblem, many: bool = False) -> CondensedProblem:
        """The body condensed onto its contact boundary, under the load, the gap and the law of the problem.

        ``many`` if many loads are to come, see :func:`hemivar.systems.condense`.
        """
        known = self._shelf(problem.model).things.get(_FOR_MANY)
        if known is not None:  # every step in time asks
            return cast(CondensedProblem, known).for_problem(problem)
        what = _FOR_MANY if many else _CONDENSATION
        return self.once(what, problem.model, lambda: condense(problem, many)).for_problem(problem)

    def condenses(self, problem: DiscreteProblem) -> bool:
        """Whether the body of the problem has been condensed already."""
        return not self._shelf(problem.model).things.keys().isdisjoint((_CONDENSATION, _FOR_MANY))

    def forget(self) -> None:
        """Give all memory back."""
        with self._lock:
            self._of_models.clear()
            self._of_contents.clear()
            self._of_foundations.clear()

    def _shelf(self, model: Model) -> _Shelf:
        with self._lock:
            shelf, known = _recent(self._of_models, model, self._bodies), {id(one) for one in self._of_models}
            for key in [key for key in self._of_foundations if key[0] not in known]:
                del self._of_foundations[key]  # they would hold a body that is forgotten
            return shelf

    def _shelf_of_content(self, what: str, arrays: tuple[AnyArray, ...]) -> _Shelf:
        digest = hashlib.sha256(what.encode())
        for array in arrays:
            digest.update(repr((array.shape, array.dtype.str)).encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        with self._lock:
            return _recent(self._of_contents, digest.digest(), 4 * self._bodies)


class _Shelf:
    """What is known of one model, or of one set of numbers."""

    def __init__(self) -> None:
        self.things: dict[str, object] = {}
        self.locks: dict[str, Lock] = {}


def _recent(shelves: OrderedDict[K, _Shelf], key: K, most: int) -> _Shelf:
    """The shelf of a key, the last one used from now on; the one used longest ago is forgotten beyond ``most``."""
    shelf = shelves.setdefault(key, _Shelf())
    shelves.move_to_end(key)
    while len(shelves) > most:
        shelves.popitem(last=False)
    return shelf
