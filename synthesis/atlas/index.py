"""The index of an atlas file: what its scan needs, prepared once and kept in files that processes map and share.

Files of `prepared`: cells with the table itself, made when the scan is first wanted; beside it the series for positions
(``.positions``), made when those are first wanted, and the indexes of short spans (``.spans``) and of paths (``.paths``), made
when they are asked for.
All name the SHA-256 of the atlas file and the code that made them.
Where they cannot be written everything is prepared in memory; where a page turns out damaged they are removed and made
anew from the atlas file, and whatever was being answered is answered again.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.atlas.cells import Cells, Level
from synthesis.atlas.path_storeys import PATH_STOREYS, build_path_storey
from synthesis.atlas.preparation import Key, Kind, Preparation, Progress, all_cells, all_phasors
from synthesis.atlas.prepared import Prepared, Writer, log, make_prepared, open_prepared
from synthesis.atlas.series import COLUMNS, PHASOR_COLUMNS, Bucket, New, Phasors
from synthesis.atlas.stored import DamagedError
from synthesis.atlas.storeys import STOREYS, Storey, StoreyIndex, build_storey
from synthesis.atlas.table import COLUMNS as TABLE_COLUMNS
from synthesis.atlas.table import Atlas, AtlasRule, Table
from synthesis.atlas.trees import Arrays
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.mechanism import Mechanism
from synthesis.work import Work

_POSITIONS = ".positions"
_SPANS = ".spans"
_PATHS = ".paths"
_MOST_RENEWED = 3
"""Times that a process makes an index anew: a disk that damages every file is not waited for."""


class _OutOfTime(Exception):
    """A request's time was up before the series for positions were there."""


@cache
def code_version() -> dict[str, str]:
    """What computes the arrays: the package's version, and a digest of the code beneath them."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*here.glob("*.py"), *here.parent.glob("fourbar/[km]*.py")]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return {"linkage-atlas": version("linkage-atlas"), "numpy": np.__version__, "code": digest.hexdigest()}


class Index:
    """The files of one table.

    Parameters
    ----------
    place : Path
        Of the first file; the one for positions lies beside it.
    source : str
        What the table comes from: the SHA-256 of the atlas file.
    mechanism : Mechanism
    load : callable
        The table itself, where it is needed to make the files.
    kind : Kind
    progress : callable
        ``progress(done, total)`` while cells are made.
    stamp : tuple of int
        Of the atlas file, which is kept with what is made from it, see `knows_source`.
    """

    def __init__(
        self,
        place: Path,
        source: str,
        mechanism: Mechanism,
        load: Callable[[], Table],
        kind: Kind,
        progress: Progress = lambda done, total: None,
        stamp: tuple[int, ...] = (),
    ) -> None:
        self.place, self.kind, self.load, self.progress, self.stamp = place, kind, load, progress, stamp
        self._mechanism = mechanism
        self._key: dict[str, Any] = {
            "atlas": source,
            "body": type(mechanism).__name__,
            "series": list(kind),
            **code_version(),
        }
        self._files: list[Prepared] = []

    def _beside(self, ending: str) -> Path:
        return self.place.with_name(self.place.name + ending)

    def beside(self, name: str, mechanism: Mechanism, load: Callable[[], Table]) -> Index:
        """Of another table from the same source, in a file beside this one."""
        place = self.place.with_name(f"{self.place.name}.{name}")
        return Index(place, self._key["atlas"], mechanism, load, self.kind)

    def opened(self, threads: int) -> IndexedPreparation | None:
        """Of the files that are there; None where there are none of this table."""
        file = open_prepared(self.place, self._key)
        return None if file is None else IndexedPreparation(self, *self._mapped(file), threads)

    def _mapped(self, file: Prepared) -> tuple[Table, list[Cells]]:
        self._files.append(file)
        return self._table_of(file), _cells_of(file)

    def prepared(self, table: Table, threads: int) -> IndexedPreparation:
        """Of the files, which are made first where there are none of this table."""
        return IndexedPreparation(self, *self.make(table, threads), threads)

    def make(self, table: Table, threads: int = 1) -> tuple[Table, list[Cells]]:
        """The table and its cells, mapped; made first where there is no file of them, in memory where none can be written."""

        def fill(writer: Writer) -> dict[str, Any]:
            for name in TABLE_COLUMNS:
                writer.put(f"table.{name}", np.asarray(getattr(table, name)))
            made = all_cells(table, self.kind, threads, _namer(writer), self.place.parent, self.progress)
            buckets = [(one.bucket.winding, one.bucket.harmonics, len(one.levels)) for one in made]
            return {"buckets": buckets, "stamp": self.stamp, **_about(table)}

        try:
            return self._mapped(make_prepared(self.place, self._key, fill))
        except OSError as error:
            log.warning("no index is written, everything is prepared in memory: %s", error)
            return self.make_in_memory(table, threads)

    def make_in_memory(self, table: Table, threads: int = 1) -> tuple[Table, list[Cells]]:
        """The table and its cells without files."""
        return table, list(all_cells(table, self.kind, threads, progress=self.progress))

    def positions(self, table: Table, cells: list[Cells], threads: int, work: Work) -> list[Phasors]:
        """The series for positions, mapped; none where the work's time ran out."""

        def go_on() -> None:
            if work.expired():
                raise _OutOfTime

        def fill(writer: Writer) -> dict[str, Any]:
            made = all_phasors(table, cells, threads, work, _namer(writer))
            if len(made) < len(cells):
                raise _OutOfTime
            return {"reach": [phasors.reach for phasors in made]}

        if not self._files:  # the cells are in memory
            return all_phasors(table, cells, threads, work)
        try:
            file = make_prepared(self._beside(_POSITIONS), self._key, fill, go_on)
        except _OutOfTime:
            return []
        except OSError as error:
            log.warning("series for positions are prepared in memory: %s", error)
            return all_phasors(table, cells, threads, work)
        self._files.append(file)
        return [
            Phasors(reach, **{name: file.arrays[f"{_bucket_name(one.bucket)}.{name}"] for name in PHASOR_COLUMNS})
            for one, reach in zip(cells, file.about["reach"])
        ]

    @property
    def knows_source(self) -> bool:
        """Whether the open file was made from an atlas file of this size and time of writing, which was compared then."""
        return bool(self._files) and tuple(self._files[0].about["stamp"]) == self.stamp

    @property
    def paths(self) -> list[Path]:
        """The files that are open; none where everything is in memory."""
        return [file.path for file in self._files]

    def short_spans(self, cells: list[Cells], work: Work) -> list[StoreyIndex] | None:
        """The index of windows of short spans, mapped, see `storeys`; None where no file of it can be written.

        Raises
        ------
        OutOfTime
        """
        buckets = [one.bucket for one in cells]

        def build(storey: Storey, new: New, folder: Path) -> Arrays:
            return build_storey(storey, buckets, new, folder, work.go_on)

        return self._made(_SPANS, STOREYS, build, work)

    def shapes(self, cells: list[Cells], phasors: list[Phasors], work: Work) -> list[StoreyIndex] | None:
        """The index of shapes of paths, mapped, see `path_storeys`; None where no file of it can be written.

        Raises
        ------
        OutOfTime
        """
        buckets = [one.bucket for one in cells]

        def build(storey: Storey, new: New, folder: Path) -> Arrays:
            return build_path_storey(storey, buckets, phasors, new, folder, work.go_on)

        return self._made(_PATHS, PATH_STOREYS, build, work)

    def known_short_spans(self) -> list[StoreyIndex]:
        """The same where it has been made before, and none otherwise."""
        return self._known(_SPANS, STOREYS)

    def known_paths(self) -> list[StoreyIndex]:
        """The same where it has been made before, and none otherwise."""
        return self._known(_PATHS, PATH_STOREYS)

    def _made(
        self, ending: str, storeys: Sequence[Storey], build: Callable[[Storey, New, Path], Arrays], work: Work
    ) -> list[StoreyIndex] | None:
        """Storeys, mapped from the file of an ending, which is made first; None where none can be written."""

        def fill(writer: Writer) -> dict[str, Any]:
            for number, storey in enumerate(storeys):
                build(storey, partial(_new_of, writer, str(number)), self.place.parent)
            return {}

        if not self._files:  # the cells are in memory
            return None
        try:
            return self._storeys_of(make_prepared(self._beside(ending), self._key, fill, work.go_on), storeys)
        except OSError as error:
            log.warning("no index of windows (%s) is written: %s", ending, error)
            return None

    def _known(self, ending: str, storeys: Sequence[Storey]) -> list[StoreyIndex]:
        file = open_prepared(self._beside(ending), self._key) if self._files else None
        if file is None:
            return []
        try:
            return self._storeys_of(file, storeys)
        except DamagedError as damage:
            log.warning("an index of windows (%s) is left alone: %s", ending, damage)
            self._files.remove(file)
            file.drop()
            return []

    def _storeys_of(self, file: Prepared, storeys: Sequence[Storey]) -> list[StoreyIndex]:
        self._files.append(file)
        parts = [(name.partition("."), values) for name, values in file.arrays.items()]
        return [
            StoreyIndex(storey, {name: values for (number, _, name), values in parts if number == str(k)})
            for k, storey in enumerate(storeys)
        ]

    def drop(self) -> None:
        """Remove the files that are open."""
        for file in self._files:
            file.drop()
        self._files.clear()

    def _table_of(self, file: Prepared) -> Table:
        columns: dict[str, Any] = {name: file.arrays[f"table.{name}"] for name in TABLE_COLUMNS}
        if "rule" not in file.about:
            return Table(mechanism=self._mechanism, **columns)
        rule = file.about["rule"]
        types = TypeRule(rule["perimeter"], rule["smallest"], OrderRule(rule["order"]))
        known = {name: file.about[name] for name in ("generator", "schema", "known_hash")}
        return Atlas(rule=AtlasRule(types, rule["samples"]), **known, **columns)


def _about(table: Table) -> dict[str, Any]:
    """What there is to know of a table beside its arrays."""
    if not isinstance(table, Atlas):
        return {}
    return {
        "rule": table.rule.as_json(),
        "generator": table.generator,
        "schema": table.schema,
        "known_hash": table.content_hash(),
    }


def _bucket_name(bucket: Bucket) -> str:
    return f"{bucket.winding}.{bucket.harmonics}"


def _new_of(writer: Writer, group: str, name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """An array of a group in a file."""
    return writer.new(f"{group}.{name}", dtype, shape)


def _namer(writer: Writer) -> Callable[[Key], New]:
    """Where the arrays of a bucket lie in a file."""
    return lambda key: partial(_new_of, writer, f"{key[0]}.{key[1]}")


def _cells_of(file: Prepared) -> list[Cells]:
    """The cells of a file."""
    found = []
    for winding, harmonics, levels in file.about["buckets"]:
        bucket = partial(_bucket_of, file, winding, harmonics)
        own = partial("{}.{}.level{}.{}".format, winding, harmonics)
        coarse_to_fine = [
            Level(bucket(f"level{k}."), file.arrays[own(k, "bounds")], file.arrays[own(k, "largest")])
            for k in reversed(range(levels))
        ]
        found.append(Cells(bucket(), file.arrays[f"{winding}.{harmonics}.first"], coarse_to_fine))
    return found


def _bucket_of(file: Prepared, winding: int, harmonics: int, prefix: str = "") -> Bucket:
    columns: dict[str, Any] = {name: file.arrays[f"{winding}.{harmonics}.{prefix}{name}"] for name in COLUMNS}
    return Bucket(winding=winding, harmonics=harmonics, **columns)


class IndexedPreparation(Preparation):
    """Cells and position series in the files of an index.

    Parameters
    ----------
    index : Index
    table, cells : Table, list of Cells
        As the index opened or made them.
    threads : int
        Threads of the preparation.
    """

    def __init__(self, index: Index, table: Table, cells: list[Cells], threads: int = 1) -> None:
        self.index = index
        self.kind, self.threads = index.kind, threads
        self.phasors = []
        self._lock, self._storeys_lock = threading.Lock(), threading.Lock()
        self.table, self.cells = table, cells
        self._renewed = 0
        self.storeys = index.known_short_spans()
        self.path_storeys = index.known_paths()

    def _positions(self, work: Work) -> list[Phasors]:
        return self.index.positions(self.table, self.cells, self.threads, work)

    def _short_spans(self, work: Work) -> list[StoreyIndex]:
        made = self.index.short_spans(self.cells, work)
        return super()._short_spans(work) if made is None else made

    def _paths(self, work: Work) -> list[StoreyIndex]:
        made = self.index.shapes(self.cells, self.phasors, work)
        return super()._paths(work) if made is None else made

    def renew(self, seen: list[Cells], damage: DamagedError) -> None:
        """Make the files anew from the atlas, unless that has been done since ``seen`` were the cells."""
        with self._lock:
            if self.cells is not seen:
                return
            self._renewed += 1
            self.index.drop()
            table = self.index.load()
            if self._renewed <= _MOST_RENEWED:
                log.warning("the index is made anew: %s", damage)
                self.table, self.cells = self.index.make(table, self.threads)
            else:
                log.warning("the index is damaged again and again, everything is prepared in memory: %s", damage)
                self.table, self.cells = self.index.make_in_memory(table, self.threads)
            self.phasors, self.storeys, self.path_storeys = [], [], []
