"""The laws by name: what problem files, the list of laws and whoever adds a law find in the packages of laws.

Laws say of themselves what stands here; see :func:`hemivar.laws.named.named`.  Beside the library's own names stand
classes of the user's, see :mod:`hemivar.basics.user_code`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from inspect import Parameter as Taken
from inspect import Signature, cleandoc, isabstract, signature
from typing import cast

from hemivar.basics.arguments import shortened
from hemivar.basics.stated import Form, Stated, stated
from hemivar.basics.user_code import class_named, installed, name_of_class, of_user
from hemivar.errors import HemivarError, ProblemError
from hemivar.laws import coupled, friction, memory, normal, own
from hemivar.laws.friction import Friction
from hemivar.laws.named import LawEntry, LawKind, named_in
from hemivar.laws.parameters import FRICTION
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "COUPLED_LAWS", "FRICTION_LAWS", "MEMORIES", "NORMAL_LAWS", "LawEntry", "LawKind", "entry_named", "entry_of",
    "friction_law", "installed_laws", "normal_law",
]  # fmt: skip

#: Normal laws by name.
NORMAL_LAWS = named_in(LawKind.NORMAL, normal, own)
#: Laws that couple opening and slip by name; they stand where a normal law does, and for friction, too.
COUPLED_LAWS = named_in(LawKind.NORMAL, coupled)
#: Friction laws by name.
FRICTION_LAWS = named_in(LawKind.FRICTION, friction)
#: What contact points remember in time, by name.
MEMORIES = named_in(LawKind.MEMORY, memory)


def normal_law(name: str, **values: object) -> Superpotential:
    """The normal law of this name, such as ``normal_law("survey", q_max=0.3, p_const=2.0)``."""
    return cast(Superpotential, _known(NORMAL_LAWS, name).make(**values))


def friction_law(name: str, **values: object) -> Friction:
    """The friction law of this name, such as ``friction_law("tresca", bound=0.5)``."""
    return cast(Friction, _known(FRICTION_LAWS, name).make(**values))


def _known(laws: Mapping[str, LawEntry], name: str) -> LawEntry:
    if name not in laws:
        raise ProblemError(f"law '{name}' is not known; the laws are {', '.join(laws)}")
    return laws[name]


# ---- classes of the user's ----------------------------------------------------------------------------------

#: What a field is that says nothing of itself.
_NUMBER = stated(Form.NUMBER, "a number")


def entry_named(name: str, kind: LawKind, bases: tuple[type, ...], code: Sequence[str] = ()) -> LawEntry | None:
    """The law of the user's that a file names, which must be a class with one of these bases; None if it names none.

    ``code`` are the modules and files that the user allows; see :func:`hemivar.basics.user_code.class_named`.
    """
    found = class_named(name, code)
    if found is None:
        return None
    if not set(bases) & set(found.__mro__):
        wanted = " or ".join(base.__name__ for base in bases)
        raise ProblemError(f"'{name}' is not a class of a {kind} law; give one derived from {wanted}")
    if isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))  # type: ignore[attr-defined]
        raise ProblemError(f"'{name}' is abstract and cannot be made; supply {missing}, or name a class that does")
    return _entry(found, kind, name)


def installed_laws(bases: Mapping[LawKind, tuple[type, ...]]) -> Iterator[tuple[str, LawEntry | str]]:
    """The classes of installed packages with one of these bases: package, and the law or why there is none."""
    for name, package in installed().items():
        if name in NORMAL_LAWS or name in COUPLED_LAWS or name in FRICTION_LAWS or name in MEMORIES:
            continue  # the library's own names come first
        try:
            found = class_named(name, ())
            assert found is not None
            says = vars(found).get("__entry__")
            kinds = [kind for kind in bases if set(bases[kind]) & set(found.__mro__)] if says is None else [says.kind]
            for kind in kinds[:1]:
                entry = entry_named(name, kind, bases[kind]) if kind in bases else None
                if entry is not None:
                    yield package, entry
        except ProblemError as error:
            yield package, f"{name}: {error}"


def entry_of(kind: type, of: LawKind) -> LawEntry | None:
    """The entry of a class of the user's, under the name that files give it; None if they have no name for it."""
    name = name_of_class(kind) if of_user(kind) else None
    return None if name is None else _entry(kind, of, name)


@cache
def _entry(kind: type, of: LawKind, name: str) -> LawEntry:
    own = vars(kind).get("__entry__")  # what it says of itself, see named
    summary = own.summary if own is not None else cleandoc(kind.__doc__ or "").partition("\n")[0]
    profile = of is LawKind.FRICTION and issubclass(kind, Superpotential)
    return LawEntry(of, name, _maker(kind, name, profile), summary, "" if own is None else own.formula)


def _maker(kind: type, name: str, profile: bool) -> Callable[..., object]:
    """What makes a law of a class of the user's; of a profile it makes the friction, with the bound.

    Fields without metadata are numbers, but for those of the library's classes from which it is derived.
    """
    inherited = {one.name for base in kind.__mro__ if is_dataclass(base) and not of_user(base) for one in fields(base)}
    says: dict[str, Mapping[str, Stated]] = {}
    if is_dataclass(kind):
        says = {one.name: one.metadata for one in fields(kind) if "stated" in one.metadata}
    if issubclass(kind, Friction):
        says |= FRICTION
    several = (Taken.VAR_POSITIONAL, Taken.VAR_KEYWORD)
    given = [one for one in signature(kind).parameters.values() if one.kind not in several]
    said = {one.name: says.get(one.name, {} if one.name in inherited else _NUMBER) for one in given}
    taken = [one.replace(kind=Taken.KEYWORD_ONLY) for one in given]
    if profile:
        twice = [key for key in FRICTION if key in said]
        if twice:
            raise ProblemError(f"law '{name}': its parameter '{twice[0]}' is one that every friction has; rename it")
        beside = [Taken("bound", Taken.KEYWORD_ONLY, default=1.0), Taken("of", Taken.KEYWORD_ONLY, default=None)]
        said |= FRICTION
        taken += beside

    def make(**values: object) -> object:
        own = {key: value for key, value in values.items() if not profile or key not in FRICTION}
        try:
            made = kind(**own)
        except HemivarError:
            raise
        except Exception as error:
            why = f"{type(error).__name__}: {shortened(error)}"
            raise ProblemError(f"'{name}' cannot be made of its values ({why}); correct them, or the class") from error
        if not profile:
            return made
        assert isinstance(made, Superpotential)
        return Friction(values.get("bound", 1.0), made, of=values.get("of"))  # type: ignore[arg-type]

    make.__stated__, make.__signature__ = said, Signature(taken)  # type: ignore[attr-defined]
    return make
