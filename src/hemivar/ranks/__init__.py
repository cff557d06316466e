"""The same problem on many ranks, through PETSc (extra ``petsc``: petsc4py and mpi4py)."""

from hemivar.ranks.assembly import assemble
from hemivar.ranks.pieces import family
from hemivar.ranks.ranks import world
from hemivar.ranks.ranks_march import march_on_ranks
from hemivar.ranks.solve import solve_distributed

__all__ = ["assemble", "family", "march_on_ranks", "solve_distributed", "world"]
