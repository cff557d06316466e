"""The same problem on many ranks, through PETSc (extra ``petsc``: petsc4py and mpi4py)."""

from hemivar.distributed.assembly import BodyOnRanks, assemble
from hemivar.distributed.checkpoint import read_checkpoint, write_checkpoint
from hemivar.distributed.newton import DistributedNewton
from hemivar.distributed.pieces import Piece, family
from hemivar.distributed.ranks import Ranks, all_or_none, world
from hemivar.distributed.solve import DistributedSolution, solve_distributed

__all__ = [
    "BodyOnRanks",
    "DistributedNewton",
    "DistributedSolution",
    "Piece",
    "Ranks",
    "all_or_none",
    "assemble",
    "family",
    "read_checkpoint",
    "solve_distributed",
    "world",
    "write_checkpoint",
]
