"""What methods work on: the body condensed onto its contact boundary, or all of it."""

from hemivar.systems.condensed import CondensedProblem, condense
from hemivar.systems.workspace import Workspace

__all__ = ["CondensedProblem", "Workspace", "condense"]
