"""The index of an atlas file: what its scan needs, as plain `.npy` files in a folder, which processes map and share.

    atlas.h5.index/cells/           types and cells, made when a scan is first wanted
                   positions/       series of e^{i theta2}, made for the first request with positions
                   short_spans/     the index of windows of short spans
                   rocker_cells/    the same as cells, for the rockers' curves

Each of these *parts* has a file for each array and a `manifest.json`: the key, what else is known about the arrays, and type,
shape, size and SHA-256 of each. The key is the SHA-256 of the atlas file and `VERSION`; a part of another key is made anew. A
part is made by one process, in a temporary folder that is then renamed, so a reader sees all of it or none. Where it cannot be
written it is made in memory.

When a part is opened its key, the sizes of its files, their types and shapes and the manifest itself are checked: that reads
none of the arrays. The hashes are compared by `check_index`, for ``linkage-atlas verify``.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import logging
import math
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.atlas.cells import New
from synthesis.atlas.header import Stamp
from synthesis.errors import AtlasError, AtlasFault

VERSION = 1
"""Of what is indexed: raised by every change that makes other numbers of the same atlas, or names them otherwise."""
_MANIFEST = "manifest.json"
_PATIENCE = 0.01
"""Seconds between two looks at whether another process has finished."""
_ZEROS = bytes(1 << 20)

log = logging.getLogger("linkage_atlas")


class Part(NamedTuple):
    """Arrays by name, and what else is known about them (JSON values)."""

    about: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


Fill = Callable[[New, Path | None], Mapping[str, Any]]
"""``fill(new, folder)`` makes the arrays of a part and tells about them; the folder is for temporary files, None in memory."""


def _go_on() -> None:
    """Nothing ends the waiting."""


class InMemory:
    """Parts that are made in memory."""

    @property
    def folders(self) -> list[Path]:
        """Of the parts that are in use: none."""
        return []

    def known(self, name: str) -> Part | None:
        """A part that has been made before."""
        return None

    def part(self, name: str, fill: Fill, go_on: Callable[[], None] = _go_on) -> Part:
        """A part, made unless that has been done before; ``go_on`` is asked while another process makes it, and may raise."""
        return _filled(lambda name, dtype, shape: np.empty(shape, dtype), fill)


def _filled(new: New, fill: Fill) -> Part:
    arrays: dict[str, NDArray[Any]] = {}

    def kept(name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
        arrays[name] = new(name, dtype, shape)
        return arrays[name]

    return Part({**fill(kept, None)}, arrays)


class Index(InMemory):
    """Parts that lie in a folder, and in memory where that cannot be written.

    ``source``: what the parts are made from: the SHA-256 of the atlas file. ``stamp``: of the atlas file, which is kept
    with what is made from it, see `knows_source`. ``prefix``: of the names of the parts.
    """

    def __init__(self, folder: Path, source: str, stamp: Stamp | None = None, prefix: str = "") -> None:
        self.folder, self.source, self.stamp, self.prefix = folder, source, stamp, prefix
        self._key = {"atlas": source, "version": VERSION}
        self._open: dict[Path, Part] = {}
        self._faults: dict[Path, Exception] = {}

    @property
    def folders(self) -> list[Path]:
        """Of the parts that are in use."""
        return list(self._open)

    @property
    def knows_source(self) -> bool:
        """Whether a part in use was made from an atlas file of this size and time of writing, which was compared then."""
        return any(part.about["stamp"] == list(self.stamp or ()) for part in self._open.values())

    def beside(self, prefix: str, source: str | None = None) -> Index:
        """Parts of another table in the same folder, made from the same atlas unless another ``source`` is told."""
        return type(self)(self.folder, source or self.source, self.stamp, prefix)

    def known(self, name: str) -> Part | None:
        """A part that is there, whole and of this key; why one is none is logged where another is made in its place."""
        path = self.folder / (self.prefix + name)
        if path in self._open:
            return self._open[path]
        try:
            part = _opened(path, self._key)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError, KeyError, TypeError) as error:
            self._faults[path] = error
            return None
        self._faults.pop(path, None)
        self._open[path] = part
        return part

    def part(self, name: str, fill: Fill, go_on: Callable[[], None] = _go_on) -> Part:
        """As of `InMemory`, from files, which are made where there are none; in memory where none can be written."""
        known, path = self.known(name), self.folder / (self.prefix + name)
        if fault := self._faults.get(path):
            log.warning("%s is made anew: %s", path, fault)
        try:
            return known or self._made(name, fill, go_on)
        except OSError as error:
            log.warning("%s%s of the index is made in memory: %s", self.prefix, name, error)
            return super().part(name, fill)

    def _made(self, name: str, fill: Fill, go_on: Callable[[], None]) -> Part:
        path = self.folder / (self.prefix + name)
        self.folder.mkdir(exist_ok=True)
        handle = os.open(path.with_name(f".{path.name}.lock"), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            _lock(handle, go_on)
            part = self.known(name)  # another process may have made it meanwhile
            if part is None:
                _make(path, self._key, fill, self.stamp)
                part = self.known(name)
        finally:
            os.close(handle)
        if part is None:
            raise OSError(f"{path} is not what was written")
        return part


class Unread(Index):
    """In place of an index whose files cannot be read: parts made for this process alone, in files that vanish with it."""

    def known(self, name: str) -> Part | None:
        """None: what lies in the folder is left alone."""
        return None

    def part(self, name: str, fill: Fill, go_on: Callable[[], None] = _go_on) -> Part:
        """As of `InMemory`, but in memory only where no file can be written."""
        with contextlib.suppress(OSError):
            return _filled(temporary_arrays(self.folder.parent), fill)
        return InMemory.part(self, name, fill)


def _opened(path: Path, key: Mapping[str, Any]) -> Part:
    """A part of a key, mapped. Raises ValueError, KeyError or TypeError where it is none."""
    manifest = _manifest_of(path)
    if manifest["key"] != key:
        raise ValueError("made from something else, or by another version")
    arrays = {}
    for name, told in manifest["arrays"].items():
        file = path / f"{name}.npy"
        if file.stat().st_size != told["bytes"]:
            raise ValueError(f"{file.name} is cut off, or longer than what was written")
        arrays[name] = _mapped(file, np.dtype(told["dtype"]), tuple(told["shape"]), "r")
    return Part(manifest["about"], arrays)


def _manifest_of(path: Path) -> Any:
    whole = json.loads((path / _MANIFEST).read_bytes())
    if _hash_of(whole["part"]) != whole["sha256"]:
        raise ValueError(f"{_MANIFEST} is not what was written")
    return whole["part"]


def _hash_of(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def check_index(folder: Path) -> int:
    """Compare all files of an index with the hashes of their manifests; returns how many there are, none without an index.

    Raises `AtlasError`: a file is not what was written.
    """
    count = 0
    for file, whole in _compared(folder):
        if not whole:
            raise AtlasError(
                AtlasFault.CHECKSUM, f"of its index {file}; remove {file.parent}, and the next start makes it anew"
            )
        count += 1
    return count


def remove_damaged(folder: Path) -> None:
    """Remove the parts of an index of which a file is not what was written; the next that needs one makes it anew."""
    for part, file in {file.parent: file for file, whole in _compared(folder) if not whole}.items():
        log.warning("%s is removed: %s is not what was written", part, file.name)
        shutil.rmtree(part, ignore_errors=True)


def _compared(folder: Path) -> Iterator[tuple[Path, bool]]:
    """The files of an index, and whether each has the hash that its manifest tells; of a damaged manifest that one alone."""
    for manifest in sorted(folder.glob(f"*/{_MANIFEST}")):
        part = manifest.parent
        try:
            arrays = _manifest_of(part)["arrays"]
        except (OSError, ValueError, KeyError, TypeError):
            yield manifest, False
            continue
        for name, told in arrays.items():
            file = part / f"{name}.npy"
            yield file, _file_hash(file) == told["sha256"]


def _file_hash(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return "unreadable"


# -- writing -----------------------------------------------------------------------------------------------------------


def _lock(handle: int, go_on: Callable[[], None]) -> None:
    while True:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        go_on()
        Event().wait(_PATIENCE)


def _make(path: Path, key: Mapping[str, Any], fill: Fill, stamp: Stamp | None) -> None:
    """Write a part by way of a temporary folder; what a killed process has left of one is removed, too."""
    temporary = path.with_name(f".{path.name}.tmp")
    for stale in (temporary, path):
        if stale.exists():
            shutil.rmtree(stale)

    arrays: dict[str, dict[str, Any]] = {}

    def new(name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
        values = _new_file(temporary / f"{name}.npy", np.dtype(dtype), shape)
        arrays[name] = {"dtype": values.dtype.str, "shape": values.shape}
        return values

    try:
        temporary.mkdir()
        about = {**fill(new, temporary), "stamp": stamp}
        for name, told in arrays.items():
            file = temporary / f"{name}.npy"
            told |= {"bytes": file.stat().st_size, "sha256": _file_hash(file)}
        part = json.loads(json.dumps({"key": key, "about": about, "arrays": dict(sorted(arrays.items()))}))
        (temporary / _MANIFEST).write_text(json.dumps({"sha256": _hash_of(part), "part": part}))
        # No fsync, which a start would wait for: what a power failure leaves out is mostly noticed by its size.
        temporary.rename(path)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """What a ``.npy`` file of an array begins with."""
    written = BytesIO()
    described = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(written, described)
    return written.getvalue()


def _mapped(path: Path, dtype: np.dtype[Any], shape: tuple[int, ...], mode: Literal["r", "r+"]) -> NDArray[Any]:
    """The array in a ``.npy`` file of a type and shape that are known, mapped; ValueError where its header says otherwise.

    `numpy.load` would parse the header as Python, which CPython 3.11 does not stand on two threads at once.
    """
    header = _header(dtype, shape)
    with path.open("rb") as file:
        if file.read(len(header)) != header:
            raise ValueError(f"{path.name} is not what was written")
    return np.asarray(np.memmap(path, dtype, mode, len(header), shape))


def _new_file(path: Path, dtype: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """An array to be filled that is a mapped file, so it takes no memory that the system could not take back.

    Raises `OSError`: the disk is full.
    """
    dtype = dtype.newbyteorder("<")
    header = _header(dtype, shape)
    with path.open("xb") as file:
        file.write(header)
        file.flush()
        reserve(file.fileno(), len(header), dtype.itemsize * math.prod(shape))
    return _mapped(path, dtype, shape, "r+")


def temporary_arrays(folder: Path) -> New:
    """Arrays in files of a folder that have no name and vanish with them; like those of a part they take no memory for good."""

    def new(name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
        nbytes = np.dtype(dtype).itemsize * math.prod(shape)
        if not nbytes:
            return np.empty(shape, dtype)
        with TemporaryFile(dir=folder) as file:
            reserve(file.fileno(), 0, nbytes)
            return np.asarray(np.memmap(file, dtype, "r+", shape=shape))

    return new


def reserve(handle: int, offset: int, nbytes: int) -> None:
    """Have a part of a file on the disk: writing to the map of a part that finds no place there would end the process."""
    if not nbytes:
        return
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(handle, offset, nbytes)
        return
    while nbytes > 0:
        written = os.pwrite(handle, _ZEROS[:nbytes], offset)
        offset, nbytes = offset + written, nbytes - written
