"""Commands beside the work: ``hemivar new``, ``methods``, ``doctor`` and ``studio``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from hemivar.basics.disk import shown, write_text
from hemivar.cli.command import Command, Done
from hemivar.cli.options import option
from hemivar.cli.outputs import check_outputs
from hemivar.errors import ProblemError

__all__ = ["DoctorCommand", "MethodsCommand", "NewCommand", "StudioCommand"]


class NewCommand(Command):
    """Write a problem file that solves as it is."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")] = Path("problem.toml")
    force: Annotated[bool, option("Overwrite the file if it exists.", "--force")] = False
    kind: Annotated[
        str, option("Example to begin with; see 'hemivar new --template list'.", "--template", of="NAME")
    ] = "sample"

    def work(self) -> Done:
        from hemivar.files.sample import TEMPLATES, template

        if self.kind == "list":
            for name, what in TEMPLATES.items():
                print(f"{name:<14}{what}")
            return Done()
        file, text = self.file, template(self.kind)
        if file.exists() and not file.is_dir() and not self.force:
            raise ProblemError(f"{file}: the file exists; name another one, or overwrite it with --force")
        check_outputs({"FILE": file})
        write_text(file, text.replace("FILE", shown(file), 1))
        command = "march" if "\n[time]" in text else "solve"
        print(f"written           {shown(file)}\nnow try           hemivar {command} {shown(file)} --plot figure.png")
        return Done()


class MethodsCommand(Command):
    """List the methods."""

    def work(self) -> Done:
        from dataclasses import fields, is_dataclass

        from hemivar.solvers import METHODS

        def first_line(thing: object) -> str:
            return (type(thing).__doc__ or "").strip().split("\n")[0]

        for name, solver in METHODS.items():
            print(f"{name}\n    {first_line(solver)}")
            for one in fields(solver):  # type: ignore[arg-type]
                inner = getattr(solver, one.name)
                if is_dataclass(inner):
                    print(f"    {first_line(inner)}")
        print("\nWhere no method is named, newton or multigrid is chosen by predicted cost and memory.")
        return Done()


class DoctorCommand(Command):
    """Show versions, optional parts, threads, and what is missing for what."""

    quick: Annotated[bool, option("Give each optional package 5 s, not 30.", "--quick")] = False

    def work(self) -> Done:
        from hemivar.basics.memory import size_in_words
        from hemivar.workflows import Phase, diagnose, result_of

        def told(event: Phase) -> None:
            if sys.stderr.isatty():
                sys.stderr.write(f"\r\x1b[K{event.name} ...")
                sys.stderr.flush()

        found = result_of(diagnose(limit=5.0 if self.quick else 30.0), told)
        if sys.stderr.isatty():
            sys.stderr.write("\r\x1b[K")
        memory = "" if found.memory is None else f", {size_in_words(found.memory)} of memory free"
        cores = f"{found.cores} core{'s' if found.cores != 1 else ''}"
        print(f"hemivar           {found.version}")
        print(f"Python            {found.python}")
        print(f"machine           {found.system}, {cores}{memory}")
        if found.kernels is None:
            print("kernels           pyamg, 1 thread (no compiler at installation, or HEMIVAR_KERNELS=none)")
        else:
            print(f"kernels           compiled, {found.kernels} thread{'s' if found.kernels != 1 else ''}")
        for library, count in found.threads:
            print(f"linear algebra    {library}, {count} thread{'s' if count != 1 else ''}")
        if found.seconds is not None:
            print(f"small problem     solved and certified in {found.seconds:.2g} s")
        print("\nneeded")
        for part in found.required:
            print(f"  {part.name:<16}{part.version or 'missing'}{_trouble(part.broken)}")
        print("\noptional")
        for part in found.optional:
            state = part.version or "not there"
            print(f"  {part.name:<16}{state}{_trouble(part.broken)}\n{'':18}for {part.serves}")
            if part.remedy:
                print(f"{'':18}{part.remedy}")
        if found.remarks:
            print("\nto do")
            for remark in found.remarks:
                print(f"  {remark}")
        else:
            print("\nnothing to do")
        return Done(reached=found.sound)


def _trouble(broken: str | None) -> str:
    return f"  (broken: {broken})" if broken else ""


class StudioCommand(Command):
    """Show a problem in the browser: sliders, laws, solutions, load path and certificate.

    The page is for this machine only. Ctrl-C ends it. Nothing is written to the problem file.
    """

    problem: Annotated[
        Path | None, typer.Argument(metavar="[PROBLEM.toml]", help="The problem file; an example if left out.")
    ] = None
    template: Annotated[str, option("Example to begin with; see 'hemivar new --template list'.", of="NAME")] = "survey"
    port: Annotated[int, option("Port; 0 takes a free one.", of="N", least=0, most=65535)] = 0
    token: Annotated[str | None, option("Secret part of the address; random if left out.", of="TEXT")] = None
    browser: Annotated[bool, option("Open the page in the browser.", "--browser/--no-browser")] = True

    def work(self) -> Done:
        import webbrowser
        from dataclasses import replace

        from hemivar.files.problem_file import read_text
        from hemivar.files.sample import template
        from hemivar.studio.web_server import StudioPage, bind, refuse_missing, serve

        refuse_missing()
        if self.problem is None:
            text, folder, name = template(self.template), Path(), f"{self.template}.toml"
        else:
            text, folder, name = read_text(self.problem), self.problem.parent, self.problem.name
        page = StudioPage(text, folder, name, *(() if self.token is None else (self.token,)))
        with bind(self.port) as listening:
            page = replace(page, port=listening.getsockname()[1])

            def ready() -> None:
                print(f"studio            {page.address}\nend it with       Ctrl-C")
                sys.stdout.flush()
                if self.browser:
                    webbrowser.open_new_tab(page.address)

            serve(page, listening, ready)
        return Done()
