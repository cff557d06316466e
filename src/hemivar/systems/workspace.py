"""What is expensive about a body, kept by whoever owns it: factors, Schur complement, levels, norms."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np

from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.first_use import Lock
from hemivar.basics.types import AnyArray
from hemivar.discrete.problem import DiscreteProblem, quadratic
from hemivar.systems.condensed import CondensedProblem, condense

__all__ = ["Workspace"]

T = TypeVar("T")
#: Kinds of things that are kept for each body by their content.
_KINDS = 4
_CONDENSATION, _FOR_MANY = "condensation", "condensation for many loads"


class Workspace:
    """What has been paid for a body, so that it is paid once.

    Pass the same workspace to :func:`hemivar.solve`, :func:`hemivar.certify`, :func:`hemivar.find_solutions` and
    :func:`hemivar.follow_path`.  What it holds is keyed by the body: its stiffness, the trace and the weights of its
    contact points, its space and origin.  Another load, gap or law, made by :meth:`DiscreteProblem.with_`, costs no new
    factorisation.  Nothing in it changes an answer.  It may be used by several threads: one makes what the others wait
    for.

    Parameters
    ----------
    bodies : int
        How many bodies it holds at a time; the one used longest ago is forgotten first.
    """

    def __init__(self, bodies: int = 8) -> None:
        self._bodies = whole_number(bodies, "bodies of a workspace", 1)
        self._lock = Lock()
        self._shelves: OrderedDict[tuple[int, ...], _Shelf] = OrderedDict()
        self._contents: OrderedDict[bytes, _Shelf] = OrderedDict()

    def __repr__(self) -> str:
        with self._lock:
            kept = [f"{shelf.unknowns} unknowns: {', '.join(sorted(shelf.things))}" for shelf in self._shelves.values()]
            kept += [name for shelf in self._contents.values() for name in sorted(shelf.things)]
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
        remedy = "make one, hemivar.Workspace(), and pass it to every call"
        return expect(workspace, Workspace, "the workspace", remedy)

    @classmethod
    def holding(cls, condensed: CondensedProblem) -> Workspace:
        """A workspace that knows a condensation already."""
        workspace = cls()
        workspace.once(_CONDENSATION, condensed.problem, lambda: condensed)
        return workspace

    def once(self, what: str, problem: DiscreteProblem, make: Callable[[], T]) -> T:
        """What is known of the body of a problem under a name, made on the first call.

        Parameters
        ----------
        what : str
            The name; it stands for one kind of thing that depends on the body alone.
        problem : DiscreteProblem
            With a quadratic bulk.
        make : function
            Makes it. Other threads that ask for the same wait.
        """
        shelf = self._shelf(problem)
        with self._lock:
            lock = shelf.locks.setdefault(what, Lock())
        with lock:
            if what not in shelf.things:
                shelf.things[what] = make()
            return cast(T, shelf.things[what])

    def known(self, what: str, content: tuple[AnyArray, ...], make: Callable[[], T]) -> T:
        """What depends on nothing but the numbers of some arrays, made on the first call.

        So constants of a body are kept through meshes that are refined, and through problems that are stated anew.

        Parameters
        ----------
        what : str
            The name; it stands for one kind of thing.
        content : tuple of arrays
        make : function
            Makes it. Other threads that ask for the same wait.
        """
        digest = hashlib.sha256(what.encode())
        for array in content:
            digest.update(repr((array.shape, array.dtype.str)).encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        key = digest.digest()
        with self._lock:
            shelf = self._contents.setdefault(key, _Shelf((), 0))
            self._contents.move_to_end(key)
            while len(self._contents) > _KINDS * self._bodies:
                self._contents.popitem(last=False)
            lock = shelf.locks.setdefault(what, Lock())
        with lock:
            if what not in shelf.things:
                shelf.things[what] = make()
            return cast(T, shelf.things[what])

    def condensed(self, problem: DiscreteProblem, many: bool = False) -> CondensedProblem:
        """The body condensed onto its contact boundary, under the load, the gap and the law of the problem.

        ``many`` if many loads are to come, see :func:`hemivar.systems.condense`.
        """
        many = many or _FOR_MANY in self._shelf(problem).things
        what = _FOR_MANY if many else _CONDENSATION
        return self.once(what, problem, lambda: condense(problem, many)).for_problem(problem)

    def condenses(self, problem: DiscreteProblem) -> bool:
        """Whether the body of the problem has been condensed already."""
        return not self._shelf(problem).things.keys().isdisjoint((_CONDENSATION, _FOR_MANY))

    def forget(self) -> None:
        """Give all memory back."""
        with self._lock:
            self._shelves.clear()
            self._contents.clear()

    def _shelf(self, problem: DiscreteProblem) -> _Shelf:
        contact = problem.contact
        body = (quadratic(problem.bulk).stiffness, contact.trace, contact.weights, problem.space, problem.origin)
        key = tuple(map(id, body))
        with self._lock:
            shelf = self._shelves.get(key)
            if shelf is None:
                shelf = self._shelves[key] = _Shelf(body, problem.unknowns)
            self._shelves.move_to_end(key)
            while len(self._shelves) > self._bodies:
                self._shelves.popitem(last=False)
        return shelf


class _Shelf:
    """What belongs to one body; what makes it up is held, so that their identities stay theirs."""

    def __init__(self, body: tuple[object, ...], unknowns: int) -> None:
        self.body = body
        self.unknowns = unknowns
        self.things: dict[str, object] = {}
        self.locks: dict[str, Lock] = {}
