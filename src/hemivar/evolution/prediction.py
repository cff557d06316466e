"""Where contact points are expected to be at the end of a stage, before it is solved."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.evolution.stage import Stage
from hemivar.systems.body import Body

__all__ = ["predicted_contact"]


def predicted_contact(stage: Stage, body: Body) -> Array | None:
    """Unknowns (n,) of a stage with its contact points where they will be if the body keeps its acceleration.

    There they settle on the graphs of their laws, each by itself; all other unknowns stay at the
    prediction of the stage, where nothing accelerates.  None where the acceleration tells nothing: in the first step,
    with laws of impact, and in schemes whose accelerations swing, which are all but those of backward differences.
    """
    rule, before = stage.rule, stage.before
    swings = not rule.ends or rule.rate.velocity or rule.rate.acceleration
    if not before.index or swings or rule.restitution is not None:
        return None
    way = before.body.acceleration[: stage.problem.unknowns] / rule.acceleration.difference
    weights, stiffness, r = body.weights[:, None], body.diagonal, body.local(way)
    force = body.spread(body.load[body.unknown] - body.pull(way))
    pair = stiffness[:, [0, min(1, r.shape[1] - 1)]] / weights
    place = body.law.on_graph((stiffness * r + force) / weights, pair).r
    if not np.isfinite(place).all():
        return None
    return body.moved(np.zeros(way.shape), np.where(body.active, place, body.fixed))
