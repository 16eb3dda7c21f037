"""A file of named arrays that is mapped, not read: what the scan of an atlas needs, prepared once and shared by processes.

    first page     what the file is, its size, where its directory lies, and a checksum of this page
    arrays         each from a new page on, little-endian
    checksums      CRC-32 of every page of the arrays
    directory      JSON: the key, what else is known about it, type, shape and place of every array

The *key* says what the arrays were computed from and by what; a file with another key is not used. A file is written whole
or not at all: under another name, then renamed. First page, checksums and directory are checked when it is opened, a page
of an array when something in it is first asked for: it is read from the file and compared before its mapped twin is used.
(A part of the file that cannot be read is an error that way; through the map alone it would end the process.) So opening
takes no longer for large files, processes share the pages, and no answer comes from a page that is not what was written.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import logging
import math
import mmap
import os
import stat
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event, Lock
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.atlas.series import New
from synthesis.atlas.stored import PAGE, DamagedError, File, Region, Stored, pages_of

LAYOUT = 1
"""Version of how the file is laid out."""
_MAGIC = "linkage-atlas prepared"
_ZEROS = bytes(1 << 20)
_PATIENCE = 0.01
"""Seconds between two looks at whether another process has finished."""

log = logging.getLogger("linkage_atlas")


_UNUSABLE = (DamagedError, OSError, ValueError, KeyError, TypeError)
"""What opening a file raises that is damaged, foreign, or cannot be read."""


def _sealed(text: str) -> bytes:
    """The first page: a text and its checksum."""
    body = text.encode().ljust(PAGE - 4, b" ")
    return body + zlib.crc32(body).to_bytes(4, "little")


def _up(offset: int) -> int:
    """The next page's begin."""
    return -(-offset // PAGE) * PAGE


# -- reading ----------------------------------------------------------------------------------------------------------


class Prepared:
    """An open file of arrays; it is closed when nothing uses it any more.

    Attributes
    ----------
    path : Path
    about : dict
        What its writer stated beside the key.
    arrays : dict of str to Stored
    nbytes : int
        Of the file.
    """

    def __init__(self, path: Path, key: Mapping[str, Any]) -> None:
        self.path = path
        self._file = File(path)
        self.handle = self._file.handle
        directory, sums = self._checked(key)
        self._map = mmap.mmap(self.handle, self.nbytes, access=mmap.ACCESS_READ)
        self.about: dict[str, Any] = directory["about"]
        self.arrays = {name: self._array(sums, *place) for name, place in directory["arrays"].items()}

    def _checked(self, key: Mapping[str, Any]) -> tuple[dict[str, Any], NDArray[np.uint32]]:
        """The directory and the checksums of a whole file of this key; DamagedError otherwise."""
        status = os.fstat(self.handle)
        if not stat.S_ISREG(status.st_mode):
            raise DamagedError(f"{self.path}: no regular file")
        page = os.pread(self.handle, PAGE, 0)
        if not page.startswith(f"{_MAGIC} {LAYOUT}\n".encode()):
            raise DamagedError(f"{self.path}: no prepared arrays of layout {LAYOUT}")
        if _sealed(page[:-4].decode("utf-8", "replace").rstrip(" ")) != page:
            raise DamagedError(f"{self.path}: its first page is not what was written")
        head = json.loads(page[:-4].partition(b"\n")[2])
        self.nbytes: int = head["bytes"]
        if status.st_size != self.nbytes:
            raise DamagedError(f"{self.path}: cut off, or longer than what was written")
        texts = []
        for offset, size, checksum in (head["directory"], head["sums"]):
            text = b"".join(pages_of(self.handle, offset, size))
            if zlib.crc32(text) != checksum:
                raise DamagedError(f"{self.path}: its directory is not what was written")
            texts.append(text)
        directory = json.loads(texts[0])
        if directory["key"] != json.loads(json.dumps(key)):
            raise DamagedError(f"{self.path}: made from something else, or by another version")
        return directory, np.frombuffer(texts[1], dtype="<u4")

    def _array(self, sums: NDArray[np.uint32], kind: str, shape: list[int], offset: int) -> Stored:
        dtype, count = np.dtype(kind), math.prod(shape)
        nbytes = count * dtype.itemsize
        first = offset // PAGE - 1
        own = sums[first : first + _up(nbytes) // PAGE]
        if offset % PAGE or offset < PAGE or len(own) * PAGE != _up(nbytes):
            raise DamagedError(f"{self.path}: an array lies outside of it")
        values: NDArray[Any] = np.empty(shape, dtype=dtype)
        if count:
            values = np.frombuffer(self._map, dtype, count, offset).reshape(shape)
        return Stored(values, Region(self._file, offset, nbytes, own))

    def drop(self) -> None:
        """Remove the file, unless it has been replaced meanwhile; what is open stays open."""
        with contextlib.suppress(OSError):
            if os.path.samestat(os.stat(self.path), os.fstat(self.handle)):
                self.path.unlink()


def open_prepared(path: Path, key: Mapping[str, Any]) -> Prepared | None:
    """The arrays of a file; None where there is no whole file of this key, which is logged unless it is missing."""
    try:
        return Prepared(path, key)
    except FileNotFoundError:
        return None
    except _UNUSABLE as error:
        log.warning("%s", error)
        return None


# -- writing ----------------------------------------------------------------------------------------------------------


class Writer:
    """Arrays of a file that is being written."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._end = PAGE
        self._lock = Lock()
        self._arrays: dict[str, tuple[str, tuple[int, ...], int]] = {}

    def new(self, name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
        """An array to be filled: a part of the file, so it takes no memory that the system could not take back.

        Raises
        ------
        OSError
            The disk is full.
        """
        kind = np.dtype(dtype).newbyteorder("<")
        count = math.prod(shape)
        with self._lock:
            if name in self._arrays:
                raise ValueError(f"there is an array {name!r}")
            offset, self._end = self._end, self._end + _up(count * kind.itemsize)
            self._arrays[name] = (kind.str, shape, offset)
        return _to_be_filled(self._handle, offset, kind, shape)

    def put(self, name: str, values: NDArray[Any]) -> None:
        """An array that is there."""
        self.new(name, values.dtype, values.shape)[...] = values

    def finish(self, key: Mapping[str, Any], about: Mapping[str, Any]) -> None:
        """Write what makes the arrays a file."""
        sums = np.zeros(self._end // PAGE - 1, dtype="<u4")
        for kind, shape, offset in self._arrays.values():
            first, nbytes = offset // PAGE - 1, np.dtype(kind).itemsize * math.prod(shape)
            for k, page in enumerate(pages_of(self._handle, offset, nbytes)):
                sums[first + k] = zlib.crc32(page)
        texts = (json.dumps({"key": key, "about": about, "arrays": self._arrays}).encode(), sums.tobytes())
        places, end = [], self._end
        for text in texts:
            places.append((end, len(text), zlib.crc32(text)))
            _write(self._handle, text, end)
            end += len(text)
        head = json.dumps({"bytes": end, "directory": places[0], "sums": places[1]})
        _write(self._handle, _sealed(f"{_MAGIC} {LAYOUT}\n{head}"), 0)


def _to_be_filled(handle: int, offset: int, kind: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """An array in a part of a file."""
    count = math.prod(shape)
    if not count:
        return np.empty(shape, dtype=kind)
    nbytes = _up(count * kind.itemsize)
    reserve(handle, offset, nbytes)
    pages = mmap.mmap(handle, nbytes, access=mmap.ACCESS_WRITE, offset=offset)
    return np.frombuffer(pages, kind, count).reshape(shape)


def temporary(folder: Path) -> New:
    """Arrays in files of a folder that have no name and vanish with them: as of `Writer.new` they take no memory for good."""

    def new(name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
        with TemporaryFile(dir=folder) as file:
            return _to_be_filled(file.fileno(), 0, np.dtype(dtype), shape)

    return new


def reserve(handle: int, offset: int, nbytes: int) -> None:
    """Have a part of a file on the disk: writing to the map of a part that finds no place there would end the process."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(handle, offset, nbytes)
        return
    for first in range(offset, offset + nbytes, len(_ZEROS)):
        _write(handle, _ZEROS[: offset + nbytes - first], first)


def _write(handle: int, data: bytes, offset: int) -> None:
    left = memoryview(data)
    while left:
        written = os.pwrite(handle, left, offset)
        left, offset = left[written:], offset + written


def make_prepared(
    path: Path,
    key: Mapping[str, Any],
    fill: Callable[[Writer], Mapping[str, Any]],
    go_on: Callable[[], None] = lambda: None,
) -> Prepared:
    """The arrays of a file, written first where there is no whole one of this key.

    Of several processes one writes, and the others wait for it. One that is killed leaves a temporary file beside ``path``, which
    the next one overwrites.

    Parameters
    ----------
    path : Path
    key : mapping
        JSON values.
    fill : callable
        ``fill(writer)`` puts the arrays in and returns what is to be known about them, JSON values.
    go_on : callable
        Called again and again while another process writes; what it raises ends the waiting.

    Raises
    ------
    OSError
        The place cannot be written, or the disk is full; ``path`` is as it was.
    """
    with contextlib.suppress(*_UNUSABLE):
        return Prepared(path, key)
    found = None
    while found is None:
        temporary = path.with_name(f".{path.name}.tmp")
        handle = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            _lock(handle, go_on)
            with contextlib.suppress(*_UNUSABLE):
                return Prepared(path, key)  # another process has written it meanwhile
            try:
                mine = os.path.samestat(os.stat(temporary), os.fstat(handle))
            except FileNotFoundError:
                mine = False
            if mine:  # else who had it has finished, or given up
                _fill(handle, temporary, path, key, fill)
                found = Prepared(path, key)
        finally:
            os.close(handle)
    return found


def _lock(handle: int, go_on: Callable[[], None]) -> None:
    while True:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        go_on()
        Event().wait(_PATIENCE)


def _fill(
    handle: int,
    temporary: Path,
    path: Path,
    key: Mapping[str, Any],
    fill: Callable[[Writer], Mapping[str, Any]],
) -> None:
    try:
        os.ftruncate(handle, 0)
        writer = Writer(handle)
        writer.finish(key, fill(writer))
        # No fsync, which a start would wait for: what a power failure leaves out is noticed like any damage, and made anew.
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
