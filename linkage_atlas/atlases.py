"""Atlas files: load one, build one, and what is in it."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

from linkage_atlas.answers import AtlasType
from synthesis.atlas import table
from synthesis.atlas.file import load_atlas as load_table
from synthesis.atlas.scan import Scan
from synthesis.errors import FieldError
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import family
from synthesis.fourbar.mechanism import ROCKER
from synthesis.work import Work


class Atlas:
    """A verified atlas in memory: the dimension types of a rule, and the scan of them, prepared when first needed.

    Parameters
    ----------
    stored : synthesis.atlas.table.Atlas
    threads : int, optional
        Threads of a scan; default: one a core.
    """

    def __init__(self, stored: table.Atlas, threads: int | None = None) -> None:
        self.stored = stored
        self._threads = threads or os.cpu_count() or 1
        self._rocker_scan: Scan | None = None
        self._rocker_lock = Lock()

    def __len__(self) -> int:
        return len(self.stored)

    @cached_property
    def scan(self) -> Scan:
        """The types prepared for matching."""
        return Scan(self.stored, threads=self._threads)

    @cached_property
    def content_sha256(self) -> str:
        """Hash of what it holds, however it is packed."""
        return self.stored.content_hash()

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
                lengths = self.stored.lengths.astype(float)
                rockers = table.make_table(ROCKER, lengths, self.stored.samples)
                self._rocker_scan = Scan(rockers, threads=self._threads)
            return self._rocker_scan

    def prepare(self, positions: bool = True, work: Work | None = None, threads: int | None = None) -> None:
        """Prepare the scan now, also for requests with positions, as far as the work's time allows.

        Afterwards it scans on so many ``threads``, if that is given.
        """
        scan = self.scan
        if threads is not None:
            scan.threads = threads
        if positions:
            scan.prepare_positions(work or Work())

    def type_of(self, row: int) -> AtlasType:
        """The type of a row, counted from 0."""
        return AtlasType(row + 1, [int(length) for length in self.stored.lengths[row]])

    def details_of(self, number: int) -> dict[str, Any]:
        """A type by its number, from 1: lengths, family and stored features of its coupler rotation over the whole turn."""
        if not 1 <= number <= len(self):
            raise FieldError("/number", f"there is no type {number}: the atlas has types 1 to {len(self)}")
        stored, row = self.stored, number - 1
        return {
            "number": number,
            "lengths": stored.lengths[row].tolist(),
            "family": str(family(stored.lengths[row])),
            "samples": stored.rule.samples,
            "winding": int(stored.winding[row]),
            "normalisation": "mean",
            "unit": "rad",
            "average": float(stored.average[row]),
            "details": stored.details[row].tolist(),
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


def load_atlas(path: str | Path, max_bytes: int | None = None, max_types: int | None = None) -> Atlas:
    """The verified atlas of a file.

    Parameters
    ----------
    path : str or Path
    max_bytes, max_types : int, optional
        Refuse a larger one before it is read.

    Raises
    ------
    AtlasError
        Missing, larger than allowed, damaged or foreign.
    """
    limits = {} if max_types is None else {"max_types": max_types}
    return Atlas(load_table(Path(path), max_bytes, **limits))


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
        return Atlas(build(rule, Path(path), executor, progress))
