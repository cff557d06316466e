"""The same problem on many ranks, through PETSc (extra ``petsc``: petsc4py and mpi4py)."""

from hemivar.engines.petsc.assembly import assemble
from hemivar.engines.petsc.body_on_ranks import BodyOnRanks
from hemivar.engines.petsc.checkpoint import read_checkpoint, write_checkpoint
from hemivar.engines.petsc.pieces import Piece, family
from hemivar.engines.petsc.ranks import Ranks, world
from hemivar.engines.petsc.ranks_march import march_on_ranks, prepare_march
from hemivar.engines.petsc.solve import DistributedSolution, Saved, solve_distributed

__all__ = [
    "BodyOnRanks",
    "DistributedSolution",
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
