"""Meshes of simplices: built, read from files, checked, refined."""

from hemivar.mesh.build import box, rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.read import read_mesh

__all__ = ["Mesh", "box", "read_mesh", "rectangle"]
