"""The header of an atlas file, and the SHA-256 in it of everything behind it: compared before anything is parsed."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from synthesis.atlas.table import SCHEMA
from synthesis.errors import AtlasError, AtlasFault

HEADER_BYTES = 512
MAGIC = "linkage-atlas"
Stamp = tuple[int, int]
"""Size of a file and when it was last written, in nanoseconds."""
MAX_TYPES = 8_000_000
"""Types that are read unless the caller sets another limit."""


def header_of(sha256: str, size: int) -> bytes:
    """The header of a file, by the hash and the size of what is behind it."""
    text = f"{MAGIC} {SCHEMA}\nsha256 {sha256}\nbytes {size}\n"
    return text.encode().ljust(HEADER_BYTES - 1, b" ") + b"\n"


def refuse(fault: AtlasFault, detail: str) -> None:
    """Raise that an atlas cannot be used."""
    raise AtlasError(fault, detail)


def check_bytes(data: bytes) -> memoryview:
    """The HDF5 image behind a header that it matches; AtlasError otherwise. Costs one SHA-256 and parses nothing."""
    body = memoryview(data)[HEADER_BYTES:]
    _check_header(data[:HEADER_BYTES], hashlib.sha256(body).hexdigest(), len(body))
    return body


def _check_header(head: bytes, sha256: str, size: int) -> None:
    if len(head) < HEADER_BYTES or not head.startswith(MAGIC.encode()):
        refuse(AtlasFault.SCHEMA, "its header is not an atlas's")
    if not head.startswith(f"{MAGIC} {SCHEMA}\n".encode()):
        refuse(AtlasFault.SCHEMA, f"its header names another schema than {SCHEMA}")
    if header_of(sha256, size) != head:
        refuse(AtlasFault.CHECKSUM, f"{size} bytes behind the header")


def file_hash(
    path: Path, max_bytes: int | None = None, known: Callable[[str, Stamp], bool] = lambda sha256, stamp: False
) -> str:
    """The SHA-256 in an atlas file's header, which all behind it has been compared with; nothing is parsed.

    Not all of it is read where ``known(sha256, stamp)`` says that this very file has been compared before.

    Raises `AtlasError`: missing, larger than allowed, or not what was written.
    """
    with open_atlas_file(path, max_bytes) as file:
        status = os.fstat(file.fileno())
        head = file.read(HEADER_BYTES)
        claimed = claimed_hash(head)
        whole = header_of(claimed, status.st_size - HEADER_BYTES) == head
        if whole and known(claimed, (status.st_size, status.st_mtime_ns)):
            return claimed
        file.seek(0)
        return checked_hash(file)


def claimed_hash(head: bytes) -> str:
    """The SHA-256 that a header names."""
    return head[len(f"{MAGIC} {SCHEMA}\nsha256 ") :][:64].decode("ascii", "replace")


def checked_hash(file: BinaryIO) -> str:
    """The hash in the header of a file that is read whole and compared with it, as `file_hash` has it."""
    try:
        head = file.read(HEADER_BYTES)
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]  # it has readinto
        _check_header(head, sha256, file.tell() - len(head))
    except OSError as error:
        raise AtlasError(AtlasFault.MISSING, f"{file.name}: {error.strerror}") from None
    return sha256


def open_atlas_file(path: Path, max_bytes: int | None) -> BinaryIO:
    """A regular file of at most so many bytes, open for reading."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            refuse(AtlasFault.MISSING, f"{path} is no regular file")
        if max_bytes is not None and status.st_size > max_bytes:
            refuse(AtlasFault.LIMIT, f"{status.st_size} bytes, at most {max_bytes}")
        return path.open("rb")
    except OSError as error:
        raise AtlasError(AtlasFault.MISSING, f"{path}: {error.strerror}") from None
