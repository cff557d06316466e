"""The energy norm of a problem: by a factorisation where that takes no more than a moment, by multigrid beyond."""

from __future__ import annotations

from hemivar.certificates.by_factorisation import EnergyNorm
from hemivar.certificates.by_multigrid import MultigridNorm
from hemivar.certificates.linear_bodies import below
from hemivar.discrete.problem import DiscreteProblem
from hemivar.systems.free_unknowns import free_unknowns
from hemivar.systems.workspace import Workspace

__all__ = ["FACTORISED", "EnergyNorm", "MultigridNorm", "Norm", "energy_norm", "factorises"]

#: Unknowns up to which K is factorised, in two dimensions and in three: a moment's work.
FACTORISED = (30_000, 6_000)

Norm = EnergyNorm | MultigridNorm


def energy_norm(problem: DiscreteProblem, workspace: Workspace | None = None) -> Norm:
    """The energy norm of a problem: factorised where that takes no more than a moment, by multigrid beyond.

    Of a body that is not linear it is that of C_low (:func:`hemivar.certificates.linear_bodies.below`). A workspace
    keeps it for other loads, gaps and laws of the body.

    Parameters
    ----------
    problem : DiscreteProblem
    workspace : Workspace, optional
        Where factors and levels are kept.

    Returns
    -------
    Norm
    """
    kept = Workspace.given(workspace)

    def make() -> Norm:
        if not factorises(problem):
            return MultigridNorm(problem, kept)
        body = below(problem)
        free = free_unknowns(body)
        return EnergyNorm(body.stiffness, singular=free is not None and free.shape[1] > 0)

    return kept.once("energy norm", problem.model, make)


def factorises(problem: DiscreteProblem) -> bool:
    """Whether :func:`energy_norm` factorises the stiffness of a problem.

    Parameters
    ----------
    problem : DiscreteProblem

    Returns
    -------
    bool
    """
    dimension = problem.contact.components if problem.field is None else problem.field.mesh.dim
    return problem.unknowns <= FACTORISED[dimension == 3]
