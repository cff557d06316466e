"""Time integration over ranks: the serial one, with steps that are solved over ranks."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hemivar.basics.arrays import COUNTS
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array, IntArray
from hemivar.errors import MethodError
from hemivar.evolution import Checkpoint, Evolution, History, March
from hemivar.evolution.digest import identity
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.march import Backend, marching, refuse_plan
from hemivar.evolution.running import StepEvent
from hemivar.evolution.save import nearest_cell, probe_outside, probe_point
from hemivar.evolution.stepper import TimeStepper
from hemivar.evolution.time_error import TimeBound
from hemivar.mesh.mesh import Mesh
from hemivar.ranks.evolution import EvolutionOnRanks, discretize_on_ranks
from hemivar.ranks.march_checkpoint import CheckpointOnRanks
from hemivar.ranks.pieces import Piece
from hemivar.ranks.ranks import Ranks, shared
from hemivar.ranks.ranks_advance import MarginsOnRanks, stepper_on_ranks
from hemivar.ranks.time_limit import TimeLimit
from hemivar.solvers import FixedPoint, NonsmoothMultigrid
from hemivar.solvers.methods import as_method

__all__ = ["MarchOnRanks", "march_on_ranks", "prepare_march"]


@dataclass(frozen=True, eq=False)
class MarchOnRanks:
    """An evolution over ranks that is ready to be marched by :func:`hemivar.evolution.march.marching`."""

    discrete: EvolutionOnRanks
    plan: March
    tools: Backend


def prepare_march(
    ranks: Ranks, pieces: tuple[Piece, ...], state: Callable[[Mesh], Evolution], plan: March, alarm: TimeLimit
) -> MarchOnRanks:
    """Discretise an evolution over ranks and make ready what marches through it; see :func:`march_on_ranks`.

    Raises
    ------
    ProblemError, MethodError
        On all ranks: the evolution cannot be computed as stated or by this engine.
    """

    def suited() -> None:
        evolution = state(pieces[-1].mesh)
        if not evolution.body.material.linear:
            raise MethodError(
                "the engine 'petsc' integrates linear bodies in time only, and this material is not linear; leave "
                "--engine out, "
                "or solve for one load, hemivar solve --engine petsc"
            )
        refuse_plan(evolution, plan)
        _refuse(plan)

    ranks.agree(suited)
    discrete = discretize_on_ranks(ranks, pieces, state)
    plan = replace(plan, method=as_method(plan.method))
    if isinstance(plan.checkpoint, Checkpoint):
        plan = replace(plan, checkpoint=CheckpointOnRanks(plan.checkpoint.file, plan.checkpoint.minutes, ranks=ranks))

    stepper = partial(stepper_on_ranks, alarm=alarm)
    return MarchOnRanks(discrete, plan, Backend(stepper, MarginsOnRanks, _no_bound, _identity, _probed))


def march_on_ranks(
    ranks: Ranks,
    pieces: tuple[Piece, ...],
    state: Callable[[Mesh], Evolution],
    plan: March,
    *,
    alarm: TimeLimit | None = None,
    watch: Callable[[StepEvent], bool | None] | None = None,
) -> History:
    """Compute an evolution over ranks, which all call this; scheme, ledger, steps and table are those of one process.

    Where a step may have several solutions the body goes downhill without a leap, or the march stops: other choices
    are refused.  Of the history, the table and the events are the same on all ranks; frames and the last moment are the
    part of each.  Bounds of the error in time are not looked for, nor is the largest step with a positive margin where
    the laws soften; margins are those of :func:`certify_on_ranks`.

    Parameters
    ----------
    ranks : Ranks
    pieces : tuple of Piece
        Of the mesh and the coarser ones that it is a refinement of, coarsest first; see :func:`family`.
    state : callable
        Makes the evolution on a mesh.
    plan : March
        The method, if one is given, is ``NonsmoothMultigrid`` or a ``FixedPoint`` around one.
    alarm : TimeLimit, optional
        Ends the march before it is done; by default once ``plan.max_time`` has passed.
    watch : callable, optional
        Called on every rank after every step; the march ends after it if it returns True on one.

    Raises
    ------
    ProblemError, MethodError, FileError
        On all ranks: the evolution cannot be computed as stated or by this engine, the checkpoint is another's.
    """
    alarm = TimeLimit(plan.max_time) if alarm is None else alarm
    ready = prepare_march(ranks, pieces, state, plan, alarm)
    with np.errstate(all="ignore"):
        going = marching(ready.discrete, ready.plan, tools=ready.tools)
        return result_of(going, lambda stepped: bool((watch is not None and watch(stepped)) or alarm.due()))


def _refuse(plan: March) -> None:
    """Refuse what this engine cannot do."""
    method = as_method(plan.method)
    inner = method.inner if isinstance(method, FixedPoint) else method
    if inner is not None and not isinstance(inner, NonsmoothMultigrid):
        raise MethodError(
            f"the engine 'petsc' steps by multigrid, not by {inner.name}; leave the method out, or --engine"
        )
    if plan.jump not in (SelectionRule.LOCAL, SelectionRule.STOP):
        raise MethodError(
            f"the engine 'petsc' does not have jump = '{plan.jump}'; take 'local' or 'stop', or leave --engine out"
        )


def _no_bound(stepper: TimeStepper) -> TimeBound:
    return TimeBound(stepper, "", "bounds of the error in time are not computed over ranks")


def _identity(stepper: TimeStepper, *options: object) -> str:
    """The digests of all ranks, part by part."""
    assert isinstance(stepper.discrete, EvolutionOnRanks)
    digests = stepper.discrete.ranks.mpi.allgather(identity(stepper, *options))
    parts = zip(*(digest.split("|") for digest in digests), strict=True)
    return "|".join(hashlib.sha256("".join(part).encode()).hexdigest()[:32] for part in parts)


def _probed(discrete: DiscreteEvolution, probes: Mapping[str, object]) -> Callable[[Array], dict[str, Array]]:
    """As :func:`hemivar.evolution.save.probed`; the rank that is nearest to a point measures there."""
    assert isinstance(discrete, EvolutionOnRanks)
    ranks, mesh, dim = discrete.ranks, discrete.pieces[-1].mesh, discrete.body.dim
    ends = ranks.largest(*mesh.points.max(axis=0, initial=-np.inf), *(-mesh.points).max(axis=0, initial=-np.inf))
    size = float((ends[:dim] + ends[dim:]).max())
    rules: dict[str, tuple[IntArray, Array]] = {}
    for name, where in probes.items():
        point = ranks.agree(lambda name=name, where=where: probe_point(name, where, dim))  # type: ignore[misc]
        nodes, share, off = np.zeros(0, dtype=np.int64), np.zeros(0), math.inf
        if mesh.number_of_cells:
            cell, share, off = nearest_cell(mesh, point)
            nodes = mesh.cells[cell]
        nearest, own = ranks.lowest(off)
        if nearest > COUNTS * size:
            raise shared(probe_outside(name, -ends[dim:], ends[:dim]))
        rules[name] = (nodes, share) if own else (nodes[:0], share[:0])

    def measured(x: Array) -> dict[str, Array]:
        if not rules:
            return {}
        values = discrete.full(x)
        own = [share @ values[nodes] if share.size else np.zeros(dim) for nodes, share in rules.values()]
        sums = ranks.total(*np.concatenate(own)).reshape(-1, dim)
        return dict(zip(rules, sums, strict=True))

    return measured
