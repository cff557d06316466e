"""Multi-body meshes: several meshes as one, whose parts have names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.first_use import IMPORTS
from hemivar.errors import ProblemError
from hemivar.mesh.keys import frozen
from hemivar.mesh.reading import Reading
from hemivar.mesh.recipe import Assembly, MeshRecipe
from hemivar.mesh.refine import Refinement

if TYPE_CHECKING:
    from hemivar.basics.types import IntArray
    from hemivar.mesh.mesh import Mesh

__all__ = ["assembled"]


def assembled(parts: Mapping[str, Mesh]) -> Mesh:
    """The mesh of all parts, see :meth:`Mesh.assembled`."""
    meshes = _checked(parts)
    first = next(iter(meshes.values()))
    nodes = _starts([mesh.number_of_nodes for mesh in meshes.values()])
    cells = _starts([mesh.number_of_cells for mesh in meshes.values()])
    regions: dict[str, IntArray] = {}
    for (name, mesh), start in zip(meshes.items(), cells, strict=True):
        regions[name] = start + np.arange(mesh.number_of_cells)
        regions |= {f"{name}:{own}": start + ids for own, ids in mesh.regions.items()}
    return first.trusted(
        np.concatenate([mesh.points for mesh in meshes.values()]),
        np.concatenate([start + mesh.cells for mesh, start in zip(meshes.values(), nodes, strict=True)]),
        _joined(meshes, nodes, lambda mesh: mesh.boundaries),
        regions,
        _parent(meshes),
        _recipe(meshes),
        interfaces=_joined(meshes, nodes, lambda mesh: mesh.interfaces),
        reading=_reading(meshes, nodes),
    )


def _checked(parts: Mapping[str, Mesh]) -> dict[str, Mesh]:
    with IMPORTS:
        from hemivar.mesh.mesh import Mesh

    if not isinstance(parts, Mapping) or not parts:
        raise ProblemError('parts: give a dict of meshes by names, such as {"upper": mesh, "lower": mesh}')
    meshes = dict(parts)
    for name, mesh in meshes.items():
        if not isinstance(name, str) or not name or ":" in name or name != name.strip():
            raise ProblemError(f"part {quoted(name)}: give a name without a colon, such as 'upper'")
        if not isinstance(mesh, Mesh):
            raise ProblemError(f"part '{name}' is a {type(mesh).__name__}; give a Mesh, such as hemivar.rectangle(...)")
    dims = {name: mesh.dim for name, mesh in meshes.items()}
    if len(set(dims.values())) > 1:
        flat, solid = (next(name for name, dim in dims.items() if dim == wanted) for wanted in (2, 3))
        raise ProblemError(f"part '{flat}' is plane and part '{solid}' is not; give meshes of one dimension")
    return meshes


def _starts(counts: list[int]) -> IntArray:
    return np.concatenate([[0], np.cumsum(counts[:-1], dtype=np.int64)])


def _joined(
    meshes: Mapping[str, Mesh], starts: IntArray, named: Callable[[Mesh], Mapping[str, IntArray]]
) -> dict[str, IntArray]:
    """The named facets of all parts, under the names of both."""
    return {
        f"{name}:{own}": start + facets
        for (name, mesh), start in zip(meshes.items(), starts, strict=True)
        for own, facets in named(mesh).items()
    }


def _reading(meshes: Mapping[str, Mesh], starts: IntArray) -> Reading:
    """What was said of all parts; order 2 where all suggest it, in space where one does."""
    notes = tuple(f"{name}: {note}" for name, mesh in meshes.items() for note in mesh.notes)
    orders = [(mesh.suggested_order, mesh.dim) for mesh in meshes.values()]
    sets = {
        f"{name}:{own}": start + nodes
        for (name, mesh), start in zip(meshes.items(), starts, strict=True)
        for own, nodes in mesh.reading.node_sets.items()
    }
    return Reading(notes, max(orders)[0] if orders[0][1] == 3 else min(orders)[0], sets)


def _recipe(meshes: Mapping[str, Mesh]) -> MeshRecipe | None:
    parts = {name: mesh.recipe for name, mesh in meshes.items() if mesh.recipe is not None}
    return MeshRecipe(Assembly(MappingProxyType(parts))) if len(parts) == len(meshes) else None


def _parent(meshes: Mapping[str, Mesh]) -> Refinement | None:
    """One step back in every part that has one; the others stay as they are."""
    steps = {name: mesh.parent or _unchanged(mesh) for name, mesh in meshes.items()}
    if all(mesh.parent is None for mesh in meshes.values()):
        return None
    coarse = {name: step.mesh for name, step in steps.items()}
    nodes = _starts([mesh.number_of_nodes for mesh in coarse.values()])
    cells = _starts([mesh.number_of_cells for mesh in coarse.values()])
    return Refinement(
        assembled(coarse),
        frozen(np.concatenate([start + step.ends for step, start in zip(steps.values(), nodes, strict=True)])),
        frozen(np.concatenate([start + step.cells for step, start in zip(steps.values(), cells, strict=True)])),
    )


def _unchanged(mesh: Mesh) -> Refinement:
    own = np.arange(mesh.number_of_nodes)
    return Refinement(mesh, np.column_stack([own, own]), np.arange(mesh.number_of_cells))
