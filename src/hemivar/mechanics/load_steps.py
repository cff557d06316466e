"""Load steps: what acts on a body changes from one static problem to the next, and friction remembers the way."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import cast

import numpy as np

from hemivar.basics.arguments import described, expect, number
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws.normal.bolts import Bolt
from hemivar.mechanics.conditions import Condition, Support, Traction, VectorData, stated_values
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.initial_stress import InitialField, OneField

__all__ = [
    "Step",
    "after_step",
    "between_bolts",
    "between_conditions",
    "between_fields",
    "between_values",
    "bolted",
    "kept_step",
]


#: What a step states as a whole, not by boundary.
_WHOLE = ("body_force", "initial_stress", "initial_strain")
#: What it states by boundary.
_NAMED = ("supports", "tractions", "bolts")


@dataclass(frozen=True, eq=False)
class Step(PickleMixin):
    """One of the load steps of a body: what changes in it; what it does not name stays as it was before.

    Attributes
    ----------
    name : str
        For tables and messages.
    supports : mapping of boundary name to Support
        New values of supports that the problem has; each prescribes what it did before.
    tractions : mapping of boundary name to vector, callable or Pressure
        0 takes a load away.
    body_force, initial_stress, initial_strain
        As those of the problem; None: as before.
    bolts : mapping of boundary name to float
        Tension, a force, of contacts with the law :class:`hemivar.laws.Bolt` that are tightened in this step; they are
        held from its end on.
    ramp : bool
        Whether what changes grows evenly within the step, where it is taken in increments; else it is there at once.

    Examples
    --------
    >>> import hemivar as hv
    >>> clamp = hv.mechanics.Step("clamp", tractions={"top": hv.Pressure(1.0)})
    >>> steps = [clamp, hv.mechanics.Step("pull", body_force=(0.2, 0.0))]
    """

    name: str
    supports: Mapping[str, Support] = field(default_factory=dict)
    tractions: Mapping[str, Traction] = field(default_factory=dict)
    body_force: VectorData | float | None = None
    initial_stress: InitialField | None = None
    initial_strain: InitialField | None = None
    bolts: Mapping[str, float] = field(default_factory=dict)
    ramp: bool = True

    def __post_init__(self) -> None:
        if not expect(self.name, str, "the name of a step", "give a text").strip():
            raise ProblemError("a step has no name; give it one, Step('clamp', ...)")
        expect(self.ramp, bool, f"step '{self.name}': ramp", "give True or False")
        for name in _NAMED:
            given = getattr(self, name)
            if not isinstance(given, Mapping):
                raise ProblemError(
                    f"step '{self.name}': {name} must map boundary names to conditions; it is {described(given)}"
                )
            object.__setattr__(self, name, MappingProxyType(dict(given)))
        forces = {name: number(one, f"step '{self.name}': bolts['{name}']") for name, one in self.bolts.items()}
        object.__setattr__(self, "bolts", MappingProxyType(forces))

    def __repr__(self) -> str:
        changed = [one.name for one in fields(self)[1:-1] if self.changes(one.name)]
        return f"Step({self.name!r}: {', '.join(changed) or 'nothing'} changed)"

    def changes(self, what: str) -> bool:
        """Whether it says something of a field."""
        value = getattr(self, what)
        return bool(value) if isinstance(value, Mapping) and what in _NAMED else value is not None


def after_step(before: Mapping[str, object], step: Step) -> dict[str, object]:
    """The fields that a step changes, of what there was before it, by name."""
    after: dict[str, object] = {}
    for name in _WHOLE:
        if step.changes(name):
            after[name] = getattr(step, name)
    for name in ("supports", "tractions"):
        if step.changes(name):
            after[name] = {**cast(Mapping[str, object], before[name]), **getattr(step, name)}
    return after


def bolted(contact: Mapping[str, Contact], step: Step, areas: Callable[[str], float]) -> dict[str, Contact]:
    """Contacts after a step: bolts that it tightens have their tension, those that were tightened before are held.

    ``areas`` tells the area of a boundary.
    """
    for name in step.bolts:
        if name not in contact or not isinstance(contact[name].normal, Bolt):
            raise ProblemError(f"it tightens a bolt at '{name}', where there is none; state Contact(Bolt(), ...) there")
    after = dict(contact)
    for name, one in contact.items():
        if name in step.bolts:
            after[name] = replace(
                one, normal=Bolt(step.bolts[name] / (areas(name) or 1.0))
            )  # a part of the mesh may have none
        elif isinstance(one.normal, Bolt) and _acts(one.normal.tension):
            after[name] = replace(one, normal=replace(one.normal, held=1.0))
    return after


def between_bolts(before: Mapping[str, Contact], after: Mapping[str, Contact], share: float) -> dict[str, Contact]:
    """Contacts a share of the way through a step: the tension of bolts that are tightened grows to what it will be."""
    between = dict(after)
    for name, one in after.items():
        bolt, old = one.normal, before[name].normal
        if bolt is not old and isinstance(bolt, Bolt) and isinstance(old, Bolt) and not _acts(bolt.held):
            tension = between_values(0.0 if _acts(old.held) else old.tension, bolt.tension, share)
            between[name] = replace(one, normal=Bolt(cast(float, tension)))
    return between


def _acts(value: object) -> bool:
    return callable(value) or bool(np.any(np.asarray(value)))


def kept_step(step: Step, after: Mapping[str, object]) -> Step:
    """A step with its values as the problem after it keeps them."""
    kept: dict[str, object] = {name: after[name] for name in _WHOLE if step.changes(name)}
    for name in ("supports", "tractions"):
        kept[name] = {key: cast(Mapping[str, object], after[name])[key] for key in getattr(step, name)}
    return replace(step, **kept)  # type: ignore[arg-type]


def between_conditions(
    before: Mapping[str, Condition], after: Mapping[str, Condition], share: float, what: str, moved: Collection[str]
) -> dict[str, Condition]:
    """Supports or loads by boundary a share of the way from one to the other; what was not there grows from zero.

    Supports that a step moves are functions in all of them, so that what they hold may move where it rests.
    """
    moves = moved if what == "supports" else ()
    return {
        name: _between(before.get(name), one, share, f"{what}['{name}']", name in moves) for name, one in after.items()
    }


def _between(before: Condition | None, after: Condition, share: float, what: str, moves: bool) -> Condition:
    values = stated_values(after)  # type: ignore[arg-type]
    old = dict.fromkeys(values, 0.0) if before is None else stated_values(before)  # type: ignore[arg-type]
    if before is not None and old.keys() != values.keys():
        if "" in values and not any(map(_acts, old.values())):  # there was none
            old = dict.fromkeys(values, 0.0)
        else:
            raise ProblemError(
                f"{what} prescribes something else than before; name the same components, or the same kind of load"
            )
    between = _Between if moves else between_values
    changed = {key: between(old[key], value, share) for key, value in values.items()}
    if "" in changed:
        return cast(Condition, changed[""])
    return replace(after, **changed) if changed else after  # type: ignore[type-var, arg-type]


def between_values(before: object, after: object, share: float) -> object:
    """A quantity a share of the way from one to another."""
    if before is after or share == 1.0:
        return after
    if callable(before) or callable(after):
        return _Between(before, after, share)
    value = (1.0 - share) * np.asarray(before, dtype=float) + share * np.asarray(after, dtype=float)
    return value if value.ndim else float(value)


def between_fields(before: InitialField, after: InitialField, share: float, what: str) -> InitialField:
    """An initial stress or strain a share of the way from one to another."""
    if before is after or share == 1.0:
        return after
    if isinstance(before, Mapping) or isinstance(after, Mapping):
        one, two = _by_region(before, what), _by_region(after, what)
        regions = dict.fromkeys([*one, *two])
        parts = {name: between_fields(one.get(name, 0.0), two.get(name, 0.0), share, what) for name in regions}
        return MappingProxyType(cast(dict[str, OneField], parts))
    alike = np.shape(cast(Array, before)) == np.shape(cast(Array, after)) and callable(before) == callable(after)
    if not (alike or _is_nothing(before) or _is_nothing(after)):
        raise ProblemError(f"{what} has another form than before; give both as numbers, or tensors, or ramp=False")
    return cast(InitialField, between_values(before, after, share))


def _by_region(value: InitialField, what: str) -> Mapping[str, OneField]:
    if isinstance(value, Mapping):
        return value
    if not _is_nothing(value):
        raise ProblemError(f"{what} is stated by region in one of two steps only; state it so in both, or ramp=False")
    return {}


def _is_nothing(value: object) -> bool:
    return isinstance(value, float) and value == 0.0


@dataclass(frozen=True, eq=False)
class _Between(PickleMixin):
    """A quantity a share of the way from one to another: a function of points (k, d)."""

    before: object
    after: object
    share: float

    def __call__(self, points: Array) -> Array:
        one, two = (
            np.asarray(value(points) if callable(value) else value, dtype=float) for value in (self.before, self.after)
        )
        return np.asarray((1.0 - self.share) * one + self.share * two)
