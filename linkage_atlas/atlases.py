"""Atlas files: load one, build one, and what is in it."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from linkage_atlas.answers import AtlasType
from synthesis.atlas import table
from synthesis.atlas.header import MAX_TYPES, Stamp, file_hash
from synthesis.atlas.index import Index
from synthesis.atlas.preparation import Preparation
from synthesis.atlas.prepared import temporary
from synthesis.atlas.scan import KIND, Scan
from synthesis.errors import AtlasError, AtlasFault, FieldError
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import family
from synthesis.fourbar.mechanism import FOURBAR, ROCKER
from synthesis.work import OutOfTime, Work


class Atlas:
    """A verified atlas: the dimension types of a rule, and the scan of them, prepared when first needed.

    Parameters
    ----------
    stored : synthesis.atlas.table.Atlas
    threads : int, optional
        Threads of a scan; default: one a core.
    index : synthesis.atlas.index.Index, optional
        Prepare the scan in its files; default: in memory.
    prepared : synthesis.atlas.preparation.Preparation, optional
        What the index holds, where it has been opened.
    """

    def __init__(
        self,
        stored: table.Atlas,
        threads: int | None = None,
        index: Index | None = None,
        prepared: Preparation | None = None,
    ) -> None:
        self._stored: table.Atlas | None = stored
        self._threads = threads or os.cpu_count() or 1
        self._index, self._prepared = index, prepared
        self._lock, self._rocker_lock = Lock(), Lock()
        self._rocker_scan: Scan | None = None

    @property
    def stored(self) -> table.Atlas:
        """Its arrays; those of an index are mapped, and checked as they are used."""
        found: Any = self._stored if self._prepared is None else self._prepared.table
        return found

    def __len__(self) -> int:
        return len(self.stored)

    @cached_property
    def scan(self) -> Scan:
        """The types prepared for matching."""
        with self._lock:
            if self._prepared is None:
                self._prepared = self._prepare(self._index, self.stored)
            self._stored = None  # what is mapped needs no memory
            return Scan(self._prepared, threads=self._threads)

    def _prepare(self, index: Index | None, types: table.Table) -> Preparation:
        return index.prepared(types, self._threads) if index else Preparation(types, KIND, self._threads)

    @cached_property
    def content_sha256(self) -> str:
        """Hash of what it holds, however it is packed."""
        return self.stored.content_hash()

    @property
    def index_files(self) -> list[Path]:
        """Files of the index that are in use."""
        return self._index.paths if self._index else []

    @property
    def has_positions(self) -> bool:
        """Whether the scan is prepared for requests with positions."""
        return self.scan.prepare_positions(Work(0.0))

    @property
    def has_rocker_scan(self) -> bool:
        """Whether `rocker_scan` is there already."""
        return self._rocker_scan is not None

    @property
    def rocker_scan(self) -> Scan:
        """The same types prepared for matching their rockers' curves, which the first that asks computes (some seconds)."""
        with self._rocker_lock:
            if self._rocker_scan is None:
                index = self._index and self._index.beside("rocker", ROCKER, self._rockers)
                prepared = index and index.opened(self._threads)
                self._rocker_scan = Scan(prepared or self._prepare(index, self._rockers()), threads=self._threads)
            return self._rocker_scan

    def _rockers(self) -> table.Table:
        stored = self.stored
        return table.make_table(ROCKER, self.scan.lengths, stored.samples)

    def prepare(
        self,
        positions: bool = True,
        work: Work | None = None,
        threads: int | None = None,
        short_spans: bool = True,
    ) -> None:
        """Prepare the scan now, also its indexes of windows and the series for positions, as far as the work's time allows.

        Without them it answers too: short spans and positions without rotation more slowly, and the first request with positions
        makes their series.
        Afterwards it scans on so many ``threads``, if that is given.
        """
        work = work or Work()
        scan = self.scan
        if threads is not None:
            scan.threads = threads
        if short_spans:
            with suppress(OutOfTime):
                scan.prepare_short_spans(work)
        if positions and scan.prepare_positions(work) and short_spans:
            with suppress(OutOfTime):
                scan.prepare_paths(work)

    def type_of(self, row: int) -> AtlasType:
        """The type of a row, counted from 0."""
        return AtlasType(row + 1, self._intact(lambda: np.asarray(self.stored.lengths[row]).tolist()))

    def _intact(self, read: Callable[[], Any]) -> Any:
        """What is read of the stored arrays; where the index turns out damaged, from the one that is made anew."""
        return read() if self._prepared is None else self.scan.intact(read)

    def details_of(self, number: int) -> dict[str, Any]:
        """A type by its number, from 1: lengths, family and stored features of its coupler rotation over the whole turn."""
        if not 1 <= number <= len(self):
            raise FieldError("/number", f"there is no type {number}: the atlas has types 1 to {len(self)}")
        return self._intact(lambda: self._details(number - 1))

    def _details(self, row: int) -> dict[str, Any]:
        stored = self.stored
        lengths = np.asarray(stored.lengths[row])
        return {
            "number": row + 1,
            "lengths": lengths.tolist(),
            "family": str(family(lengths)),
            "samples": stored.rule.samples,
            "winding": int(stored.winding[row]),
            "normalisation": "mean",
            "unit": "rad",
            "average": float(stored.average[row]),
            "details": np.asarray(stored.details[row]).tolist(),
        }

    def describe(self) -> dict[str, Any]:
        """What it holds, as plain values."""
        return {
            "types": len(self),
            "schema_version": self.stored.schema,
            "content_sha256": self.content_sha256,
            "parameters": self.stored.rule.as_json(),
            "generator": self.stored.generator,
        }

    def __repr__(self) -> str:
        rule = ", ".join(f"{name} {value}" for name, value in self.stored.rule.as_json().items())
        return f"Atlas({len(self):,} types: {rule})"


def load_atlas(
    path: str | Path,
    max_bytes: int | None = None,
    max_types: int | None = None,
    *,
    index: str | Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Atlas:
    """The verified atlas of a file.

    Parameters
    ----------
    path : str or Path
    max_bytes, max_types : int, optional
        Refuse a larger one before it is read.
    index : str or Path, optional
        A file for what its scan needs, as large as the atlas several times: made when the scan is first wanted, and whenever it
        is not of this atlas and this version. Later processes map it, so they start at once and share its memory.
    progress : callable
        ``progress(done, total)`` while the index is made.

    Raises
    ------
    AtlasError
        Missing, larger than allowed, damaged or foreign.
    """
    most = MAX_TYPES if max_types is None else max_types

    def read(*where: Any) -> table.Atlas:
        from synthesis.atlas.file import load_atlas as load_table  # HDF5, which an index spares

        return load_table(Path(path), max_bytes, most, *where)

    if index is None:
        return Atlas(read())
    files: Any = None
    prepared: Preparation | None = None

    def load() -> table.Atlas:
        with suppress(OSError):  # where there is no place for an index, it is prepared in memory
            return read(digest, temporary(Path(index).parent))
        return read(digest)

    def known(claimed: str, stamp: Stamp) -> bool:
        nonlocal files, prepared
        files = Index(Path(index), claimed, FOURBAR, load, KIND, progress, stamp)
        prepared = files.opened(os.cpu_count() or 1)
        return prepared is not None and files.knows_source

    digest = file_hash(Path(path), max_bytes, known)
    if prepared is not None and len(prepared.table) > most:
        raise AtlasError(AtlasFault.LIMIT, f"{len(prepared.table)} types, at most {most}")
    if prepared is not None:
        mapped: Any = prepared.table
        return Atlas(mapped, index=files, prepared=prepared)
    return Atlas(load(), index=files)


def build_atlas(
    path: str | Path,
    perimeter: int = 400,
    smallest: int = 2,
    order: str = "increasing",
    samples: int = 256,
    *,
    jobs: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Atlas:
    """Enumerate the dimension types of a rule, compute their features and write the atlas file.

    Parameters
    ----------
    path : str or Path
        Written whole or not at all; an interrupted build goes on from where it was.
    perimeter : int
        Sum of the four whole lengths.
    smallest : int
        Smallest length of the shortest link.
    order : {"increasing", "crank_shortest", "full_crank"}
    samples : int
        Samples of a curve over the turn, a power of two.
    jobs : int, optional
        Processes; default: one a core. (More than one needs a script that can be imported, as all Python processes do.)
    progress : callable
        ``progress(done, total)`` after each shard.

    Returns
    -------
    Atlas
    """
    from data_build.batch import build_atlas as build
    from data_build.executors import local_executor

    orders = [rule.value for rule in OrderRule]
    if order not in orders:
        raise FieldError("/order", f"wanted one of {', '.join(orders)}, found {order!r}")
    rule = table.AtlasRule(TypeRule(perimeter, smallest, OrderRule(order)), samples)
    with local_executor(jobs or os.cpu_count() or 1) as executor:
        build(rule, Path(path), executor, progress)
    return load_atlas(path)
