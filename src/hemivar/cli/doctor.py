"""``hemivar doctor``: what this installation has, what is missing and for what."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from hemivar.cli.options import Exit

__all__ = ["doctor"]


def doctor(
    quick: Annotated[bool, typer.Option("--quick", help="Give each optional package 5 s, not 30.")] = False,
) -> int:
    """Show versions, optional parts, threads, and what is missing for what."""
    from hemivar.basics.memory import size_in_words
    from hemivar.workflows import Phase, diagnose, result_of

    def told(event: Phase) -> None:
        if sys.stderr.isatty():
            sys.stderr.write(f"\r\x1b[K{event.name} ...")
            sys.stderr.flush()

    found = result_of(diagnose(limit=5.0 if quick else 30.0), told)
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
    return Exit.CONVERGED if found.sound else Exit.NOT_CONVERGED


def _trouble(broken: str | None) -> str:
    return f"  (broken: {broken})" if broken else ""
