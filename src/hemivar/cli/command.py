"""A command: a class whose fields are its options and whose docstring is its help, run like every other."""

from __future__ import annotations

import gc
import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeVar, dataclass_transform, get_type_hints

from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.engine import Engine
from hemivar.cli.options import WRITTEN, Exit
from hemivar.cli.outputs import Files, Writer, check_outputs
from hemivar.cli.printing import StageView, console
from hemivar.cli.session import Session, print_head

if TYPE_CHECKING:
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.workflows import Work

__all__ = ["Command", "Done", "OnProblem", "function_of", "watched"]

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Done:
    """What a command leaves to do: files to write by option (a figure also by its path), and how it ended."""

    files: Files = field(default_factory=dict)
    reached: bool = True
    interrupted: bool = False
    last: Callable[[], object] = lambda: None  # says what comes after the names of the files; may return the code


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Command:
    """Base of all commands: checks, works, writes what was asked for, says what was written, and ends with a code."""

    #: Whether the names of the files that were written are printed.
    names_files: ClassVar[bool] = True

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False, repr=False)(cls)

    @cached_property
    def backend(self) -> Engine:
        """What it works with."""
        return Engine()

    @property
    def read(self) -> Path | None:
        """A file that is read, beside the problem file where there is one."""
        return None

    def check(self) -> None:
        """Refuse options that make no sense, before anything is read."""

    def begin(self) -> None:
        """Refuse files that could not be written."""
        check_outputs(self.outputs, self.read)

    def work(self) -> Done:
        """Do the work, and print what is found."""
        raise NotImplementedError

    @cached_property
    def outputs(self) -> dict[str, Path | None]:
        """The files to write by option, from the fields of the class."""
        hints = get_type_hints(type(self), include_extras=True)
        named = [name for name, hint in hints.items() if WRITTEN in getattr(hint, "__metadata__", ())]
        return {f"--{name.replace('_', '-')}": getattr(self, name) for name in named}

    @cached_property
    def writer(self) -> Writer:
        """What writes the files, but not over what was read."""
        return Writer([] if self.read is None else [self.read])

    def run(self) -> int:
        """Run it, and return the exit code."""
        with self.backend.working():
            self.backend.agree(self.check)
            self.begin()
            _look_for_garbage()
            done = self.work()
            self.write(done.files)
            code = Exit.CONVERGED if done.reached else Exit.NOT_CONVERGED
            code = Exit.INTERRUPTED if done.interrupted else code
            ended = done.last()
            return self.backend.ended(self.writer.ended(ended if isinstance(ended, Exit) else code))

    def write(self, files: Files) -> None:
        """Write the files that were asked for, and print their names."""
        for key, content in files.items():
            option, path = ("--plot", key) if isinstance(key, Path) else (key, self.outputs.get(key))
            if self.backend.first or option in self.backend.together:
                self.writer.take(option, path, content)
        if self.names_files:
            self.writer.print_names()


class OnProblem(Command):
    """Base of the commands that work on a problem file."""

    problem: opt.ProblemPath
    allow_code: opt.AllowCode = field(default=None, kw_only=True)

    def begin(self) -> None:
        """Read the problem file, once the files could be written."""
        _ = self.session

    @cached_property
    def session(self) -> Session:
        """The problem file, read, with limits and changes of the command line."""
        limits = {name: getattr(self, name, None) for name in ("rtol", "max_time", "max_steps", "given")}
        return Session(
            self.problem, self.outputs, **limits, solution=self.read, engine=self.backend, code=self.allow_code
        )

    @cached_property
    def writer(self) -> Writer:
        """That of the session, which knows what was read."""
        return self.session.writer

    def discrete(self) -> DiscreteProblem:
        """The discrete problem, which is printed."""
        problem = self.session.discrete()
        print_head(self.session, problem)
        return problem


def _look_for_garbage() -> None:
    """From now on, but not among what the modules have made."""
    if not gc.isenabled():
        gc.freeze()
        gc.enable()


def watched(work: Work[Result]) -> Result:
    """The result of long work, whose stages are shown."""
    from hemivar.workflows import result_of

    with StageView(console()) as view:
        return result_of(work, view)


def function_of(kind: type[Command]) -> Callable[..., int]:
    """A command as a function, with a parameter for each field."""
    hints, named = get_type_hints(kind, include_extras=True), inspect.Parameter.KEYWORD_ONLY

    def call(**given: object) -> int:
        return kind(**given).run()

    def parameter(name: str, default: object) -> inspect.Parameter:
        default = inspect.Parameter.empty if default is MISSING else default
        return inspect.Parameter(name, named, default=default, annotation=hints[name])

    options = sorted(fields(kind), key=lambda option: bool(option.kw_only))  # type: ignore[arg-type]
    own = [parameter(option.name, option.default) for option in options]
    call.__doc__, call.__signature__ = kind.__doc__, inspect.Signature(own)  # type: ignore[attr-defined]
    return call
