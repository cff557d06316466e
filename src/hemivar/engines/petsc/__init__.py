"""The same problem on many ranks, through PETSc (extra ``petsc``: petsc4py and mpi4py)."""

from hemivar.engines.petsc.assembly import BodyOnRanks, assemble
from hemivar.engines.petsc.checkpoint import read_checkpoint, write_checkpoint
from hemivar.engines.petsc.newton import DistributedNewton
from hemivar.engines.petsc.pieces import Piece, family
from hemivar.engines.petsc.ranks import Ranks, all_or_none, world
from hemivar.engines.petsc.solve import DistributedSolution, solve_distributed

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
