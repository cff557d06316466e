"""Meshes of simplices: built, read from files, checked, refined."""

from hemivar.mesh.build import box, rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.read import read_mesh
from hemivar.mesh.refine import Refinement

__all__ = ["Mesh", "Refinement", "box", "read_mesh", "rectangle"]
