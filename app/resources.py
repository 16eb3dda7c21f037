"""What answers need beyond their request: the atlas, loaded once when it is needed, and a watch over their time."""

from __future__ import annotations

import ctypes
import gc
import sys
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from app.query import build_models
from app.settings import Settings
from linkage_atlas.cache import open_atlas


def opened(place: Path, settings: Settings) -> la.Atlas:
    """The atlas of a file, as far as the settings allow, with its index if that is set."""
    limits = {"max_bytes": settings.atlas_max_bytes, "max_types": settings.atlas_max_types}
    return open_atlas(place, settings.index, **limits)


_TAKES_MEMORY = 50
"""Rows of a matrix that is large enough for it."""


class Unprepared(Exception):
    """What an answer needs is not there, and is not to be made by the process that answers; the message names it."""


class ServiceResources:
    """Loads what is asked for, once: a scene's request never loads the atlas."""

    def __init__(
        self, settings: Settings, find_atlas: Callable[[Settings], Path] = lambda settings: settings.atlas
    ) -> None:
        self.settings = settings
        self._find_atlas = find_atlas
        self.max_budget_ms = settings.max_budget_ms
        self.failure: la.AtlasError | None = None
        self.load_seconds = 0.0
        self.complete = False
        """Whether this process answers one request at a time, with what is there: what is missing raises `Unprepared`."""
        # Several requests at a time, each with small matrices: threads inside a product would only wait for each other.
        import numpy  # noqa: F401  # for only a library that is loaded is limited

        self._blas = threadpool_limits(1, "blas")

    @cached_property
    def atlas(self) -> la.Atlas:
        """The atlas, loaded and verified. Raises AtlasError: the one that `prepare` met, if it met one, without reading again."""
        if self.failure is not None:
            raise self.failure
        if not self.settings.with_atlas:
            raise la.AtlasError(la.AtlasFault.NOT_WANTED, "--no-atlas; searching needs none")
        place = self._find_atlas(self.settings)
        begin = time.perf_counter()
        atlas = opened(place, self.settings)
        # Prepared by all cores; a scan is of one request among several, and its budget is one of processor time too.
        atlas.prepare(positions=False, threads=1, short_spans=False)
        self.load_seconds = time.perf_counter() - begin
        return atlas

    def need_rockers(self) -> None:
        """Where a scan of rockers is needed: made when first needed, unless the resources are `complete`."""
        if self.complete and not self.atlas.has_rocker_scan:
            raise Unprepared("rockers")

    def need_positions(self) -> None:
        """The same where series for positions are needed, and none are made in the background."""
        awaited = self.settings.prepare_positions and self.wants_more
        if self.complete and self.settings.with_atlas and not awaited and not self.atlas.has_positions:
            raise Unprepared("positions")

    def describe_atlas(self) -> dict[str, Any]:
        """What is loaded, as plain JSON values."""
        atlas = self.atlas
        return {**atlas.describe(), "scan_bytes": atlas.scan.nbytes, "load_ms": 1000 * self.load_seconds}

    def work(self, budget: float | None = None, cancelled: Callable[[], bool] | None = None) -> la.Work:
        """A watch over the time of an answer, in seconds, and over whether it is still wanted."""
        return la.Work(budget, cancelled, processor_clock() if self.complete else time.perf_counter)

    def load(self) -> None:
        """Load the atlas now; one that cannot be used is remembered as the `failure` and not raised."""
        try:
            if self.settings.with_atlas:
                _ = self.atlas.content_sha256
        except la.AtlasError as error:
            self.failure = error
        give_back_memory()
        gc.freeze()  # what is loaded stays: looking through it again and again would hold up everyone

    def prepare(self) -> None:
        """Load what a match needs now; everything where no `prepare_more` follows."""
        self.load()
        if self.wants_more:
            _ = la.match
        else:
            self.prepare_rest()

    def prepare_rest(self) -> None:
        """Have now what the first answer of each kind would else import or make: searches, their tables, models."""
        import scipy.interpolate  # noqa: F401 - the first spline would

        self._blas = threadpool_limits(1, "blas")  # scipy has a library of its own
        build_models()
        la.prepare()
        give_back_memory()
        gc.freeze()

    @property
    def wants_more(self) -> bool:
        """Whether there is an atlas, of which more is to be prepared once the service is ready."""
        return self.settings.with_atlas and self.failure is None

    def prepare_more(self, cancelled: Callable[[], bool]) -> bool:
        """Prepare the scan for short spans, and for positions if that is set, where it `wants_more`.

        Returns false if cancelled.
        """
        if self.wants_more:
            try:
                self.atlas.prepare(positions=self.settings.prepare_positions, work=la.Work(cancelled=cancelled))
            except la.Cancelled:
                return False
            give_back_memory()
        return True


def processor_clock() -> Callable[[], float]:
    """A clock of this process's processor time, so that an answer is as good on a busy machine; but at least half the time."""
    processor, passed = time.process_time(), time.perf_counter()
    return lambda: max(time.process_time() - processor, (time.perf_counter() - passed) / 2)


def take_working_memory() -> None:
    """Have the libraries of linear algebra map their working memory now, 34 MB each, of which little is used.

    Each does so at its first call, and waits for it forever where the process may not have it.
    """
    np.linalg.qr(np.ones((_TAKES_MEMORY, _TAKES_MEMORY)))
    if linalg := sys.modules.get("scipy.linalg"):  # imported with what all processes share, or not at all yet
        linalg.lapack.dgbsv(1, 1, np.ones((4, 3)), np.ones(3))


_given_back = 0.0


def give_back_memory(every: float = 0.0) -> None:
    """Return to the system what has been freed, unless that was done less than ``every`` seconds ago.

    glibc keeps it otherwise, after preparing about 130 MB with the default atlas.
    """
    global _given_back
    now = time.monotonic()
    if now - _given_back < every:
        return
    _given_back = now
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # other C libraries have no such function
        return
    trim(0)
