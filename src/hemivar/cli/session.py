"""A problem file that a command works on, and the files that it writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hemivar.basics.disk import noting_files_read, shown
from hemivar.cli.engine import Engine
from hemivar.cli.options import check_limits, controls_of, method_named
from hemivar.cli.outputs import Writer, check_distinct, check_outputs, files_of, keep_off, one_line
from hemivar.cli.printing import print_changes, print_notes
from hemivar.errors import HemivarError, SupportError

if TYPE_CHECKING:
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.files.changes import Change
    from hemivar.mesh.mesh import Mesh
    from hemivar.solvers import Controls, Solver
    from hemivar.workflows import Study, Sweep

__all__ = ["Session", "naming_file", "print_head"]


class Session:
    """A command at work on a problem file: outputs and limits are checked before anything is read."""

    def __init__(
        self,
        path: Path,
        outputs: Mapping[str, Path | None],
        rtol: float | None = None,
        max_time: float | None = None,
        max_steps: int | None = None,
        solution: Path | None = None,
        given: Sequence[str | Change] | None = None,
        engine: Engine | None = None,
        code: Sequence[str] | None = None,
    ) -> None:
        from hemivar.files.changes import Change, read_change

        self.engine = engine = Engine() if engine is None else engine

        def checked() -> list[Change]:
            check_outputs(outputs, path, engine.pieces)
            check_limits(rtol, max_time, max_steps)
            return [change if isinstance(change, Change) else read_change(change) for change in given or ()]

        changes = engine.agree(checked)
        with noting_files_read() as read:
            self.stated = engine.read(path, changes, code or ())
        files = engine.inputs(read if solution is None else [*read, solution])
        engine.agree(lambda: keep_off(files_of(outputs, engine.pieces), files))
        self.path, self.outputs = path, outputs
        self.writer = Writer(files, self.stated.units.record(), engine.together)
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

    def solver(self, name: str | None) -> Solver | None:
        """The method of a name, else that of the file."""
        return self.method if name is None else method_named(name)

    @property
    def title(self) -> str | None:
        """The title for figures, in which a dollar begins a formula."""
        return self.stated.problem.title.replace("$", r"\$") or None

    def kept(self, kind: str, digest: Callable[[], str]) -> Path:
        """The file in which work is kept: if none is named, one made of the problem's and of what the work depends on.

        Nobody asked for that: where it cannot be written, the work goes on without it.
        """
        given = {option: path for option, path in self.outputs.items() if path is not None}
        if "--checkpoint" not in given:
            own = Path(f"{self.path.stem}-{digest()[:8]}.{kind}.jsonl")
            check_distinct(files_of({"--checkpoint": own, **given}), self.path)
            keep_off(files_of({"--checkpoint": own}), self.writer.inputs)
            given["--checkpoint"] = own
        self.keep = given["--checkpoint"]
        return self.keep

    def print_kept(self, result: Study | Sweep, done: str) -> None:
        """Print where work is kept, or why it is not, and of interrupted work how much is done."""
        unkept = result.unkept
        print(f"not kept          {one_line(unkept)}" if unkept else f"kept              {shown(self.keep)}")
        if result.interrupted:
            print(f"interrupted: {done}; run the same command to continue")

    def discrete(self, mesh: Mesh | None = None, load_factor: float | None = None) -> DiscreteProblem:
        """The discrete problem, on another mesh and at a load factor if they are given; errors name the file."""
        from hemivar.fem import LoadLine

        problem = self.stated.problem if mesh is None else self.stated.problem.on(mesh)
        try:
            return self.engine.discrete(problem) if load_factor is None else LoadLine.of(problem).at(load_factor)
        except self.engine.refusals as error:
            raise naming_file(error, self.stated.name) from error


def print_head(session: Session, discrete: DiscreteProblem) -> None:
    """Print what the problem is."""
    stated = session.stated
    sizes, method = session.engine.head(stated, discrete)
    title = "".join(c if c.isprintable() else " " for c in stated.problem.title)
    print(title or shown(stated.name))
    print_changes(stated.changes)
    print_notes(stated.problem.mesh)
    where = f" on {', '.join(discrete.contact.places)}" if discrete.contact.names else ""
    points = int(discrete.vectors.total(discrete.contact_points)[0])
    warnings = [f"warning           {warning}" for warning in discrete.notes]
    print("\n".join([*sizes, *warnings, f"contact points    {points}{where}", *method]), flush=True)


def naming_file(error: HemivarError, name: str, table: str = "") -> HemivarError:
    """The error with the file, and a table of it, named before what it says, unless it names the file itself."""
    if str(error).startswith(f"{name}: "):
        return error
    named = type(error)(f"{name}: {'[supports] ' if isinstance(error, SupportError) else table}{error}")
    named.__dict__.update(error.__dict__)
    return named
