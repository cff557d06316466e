"""Arrays of a VTU file: ASCII, base64 or appended, alone or in blocks of zlib or LZMA; sizes are known beforehand."""

from __future__ import annotations

import binascii
import sys
import warnings
import zlib
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.memory import size_in_words
from hemivar.basics.types import AnyArray
from hemivar.errors import ProblemError

__all__ = ["NUMBERS", "Packing", "VtuArray", "short", "whole"]

#: Types of numbers by their names in VTK.
NUMBERS = {
    "Int8": "i1", "Int16": "i2", "Int32": "i4", "Int64": "i8", "UInt8": "u1", "UInt16": "u2", "UInt32": "u4",
    "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip


class Packing:
    """How the numbers of a file are packed, and how many bytes they may unpack to."""

    def __init__(self, root: Element, appended: bytes | str, budget: int) -> None:
        little = root.get("byte_order", "LittleEndian" if sys.byteorder == "little" else "BigEndian")
        head, by = root.get("header_type", "UInt32"), root.get("compressor", "")
        if little not in ("LittleEndian", "BigEndian") or head not in ("UInt32", "UInt64"):
            raise ProblemError("its byte_order or header_type is not known; save it again")
        if by not in ("", "vtkZLibDataCompressor", "vtkLZMADataCompressor"):
            raise ProblemError(f"it is compressed by {short(by)}; save it with zlib, LZMA or uncompressed")
        self.order: Literal["<", ">"] = "<" if little == "LittleEndian" else ">"
        self.word = np.dtype(NUMBERS[head]).newbyteorder(self.order)
        self.by, self.appended, self.budget, self.declared = by, appended, budget, 0

    def array(self, element: Element, rows: int | None = None, components: int | None = None) -> VtuArray:
        """The array of an element, of so many rows if that is known; refused where all would exceed the budget."""
        array = VtuArray(self, element, components)
        self.declared += array.declared
        if self.declared > self.budget:
            raise ProblemError(
                f"it would unpack to more than {size_in_words(self.budget)}, far more than a file of its size should; "
                "save it uncompressed if it is right"
            )
        if rows is not None:
            array.expect(rows)
        return array


class VtuArray:
    """The numbers of a DataArray, of which ``declared`` bytes are known before any of them is unpacked."""

    def __init__(self, packing: Packing, element: Element, components: int | None) -> None:
        self.name = shown(element.get("Name", element.tag))[:60]
        if element.get("type") not in NUMBERS:
            raise self._wrong("is of no type of numbers that is known")
        self.packing, self.kind = packing, np.dtype(NUMBERS[element.get("type", "")])
        self.components = whole(element, "NumberOfComponents", 1) if element.get("NumberOfComponents") else components
        self.rows: int | None = None
        form = element.get("format", "ascii")
        if form not in ("ascii", "binary", "appended"):
            raise self._wrong(f"is in the format {short(form)}, which is not known")
        if form == "appended":
            self.source, self.start = packing.appended, whole(element, "offset")
        else:
            self.source, self.start = (element.text or "").strip(), 0
            element.text = None
        self.size: int | None = None  # bytes of the numbers, which ASCII does not tell
        if form == "ascii":
            self.declared = 8 * (len(self.source) // 2 + 1)
            return
        if form == "binary" and isinstance(self.source, str) and "\n" in self.source:
            self.source = "".join(self.source.split())
        self.blocks, self.whole, self.last = np.zeros(0, dtype=np.int64), 0, 0
        self.size, head = self._sizes_in_blocks() if packing.by else self._size_alone()
        self.declared = self.size + head
        if self.size % self.kind.itemsize:
            raise self._wrong("holds part of a number")

    # ---- sizes ------------------------------------------------------------------------------------------------

    def _size_alone(self) -> tuple[int, int]:
        """Bytes of the numbers and of the head; in base64 both are one text, or each is one with its own end."""
        word = self.packing.word
        head, body = self._take(self.start, word.itemsize)
        size = int(np.frombuffer(head, word)[0])
        padding = "=" * (-word.itemsize % 3)
        joined = isinstance(self.source, str) and not self.source[self.start : body].endswith(padding)
        self.skipped = word.itemsize if joined else 0
        self.start = self.start if joined else body
        if size > len(self.source):
            raise self._wrong("is cut off")
        return size, len(head)

    def _sizes_in_blocks(self) -> tuple[int, int]:
        """The same of blocks: their number, the size of each and of the last one (0 for that of each), packed sizes."""
        word = self.packing.word
        count, each, last = (int(n) for n in np.frombuffer(self._take(self.start, 3 * word.itemsize)[0], word))
        if count > len(self.source) or (count and not each):
            raise self._wrong("has a head that is damaged")
        head, self.start = self._take(self.start, (3 + count) * word.itemsize)
        self.blocks, self.whole, self.last = np.frombuffer(head, word)[3:], each, last or each
        return (count - 1) * each + self.last if count else 0, len(head)

    def _take(self, start: int, count: int) -> tuple[bytes, int]:
        """Bytes that lie at a place, and the place behind them."""
        if isinstance(self.source, bytes):
            end = start + count
            raw = self.source[start:end]
        else:
            end = start + 4 * -(-count // 3)
            try:
                raw = binascii.a2b_base64(self.source[start:end], strict_mode=True)[:count]
            except ValueError:
                raise self._wrong("is no base64") from None
        if len(raw) < count:
            raise self._wrong("is cut off")
        return raw, end

    def expect(self, rows: int) -> None:
        """Refuse another number of rows; what is in ASCII is counted when it is read."""
        self.rows = rows
        if self.size is not None:
            self._count(self.size // self.kind.itemsize)

    def _count(self, numbers: int) -> None:
        if self.rows is not None and numbers != self.rows * (self.components or 1):
            raise self._wrong(f"has not the {self.rows} rows that it should")
        if numbers % (self.components or 1):
            raise self._wrong("has not as many numbers as its components ask for")

    # ---- numbers ----------------------------------------------------------------------------------------------

    def read(self) -> AnyArray:
        """The numbers, (rows,) where the file states no number of components, otherwise (rows, components)."""
        values = self._of_text() if self.size is None else self._of_bytes(self.size)
        self._count(values.size)
        return values if self.components is None else values.reshape(-1, self.components)

    def _of_text(self) -> AnyArray:
        wide = np.dtype({"f": "f8", "i": "i8", "u": "u8"}[self.kind.kind])
        values: AnyArray = np.zeros(0, wide)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                if self.source:
                    values = np.fromstring(self.source, wide, sep=" ")  # type: ignore[call-overload]
        except (DeprecationWarning, ValueError):
            raise self._wrong("holds an entry that is not a number") from None
        if wide.kind != "f" and values.size:
            limits = np.iinfo(self.kind)
            if values.min() < limits.min or values.max() > limits.max:
                raise self._wrong("holds numbers that are too large for its type")
        with np.errstate(over="ignore"):
            return values.astype(self.kind, copy=False)

    def _of_bytes(self, size: int) -> AnyArray:
        stored = self.kind.newbyteorder(self.packing.order)
        if not self.packing.by:
            raw = self._take(self.start, self.skipped + size)[0]
            return np.frombuffer(raw, stored, offset=self.skipped).astype(self.kind, copy=False)
        room, done, start, lengths = np.empty(size, dtype=np.uint8), 0, 0, self.blocks.tolist()
        packed = memoryview(self._take(self.start, sum(lengths))[0])
        for number, length in enumerate(lengths):
            wanted = self.whole if number < len(lengths) - 1 else self.last
            block = self._unpacked(packed[start : start + length], wanted)
            room[done : done + wanted] = np.frombuffer(block, dtype=np.uint8)
            start, done = start + length, done + wanted
        return room.view(stored).astype(self.kind, copy=False)

    def _unpacked(self, packed: memoryview, size: int) -> bytes:
        """One block, never unpacked further than one byte beyond the size that it should have."""
        try:
            if self.packing.by == "vtkZLibDataCompressor":
                inflater = zlib.decompressobj()
                block, ended = inflater.decompress(packed, size + 1), inflater.eof
            else:
                block, ended = _by_lzma(packed, size + 1)
        except zlib.error:
            block, ended = b"", False
        if len(block) != size or not ended:
            raise self._wrong("is damaged, or unpacks to another size than it says")
        return block

    def _wrong(self, why: str) -> ProblemError:
        return ProblemError(f"its array '{self.name}' {why}; save it again")


def _by_lzma(packed: memoryview, most: int) -> tuple[bytes, bool]:
    """What LZMA unpacks, and whether it ended."""
    try:
        import lzma
    except ImportError:
        raise ProblemError("it is compressed by LZMA, which this Python lacks; save it with zlib") from None
    try:
        opened = lzma.LZMADecompressor(memlimit=128 * 2**20)  # its strongest preset takes 65 MiB
        return opened.decompress(packed, most), opened.eof
    except lzma.LZMAError:
        return b"", False


def whole(element: Element, name: str, least: int = 0) -> int:
    """A count that an element states."""
    text = (element.get(name) or "").strip()
    if not (text.isascii() and text.isdigit() and len(text) < 16 and int(text) >= least):
        raise ProblemError(f"its {name} is {short(text)}, which is not a count; save it again")
    return int(text)


def short(text: str | None) -> str:
    """A text of a file for messages."""
    return f"'{shown(text)[:30]}'"
