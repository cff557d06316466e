"""Mesh files in HDF5: which format they hold, and their arrays."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import AnyArray
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    import h5py  # type: ignore[import-untyped]

__all__ = ["HDF5", "arrays_of_hdf5", "format_of_hdf5", "refuse_unwritten"]

#: How files of HDF5 begin; how much an array is packed at most.
HDF5, _PACKED = b"\x89HDF\r\n\x1a\n", 1100.0
#: Formats by what stands in a file at the top, and by suffixes where h5py is missing or nothing tells.
_TOPS = {"ENS_MAA": "med", "connect1": "exodus", "coordx": "exodus"}
_SUFFIXES = {".e": "exodus", ".exo": "exodus", ".ex2": "exodus", ".cgns": "", ".h5m": "", ".hmf": ""}


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """The file; failures in one sentence."""
    try:
        with IMPORTS:
            import h5py
    except ModuleNotFoundError as error:
        raise ProblemError("its format is read with the package h5py; pip install h5py") from error
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError) as error:
        raise ProblemError("it begins like HDF5, and is cut off or damaged; save it again") from error


def format_of_hdf5(path: Path) -> str:
    """The format that a file of HDF5 holds; empty where only its name tells."""
    with contextlib.suppress(ProblemError), _opened(path) as file:
        for top, name in _TOPS.items():
            if top in file:
                return name
    return _SUFFIXES.get(path.suffix.lower(), "med")


def refuse_unwritten(path: Path) -> None:
    """Refuse arrays that are larger than what is stored of them can be."""

    def look(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if hasattr(item, "nbytes") and item.nbytes > _PACKED * (item.id.get_storage_size() + 4096):
            raise ProblemError(
                f"the array '{shown(name)}' is said to hold {item.nbytes / 2**20:.0f} MiB, and most of it was never "
                "written; save it again"
            )

    with _opened(path) as file:
        file.visititems(look)


def arrays_of_hdf5(path: Path, wanted: re.Pattern[str], attribute: str) -> tuple[dict[str, AnyArray], dict[str, str]]:
    """Arrays at the top of a file by their names, and a text that stands at some of them."""
    refuse_unwritten(path)
    with _opened(path) as file:
        own = {name: item for name, item in file.items() if wanted.fullmatch(name) and hasattr(item, "nbytes")}
        texts = {name: np.ravel(item.attrs.get(attribute, b"")).tolist()[:1] for name, item in own.items()}
        arrays = {name: np.asarray(item[()]) for name, item in own.items()}
    plain = {name: text[0] if text else b"" for name, text in texts.items()}
    return arrays, {
        name: text.decode("latin-1") if isinstance(text, bytes) else str(text) for name, text in plain.items()
    }
