"""How much memory a condensation will take, and how much there is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from hemivar.errors import MethodError
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.solvers.factorisation import mumps_available

__all__ = ["available_bytes", "check_memory", "factorisation_bytes", "shortage"]

#: By dimension, for SuperLU with minimum degree (benchmarks/factor_memory.py): bytes over ``n log2 n`` in 2D and over
#: ``n^1.5`` in 3D (nested dissection would give n^(4/3)), and the number of dense matrices on the contact unknowns.
_SUPERLU = {2: (130.0, 4.0), 3: (222.0, 8.0)}
#: The same for MUMPS with METIS, over ``n^(4/3)`` in 3D.
_MUMPS = {2: (48.0, 4.0), 3: (260.0, 8.0)}
#: What the prediction is multiplied by before it is held against the memory that is free: the largest underestimate
#: seen, and a little.
_SAFETY = 1.25
_UNLIMITED = 2.0**60


def factorisation_bytes(unknowns: int, dimension: int, contact: int) -> float:
    """Bytes that condensing a problem and solving it by :class:`NonsmoothNewton` take beyond the problem itself.

    A fit to measurements with linear elements on uniform meshes, by the factorisation that :func:`factorise` takes
    here; it was off by at most 25 % in 2D up to 1.05 million unknowns and 10 % in 3D up to 0.1 million.

    Parameters
    ----------
    unknowns, contact : int
        Unknowns n, and those of them on the contact boundary.
    dimension : int
        Of the body.
    """
    mumps = mumps_available()
    factor, dense = (_MUMPS if mumps else _SUPERLU).get(dimension, (100.0, 8.0))
    n = float(max(unknowns, 2))
    growth = n * math.log2(n) if dimension == 2 else n ** (4.0 / 3.0 if mumps else 1.5) if dimension == 3 else n
    return factor * growth + dense * 8.0 * float(contact) ** 2


def available_bytes() -> float | None:
    """Bytes that this process may still take, None where that cannot be told.

    The smallest of what the machine has available, what the limits of the control groups of the process leave
    (containers, batch systems), and what the limit of its address space leaves.
    """
    known = [left for left in (_machine_left(), *_groups_left(), _address_space_left()) if left is not None]
    return max(min(known), 0.0) if known else None


def check_memory(unknowns: int, dimension: int, contact: int) -> None:
    """Refuse a condensation that would not fit.

    Raises
    ------
    MethodError
        The prediction, with a safety factor, is more than what is available.
    """
    free = available_bytes()
    needed = _SAFETY * factorisation_bytes(unknowns, dimension, contact)
    if free is not None and needed > free:
        raise MethodError(
            f"the factorisation of {unknowns} unknowns, {contact} of them on the contact boundary, needs about "
            f"{_size(needed)} of memory, and {_size(free)} are free; {_REMEDY}"
        )


def shortage(problem: DiscreteProblem, condensed: bool = True) -> MethodError:
    """The error for a problem that ran out of memory all the same; ``condensed`` if it was to be factorised."""
    contact = problem.trace.nnz
    remedy = _REMEDY if condensed else "take fewer cells, or a machine with more memory"
    return MethodError(
        f"the memory gave out for {problem.unknowns} unknowns, {contact} of them on the contact boundary; {remedy}"
    )


_REMEDY = "take the multigrid method (--method multigrid), which factorises nothing of this size, or fewer cells"


def _size(amount: float) -> str:
    return f"{amount / 2.0**30:.3g} GiB" if amount >= 2.0**30 else f"{amount / 2.0**20:.3g} MiB"


def _machine_left() -> float | None:
    for line in _lines(Path("/proc/meminfo")):
        if line.startswith("MemAvailable:"):
            return 1024.0 * float(line.split()[1])
    return None


def _groups_left() -> Iterator[float]:
    """What each control group of the process, and each group above it, leaves."""
    for line in _lines(Path("/proc/self/cgroup")):
        number, controllers, path = [*line.split(":", 2), "", ""][:3]
        if number == "0" and not controllers:
            root, names = Path("/sys/fs/cgroup"), ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            root = Path("/sys/fs/cgroup/memory")
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            left = _group_left(folder, *names)
            if left is not None:
                yield left
            if folder == root:
                break


def _group_left(folder: Path, limit_file: str, used_file: str, reclaimable_key: str) -> float | None:
    limit, used = _number(folder / limit_file), _number(folder / used_file)
    if limit is None or used is None or limit >= _UNLIMITED:
        return None
    files = (line.split() for line in _lines(folder / "memory.stat"))
    reclaimable = next((float(pair[1]) for pair in files if pair[0] == reclaimable_key), 0.0)
    return limit - used + reclaimable


def _address_space_left() -> float | None:
    try:
        import resource
    except ImportError:
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    pages = next((line.split()[0] for line in _lines(Path("/proc/self/statm"))), None)
    if limit == resource.RLIM_INFINITY or pages is None:
        return None
    return float(limit) - float(pages) * resource.getpagesize()


def _number(path: Path) -> float | None:
    text = next(iter(_lines(path)), "")
    return float(text) if text.isdigit() else None


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return []
