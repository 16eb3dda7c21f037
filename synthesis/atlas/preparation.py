"""What a scan needs of a table, computed once: cells of its types, series for positions, and the index of short spans."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor, wait
from functools import partial
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event, Lock
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.atlas.cells import (
    COLUMNS,
    PHASOR_COLUMNS,
    PREPARED_AT_ONCE,
    Cells,
    GroupKey,
    Level,
    New,
    Phasors,
    SeriesGroup,
    make_cells,
    phasor_harmonics,
    prepare,
    prepare_phasors,
)
from synthesis.atlas.index import InMemory, Part
from synthesis.atlas.table import AtlasTypes, Table, Types
from synthesis.atlas.window_index import INTERVALS, WindowIndex, build_window_index
from synthesis.mechanism import Turning
from synthesis.work import OutOfTime, Work

CELLS, POSITIONS, SHORT_SPANS = "cells", "positions", "short_spans"
"""Names of the parts, see `index`."""
MOST_IN_MEMORY = 1 << 19
"""Types up to which the index of short spans is made in memory, where no file of it can be written: 1.7 kB for each."""
_PATIENCE = 0.01
"""Seconds between two looks at whether an answer is still wanted."""

Progress = Callable[[int, int], None]


class Kind(NamedTuple):
    """Which series a scan holds, see `scan.Scan`."""

    series_error: float
    harmonics: tuple[int, ...]
    cells: bool = True


class Preparation:
    """Cells, position series and the index of short spans of a table.

    ``load``: the table, where something is to be made of it. ``threads``: threads of the preparation. ``parts``: where
    they are kept. ``progress``: ``progress(done, total)`` while cells are made.

    ``types``: `AtlasTypes` where the table is an atlas. ``phasors``: Those of each group of the cells; empty until they
    are prepared. ``short_spans``: empty until they are prepared.
    """

    def __init__(
        self,
        mechanism: Turning,
        load: Callable[[], Table],
        kind: Kind,
        threads: int = 1,
        parts: InMemory | None = None,
        progress: Progress = lambda done, total: None,
    ) -> None:
        self.threads = threads
        self._load, self._kind, self._parts, self._progress = load, kind, parts or InMemory(), progress
        self._positions_lock, self._short_spans_lock = Lock(), Lock()
        part = self._parts.part(CELLS, self._fill_cells)
        self.types = types_of(part, mechanism)
        self.cells = _cells_of(part)
        self.phasors: list[Phasors] = []
        self.short_spans = _short_spans_of(self._parts.known(SHORT_SPANS))

    @property
    def nbytes(self) -> int:
        """Bytes of the series and cells, wherever they are."""
        arrays = [value for cells in self.cells for value in vars(cells.group).values()]
        arrays += [value for phasors in self.phasors for value in vars(phasors).values()]
        own = sum(value.nbytes for value in arrays if hasattr(value, "nbytes"))
        own += sum(cells.nbytes for cells in self.cells)
        own += sum(index.nbytes for index in self.short_spans)
        return len(self.types) * 32 + own

    def has(self, part: str) -> bool:
        """Whether `POSITIONS` or `SHORT_SPANS` are there; what another process has made meanwhile is taken up."""
        if part == POSITIONS:
            return self.prepare_positions(Work(0.0))
        self.short_spans = self.short_spans or _short_spans_of(self._parts.known(SHORT_SPANS))
        return bool(self.short_spans)

    def prepare_positions(self, work: Work) -> bool:
        """Make the series that requests with positions need; done by the first of them otherwise.

        Whether they are there; false where the work's time ran out, also while another thread was making them.
        """
        if self.phasors:
            return True
        while not self._positions_lock.acquire(timeout=_PATIENCE):
            if work.expired():
                return False
        try:
            if not self.phasors:  # else another thread has made them meanwhile
                part = self._parts.known(POSITIONS)
                if part is None:
                    work.go_on()
                    part = self._parts.part(POSITIONS, partial(self._fill_positions, work), work.go_on)
                self.phasors = [_phasors_of(part, cells.group.key) for cells in self.cells]
        except OutOfTime:
            return False
        finally:
            self._positions_lock.release()
        return True

    def prepare_short_spans(self, work: Work) -> None:
        """Make the index of windows that answers short spans sooner; without it the cells answer them.

        Raises `OutOfTime`.
        """
        with self._short_spans_lock:
            if not self.short_spans:
                part = self._parts.part(SHORT_SPANS, partial(self._fill_short_spans, work), work.go_on)
                self.short_spans = _short_spans_of(part)

    # -- making -------------------------------------------------------------------------------------------------------

    def _fill_cells(self, new: New, folder: Path | None) -> dict[str, Any]:
        table = self._load()
        for name, values in (("lengths", table.lengths), ("winding", table.winding)):
            new(name, values.dtype, values.shape)[...] = values
        collected: dict[GroupKey, _Collected] = {}
        total, done = 2 * len(table), 0  # each type counts when it has its series and again in its cells
        with ThreadPoolExecutor(self.threads) as pool:
            starts = range(0, len(table), PREPARED_AT_ONCE)
            for groups in _ahead(pool, partial(self._series, table), list(starts), 4 * self.threads):
                for group in groups:
                    if group.key not in collected:
                        collected[group.key] = _Collected(group, folder)
                    collected[group.key].add(group)
                    done += len(group.rows)
                self._progress(done, total)

            def cells_of(key: GroupKey) -> Cells:
                group, own = collected.pop(key).joined(), partial(_new_of, new, _prefix(key))
                if self._kind.cells:
                    return make_cells(group, own)
                count = len(group.rows)
                own("first", np.int64, (2,))[...] = 0, count
                return Cells(group.copy(np.arange(count), own), np.array([0, count]), [])

            told = []
            for cells in pool.map(cells_of, sorted(collected)):
                told.append([*cells.group.key, len(cells.levels)])
                done += len(cells.group.rows)
                self._progress(done, total)
        return {**(table.as_json() if isinstance(table, AtlasTypes) else {}), "groups": told}

    def _series(self, table: Table, first: int) -> list[SeriesGroup]:
        rows = np.arange(first, min(first + PREPARED_AT_ONCE, len(table)))
        return list(prepare(table, rows, self._kind.series_error, self._kind.harmonics))

    def _fill_positions(self, work: Work, new: New, folder: Path | None) -> dict[str, Any]:
        table, given_up = self._load(), Event()
        with ThreadPoolExecutor(self.threads) as pool:
            made = [
                pool.submit(
                    prepare_phasors, table, cells.group, given_up, partial(_new_of, new, _prefix(cells.group.key))
                )
                for cells in self.cells
            ]
            try:
                while made and wait(made, _PATIENCE).not_done:
                    work.go_on()
            except BaseException:
                given_up.set()
                raise
        for one in made:
            one.result()
        return {}

    def _fill_short_spans(self, work: Work, new: New, folder: Path | None) -> dict[str, Any]:
        if folder is None and len(self.types) > MOST_IN_MEMORY:
            return {}
        groups = [cells.group for cells in self.cells]
        for number, intervals in enumerate(INTERVALS):
            build_window_index(intervals, groups, partial(_new_of, new, f"{number}."), folder, work.go_on)
        return {}


def _new_of(new: New, prefix: str, name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
    return new(prefix + name, dtype, shape)


def _prefix(key: GroupKey) -> str:
    return f"winding{key.winding}_harmonics{key.harmonics}."


def _ahead(pool: Executor, work: Callable[[Any], Any], parts: list[Any], most: int) -> Iterator[Any]:
    """The results for all parts in order, never more than ``most`` of them computed ahead."""
    running = [pool.submit(work, part) for part in parts[:most]]
    for k in range(len(parts)):
        yield running[k % most].result()
        if k + most < len(parts):
            running[k % most] = pool.submit(work, parts[k + most])


class _Collected:
    """The series of a group while they are computed: in memory, or in temporary files that vanish with the process."""

    def __init__(self, first: SeriesGroup, folder: Path | None) -> None:
        self._first = first
        self._files: dict[str, IO[bytes]] = {
            name: BytesIO() if folder is None else TemporaryFile(dir=folder) for name in COLUMNS
        }

    def add(self, part: SeriesGroup) -> None:
        for name, file in self._files.items():
            file.write(np.ascontiguousarray(getattr(part, name)).data)

    def joined(self) -> SeriesGroup:
        columns: dict[str, Any] = {}
        for name, file in self._files.items():
            first = getattr(self._first, name)
            if isinstance(file, BytesIO):
                values = np.frombuffer(file.getbuffer(), first.dtype)
            else:
                file.flush()
                values = np.asarray(np.memmap(file, first.dtype, "r"))
                file.close()
            columns[name] = values.reshape(-1, *first.shape[1:])
        return SeriesGroup(self._first.key, **columns)


# -- opening -----------------------------------------------------------------------------------------------------------


def types_of(part: Part, mechanism: Turning) -> Types:
    """The types that cells are of: `AtlasTypes`, of its own mechanism, where they are those of an atlas."""
    columns: dict[str, Any] = {"lengths": part.arrays["lengths"], "winding": part.arrays["winding"]}
    if "rule" not in part.about:
        return Types(mechanism=mechanism, **columns)
    return AtlasTypes.from_json(part.about, **columns)


def _cells_of(part: Part) -> list[Cells]:
    found = []
    for winding, harmonics, levels in part.about["groups"]:
        key = GroupKey(winding, harmonics)
        own = {
            name.removeprefix(_prefix(key)): values
            for name, values in part.arrays.items()
            if name.startswith(_prefix(key))
        }
        coarse_to_fine = [
            Level(_group_of(key, own, f"level{k}."), own[f"level{k}.bounds"], own[f"level{k}.largest"])
            for k in reversed(range(levels))
        ]
        found.append(Cells(_group_of(key, own), own["first"], coarse_to_fine))
    return found


def _group_of(key: GroupKey, arrays: dict[str, NDArray[Any]], prefix: str = "") -> SeriesGroup:
    return SeriesGroup(key, *(arrays[prefix + name] for name in COLUMNS))


def _phasors_of(part: Part, key: GroupKey) -> Phasors:
    return Phasors(phasor_harmonics(key), *(part.arrays[_prefix(key) + name] for name in PHASOR_COLUMNS))


def _short_spans_of(part: Part | None) -> list[WindowIndex]:
    if part is None or not part.arrays:
        return []
    return [
        WindowIndex(
            intervals,
            {name[2:]: values for name, values in part.arrays.items() if name.startswith(f"{number}.")},
        )
        for number, intervals in enumerate(INTERVALS)
    ]
