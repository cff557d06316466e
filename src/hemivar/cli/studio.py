"""``hemivar studio``: a problem in the browser."""

from __future__ import annotations

import dataclasses
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from hemivar.cli.options import Exit

__all__ = ["studio"]


def studio(
    problem: Annotated[
        Path | None, typer.Argument(metavar="[PROBLEM.toml]", help="The problem file; an example if left out.")
    ] = None,
    template: Annotated[
        str, typer.Option(metavar="NAME", help="Example to begin with; see 'hemivar new --template list'.")
    ] = "survey",
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535, help="Port; 0 takes a free one.")] = 0,
    token: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Secret part of the address; random if left out.")
    ] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> int:
    """Show a problem in the browser: sliders, laws, solutions, load path and certificate.

    The page is for this machine only. Ctrl-C ends it. Nothing is written to the problem file.
    """
    from hemivar.files.problem_file import read_text
    from hemivar.files.sample import template as sample
    from hemivar.studio.web_server import StudioPage, bind, refuse_missing, serve

    refuse_missing()
    if problem is None:
        text, folder, name = sample(template), Path(), f"{template}.toml"
    else:
        text, folder, name = read_text(problem), problem.parent, problem.name
    page = StudioPage(text, folder, name) if token is None else StudioPage(text, folder, name, token)
    with bind(port) as listening:
        page = dataclasses.replace(page, port=listening.getsockname()[1])

        def ready() -> None:
            print(f"studio            {page.address}\nend it with       Ctrl-C")
            sys.stdout.flush()
            if browser:
                webbrowser.open_new_tab(page.address)

        serve(page, listening, ready)
    return Exit.CONVERGED
