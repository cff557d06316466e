"""Meshes of simplices: built, read from files, checked, refined."""

from hemivar.mesh.build import box, rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.read import read_mesh
from hemivar.mesh.recipe import Assembly, Grid, Marking, MeshRecipe, Opening
from hemivar.mesh.refine import Refinement
from hemivar.mesh.write import msh_text

__all__ = [
    "Assembly",
    "Grid",
    "Marking",
    "Mesh",
    "MeshRecipe",
    "Opening",
    "Refinement",
    "box",
    "msh_text",
    "read_mesh",
    "rectangle",
]
