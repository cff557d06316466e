"""A problem file as the ranks hold it."""

from __future__ import annotations

from pathlib import Path

from hemivar.cli.session import Session
from hemivar.ranks.body_on_ranks import BodyOnRanks, body_of
from hemivar.ranks.petsc_engine import PetscEngine

__all__ = ["body_of_file"]


def body_of_file(path: str | Path) -> BodyOnRanks:
    """The body of a problem file over all ranks, which read it together."""
    return body_of(Session(Path(path), {}, engine=PetscEngine()).discrete())
