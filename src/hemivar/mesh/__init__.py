"""Meshes of simplices: built, read from files, checked, refined."""

from hemivar.mesh.build import box, rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.read import read_mesh
from hemivar.mesh.recipe import Opening

__all__ = ["Mesh", "Opening", "box", "read_mesh", "rectangle"]
