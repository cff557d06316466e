"""A problem file that a command works on, and the files that it writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hemivar.basics.disk import noting_files_read
from hemivar.cli.options import check_limits, controls_of, method_named
from hemivar.cli.outputs import Writer, check_outputs, files_of, keep_off
from hemivar.errors import HemivarError, ProblemError, SupportError

if TYPE_CHECKING:
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.mesh.mesh import Mesh
    from hemivar.solvers import Controls, Solver

__all__ = ["Session", "naming_file"]


class Session:
    """A command at work on a problem file: outputs and limits are checked before anything is read.

    Parameters
    ----------
    path : Path
        The problem file.
    outputs : mapping of option to Path or None
        What will be written; what falls on a file that is read is refused.
    rtol, max_time, max_steps : optional
        Limits of the command line, which go before those of the file.
    solution : Path, optional
        Another file that is read.
    given : sequence of str, optional
        ``key=value`` of ``--set``.

    Attributes
    ----------
    stated : ProblemFile
    writer : Writer
    controls : Controls
        Limits, and no callback.

    Raises
    ------
    ProblemError
    """

    def __init__(
        self,
        path: Path,
        outputs: Mapping[str, Path | None],
        rtol: float | None = None,
        max_time: float | None = None,
        max_steps: int | None = None,
        solution: Path | None = None,
        given: Sequence[str] | None = None,
    ) -> None:
        from hemivar.files.changes import read_change
        from hemivar.files.problem_file import read_problem_file

        check_outputs(outputs, path)
        check_limits(rtol, max_time, max_steps)
        changes = [read_change(text) for text in given or ()]
        with noting_files_read() as files:
            self.stated = read_problem_file(path, changes)
        files += [] if solution is None else [solution]
        keep_off(files_of(outputs), files)
        self.outputs = outputs
        self.writer = Writer(files, self.stated.units.record())
        self._limits = rtol, max_time, max_steps

    @property
    def controls(self) -> Controls:
        """Limits from the command line, else from the file, else the defaults."""
        return controls_of(self.stated, *self._limits)

    @property
    def method(self) -> Solver | None:
        """The method of the file."""
        name = self.stated.solver.method
        return None if name is None else method_named(name)

    @property
    def title(self) -> str | None:
        """The title for figures, in which a dollar begins a formula."""
        return self.stated.problem.title.replace("$", r"\$") or None

    def discrete(self, mesh: Mesh | None = None, load_factor: float | None = None) -> DiscreteProblem:
        """The discrete problem, on another mesh and at a load factor if they are given; errors name the file."""
        from hemivar.fem import LoadLine, discretize

        problem = self.stated.problem if mesh is None else self.stated.problem.on(mesh)
        try:
            return discretize(problem) if load_factor is None else LoadLine.of(problem).at(load_factor)
        except ProblemError as error:
            raise naming_file(error, self.stated.name) from error


def naming_file(error: HemivarError, name: str, table: str = "") -> HemivarError:
    """The error with the file, and a table of it, named before what it says, unless it names the file itself."""
    if str(error).startswith(f"{name}: "):
        return error
    return type(error)(f"{name}: {'[supports] ' if isinstance(error, SupportError) else table}{error}")
