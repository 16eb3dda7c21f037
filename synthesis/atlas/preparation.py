"""What a scan needs of a table, made once: cells of its types and, when a request has positions, series for those.

In memory here; `index` keeps the same in files that processes share.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event, Lock
from typing import IO, Any, NamedTuple

import numpy as np

from synthesis.atlas.cells import Cells, make_cells
from synthesis.atlas.path_storeys import PATH_STOREYS, build_path_storey
from synthesis.atlas.prepared import temporary
from synthesis.atlas.series import (
    COLUMNS,
    Bucket,
    Ints,
    New,
    Phasors,
    in_memory,
    join,
    prepare,
    prepare_phasors,
)
from synthesis.atlas.stored import DamagedError
from synthesis.atlas.storeys import STOREYS, StoreyIndex, build_storey
from synthesis.atlas.table import Table
from synthesis.work import OutOfTime, Work

PREPARED_AT_ONCE = 512
MOST_IN_MEMORY = 1 << 19
"""Types up to which indexes of windows are made in memory, where no file of them can be written: up to 6 kB for each."""
_PATIENCE = 0.01
"""Seconds between two looks at whether an answer is still wanted."""

Key = tuple[int, int]
"""Winding and harmonics of a bucket."""
Progress = Callable[[int, int], None]


class Kind(NamedTuple):
    """Which series a scan holds, see `scan.Scan`."""

    series_error: float
    harmonics: tuple[int, ...]
    cells: bool = True


class Preparation:
    """Cells and position series of a table, in memory.

    Parameters
    ----------
    table : Table
    kind : Kind
    threads : int
        Threads of the preparation.
    """

    def __init__(self, table: Table, kind: Kind, threads: int = 1) -> None:
        self.kind = kind
        self.threads = threads
        self.phasors: list[Phasors] = []
        self.storeys: list[StoreyIndex] = []
        self.path_storeys: list[StoreyIndex] = []
        self._lock, self._storeys_lock = Lock(), Lock()
        self.table, self.cells = self._prepared(table)

    def _prepared(self, table: Table) -> tuple[Table, list[Cells]]:
        """The table and the cells to be used."""
        return table, list(all_cells(table, self.kind, self.threads))

    @property
    def nbytes(self) -> int:
        """Bytes of the series and cells, wherever they are."""
        arrays = [value for cells in self.cells for value in vars(cells.bucket).values()]
        arrays += [value for phasors in self.phasors for value in vars(phasors).values()]
        own = sum(value.nbytes for value in arrays if hasattr(value, "nbytes"))
        own += sum(cells.nbytes for cells in self.cells)
        own += sum(index.nbytes for index in (*self.storeys, *self.path_storeys))
        return len(self.table) * 32 + own

    def prepare_positions(self, work: Work) -> bool:
        """Make the series that requests with positions need; done by the first of them otherwise.

        Returns
        -------
        bool
            Whether they are there; false where the work's time ran out, also while another thread was making them.
        """
        if self.phasors:
            return True
        while not self._lock.acquire(timeout=_PATIENCE):
            if work.expired():
                return False
        try:
            if not self.phasors:  # else another thread has made them meanwhile
                self.phasors = self._positions(work)
        finally:
            self._lock.release()
        return bool(self.phasors)

    def _positions(self, work: Work) -> list[Phasors]:
        """The series for positions of all buckets; none where the time ran out."""
        return all_phasors(self.table, self.cells, self.threads, work)

    def prepare_short_spans(self, work: Work) -> None:
        """Make the index of windows that answers short spans sooner; without it the cells answer them.

        Raises
        ------
        OutOfTime
        """
        with self._storeys_lock:
            if not self.storeys:
                self.storeys = self._short_spans(work)

    def _short_spans(self, work: Work) -> list[StoreyIndex]:
        if len(self.table) > MOST_IN_MEMORY:
            return []
        buckets = [cells.bucket for cells in self.cells]
        return [StoreyIndex(storey, build_storey(storey, buckets, go_on=work.go_on)) for storey in STOREYS]

    def prepare_paths(self, work: Work) -> None:
        """Make the index of shapes that answers positions without rotation sooner; without it all windows are compared.

        Raises
        ------
        OutOfTime
        """
        if not self.prepare_positions(work):
            raise OutOfTime
        with self._storeys_lock:
            if not self.path_storeys:
                self.path_storeys = self._paths(work)

    def _paths(self, work: Work) -> list[StoreyIndex]:
        if len(self.table) > MOST_IN_MEMORY:
            return []
        buckets = [cells.bucket for cells in self.cells]
        made = (build_path_storey(storey, buckets, self.phasors, go_on=work.go_on) for storey in PATH_STOREYS)
        return [StoreyIndex(storey, arrays) for storey, arrays in zip(PATH_STOREYS, made)]

    def renew(self, seen: list[Cells], damage: DamagedError) -> None:
        """Prepare everything anew after damage to the cells that were ``seen``, unless that has been done since."""
        raise damage


def all_cells(
    table: Table,
    kind: Kind,
    threads: int,
    new_of: Callable[[Key], New] = lambda key: in_memory,
    spool: Path | None = None,
    progress: Progress = lambda done, total: None,
) -> Iterator[Cells]:
    """Cells of all buckets of a table, in the order of their keys.

    Parameters
    ----------
    new_of : callable
        Where the arrays of a bucket lie.
    spool : Path, optional
        Folder for temporary files: series lie there, and not in memory, until their bucket is put in order.
    progress : callable
        ``progress(done, total)`` in types, each of which is counted when it has its series and again in its cells.
    """
    total, done = 2 * len(table), 0
    parts = [
        np.arange(first, min(first + PREPARED_AT_ONCE, len(table)))
        for first in range(0, len(table), PREPARED_AT_ONCE)
    ]
    shares: dict[Key, _Shares] = {}
    with ThreadPoolExecutor(threads) as pool:
        for buckets in _ahead(pool, partial(_series, table, kind), parts, 4 * threads):
            for bucket in buckets:
                key = (bucket.winding, bucket.harmonics)
                if key not in shares:
                    shares[key] = _Shares() if spool is None else _SpooledShares(spool)
                shares[key].add(bucket)
                done += len(bucket.rows)
            progress(done, total)

        def cells_of(key: Key) -> Cells:
            bucket = shares.pop(key).joined()
            if not kind.cells:
                return Cells(bucket, np.array([0, len(bucket.rows)]), [])
            return make_cells(bucket, new_of(key), in_memory if spool is None else temporary(spool))

        for cells in pool.map(cells_of, sorted(shares)):
            done += len(cells.bucket.rows)
            progress(done, total)
            yield cells


def _series(table: Table, kind: Kind, rows: Ints) -> list[Bucket]:
    return list(prepare(table, rows, kind.series_error, kind.harmonics))


def _ahead(pool: Executor, work: Callable[[Any], Any], parts: list[Any], most: int) -> Iterator[Any]:
    """The results for all parts in order, never more than ``most`` of them computed ahead."""
    running = [pool.submit(work, part) for part in parts[:most]]
    for k in range(len(parts)):
        yield running[k % most].result()
        if k + most < len(parts):
            running[k % most] = pool.submit(work, parts[k + most])


class _Shares:
    """Parts of a bucket, in memory."""

    def __init__(self) -> None:
        self._parts: list[Bucket] = []

    def add(self, part: Bucket) -> None:
        self._parts.append(part)

    def joined(self) -> Bucket:
        bucket = join(self._parts)
        self._parts.clear()
        return bucket


class _SpooledShares(_Shares):
    """Parts of a bucket, in temporary files that vanish with the process."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._files: dict[str, IO[bytes]] = {name: TemporaryFile(dir=folder) for name in COLUMNS}

    def add(self, part: Bucket) -> None:
        if not self._parts:
            self._parts.append(part)
        for name, file in self._files.items():
            file.write(np.ascontiguousarray(getattr(part, name)).data)

    def joined(self) -> Bucket:
        columns: dict[str, Any] = {}
        for name, file in self._files.items():
            first = getattr(self._parts[0], name)
            file.flush()
            columns[name] = np.memmap(file, first.dtype, "r").reshape(-1, *first.shape[1:])
            file.close()
        return Bucket(winding=self._parts[0].winding, harmonics=self._parts[0].harmonics, **columns)


def all_phasors(
    table: Table, cells: list[Cells], threads: int, work: Work, new_of: Callable[[Key], New] = lambda key: in_memory
) -> list[Phasors]:
    """The series for positions of all buckets; none where the work's time ran out."""
    given_up = Event()
    with ThreadPoolExecutor(threads) as pool:
        made = [
            pool.submit(
                prepare_phasors,
                table,
                one.bucket,
                PREPARED_AT_ONCE,
                given_up,
                new_of((one.bucket.winding, one.bucket.harmonics)),
            )
            for one in cells
        ]
        try:
            while made and wait(made, _PATIENCE).not_done:
                if work.expired():
                    given_up.set()
                    return []
        except BaseException:
            given_up.set()
            raise
    return [one.result() for one in made]
