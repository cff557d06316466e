"""What is refused, and with which sentence; every other combination that can be stated works."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache, reduce
from operator import and_

from tests.composition.cases import BESIDE, BODIES, COUPLED, FORMS, FRICTIONS, NORMALS, SCALAR, TIMED, Row
from tests.composition.tasks import IN_TIME, TASKS

__all__ = ["FACTORS", "RULES", "Rule", "matching", "statable", "works"]

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
_PLANE = tuple(body for body in BODIES if body not in ("space", "quadratic tetrahedra", *SCALAR))
_PAIRS = ("pair", "glued inside")
_ON_FOUNDATIONS = tuple(body for body in BODIES if body not in _PAIRS)
_OF_STATEMENTS = (*_MARCHES, "study", "jobs", "adaptive", "file")
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


_NO_PATH = (
    "Where a law drops discontinuously a load path needs a linear plane body, with separate opening and slip and a "
    "bound "
    "that does not depend on the solution."
)
_NO_BOUND = (
    "The distance to the exact solution is bounded for elastic bodies held on boundaries, without bedding, springs, "
    "plates, ties and initial stress, and for one component on supports; adaptive solves are for bodies."
)
_NO_BOUND_REVOLVED = "Bodies of revolution have no bound of the distance to the exact solution and no adaptive solve."
_NO_BOUND_QUADRATIC = "In space the distance to the exact solution is bounded for linear elements only."
_NO_BOUND_RESTING = (
    "The distance to the exact solution is bounded for bodies held by contact only where laws are convex, with "
    "separate opening and slip, and do not depend on the solution."
)
_NO_BOUND_FALLS = "The distance to the exact solution of a membrane is bounded where no law drops discontinuously."
_NO_BOUND_DROPS = (
    "Beside orthotropic friction the distance to the exact solution is bounded where no law drops discontinuously."
)
_NOT_CONVEX = ("softening", "adhesive", "cohesion", "saw-tooth", "function", *COUPLED)
_NO_BOUND_OF_LAW = (
    "The distance to the exact solution is not bounded for Coulomb's law; and for glue that depends on the mode "
    "there is an "
    "estimate only where its tractions change little with the mode."
)
_STRESSED = (
    "Stress stiffening is for single loads at rest: no time, no path, no search for all solutions, and no bound of the "
    "distance to the exact solution."
)
_NOT_IN_TIME = "Time integration needs laws without discontinuous drops."
_BESIDE_COUPLED = (
    "Beside a law of opening and slip together stands the memory of glue alone, no damping and no other one."
)
_BOND = "A bond with plastic slip already resists slip: no friction, and no other law of the slip."
_RUBBING = "Friction on the damaged share is that of glue whose damage is known, and no other."
_UNDAMAGED = tuple(normal for normal in NORMALS if normal not in ("adhesive", *COUPLED))
_SCALAR_LAW = "A scalar body has one component: no pressure beside the slip, and no direction of it."
_ARRAYS = "A problem made of arrays has no continuous problem and, by default, no mesh."
_FORMS = (
    "Bodies by forms have no bounds of the distance to the exact solution, no problem file, no refinement of their own "
    "and, with a pressure, no time and no pictures."
)

RULES = (
    Rule("drops discontinuously", _NO_PATH, ("path",), ("space", "quadratic tetrahedra", "nonlinear"), ("saw-tooth",)),
    Rule("drops discontinuously", _NO_PATH, ("path",), normal=("saw-tooth",), friction=("coulomb", "bound")),
    Rule("bodies without bedding", _NO_BOUND, _BOUNDS, ("bedded",)),
    Rule("bodies held on boundaries", _NO_BOUND, _BOUNDS, ("sprung",)),
    Rule("bodies without ties", _NO_BOUND, _BOUNDS, ("tied",)),
    Rule("bodies held on boundaries", _NO_BOUND, _BOUNDS, ("plated",)),
    Rule("bodies without initial stress", _NO_BOUND, _BOUNDS, ("stressed",)),
    Rule("use order = 1", _NO_BOUND_QUADRATIC, _BOUNDS, ("quadratic tetrahedra",)),
    Rule(
        "not available with stress stiffening",
        _STRESSED,
        (*_BOUNDS, *_MARCHES, "all solutions", "path", "sweep"),
        ("stiffened",),
    ),
    Rule("not available with stress stiffening", _STRESSED, ("pickle", "file"), ("stiffened",), beside=TIMED),
    Rule("bounded for plane and 3D bodies", _NO_BOUND_REVOLVED, _BOUNDS, ("axisymmetric",)),
    Rule("there is no bound", _NO_BOUND_RESTING, _BOUNDS, ("resting",), _NOT_CONVEX),
    Rule("there is no bound", _NO_BOUND_RESTING, _BOUNDS, ("resting",), friction=("bound",)),
    Rule("there is no bound", _NO_BOUND_RESTING, _BOUNDS, ("cracked",)),
    Rule(
        "the foundation softens too much for the bodies",
        "For bodies that touch each other the distance to the exact solution is known where no law drops "
        "discontinuously.",
        _BOUNDS,
        _PAIRS,
        ("saw-tooth",),
    ),
    Rule("drops discontinuously", _NO_BOUND_FALLS, ("exact",), ("membrane",), ("saw-tooth",)),
    Rule(
        "drops discontinuously, so c is infinite",
        _NO_BOUND_DROPS,
        _BOUNDS,
        ("space",),
        ("saw-tooth",),
        ("orthotropic",),
    ),
    Rule("is a ScalarProblem; give a ContactProblem", _NO_BOUND, ("adaptive",), SCALAR),
    Rule("there is no bound", _NO_BOUND_OF_LAW, _BOUNDS, _ON_FOUNDATIONS, friction=("coulomb",)),
    Rule("depend on the mode adds", _NO_BOUND_OF_LAW, _BOUNDS, _ON_FOUNDATIONS, normal=("mode-dependent",)),
    Rule("was made of arrays", _ARRAYS, ("exact", "output"), ("arrays",)),
    Rule("was made of arrays", _FORMS, ("exact",), FORMS),
    Rule("was made of arrays", _FORMS, ("output",), ("mixed",)),
    Rule("give a ContactProblem", _FORMS, ("study", "sweep", "jobs", "adaptive", "file"), FORMS),
    Rule("needs its displacement at nodes", _FORMS, IN_TIME, ("mixed",), beside=TIMED),
    Rule("needs its displacement at nodes", _FORMS, ("march", "resume"), ("mixed",)),
    Rule("has no mass", _FORMS, ("mass",), ("mixed",)),
    Rule("is a DiscreteProblem; give a ContactProblem", _ARRAYS, _OF_STATEMENTS, ("arrays",)),
    Rule("a contact law drops discontinuously", _NOT_IN_TIME, _MARCHES, normal=("saw-tooth",)),
    Rule("a contact law drops discontinuously", _NOT_IN_TIME, normal=("saw-tooth",), beside=TIMED),
    Rule("is unstable in series", _NOT_IN_TIME, normal=("saw-tooth",), beside=("wear", "creep")),
    Rule(
        "which a problem file cannot express",
        "A problem file gives laws by name, table or formula; this one has no name there.",
        ("file",),
        normal=("cohesion", "function", "coupled-function"),
    ),
    Rule(
        "which means something in time only",
        "Memory and damping need a problem in time.",
        _AT_REST,
        beside=TIMED,
    ),
    Rule("leave the friction out", _BOND, friction=_RUBS, beside=("bond",)),
    Rule("no damage on which friction could act", _RUBBING, normal=_UNDAMAGED, beside=("rubbing",)),
    Rule("leave one of the two out", _RUBBING, friction=_RUBS, beside=("rubbing",)),
    Rule("needs a normal law with friction beside it", _BOND, normal=COUPLED, beside=("bond",)),
    Rule("friction on the damaged share of", _RUBBING, normal=("mode-dependent",), beside=("rubbing",)),
    Rule("has no effective opening", _RUBBING, normal=COUPLED[2:], beside=("rubbing",)),
    Rule("beyond what its law allows", "A march begins where the law allows.", _MARCHES, ("membrane",), ("bilateral",)),
    Rule("the body is free to move", "The body is unconstrained.", (), ("resting",), ("none",)),
    Rule(
        "needs a surface, and the mesh is plane",
        "Orthotropic friction has two directions on a surface: it needs a 3D body.",
        (),
        _PLANE,
        friction=("orthotropic",),
    ),
    Rule("friction", "A law of opening and slip together resists slip itself.", (), normal=COUPLED, friction=_RUBS),
    Rule(
        "needs a normal law with friction beside it",
        _BESIDE_COUPLED,
        (),
        normal=COUPLED,
        beside=("wear", "creep", "penetration", "slip sum"),
    ),
    Rule("damping of the normal rate is not known beside it", _BESIDE_COUPLED, (), normal=COUPLED, beside=("damping",)),
    Rule("has no effective opening", _BESIDE_COUPLED, (), normal=COUPLED[2:], beside=("secant",)),
    Rule("the law of a scalar contact is", _SCALAR_LAW, (), ("membrane",), COUPLED),
    Rule("which a scalar problem does not have", _SCALAR_LAW, (), ("antiplane",), friction=("coulomb", "bound")),
    Rule("and a scalar problem none", _SCALAR_LAW, (), ("antiplane",), friction=("orthotropic",)),
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


def works(levels: Mapping[str, str]) -> bool:
    """Whether some levels can stand together and no rule refuses them."""
    return not reduce(and_, [_bits(name, levels.get(name)) for name in FACTORS])


@cache
def _bits(factor: str, level: str | None) -> int:
    """Which rules apply to a level of one factor, a bit for each: many rows are asked."""
    named = [getattr(rule, factor) for rule in (*_ABSENT, *RULES)]
    return sum(1 << k for k, levels in enumerate(named) if not levels or level in levels)
