"""What methods work on: the body condensed onto its contact boundary, or all of it."""

from hemivar.systems.condensed import CondensedProblem, condense

__all__ = ["CondensedProblem", "condense"]
