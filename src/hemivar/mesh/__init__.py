"""Meshes of simplices: built, read from files, checked, refined."""

from hemivar.mesh.mesh import Mesh, box, read_mesh, rectangle
from hemivar.mesh.recipe import Grid, MeshRecipe
from hemivar.mesh.write import msh_text

__all__ = ["Grid", "Mesh", "MeshRecipe", "box", "msh_text", "read_mesh", "rectangle"]
