"""The build of an atlas file: shards as pure functions over an executor, resumable, and one atomic write at the end.

Data flow: rule -> lengths -> shards of 4,096 types -> `compute_shard` on any ``concurrent.futures.Executor`` -> each
result kept in ``<out>.parts`` as soon as it is there -> one HDF5 image in memory -> temporary file, fsync, rename.
A reader sees the old file or the new one, also after a kill or a full disk.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, wait
from functools import lru_cache
from pathlib import Path

import numpy as np

from synthesis.atlas.file import encode_atlas, generator_versions
from synthesis.atlas.rows import AtlasRows, compute_rows, concatenate
from synthesis.atlas.table import Atlas, AtlasRule
from synthesis.errors import FieldError
from synthesis.fourbar.dimension_types import enumerate_types

SHARD_TYPES = 4096
"""Types of one shard: the same whatever the number of workers, so that the file is the same too."""

_DIGEST_BYTES = 32
_LOOK_SECONDS = 0.1
"""Between two looks at whether the build is to stop."""


class BuildLocked(Exception):
    """Another build of the same file is running."""


# A worker keeps the list for its next shard: of millions of types, making it takes longer than a shard does.
_types = lru_cache(maxsize=1)(enumerate_types)


def compute_shard(rule: AtlasRule, shard: int) -> bytes:
    """The rows of one shard as bytes (npz), from the rule alone: the same bytes on every run, in any process."""
    lengths = _types(rule.types)[shard * SHARD_TYPES : (shard + 1) * SHARD_TYPES]
    buffer = io.BytesIO()
    np.savez(buffer, **compute_rows(lengths, rule.samples)._asdict())
    return buffer.getvalue()


def _rows(payload: bytes) -> AtlasRows:
    with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
        return AtlasRows(**arrays)


def check_target(path: Path) -> None:
    """Refuse to replace what is no regular file: devices, pipes and folders stay what they are."""
    if os.path.lexists(path) and not path.is_file():
        raise FieldError("/out", f"{path} exists and is no regular file")


def replace_file(path: Path, data: bytes | memoryview, *, durable: bool) -> None:
    """Write a file so that a reader sees the old content or all of the new one.

    The temporary file lies beside it and is removed on any failure. With ``durable`` it returns once both the bytes
    and the name are on the disk.
    """
    check_target(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    if durable:
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextlib.contextmanager
def _parts_folder(out: Path) -> Iterator[Path]:
    """The folder of finished shards, locked for this process; a kill frees the lock and keeps the shards.

    Raises
    ------
    BuildLocked
    """
    folder = out.with_name(out.name + ".parts")
    while True:
        folder.mkdir(exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # The folder may have been removed by its owner between our open and our lock; then try again.
            if folder.exists() and os.fstat(handle).st_ino == folder.stat().st_ino:
                break
        except BlockingIOError:
            os.close(handle)
            raise BuildLocked(f"another build of {out} is running") from None
        os.close(handle)
    try:
        temporary = re.compile(re.escape(f".{out.name}.") + r"\d+\.tmp")  # and not another file's: atlas.h5.new's
        for stale in out.parent.iterdir():
            if temporary.fullmatch(stale.name):
                stale.unlink(missing_ok=True)
        yield folder
    finally:
        os.close(handle)


class _Parts:
    """Finished shards on disk, each with the digest of its number, its bytes and the key of what it was made from."""

    def __init__(self, folder: Path, rule: AtlasRule) -> None:
        made_from = {"rule": rule.as_json(), "generator": generator_versions(), "shard_types": SHARD_TYPES}
        self.folder = folder
        self.key = hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).digest()

    def _path(self, shard: int) -> Path:
        return self.folder / f"shard-{shard:06d}"

    def _digest(self, shard: int, payload: bytes) -> bytes:
        return hashlib.sha256(self.key + shard.to_bytes(8, "little") + payload).digest()

    def read(self, shard: int) -> bytes | None:
        """The payload of a shard, or None where there is none of this build or it is damaged."""
        try:
            data = self._path(shard).read_bytes()
        except OSError:
            return None
        digest, payload = data[:_DIGEST_BYTES], data[_DIGEST_BYTES:]
        return payload if self._digest(shard, payload) == digest else None

    def write(self, shard: int, payload: bytes) -> None:
        path = self._path(shard)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)  # no part: where one belongs
        # Not durable: after a power cut a part fails its digest and is made again.
        replace_file(self._path(shard), self._digest(shard, payload) + payload, durable=False)


def build_atlas(
    rule: AtlasRule,
    out: Path,
    executor: Executor,
    progress: Callable[[int, int], None] = lambda done, total: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Atlas:
    """Build an atlas and write it to a file.

    Parameters
    ----------
    rule : AtlasRule
    out : Path
        Replaced atomically when everything is done; its folder must exist. A symbolic link is followed: what it points to is
        replaced.
    executor : concurrent.futures.Executor
        Runs `compute_shard`; processes, threads or a cluster's.
    progress : callable
        ``progress(done, total)`` after each shard.
    stopped : callable
        Asked a few times a second; once it is true the build ends with KeyboardInterrupt, and the shards are kept.

    Returns
    -------
    Atlas
        What was written. Law: the file has the same bytes for every executor, and after any number of kills and resumes.

    Raises
    ------
    BuildLocked
        Another process builds the same file.
    FieldError
        ``out`` exists and is no regular file.
    KeyboardInterrupt
        When it was stopped.
    OSError
        The disk is full or the place cannot be written; ``out`` is as it was.
    """

    def go_on() -> None:
        if stopped():
            raise KeyboardInterrupt

    out = out.resolve()
    check_target(out)
    lengths = enumerate_types(rule.types)
    shards = -(-len(lengths) // SHARD_TYPES)
    with _parts_folder(out) as folder:
        parts = _Parts(folder, rule)
        payloads = {shard: payload for shard in range(shards) if (payload := parts.read(shard)) is not None}
        progress(len(payloads), shards)
        pending = {
            executor.submit(compute_shard, rule, shard): shard for shard in range(shards) if shard not in payloads
        }
        try:
            left = set(pending)
            while left:
                done, left = wait(left, _LOOK_SECONDS, FIRST_COMPLETED)
                go_on()
                for future in done:
                    shard = pending[future]
                    payloads[shard] = future.result()
                    parts.write(shard, payloads[shard])
                    progress(len(payloads), shards)
        except BaseException:
            for future in pending:
                future.cancel()
            raise
        rows = [_rows(payloads.pop(shard)) for shard in range(shards)]
        table = concatenate(rows) if rows else compute_rows(lengths, rule.samples)
        atlas = Atlas(rule=rule, lengths=lengths.astype("<u2"), generator=generator_versions(), **table._asdict())
        go_on()
        image = encode_atlas(atlas)
        go_on()
        replace_file(out, image, durable=True)
        shutil.rmtree(folder)
    return atlas
