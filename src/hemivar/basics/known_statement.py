"""Statements whose solution is known: they may be given wherever a statement is asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod

from hemivar.basics.portable import PickleMixin

__all__ = ["ManufacturedProblem"]


class ManufacturedProblem(PickleMixin, ABC):
    """A problem or an evolution together with what is known of its solution."""

    @property
    @abstractmethod
    def statement(self) -> object:
        """The ContactProblem or Evolution itself."""

    @staticmethod
    def of(given: object) -> object:
        """The statement of one whose solution is known as well; anything else as it is."""
        return given.statement if isinstance(given, ManufacturedProblem) else given
