"""Bodies that Gmsh meshes and exports to the formats of other programs.

python -m tests.mesh.foreign_models      # writes the files of Gmsh in tests/mesh/files anew
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

FILES = Path(__file__).parent / "files"
#: Name, elements, order, formats.
EXPORTS = (
    ("plane", "triangles", 1, "inp bdf med su2 mesh vtk"),
    ("quads", "quadrilaterals", 1, "inp med unv vtk"),
    ("second", "triangles", 2, "inp med su2 unv vtk"),
    ("hexes", "hexahedra", 1, "inp bdf med su2 mesh vtk"),
    ("hexes2", "hexahedra", 2, "inp bdf med unv vtk"),
    ("wedges1", "wedges", 1, "msh"),
    ("wedges2", "wedges", 2, "msh inp bdf unv vtk"),
)


def mesh_body(gmsh: Any, elements: str, order: int) -> None:
    """Mesh the body of these elements in the current session of Gmsh."""
    gmsh.clear()
    model, option, solid = gmsh.model, gmsh.option.setNumber, elements in ("hexahedra", "wedges")
    option("Mesh.RecombineAll", elements in ("quadrilaterals", "hexahedra"))
    option("Mesh.RecombinationAlgorithm", 1)
    option("Mesh.SecondOrderIncomplete", 1)
    model.add(elements)
    occ = model.occ
    if elements == "hexahedra":
        occ.addBox(0, 0, 0, 1, 1, 1)
    elif elements == "wedges":
        occ.extrude([(2, occ.addRectangle(0, 0, 0, 1, 1))], 0, 0, 1, [2], recombine=True)
    else:
        occ.fragment([(2, occ.addRectangle(0, 0, 0, 2, 1))], [(2, occ.addRectangle(2, 0, 0, 1, 1))])
    occ.synchronize()
    boxes = {tag: model.getBoundingBox(2 if solid else 1, tag) for _, tag in model.getEntities(2 if solid else 1)}

    def group(name: str, axis: int, low: float, high: float) -> None:
        chosen = [tag for tag, box in boxes.items() if low < box[axis] and box[axis + 3] < high]
        model.addPhysicalGroup(2 if solid else 1, chosen, name=name)

    if solid:
        group("bottom", 2, -0.1, 0.1)
        group("top", 2, 0.9, 1.1)
        model.addPhysicalGroup(3, [1], name="body")
    else:
        group("left", 0, -0.1, 0.1)
        group("right", 0, 2.9, 3.1)
        group("middle", 0, 1.9, 2.1)
        model.addPhysicalGroup(2, [1], name="steel")
        model.addPhysicalGroup(2, [2], name="rubber")
    model.mesh.setSize(model.getEntities(0), 2.0 if elements == "wedges" else 0.6)
    if elements == "hexahedra":
        for dim, set_entity in ((1, model.mesh.setTransfiniteCurve), (2, model.mesh.setTransfiniteSurface)):
            for _, tag in model.getEntities(dim):
                set_entity(tag, *([3] if dim == 1 else []))
        model.mesh.setTransfiniteVolume(1)
    model.mesh.generate(3 if solid else 2)
    model.mesh.setOrder(order)


if __name__ == "__main__":
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    for name, elements, order, formats in EXPORTS:
        mesh_body(gmsh, elements, order)
        for suffix in formats.split():
            gmsh.write(str(FILES / f"gmsh-{name}.{suffix}"))
    gmsh.finalize()
