"""The build of an atlas file: shards as pure functions over an executor, resumable, and one atomic write at the end.

Data flow: rule -> shards of 4,096 types -> `compute_shard` on any ``concurrent.futures.Executor`` -> each result kept in
``<out>.parts`` as soon as it is there -> column by column, shard by shard, an HDF5 image beside them -> temporary file, fsync,
rename. A reader sees the old file or the new one, also after a kill or a full disk. Nothing holds more than some shards.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import json
import multiprocessing
import os
import re
import shutil
import signal
import threading
import zipfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.file import generator_versions, write_image
from synthesis.atlas.table import AtlasRule, compute_rows
from synthesis.errors import FieldError

# -- where the work is done ---------------------------------------------------------------------------------------------


def _start_worker() -> None:
    """Ignore interrupts, which the parent handles, and end when the parent ends, also when it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        parent.join()
        os._exit(1)

    if parent is not None:
        threading.Thread(target=follow, daemon=True).start()


class _Processes(ProcessPoolExecutor):
    """Processes that are born with interrupts blocked: one that is still importing would show a traceback."""

    def submit(self, *arguments: Any, **others: Any) -> Future[Any]:
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(*arguments, **others)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


@contextlib.contextmanager
def local_executor(jobs: int) -> Iterator[Executor]:
    """``jobs`` processes; for one job a thread, which saves the start of a process."""
    if jobs == 1:
        executor: Executor = ThreadPoolExecutor(1)
    else:
        executor = _Processes(jobs, multiprocessing.get_context("spawn"), _start_worker)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """A Dask cluster's executor; needs the extra ``[distributed]`` here and this package on the workers."""
    try:
        from distributed import Client
    except ImportError:
        raise SystemExit("--scheduler needs the extra: pip install 'linkage-atlas[distributed]'") from None
    with Client(address, timeout="10s", set_as_default=False) as client:
        yield client.get_executor()


# -- the batch ----------------------------------------------------------------------------------------------------------

SHARD_TYPES = 4096
"""Types of one shard: the same whatever the number of workers, so that the file is the same too."""

_SUBMITTED = 128
"""Shards that an executor has at a time: what waits to be written to disk is in memory."""
_PIECE_BYTES = 1 << 20
_DIGEST_BYTES = 32
_LOOK_SECONDS = 0.1
"""Between two looks at whether the build is to stop."""


class BuildLocked(Exception):
    """Another build of the same file is running."""


def compute_shard(rule: AtlasRule, shard: int) -> bytes:
    """The rows of one shard as bytes (npz), from the rule alone: the same bytes on every run, in any process."""
    buffer = io.BytesIO()
    rows = compute_rows(_lengths(rule, shard), rule.samples, rule.kind.mechanism)
    np.savez(buffer, **rows._asdict())
    return buffer.getvalue()


def _lengths(rule: AtlasRule, shard: int) -> NDArray[np.int32]:
    return rule.lengths(shard * SHARD_TYPES, (shard + 1) * SHARD_TYPES)


def check_target(path: Path) -> None:
    """Refuse to replace what is no regular file: devices, pipes and folders stay what they are."""
    if os.path.lexists(path) and not path.is_file():
        raise FieldError("/out", f"{path} exists and is no regular file")


def replace_file(path: Path, parts: Iterable[bytes], *, durable: bool) -> None:
    """Write a file so that a reader sees the old content or all of the new one.

    The temporary file lies beside it and is removed on any failure. With ``durable`` it returns once both the bytes
    and the name are on the disk.
    """
    check_target(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            for part in parts:
                file.write(part)
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


def _pieces(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while piece := file.read(_PIECE_BYTES):
            yield piece


@contextlib.contextmanager
def _parts_folder(out: Path) -> Iterator[Path]:
    """The folder of finished shards, locked for this process; a kill frees the lock and keeps the shards.

    Raises `BuildLocked`.
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

    def holds(self, shard: int) -> bool:
        """Whether there is a shard of this build that is what was written."""
        try:
            data = self._path(shard).read_bytes()
        except OSError:
            return False
        return self._digest(shard, data[_DIGEST_BYTES:]) == data[:_DIGEST_BYTES]

    def column(self, shard: int, name: str) -> NDArray[Any]:
        """A column of a shard that is there; only its bytes are read, and compared with its own checksum."""
        try:
            with self._path(shard).open("rb") as file:
                file.seek(_DIGEST_BYTES)
                with np.load(file, allow_pickle=False) as arrays:
                    found: NDArray[Any] = arrays[name]
                    return found
        except (zipfile.BadZipFile, ValueError, KeyError) as error:
            raise OSError(f"{self._path(shard)} has changed since it was written ({error}); build again") from None

    def write(self, shard: int, payload: bytes) -> None:
        path = self._path(shard)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)  # no part: where one belongs
        # Not durable: after a power cut a part fails its digest and is made again.
        replace_file(self._path(shard), [self._digest(shard, payload), payload], durable=False)


class Built(NamedTuple):
    """What has been written to an atlas file."""

    types: int
    content_sha256: str
    curve_error_max: float
    generator: dict[str, str]


def build_atlas(
    rule: AtlasRule,
    out: Path,
    executor: Executor,
    progress: Callable[[int, int], None] = lambda done, total: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Built:
    """Build an atlas and write it to a file.

    ``out``: replaced atomically when everything is done; its folder must exist. A symbolic link is followed: what it
    points to is replaced. ``executor``: runs `compute_shard`; processes, threads or a cluster's. ``progress``:
    ``progress(done, total)`` after each shard. ``stopped``: asked a few times a second; once it is true the build ends
    with KeyboardInterrupt, and the shards are kept.

    Law: the file has the same bytes for every executor, and after any number of kills and resumes.

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
    types, generator = rule.count, generator_versions()
    shards = -(-types // SHARD_TYPES)
    with _parts_folder(out) as folder:
        parts = _Parts(folder, rule)
        missing = deque(shard for shard in range(shards) if not parts.holds(shard))
        progress(shards - len(missing), shards)
        pending: dict[Future[bytes], int] = {}
        try:
            while missing or pending:
                while missing and len(pending) < _SUBMITTED:
                    shard = missing.popleft()
                    pending[executor.submit(compute_shard, rule, shard)] = shard
                done, _ = wait(pending, _LOOK_SECONDS, FIRST_COMPLETED)
                go_on()
                for future in done:
                    parts.write(pending.pop(future), future.result())
                    progress(shards - len(missing) - len(pending), shards)
        except BaseException:
            for future in pending:
                future.cancel()
            raise
        largest = 0.0

        def columns(name: str) -> Iterator[NDArray[Any]]:
            nonlocal largest
            for shard in range(shards):
                go_on()
                values = _lengths(rule, shard) if name == "lengths" else parts.column(shard, name)
                if name == "curve_error":
                    largest = max(largest, float(values.max()))
                yield values

        image = folder / "image"
        header, content = write_image(image, rule, generator, columns)
        go_on()
        replace_file(out, chain([header.encode()], _pieces(image)), durable=True)
        shutil.rmtree(folder)
    return Built(types, content, largest, generator)
