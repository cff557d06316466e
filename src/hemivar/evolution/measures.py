"""What a row of the table says of a moment: forces and measures of contact."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hemivar.basics.types import IntArray
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.state import TimeState
from hemivar.solvers.boundary_result import friction_of

__all__ = ["contact_forces", "healing"]

#: Part of the stiffness by which the damage of glue changes where it changes.
_HEALS = 1e-9


def contact_forces(discrete: DiscreteEvolution, moment: TimeState) -> dict[str, float]:
    """Forces and measures of contact, over all and by boundary.

    ``normal_force`` is the resultant of the pressure; ``friction_force`` that of the friction of the foundation on the
    body: its local component in the plane, in space the length of the vector.  ``force_time`` is the time that forces
    belong to.
    """
    shown = moment.contact_force
    weights, lam = discrete.problem.contact.weights, shown.multiplier
    found: dict[str, float] = {}
    boundaries: Mapping[str, IntArray] = dict(discrete.blocks) if len(discrete.blocks) > 1 else {}
    parts: list[tuple[str, IntArray | slice]] = [("", slice(None))]
    parts += [(f"{name}.", index) for name, index in boundaries.items()]
    own, deep = [], []
    force = weights[:, None] * lam
    rubbed = friction_of(force)
    if rubbed.shape[1] > 1:  # the tangents of different points point in different directions
        rubbed = discrete.problem.contact.global_vectors(force * (np.arange(lam.shape[1]) > 0))
    depth = moment.local.displacement[:, 0]
    summed = np.empty((len(lam), rubbed.shape[1] + 2))
    summed[:, 0], summed[:, 1:-1], summed[:, -1] = force[:, 0], rubbed, np.where(lam[:, 0] > 0.0, weights, 0.0)
    for _, index in parts:
        own += np.add.reduce(summed[index], axis=0).tolist()
        deep.append(float(depth[index].max(initial=-np.inf)))
    sums = discrete.vectors.total(*own).reshape(len(parts), -1)
    deepest = discrete.vectors.largest(*deep)
    for (name, _), total, deepest_here in zip(parts, sums, deepest, strict=True):
        slid = total[1:-1]
        found[f"{name}normal_force"] = float(total[0])
        found[f"{name}friction_force"] = float(slid[0]) if slid.size == 1 else float(np.linalg.norm(slid))
        found[f"{name}contact_measure"] = float(total[-1])
        found[f"{name}penetration"] = float(deepest_here)
    return found | {"force_time": shown.time}


def healing(discrete: DiscreteEvolution, before: TimeState, after: TimeState) -> str:
    """The first boundary whose glue is past its strength and closes along the curve that it has opened by, or ""."""
    for name, index in discrete.blocks:
        contact = discrete.contacts[name]
        elastic = not contact.remembers and contact.law.remembers
        if elastic and discrete.vectors.largest(float(_closes(discrete, index, before, after)))[0]:
            return name
    return ""


def _closes(discrete: DiscreteEvolution, index: IntArray, before: TimeState, after: TimeState) -> bool:
    law, places = discrete.problem.law.take(index), [state.local.displacement[index] for state in (before, after)]
    old, new = (law.debonding(r)["damage"] for r in places)
    return bool((law.past_peak(places[0]) & (new < old - _HEALS)).any())
