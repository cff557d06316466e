"""Meshes as text of Gmsh's format 2.2, which :func:`hemivar.mesh.read_mesh` reads back to the last digit."""

from __future__ import annotations

import io

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.types import IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.mesh import Mesh

__all__ = ["msh_text"]


def msh_text(mesh: Mesh) -> str:
    """The mesh with its boundaries, interfaces and regions as physical groups; elements of several are repeated."""
    surfaces = {**mesh.boundaries, **mesh.interfaces}
    groups = [(mesh.dim - 1, name) for name in surfaces] + [(mesh.dim, name) for name in mesh.regions]
    for _, name in groups:
        if '"' in name or name.splitlines() != [name] or name != name.strip():
            raise ProblemError(f"a mesh file cannot hold the name {quoted(name)} of a boundary or a region; rename it")
    out = io.StringIO()
    out.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
    if groups:
        lines = [f'{dim} {number} "{name}"\n' for number, (dim, name) in enumerate(groups, start=1)]
        out.write(f"$PhysicalNames\n{len(groups)}\n{''.join(lines)}$EndPhysicalNames\n")
    points = np.zeros((mesh.number_of_nodes, 3))
    points[:, : mesh.dim] = mesh.points
    out.write(f"$Nodes\n{len(points)}\n")
    out.writelines(f"{number} {x!r} {y!r} {z!r}\n" for number, (x, y, z) in enumerate(points.tolist(), start=1))
    out.write("$EndNodes\n")
    elements: list[list[int]] = []
    for number, facets in enumerate(surfaces.values(), start=1):
        elements += _elements(facets, np.full(len(facets), number))
    group = np.zeros(mesh.number_of_cells, dtype=np.int64)
    further = []
    for number, cells in enumerate(mesh.regions.values(), start=len(surfaces) + 1):
        taken = group[cells] > 0
        further.append((cells[taken], number))
        group[cells[~taken]] = number
    elements += _elements(mesh.cells, group)
    for cells, number in further:
        elements += _elements(mesh.cells[cells], np.full(len(cells), number))
    out.write(f"$Elements\n{len(elements)}\n")
    out.writelines(f"{number} {' '.join(map(str, row))}\n" for number, row in enumerate(elements, start=1))
    out.write("$EndElements\n")
    return out.getvalue()


def _elements(nodes: IntArray, group: IntArray) -> list[list[int]]:
    """Rows of kind, number of tags, group, entity, and nodes counted from 1."""
    kind = {2: 1, 3: 2, 4: 4}[nodes.shape[1]]
    head = np.column_stack([np.full(len(nodes), kind), np.full(len(nodes), 2), group, np.ones(len(nodes), dtype=int)])
    rows: list[list[int]] = np.hstack([head, nodes + 1]).tolist()
    return rows
