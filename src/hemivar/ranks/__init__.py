"""The same problem on many ranks, through PETSc (extra ``petsc``: petsc4py and mpi4py)."""

from hemivar.ranks.assembly import assemble
from hemivar.ranks.body_on_ranks import BodyOnRanks
from hemivar.ranks.checkpoint import read_checkpoint, write_checkpoint
from hemivar.ranks.pieces import Piece, family
from hemivar.ranks.ranks import Ranks, world
from hemivar.ranks.ranks_march import march_on_ranks, prepare_march
from hemivar.ranks.solve import Saved, solve_distributed

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
