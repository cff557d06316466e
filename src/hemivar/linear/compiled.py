"""V-cycles in the compiled kernels: cycle and matrix-vector products of :class:`Levels` in single calls."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.kernels.library import Kernels, expect_list
from hemivar.linear.truncated_level import Transfer

__all__ = ["CompiledLevels", "CompiledTruncation", "NodeSlots"]

#: Unknowns of a node that the kernels are compiled for.
_SIZES = (1, 2, 3, 6)


@dataclass(frozen=True, eq=False)
class NodeSlots:
    """Where unknowns go in a vector with the same number of entries for every node."""

    places: IntArray  # (n,)
    size: int  # entries of a node
    nodes: int
    signs: Array | None = None  # (n,): -1 for unknowns that are counted against the direction of their component
    # (n,): unknowns of bodies that touch have different numbers, odd ones where they are jumps; no aggregate has both
    group: IntArray | None = None

    @staticmethod
    def single(n: int) -> NodeSlots:
        """Each unknown a node of its own."""
        return NodeSlots(np.arange(n), 1, n)

    def serves(self, n: int) -> bool:
        """Whether the compiled kernels know nodes of this size, and n unknowns have places of their own."""
        places, count = self.places, self.size * self.nodes
        if self.size not in _SIZES or places.shape != (n,) or places.dtype.kind not in "iu":
            return False
        if n == 0 or int(places.min()) < 0 or int(places.max()) >= count:
            return False
        taken = np.zeros(count, dtype=bool)
        taken[places] = True
        return int(np.count_nonzero(taken)) == n


class CompiledLevels:
    """Matrices and transfers of a hierarchy, copied into blocks.

    ``matrices``: from coarse to fine; of each 32-bit indices in order; ``contacts``: unknowns whose rows a solve may
    change. Raises ValueError: an array is not what it should be.
    """

    def __init__(
        self,
        kernels: Kernels,
        matrices: Sequence[sp.csr_array],
        transfers: Sequence[Transfer],
        contacts: Sequence[IntArray],
        slots: Sequence[NodeSlots],
    ) -> None:
        self.kernels = kernels
        if not matrices or len(transfers) != len(matrices) - 1:
            raise ValueError(f"{len(matrices)} levels must have a transfer between any two, not {len(transfers)}")
        call, at = kernels.call, kernels.address
        self.pointer = kernels.made(call.hv_levels_new(len(matrices)))
        weakref.finalize(self, call.hv_levels_free, self.pointer)
        self.matrices = []  # which products read
        self.sizes = [matrix.shape[0] for matrix in matrices]
        self.entries = []
        for k, (A, contact, slot) in enumerate(zip(matrices, contacts, slots, strict=True)):
            n = A.shape[0]
            _check(A, (n, n))
            self.matrices.append(_kept(A))
            if not slot.serves(n):
                raise ValueError(f"level {k}: its unknowns have no places of their own in nodes")
            known = np.asarray(contact)
            plain = known.ndim == 1 and (known.dtype.kind in "iu" or not known.size)
            if not plain or (known.size and not (known[0] >= 0 and known[-1] < n and np.all(np.diff(known) > 0))):
                raise ValueError(f"level {k}: contact unknowns must be between 0 and {n - 1}, in order")
            rows, places = (np.ascontiguousarray(given, dtype=np.int32) for given in (known, slot.places))
            signs = np.ones(n) if slot.signs is None else np.where(np.asarray(slot.signs) < 0.0, -1.0, 1.0)
            if signs.shape != (n,):
                raise ValueError(f"level {k}: signs must have one number for each of {n} unknowns, not {signs.shape}")
            signs = np.ascontiguousarray(signs, dtype=np.float32)
            kernels.check(
                call.hv_levels_matrix(
                    self.pointer, k, n, at(A.indptr), at(A.indices), at(A.data), slot.size, slot.nodes, at(places),
                    at(signs), at(rows), rows.size,
                )
            )  # fmt: skip
            self.entries.append((rows.size, int((A.indptr[rows + 1] - A.indptr[rows]).sum())))
        for k, transfer in enumerate(transfers):
            P = transfer.prolongation
            _check(P, (self.sizes[k + 1], self.sizes[k]))
            kernels.check(call.hv_levels_transfer(self.pointer, k, *P.shape, at(P.indptr), at(P.indices), at(P.data)))

    def __reduce__(self) -> str:
        raise TypeError("compiled levels belong to this process")

    def check(self, k: int) -> None:
        """Refuse a level that is not there; Python would count from the end, the kernels would not."""
        if not 0 <= k < len(self.sizes):
            raise ValueError(f"there is no level {k}; it must be between 0 and {len(self.sizes) - 1}")

    def multiply(self, k: int, x: Array) -> Array:
        """The matrix of a level times a vector (n,)."""
        self.check(k)
        A, x = self.matrices[k], np.require(x, float, ["C", "A"])
        if x.shape != (self.sizes[k],):
            raise ValueError(f"level {k} has {self.sizes[k]} unknowns, not {x.shape}")
        out, at = np.empty_like(x), self.kernels.address
        self.kernels.check(
            self.kernels.call.hv_multiply(x.size, at(A.indptr), at(A.indices), at(A.data), at(x), at(out))
        )
        return out


class CompiledTruncation:
    """Compiled levels with some rows changed; belongs to one solve."""

    def __init__(self, levels: CompiledLevels) -> None:
        self._levels = levels
        self._kernels = levels.kernels
        self._pointer = self._kernels.made(self._kernels.call.hv_truncation_new(levels.pointer))
        weakref.finalize(self, self._kernels.call.hv_truncation_free, self._pointer)

    def __reduce__(self) -> str:
        raise TypeError("compiled levels belong to this process")

    def change(self, k: int, held: BoolArray, values: Array) -> None:
        """Other entries for the rows of the contact unknowns of a level, of which some are held."""
        self._levels.check(k)
        held = np.ascontiguousarray(held, dtype=np.uint8)
        values = np.require(values, float, ["C", "A"])
        if (held.size, values.size) != self._levels.entries[k]:
            raise ValueError(f"level {k} has {self._levels.entries[k]} contact unknowns and entries of their rows")
        at = self._kernels.address
        self._kernels.check(self._kernels.call.hv_truncation_rows(self._pointer, k, at(held), at(values)))

    def set_root(self, root: Array) -> None:
        """R with R R' about the inverse of the coarsest matrix."""
        root = np.require(root, float, ["C", "A"])
        if root.shape != (self._levels.sizes[0],) * 2:
            raise ValueError("the root of the inverse has another size than the coarsest level")
        self._kernels.check(self._kernels.call.hv_truncation_root(self._pointer, self._kernels.address(root)))

    def cycle(self, k: int, right: Array) -> Array:
        """One symmetric V-cycle from zero; the answer has the accuracy of single precision."""
        self._levels.check(k)
        right = np.require(right, float, ["C", "A"])
        if right.shape != (self._levels.sizes[k],):
            raise ValueError(f"level {k} has {self._levels.sizes[k]} unknowns, not {right.shape}")
        out = np.empty_like(right)
        at = self._kernels.address
        self._kernels.check(self._kernels.call.hv_cycle(self._pointer, k, at(right), at(out)))
        return out


def _kept(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix behind arrays that cannot be written to: products read where its columns lead."""
    parts = [part.view() for part in (matrix.data, matrix.indices, matrix.indptr)]
    for part in parts:
        part.flags.writeable = False
    return sp.csr_array(tuple(parts), shape=matrix.shape)


def _check(matrix: sp.csr_array, shape: tuple[int, int]) -> None:
    """That the kernels read what they expect, and nothing beyond its ends."""
    indptr, indices, data = matrix.indptr, matrix.indices, matrix.data
    for name, array, kind in (("indptr", indptr, np.int32), ("indices", indices, np.int32), ("data", data, np.float64)):
        expect_list(f"{name} of a matrix", array, kind)
    if matrix.shape != shape or indptr.size != shape[0] + 1:
        raise ValueError(f"a matrix of shape {matrix.shape} stands where {shape} is asked for")
    if indptr[0] != 0 or np.any(np.diff(indptr) < 0) or indptr[-1] != indices.size or indices.size != data.size:
        raise ValueError("indptr of a matrix must rise from 0 to the number of its entries")
    if indices.size and not (indices.min() >= 0 and indices.max() < shape[1]):
        raise ValueError(f"columns of a matrix must be between 0 and {shape[1] - 1}")
