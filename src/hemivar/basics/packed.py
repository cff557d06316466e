"""Arrays in one file with a digest of their content: what was damaged since is not read, nor what declares too much."""

from __future__ import annotations

import hashlib
import io
import math
import zipfile
import zlib
from collections.abc import Mapping
from typing import IO

import numpy as np
from numpy.lib import format as npy

from hemivar.basics.types import AnyArray

__all__ = ["read_arrays", "write_arrays"]

_DIGEST = "digest"


def write_arrays(stream: IO[bytes], arrays: Mapping[str, AnyArray]) -> None:
    """Write arrays as an NPZ file, not compressed, with the digest of their names, types, shapes and numbers.

    The digest is one against damage. It does not protect against forgery: whoever writes a file can compute it.
    """
    plain = {name: np.asarray(array) for name, array in arrays.items()}
    np.savez(stream, **plain, **{_DIGEST: _digest(plain)})  # type: ignore[arg-type]


def read_arrays(data: bytes) -> tuple[dict[str, AnyArray], bool]:
    """The arrays that :func:`write_arrays` wrote, and whether their digest is the one in the file.

    No array is made before its declared size is found to be that of its bytes.

    Returned: ``sound``: false as well where there is no digest.
    """
    arrays: dict[str, AnyArray] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for part in archive.infolist():
                if part.compress_type != zipfile.ZIP_STORED or part.file_size > len(data):
                    raise ValueError("it is compressed")
                name = part.filename.removesuffix(".npy")
                if name in arrays:
                    raise ValueError("an array occurs twice")
                arrays[name] = _array(archive.read(part))
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, KeyError, NotImplementedError, RuntimeError) as error:
        raise ValueError(str(error)) from error
    digest = arrays.pop(_DIGEST, None)
    return arrays, digest is not None and np.array_equal(digest, _digest(arrays))


def _array(data: bytes) -> AnyArray:
    """An array of numbers or truth values, from the bytes of an NPY file."""
    stream = io.BytesIO(data)
    read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(npy.read_magic(stream))
    if read is None:
        raise ValueError("an array is of an unknown format")
    try:
        shape, by_columns, kind = read(stream)
    except (SyntaxError, TypeError, RecursionError, MemoryError) as error:
        raise ValueError("the head of an array is damaged") from error
    left = len(data) - stream.tell()
    if kind.kind not in "fiub" or min(shape, default=1) < 0 or math.prod(shape) * kind.itemsize != left:
        raise ValueError("an array has another size than it declares")
    numbers = np.frombuffer(data, dtype=kind, offset=stream.tell())
    return numbers.reshape(shape, order="F" if by_columns else "C").copy()


def _digest(arrays: Mapping[str, AnyArray]) -> AnyArray:
    """The digest, (32,) bytes."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)
