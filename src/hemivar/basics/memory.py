"""How much memory there is, and how much a mesh and a discrete problem will take, estimated before they are made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from hemivar.basics.machine import control_groups, lines_of
from hemivar.errors import ProblemError

__all__ = ["available_bytes", "mesh_bytes", "problem_bytes", "refined_cells", "require", "size_in_words"]

#: Bytes for each cell by dimension, at the peak: making a mesh (by a formula, or by refinement), checking one given by
#: arrays or by a file, and stating and discretising a problem of order 1 and 2 on it.  Measured on uniform meshes of
#: 0.05 to 1 million cells (benchmarks/mesh_memory.py), rounded upwards.
_MAKE = {2: 120.0, 3: 120.0}
_CHECK = {2: 320.0, 3: 420.0}
_DISCRETISE = {(2, 1): 600.0, (3, 1): 850.0, (2, 2): 4200.0, (3, 2): 15000.0}
#: Less than this is not held against what is free.
_SMALL = 64.0 * 2.0**20
#: Taken to be free where that is not known.
_ASSUMED = 16.0 * 2.0**30
#: Limits of a container from here on are none: version 1 of control groups writes 2^63 less a page.
_UNLIMITED = 2.0**60


def mesh_bytes(dimension: int, cells: float, *, checked: bool = False) -> float:
    """Bytes that making a mesh takes at the peak."""
    return (_CHECK if checked else _MAKE)[dimension] * cells


def problem_bytes(dimension: int, cells: float, order: int = 1, parts: int = 1) -> float:
    """Bytes that a mesh and the discretisation of a problem on it take at the peak, without any factorisation."""
    return _DISCRETISE[dimension, order] * cells / parts


def refined_cells(dimension: int, cells: float, times: int) -> float:
    """Number of cells after uniform refinement; inf where it is too large for a float."""
    exponent = dimension * times
    return cells * 2.0**exponent if exponent < 900 else math.inf


def require(needed: float, what: str, remedy: str = "take fewer cells", *, sharers: int = 1) -> None:
    """Refuse what does not fit into the memory that is free.

    Where it is not known what is free (on systems other than Linux), 16 GiB are assumed.
    """
    total = needed * sharers
    if total < _SMALL:
        return
    free = available_bytes()
    if total > (_ASSUMED if free is None else free):
        left = f"about {size_in_words(_ASSUMED)} are assumed to be" if free is None else f"{size_in_words(free)} are"
        raise ProblemError(f"{what} needs about {size_in_words(total)} of memory, and {left} free; {remedy}")


def available_bytes() -> float | None:
    """Bytes that this process may still take, None where that is not known.

    The smallest of what the machine has available, what the limits of the control groups of the process leave
    (containers, batch systems), and what the limit of its address space leaves.
    """
    known = [left for left in (_machine_left(), *_groups_left(), _address_space_left()) if left is not None]
    return max(min(known), 0.0) if known else None


def size_in_words(amount: float) -> str:
    """An amount of memory for messages."""
    if math.isinf(amount):
        return "more than 1e+299 GiB"
    return f"{amount / 2.0**30:.3g} GiB" if amount >= 2.0**30 else f"{amount / 2.0**20:.3g} MiB"


def _machine_left() -> float | None:
    for line in lines_of(Path("/proc/meminfo")):
        if line.startswith("MemAvailable:"):
            return 1024.0 * float(line.split()[1])
    return None


def _groups_left() -> Iterator[float]:
    """What each control group of the process, and each group above it, leaves."""
    for folder, second in control_groups("memory"):
        names = (
            ("memory.max", "memory.current", "inactive_file")
            if second
            else ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        )
        left = _group_left(folder, *names)
        if left is not None:
            yield left


def _group_left(folder: Path, limit_file: str, used_file: str, reclaimable_key: str) -> float | None:
    limit, used = _number(folder / limit_file), _number(folder / used_file)
    if limit is None or used is None or limit >= _UNLIMITED:
        return None
    files = (line.split() for line in lines_of(folder / "memory.stat"))
    reclaimable = next((float(pair[1]) for pair in files if pair[0] == reclaimable_key), 0.0)
    return limit - used + reclaimable


def _address_space_left() -> float | None:
    try:
        import resource
    except ImportError:
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    pages = next((line.split()[0] for line in lines_of(Path("/proc/self/statm"))), None)
    if limit == resource.RLIM_INFINITY or pages is None:
        return None
    return float(limit) - float(pages) * resource.getpagesize()


def _number(path: Path) -> float | None:
    text = next(iter(lines_of(path)), "")
    return float(text) if text.isdigit() else None
