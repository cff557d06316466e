"""Small Exodus files, written by hand in both kinds of netCDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

#: Name of the type of elements, name of the block, nodes of its elements counted from 1.
Block = tuple[str, str, Sequence[Sequence[int]]]
#: Name, elements and sides.
SideSet = tuple[str, Sequence[int], Sequence[int]]


def write_exodus(
    path: Path,
    points: Sequence[Sequence[float]],
    blocks: Sequence[Block],
    side_sets: Sequence[SideSet] = (),
    node_sets: Sequence[tuple[str, Sequence[int]]] = (),
    how: str = "classic",
) -> None:
    """Blocks have the numbers 10, 20, ..., side sets 100, 200, ..., node sets 7, 14, ...; sets may lack a name."""
    x = np.array(points, dtype=float)
    arrays: dict[str, np.ndarray] = {}
    if how == "one array":
        arrays["coord"] = np.ascontiguousarray(x.T)
    else:
        arrays |= {f"coord{axis}": np.ascontiguousarray(x[:, k]) for k, axis in enumerate("xyz"[: x.shape[1]])}
    types = {}
    for number, (kind, _, nodes) in enumerate(blocks, start=1):
        arrays[f"connect{number}"], types[f"connect{number}"] = np.array(nodes, dtype="i4"), kind
    for number, (_, elements, sides) in enumerate(side_sets, start=1):
        arrays[f"elem_ss{number}"] = np.array(elements, dtype="i4")
        arrays[f"side_ss{number}"] = np.array(sides, dtype="i4")
    for number, (_, nodes) in enumerate(node_sets, start=1):
        arrays[f"node_ns{number}"] = np.array(nodes, dtype="i4")
    for of, step, several in (("eb", 10, [b[1] for b in blocks]), ("ss", 100, [s[0] for s in side_sets]),
                              ("ns", 7, [n[0] for n in node_sets])):  # fmt: skip
        if several:
            arrays[f"{of}_prop1"] = np.arange(1, len(several) + 1, dtype="i4") * step
            arrays[f"{of}_names"] = np.array([list(name.ljust(33, "\0")) for name in several], dtype="S1")
    arrays["vals_nod_var1"] = np.zeros((1, len(x)))  # a result, which is not read
    if how == "hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file[name] = values
                if name in types:
                    file[name].attrs["elem_type"] = np.bytes_(types[name])
        return
    with netcdf_file(path, "w", version=2) as file:
        for name, values in arrays.items():
            sizes = tuple(f"{name}_{k}" for k in range(values.ndim))
            for size, count in zip(sizes, values.shape, strict=True):
                file.createDimension(size, count)
            variable = file.createVariable(name, "c" if values.dtype.kind == "S" else values.dtype, sizes)
            variable[:] = values
            if name in types:
                variable.elem_type = types[name]
