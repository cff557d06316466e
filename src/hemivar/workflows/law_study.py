"""One law: its constants, for parameters that are given or that show what it does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, cast

from hemivar.basics.arguments import expecting, quoted, suggest
from hemivar.basics.display import brief
from hemivar.basics.stated import Form, Stated
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.laws import Friction, MixedMode, ModeDependentGlue, OwnCoupledLaw, Superpotential
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, MEMORIES, NORMAL_LAWS, LawEntry, LawKind, entry_named
from hemivar.workflows.events import Notice, Work

__all__ = ["LawStudy", "Value", "study_law", "values_shown"]

#: A parameter: a number, several, or the text of one or of a file's name.
Value: TypeAlias = str | float | Sequence[float]


@dataclass(frozen=True, eq=False)
class LawStudy(Notice):
    """A law and its superpotential.

    Attributes
    ----------
    entry : LawEntry
        Its line in the registry.
    curve : Superpotential, MixedMode, ModeDependentGlue, OwnCoupledLaw or None
        The function j of one contact point, for friction of the size of the slip; None of a memory, and if the law
        is a file that was not given.  ``curve.describe()`` has the constants, and says which of them are sampled.
    examples : mapping of name to value
        Parameters that were not given, with the values that show what the law does.
    unit_bound : bool
        Whether the friction bound depends on the state of the contact point, so that the curve is for a bound of 1.
    """

    entry: LawEntry
    curve: Superpotential | MixedMode | ModeDependentGlue | OwnCoupledLaw | None
    examples: Mapping[str, Value] = field(default_factory=dict)
    unit_bound: bool = False

    __repr__ = brief


@expecting(name=str, parameters=Mapping, friction=bool, first=bool, label=str)
def study_law(
    name: str,
    parameters: Mapping[str, Value] | None = None,
    *,
    friction: bool = False,
    first: bool = False,
    label: str = "parameter ",
    code: Sequence[str] = (),
) -> Work[tuple[LawStudy, ...]]:
    """The laws of a name, the normal law before the friction law; each is yielded as an event too.

    Parameters
    ----------
    name : str
        A name of the registry; "table" and "formula" make laws of a file and of a text.
    parameters : mapping of name to value
        Examples stand for those that are left out.
    friction : bool
        The friction law of this name only.
    first : bool
        The first law of this name only, as parameters are of one law.
    label : str
        What stands before the name of a parameter in messages.
    code : sequence of str
        Modules and files of which a scalar law may be named, as for :func:`hemivar.read_problem`.

    Yields
    ------
    Event
        What happens; the generator returns a tuple of LawStudy.

    Raises
    ------
    ProblemError
        No such law or parameter, or a value that the law does not take.
    """
    parameters = {} if parameters is None else parameters
    entries = [laws[name] for laws in (NORMAL_LAWS, COUPLED_LAWS, FRICTION_LAWS, MEMORIES) if name in laws]
    if not entries:
        of = LawKind.FRICTION if friction else LawKind.NORMAL
        own = entry_named(name, of, (Superpotential,), code)
        entries = [] if own is None else [own]
    if not entries:
        known = list(dict.fromkeys([*NORMAL_LAWS, *COUPLED_LAWS, *FRICTION_LAWS, *MEMORIES]))
        raise ProblemError(f"law {quoted(name)} is not known{suggest(name, known)}")
    if friction:
        entries = [entry for entry in entries if entry.kind is LawKind.FRICTION]
        if not entries:
            what = "memory" if name in MEMORIES else "normal law"
            raise ProblemError(f"'{name}' is a {what}; there is no friction law of this name")
    elif first or parameters:
        entries = entries[:1]
    studies = []
    for entry in entries:
        studies.append(_study(entry, parameters, label))
        yield studies[-1]
    return tuple(studies)


def _study(entry: LawEntry, given: Mapping[str, Value], label: str) -> LawStudy:
    """The law with the values given and example values for the others."""
    values, examples = values_shown(entry, given, label)
    missing = any(p.stated.form is Form.FILE and p.key not in values for p in entry.parameters)
    if missing or entry.kind is LawKind.MEMORY:
        return LawStudy(entry, None)
    law = cast(Superpotential | Friction | MixedMode | ModeDependentGlue | OwnCoupledLaw, entry.make(**values)).at(None)
    if not isinstance(law, Friction):
        return LawStudy(entry, law, examples)
    curve = law.profile if law.state_dependent else law.radial
    return LawStudy(entry, curve, examples, law.state_dependent)


def values_shown(entry: LawEntry, given: Mapping[str, Value], label: str) -> tuple[dict[str, Value], dict[str, Value]]:
    """The parameters with which a law or a material is shown, and which of them are examples."""
    known = {p.key: p for p in entry.parameters}
    for key in given:
        if key not in known:
            raise ProblemError(
                f"{entry.noun} '{entry.name}' has no parameter '{key}' (parameters: {', '.join(known) or 'none'})"
            )
    values: dict[str, Value] = {}
    examples: dict[str, Value] = {}
    replaced = {known[key].stated.instead for key in given}
    for p in entry.parameters:
        if p.key in replaced:
            continue
        if p.key in given:
            values[p.key] = _value(p.stated, given[p.key], f"{label}{p.key}")
        elif p.stated.form is not Form.FILE and p.shown is not None:
            values[p.key] = cast(Value, p.shown)
            if p.default is None:
                examples[p.key] = values[p.key]
    return values, examples


def _value(stated: Stated, given: Value, where: str) -> Value:
    if not isinstance(given, str):
        return given
    if stated.form in (Form.FILE, Form.TEXT):
        if stated.choices and given not in stated.choices:
            raise ProblemError(f"{where}={given}: write one of {', '.join(stated.choices)}")
        return given
    parts = given.strip("[]").split(",") if stated.form is Form.LIST else [given]
    numbers = []
    for part in parts:
        formula = Formula(part, where)
        if formula.variables:
            raise ProblemError(f"{where}={given}: give a number here; a formula of x belongs in a problem file")
        numbers.append(float(formula([[0.0, 0.0]])[0]))  # type: ignore[arg-type]
    return numbers if stated.form is Form.LIST else numbers[0]
