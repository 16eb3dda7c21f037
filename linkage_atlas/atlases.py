"""Atlases: where the default one is, opened from a file or built, and prepared for scanning when that is first needed."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Any

from linkage_atlas.answers import AtlasType
from linkage_atlas.notes import counted
from synthesis.atlas import table
from synthesis.atlas.header import MAX_TYPES, Stamp, file_hash
from synthesis.atlas.index import Index, InMemory, Unread, remove_damaged, temporary_arrays
from synthesis.atlas.preparation import CELLS, Preparation, Progress, types_of
from synthesis.atlas.scan import KIND, Scan
from synthesis.errors import AtlasError, AtlasFault, FieldError
from synthesis.fourbar.kinematics import family
from synthesis.fourbar.mechanism import FOURBAR, ROCKER
from synthesis.work import OutOfTime, Work

SLIDER_CRANK = "slider_crank"
MECHANISMS = (FOURBAR.kind, SLIDER_CRANK)
"""Kinds of mechanisms that there are atlases of."""


class Atlas:
    """A verified atlas: the dimension types of a rule, and the scan of them, prepared when first needed.

    Parameters
    ----------
    stored : synthesis.atlas.table.Atlas
    threads : int, optional
        Threads of a scan; default: one a core.
    source : AtlasSource or MadeSource, optional
        Where it comes from; default: ``stored``, all of it in memory.
    cells : bool
        False scans all windows of all types; the answers are the same.
    """

    def __init__(
        self,
        stored: table.AtlasTypes,
        threads: int | None = None,
        source: AtlasSource | MadeSource | None = None,
        cells: bool = True,
    ) -> None:
        self.stored = stored
        """Its types; with all of their rotations where they are in memory."""
        self._threads = threads or os.cpu_count() or 1
        self._source = source
        self._kind = KIND._replace(cells=cells)
        self._lock, self._rocker_lock = Lock(), Lock()
        self._rocker_scan: Scan | None = None

    def __len__(self) -> int:
        return len(self.stored)

    @property
    def kind(self) -> str:
        """What its types are of: "four_bar" or "slider_crank"."""
        return self.stored.mechanism.kind

    @cached_property
    def scan(self) -> Scan:
        """The types prepared for matching."""
        with self._lock:
            index = self._source.index if self._source else None
            progress = self._source.progress if self._source else _quietly
            prepared = Preparation(self.stored.mechanism, self._table, self._kind, self._threads, index, progress)
            if self.index_files:  # what is mapped needs no memory
                mapped: Any = prepared.types
                self.stored = mapped
            return Scan(prepared, threads=self._threads)

    def _table(self) -> table.Atlas:
        """All of its arrays."""
        if isinstance(self.stored, table.Atlas):
            return self.stored
        assert self._source is not None
        return self._source.load()

    @cached_property
    def content_sha256(self) -> str:
        """Hash of what it holds, however it is packed."""
        return self.stored.known_hash or self._table().content_hash()

    @property
    def index_files(self) -> list[Path]:
        """Folders of the index that are in use."""
        return self._source.index.folders if self._source else []

    def has(self, part: str) -> bool:
        """Whether a part of the index is there, made by this process or by another.

        One of "positions", "short_spans", "rockers", and "slider_cranks": an atlas of those beside this one.
        """
        if part == "slider_cranks":
            return self.slider_cranks.is_prepared
        if part == "rockers":
            return self._rocker_scan is not None or bool(self._rocker_parts and self._rocker_parts.known(CELLS))
        return self.scan.prepared.has(part)

    def make(self, part: str, work: Work | None = None) -> None:
        """Make a part of the index now, unless it is there.

        Raises `OutOfTime` or `Cancelled`.
        """
        work = work or Work()
        if part == "slider_cranks":
            _ = self.slider_cranks.scan
        elif part == "rockers":
            _ = self.rocker_scan
        elif part == "positions":
            self.scan.prepare_positions(work)
        else:
            self.scan.prepare_short_spans(work)

    def drop_damaged(self) -> None:
        """Remove the parts of its index that are not what was written: whoever opens the atlas next makes them anew."""
        if isinstance(self._source, AtlasSource):
            remove_damaged(self._source.index.folder)

    def plain(self) -> Atlas:
        """The same atlas without its index, a file of which cannot be read: its scan, on one thread, looks at every window."""
        if not isinstance(self._source, AtlasSource):
            return self
        index = self._source.index
        source = replace(self._source, index=Unread(index.folder, index.source))
        return Atlas(source.load(), 1, source, cells=False)

    @property
    def rocker_scan(self) -> Scan:
        """The same types prepared for matching their rockers' curves, which the first that asks computes (some seconds).

        Only of four-bars.
        """
        with self._rocker_lock:
            if self._rocker_scan is None:
                prepared = Preparation(ROCKER, self._rockers, self._kind, self._threads, self._rocker_parts)
                self._rocker_scan = Scan(prepared, threads=self._threads)
            return self._rocker_scan

    @cached_property
    def _rocker_parts(self) -> Index | None:
        index = self._source.index if self._source else None
        return index.beside("rocker_") if isinstance(index, Index) else None

    def _rockers(self) -> table.Table:
        return table.make_table(ROCKER, self.scan.lengths, self.stored.rule.samples)

    @property
    def is_prepared(self) -> bool:
        """Whether its scan needs nothing but to be opened."""
        return "scan" in vars(self) or bool(self._source and self._source.index.known(CELLS))

    @cached_property
    def slider_cranks(self) -> Atlas:
        """An atlas of slider-cranks to match beside this one: itself if it is one, else that of the default rule.

        Its scan is prepared by the first that asks, some two seconds, in this atlas's index if that has one.
        """
        if self.kind == SLIDER_CRANK:
            return self
        return slider_cranks(self._source.index if self._source else None, self._threads)

    def of(self, kind: str) -> Atlas:
        """The atlas of a kind, one of `MECHANISMS`: this one, or the one beside it.

        Raises `FieldError`: there is none.
        """
        if kind == self.kind:
            return self
        if kind == SLIDER_CRANK:
            return self.slider_cranks
        raise FieldError("/mechanisms", f"the atlas that is loaded is of kind {self.kind}, not {kind}")

    def prepare(
        self,
        positions: bool = True,
        work: Work | None = None,
        threads: int | None = None,
        short_spans: bool = True,
    ) -> None:
        """Prepare the scan now, also its index of short spans and the series for positions, as far as the work's time allows.

        Without them it answers too: short spans more slowly, and the first request with positions makes their series.
        Afterwards it scans on so many ``threads``, if that is given.
        """
        work = work or Work()
        scan = self.scan
        if threads is not None:
            scan.threads = threads
        if short_spans:
            with suppress(OutOfTime):
                scan.prepare_short_spans(work)
        if positions:
            scan.prepare_positions(work)

    def type_of(self, row: int) -> AtlasType:
        """The type of a row, counted from 0."""
        return AtlasType(row + 1, self.stored.lengths[row].tolist())

    def details_of(self, number: int) -> dict[str, Any]:
        """A type by its number, from 1: lengths, family and stored features of its coupler rotation over the whole turn."""
        if not 1 <= number <= len(self):
            raise FieldError("/number", f"there is no type {number}: the atlas has types 1 to {len(self)}")
        stored, row = self.stored, number - 1
        if self._source is None:
            rows = table.AtlasRows(*(getattr(stored, name)[row : row + 1] for name in table.AtlasRows._fields))
        else:  # not from the index, a file of which may be damaged while it is mapped
            rows = self._source.rows(row)
        lengths = stored.rule.lengths(row, row + 1)[0]
        return {
            "kind": self.kind,
            "number": number,
            "lengths": lengths.tolist(),
            "family": str(family(lengths)) if self.kind == FOURBAR.kind else None,
            "samples": stored.rule.samples,
            "winding": int(rows.winding[0]),
            "normalisation": "mean",
            "unit": "rad",
            "average": float(rows.average[0]),
            "details": rows.details[0].tolist(),
        }

    def describe(self) -> dict[str, Any]:
        """What it holds, as plain values."""
        return {
            "kind": self.kind,
            "types": len(self),
            "schema_version": self.stored.schema,
            "content_sha256": self.content_sha256,
            "parameters": self.stored.rule.as_json(),
            "generator": self.stored.generator,
        }

    def __repr__(self) -> str:
        rule = ", ".join(f"{name} {value}" for name, value in self.stored.rule.as_json().items())
        return f"Atlas({counted(len(self), 'type')}: {rule})"


def _quietly(done: int, total: int) -> None:
    """Shows no progress."""


@dataclass(frozen=True)
class MadeSource:
    """An atlas that no file holds: its rows are computed where they are asked for."""

    rule: table.AtlasRule
    index: InMemory
    progress: Progress = _quietly

    def load(self) -> table.Atlas:
        """All of its arrays."""
        return table.atlas_of_rule(self.rule)

    def rows(self, row: int) -> table.AtlasRows:
        """One row."""
        return table.compute_rows(self.rule.lengths(row, row + 1), self.rule.samples, self.rule.kind.mechanism)


def slider_cranks(beside: Index | InMemory | None = None, threads: int | None = None) -> Atlas:
    """The atlas of slider-cranks of the default rule, its scan kept in an index, with a prefix, if there is one to lie in."""
    rule = table.AtlasRule.of(SLIDER_CRANK)
    index: InMemory = InMemory()
    if isinstance(beside, Index):
        named = " ".join(f"{name} {value}" for name, value in rule.as_json().items())
        index = beside.beside("slider_crank_", named)
    return Atlas(table.types_of_rule(rule), threads, MadeSource(rule, index))


@dataclass(frozen=True)
class AtlasSource:
    """An atlas file that has been verified, and its index.

    ``sha256``: in its header. ``limits``: most bytes, most types. ``progress``: ``progress(done, total)`` while the
    index is made.
    """

    path: Path
    sha256: str
    limits: tuple[int | None, int]
    index: Index
    progress: Progress

    def load(self) -> table.Atlas:
        """All of its arrays: in temporary files beside the index, or in memory where none can be written."""
        from synthesis.atlas.file import load_atlas as load_table  # HDF5, which an index spares

        with suppress(OSError):
            return load_table(self.path, *self.limits, self.sha256, temporary_arrays(self.index.folder.parent))
        return load_table(self.path, *self.limits, self.sha256)

    def rows(self, row: int) -> table.AtlasRows:
        """One row."""
        from synthesis.atlas.file import load_row

        return load_row(self.path, self.sha256, row)


def load_atlas(
    path: str | Path,
    max_bytes: int | None = None,
    max_types: int | None = None,
    *,
    index: str | Path | None = None,
    progress: Progress = _quietly,
) -> Atlas:
    """The verified atlas of a file.

    Parameters
    ----------
    path : str or Path
    max_bytes, max_types : int, optional
        Refuse a larger one before it is read.
    index : str or Path, optional
        A folder for what its scan needs, as large as the atlas several times: made when the scan is first wanted, and whenever it
        is not of this atlas and this version. Later processes map it, so they start at once and share its memory.
    progress : callable
        ``progress(done, total)`` while the index is made.

    Raises
    ------
    AtlasError
        Missing, larger than allowed, damaged or foreign.
    """
    path, most = Path(path), MAX_TYPES if max_types is None else max_types
    if index is None:
        from synthesis.atlas.file import load_atlas as load_table

        return Atlas(load_table(path, max_bytes, most))
    source: Any = None
    types: Any = None

    def known(claimed: str, stamp: Stamp) -> bool:
        nonlocal source, types
        source = AtlasSource(path, claimed, (max_bytes, most), Index(Path(index), claimed, stamp), progress)
        part = source.index.known(CELLS)
        types = part and types_of(part, FOURBAR)
        return part is not None and source.index.knows_source

    file_hash(path, max_bytes, known)
    if types is None:
        return Atlas(source.load(), source=source)
    if len(types) > most:
        raise AtlasError(AtlasFault.LIMIT, f"{len(types)} types, at most {most}")
    return Atlas(types, source=source)


def build_atlas(
    path: str | Path,
    perimeter: int | None = None,
    smallest: int | None = None,
    order: str | None = None,
    samples: int | None = None,
    *,
    kind: str = "four_bar",
    jobs: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Atlas:
    """Enumerate the dimension types of a rule, compute their features and write the atlas file.

    Parameters
    ----------
    path : str or Path
        Written whole or not at all; an interrupted build goes on from where it was.
    perimeter : int, optional
        Sum of the whole lengths of a type; default: 400 of the four of four-bars, 640 of crank, rod and offset.
    smallest : int, optional
        Smallest length of the shortest link, of slider-cranks of the crank; default: 2.
    order : {"increasing", "crank_shortest", "full_crank"}, optional
        Of four-bars.
    samples : int, optional
        Samples of a curve over the turn, a power of two; default: 256.
    kind : {"four_bar", "slider_crank"}
        Of slider-cranks all whose crank turns fully, crank + offset < rod, mirror images once.
    jobs : int, optional
        Processes; default: one a core. (More than one needs a script that can be imported, as all Python processes do.)
    progress : callable
        ``progress(done, total)`` after each shard.

    Returns
    -------
    Atlas
    """
    from data_build.batch import build_atlas as build
    from data_build.batch import local_executor

    rule = table.AtlasRule.of(kind, perimeter, smallest, order, samples)
    with local_executor(jobs or os.cpu_count() or 1) as executor:
        build(rule, Path(path), executor, progress)
    return load_atlas(path)


# -- the one that nobody named: here, or in the user's cache folder; it and its index are each made once -----------------

HERE = Path("atlas.h5")


def _folder() -> Path:
    from platformdirs import user_cache_path

    return user_cache_path("linkage-atlas", appauthor=False)


def cached_atlas() -> Path:
    """The default atlas in the user's cache folder, which need not be there yet.

    Its name says the version: another one may make other rows.
    """
    return _folder() / f"atlas-{version('linkage-atlas')}.h5"


def find_atlas(here: Path = HERE, jobs: int | None = None) -> Path:
    """The atlas of this folder, or else the default one, which is built by so many processes first if it must be."""
    if here.exists():
        return here
    place = cached_atlas()
    if not place.exists():
        import fcntl

        place.parent.mkdir(parents=True, exist_ok=True)
        with place.with_suffix(".lock").open("w") as lock:  # a second command waits for the first one's atlas
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not place.exists():
                print(f"no atlas here: building the default one (once, some seconds) as {place}", file=sys.stderr)
                build_atlas(place, jobs=jobs, progress=_Bar("atlas", "shard"))
    return place


@cache
def default_atlas() -> Atlas:
    """The atlas that `find_atlas` finds, opened once.

    It is built by one process: more need a script that can be imported.
    """
    return open_atlas(find_atlas(jobs=1))


@cache
def default_slider_cranks() -> Atlas:
    """The default atlas of slider-cranks, its scan kept beside the default atlas, which it does not need."""
    place = index_of(HERE if HERE.exists() else cached_atlas())
    with suppress(OSError):  # then it is prepared in memory
        place.parent.mkdir(parents=True, exist_ok=True)
    return slider_cranks(Index(place, ""))


def index_of(atlas: Path) -> Path:
    """The file of an atlas's index: beside it, or in the user's cache folder where there is none and none can be written."""
    beside = atlas.with_name(atlas.name + ".index")
    if beside.exists() or os.access(beside.parent, os.W_OK):
        return beside
    name = hashlib.sha256(os.fsencode(atlas.resolve())).hexdigest()[:16]
    return _folder() / f"{atlas.name}-{name}.index"


def open_atlas(atlas: Path, index: bool = True, **limits: Any) -> Atlas:
    """The atlas of a file, its scan in an ``index`` if that is wanted, which is made, with a bar, when the scan is first wanted.

    ``limits`` are those of `linkage_atlas.load_atlas`.
    """
    if not index:
        return load_atlas(atlas, **limits)
    place = index_of(atlas)
    if place.parent != atlas.parent:
        with suppress(OSError):  # then everything is prepared in memory
            place.parent.mkdir(parents=True, exist_ok=True)
    return load_atlas(atlas, **limits, index=place, progress=_Bar("index", "types"))


class _Bar:
    """A bar on the terminal, from the first part to the last."""

    def __init__(self, what: str, unit: str) -> None:
        self._what, self._unit = what, unit
        self._bar: Any = None

    def __call__(self, done: int, total: int) -> None:
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                total=total, disable=None, unit=self._unit, desc=self._what, file=sys.stderr, unit_scale=True
            )
        self._bar.update(done - self._bar.n)
        if done >= total:
            self._bar.close()
            self._bar = None
