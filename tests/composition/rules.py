"""What is refused, and with which sentence; every other combination that can be stated works."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

from tests.composition.cases import BESIDE, BODIES, COUPLED, FRICTIONS, NORMALS, SCALAR, TIMED, Row
from tests.composition.tasks import IN_TIME, TASKS

__all__ = ["FACTORS", "RULES", "Rule", "matching", "statable"]

FACTORS: Mapping[str, tuple[str, ...]] = {
    "task": tuple(TASKS),
    "body": tuple(BODIES),
    "normal": tuple(NORMALS),
    "friction": tuple(FRICTIONS),
    "beside": tuple(BESIDE),
}
assert tuple(FACTORS) == tuple(one.name for one in fields(Row))

_AT_REST = tuple(task for task in TASKS if task not in IN_TIME)
_MARCHES = ("march", "mass", "resume")
_BOUNDS = ("exact", "adaptive")
_PLANE = tuple(body for body in BODIES if body not in ("space", *SCALAR))
_RUBS = tuple(friction for friction in FRICTIONS if friction != "none")


@dataclass(frozen=True)
class Rule:
    """Combinations of levels that are refused.

    Attributes
    ----------
    said : str
        Part of the sentence.
    why : str
        What the table of the docs says of it.
    task, body, normal, friction, beside : sequences of str
        The levels to which it applies; all, where there are none.
    """

    said: str
    why: str
    task: Sequence[str] = ()
    body: Sequence[str] = ()
    normal: Sequence[str] = ()
    friction: Sequence[str] = ()
    beside: Sequence[str] = ()

    def of(self, levels: Mapping[str, str]) -> bool:
        """Whether it refuses levels of some factors, whatever the others are."""
        return all(not getattr(self, name) or levels.get(name) in getattr(self, name) for name in FACTORS)


RULES = (
    Rule("follow_path needs a linear body", "nonlinear bodies have no load path", ("path",), ("nonlinear",)),
    Rule("a curve only in one and two dimensions", "no load path in space", ("path",), ("space",)),
    Rule("couples opening and slip, and a load path", "no load path", ("path",), normal=COUPLED),
    Rule(
        "needs a friction bound that does not depend on the solution",
        "no load path where the bound depends on the solution",
        ("path",),
        friction=("coulomb", "bound"),
    ),
    Rule("does not depend on the solution", "no load path", ("path",), normal=("mode-dependent",)),
    Rule("bodies without bedding", "no bound of the distance to the exact solution", _BOUNDS, ("bedded",)),
    Rule("constants of the body are from the discrete problem", "no bound without supports", _BOUNDS, ("resting",)),
    Rule("and this is a scalar problem", "no bound", ("exact",), SCALAR),
    Rule("is a ScalarProblem; give a ContactProblem", "no bound", ("adaptive",), SCALAR),
    Rule("was made of arrays", "no mesh", ("exact", "output"), ("arrays",)),
    Rule("is a DiscreteProblem; give a ContactProblem", "no statement", ("march", "mass", "resume"), ("arrays",)),
    Rule("is a DiscreteProblem; give a ContactProblem", "no statement", ("study", "jobs", "adaptive"), ("arrays",)),
    Rule("is a DiscreteProblem; give a ContactProblem", "no statement", ("file",), ("arrays",)),
    Rule("a bound of the distance to the exact solution is only known", "no bound", _BOUNDS, normal=COUPLED),
    Rule("there is no bound", "no bound of Coulomb's law", _BOUNDS, friction=("coulomb",)),
    Rule("depends on the direction of the slip", "no bound", _BOUNDS, friction=("orthotropic",)),
    Rule("couples opening and slip", "not in time", _MARCHES, normal=COUPLED),
    Rule("a contact law drops discontinuously", "not in time", _MARCHES, normal=("saw-tooth",)),
    Rule("a contact law drops discontinuously", "not in time", normal=("saw-tooth",), beside=TIMED),
    Rule("depends on the direction of the slip", "not in time", _MARCHES, friction=("orthotropic",)),
    Rule("depends on the direction of the slip", "not in time", friction=("orthotropic",), beside=TIMED),
    Rule("the body is free to move", "nothing holds it", (), ("resting",), ("none",)),
    Rule(
        "which a problem file cannot say",
        "a problem file has no name for it",
        ("file",),
        normal=("cohesion", "function", "coupled-function"),
    ),
    Rule("which means something in time only", "in time only", _AT_REST, beside=TIMED),
    Rule("needs a surface, and the mesh is plane", "in space only", (), _PLANE, friction=("orthotropic",)),
    Rule("friction", "it has its own resistance to slip", (), normal=COUPLED, friction=_RUBS),
    Rule("memory", "a coupled law remembers nothing", (), normal=COUPLED, beside=TIMED),
    Rule("the law of a scalar contact is", "a scalar body has one component", (), ("membrane",), COUPLED),
    Rule("which a scalar problem does not have", "no pressure", (), ("antiplane",), friction=("coulomb", "bound")),
    Rule("and a scalar problem none", "no direction", (), ("antiplane",), friction=("orthotropic",)),
)


#: What cannot be written down.
_ABSENT = (
    Rule("", "", (), ("membrane",), friction=_RUBS),
    Rule("", "", (), ("antiplane",), tuple(normal for normal in NORMALS if normal != "none")),
    Rule("", "", (), ("antiplane",), friction=("none",)),
    Rule("", "", (), (*SCALAR, "arrays"), beside=TIMED),
)


def matching(levels: Mapping[str, str]) -> list[Rule]:
    """The rules that refuse levels of some factors, whatever the others are."""
    return [rule for rule in RULES if rule.of(levels)]


def statable(levels: Mapping[str, str]) -> bool:
    """Whether some levels can stand together: scalar contact is a law or friction alone, arrays are at rest."""
    return not any(absent.of(levels) for absent in _ABSENT)
