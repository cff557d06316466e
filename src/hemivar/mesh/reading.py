"""What the reader of a mesh file did and suggests."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["NOT_READ", "Reading"]


@dataclass(frozen=True)
class Reading:
    """What the reader of a mesh file did and suggests.

    Attributes
    ----------
    notes : tuple of str
        How cells were converted, and what could not be taken.
    order : int
        The order of elements that the file suggests.
    """

    notes: tuple[str, ...] = ()
    order: int = 1


#: Of meshes that come from no file.
NOT_READ = Reading()
