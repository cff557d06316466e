"""Bodies that Gmsh meshes and writes in every variant of its format.

python -m tests.mesh.gmsh_models      # writes the files of tests/mesh/gmsh anew
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FILES = Path(__file__).parent / "gmsh"
#: Variants that are committed: model, version, binary, all elements, parameters of nodes, parts.
COMMITTED = (
    ("plane", "2.2", False, False, False, False),
    ("plane", "2.2", True, False, True, True),
    ("plane", "4.0", False, True, True, True),
    ("plane", "4.1", False, True, True, True),
    ("plane", "4.1", True, False, False, False),
    ("solid", "2.2", False, False, True, False),
    ("solid", "4.1", True, True, True, True),
)


def plane(gmsh: Any, size: float) -> None:
    """A rectangle 2 by 1 with a square hole beside a unit square: groups that share a name, a number or elements."""
    gmsh.model.add("plane")
    occ = gmsh.model.occ
    whole, hole = occ.addRectangle(0, 0, 0, 2, 1), occ.addRectangle(0.6, 0.3, 0, 0.4, 0.4)
    occ.cut([(2, whole)], [(2, hole)], tag=10)
    occ.addRectangle(2, 0, 0, 1, 1, tag=11)
    occ.fragment([(2, 10)], [(2, 11)])
    occ.synchronize()
    boxes = {tag: gmsh.model.getBoundingBox(1, tag) for _, tag in gmsh.model.getEntities(1)}

    def curves(chosen: Any) -> list[int]:
        return [tag for tag, box in boxes.items() if chosen(*box)]

    group = gmsh.model.addPhysicalGroup
    group(1, curves(lambda a, b, c, d, e, f: e < 1e-3), 1, "ground")
    group(1, curves(lambda a, b, c, d, e, f: d < 1e-3), 2, "side")
    group(1, curves(lambda a, b, c, d, e, f: a > 0.1 and b > 0.1 and d < 1.1 and e < 0.9), 4, "body")  # the hole
    group(1, curves(lambda a, b, c, d, e, f: b > 0.999), 7)  # without a name
    surfaces = sorted((gmsh.model.occ.getMass(2, tag), tag) for _, tag in gmsh.model.getEntities(2))
    tags = [tag for _, tag in surfaces]
    group(2, tags, 1, "body")
    group(2, tags[1:], 2, "holed")
    group(2, tags[:1], 3)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)


def solid(gmsh: Any, size: float) -> None:
    """A unit cube of two layers."""
    gmsh.model.add("solid")
    occ = gmsh.model.occ
    occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 0.75))], [(3, occ.addBox(0, 0, 0.75, 1, 1, 0.25))])
    occ.synchronize()
    boxes = {tag: gmsh.model.getBoundingBox(2, tag) for _, tag in gmsh.model.getEntities(2)}
    group = gmsh.model.addPhysicalGroup
    group(2, [tag for tag, box in boxes.items() if box[5] < 1e-3], 1, "ground")
    group(2, [tag for tag, box in boxes.items() if box[2] > 0.999], 2, "top")
    volumes = sorted((occ.getMass(3, tag), tag) for _, tag in gmsh.model.getEntities(3))
    group(3, [tag for _, tag in volumes], 1, "ground")
    group(3, [volumes[0][1]], 5, "layer")
    group(3, [volumes[1][1]], 6)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)


def bracket(gmsh: Any, size: float) -> None:
    """An angle of two plates, 8 thick, with a hole in the lower one; in millimetres."""
    gmsh.model.add("bracket")
    occ = gmsh.model.occ
    angle, _ = occ.fuse([(3, occ.addBox(0, 0, 0, 60, 40, 8))], [(3, occ.addBox(0, 0, 8, 8, 40, 50))])
    occ.cut(angle, [(3, occ.addCylinder(40, 20, -1, 0, 0, 12, 6))])
    occ.synchronize()
    boxes = {tag: gmsh.model.getBoundingBox(2, tag) for _, tag in gmsh.model.getEntities(2)}
    group = gmsh.model.addPhysicalGroup
    group(2, [tag for tag, box in boxes.items() if abs(box[5]) < 1e-3], 1, "bottom")
    group(2, [tag for tag, box in boxes.items() if box[2] > 57.9], 2, "pull")
    hole = [tag for tag, box in boxes.items() if box[0] > 33.0 and box[3] < 47.0 and box[5] - box[2] > 7.0]
    group(2, hole, 3, "hole")
    group(3, [tag for _, tag in gmsh.model.getEntities(3)], 1, "aluminium")
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)


MODELS = {"plane": plane, "solid": solid}


def variants() -> Iterator[tuple[str, bool, bool, bool]]:
    """Version, binary, all elements, parameters: those that Gmsh writes."""
    for version, binary, all_of_them, parameters in itertools.product(("2.2", "4.0", "4.1"), *[(False, True)] * 3):
        if version != "4.0" or not binary:
            yield version, binary, all_of_them, parameters


def write(gmsh: Any, path: Path, version: str, binary: bool, all_of_them: bool, parameters: bool) -> None:
    """Write the present model."""
    gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
    gmsh.option.setNumber("Mesh.Binary", int(binary))
    gmsh.option.setNumber("Mesh.SaveAll", int(all_of_them))
    gmsh.option.setNumber("Mesh.SaveParametric", int(parameters))
    gmsh.write(str(path))


def file_name(model: str, version: str, binary: bool, all_of_them: bool, parameters: bool, parts: bool) -> str:
    words = [model, version, "binary" if binary else "text"]
    words += [
        word for word, there in (("all", all_of_them), ("parametric", parameters), ("partitioned", parts)) if there
    ]
    return "-".join(words) + ".msh"


def main() -> None:
    """Write the committed files."""
    import gmsh

    FILES.mkdir(exist_ok=True)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for variant in COMMITTED:
            gmsh.clear()
            MODELS[variant[0]](gmsh, 1.0)
            if variant[-1]:
                gmsh.model.mesh.partition(2)
            write(gmsh, FILES / file_name(*variant), *variant[1:-1])
    finally:
        gmsh.finalize()


if __name__ == "__main__":
    main()
