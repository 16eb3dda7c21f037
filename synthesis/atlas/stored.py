"""Arrays of a file that is mapped: each page is compared with its checksum before something in it is used.

A page is read from the file, compared, and then its mapped twin is used. So a part of the file that cannot be read is an
error; through the map alone it would end the process. What has once been compared is trusted while the file is open.
"""

from __future__ import annotations

import math
import os
import weakref
import zlib
from collections.abc import Iterator
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

Ints = NDArray[np.int64]

PAGE = 4096
"""Bytes of a page: arrays begin at one, and each has its checksum."""
_READ_AT_ONCE = 1 << 20
_TOGETHER = 16
"""Pages that are checked together when single rows are asked for: their neighbours will be, too."""
_SMALL = 64
"""An array of at most so many pages is checked whole when it is first asked for something."""


class DamagedError(Exception):
    """A file of arrays is not what was written."""


def pages_of(file: int, first: int, count: int) -> Iterator[bytes]:
    """So many bytes of a file, page by page; short where it ends."""
    while count > 0:
        chunk = os.pread(file, min(_READ_AT_ONCE, count), first)
        for begin in range(0, len(chunk), PAGE):
            yield chunk[begin : begin + PAGE]
        if len(chunk) < min(_READ_AT_ONCE, count):
            return
        first, count = first + len(chunk), count - len(chunk)


class File:
    """A file that is open for reading until nothing uses it any more."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a pipe must not block
        weakref.finalize(self, os.close, self.handle)


class Region:
    """The pages of one array, and which of them have been compared with their checksums."""

    def __init__(self, file: File, offset: int, nbytes: int, sums: NDArray[np.uint32]) -> None:
        self.file, self.offset, self.nbytes, self.sums = file, offset, nbytes, sums
        self.checked = np.zeros(len(sums), dtype=bool)
        self._left, self._lock = len(sums), Lock()

    @property
    def whole(self) -> bool:
        """Whether nothing is left to be compared."""
        return not self._left

    def check(self, pages: Ints) -> None:
        """Compare pages, ascending and each once, with their checksums."""
        ends = np.flatnonzero(np.diff(pages) != 1) + 1
        for run in np.split(pages, ends):
            first, count = int(run[0]), len(run)
            nbytes = min(count * PAGE, self.nbytes - first * PAGE)
            try:
                found = [zlib.crc32(page) for page in pages_of(self.file.handle, self.offset + first * PAGE, nbytes)]
            except OSError as error:
                raise DamagedError(f"{self.file.path}: {error.strerror}") from None
            if len(found) < count or not np.array_equal(self.sums[run], found):
                raise DamagedError(f"{self.file.path}: a page is not what was written")
        with self._lock:  # another thread may have compared the same ones
            self._left -= len(pages) - int(np.count_nonzero(self.checked[pages]))
            self.checked[pages] = True

    def need(self, begin: int, end: int) -> None:
        """Have the bytes from ``begin`` to ``end`` checked."""
        if self.whole or begin >= end:
            return
        first, last = (0, len(self.sums)) if len(self.sums) <= _SMALL else (begin // PAGE, -(-end // PAGE))
        missing = np.flatnonzero(~self.checked[first:last])
        if missing.size:
            self.check(missing + first)

    def need_rows(self, begin: int, row_bytes: int, rows: Ints) -> None:
        """Have some rows checked, the first of all being at ``begin``."""
        if self.whole or not rows.size or not row_bytes:
            return
        if len(self.sums) <= _SMALL:
            self.need(0, self.nbytes)
            return
        at = rows.ravel() * row_bytes + begin
        first, last = at // PAGE, (at + (row_bytes - 1)) // PAGE
        if row_bytes > PAGE:  # pages between those of its begin and its end
            last = np.minimum(first[:, None] + np.arange(1, row_bytes // PAGE + 2), last[:, None]).ravel()
        missing = [pages[~self.checked[pages]] for pages in (first, last)]
        if any(pages.size for pages in missing):
            together = np.unique(np.concatenate(missing) // _TOGETHER)
            pages = (together[:, None] * _TOGETHER + np.arange(_TOGETHER)).ravel()
            self.check(pages[pages < len(self.sums)])


class Stored:
    """An array of a prepared file, used like a read-only numpy array whose rows are checked when they are asked for.

    ``array[k]`` of more than one axis and `reshape` are such arrays again; slices of rows, ``array[rows]`` and `take` are
    numpy's. Law: equal to the array that was written, or `DamagedError`.
    """

    __slots__ = ("_begin", "_region", "_values")

    def __init__(self, values: NDArray[Any], region: Region, begin: int = 0) -> None:
        self._values, self._region, self._begin = values, region, begin

    @property
    def shape(self) -> tuple[int, ...]:
        """As of an array."""
        return self._values.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """As of an array."""
        return self._values.dtype

    @property
    def nbytes(self) -> int:
        """As of an array: bytes of the file, which all processes share."""
        return self._values.nbytes

    def __len__(self) -> int:
        return len(self._values)

    @property
    def _row_bytes(self) -> int:
        return self._values.itemsize * math.prod(self._values.shape[1:])

    def reshape(self, *shape: int) -> Stored:
        """As of an array; nothing is copied."""
        return Stored(self._values.reshape(*shape), self._region, self._begin)

    def take(self, rows: ArrayLike, axis: int | None = 0, out: None = None, mode: str = "raise") -> NDArray[Any]:
        """Rows by number, none of them negative, as `numpy.take` has them along the first axis."""
        if axis not in (0, None) or (axis is None and self._values.ndim > 1):
            raise ValueError(f"rows are taken along axis 0, found {axis}")
        index = np.asarray(rows)
        self._region.need_rows(self._begin, self._row_bytes, index)
        taken: NDArray[Any] = np.take(self._values, index, axis=0, mode="clip" if mode == "clip" else "raise")
        return taken

    def __getitem__(self, rows: Any) -> Any:
        if isinstance(rows, (int, np.integer)) and self._values.ndim > 1:
            row = range(len(self))[int(rows)]
            return Stored(self._values[row], self._region, self._begin + row * self._row_bytes)
        if isinstance(rows, slice):
            begin, end, _ = slice(rows.start, rows.stop).indices(len(self))
            self._region.need(self._begin + begin * self._row_bytes, self._begin + end * self._row_bytes)
            return self._values[rows]
        if isinstance(rows, (int, np.integer)):
            return self.take(range(len(self))[int(rows)])
        index = np.asarray(rows)
        if index.dtype == bool:
            index = np.flatnonzero(index)
        return self.take(np.where(index < 0, index + len(self), index))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self[:], dtype=dtype, copy=copy)
