"""The same problem on many ranks, through PETSc (extra ``petsc``: petsc4py and mpi4py)."""

from hemivar.engines.petsc.assembly import assemble
from hemivar.engines.petsc.body_on_ranks import BodyOnRanks
from hemivar.engines.petsc.checkpoint import read_checkpoint, write_checkpoint
from hemivar.engines.petsc.pieces import Piece, family
from hemivar.engines.petsc.ranks import Ranks, world
from hemivar.engines.petsc.ranks_march import march_on_ranks, prepare_march
from hemivar.engines.petsc.solve import Saved, solve_distributed

__all__ = [
    "BodyOnRanks",
    "Piece",
    "Ranks",
    "Saved",
    "assemble",
    "family",
    "march_on_ranks",
    "prepare_march",
    "read_checkpoint",
    "solve_distributed",
    "world",
    "write_checkpoint",
]

_REMOVED = {"DistributedSolution": "solve_distributed returns a hemivar.Solution, whose arrays are those of the rank"}


def __getattr__(name: str) -> object:
    if name in _REMOVED:
        raise AttributeError(f"{__name__}.{name} was removed; {_REMOVED[name]}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
