"""Notes of the reader of a mesh file, and the element order that it suggests."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["NOT_READ", "Reading"]


@dataclass(frozen=True)
class Reading:
    """What the reader of a mesh file did and suggests."""

    notes: tuple[str, ...] = ()  # how cells were converted, and what could not be taken
    order: int = 1  # the order of elements that the file suggests


#: Of meshes that come from no file.
NOT_READ = Reading()
