"""Meshes of simplices: built, read from files, checked, refined."""

from hemivar.mesh.mesh import Mesh, box, read_mesh, rectangle

__all__ = ["Mesh", "box", "read_mesh", "rectangle"]
