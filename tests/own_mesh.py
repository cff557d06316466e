"""A body as users bring it: a bracket in space from Gmsh, in mm and MPa, clamped in its hole, on a plate."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from hemivar.laws import Friction, NoFriction, Signorini
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import Mesh, read_mesh
from tests.mesh.gmsh_models import bracket

__all__ = ["bracket_mesh", "bracket_on_a_plate"]


@cache
def bracket_mesh(size: float) -> Mesh:
    """Gmsh's mesh of the bracket; tests that need it are left out where Gmsh is not installed."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        bracket(gmsh, size)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "bracket.msh"
            gmsh.write(str(path))
            return read_mesh(path)
    finally:
        gmsh.finalize()


def bracket_on_a_plate(size: float, friction: Friction | None = None, pull: float = 1.0) -> ContactProblem:
    """Pulled at its top, so that most of its foot lifts."""
    return ContactProblem(
        bracket_mesh(size),
        Material.young(70e3, 0.33),
        supports={"hole": Clamped()},
        contact={"bottom": Contact(Signorini(), friction or NoFriction())},
        tractions={"pull": (pull, 0.0, 0.0)},
    )
