"""Notes of the reader of a mesh file, the element order that it suggests, and its sets of nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.types import IntArray

__all__ = ["NOT_READ", "Reading"]


@dataclass(frozen=True)
class Reading:
    """What the reader of a mesh file did and suggests."""

    notes: tuple[str, ...] = ()  # how cells were converted, and what could not be taken
    order: int = 1  # the order of elements that the file suggests
    #: Numbers of the nodes of named sets that are no boundaries.
    node_sets: Mapping[str, IntArray] = field(default_factory=dict, compare=False)

    def onto(self, ends: IntArray) -> Reading:
        """That of a mesh whose nodes lie between nodes ``ends (N, 2)`` of this one: a set has those between its own."""
        sets = {name: np.flatnonzero(np.isin(ends, nodes).all(axis=1)) for name, nodes in self.node_sets.items()}
        return replace(self, node_sets=sets)


#: Of meshes that come from no file.
NOT_READ = Reading()
